// Bodies that do something else in a step than the shells were solved for: what their users do to them between two
// solves, and what Bullet's own solve leaves over.
#include <btBulletDynamicsCommon.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "support/FreeScenes.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::totalMomentum;
using jacket::testing::toVec3;

double deepestIn(const Bodies& bodies, const ShellBody& shell) {
    double depth = 0.0;
    for (const btRigidBody* body : bodies) depth = std::max(depth, penetration(shell, *body));
    return depth;
}

/// Speed that the user gives a body [m/s], steps a second.
class KickedBall : public ::testing::TestWithParam<std::tuple<double, int>> {};

TEST_P(KickedBall, TakesTheClothOnItAlong) {
    constexpr int kStarts = 8;
    const auto [speed, stepsASecond] = GetParam();
    const double h = 1.0 / stepsASecond;
    for (int start = 0; start < kStarts; ++start) {
        BulletScene scene;
        scene.addFloor();
        Bodies bodies;
        const ShellBody& cloth =
            free_scenes::ballUnderCloth("ball", 2.0)
                .make(scene, materials::cotton(), 16, Vec3(0.003 * start, 0, 0.002 * start), bodies);
        scene.run(1.0, h);
        bodies[0]->activate();
        bodies[0]->setLinearVelocity(btVector3(0, btScalar(speed), 0));
        double deepest = 0.0;
        for (int i = 0; i < stepsASecond / 4; ++i) {
            scene.step(h);
            deepest = std::max(deepest, deepestIn(bodies, cloth));
            EXPECT_LT(cloth.shell().velocities().colwise().norm().maxCoeff(), 2.0 * speed + 2.0) << "step " << i;
        }
        EXPECT_LT(deepest, 5e-4) << "start " << start;
    }
}
INSTANTIATE_TEST_SUITE_P(Speeds, KickedBall,
                         ::testing::Combine(::testing::Values(2.0, 5.0, 10.0), ::testing::Values(60, 240)));

/// A sheet that presses on a ball in free space, and a ball that its user strikes: five solves are done anew.
TEST(Unforeseen, MomentumIsKeptAndTheLedgerCountsItOnce) {
    BulletScene scene;
    scene.world.setGravity(btVector3(0, 0, 0));
    auto& ball = scene.addSphere(0.1, 0.5, btVector3(0, 0, 0));
    auto& sheet = scene.shells->add(squareSheet(0.4, 10), materials::cotton());
    place(sheet, {0.004, 0.11, 0.007});
    sheet.setVelocity(btVector3(0, -1, 0));
    const Vec3 thrown(0, -sheet.shell().masses().sum(), 0);
    Vec3 struck = Vec3::Zero();
    for (int i = 0; i < 40; ++i) {
        if (i % 8 == 7) {
            const btVector3 kick(btScalar(0.4), btScalar(i % 16 == 7 ? 1.5 : -1.0), btScalar(-0.3));
            ball.applyCentralImpulse(kick);
            struck += toVec3(kick);
        }
        scene.step(kStep);
        EXPECT_LT((totalMomentum(scene.world, *scene.shells) - thrown - struck).norm(), 1e-5) << "step " << i;
        const Vec3 given = 0.5 * toVec3(ball.getLinearVelocity()) - struck;
        EXPECT_LT((sheet.ledger().exchanged - given).norm(), 1e-5) << "step " << i;
        EXPECT_LT(penetration(sheet, ball), 5e-4) << "step " << i;
    }
}

/// Under a cloth that comes down on it and lies there. Solves of a second, from one of several starts.
int solvesOverCrateOnSlope(int start) {
    BulletScene scene;
    scene.world.setGravity(btVector3(btScalar(3.3), btScalar(-9.2), 0));
    scene.addFloor().setFriction(1);
    btRigidBody& crate =
        scene.addBox(btVector3(btScalar(0.15), btScalar(0.15), btScalar(0.15)), 20.0, btVector3(0, btScalar(0.15), 0));
    crate.setFriction(1);
    auto& cloth = scene.shells->add(squareSheet(1.2, 24), materials::cotton(), {.friction = 0.4, .sleeping = false});
    place(cloth, {0.003 * start, 0.42, 0.002 * start});
    scene.run(1.0, kStep);
    const btScalar before = crate.getCenterOfMassPosition().x();
    int solves = 0;
    for (int i = 0; i < 60; ++i) {
        scene.step(kStep);
        solves += scene.shells->lastStep().solves;
    }
    EXPECT_NEAR(double(crate.getCenterOfMassPosition().x()), double(before), 5e-4) << "start " << start;
    return solves;
}

/// Friction of its floor is foreseen: else each of its steps would be solved once for a crate that slides, and once
/// more.
TEST(Unforeseen, IsNotWhatHoldsACrateOnASlope) {
    std::vector<double> solves;
    for (int start = 0; start < 5; ++start) solves.push_back(solvesOverCrateOnSlope(start));
    EXPECT_LT(medianOf(solves), 60 * 6);
}

/// A jolt in every joint, which Bullet's iterations leave much of.
TEST(Unforeseen, AFigureOnJointsHitsTheFloorUnderACloth) {
    for (const int start : {0, 1}) {
        const auto run = free_scenes::clothOnRagdoll("figure").run(materials::cotton(), 16, start);
        EXPECT_LT(run.outcome.deepest, 1e-3) << start;
        EXPECT_LE(run.outcome.unsettled, 2) << start;
    }
}

/// Speed of a cloth on boxes after one of them was struck and another one, or a shell, taken away [m/s].
double speedWithoutAnother(bool isShell, int start) {
    BulletScene scene;
    scene.addFloor();
    Bodies bodies;
    auto& cloth = free_scenes::pileUnderCloth("boxes", 2.0)
                      .make(scene, materials::cotton(), 12, Vec3(1e-4 * start, 0, 0.7e-4 * start), bodies);
    auto& other = free_scenes::addSheet(scene, materials::cotton(), 12, {0.05, 0.6, 0.03});
    scene.run(0.5, kStep);
    bodies[4]->setLinearVelocity(btVector3(0, 5, 0));
    if (isShell)
        scene.shells->remove(other);
    else
        scene.remove(*bodies[3]);
    scene.run(0.5, kStep);
    EXPECT_TRUE(cloth.shell().positions().allFinite());
    EXPECT_EQ(scene.shells->lastStep().rejectedSteps, 0);
    return cloth.shell().velocities().colwise().norm().maxCoeff();
}

/// Then the solve is left as it is.
TEST(Unforeseen, ABodyOrAShellMayBeGoneBeforeItsSolveIsDoneAnew) {
    for (const bool isShell : {false, true}) {
        std::vector<double> speeds;
        for (int start = 0; start < 3; ++start) speeds.push_back(speedWithoutAnother(isShell, start));
        EXPECT_LT(medianOf(speeds), 10.0);
    }
}

}  // namespace
}  // namespace jacket::bullet::testing
