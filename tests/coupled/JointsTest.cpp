// Shells on bodies that Bullet's joints hold.
#include <btBulletDynamicsCommon.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <ostream>
#include <tuple>
#include <vector>

#include "support/PlateScene.h"

namespace jacket::bullet::testing {
namespace {

/// Boards of 30 x 4 x 30 cm, 1 m up, and what holds them.
struct JointScene : BulletScene {
    /// With ten, as usual, Bullet leaves more of the error of joints that two bodies share.
    JointScene() { world.getSolverInfo().m_numIterations = 50; }
    btRigidBody& addBoard(double mass) {
        btRigidBody& board =
            addBox(btVector3(btScalar(0.15), btScalar(0.02), btScalar(0.15)), mass, btVector3(0, 1, 0));
        board.setActivationState(DISABLE_DEACTIVATION);
        return board;
    }
    ShellBody& addCloth(double height) {
        ShellBody& cloth = shells->add(squareSheet(0.6, 12), materials::cotton(), {.friction = 0.5});
        place(cloth, {0.003, height, 0.01});
        return cloth;
    }
};

btTransform frameAt(const btVector3& origin) {
    return btTransform(btQuaternion::getIdentity(), origin);
}

struct Kind {
    const char* name;
    double deepest;  ///< that cloth may stand in the board: what Bullet leaves of the joint's error, times the step [m]
    void (*hold)(JointScene& scene, btRigidBody& board);
};
void PrintTo(const Kind& kind, std::ostream* to) {
    *to << kind.name;
}

const Kind kKinds[] = {
    {"four points", 5e-4,
     [](JointScene& scene, btRigidBody& board) {
         for (const double x : {-0.15, 0.15})
             for (const double z : {-0.15, 0.15})
                 scene.addJoint(
                     std::make_unique<btPoint2PointConstraint>(board, btVector3(btScalar(x), 0, btScalar(z))));
     }},
    {"six degrees of freedom, all locked", 5e-4,
     [](JointScene& scene, btRigidBody& board) {
         auto& joint =
             scene.addJoint(std::make_unique<btGeneric6DofSpring2Constraint>(board, frameAt(btVector3(0, 1, 0))));
         for (int axis = 0; axis < 6; ++axis) joint.setLimit(axis, 0, 0);
     }},
    {"slider with a strong motor", 5e-4,
     [](JointScene& scene, btRigidBody& board) {
         auto& joint = scene.addJoint(std::make_unique<btSliderConstraint>(board, frameAt(btVector3(0, 0, 0)), true));
         joint.setLowerLinLimit(1);
         joint.setUpperLinLimit(-1);
         joint.setLowerAngLimit(0);
         joint.setUpperAngLimit(0);
         joint.setPoweredLinMotor(true);
         joint.setTargetLinMotorVelocity(btScalar(0.3));
         joint.setMaxLinMotorForce(1000);
     }},
    {"seesaw", 5e-4,
     [](JointScene& scene, btRigidBody& board) {
         scene.addJoint(
             std::make_unique<btHingeConstraint>(board, btVector3(btScalar(-0.03), 0, 0), btVector3(0, 0, 1)));
     }},
    {"arm of a heavy wheel", 3e-3,
     [](JointScene& scene, btRigidBody& board) {
         btRigidBody& wheel =
             scene.addBody(std::make_unique<btCylinderShapeZ>(btVector3(btScalar(0.3), btScalar(0.3), btScalar(0.05))),
                           5.0, btVector3(btScalar(-0.5), 1, 0));
         wheel.setActivationState(DISABLE_DEACTIVATION);
         scene.addJoint(std::make_unique<btHingeConstraint>(wheel, btVector3(0, 0, 0), btVector3(0, 0, 1)));
         scene.addJoint(std::make_unique<btFixedConstraint>(board, wheel, frameAt(btVector3(btScalar(-0.25), 0, 0)),
                                                            frameAt(btVector3(btScalar(0.25), 0, 0))));
     }},
};

/// What holds the board, its mass [kg], and the step [s].
class JointedBoard : public ::testing::TestWithParam<std::tuple<Kind, double, double>> {};

TEST_P(JointedBoard, ClothThatFallsOnItStaysOutOfIt) {
    const auto& [kind, mass, h] = GetParam();
    JointScene scene;
    btRigidBody& board = scene.addBoard(mass);
    kind.hold(scene, board);
    const ShellBody& cloth = scene.addCloth(1.2);
    double deepest = 0.0;
    int unsettled = 0;
    for (int i = 0; i < int(0.7 / h); ++i) {
        scene.step(h);
        deepest = std::max(deepest, penetration(cloth, board));
        unsettled += !scene.shells->lastStep().settled;
    }
    EXPECT_LT(deepest, kind.deepest);
    EXPECT_LE(unsettled, 3);
}

INSTANTIATE_TEST_SUITE_P(Kinds, JointedBoard,
                         ::testing::Combine(::testing::ValuesIn(kKinds), ::testing::Values(0.1, 0.5),
                                            ::testing::Values(kStep, kStep / 4)));

/// The nail bears the board and what lies on it, and the board stays where it is.
TEST(Joints, BearWhatLiesOnABody) {
    JointScene scene;
    btRigidBody& board = scene.addBoard(0.2);
    auto& nail = scene.addJoint(std::make_unique<btGeneric6DofSpring2Constraint>(board, frameAt(btVector3(0, 1, 0))));
    for (int axis = 0; axis < 6; ++axis) nail.setLimit(axis, 0, 0);
    btJointFeedback feedback;
    nail.setJointFeedback(&feedback);
    ShellBody& plate = scene.shells->add(squareSheet(0.2, 6), materials::steel(1e-3), {.friction = 0.5});
    place(plate, {0, 1.0205, 0});
    scene.run(1.0, kStep);
    double force = 0.0, lowest = 0.0;
    constexpr int kSteps = 60;
    for (int i = 0; i < kSteps; ++i) {
        scene.step(kStep);
        force += std::abs(double(feedback.m_appliedForceBodyA.y())) / kSteps;
        lowest = std::min(lowest, double(board.getWorldTransform().getOrigin().y()) - 1.0);
    }
    const double weight = 9.81 * (0.2 + 7850 * 1e-3 * 0.2 * 0.2);
    EXPECT_NEAR(force, weight, 1e-2 * weight);
    EXPECT_GT(lowest, -1e-4);
}

/// How far a board that hangs by a ball and socket swings out, with a light cloth tied to it or without [m].
double swing(bool hasCloth) {
    JointScene scene;
    btRigidBody& board = scene.addBoard(0.5);
    scene.addJoint(std::make_unique<btPoint2PointConstraint>(board, btVector3(0, btScalar(0.6), 0)));
    if (hasCloth) {
        ShellBody& cloth = scene.shells->add(squareSheet(0.2, 6), trampolineCloth());
        place(cloth, {0, 0.97, 0});
        cloth.anchor(0, board);
    }
    board.setLinearVelocity(btVector3(btScalar(0.5), 0, 0));
    board.setAngularVelocity(btVector3(0, 0, btScalar(0.5 / 0.6)));
    double farthest = 0.0;
    for (int i = 0; i < 60; ++i) {
        scene.step(kStep);
        farthest = std::max(farthest, double(board.getWorldTransform().getOrigin().x()));
    }
    return farthest;
}

/// Joints hold bodies only as they do: the board swings as if there were no shell.
TEST(Joints, LetABodySwing) {
    const double alone = swing(false);
    EXPECT_GT(alone, 0.08);
    EXPECT_NEAR(swing(true), alone, 0.05 * alone);
}

/// The scene's own joints go with a body that is removed.
TEST(Joints, GoWithTheirBodies) {
    JointScene scene;
    btRigidBody& board = scene.addBoard(0.5);
    scene.addJoint(std::make_unique<btPoint2PointConstraint>(board, btVector3(0, 0, 0)));
    scene.addCloth(1.05);
    scene.run(0.1, kStep);
    scene.remove(board);
    EXPECT_EQ(scene.world.getNumConstraints(), 0);
    scene.run(0.1, kStep);
    EXPECT_TRUE(scene.shells->lastStep().finite);
}

}  // namespace
}  // namespace jacket::bullet::testing
