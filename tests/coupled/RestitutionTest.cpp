// What bounces leaves with the share of its speed that restitution says: Newton's law of impact.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::energy;
using jacket::testing::energyGain;
using jacket::testing::Scene;
using jacket::testing::stateOf;
using jacket::testing::totalMomentum;

constexpr double kGravity = 9.81, kDrop = 0.3, kShortStep = 1.0 / 240;

/// A stiff plate above a floor that gives back all.
struct DroppedPlate : Scene<> {
    btRigidBody& floor = addFloor();
    ShellBody* plate;

    explicit DroppedPlate(double restitution, double tilt = 0.0, const ShellMaterial& material = materials::steel(2e-3),
                          double drop = kDrop) {
        floor.setRestitution(1);
        TriangleMesh mesh = squareSheet(0.2, 4);
        mesh.positions = Eigen::AngleAxisd(tilt, Vec3(1, 0, 0.3).normalized()).toRotationMatrix() * mesh.positions;
        mesh.positions.row(1).array() += drop + 0.5 * material.thickness - mesh.positions.row(1).minCoeff();
        plate = &shells->add(mesh, material, {.restitution = restitution});
    }
    double height() const { return plate->shell().positions().row(1).mean() - plate->contactThickness(); }
    /// How high it rises once it has been down, until it comes down again [m].
    double rebound(double h) {
        while (plate->contacts().empty()) step(h);
        step(h);  // contacts say what the coming motion will be
        double highest = height();
        for (step(h); height() > highest; step(h)) highest = height();
        return highest;
    }
};

/// Restitution, step.
class FlatPlate : public ::testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(FlatPlate, RisesByTheSquareOfItsRestitution) {
    const auto [restitution, h] = GetParam();
    const double expected = restitution * restitution * kDrop;
    // It bounces from where it is when the step begins that would close the contact.
    const double above = (1.0 - restitution * restitution) * std::sqrt(2.0 * kGravity * kDrop) * h;
    const double rebound = DroppedPlate(restitution).rebound(h);
    EXPECT_GT(rebound, expected - 0.01 * kDrop);
    EXPECT_LT(rebound, expected + (restitution == 0.0 ? 1e-6 : above + 0.005 * kDrop));
}
INSTANTIATE_TEST_SUITE_P(Steps, FlatPlate,
                         ::testing::Combine(::testing::Values(0.0, 0.5, 1.0), ::testing::Values(1.0 / 60, kShortStep)));

/// One corner hits after the other. What a stiff plate that turns seems to hold in its membrane is the linear step's
/// error, with and without contact, and gone in the next step.
TEST(Restitution, ATiltedPlateGainsNoEnergy) {
    for (const ShellMaterial& material : {materials::steel(2e-3), materials::rubber(2e-2)})
        for (const double restitution : {0.5, 1.0})
            for (const double tilt : {0.05, 0.3, 1.0}) {
                DroppedPlate scene(restitution, tilt, material);
                scene.floor.setFriction(0);
                const double start = energy(scene).total();
                for (int i = 0; i < 240; ++i) {
                    scene.step(kShortStep);
                    const auto now = energy(scene);
                    ASSERT_LT(now.total() - now.membrane, 1.001 * start)
                        << material.thickness << " " << restitution << " " << tilt << " step " << i;
                }
            }
}

/// Where the ball falls, its speed at the start.
class BallOnPinnedSheet : public ::testing::TestWithParam<std::tuple<std::pair<double, double>, double>> {};

/// Over a vertex, over an edge, inside a triangle; fast enough to pass the sheet within a step.
TEST_P(BallOnPinnedSheet, Rebounds) {
    const auto [place, speed] = GetParam();
    for (const double restitution : {0.0, 0.3, 0.9, 1.0}) {
        Scene scene;
        auto& sheet = scene.shells->add(squareSheet(1, 10), trampolineCloth(), {.restitution = restitution});
        for (int i = 0; i < sheet.vertexCount(); ++i) sheet.pin(i);
        auto& ball = scene.addSphere(0.04, 0.3, btVector3(btScalar(place.first), 0.5, btScalar(place.second)));
        ball.setRestitution(1);
        ball.setLinearVelocity(btVector3(0, btScalar(-speed), 0));
        double before = 0.0;
        for (int i = 0; i < 120 && sheet.contacts().empty(); ++i) {
            before = double(ball.getLinearVelocity().y());
            scene.step(kShortStep);
        }
        scene.step(kShortStep);
        EXPECT_NEAR(double(ball.getLinearVelocity().y()), -restitution * before,
                    0.03 * -before + 2 * kShortStep * kGravity)
            << "restitution " << restitution;
    }
}
INSTANTIATE_TEST_SUITE_P(Places, BallOnPinnedSheet,
                         ::testing::Combine(::testing::Values(std::pair(0.0, 0.0), std::pair(0.05, 0.0),
                                                              std::pair(0.03, 0.06)),
                                            ::testing::Values(0.0, 30.0)));

