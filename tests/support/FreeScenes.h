#pragma once
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "support/HardScenes.h"
#include "support/SheetOutcome.h"

namespace jacket::bullet::testing {

/// A sheet of 1.2 m among bodies that move freely: tests run some, free_bench all.
struct FreeScene {
    struct Run : SheetRun {
        int iterations = 0;
        double lowest = 1e300;  ///< where a body's centre is at the end [m]
    };

    const char* name;
    double lasts;    ///< [s]
    double fastest;  ///< a vertex that moves faster was thrown [m/s]
    std::function<ShellBody&(BulletScene&, const ShellMaterial&, int cells, const Vec3& aside, Bodies&)> make;

    /// From one of several starts, which a few millimetres tell apart.
    Run run(const ShellMaterial& material, int cells, int start, double h = kStep) const {
        BulletScene scene;
        scene.addFloor();
        Bodies bodies;
        auto& sheet = make(scene, material, cells, {0.007 * start, 0.0, 0.005 * (start % 3)}, bodies);
        Run run;
        for (double t = 0.0; t < lasts; t += h) {
            run.step(scene, sheet, h, [&] { return deepestIn(bodies, sheet); });
            run.iterations += scene.shells->lastStep().pcgIterations;
        }
        for (const btRigidBody* body : bodies)
            run.lowest = std::min(run.lowest, double(body->getWorldTransform().getOrigin().y()));
        return run;
    }
};

namespace free_scenes {

constexpr double kSide = 1.2;  ///< of the sheets [m]

inline ShellBody& addSheet(BulletScene& scene, const ShellMaterial& material, int cells, const Vec3& at) {
    auto& sheet = scene.shells->add(squareSheet(kSide, cells), material, {.friction = 0.5});
    place(sheet, at);
    return sheet;
}

inline btVector3 moved(double x, double y, double z, const Vec3& by) {
    return {btScalar(x + by.x()), btScalar(y + by.y()), btScalar(z + by.z())};
}

inline FreeScene ballUnderCloth(const char* name, double mass) {
    return {name, 3.0, 6.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                bodies.push_back(&scene.addSphere(0.2, mass, btVector3(0, btScalar(0.2), 0)));
                return addSheet(scene, material, cells, Vec3(0.05, 0.45, 0.03) + aside);
            }};
}

inline FreeScene pileUnderCloth(const char* name, double mass) {
    return {name, 3.0, 6.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                constexpr btScalar half = btScalar(0.1);
                for (const auto& [x, y] : {std::pair{-0.21, 0.1}, {0.0, 0.1}, {0.21, 0.1}, {-0.1, 0.3}, {0.11, 0.3}})
                    bodies.push_back(
                        &scene.addBox(btVector3(half, half, half), mass, btVector3(btScalar(x), btScalar(y), 0)));
                return addSheet(scene, material, cells, Vec3(0.05, 0.55, 0.03) + aside);
            }};
}

inline FreeScene onTrampoline(const char* name, bool isBox, double mass) {
    return {name, 3.0, 6.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                constexpr btScalar half = btScalar(0.1);
                const btVector3 at = moved(0.03, 1.4, 0.05, aside);
                bodies.push_back(isBox ? &scene.addBox(btVector3(half, half, half), mass, at)
                                       : &scene.addSphere(half, mass, at));
                auto& sheet = addSheet(scene, material, cells, {0, 1, 0});
                pinBorder(sheet);
                return sheet;
            }};
}

inline FreeScene boxesInHammock(const char* name, double mass) {
    return {name, 3.0, 6.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                constexpr btScalar half = btScalar(0.07);
                for (int i = 0; i < 6; ++i) {
                    const btVector3 at = moved(-0.2 + 0.2 * (i % 3), 1.1 + 0.2 * (i / 3), 0.03 * i - 0.1, aside);
                    bodies.push_back(&scene.addBox(btVector3(half, half, half), mass, at));
                }
                auto& sheet = addSheet(scene, material, cells, {0, 1, 0});
                for (int i = 0; i < sheet.vertexCount(); ++i) {
                    const Vec3 x = sheet.shell().positions().col(i);
                    if (std::min(std::abs(x.x()), std::abs(x.z())) > 0.49 * kSide) sheet.pin(i);
                }
                return sheet;
            }};
}

