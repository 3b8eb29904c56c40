#include "solver/BodySupports.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace jacket {
namespace {

/// A body of the given mass, with unit inertia, that falls at 1 m/s.
CoupledBody falling(double mass) {
    CoupledBody body;
    body.mass.setIdentity();
    body.mass.topLeftCorner<3, 3>() *= mass;
    body.freeTwist[1] = -1.0;
    return body;
}

Vec6 up() {
    return Vec6::Unit(1);
}

/// Of body 1 on body 0, below its centre.
RigidContact onTop(double weight) {
    return {.a = 0, .b = 1, .rowA = -up(), .rowB = up(), .weight = weight};
}

TEST(BodySupports, APileStopsAsOneOnWhatBearsItsLowestBody) {
    std::vector<CoupledBody> bodies{falling(1), falling(10)};
    const BodySupport ground[] = {{up(), 0.0, 1e4}};  // mass and free twist as if it held
    bodies[0].supports = ground;
    bodies[0].mass += 1e4 * up() * up().transpose();
    bodies[0].freeTwist[1] = -1.0 / 10001;
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{onTop(1e5)}, {0, 1});
    // 11 kg m/s on the ground's 1e4 kg.
    EXPECT_NEAR(supports.freeTwists()[0][1], -11.0 / 10011, 1e-6);
    EXPECT_NEAR(supports.freeTwists()[1][1], -11.0 / 10011, 2e-4);
    ASSERT_EQ(supports.couplings().size(), 1u);
    EXPECT_EQ(supports.couplings()[0].mass(1, 1), -1e5);
}

/// As Bullet's solve has it: they part as fast as they are to, with what momentum they had.
TEST(BodySupports, APairPartsAtLeastAsFastAsItIsTo) {
    std::vector<CoupledBody> bodies{falling(1), falling(1)};
    bodies[0].freeTwist[1] = 0.0;
    RigidContact pair = onTop(1e6);
    pair.velocity = 0.3;
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{pair}, {0, 1});
    EXPECT_NEAR(supports.freeTwists()[0][1], -0.65, 1e-5);
    EXPECT_NEAR(supports.freeTwists()[1][1], -0.35, 1e-5);
    Eigen::Matrix<double, 6, Eigen::Dynamic> slower(6, 2), faster(6, 2);
    slower << Vec6::Zero(), 0.2 * up();
    faster << Vec6::Zero(), 0.4 * up();
    EXPECT_FALSE(supports.update(slower, 0.1));
    EXPECT_TRUE(supports.update(faster, 0.1));
    EXPECT_NEAR(supports.freeTwists()[0][1], 0.0, 1e-9);
    EXPECT_NEAR(supports.freeTwists()[1][1], -1.0, 1e-9);
}

TEST(BodySupports, StiffTermsHaveNoEnergy) {
    std::vector<CoupledBody> bodies{falling(1), falling(10)};
    const BodySupport ground[] = {{up(), 0.5, 1e4}};
    bodies[0].supports = ground;
    bodies[0].mass += 1e4 * up() * up().transpose();
    RigidContact pair = onTop(1e5);
    pair.velocity = 0.3;
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{pair}, {0, 1});
    Eigen::Matrix<double, 6, Eigen::Dynamic> twists(6, 2);
    twists << 2.0 * up(), 3.0 * up();
    EXPECT_NEAR(supports.kineticEnergy(twists), 0.5 * 1 * 4 + 0.5 * 10 * 9, 1e-6);
}

TEST(BodySupports, APairLetsGoWhereItPullsAndComesBackOnce) {
    const std::vector<CoupledBody> bodies{falling(1), falling(1)};
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{onTop(1e4)}, {0, 1});
    const Mat6 joined = supports.masses()[0];
    Eigen::Matrix<double, 6, Eigen::Dynamic> apart(6, 2), together(6, 2);
    apart << -up(), up();
    together << up(), -up();
    for (int i = 0; i < 2; ++i) {
        EXPECT_FALSE(supports.update(together, 0.1));  // pressed it stays
        EXPECT_TRUE(supports.update(apart, 0.1));
        EXPECT_NEAR(supports.masses()[0](1, 1), 1.0, 1e-9);
        EXPECT_NEAR(supports.couplings()[0].mass(1, 1), 0.0, 1e-9);
        EXPECT_NEAR(supports.freeTwists()[1][1], -1.0, 1e-9);
        EXPECT_FALSE(supports.update(apart, 0.1));
        EXPECT_EQ(supports.update(together, 0.1), i == 0);
    }
    EXPECT_FALSE(supports.masses()[0].isApprox(joined));
}

