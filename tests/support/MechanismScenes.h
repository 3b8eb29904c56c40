#pragma once
#include <BulletDynamics/ConstraintSolver/btHingeConstraint.h>
#include <BulletDynamics/ConstraintSolver/btPoint2PointConstraint.h>
#include <BulletDynamics/ConstraintSolver/btSliderConstraint.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "support/UseScene.h"

/// Shells with bodies that joints hold, motors drive, or users move.
namespace jacket::bullet::testing::use_scenes {

inline const btQuaternion kAlongX(btVector3(0, 0, 1), SIMD_HALF_PI), kAlongZ(btVector3(1, 0, 0), SIMD_HALF_PI);

inline btVector3 localOf(const btRigidBody& body, const btVector3& at) {
    return body.getWorldTransform().inverse() * at;
}
inline void joinAt(BulletScene& scene, btRigidBody& a, btRigidBody& b, const btVector3& at) {
    scene.addJoint(std::make_unique<btPoint2PointConstraint>(a, b, localOf(a, at), localOf(b, at)));
}
inline void hangAt(BulletScene& scene, btRigidBody& body, const btVector3& at) {
    body.setActivationState(DISABLE_DEACTIVATION);
    scene.addJoint(std::make_unique<btPoint2PointConstraint>(body, localOf(body, at)));
}
/// Moves along z only, driven at `speed` by up to `force` [m/s, N].
inline void driveAlongZ(BulletScene& scene, btRigidBody& body, double speed, double force) {
    body.setActivationState(DISABLE_DEACTIVATION);
    const btQuaternion xToMinusZ(btVector3(0, 1, 0), -SIMD_HALF_PI);
    auto slider = std::make_unique<btSliderConstraint>(body, btTransform(xToMinusZ, btVector3(0, 0, 0)), false);
    slider->setPoweredLinMotor(true);
    slider->setTargetLinMotorVelocity(btScalar(-speed));
    slider->setMaxLinMotorForce(btScalar(force));
    slider->setLowerLinLimit(-10);
    slider->setUpperLinLimit(10);
    slider->setLowerAngLimit(0);
    slider->setUpperAngLimit(0);
    scene.addJoint(std::move(slider));
}

/// A block of 30 kg on a slider whose motor of 3 kN drives it into a sheet that hangs in front of a wall.
inline UseScene press(const char* name) {
    return {name, 1.5, 12.0, {"cotton", "rubber", "steel"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& wall = scene.addBox(vector(1, 1, 0.1), 0.0, vector(0, 1, 0.105));
                auto& sheet = scene.shells->add(upright(1.2, 1.2, 10 * fineness, 10 * fineness, {0, 1, 0}), material);
                pinWhere(sheet, [](const Vec3& x) { return x.y() > 1.599; });
                auto& block = scene.addBox(vector(0.3, 0.3, 0.1), 30.0, vector(0.02, 1, -0.6));
                driveAlongZ(scene, block, 1.0, 3000.0);
                return {sheet, {&wall, &block}};
            }};
}

/// Two of them, of 10 kg and 500 N, that close on a sheet from both sides.
inline UseScene vise(const char* name) {
    return {name, 2.0, 8.0, {"cotton", "rubber", "steel"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& sheet = scene.shells->add(upright(0.8, 0.8, 8 * fineness, 8 * fineness, {0, 1, 0}), material);
                pinWhere(sheet, [](const Vec3& x) { return x.y() > 1.399; });
                Bodies jaws;
                for (const double side : {-1.0, 1.0}) {
                    jaws.push_back(&scene.addBox(vector(0.19, 0.19, 0.05), 10.0, vector(0.01 * side, 1, 0.4 * side)));
                    driveAlongZ(scene, *jaws.back(), -0.5 * side, 500.0);
                }
                return {sheet, jaws};
            }};
}

/// A strip between two banks with planks of 2 kg anchored below it, and a character of 60 kg that walks over it.
inline UseScene ropeBridge(const char* name) {
    return {name, 3.0, 8.0, {"cotton", "denim", "leather"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& strip = scene.shells->add(
                    moved(makeGrid({.size = {3, 0.6}, .cells = {24 * fineness, 4 * fineness}}), {0, 1, 0}), material);
                pinWhere(strip, [](const Vec3& x) { return std::abs(x.x()) > 1.499; });
                Bodies bodies;
                for (int k = -5; k <= 5; ++k) {
                    auto& plank = scene.addBox(vector(0.08, 0.015, 0.3), 2.0, vector(0.25 * k, 0.984, 0));
                    anchorWhere(strip, plank, [k](const Vec3& x) { return std::abs(x.x() - 0.25 * k) < 1e-3; });
                    bodies.push_back(&plank);
                }
                auto& walker = addWalker(scene, 0.2, 0.8, 60.0, vector(-0.9, 1.7, 0));
                bodies.push_back(&walker);
                return {strip, bodies, [&walker](double t) {
                            if (t > 1.0) walk(walker, 0.6, 0.0);
                        }};
            }};
}

/// A sheet on a plank on a hinge, with a box of 5 kg on one end and one of 15 kg that falls on the other.
inline UseScene seesaw(const char* name) {
    return {name, 3.0, 10.0, {"cotton", "rubber", "denim"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& plank = scene.addBox(vector(1, 0.02, 0.25), 10.0, vector(0, 0.4, 0));
                plank.setActivationState(DISABLE_DEACTIVATION);
                scene.addJoint(std::make_unique<btHingeConstraint>(plank, vector(0, 0, 0), vector(0, 0, 1)));
                auto& sheet = scene.shells->add(
                    moved(makeGrid({.size = {1.6, 0.6}, .cells = {16 * fineness, 6 * fineness}}), {0, 0.424, 0}),
                    material);
                auto& light = scene.addBox(vector(0.1, 0.1, 0.1), 5.0, vector(-0.8, 0.55, 0));
                auto& heavy = scene.addBox(vector(0.1, 0.1, 0.1), 15.0, vector(0.8, 1.5, 0));
                return {sheet, {&scene.addFloor(), &plank, &light, &heavy}};
            }};
}

/// A figure of six bodies that falls on a trampoline.
inline UseScene ragdoll(const char* name) {
    return {name, 3.0, 20.0, {"rubber", "denim"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& sheet = scene.shells->add(moved(squareSheet(3.0, 12 * fineness), {0, 0.8, 0}), material);
                pinBorder(sheet);
                auto& torso = scene.addBox(vector(0.2, 0.12, 0.3), 40.0, vector(0, 2, 0));
                Bodies bodies{&torso, &addBall(scene, 0.12, 5.0, vector(0, 2, -0.45))};
                joinAt(scene, torso, *bodies[1], vector(0, 2, -0.32));
                for (const double side : {-1.0, 1.0}) {
                    bodies.push_back(&addCapsule(scene, 0.05, 0.4, 4.0, vector(0.55 * side, 2, -0.2), kAlongX));
                    joinAt(scene, torso, *bodies.back(), vector(0.28 * side, 2, -0.2));
                    bodies.push_back(&addCapsule(scene, 0.07, 0.6, 10.0, vector(0.12 * side, 2, 0.75), kAlongZ));
                    joinAt(scene, torso, *bodies.back(), vector(0.12 * side, 2, 0.36));
                }
                return {sheet, bodies};
            }};
}

/// A cart whose wheels motors turn drives over a carpet.
inline UseScene cart(const char* name) {
    return {name, 3.0, 6.0, {"cotton", "denim", "rubber"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& floor = scene.addFloor();
                floor.setFriction(1);
                auto& carpet = scene.shells->add(
                    moved(makeGrid({.size = {2, 1.6}, .cells = {16 * fineness, 12 * fineness}}), {1.2, 0.002, 0}),
                    material);
                auto& chassis = scene.addBox(vector(0.4, 0.08, 0.2), 40.0, vector(-0.6, 0.25, 0));
                chassis.setActivationState(DISABLE_DEACTIVATION);
                Bodies bodies{&floor, &chassis};
                for (const auto& [x, z] : {std::pair(-0.3, -0.27), {-0.3, 0.27}, {0.3, -0.27}, {0.3, 0.27}}) {
                    auto& wheel = scene.addBody(std::make_unique<btCylinderShapeZ>(vector(0.12, 0.12, 0.04)), 4.0,
                                                vector(x - 0.6, 0.12, z));
                    wheel.setFriction(1);
                    wheel.setActivationState(DISABLE_DEACTIVATION);
                    auto axle = std::make_unique<btHingeConstraint>(chassis, wheel, vector(x, -0.13, z),
                                                                    vector(0, 0, 0), vector(0, 0, 1), vector(0, 0, 1));
                    axle->enableAngularMotor(true, 8, btScalar(0.5));
                    scene.addJoint(std::move(axle));
                    bodies.push_back(&wheel);
                }
                return {carpet, bodies};
            }};
}

/// A sail between a mast and a boom, in wind from the side.
inline UseScene sail(const char* name) {
    return {name, 3.0, 8.0, kSoft, [](auto& scene, auto& material, int fineness) -> Things {
                auto& mast = addCapsule(scene, 0.04, 3.0, 0.0, vector(0, 1.6, 0));
                auto& boom = addCapsule(scene, 0.03, 1.4, 3.0, vector(0.8, 0.3, 0), kAlongX);
                hangAt(scene, boom, vector(0, 0.3, 0));
                TriangleMesh mesh = upright(1.5, 2.0, 9 * fineness, 12 * fineness, {0.8, 1.35, 0});
                for (auto x : mesh.positions.colwise())
                    x.x() = 0.05 + (x.x() - 0.05) * (1.0 - 0.9 * (x.y() - 0.35) / 2.0);
                auto& canvas = scene.shells->add(mesh, material);
                scene.shells->setWind({.velocity = Vec3(0, 0, 8)});
                anchorWhere(canvas, mast, [](const Vec3& x) { return x.x() < 0.051; });
                anchorWhere(canvas, boom, [](const Vec3& x) { return x.y() < 0.351 && x.x() > 0.051; });
                return {canvas, {&boom}};
            }};
}

/// A ball of 100 kg on a rope that swings into a panel.
inline UseScene wreckingBall(const char* name) {
    return {name, 2.5, 8.0, {"steel", "aluminium", "rubber"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& panel = scene.shells->add(upright(1.5, 1.5, 10 * fineness, 10 * fineness, {0, 1, 0}), material,
                                                {.plasticity = true});
                pinBorder(panel);
                auto& ball = addBall(scene, 0.2, 100.0, vector(0.05, 1.6, -1.8));
                hangAt(scene, ball, vector(0.05, 3, 0));
                return {panel, {&ball}};
            }};
}

/// A crate of 200 kg on the floor that something tows by a strap.
inline UseScene strap(const char* name) {
    return {name, 2.5, 8.0, {"cotton", "leather", "rubber"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& strip = scene.shells->add(
                    moved(makeGrid({.size = {1.5, 0.1}, .cells = {20 * fineness, 2 * fineness}}), {0, 0.3, 0}),
                    material);
                auto& crate = scene.addBox(vector(0.3, 0.3, 0.3), 200.0, vector(-1.06, 0.3, 0));
                auto& tug = scene.addBox(vector(0.2, 0.3, 0.2), 0.0, vector(0.96, 0.35, 0));
                makeKinematic(tug);
                anchorWhere(strip, crate, [](const Vec3& x) { return x.x() < -0.749; });
                anchorWhere(strip, tug, [](const Vec3& x) { return x.x() > 0.749; });
                return {strip, {&scene.addFloor(), &crate, &tug}, [&tug](double t) {
                            moveTo(tug, vector(0.96 - 0.1 * std::min(t, 1.0) + 1.5 * std::max(0.0, t - 1.0), 0.35, 0));
                        }};
            }};
}

/// A sheet in a drum that turns, with three ribs.
inline UseScene dryer(const char* name) {
    return {name, 3.0, 8.0, {"cotton", "denim", "paper"}, [](auto& scene, auto& material, int fineness) -> Things {
                Bodies drum;
                std::vector<btTransform> places;
                const auto put = [&](const btVector3& halfSides, double turn, double radius, double z) {
                    const btQuaternion q(vector(0, 0, 1), btScalar(turn));
                    places.emplace_back(q, quatRotate(q, vector(0, -radius, z)));
                    drum.push_back(&scene.addBox(halfSides, 0.0, places.back().getOrigin() + vector(0, 1, 0)));
                    makeKinematic(*drum.back());
                };
                for (int k = 0; k < 12; ++k) {
                    put(vector(0.09, 0.02, 0.3), k * SIMD_2_PI / 12, 0.32, 0.0);
                    if (k % 4 == 0) put(vector(0.02, 0.05, 0.25), k * SIMD_2_PI / 12, 0.26, 0.0);
                }
                for (const double end : {-0.32, 0.32}) put(vector(0.4, 0.4, 0.02), 0.0, 0.0, end);
                auto& sheet = scene.shells->add(moved(squareSheet(0.4, 10 * fineness), {0, 1, 0}), material);
                return {sheet, drum, [=](double t) {
                            const btTransform turn(btQuaternion(vector(0, 0, 1), btScalar(3.5 * t)), vector(0, 1, 0));
                            for (std::size_t i = 0; i < drum.size(); ++i) drum[i]->setWorldTransform(turn * places[i]);
                        }};
            }};
}

/// A sheet with a box of 5 kg on it, on a lift that goes up and down.
inline UseScene lift(const char* name) {
    return {name, 3.0, 6.0, {"cotton", "rubber", "paper"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& car = scene.addBox(vector(1, 0.1, 1), 0.0, vector(0, 0.4, 0));
                makeKinematic(car);
                auto& sheet = scene.shells->add(moved(squareSheet(1.2, 10 * fineness), {0, 0.502, 0}), material);
                auto& box = scene.addBox(vector(0.15, 0.15, 0.15), 5.0, vector(0.05, 0.67, 0));
                return {sheet, {&car, &box}, [&car](double t) {
                            moveTo(car, vector(0, 0.4 + 0.3 * (1.0 - std::cos(3.0 * t)), 0));
                        }};
            }};
}

inline std::vector<UseScene> mechanisms() {
    return {press("block that presses on a wall"),
            vise("vise of two motors"),
            ropeBridge("walker on a rope bridge"),
            seesaw("sheet on a seesaw"),
            ragdoll("figure on a trampoline"),
            cart("cart over a carpet"),
            sail("sail with a boom"),
            wreckingBall("wrecking ball and panel"),
            strap("strap that tows a crate"),
            dryer("sheet in a drum"),
            lift("box and sheet on a lift")};
}

}  // namespace jacket::bullet::testing::use_scenes
