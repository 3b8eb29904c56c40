// Bodies that their user moves: shells go with them, whenever they start and stop.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "support/KinematicScenes.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::contactImpulse;
using jacket::testing::Scene;

/// Moves a kinematic ball, by hand or by a motion state.
class KinematicBall : public ::testing::TestWithParam<bool> {
  protected:
    KinematicBall() : ball(scene.addSphere(0.2, 0, btVector3(0, btScalar(-0.3), 0))) {
        makeKinematic(ball);
        if (GetParam()) ball.setMotionState(&motion);
    }
    void moveTo(double height) {
        btTransform pose = btTransform::getIdentity();
        pose.setOrigin(btVector3(0, btScalar(height), 0));
        if (GetParam())
            motion.setWorldTransform(pose);
        else
            ball.setWorldTransform(pose);
    }
    btDefaultMotionState motion{btTransform(btQuaternion::getIdentity(), btVector3(0, btScalar(-0.3), 0))};
    Scene<> scene{0.0};
    btRigidBody& ball;
};

TEST_P(KinematicBall, PushesASheetAlong) {
    auto& sheet = scene.shells->add(squareSheet(1, 10), trampolineCloth());
    for (int i = 1; i <= 60; ++i) {
        moveTo(-0.3 + i * kStep);
        scene.step(kStep);
        ASSERT_LT(penetration(sheet, ball), 3e-4) << "step " << i;
    }
    EXPECT_GT(sheet.shell().positions().row(1).mean(), 0.3);
    EXPECT_NEAR(double(sheet.linearMomentum().y()), 0.3, 0.1);  // 0.3 kg at the ball's 1 m/s
}

TEST_P(KinematicBall, ThrowsNothingWhenItIsTeleported) {
    auto& sheet = scene.shells->add(squareSheet(1, 10), trampolineCloth());
    scene.run(0.1, kStep);
    moveTo(10.0);  // through the sheet
    scene.run(0.2, kStep);
    EXPECT_LT(sheet.shell().velocities().norm(), 1e-9);
}
INSTANTIATE_TEST_SUITE_P(MotionState, KinematicBall, ::testing::Bool());

/// A cloth of 0.6 m on a kinematic plate. Parameters: step [s], substeps of a frame.
class KinematicPlate : public ::testing::TestWithParam<std::tuple<double, int>> {
  protected:
    KinematicPlate() {
        makeKinematic(plate);
        TriangleMesh mesh = squareSheet(0.6, 6);
        mesh.positions.row(1).array() += 1e-3;
        sheet = &scene.shells->add(mesh, trampolineCloth(), {.friction = 0.8});
        plate.setFriction(1);
        for (double t = 0; t < 0.3; t += frameTime()) frame(Vec3::Zero());
    }
    double frameTime() const { return std::get<0>(GetParam()) * std::get<1>(GetParam()); }
    /// One stepSimulation that takes the plate on by `way` [m] and turns it by `angle` [rad].
    void frame(const Vec3& way, double angle = 0.0) {
        const auto [h, substeps] = GetParam();
        btTransform pose = plate.getWorldTransform();
        pose.getOrigin() += btVector3(btScalar(way.x()), btScalar(way.y()), btScalar(way.z()));
        pose.setRotation(btQuaternion(btVector3(0, 1, 0), btScalar(angle)) * pose.getRotation());
        plate.setWorldTransform(pose);
        scene.world.stepSimulation(btScalar(frameTime()), substeps + 1, btScalar(h));
        deepest = std::max(deepest, penetration(*sheet, plate));
    }
    /// Of the sheet's highest vertex [m].
    double gap() const {
        return sheet->shell().positions().row(1).maxCoeff() - double(plate.getWorldTransform().getOrigin().y()) - 0.05;
    }
    btVector3 onPlate(int vertex) const { return plate.getWorldTransform().inverse() * sheet->positions()[vertex]; }
    double deepest = 0.0;  ///< [m]
    Scene<> scene;
    btRigidBody& plate =
        scene.addBox(btVector3(btScalar(0.4), btScalar(0.05), btScalar(0.4)), 0.0, btVector3(0, btScalar(-0.05), 0));
    ShellBody* sheet = nullptr;
};

