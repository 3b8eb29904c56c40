// What nobody holds keeps its momentum.
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <gtest/gtest.h>

#include "Worlds.h"
#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::Scene;
using jacket::testing::totalAngularMomentum;
using jacket::testing::totalMomentum;

/// A spinning body flies into a free sheet, off its middle, which flies into a second one.
class FreeSystem : public ::testing::TestWithParam<const char*> {};

std::unique_ptr<btCollisionShape> flyer(const std::string& name) {
    if (name == "box") return std::make_unique<btBoxShape>(btVector3(btScalar(0.2), btScalar(0.1), btScalar(0.15)));
    if (name == "capsule") return std::make_unique<btCapsuleShape>(btScalar(0.1), btScalar(0.2));
    return std::make_unique<btSphereShape>(btScalar(0.2));
}

/// Largest drift over half a second, relative to the start.
struct Drift {
    double linear = 0.0, angular = 0.0;
};

Drift driftOf(const std::string& shape, double h) {
    Scene scene(0.0);
    const btVector3 place(btScalar(0.13), btScalar(0.3), btScalar(-0.21));
    auto& body = scene.addBody(flyer(shape), 0.7, place);
    body.setLinearVelocity(btVector3(btScalar(0.3), -2, btScalar(0.1)));
    body.setAngularVelocity(btVector3(5, 7, -3));
    scene.shells->add(squareSheet(1.5, 12), trampolineCloth());
    TriangleMesh below = squareSheet(1.5, 12);
    below.positions.row(1).array() -= 0.05;
    scene.shells->add(below, trampolineCloth());
    auto& target = scene.addSphere(0.15, 0.3, btVector3(0, btScalar(-0.3), 0));
    const Vec3 linear = totalMomentum(scene), angular = totalAngularMomentum(scene);
    Drift drift;
    for (double t = 0; t < 0.5; t += h) {
        scene.step(h);
        drift.linear = std::max(drift.linear, (totalMomentum(scene) - linear).norm() / linear.norm());
        drift.angular = std::max(drift.angular, (totalAngularMomentum(scene) - angular).norm() / angular.norm());
    }
    EXPECT_LT(body.getLinearVelocity().y(), 0.0);
    EXPECT_GT(body.getLinearVelocity().y(), -1.9);              // it has hit the first sheet
    EXPECT_GT(std::abs(target.getLinearVelocity().y()), 0.01);  // and the sheets the ball below
    return drift;
}

TEST_P(FreeSystem, KeepsItsMomentum) {
    const Drift drift = driftOf(GetParam(), 1.0 / 120);
    EXPECT_LT(drift.linear, bulletTolerance(1e-9, 1e-6));
    EXPECT_LT(drift.angular, 0.12);  // measured: 0.09 to 0.10, see below
    RecordProperty("angular_drift", std::to_string(drift.angular));
}

/// Also in steps that the solver cuts short (this box and this capsule meet such).
TEST_P(FreeSystem, KeepsItsLinearMomentumInShortSteps) {
    EXPECT_LT(driftOf(GetParam(), 1.0 / 480).linear, bulletTolerance(1e-9, 2e-6));
}

INSTANTIATE_TEST_SUITE_P(Bodies, FreeSystem, ::testing::Values("sphere", "box", "capsule"));

/// Angular momentum is kept only as well as backward Euler of a sheet that turns and waves keeps it.
TEST(Momentum, ShorterStepsLoseLessAngularMomentum) {
    const Drift coarse = driftOf("sphere", 1.0 / 120), fine = driftOf("sphere", 1.0 / 480);
    EXPECT_LT(fine.linear, bulletTolerance(1e-9, 1e-6));
    EXPECT_LT(fine.angular, 0.5 * coarse.angular);
}

/// An impulse between a body and a sheet has one line of action: with no time for anything to move, nothing turns.
TEST(Momentum, ContactItselfKeepsAngularMomentum) {
    Scene scene(0.0);
    auto& ball = scene.addSphere(0.2, 0.7, btVector3(btScalar(0.13), btScalar(0.2005), btScalar(-0.21)));
    ball.setLinearVelocity(btVector3(btScalar(0.3), -2, btScalar(0.1)));
    ball.setAngularVelocity(btVector3(5, 7, -3));
    auto& sheet = scene.shells->add(squareSheet(1.5, 12), trampolineCloth(), {.tolerance = 1e-9});
    const Vec3 before = totalAngularMomentum(scene);
    bool touched = false;
    for (int i = 0; i < 100; ++i) {
        scene.step(1e-5);
        touched = touched || !sheet.contacts().empty();
    }
    ASSERT_TRUE(touched);
    const double drift = (totalAngularMomentum(scene) - before).norm() / before.norm();
    EXPECT_LT(drift, 1e-4);
}

/// A multibody of one link flies into a sheet.
TEST(Momentum, MultibodiesTakeWhatSheetsLose) {
    Scene<btMultiBodyDynamicsWorld> scene(0.0);
    auto& sheet = scene.shells->add(squareSheet(1, 10), trampolineCloth());
    btSphereShape shape(btScalar(0.1));
    btMultiBody ball(0, btScalar(0.5), btVector3(btScalar(0.002), btScalar(0.002), btScalar(0.002)), false, false);
    ball.setLinearDamping(0);
    ball.setAngularDamping(0);
    ball.setBasePos(btVector3(0, btScalar(0.2), 0));
    ball.finalizeMultiDof();
    btMultiBodyLinkCollider collider(&ball, -1);
    collider.setCollisionShape(&shape);
    collider.setWorldTransform(ball.getBaseWorldTransform());
    ball.setBaseCollider(&collider);
    scene.world.addCollisionObject(&collider);
    scene.world.addMultiBody(&ball);
    ball.setBaseVel(btVector3(0, -3, 0));
    EXPECT_LT((totalMomentum(scene) - Vec3(0, -1.5, 0)).norm(), bulletTolerance(1e-12, 1e-6));
    bool touched = false;
    for (int i = 0; i < 60; ++i) {
        scene.step(1.0 / 120);
        touched = touched || !sheet.contacts().empty();
        ASSERT_LT((totalMomentum(scene) - Vec3(0, -1.5, 0)).norm(), bulletTolerance(1e-9, 1e-5)) << "step " << i;
    }
    EXPECT_TRUE(touched);
    EXPECT_GT(ball.getBaseVel().y(), -2.9);
    scene.world.removeMultiBody(&ball);
    scene.world.removeCollisionObject(&collider);
}

/// Tied, not touching: the anchor hands over as much as it takes.
TEST(Momentum, AnchorsKeepIt) {
    Scene scene(0.0);
    auto& sheet = scene.shells->add(squareSheet(1, 6), trampolineCloth());
    auto& box = scene.addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 0.5,
                             btVector3(btScalar(-0.5), btScalar(0.3), btScalar(-0.5)));
    sheet.anchor(0, box);
    box.setLinearVelocity(btVector3(0, 2, 0));
    const Vec3 before = totalMomentum(scene);
    for (int i = 0; i < 60; ++i) {
        scene.step(1.0 / 60);
        ASSERT_LT((totalMomentum(scene) - before).norm() / before.norm(), bulletTolerance(1e-9, 1e-6)) << "step " << i;
    }
    EXPECT_GT(sheet.velocity(24).y(), 0.1);
}

}  // namespace
}  // namespace jacket::bullet::testing
