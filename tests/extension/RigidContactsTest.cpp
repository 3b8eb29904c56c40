// What is foreseen of the friction that bodies feel among each other, against what Bullet then does.
#include "RigidContacts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory_resource>

#include "BodyTwist.h"
#include "Obstacles.h"
#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

constexpr double kFloor = 1.0;        ///< friction of the floor
constexpr double kNearlyNone = 4e-3;  ///< by Bullet's solver, in its ten iterations [m/s]

class ForeseenFriction : public ::testing::Test {
  protected:
    BulletScene scene;
    btRigidBody& floor = scene.addBox(btVector3(20, 1, 20), 0.0, btVector3(0, -1, 0));

    ForeseenFriction() { floor.setFriction(kFloor); }

    /// It does not turn: on two or three of its corners, as Bullet holds it by turns, it would rock.
    btRigidBody& addCube(double friction, double height) {
        constexpr btScalar half = btScalar(0.1);
        btRigidBody& cube = scene.addBox(btVector3(half, half, half), 1.0, btVector3(0, half + btScalar(height), 0));
        cube.setFriction(btScalar(friction));
        cube.setAngularFactor(0);
        return cube;
    }
    Vec6 foreseen(btRigidBody& body) {
        scene.world.applyGravity();
        RigidContacts contacts(scene.world, kStep, false, *std::pmr::get_default_resource());
        btCollisionObject* const object = &body;
        contacts.join({&object, 1});
        Obstacles obstacles;
        const Vec6 twist = obstacles.make(body, kStep, &contacts, false).body.freeTwist;
        scene.world.clearForces();
        return twist;
    }
    /// Of the body's velocity after the next step [m/s].
    double errorOfForesight(btRigidBody& body) {
        const Vec3 before = foreseen(body).head<3>();
        scene.step(kStep);
        return (before - toVec3(body.getLinearVelocity())).norm();
    }
};

/// Gravity alone would give it 55 mm/s in a step.
TEST_F(ForeseenFriction, HoldsWhatRestsOnASlope) {
    scene.world.setGravity(btVector3(btScalar(3.3), btScalar(-9.2), 0));
    btRigidBody& cube = addCube(1.0, 0.0);
    scene.run(0.5, kStep);
    EXPECT_LT(errorOfForesight(cube), kNearlyNone);
}

TEST_F(ForeseenFriction, HoldsPilesOnASlope) {
    scene.world.setGravity(btVector3(btScalar(3.3), btScalar(-9.2), 0));
    btRigidBody &lower = addCube(1.0, 0.0), &upper = addCube(1.0, 0.2);
    scene.run(0.5, kStep);
    EXPECT_LT(std::abs(foreseen(lower)[0]), kNearlyNone);
    EXPECT_LT(std::abs(foreseen(upper)[0]), kNearlyNone);
}

/// By 50 mm/s in a step, and not beyond a standstill.
TEST_F(ForeseenFriction, SlowsWhatSlidesDownUntilItStands) {
    btRigidBody& cube = addCube(0.3, 0.0);
    scene.run(0.1, kStep);
    cube.setLinearVelocity(btVector3(1, 0, 0));
    scene.step(kStep);
    int steps = 0;
    for (; toVec3(cube.getLinearVelocity()).norm() > kNearlyNone; ++steps)
        ASSERT_LT(errorOfForesight(cube), kNearlyNone) << "step " << steps;
    EXPECT_NEAR(steps, 19, 2);
}

/// Friction of an impact is a multiple of what it is in the step after that.
TEST_F(ForeseenFriction, OfAnImpactIsOverWithIt) {
    btRigidBody& cube = addCube(0.3, 0.5);
    cube.setLinearVelocity(btVector3(3, 0, 0));
    double before = 3.0;
    while (before == 3.0) {
        scene.step(kStep);
        before = double(cube.getLinearVelocity().x());
    }
    ASSERT_LT(before, 2.5);
    EXPECT_LT(errorOfForesight(cube), 0.3 * kStep * 9.81 + kNearlyNone);
}

TEST_F(ForeseenFriction, CarriesWhatLiesOnAMovingFloor) {
    makeKinematic(floor);
    btRigidBody& cube = addCube(1.0, 0.0);
    const auto moveFloor = [&](int step) {
        floor.setWorldTransform(btTransform(btQuaternion::getIdentity(), btVector3(btScalar(kStep * step), -1, 0)));
    };
    cube.setLinearVelocity(btVector3(1, 0, 0));
    for (int step = 1; step <= 30; ++step) {
        moveFloor(step);
        scene.step(kStep);
    }
    EXPECT_NEAR(foreseen(cube)[0], 1.0, kNearlyNone);
}

TEST_F(ForeseenFriction, RollsABallDownASlope) {
    scene.world.setGravity(btVector3(btScalar(3.3), btScalar(-9.2), 0));
    btRigidBody& ball = scene.addSphere(0.1, 1.0, btVector3(0, btScalar(0.1), 0));
    scene.run(0.5, kStep);
    const Vec6 before = foreseen(ball);
    scene.step(kStep);
    EXPECT_NEAR(before[0], double(ball.getLinearVelocity().x()), kNearlyNone);
    EXPECT_NEAR(0.1 * before[5], 0.1 * double(ball.getAngularVelocity().z()), kNearlyNone);
}

}  // namespace
}  // namespace jacket::bullet::testing