/// What counts as a pull is measured by what the body itself weighs, however many contacts make it heavy.
TEST(BodySupports, TheGroundLetsGoOfABodyThatAnotherOneTouches) {
    std::vector<CoupledBody> bodies{falling(1), falling(1)};
    const BodySupport ground[] = {{up(), 0.0, 1e4}};
    bodies[0].supports = ground;
    bodies[0].mass += 1e4 * up() * up().transpose();
    Vec6 aslant = Vec6::Zero();
    aslant.head<3>() = Vec3(1, 1, 1).normalized();
    const RigidContact beside{.a = 0, .b = 1, .rowA = aslant, .rowB = -aslant, .weight = 1e4};
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{beside}, {0, 1});
    Eigen::Matrix<double, 6, Eigen::Dynamic> rising(6, 2);
    rising << 5e-4 * up(), 5e-4 * up();  // the ground pulls by 5 N s, which is 50 times what gravity does in the step
    EXPECT_TRUE(supports.update(rising, 0.1));
    EXPECT_NEAR(supports.masses()[0](1, 1), 1.0 + 1e4 / 3, 1e-6);
}

/// A beam on two feet that is lifted at one end turns about the other: no foot holds it down, and it is as light as it
/// is.
TEST(BodySupports, WhatALiftedBodyRestedOnDoesNotHoldItBack) {
    std::vector<CoupledBody> bodies{falling(1)};
    const auto foot = [](double x) { return (Vec6() << 0, 1, 0, 0, 0, x).finished(); };
    const BodySupport feet[] = {{foot(-1), 0.0, 1e4}, {foot(1), 0.0, 1e4}};
    bodies[0].supports = feet;
    Vec6 momentum = bodies[0].mass * bodies[0].freeTwist;
    for (const BodySupport& each : feet) bodies[0].mass += each.weight * each.row * each.row.transpose();
    bodies[0].freeTwist = bodies[0].mass.ldlt().solve(momentum);
    BodySupports supports;
    supports.begin(bodies, {}, {}, {0});
    EXPECT_TRUE(supports.ownMass(0).isApprox(Mat6(Mat6::Identity()), 1e-9));
    const Vec6 lift = 3.0 * foot(1);  // at an end: held by both feet the beam would stay
    const Vec6 twist = supports.respond(lift, 1.0);
    EXPECT_NEAR(twist.dot(foot(-1)), 0.0, 1e-3);
    // About the other foot: inertia 1 + 1, and an angular momentum of 2 * 3 less the weight's 1 * 1.
    EXPECT_NEAR(twist[5], (6.0 - 1.0) / 2.0, 1e-3);
    supports.begin(bodies, {}, {}, {0});
    EXPECT_LT(supports.respond(-lift, 1.0).norm(), 1e-3);  // pressed, it stays
}

/// A joint holds what is pulled as well as what is pressed.
TEST(BodySupports, AJointHoldsEitherWay) {
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    std::vector<CoupledBody> bodies{falling(1), falling(1)};
    const BodySupport nail[] = {{up(), 0.0, 1e4, {-kInfinite, kInfinite}}};
    bodies[0].supports = nail;
    bodies[0].mass += 1e4 * up() * up().transpose();
    bodies[0].freeTwist[1] = -1.0 / 10001;
    RigidContact joint = onTop(1e4);
    joint.range = {-kInfinite, kInfinite};
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{joint}, {0, 1});
    Eigen::Matrix<double, 6, Eigen::Dynamic> impulses(6, 2);
    for (const double pull : {-5.0, 5.0}) {
        impulses << Vec6::Zero(), pull * up();
        const auto& twists = supports.respond(impulses, 0.1);
        EXPECT_NEAR(twists(1, 1), (pull - 2.0) / 1e4, 2e-3);
        EXPECT_NEAR(twists(1, 0), (pull - 2.0) / 1e4, 1e-5);
    }
}

