// Coulomb's law against closed forms: sheets on inclines, balls that roll.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <tuple>

#include "support/HardScenes.h"
#include "support/Incline.h"
#include "support/Target.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::Scene;

constexpr double kSide = 0.2;

/// Cells along a side, step.
class SheetOnIncline : public ::testing::TestWithParam<std::tuple<int, double>> {};

TEST_P(SheetOnIncline, SticksWithoutCreepBelowTheAngleOfFriction) {
    const auto [cells, h] = GetParam();
    Incline scene(0.37, kSide, cells);
    const Points start = scene.sheet.shell().positions();
    scene.run(5.0, h);
    const double moved = (scene.downhill.transpose() * (scene.sheet.shell().positions() - start)).cwiseAbs().maxCoeff();
    EXPECT_LT(moved, 5.0 * Incline::mostCreep(kSide));
}

TEST_P(SheetOnIncline, SlidesAsCoulombSaysAboveIt) {
    const auto [cells, h] = GetParam();
    for (const double friction : {0.2, 0.35}) {
        Incline scene(friction, kSide, cells);
        const double start = scene.place(), seconds = 0.75;
        scene.run(seconds, h);
        // Velocities hold the coming substep's gravity already.
        const double expected = Incline::accelerationByCoulomb(friction) * (seconds + h);
        EXPECT_NEAR(scene.speed(), expected, 0.02 * expected) << "friction " << friction;

        const double mass = scene.sheet.shell().masses().sum();
        const double fallen = std::sin(Incline::kTilt) * (scene.place() - start + h * scene.speed());
        const double heat = mass * Incline::kGravity * fallen - 0.5 * mass * scene.speed() * scene.speed();
        EXPECT_NEAR(scene.sheet.ledger().frictionLoss, heat, 0.02 * heat) << "friction " << friction;
    }
}
INSTANTIATE_TEST_SUITE_P(Grid, SheetOnIncline,
                         ::testing::Combine(::testing::Values(2, 4, 9), ::testing::Values(1.0 / 60, 1.0 / 240)));

/// Of few vertices each: what the solve leaves over, and what friction gets a step late, would show.
TEST(CoarseSheetOnIncline, DoesAsCoulombSays) {
    constexpr double kLarge = 1.0, kSettling = 1.0, kHeld = 2.0, kSliding = 0.75;  // [m], [s]
    for (const double friction : {0.37, 0.5})
        for (const int cells : {2, 5}) {
            Incline scene(friction, kLarge, cells, materials::rubber());
            scene.run(kSettling, kStep);
            const double start = scene.place();
            scene.run(kHeld, kStep);
            EXPECT_LT(scene.place() - start, kHeld * Incline::mostCreep(kLarge))
                << friction << ", " << cells << " cells";
        }
    for (const ShellMaterial& material : {materials::paper(), materials::steel(5e-4)}) {
        Incline scene(0.2, kLarge, 2, material);
        scene.run(kSliding, kStep / 4);
        const double wanted = Incline::accelerationByCoulomb(0.2) * (kSliding + kStep / 4);
        EXPECT_NEAR(scene.speed(), wanted, 0.02 * wanted);
    }
}

/// A strip of cloth that hangs over the edge of a table by a part of its length. By Euler and Eytelwein's law of belts
/// an edge passes on e^-(mu pi / 2) of what pulls at one side of it: where mu is 0.3, the strip slides from 0.32 on.
/// Cells along it, step [s], whether the table is one of triangles.
class StripOverAnEdge : public ::testing::TestWithParam<std::tuple<int, double, bool>> {
  protected:
    const int cells = std::get<0>(GetParam());
    const double h = std::get<1>(GetParam());
    const btVector3 halfTable{1, btScalar(0.5), 1};
    std::unique_ptr<btTriangleMesh> triangles = boxMesh(halfTable);
    Scene<> scene;
    ShellBody* strip = nullptr;

