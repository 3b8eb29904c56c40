#pragma once
#include <cmath>
#include <numbers>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {

/// A plane that falls off by 20 degrees towards +x, with a sheet that lies on it as far above as contact keeps it.
struct Incline : BulletScene {
    static constexpr double kGravity = 9.81;                          // [m/s^2]
    static constexpr double kTilt = 20.0 * std::numbers::pi / 180.0;  // its tangent is 0.364
    const Vec3 normal{std::sin(kTilt), std::cos(kTilt), 0}, downhill{std::cos(kTilt), -std::sin(kTilt), 0};
    btRigidBody& plane;
    ShellBody& sheet;

    /// `side` [m].
    Incline(double friction, double side, int cells, const ShellMaterial& material = trampolineCloth())
        : plane(addBody(std::make_unique<btStaticPlaneShape>(toBullet(normal), btScalar(0)), 0, btVector3(0, 0, 0))),
          sheet(shells->add(lying(side, cells, material), material, {.friction = friction, .sleeping = false})) {
        plane.setFriction(1);
    }
    static btVector3 toBullet(const Vec3& v) { return {btScalar(v.x()), btScalar(v.y()), btScalar(v.z())}; }
    double place() const { return downhill.dot(sheet.shell().positions().rowwise().mean()); }
    double speed() const { return downhill.dot(sheet.shell().velocities().rowwise().mean()); }

    /// Along the plane of a sheet that slides, by Coulomb's law [m/s^2].
    static double accelerationByCoulomb(double friction) {
        return kGravity * (std::sin(kTilt) - friction * std::cos(kTilt));
    }
    /// Most that a sheet that sticks may creep [m/s].
    static double mostCreep(double side) { return 1e-4 * std::sqrt(kGravity * side); }

  private:
    TriangleMesh lying(double side, int cells, const ShellMaterial& material) const {
        TriangleMesh mesh = squareSheet(side, cells);
        const Mat3 turn = Eigen::AngleAxisd(-kTilt, Vec3::UnitZ()).toRotationMatrix();
        mesh.positions = (turn * mesh.positions).colwise() + (0.5 * material.thickness + 5e-6) * normal;
        return mesh;
    }
};

}  // namespace jacket::bullet::testing