/// A motor that is to hold a body gives no more than it has, and the rest moves the body.
TEST(BodySupports, AMotorGivesWhatItHas) {
    constexpr double kStrength = 2.0;  // [N s]
    std::vector<CoupledBody> bodies{falling(1)};
    const BodySupport motor[] = {{up(), 0.0, 1e4, {-kStrength, kStrength}}};
    bodies[0].supports = motor;
    bodies[0].mass += 1e4 * up() * up().transpose();
    bodies[0].freeTwist[1] = -1.0 / 10001;
    BodySupports supports;
    for (const double pull : {-5.0, 0.0, 2.0, 7.0}) {
        supports.begin(bodies, {}, {}, {0});
        const double beyond = std::copysign(std::max(0.0, std::abs(pull - 1.0) - kStrength), pull - 1.0);
        EXPECT_NEAR(supports.respond(pull * up(), 0.1)(1, 0), beyond, 1e-3) << pull;
    }
}

/// While contacts of shells are not settled, what bears a body stays; a motor lets go, and what only lies on it.
TEST(BodySupports, MotorsAndPairsLetGoWhileTheGroundHolds) {
    std::vector<CoupledBody> bodies{falling(1), falling(1)};
    const BodySupport both[] = {{up(), 0.0, 1e4}, {Vec6::Unit(0), 0.0, 1e4, {-2.0, 2.0}}};
    bodies[0].supports = both;
    for (const BodySupport& each : both) bodies[0].mass += each.weight * each.row * each.row.transpose();
    bodies[0].freeTwist[1] = -1.0 / 10001;
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{onTop(1e4)}, {0, 1});
    Eigen::Matrix<double, 6, Eigen::Dynamic> away(6, 2);
    away << Vec6::Unit(0) + up(), 2.0 * up();  // 1e4 N s off each
    EXPECT_TRUE(supports.update(away, 0.1, true));
    EXPECT_NEAR(supports.freeTwists()[0][0], -2.0, 1e-9);
    EXPECT_NEAR(supports.masses()[0](1, 1), 10001.0, 1e-9);
    EXPECT_NEAR(supports.couplings()[0].mass(1, 1), 0.0, 1e-9);
    EXPECT_TRUE(supports.update(away, 0.1));
    EXPECT_NEAR(supports.masses()[0](1, 1), 1.0, 1e-9);
}

/// Two that a motor drives apart.
TEST(BodySupports, AMotorBetweenBodiesPushesBothAsHardAsItCan) {
    const std::vector<CoupledBody> bodies{falling(1), falling(4)};
    RigidContact motor = onTop(1e4);
    motor.velocity = 10.0;
    motor.range = {-2.0, 2.0};
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{motor}, {0, 1});
    const auto& twists = supports.respond(Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, 2), 0.1);
    EXPECT_NEAR(twists(1, 0), -1.0 - 2.0 / 1, 1e-9);
    EXPECT_NEAR(twists(1, 1), -1.0 + 2.0 / 4, 1e-9);
}

TEST(BodySupports, ABodyThatStandsStillBearsTheOther) {
    const std::vector<CoupledBody> bodies{falling(1), falling(1)};
    BodySupports supports;
    for (const std::vector<int>& dynamicIndex : {std::vector{-1, 0}, std::vector{0, -1}}) {
        supports.begin(bodies, {}, std::vector{onTop(1e4)}, dynamicIndex);
        ASSERT_EQ(supports.masses().size(), 1u);
        EXPECT_TRUE(supports.couplings().empty());
        const Vec6& row = dynamicIndex[0] < 0 ? onTop(1e4).rowB : onTop(1e4).rowA;
        EXPECT_LT((supports.masses()[0] - bodies[1].mass - 1e4 * row * row.transpose()).norm(), 1e-9);
    }
    supports.begin(bodies, {}, std::vector{onTop(1e4)}, {-1, 0});
    EXPECT_LT(supports.freeTwists()[0].norm(), 1e-3 * bodies[1].freeTwist.norm());  // it falls no more
    EXPECT_LT((supports.ownMass(0) - bodies[1].mass).norm(), 1e-9);
}

}  // namespace
}  // namespace jacket