    void layOut(double hanging) {
        std::unique_ptr<btCollisionShape> shape = std::make_unique<btBoxShape>(halfTable);
        if (std::get<2>(GetParam())) shape = std::make_unique<btBvhTriangleMeshShape>(triangles.get(), true);
        scene.addBody(std::move(shape), 0.0, btVector3(-1, btScalar(-0.5), 0)).setFriction(1);
        strip = &scene.shells->add(makeGrid({.size = {1.0, 0.4}, .cells = {cells, cells / 2}}), materials::cotton(),
                                   {.friction = 0.3});
        constexpr btScalar kGap = btScalar(1e-3);
        std::vector<btVector3> x(strip->positions().begin(), strip->positions().end());
        for (btVector3& p : x) {
            const btScalar beyond = p.x() + btScalar(hanging - 0.5);
            p = beyond > btScalar(1e-6) ? btVector3(kGap, -beyond, p.z()) : btVector3(beyond, kGap, p.z());
        }
        strip->setPositions(x);
    }
    double highest() const { return strip->shell().positions().row(1).maxCoeff(); }
};

TEST_P(StripOverAnEdge, SlidesOffWhereMostOfItHangs) {
    layOut(0.75);
    for (double t = 0.0; t < 3.0 && highest() > -0.1; t += h) scene.step(h);
    EXPECT_LT(highest(), -0.1);
}

TEST_P(StripOverAnEdge, StaysWhereFrictionBearsWhatHangs) {
    layOut(0.25);
    scene.run(2.0, h);
    EXPECT_NEAR(strip->shell().positions().row(1).minCoeff(), -0.25, 2e-3);
}
INSTANTIATE_TEST_SUITE_P(Grid, StripOverAnEdge,
                         ::testing::Combine(::testing::Values(12, 24), ::testing::Values(1.0 / 60), ::testing::Bool()));
INSTANTIATE_TEST_SUITE_P(ShortSteps, StripOverAnEdge,
                         ::testing::Combine(::testing::Values(12), ::testing::Values(1.0 / 240), ::testing::Bool()));

/// A cloth that has come to rest is pulled away by a corner: it comes loose ring by ring, in more rounds than friction
/// is looked for in. What had not come loose by then held by up to 10000 times what it can.
TEST(Friction, OfAClothThatIsPulledAtIsNoMoreThanCoulombs) {
    for (const double speed : {0.6, 3.0}) {
        BulletScene scene;
        scene.addFloor();
        auto& sheet = scene.shells->add(squareSheet(0.6, 6), trampolineCloth(), {.sleeping = false});
        place(sheet, {0.0, 2e-3, 0.0});
        scene.run(2.0, kStep);
        const int corner = sheet.vertexCount() - 1;
        const btVector3 start = sheet.positions()[corner];
        sheet.pin(corner);
        for (int i = 1; i <= 10; ++i) {
            sheet.movePin(corner, start + btVector3(btScalar(i * speed * kStep), 0, 0));
            scene.step(kStep);
            double normal = 0.0, friction = 0.0;
            for (const BodyContact& contact : sheet.contacts()) {
                const double along = contact.impulse.dot(contact.contact.normal);
                normal += along;
                friction += (contact.impulse - along * contact.contact.normal).norm();
            }
            EXPECT_LT(friction, 2.0 * 0.25 * normal) << speed << " m/s, step " << i;
        }
    }
}

/// A solid ball that rolls without slipping: a = 5/7 g sin. It lies on the sheet only, not on the plane below.
/// Cells along the sheet's 1 m, whether all of it is pinned.
class RollingBall : public ::testing::TestWithParam<std::tuple<int, bool>> {};

