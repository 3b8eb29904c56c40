#pragma once
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "support/BulletScene.h"
#include "support/SheetOutcome.h"
#include "support/Target.h"

/// Bodies that their user moves against a sheet of 80 cm for 4 s, starting and stopping at once: tests run some of them
/// from a few starts, kinematic_bench all.
namespace jacket::bullet::testing {

inline std::unique_ptr<btCollisionShape> makeBlock() {
    return std::make_unique<btBoxShape>(btVector3(btScalar(0.1), btScalar(0.05), btScalar(0.1)));
}
/// The same as triangles.
inline std::unique_ptr<btCollisionShape> makeBlockMesh() {
    static const auto mesh = boxMesh(btVector3(btScalar(0.1), btScalar(0.05), btScalar(0.1)));
    return std::make_unique<btBvhTriangleMeshShape>(mesh.get(), true);
}

struct Pusher {
    const char* name;
    double halfHeight;  ///< [m]
    std::unique_ptr<btCollisionShape> (*make)();
    std::unique_ptr<btCollisionShape> (*surface)() = make;  ///< by which depth is measured
};

inline constexpr Pusher kPushers[] = {
    {"ball", 0.08,
     []() -> std::unique_ptr<btCollisionShape> { return std::make_unique<btSphereShape>(btScalar(0.08)); }},
    {"box", 0.05, makeBlock},
    {"mesh", 0.05, makeBlockMesh, makeBlock},
    {"capsule", 0.04,
     []() -> std::unique_ptr<btCollisionShape> {
         return std::make_unique<btCapsuleShapeX>(btScalar(0.04), btScalar(0.2));
     }},
    {"disc", 0.04,
     []() -> std::unique_ptr<btCollisionShape> {
         return std::make_unique<btCylinderShape>(btVector3(btScalar(0.12), btScalar(0.04), btScalar(0.12)));
     }},
    {"rod", 0.05, []() -> std::unique_ptr<btCollisionShape> {
         return std::make_unique<btCylinderShapeZ>(btVector3(btScalar(0.05), btScalar(0.05), btScalar(0.3)));
     }}};

/// How a body is moved, and how the sheet is held that it meets.
struct Course {
    const char* name;
    btTransform (*pose)(double time, double halfHeight);  ///< [s], of the body [m]
    double height;                                        ///< of the sheet at the start [m]
    bool isPinned = false;                                ///< by its border
    bool isOnShelves = false;                             ///< by two of its edges
};

/// At up to 0.75 m/s.
namespace courses {

inline btTransform at(double x, double y, const btQuaternion& turn = btQuaternion::getIdentity()) {
    return btTransform(turn, btVector3(btScalar(x), btScalar(y), btScalar(0.02)));
}
inline btTransform pressDown(double t, double half) {
    return at(0.03, 0.54 + half - 0.15 * std::min({t, 1.0, std::max(0.0, 3.0 - t)}));
}
inline btTransform lift(double t, double half) {
    return at(0.03, 0.3 - half + std::min(0.5 * std::max(t - 0.2, 0.0), 0.7));
}
inline btTransform shake(double t, double) {
    return at(t < 1.0 || t > 3.0 ? 0.0 : 0.1 * std::sin(2.0 * std::numbers::pi * (t - 1.0)), 0.4);
}
inline btTransform turn(double t, double) {
    return at(0.0, 0.4, btQuaternion(btVector3(0, 1, 0), btScalar(2.0 * std::clamp(t - 0.5, 0.0, 2.5))));
}
inline btTransform push(double t, double half) {
    return at(-0.6 + std::min(0.3 * t, 0.9), half + 5e-3);
}
inline btTransform spin(double t, double) {
    const btQuaternion turn(btVector3(0, 0, 1), btScalar(6.0 * std::min(t, 3.0)));
    return at(0.03, std::min(0.38 + 0.05 * t, 0.45), turn);
}

inline constexpr Course kPress{"pressed down on a pinned sheet", pressDown, 0.5, true};
inline constexpr Course kLift{"lifts a sheet off shelves", lift, 0.403, false, true};
inline constexpr Course kShake{"shaken under a sheet", shake, 0.52};
inline constexpr Course kTurn{"turned under a sheet", turn, 0.52};
inline constexpr Course kPush{"pushed over a sheet on a floor", push, 3e-3};
inline constexpr Course kSpin{"spins under a pinned sheet", spin, 0.5, true};

}  // namespace courses

struct KinematicScene {
    ShellMaterial material;
    const Course& course;
    const Pusher& pusher;
    int cells;                  ///< of the sheet's side
    double h;                   ///< [s]
    Vec3 aside = Vec3::Zero();  ///< by which the body's way is beside the course's [m]

    SheetOutcome run() const {
        constexpr double kSide = 0.8, kSeconds = 4.0;  // [m], [s]
        BulletScene scene;
        scene.addFloor();
        for (const double side : {-0.35, 0.35})
            if (course.isOnShelves)
                scene.addBox(btVector3(btScalar(0.05), btScalar(0.2), btScalar(0.6)), 0.0,
                             btVector3(btScalar(side), btScalar(0.2), 0));
        TriangleMesh mesh = squareSheet(kSide, cells);
        mesh.positions.row(1).array() += course.height;
        auto& sheet = scene.shells->add(mesh, material, {.friction = 0.5});
        if (course.isPinned) pinBorder(sheet);
        auto& body = scene.addBody(pusher.make(), 0.0, pose(0.0).getOrigin());
        makeKinematic(body);
        const auto surface = pusher.surface();
        SheetOutcome outcome;
        for (double t = h; t < kSeconds; t += h) {
            body.setWorldTransform(pose(t));
            scene.step(h);
            outcome.note(scene, sheet,
                         std::max(penetration(sheet, *surface, body.getWorldTransform()),
                                  -sheet.shell().positions().row(1).minCoeff()));  // or in the floor
        }
        return outcome;
    }

  private:
    btTransform pose(double time) const {
        btTransform result = course.pose(time, pusher.halfHeight);
        result.getOrigin() += btVector3(btScalar(aside.x()), btScalar(aside.y()), btScalar(aside.z()));
        return result;
    }
};

}  // namespace jacket::bullet::testing