inline FreeScene ballAtCurtain(const char* name, double mass) {
    return {name, 2.0, 12.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                bodies.push_back(&scene.addSphere(0.1, mass, moved(0.03, 1.3, -1.0, aside)));
                bodies.back()->setLinearVelocity(btVector3(0, 1, 6));
                TriangleMesh mesh = squareSheet(kSide, cells);
                for (int i = 0; i < mesh.positions.cols(); ++i)
                    mesh.positions.col(i) = Vec3(mesh.positions(0, i), 1.3 + mesh.positions(2, i), 0.0);
                auto& sheet = scene.shells->add(mesh, material, {.friction = 0.5});
                for (int i = 0; i < sheet.vertexCount(); ++i)
                    if (sheet.shell().positions()(1, i) > 1.3 + 0.49 * kSide) sheet.pin(i);
                return sheet;
            }};
}

inline FreeScene fallingTogether(const char* name, double mass) {
    return {name, 2.0, 6.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                constexpr btScalar half = btScalar(0.1);
                bodies.push_back(&scene.addBox(btVector3(half, half, half), mass, moved(0, 1.2, 0, aside)));
                return addSheet(scene, material, cells, {0, 0.8, 0});
            }};
}

/// A box that falls to the floor with a cloth on it.
inline FreeScene clothOnFallingBox(const char* name, double mass) {
    return {name, 1.5, 8.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                constexpr double half = 0.2, drop = 0.5;
                bodies.push_back(&scene.addBox(btVector3(btScalar(half), btScalar(half), btScalar(half)), mass,
                                               btVector3(0, btScalar(drop + half), 0)));
                return addSheet(scene, material, cells, Vec3(0.0, drop + 2.0 * half + 1e-4, 0.01) + aside);
            }};
}

/// On a slope of 20 degrees, where the crate stands and the cloth may slide.
inline FreeScene crateOnSlope(const char* name, double mass) {
    return {name, 2.0, 6.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                constexpr btScalar half = btScalar(0.15);
                scene.world.setGravity(btVector3(btScalar(3.36), btScalar(-9.22), 0));
                bodies.push_back(&scene.addBox(btVector3(half, half, half), mass, btVector3(0, half, 0)));
                bodies.back()->setFriction(2);  // times the floor's: 1
                return addSheet(scene, material, cells, Vec3(0.0, 0.42, 0.0) + aside);
            }};
}

/// A cylinder that rolls at 2 m/s under a falling cloth.
inline FreeScene clothOnRoller(const char* name, double mass) {
    return {name, 1.0, 8.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                constexpr double radius = 0.12, speed = 2.0;
                auto shape =
                    std::make_unique<btCylinderShapeZ>(btVector3(btScalar(radius), btScalar(radius), btScalar(0.3)));
                bodies.push_back(&scene.addBody(std::move(shape), mass, moved(-0.4, radius, 0.0, aside)));
                bodies.back()->setLinearVelocity(btVector3(btScalar(speed), 0, 0));
                bodies.back()->setAngularVelocity(btVector3(0, 0, btScalar(-speed / radius)));
                return addSheet(scene, material, cells, {0.0, 2.0 * radius + 0.02, 0.0});
            }};
}

/// A sheet that is tied to blocks, which stand under its corners, in the middle of their tops.
inline FreeScene tiedToBlocks(const char* name, double mass) {
    return {name, 3.0, 6.0,
            [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
                constexpr btScalar half = btScalar(0.05);
                auto& sheet = addSheet(scene, material, cells, Vec3(0.0, 2.0 * double(half), 0.0) + aside);
                for (const int corner : {0, cells, (cells + 1) * cells, (cells + 1) * (cells + 1) - 1}) {
                    const btVector3 at = sheet.positions()[corner] - btVector3(0, half, 0);
                    bodies.push_back(&scene.addBox(btVector3(half, half, half), mass, at));
                    sheet.anchor(corner, *bodies.back());
                }
                return sheet;
            }};
}