TEST_P(RollingBall, AcceleratesAsASolidSphereDoes) {
    const auto [cells, isPinned] = GetParam();
    Incline scene(1.0, 1.0, cells);
    for (int i = 0; i < scene.sheet.vertexCount(); ++i)
        if (isPinned) scene.sheet.pin(i);
    const double radius = 0.1, seconds = 0.4;
    const Vec3 start =
        (radius + 2 * scene.sheet.contactThickness() + 1e-5) * scene.normal - 0.3 * scene.downhill + Vec3(0, 0, 0.013);
    auto& ball = scene.addSphere(radius, 0.2, Incline::toBullet(start));
    ball.setFriction(1);
    ball.setIgnoreCollisionCheck(&scene.plane, true);
    const double h = 1.0 / 240, gravity = Incline::kGravity * std::sin(Incline::kTilt);
    scene.run(seconds, h);
    // The sheet's impulses answer the coming substep's gravity already, which the ball gets only then.
    const double v = scene.downhill.dot(toVec3(ball.getLinearVelocity())) + h * gravity;
    const double expected = 5.0 / 7 * gravity * (seconds + h);
    EXPECT_NEAR(v, expected, 0.02 * expected);
    EXPECT_NEAR(-double(ball.getAngularVelocity().z()) * radius, v, 0.02 * v);
}
INSTANTIATE_TEST_SUITE_P(Sheets, RollingBall, ::testing::Combine(::testing::Values(5, 10, 20), ::testing::Bool()));

/// A ball that rolls over a flat sheet that cannot give way, as it lies on a floor or is pinned. Steps a second,
/// whether it is pinned.
class LevelRoll : public ::testing::TestWithParam<std::tuple<double, bool>> {
  protected:
    /// Most kinetic energy besides that of falling, of the start's, on a strip of 1 x 0.4 m.
    double mostEnergy(double cell, double radius, double speed, double angle, double stepsASecond, bool isPinned) {
        const ShellMaterial material = materials::cotton();
        TriangleMesh mesh = makeGrid({.size = {1.0, 0.4}, .cells = {int(1.0 / cell + 0.5), int(0.4 / cell + 0.5)}});
        mesh.positions.row(1).array() += 0.5 * material.thickness + 1e-6;
        Scene<> scene;
        scene.addFloor();
        auto& sheet = scene.shells->add(mesh, material, {.friction = 1.0, .sleeping = false});
        for (int i = 0; i < sheet.vertexCount(); ++i)
            if (isPinned) sheet.pin(i);
        const double mass = 0.24, h = 1.0 / stepsASecond;
        const double height = material.thickness + radius + 1e-6;
        auto& ball = scene.addSphere(radius, mass, btVector3(btScalar(-0.4), btScalar(height), btScalar(-0.07)));
        ball.setFriction(1);
        ball.setActivationState(DISABLE_DEACTIVATION);
        scene.run(0.2, h);
        const Vec3 along = speed * Vec3(std::cos(angle), 0, std::sin(angle));
        ball.setLinearVelocity(Incline::toBullet(Vec3(along.x(), double(ball.getLinearVelocity().y()), along.z())));
        ball.setAngularVelocity(Incline::toBullet(Vec3(along.z(), 0, -along.x()) / radius));
        const int steps = int(std::min(0.75 / speed, 2.0) / h);
        double most = 0.0;
        for (int i = 0; i < steps; ++i) {
            scene.step(h);
            const Vec3 v = toVec3(ball.getLinearVelocity()), spin = radius * toVec3(ball.getAngularVelocity());
            const double energy = v.x() * v.x() + v.z() * v.z() + 0.4 * spin.squaredNorm();
            most = std::max(most, energy / (1.4 * speed * speed));
        }
        return most;
    }
};

TEST_P(LevelRoll, GainsNoEnergy) {
    const auto [stepsASecond, isPinned] = GetParam();
    for (const double cell : {0.05, 0.2})
        for (const auto& [radius, speed, angle] :
             {std::tuple(0.05, 0.15, 0.0), std::tuple(0.12, 0.5, 0.25), std::tuple(0.3, 2.0, 0.1)})
            EXPECT_LT(mostEnergy(cell, radius, speed, angle, stepsASecond, isPinned), 1.01)
                << "cells of " << cell << " m, radius " << radius << " m, " << speed << " m/s";
}
INSTANTIATE_TEST_SUITE_P(Steps, LevelRoll,
                         ::testing::Combine(::testing::Values(60.0, 120.0, 240.0, 480.0), ::testing::Bool()));

}  // namespace
}  // namespace jacket::bullet::testing