TEST_P(KinematicPlate, LiftsASheetFromTheFirstStepOnAndStopsAtOnce) {
    constexpr double kSpeed = 0.5, kFlight = kSpeed * kSpeed / (2 * 9.81);  // [m/s], height that it throws by [m]
    for (double t = 0; t < 0.3; t += frameTime()) {
        frame({0, kSpeed * frameTime(), 0});
        EXPECT_LT(gap(), 2e-3) << "lifted for " << t << " s";
    }
    EXPECT_NEAR(double(sheet->linearMomentum().y()) / sheet->shell().masses().sum(), kSpeed, 1e-2 * kSpeed);
    for (double t = 0; t < 0.5; t += frameTime()) {
        frame(Vec3::Zero());
        EXPECT_LT(gap(), kFlight + 2e-3);
    }
    EXPECT_LT(deepest, 5e-5);
}

/// With 2 m/s^2, where mu g is 7.8, and at 0.2 rad/s.
TEST_P(KinematicPlate, TakesASheetAlongByFriction) {
    constexpr double kAcceleration = 2.0, kStarting = 0.2, kSpin = 0.2;  // [m/s^2], [s], [rad/s]
    std::vector<btVector3> start;
    for (int i = 0; i < sheet->vertexCount(); ++i) start.push_back(onPlate(i));
    for (double t = 0; t < 1.0; t += frameTime())
        frame({frameTime() * kAcceleration * std::min(t, kStarting), 0, 0}, kSpin * frameTime());
    double slipped = 0.0;
    for (int i = 0; i < sheet->vertexCount(); ++i)
        slipped = std::max(slipped, double((onPlate(i) - start[i]).length()));
    EXPECT_LT(slipped, 1e-3);
    EXPECT_LT(deepest, 5e-5);
}

TEST_P(KinematicPlate, LiftsASheetThatSleepsOnIt) {
    plate.forceActivationState(ACTIVE_TAG);
    for (double t = 0; t < 6.0 && !sheet->isAsleep(); t += frameTime()) frame(Vec3::Zero());
    ASSERT_TRUE(sheet->isAsleep());
    for (double t = 0; t < 0.1; t += frameTime()) frame({0, 0.5 * frameTime(), 0});
    EXPECT_FALSE(sheet->isAsleep());
    EXPECT_LT(gap(), 2e-3);
    EXPECT_LT(deepest, 5e-5);
}
INSTANTIATE_TEST_SUITE_P(Steps, KinematicPlate,
                         ::testing::Combine(::testing::Values(kStep, kStep / 4), ::testing::Values(1, 4)));

/// What lies on the carpet, speed of the board [m/s].
class LiftedCarpet : public ::testing::TestWithParam<std::tuple<std::string, double>> {
  protected:
    /// Deepest that the carpet stands in the board in any step [m].
    static double deepest(const std::string& load, double speed, int start) {
        BulletScene scene;
        auto& board = scene.addBox(btVector3(btScalar(0.5), btScalar(0.05), btScalar(0.5)), 0, btVector3(0, 0, 0));
        makeKinematic(board);
        auto& carpet = scene.shells->add(squareSheet(1.2, 16), materials::cotton(), {.friction = 0.5});
        place(carpet, {0.01 + 0.003 * start, 0.051, 0.02 + 0.0017 * start});
        const btVector3 at(btScalar(0.02), btScalar(0.152), btScalar(0.03));
        if (load == "ball") scene.addSphere(0.1, 0.3, at);
        if (load == "box") scene.addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 0.3, at);
        double depth = 0.0;
        for (int i = 0; i < 90; ++i) {
            btTransform pose = btTransform::getIdentity();
            pose.setOrigin(btVector3(0, btScalar(speed * kStep * std::clamp(i - 30, 0, 30)), 0));
            board.setWorldTransform(pose);
            scene.step(kStep);
            depth = std::max(depth, penetration(carpet, board));
        }
        return depth;
    }
};