/// Nobody holds either: the velocity of one relative to the other turns around. What a plate keeps as vibration is
/// lost; this one is so thick that it keeps little.
TEST(Restitution, ABallAndAFreePlateExchangeMomentum) {
    for (const double restitution : {0.0, 0.5, 1.0})
        for (const double mass : {0.1, 1.0, 10.0}) {
            Scene scene(0.0);
            const auto& plate =
                scene.shells->add(squareSheet(0.2, 4), materials::steel(1e-2), {.restitution = restitution});
            auto& ball = scene.addSphere(0.05, mass, btVector3(0, btScalar(0.1), 0));
            ball.setRestitution(1);
            ball.setLinearVelocity(btVector3(0, -2, 0));
            const Vec3 before = totalMomentum(scene);
            scene.run(0.08, kShortStep);
            EXPECT_LT((totalMomentum(scene) - before).norm(), bulletTolerance(1e-9, 1e-6) * before.norm());
            const double parting = double(ball.getLinearVelocity().y()) -
                                   double(plate.linearMomentum().y()) / plate.shell().masses().sum();
            EXPECT_NEAR(parting, 2.0 * restitution, 0.05) << "ball of " << mass << " kg";
        }
}

/// Light vertices, a heavy ball, edges and triangles that touch: what flies off is caught and hit again.
TEST(Restitution, AFreeClothKeepsItsMomentum) {
    for (const double restitution : {0.4, 1.0}) {
        Scene scene(0.0);
        auto& ball = scene.addSphere(0.2, 0.7, btVector3(btScalar(0.13), btScalar(0.3), btScalar(-0.21)));
        ball.setRestitution(1);
        ball.setLinearVelocity(btVector3(btScalar(0.3), -2, btScalar(0.1)));
        scene.shells->add(squareSheet(1.5, 12), trampolineCloth(), {.restitution = restitution});
        const Vec3 before = totalMomentum(scene);
        const double start = energy(scene).total();
        EXPECT_LT(energyGain(scene, 0.5, 1.0 / 120), 0.01 * start);
        EXPECT_LT((totalMomentum(scene) - before).norm(), bulletTolerance(1e-9, 1e-6) * before.norm());
        EXPECT_GT(ball.getLinearVelocity().y(), -1.9);
    }
}

/// Restitution is for what closes faster than Bullet's threshold.
TEST(Restitution, WhatLiesStillComesToRest) {
    for (const ShellMaterial& material : {materials::steel(1e-3), trampolineCloth()})
        for (const double h : {1.0 / 60, kShortStep}) {
            DroppedPlate scene(1.0, 0.0, material, 1.5e-3);
            for (int i = 0; i < int(4.0 / h) && !scene.plate->isAsleep(); ++i) {
                scene.step(h);
                ASSERT_LT(scene.height(), 1.6e-3);
            }
            EXPECT_TRUE(scene.plate->isAsleep());
        }
}

TEST(Restitution, TheWorldsThresholdCounts) {
    DroppedPlate scene(1.0);
    scene.world.getSolverInfo().m_restitutionVelocityThreshold = 10;
    EXPECT_LT(scene.rebound(kShortStep), 1e-3);
}

/// It takes both: the product decides.
TEST(Restitution, ABodyWithoutItChangesNothing) {
    const auto run = [](double shell, double floor) {
        DroppedPlate scene(shell, 0.3);
        scene.floor.setRestitution(btScalar(floor));
        scene.run(0.5, kShortStep);
        return stateOf(scene);
    };
    const auto without = run(0.0, 0.0);
    EXPECT_EQ(run(0.7, 0.0), without);
    EXPECT_EQ(run(0.0, 1.0), without);
    EXPECT_NE(run(0.7, 1.0), without);
    EXPECT_EQ(run(1.0, 3.0), run(1.0, 1.0));  // nobody gives back more than he gets
}

TEST(Restitution, IsFromZeroToOne) {
    Scene scene;
    for (const double wrong : {-0.1, 1.1, std::nan("")}) {
        try {
            scene.shells->add(squareSheet(1, 2), trampolineCloth(), {.restitution = wrong});
            ADD_FAILURE() << wrong;
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find("ShellOptions.restitution must be from 0 to 1"),
                      std::string::npos);
        }
    }
}

}  // namespace
}  // namespace jacket::bullet::testing