/// Planks that hang on each other and, at both ends, on the world.
inline FreeScene clothOnBridge(const char* name, double mass) {
    return {
        name, 2.0, 6.0, [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
            constexpr int kPlanks = 9;
            constexpr double kPitch = 0.1, kHalf = 0.05, kAside = 0.12;
            for (int i = 0; i < kPlanks; ++i)
                bodies.push_back(&scene.addBox(btVector3(btScalar(0.045), btScalar(0.01), btScalar(0.15)), mass,
                                               btVector3(btScalar(kPitch * (i - kPlanks / 2)), btScalar(0.8), 0)));
            for (const double z : {-kAside, kAside}) {
                const btVector3 left(btScalar(-kHalf), 0, btScalar(z)), right(btScalar(kHalf), 0, btScalar(z));
                scene.addJoint(std::make_unique<btPoint2PointConstraint>(*bodies.front(), left));
                scene.addJoint(std::make_unique<btPoint2PointConstraint>(*bodies.back(), right));
                for (int i = 1; i < kPlanks; ++i)
                    scene.addJoint(std::make_unique<btPoint2PointConstraint>(*bodies[i - 1], *bodies[i], right, left));
            }
            return addSheet(scene, material, cells, Vec3(0.05, 0.9, 0.03) + aside);
        }};
}

/// Holds two bodies together at a point of the world.
inline void joinAt(BulletScene& scene, btRigidBody& a, btRigidBody& b, const btVector3& at) {
    scene.addJoint(std::make_unique<btPoint2PointConstraint>(a, b, a.getWorldTransform().inverse() * at,
                                                             b.getWorldTransform().inverse() * at));
}

/// A figure that falls on its back, and a cloth on it.
inline FreeScene clothOnRagdoll(const char* name) {
    return {
        name, 3.0, 6.0, [=](auto& scene, auto& material, int cells, const Vec3& aside, Bodies& bodies) -> ShellBody& {
            constexpr double y = 0.5;
            const auto at = [](double x, double z) { return btVector3(btScalar(x), btScalar(y), btScalar(z)); };
            const auto limb = [&](auto shape, btRigidBody& on, const btVector3& joint, const btVector3& middle) {
                bodies.push_back(&scene.addBody(std::move(shape), 2.0, middle));
                joinAt(scene, on, *bodies.back(), joint);
                return bodies.back();
            };
            bodies.push_back(&scene.addBox(btVector3(btScalar(0.14), btScalar(0.08), btScalar(0.22)), 20.0, at(0, 0)));
            btRigidBody& torso = *bodies.back();
            limb(std::make_unique<btSphereShape>(btScalar(0.1)), torso, at(0, 0.25), at(0, 0.36));
            for (const double side : {-1.0, 1.0}) {
                const auto arm = [] { return std::make_unique<btCapsuleShapeX>(btScalar(0.05), btScalar(0.15)); };
                const auto leg = [] { return std::make_unique<btCapsuleShapeZ>(btScalar(0.06), btScalar(0.2)); };
                btRigidBody* upper = limb(arm(), torso, at(0.16 * side, 0.18), at(0.29 * side, 0.18));
                limb(arm(), *upper, at(0.42 * side, 0.18), at(0.55 * side, 0.18));
                upper = limb(leg(), torso, at(0.08 * side, -0.24), at(0.08 * side, -0.41));
                limb(leg(), *upper, at(0.08 * side, -0.58), at(0.08 * side, -0.75));
            }
            return addSheet(scene, material, cells, Vec3(0.05, y + 0.2, 0.03) + aside);
        }};
}

}  // namespace free_scenes
}  // namespace jacket::bullet::testing
