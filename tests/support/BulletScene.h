#pragma once
#include <jacket/testing.h>

namespace jacket::bullet::testing {

using BulletScene = jacket::testing::Scene<>;
using jacket::testing::penetration;
using jacket::testing::toVec3;

constexpr double kStep = 1.0 / 60;  ///< [s] what most tests step by

/// Cloth of 0.3 kg/m^2, E t = 1e4 N/m, nu = 0.3, D = 1e-4 N m.
inline ShellMaterial trampolineCloth() {
    ShellMaterial m{.young = 3.03e7, .poisson = 0.3, .thickness = 3.3e-4, .density = 909.0};
    m.stretchStiffnessOverride = 1e4;
    m.bendingStiffnessOverride = 1e-4;
    m.areaDensityOverride = 0.3;
    return m;
}

inline TriangleMesh squareSheet(double side, int cells) {
    return makeGrid({.size = {side, side}, .cells = {cells, cells}});
}

inline void pinBorder(ShellBody& sheet) {
    for (int i = 0; i < sheet.vertexCount(); ++i)
        if (sheet.shell().mesh().isBorderVertex(i)) sheet.pin(i);
}

/// A body that its user moves from now on, by its pose or its motion state.
inline void makeKinematic(btRigidBody& body) {
    body.setCollisionFlags(body.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    body.setActivationState(DISABLE_DEACTIVATION);
}

/// Deepest that a vertex, edge midpoint or centroid of the shell stands inside a ball [m].
inline double penetration(const ShellBody& sheet, const Vec3& centre, double radius) {
    const btVector3 origin{btScalar(centre.x()), btScalar(centre.y()), btScalar(centre.z())};
    return penetration(sheet, btSphereShape(btScalar(radius)), btTransform(btQuaternion::getIdentity(), origin));
}

/// Relative accuracy that can be asked of what Bullet stores.
constexpr double bulletTolerance(double inDouble, double inFloat) {
    return sizeof(btScalar) == 8 ? inDouble : inFloat;
}

}  // namespace jacket::bullet::testing
