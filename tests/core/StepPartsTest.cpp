#include "StepParts.h"

#include <gtest/gtest.h>

#include "solver/BodySupports.h"

namespace jacket {
namespace {

constexpr double kWhole = 1.0 / 60, kBodyMass = 2.0;  // [s], [kg]

class NoContacts : public ContactDetector {
    void find(const ContactPose&, double, double, std::vector<Contact>&) override {}
};

/// A body on a ground as heavy as `weight`, under a sheet.
struct OnGround {
    explicit OnGround(double speed) {
        bodies[0].mass.setIdentity();
        bodies[0].mass.topLeftCorner<3, 3>() *= kBodyMass;
        bodies[0].mass += ground.weight * ground.row * ground.row.transpose();
        bodies[0].supports = {&ground, 1};
        bodies[0].startTwist[1] = speed;
        bodies[0].freeTwist[1] = kBodyMass * (speed - 9.81 * kWhole) / (kBodyMass + ground.weight);
        input.h = kWhole;
        input.shells = shells;
        input.bodies = bodies;
        input.contacts = &contacts;
    }
    /// A part of the step that ends with the body moving so [m/s].
    static void pass(StepParts& step, double speed) {
        CoupledBody& body = step.next().bodies[0];
        body.twist = Vec6::Unit(1) * speed;
        body.motion = step.next().h * body.twist;
        step.add({});
    }

    Shell shell{makeGrid({.size = {1, 1}, .cells = {2, 2}}), materials::cotton(), {}};
    Shell* const shells[1] = {&shell};
    BodySupport ground{Vec6::Unit(1), 0.0, 1e4 * kBodyMass};
    std::vector<CoupledBody> bodies{1};
    NoContacts contacts;
    IslandInput input;
};

/// What shells lift off the ground in a part of a step flies from there as if that had not been: the stiff term that
/// stands for the ground has no momentum.
TEST(StepParts, ABodyThatIsLiftedFliesAsByItself) {
    OnGround scene(0.0);
    StepParts step(scene.input, {});
    EXPECT_NEAR(step.next().bodies[0].freeTwist[1], 0.0, 1e-4);
    OnGround::pass(step, 0.3);
    BodySupports supports;
    supports.begin(step.next().bodies, {}, {}, {0});
    EXPECT_NEAR(supports.freeTwists()[0][1], 0.0, 1e-4);  // held, if nothing lifts it
    EXPECT_TRUE(supports.update(Vec6::Unit(1) * 0.3, 9.81 * kWhole));
    EXPECT_NEAR(supports.freeTwists()[0][1], 0.3 - 9.81 * step.next().h, 1e-6);
}

/// The parts lead where the whole does.
TEST(StepParts, ABodyOnTheGroundKeepsStanding) {
    OnGround scene(0.0);
    StepParts step(scene.input, {});
    while (!step.areDone()) OnGround::pass(step, step.next().bodies[0].freeTwist[1]);
    EXPECT_NEAR(scene.bodies[0].motion[1], 0.0, 1e-6);
}

/// Bullet stops it in the whole of a step: it does not fall on in the first part.
TEST(StepParts, ABodyThatHitsTheGroundStopsAtOnce) {
    OnGround scene(-1.0);
    ASSERT_TRUE(StepParts::areAllowed(scene.input));
    StepParts step(scene.input, {});
    EXPECT_NEAR(step.next().bodies[0].freeTwist[1], 0.0, 2e-4);
    while (!step.areDone()) OnGround::pass(step, step.next().bodies[0].freeTwist[1]);
    EXPECT_NEAR(scene.bodies[0].motion[1], 0.0, 2e-4 * kWhole);
}

/// Over the whole step it gives what it may in the whole step.
TEST(StepParts, AMotorGivesItsShare) {
    OnGround scene(1.0);
    scene.ground.range = {-3.0, 5.0};
    const std::vector<RigidContact> motors{{.weight = 1.0, .range = {-1.0, 2.0}}};
    scene.input.rigidContacts = motors;
    ASSERT_TRUE(StepParts::areAllowed(scene.input));
    StepParts step(scene.input, {});
    const double share = step.next().h / kWhole;
    ASSERT_LT(share, 1.0);
    EXPECT_EQ(step.next().bodies[0].supports[0].range.least, -3.0 * share);
    EXPECT_EQ(step.next().bodies[0].supports[0].range.most, 5.0 * share);
    EXPECT_EQ(step.next().rigidContacts[0].range.least, -1.0 * share);
    EXPECT_EQ(step.next().rigidContacts[0].range.most, 2.0 * share);
}

/// The stiff term lets go of it, and has no momentum of its own in any part.
TEST(StepParts, ABodyThatLeavesTheGroundFliesAsByItself) {
    OnGround scene(1.0);
    ASSERT_TRUE(StepParts::areAllowed(scene.input));
    StepParts step(scene.input, {});
    double speed = 1.0;
    while (!step.areDone()) {
        BodySupports supports;
        supports.begin(step.next().bodies, {}, {}, {0});
        supports.respond(Vec6::Zero(), 9.81 * step.next().h);
        EXPECT_NEAR(supports.freeTwists()[0][1], speed - 9.81 * step.next().h, 1e-6);
        speed = supports.freeTwists()[0][1];
        OnGround::pass(step, speed);
    }
    EXPECT_NEAR(speed, 1.0 - 9.81 * kWhole, 1e-6);
}

TEST(StepParts, CouplingsAreKnownForWholeStepsOnly) {
    OnGround joined(0.0);
    joined.bodies.push_back(joined.bodies[0]);
    joined.input.bodies = joined.bodies;
    EXPECT_TRUE(StepParts::areAllowed(joined.input));
    const std::vector<BodyCoupling> joints{{0, 1, 0.1 * Mat6::Identity()}};
    joined.input.couplings = joints;
    EXPECT_FALSE(StepParts::areAllowed(joined.input));
}

}  // namespace
}  // namespace jacket
