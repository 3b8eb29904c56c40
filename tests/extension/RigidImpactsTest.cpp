// What is foreseen of an impact, against what Bullet then does.
#include "RigidImpacts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory_resource>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

constexpr double kLeftOver = 1e-3;  ///< by Bullet's solver, in its ten iterations [m/s]

/// A body that comes to the floor at `speed`: how far above it [m], and what the pair gives back of its speed.
struct Coming {
    double gap, speed, restitution;
};
void PrintTo(const Coming& c, std::ostream* to) {
    *to << c.gap << " m, " << c.speed << " m/s, restitution " << c.restitution;
}

class RigidImpacts : public ::testing::TestWithParam<Coming> {
  protected:
    BulletScene scene{0.0};
    btRigidBody& floor = scene.addBox(btVector3(1, 1, 1), 0.0, btVector3(0, -1, 0));
    std::pmr::vector<RigidImpact> impacts;

    /// Speed of the body after Bullet's step, upwards, and the largest that was foreseen before it; `least`: see
    /// foreseeImpact.
    std::pair<double, double> land(btRigidBody& body, double least = 0.0) {
        const auto [gap, speed, restitution] = GetParam();
        floor.setRestitution(1);
        body.setRestitution(btScalar(restitution));
        body.setLinearVelocity(btVector3(0, btScalar(-speed), 0));
        foreseeImpact(scene.world, body, floor, kStep, least, impacts);
        double foreseen = -speed;
        for (const RigidImpact& impact : impacts)
            for (const auto& point : impact.points) {
                EXPECT_EQ(impact.first, &body);
                EXPECT_EQ(impact.second, &floor);
                EXPECT_NEAR(point.normal.y(), 1.0, 1e-6);
                EXPECT_NEAR(point.onSecond.y(), 0.0, 1e-5);
                EXPECT_NEAR(point.onFirst.y(), gap, 1e-5);
                foreseen = std::max(foreseen, point.opening);
            }
        scene.step(kStep);
        return {double(body.getLinearVelocity().y()), foreseen};
    }
};

TEST_P(RigidImpacts, OfABallAreThoseThatBulletFinds) {
    const auto [actual, foreseen] = land(scene.addSphere(0.2, 1.0, btVector3(0, btScalar(0.2 + GetParam().gap), 0)));
    EXPECT_NEAR(actual, foreseen, kLeftOver);
}

TEST_P(RigidImpacts, OfABoxAreThoseThatBulletFinds) {
    constexpr btScalar half = btScalar(0.2);
    const auto [actual, foreseen] =
        land(scene.addBox(btVector3(half, half, half), 1.0, btVector3(0, half + btScalar(GetParam().gap), 0)));
    EXPECT_NEAR(actual, foreseen, kLeftOver);
}

TEST_P(RigidImpacts, OfLittleAreLeftOutWhereThatIsAsked) {
    btRigidBody& ball = scene.addSphere(0.2, 1.0, btVector3(0, btScalar(0.2 + GetParam().gap), 0));
    land(ball, 100.0);
    EXPECT_TRUE(impacts.empty());
}

TEST_P(RigidImpacts, LeaveNothingInTheWorld) {
    btRigidBody& ball = scene.addSphere(0.2, 1.0, btVector3(0, btScalar(0.2 + GetParam().gap), 0));
    foreseeImpact(scene.world, ball, floor, kStep, 0.0, impacts);
    EXPECT_EQ(scene.dispatcher.getNumManifolds(), 0);
}

INSTANTIATE_TEST_SUITE_P(Coming, RigidImpacts,
                         ::testing::Values(Coming{0.003, 3.0, 0.0}, Coming{0.003, 3.0, 0.5}, Coming{0.003, 0.1, 0.0},
                                           Coming{0.01, 3.0, 0.0}, Coming{-0.01, 3.0, 0.0}, Coming{-0.01, 3.0, 0.5},
                                           Coming{-0.06, 3.0, 0.0}, Coming{-0.01, -1.0, 0.0}, Coming{0.05, 3.0, 0.0}));

TEST(ForeseenImpact, IsNoneWhereBulletLetsThemPass) {
    BulletScene scene(0.0);
    btRigidBody& ball = scene.addSphere(0.2, 1.0, btVector3(0, btScalar(0.19), 0));
    btRigidBody& ghost = scene.addFloor();
    ball.setIgnoreCollisionCheck(&ghost, true);
    ball.setLinearVelocity(btVector3(0, -3, 0));
    std::pmr::vector<RigidImpact> impacts;
    foreseeImpact(scene.world, ball, ghost, kStep, 0.0, impacts);
    EXPECT_TRUE(impacts.empty());
}

}  // namespace
}  // namespace jacket::bullet::testing
