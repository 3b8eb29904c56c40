#pragma once
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "support/MechanismScenes.h"
#include "support/PressedScenes.h"
#include "support/UseScene.h"

namespace jacket::bullet::testing::use_scenes {

/// Half a sphere that is open above, its lowest point at the origin.
inline TriangleMesh bowl(double radius, int rings) {
    TriangleMesh mesh = makeHemisphere(radius, rings);
    mesh.positions.bottomRows<2>() *= -1.0;  // half a turn about x
    return moved(mesh, {0.0, radius, 0.0});
}
inline TriangleMesh closedBall(double radius, int rings, const Vec3& middle) {
    const TriangleMesh half = makeHemisphere(radius, rings);
    const Eigen::Index n = half.positions.cols(), m = half.triangles.cols();
    TriangleMesh mesh;
    mesh.positions.resize(3, 2 * n);
    mesh.positions << half.positions, half.positions;
    mesh.positions.rightCols(n).row(1) *= -1.0;
    mesh.triangles.resize(3, 2 * m);
    mesh.triangles.leftCols(m) = half.triangles;
    mesh.triangles.rightCols(m) = half.triangles.colwise().reverse().array() + int(n);
    return moved(weldSeams(mesh), middle);
}

inline const std::vector<std::string> kInflated{"rubber", "cotton", "pet"},
    kStiff{"steel", "aluminium", "pet", "rubber"};

/// A panel on the front of a car of 800 kg, which drives into a pole at 10 m/s.
inline UseScene carPanel(const char* name) {
    return {name, 1.0, 20.0, {"steel", "aluminium", "rubber"}, [](auto& scene, auto& material, int fineness) -> Things {
                scene.world.setGravity(vector(0, 0, 0));
                auto& car = scene.addBox(vector(0.7, 0.3, 1.5), 800.0, vector(0, 0.8, 0));
                car.setLinearVelocity(vector(0, 0, 10));
                auto& pole = scene.addBox(vector(0.1, 1, 0.1), 0.0, vector(0.1, 0.8, 3));
                TriangleMesh mesh = upright(1.2, 0.5, 10 * fineness, 4 * fineness, {0, 0.8, 1.7});
                for (auto x : mesh.positions.colwise()) x.z() += 0.15 * (1.0 - x.x() * x.x() / 0.36);
                auto& panel = scene.shells->add(mesh, material, {.plasticity = true});
                panel.setVelocity(vector(0, 0, 10));
                for (int i = 0; i < panel.vertexCount(); ++i)
                    if (panel.shell().mesh().isBorderVertex(i)) panel.anchor(i, car);
                return {panel, {&car, &pole}};
            }};
}

/// A door on a hinge, whose motor swings it into a curtain that is pinned at a height of 1.9 m. `top`: of the door [m].
inline UseScene doorAndCurtain(const char* name, double top) {
    return {name, 3.0, 18.0, kSoft, [=](auto& scene, auto& material, int fineness) -> Things {
                const double half = 0.5 * (top - 0.1);
                auto& door = scene.addBox(vector(0.4, half, 0.02), 20.0, vector(0.4, 0.1 + half, -0.5));
                door.setActivationState(DISABLE_DEACTIVATION);
                auto hinge = std::make_unique<btHingeConstraint>(door, vector(-0.4, 0, 0), vector(0, 1, 0));
                hinge->enableAngularMotor(true, btScalar(-1.5), btScalar(5));
                scene.addJoint(std::move(hinge));
                auto& curtain =
                    scene.shells->add(upright(1.6, 1.6, 12 * fineness, 12 * fineness, {0.3, 1.1, 0.0}), material);
                pinWhere(curtain, [](const Vec3& x) { return x.y() > 1.899; });
                return {curtain, {&door}};
            }};
}

/// A character of 70 kg, kept upright and moved by its velocity, walks into a curtain and back.
inline UseScene walkerAndCurtain(const char* name) {
    return {name, 3.0, 8.0, kSoft, [](auto& scene, auto& material, int fineness) -> Things {
                auto& floor = scene.addFloor();
                auto& walker = addWalker(scene, 0.25, 1.2, 70.0, vector(0.05, 0.86, -1.2));
                auto& curtain =
                    scene.shells->add(upright(1.8, 1.8, 12 * fineness, 12 * fineness, {0.0, 1.1, 0.0}), material);
                pinWhere(curtain, [](const Vec3& x) { return x.y() > 1.999; });
                return {curtain, {&floor, &walker}, [&walker](double t) { walk(walker, 0.0, t < 1.6 ? 1.5 : -1.5); }};
            }};
}

/// A balloon of 60 cm that falls on the floor; `mass`, if any: of a box that falls on it.
inline UseScene balloon(const char* name, double pressure, double height, double mass) {
    return {name, 3.0, 8.0, kInflated, [=](auto& scene, auto& material, int fineness) -> Things {
                auto& sheet = scene.shells->add(closedBall(0.3, 4 * fineness, {0, height, 0}), material);
                sheet.shell().setPressure(pressure);
                Bodies bodies{&scene.addFloor()};
                if (mass > 0.0) bodies.push_back(&scene.addBox(vector(0.2, 0.1, 0.2), mass, vector(0.02, 1.0, 0)));
                return {sheet, bodies};
            }};
}

/// The same on the floor, pressed down by half and let go; or hit by a ball of 400 g at 10 m/s.
inline UseScene pressedBalloon(const char* name) {
    return {name, 3.0, 8.0, kInflated, [](auto& scene, auto& material, int fineness) -> Things {
                auto& sheet = scene.shells->add(closedBall(0.3, 4 * fineness, {0, 0.305, 0}), material);
                sheet.shell().setPressure(500.0);
                auto& plate = scene.addBox(vector(0.5, 0.05, 0.5), 0.0, vector(0, 0.7, 0));
                makeKinematic(plate);
                return {sheet, {&scene.addFloor(), &plate}, [&plate](double t) {
                            moveTo(plate, vector(0, 0.7 - 0.4 * std::min(t, 1.0) + 0.4 * std::max(t - 1.5, 0.0), 0));
                        }};
            }};
}
inline UseScene kickedBalloon(const char* name) {
    return {name, 2.0, 14.0, kInflated, [](auto& scene, auto& material, int fineness) -> Things {
                auto& sheet = scene.shells->add(closedBall(0.3, 4 * fineness, {0, 0.305, 0}), material);
                sheet.shell().setPressure(500.0);
                auto& ball = addBall(scene, 0.11, 0.4, vector(-1, 0.35, 0.02), vector(10, 0, 0));
                return {sheet, {&scene.addFloor(), &ball}};
            }};
}

/// Marbles of 50 g, or blocks of 200 g, that fall into a bowl of 40 cm on the floor.
inline UseScene filledBowl(const char* name, bool areMarbles) {
    return {name, 3.0, 6.0, kStiff, [=](auto& scene, auto& material, int fineness) -> Things {
                auto& sheet = scene.shells->add(moved(bowl(0.2, 4 * fineness), {0, 1e-3, 0}), material);
                Bodies bodies{&scene.addFloor()};
                for (int i = 0; i < (areMarbles ? 8 : 4); ++i) {
                    const double turn = 2.4 * i, off = areMarbles ? 0.06 : 0.04;
                    const auto at =
                        vector(off * std::cos(turn), 0.3 + (areMarbles ? 0.06 : 0.1) * i, off * std::sin(turn));
                    bodies.push_back(areMarbles ? &addBall(scene, 0.02, 0.05, at)
                                                : &scene.addBox(vector(0.04, 0.03, 0.03), 0.2, at));
                }
                return {sheet, bodies};
            }};
}

/// A hat that falls on a head, which nods and walks to and fro.
inline UseScene hat(const char* name) {
    return {name,
            3.0,
            8.0,
            {"denim", "leather", "paper", "rubber", "pet"},
            [](auto& scene, auto& material, int fineness) -> Things {
                auto& head = scene.addSphere(0.15, 0.0, vector(0, 1, 0));
                makeKinematic(head);
                head.setFriction(1);
                auto& sheet = scene.shells->add(moved(makeHemisphere(0.17, 4 * fineness), {0.01, 1.05, 0}), material,
                                                {.friction = 1.0});
                return {sheet, {&head}, [&head](double t) {
                            moveTo(head, vector(0.3 - 0.3 * std::cos(2.0 * t), 1.0 + 0.02 * std::sin(12.0 * t), 0),
                                   btQuaternion(vector(0, 0, 1), btScalar(0.3 * std::sin(4.0 * t))));
                        }};
            }};
}

/// A bag with six balls of 200 g, whose rim its user swings.
inline UseScene bag(const char* name) {
    return {
        name,
        4.0,
        8.0,
        {"cotton", "denim", "rubber", "leather"},
        [](auto& scene, auto& material, int fineness) -> Things {
            auto& sheet = scene.shells->add(moved(bowl(0.25, 5 * fineness), {0, 0.75, 0}), material);
            std::vector<int> border;
            for (int i = 0; i < sheet.vertexCount(); ++i)
                if (sheet.shell().mesh().isBorderVertex(i)) border.push_back(i);
            const Pins rim = pinAll(sheet, border);
            Bodies bodies;
            for (int i = 0; i < 6; ++i)
                bodies.push_back(&addBall(
                    scene, 0.06, 0.2, vector(0.09 * std::cos(1.05 * i), 0.95 + 0.02 * i, 0.09 * std::sin(1.05 * i))));
            return {sheet, bodies,
                    [=, &sheet](double t) { movePins(sheet, rim, vector(0.3 - 0.3 * std::cos(3.0 * t), 0, 0)); }};
        }};
}

/// Two balls of 300 g that fly apart, tied to the ends of a strip.
inline UseScene bola(const char* name) {
    return {name, 2.0, 12.0, kSoft, [](auto& scene, auto& material, int fineness) -> Things {
                auto& strip = scene.shells->add(
                    moved(makeGrid({.size = {0.8, 0.08}, .cells = {12 * fineness, 2 * fineness}}), {0, 1, 0}),
                    material);
                auto& left = addBall(scene, 0.05, 0.3, vector(-0.45, 1, 0), vector(2, 2, 5));
                auto& right = addBall(scene, 0.05, 0.3, vector(0.45, 1, 0), vector(2, 2, -3));
                anchorWhere(strip, left, [](const Vec3& x) { return x.x() < -0.399; });
                anchorWhere(strip, right, [](const Vec3& x) { return x.x() > 0.399; });
                return {strip, {&scene.addFloor(), &left, &right}};
            }};
}

/// A lid that falls on an open box, and a sheet on three poles that stand.
inline UseScene lid(const char* name) {
    return {name, 2.0, 6.0, kStiff, [](auto& scene, auto& material, int fineness) -> Things {
                auto& sheet = scene.shells->add(moved(squareSheet(0.7, 8 * fineness), {0, 0.5, 0}), material);
                Bodies bodies{&scene.addFloor()};
                for (const double side : {-0.3, 0.3}) {
                    bodies.push_back(&scene.addBox(vector(0.02, 0.15, 0.3), 0.0, vector(side, 0.15, 0)));
                    bodies.push_back(&scene.addBox(vector(0.3, 0.15, 0.02), 0.0, vector(0, 0.15, side)));
                }
                return {sheet, bodies};
            }};
}
inline UseScene tent(const char* name) {
    return {name, 2.0, 7.0, kSoft, [](auto& scene, auto& material, int fineness) -> Things {
                auto& sheet = scene.shells->add(moved(squareSheet(1.2, 10 * fineness), {0, 0.6, 0}), material);
                Bodies bodies{&scene.addFloor()};
                for (const double turn : {0.0, 2.1, 4.2})
                    bodies.push_back(
                        &addCapsule(scene, 0.02, 0.5, 0.0, vector(0.3 * std::cos(turn), 0.25, 0.3 * std::sin(turn))));
                return {sheet, bodies};
            }};
}

inline std::vector<UseScene> all() {
    std::vector<UseScene> scenes{carPanel("panel of a car that hits a pole"),
                                 doorAndCurtain("door below a curtain's pins", 1.8),
                                 doorAndCurtain("door as high as the pins", 1.9),
                                 doorAndCurtain("door that the pins stop", 1.96),
                                 walkerAndCurtain("walker in a curtain"),
                                 balloon("balloon on the floor", 500.0, 0.8, 0.0),
                                 balloon("balloon under a box of 5 kg", 1500.0, 0.31, 5.0),
                                 pressedBalloon("balloon under a plate"),
                                 kickedBalloon("balloon hit by a ball"),
                                 filledBowl("bowl of marbles", true),
                                 filledBowl("bowl of blocks", false),
                                 hat("hat on a head"),
                                 bag("bag of balls"),
                                 bola("two balls on a strip"),
                                 lid("lid on a box"),
                                 tent("sheet on three poles")};
    for (const auto& more : {mechanisms(), pressed()}) scenes.insert(scenes.end(), more.begin(), more.end());
    return scenes;
}

}  // namespace jacket::bullet::testing::use_scenes
