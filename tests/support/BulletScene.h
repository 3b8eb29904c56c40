#pragma once
#include <btBulletDynamicsCommon.h>
#include <jacket/bullet/ShellWorld.h>

#include <algorithm>
#include <memory>
#include <vector>

namespace jacket::bullet::testing {

/// A Bullet world with shells, torn down in order.
struct BulletScene {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
    std::vector<std::unique_ptr<btCollisionShape>> shapes;
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    std::unique_ptr<ShellWorld> shells = std::make_unique<ShellWorld>(world);

    explicit BulletScene(double gravity = -9.81) { world.setGravity(btVector3(0, btScalar(gravity), 0)); }
    ~BulletScene() {
        shells.reset();
        for (const auto& body : bodies) world.removeRigidBody(body.get());
    }

    btRigidBody& addBody(std::unique_ptr<btCollisionShape> shape, double mass, const btVector3& position) {
        btVector3 inertia(0, 0, 0);
        if (mass > 0) shape->calculateLocalInertia(btScalar(mass), inertia);
        bodies.push_back(std::make_unique<btRigidBody>(btScalar(mass), nullptr, shape.get(), inertia));
        shapes.push_back(std::move(shape));
        btTransform pose = btTransform::getIdentity();
        pose.setOrigin(position);
        bodies.back()->setWorldTransform(pose);
        bodies.back()->setInterpolationWorldTransform(pose);
        world.addRigidBody(bodies.back().get());
        return *bodies.back();
    }
    btRigidBody& addSphere(double radius, double mass, const btVector3& position) {
        return addBody(std::make_unique<btSphereShape>(btScalar(radius)), mass, position);
    }
    void remove(btRigidBody& body) {
        world.removeRigidBody(&body);
        std::erase_if(bodies, [&](const auto& b) { return b.get() == &body; });
    }
    /// One step of exactly h.
    void step(double h) { world.stepSimulation(btScalar(h), 0); }
    void run(double seconds, double h) {
        for (int i = 0; i < int(seconds / h + 0.5); ++i) step(h);
    }
};

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

inline Vec3 toVec3(const btVector3& v) {
    return {double(v.x()), double(v.y()), double(v.z())};
}

/// Deepest that a vertex, edge midpoint or centroid of the shell stands inside a ball [m].
inline double penetration(const ShellBody& sheet, const Vec3& centre, double radius) {
    const Points& x = sheet.shell().positions();
    double nearest = radius;
    const auto look = [&](const Vec3& p) { nearest = std::min(nearest, (p - centre).norm()); };
    for (int i = 0; i < x.cols(); ++i) look(x.col(i));
    for (const auto& e : sheet.shell().mesh().edges()) look(0.5 * (x.col(e.v0) + x.col(e.v1)));
    for (int t = 0; t < sheet.triangles().cols(); ++t) {
        const auto c = sheet.triangles().col(t);
        look((x.col(c[0]) + x.col(c[1]) + x.col(c[2])) / 3.0);
    }
    return radius - nearest;
}

/// Relative accuracy that can be asked of what Bullet stores.
constexpr double bulletTolerance(double inDouble, double inFloat) {
    return sizeof(btScalar) == 8 ? inDouble : inFloat;
}

}  // namespace jacket::bullet::testing