/// The median of five starts: a load that comes down again pushes the carpet in by a millimetre or more in 3 to 6 of
/// 216.
TEST_P(LiftedCarpet, LiesOnTheBoard) {
    const auto [load, speed] = GetParam();
    std::vector<double> depths;
    for (const int start : {0, 1, 2, 3, 4}) depths.push_back(deepest(load, speed, start));
    EXPECT_LT(medianOf(depths), 5e-4);
}
INSTANTIATE_TEST_SUITE_P(Loads, LiftedCarpet,
                         ::testing::Combine(::testing::Values("none", "ball", "box"),
                                            ::testing::Values(0.5, 1.0, 3.0)));

/// What a sheet gets is what it gives, also where that is known only when the step is over.
TEST(Kinematic, TheLedgerAddsUp) {
    Scene<> scene(0.0);
    auto& ball = scene.addSphere(0.2, 0, btVector3(0, btScalar(-0.25), 0));
    makeKinematic(ball);
    auto& sheet = scene.shells->add(squareSheet(1, 10), trampolineCloth());
    for (int i = 1; i <= 40; ++i) {
        btTransform pose = ball.getWorldTransform();
        pose.getOrigin() += btVector3(0, btScalar(std::min(0.5 * i, 10.0) * 1e-3), 0);
        ball.setWorldTransform(pose);
        const ShellLedger before = sheet.ledger();
        scene.step(kStep);
        const ShellLedger after = sheet.ledger();
        EXPECT_LT((after.momentum - before.momentum + after.exchanged - before.exchanged).norm(), 1e-9);
        EXPECT_LT((after.exchanged - before.exchanged - contactImpulse(sheet, ball)).norm(), 1e-12);
    }
    EXPECT_GT(sheet.ledger().momentum.y(), 0.05);
}

TEST(Kinematic, AnAnchorIsWhereItsBodyIsInEveryStep) {
    Scene<> scene;
    auto& pole = scene.addBox(btVector3(btScalar(0.02), btScalar(0.3), btScalar(0.02)), 0, btVector3(-1, 0, 0));
    makeKinematic(pole);
    auto& flag = scene.shells->add(squareSheet(0.4, 8), trampolineCloth());
    std::vector<int> anchored;
    for (int i = 0; i < flag.vertexCount(); ++i)
        if (flag.shell().positions()(0, i) < -0.199) anchored.push_back(i);
    std::vector<btVector3> local;
    for (const int i : anchored) {
        flag.anchor(i, pole);
        local.push_back(pole.getWorldTransform().inverse() * flag.positions()[i]);
    }
    for (int i = 0; i < 120; ++i) {
        const double t = i * kStep, way = i < 30 ? 0.0 : i < 60 ? 1.0 * (t - 0.5) : 0.5;  // starts and stops at once
        pole.setWorldTransform(btTransform(btQuaternion(btVector3(0, 1, 0), btScalar(i < 60 ? 0.0 : 3.0 * (t - 1.0))),
                                           btVector3(btScalar(-1 + way), 0, 0)));
        scene.step(kStep);
        for (std::size_t k = 0; k < anchored.size(); ++k)
            EXPECT_LT((pole.getWorldTransform() * local[k] - flag.positions()[anchored[k]]).length(),
                      btScalar(bulletTolerance(1e-9, 1e-6)))
                << "step " << i;
        EXPECT_LT(flag.shell().maxStretch(), 0.1) << "step " << i;
    }
}

/// Under a cloth. Parameters: shape, cells of the cloth's side.
class KinematicCourse : public ::testing::TestWithParam<std::tuple<std::string, int>> {
  protected:
    /// Deepest that the cloth stands inside, the median of nine starts 10 um apart: in some (of mesh, shaken, 15 of
    /// 40) a corner comes in for a step. `z`: where the body is beside the course [m].
    static double medianDepth(const Course& course, double z) {
        const auto& [name, cells] = GetParam();
        const auto isMeant = [&](const Pusher& pusher) { return pusher.name == name; };
        const Pusher& pusher = *std::find_if(std::begin(kPushers), std::end(kPushers), isMeant);
        std::vector<double> depths;
        for (int start = 0; start < 9; ++start)
            depths.push_back(
                KinematicScene{materials::cotton(), course, pusher, cells, kStep, {1e-5 * start, 0, z}}.run().deepest);
        return medianOf(depths);
    }
};

