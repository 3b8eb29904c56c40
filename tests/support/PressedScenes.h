#pragma once
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletDynamics/ConstraintSolver/btGeneric6DofSpring2Constraint.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "support/UseScene.h"

/// Shells that bodies press, mostly on other bodies: by their faces more than by their vertices.
namespace jacket::bullet::testing::use_scenes {

/// Two rails of 10 cm, of `railMass` each (0: fixed), a sheet of large cells over them, and a ball of `mass` let down
/// on it between the rails: it touches insides of triangles, and rails their edges.
inline Things makeRails(BulletScene& scene, const ShellMaterial& material, int cells, double mass, double railMass) {
    Bodies bodies{&scene.addFloor()};
    for (const double side : {-0.05, 0.05})
        bodies.push_back(&scene.addBox(vector(1, 0.05, 0.01), railMass, vector(0, 0.05, side)));
    auto& sheet = scene.shells->add(moved(squareSheet(0.8, cells), {0.1, 0.1015, 0.1}), material);
    bodies.push_back(&addBall(scene, 0.15, mass, vector(0, 0.2505, 0)));
    bodies.back()->setActivationState(DISABLE_DEACTIVATION);
    return {sheet, bodies};
}
inline UseScene ballOnRails(const char* name, double railMass) {
    return {name, 1.0, 6.0, kSoft, [=](auto& scene, auto& material, int fineness) {
                return makeRails(scene, material, 4 * fineness, 50.0, railMass);
            }};
}

/// A terrain of 6.4 m with hills of 25 cm. Bullet keeps a pointer to the heights.
inline std::unique_ptr<btHeightfieldTerrainShape> hills() {
    constexpr int kCount = 33;
    static const std::vector<float> heights = [] {
        std::vector<float> y;
        for (int i = 0; i < kCount; ++i)
            for (int j = 0; j < kCount; ++j)
                y.push_back(float(0.25 * std::sin(0.5 * i) * std::cos(0.4 * j) + 0.02 * i));
        return y;
    }();
    auto shape = std::make_unique<btHeightfieldTerrainShape>(kCount, kCount, heights.data(), btScalar(-2), btScalar(2),
                                                             1, false);
    shape->setLocalScaling(vector(0.2, 1, 0.2));
    return shape;
}
/// Five balls of 5 kg fall on a tarp on it, and roll. (Depths are those in the balls.)
inline UseScene boulders(const char* name) {
    return {name, 2.0, 18.0, {"cotton", "rubber", "steel"}, [](auto& scene, auto& material, int fineness) -> Things {
                scene.addBody(hills(), 0.0, vector(0, 0, 0));
                auto& tarp = scene.shells->add(moved(squareSheet(2.5, 16 * fineness), {0, 1, 0}), material);
                Bodies bodies;
                for (int k = 0; k < 5; ++k)
                    bodies.push_back(&addBall(scene, 0.12 + 0.02 * k, 5.0,
                                              vector(-0.6 + 0.3 * k, 1.6 + 0.2 * k, 0.3 - 0.2 * (k % 3))));
                return {tarp, bodies};
            }};
}

/// Three boxes of 4 kg on each other, with a sheet above each. (Depths and speeds are those of the one in the middle.)
inline UseScene stackedBoxes(const char* name) {
    return {name,
            2.0,
            6.0,
            {"cotton", "rubber", "steel", "paper"},
            [](auto& scene, auto& material, int fineness) -> Things {
                Bodies bodies{&scene.addFloor()};
                std::vector<ShellBody*> sheets;
                for (int k = 0; k < 3; ++k) {
                    bodies.push_back(&scene.addBox(vector(0.2, 0.1, 0.2), 4.0, vector(0.01 * k, 0.102 + 0.206 * k, 0)));
                    sheets.push_back(
                        &scene.shells->add(moved(squareSheet(0.7, 8 * fineness), {0, 0.205 + 0.206 * k, 0}), material));
                }
                return {*sheets[1], bodies};
            }};
}

/// A cloth that is pulled from under four cups on a table.
inline UseScene pulledCloth(const char* name) {
    return {name, 2.0, 10.0, {"cotton", "denim", "rubber"}, [](auto& scene, auto& material, int fineness) -> Things {
                Bodies bodies{&scene.addFloor(), &scene.addBox(vector(0.6, 0.4, 0.4), 0.0, vector(0, 0.4, 0))};
                for (int k = 0; k < 4; ++k)
                    bodies.push_back(&scene.addBody(std::make_unique<btCylinderShape>(vector(0.04, 0.06, 0.04)), 0.3,
                                                    vector(-0.3 + 0.2 * k, 0.864, 0.1 * (k % 2))));
                auto& cloth = scene.shells->add(
                    moved(makeGrid({.size = {1.1, 0.7}, .cells = {22 * fineness, 14 * fineness}}), {0, 0.802, 0}),
                    material, {.friction = 0.3});
                const Pins edge = pinAll(cloth, verticesWhere(cloth, [](const Vec3& x) { return x.x() > 0.549; }));
                return {cloth, bodies, [=, &cloth](double t) {
                            movePins(cloth, edge, vector(std::clamp(4.0 * (t - 0.8), 0.0, 1.6), 0, 0));
                        }};
            }};
}

/// A box of 6 kg that falls on a sheet on a platform of 10 kg, which moves up and down on a spring.
inline UseScene sprungPlatform(const char* name) {
    return {name, 2.0, 6.0, kSoft, [](auto& scene, auto& material, int fineness) -> Things {
                auto& platform = scene.addBox(vector(0.5, 0.03, 0.5), 10.0, vector(0, 0.6, 0));
                platform.setActivationState(DISABLE_DEACTIVATION);
                auto joint = std::make_unique<btGeneric6DofSpring2Constraint>(platform, btTransform::getIdentity());
                joint->setLinearLowerLimit(vector(0, 1, 0));  // above the upper limit: free
                joint->setLinearUpperLimit(vector(0, -1, 0));
                joint->setAngularLowerLimit(vector(0, 0, 0));
                joint->setAngularUpperLimit(vector(0, 0, 0));
                joint->enableSpring(1, true);
                joint->setStiffness(1, 1500);
                joint->setDamping(1, 10);
                joint->setEquilibriumPoint(1, 0);
                scene.addJoint(std::move(joint));
                auto& sheet = scene.shells->add(moved(squareSheet(1.2, 10 * fineness), {0, 0.65, 0}), material);
                auto& box = scene.addBox(vector(0.12, 0.12, 0.12), 6.0, vector(0.1, 1.2, 0));
                return {sheet, {&platform, &box}};
            }};
}

/// A dummy of 75 kg on a seat, at 5 m/s; a belt holds it when the seat brakes by 10 m/s^2.
inline UseScene belt(const char* name) {
    return {name, 1.0, 12.0, {"cotton", "leather", "denim"}, [](auto& scene, auto& material, int fineness) -> Things {
                auto& seat = scene.addBox(vector(0.3, 0.05, 0.3), 0.0, vector(0, 0.5, 0));
                makeKinematic(seat);
                auto& dummy = scene.addBox(vector(0.2, 0.4, 0.12), 75.0, vector(0, 0.96, -0.1));
                dummy.setLinearVelocity(vector(0, 0, 5));
                TriangleMesh mesh = upright(0.8, 0.1, 20 * fineness, 3 * fineness, {0, 1, 0});
                for (auto x : mesh.positions.colwise())  // across its front, and back beside it
                    x.z() = 0.025 - 0.9 * std::max(0.0, std::abs(x.x()) - 0.22);
                auto& strap = scene.shells->add(mesh, material);
                strap.setVelocity(vector(0, 0, 5));
                anchorWhere(strap, seat, [](const Vec3& x) { return std::abs(x.x()) > 0.399; });
                return {strap, {&seat, &dummy}, [&seat](double t) {
                            const double brakes = std::clamp(t - 0.2, 0.0, 0.5);
                            moveTo(seat, vector(0, 0.5, 5.0 * std::min(t, 0.7) - 5.0 * brakes * brakes));
                        }};
            }};
}

inline std::vector<UseScene> pressed() {
    return {ballOnRails("ball on a sheet on fixed rails", 0.0),
            ballOnRails("ball on a sheet on free rails", 20.0),
            boulders("boulders on a tarp on hills"),
            stackedBoxes("sheets between stacked boxes"),
            pulledCloth("cloth pulled from under cups"),
            sprungPlatform("box on a sheet on a spring"),
            belt("belt that holds a dummy")};
}

}  // namespace jacket::bullet::testing::use_scenes