TEST_P(KinematicCourse, ATurningBodyDoesNotComeThrough) {
    EXPECT_LT(medianDepth(courses::kSpin, 0.0), 3e-4);
}
TEST_P(KinematicCourse, AShakenBodyKeepsTheClothOff) {
    EXPECT_LT(medianDepth(courses::kShake, -0.02), 3e-4);
}
INSTANTIATE_TEST_SUITE_P(Shapes, KinematicCourse,
                         ::testing::Combine(::testing::Values("box", "mesh", "capsule", "disc"),
                                            ::testing::Values(5, 12)));

/// Into a few large triangles with a corner that is pinned: each step adds less to the depth than is looked at, and
/// nothing took it back.
TEST(KinematicRod, ThatIsPressedDownDoesNotSinkInLittleByLittle) {
    for (const ShellMaterial& material : {materials::cotton(), materials::paper(), materials::rubber()})
        EXPECT_LT((KinematicScene{material, courses::kPress, kPushers[5], 5, kStep / 4}.run().deepest), 3e-4);
}

/// Two kinematic boxes close on the edge of a sheet that lies on a table, then lift it. `squeeze`: how much nearer than
/// the sheet is thick each of them comes.
class KinematicJaws : public ::testing::TestWithParam<std::tuple<double, double>> {
  protected:
    static constexpr double kHalf = 0.02, kOpen = 0.05;
    btRigidBody& addJaw() {
        auto& jaw =
            scene.addBody(std::make_unique<btBoxShape>(btVector3(btScalar(0.02), btScalar(kHalf), btScalar(0.05))), 0.0,
                          btVector3(0, -2, 0));
        makeKinematic(jaw);
        jaw.setFriction(1);
        return jaw;
    }
    static void moveTo(btRigidBody& jaw, double height) {
        jaw.setWorldTransform(btTransform(btQuaternion::getIdentity(), btVector3(btScalar(0.09), btScalar(height), 0)));
    }
    Scene<> scene;
};

TEST_P(KinematicJaws, HoldASheetBetweenThem) {
    const auto [squeeze, h] = GetParam();
    const ShellMaterial cloth = trampolineCloth();
    auto& sheet = scene.shells->add(squareSheet(0.2, 6), cloth, {.friction = 1.0});
    auto& table = scene.addBody(std::make_unique<btBoxShape>(btVector3(btScalar(0.3), btScalar(0.05), btScalar(0.3))),
                                0.0, btVector3(btScalar(-0.25), btScalar(-0.05 - 0.5 * cloth.thickness - 1e-5), 0));
    table.setFriction(1);
    btRigidBody &upper = addJaw(), &lower = addJaw();
    int gripped = 0;
    (sheet.shell().positions().colwise() - Vec3(0.1, 0, 0)).colwise().norm().minCoeff(&gripped);
    double lift = 0.0;
    for (double t = h; t < 2.5; t += h) {
        const double closed = std::min(1.0, t / 0.5);
        const double gap = kOpen * (1.0 - closed) + closed * (0.5 * cloth.thickness - squeeze);
        lift = std::clamp(0.2 * (t - 0.8), 0.0, 0.2);
        moveTo(upper, lift + gap + kHalf);
        moveTo(lower, lift - gap - kHalf);
        scene.step(h);
        if (t <= 1.0) continue;
        EXPECT_NEAR(sheet.shell().positions()(1, gripped), lift, 5e-3) << "at " << t << " s";
    }
    EXPECT_LT(sheet.shell().maxStretch(), 0.1);
}
INSTANTIATE_TEST_SUITE_P(Grid, KinematicJaws,
                         ::testing::Combine(::testing::Values(0.0, 2e-5, 1e-4), ::testing::Values(kStep, kStep / 4)));

}  // namespace
}  // namespace jacket::bullet::testing
