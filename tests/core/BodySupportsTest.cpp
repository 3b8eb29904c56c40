#include "solver/BodySupports.h"

#include <gtest/gtest.h>

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

TEST(BodySupports, AContactWithABodyOfPrescribedMotionDoesNothing) {
    const std::vector<CoupledBody> bodies{falling(1), falling(1)};
    BodySupports supports;
    supports.begin(bodies, {}, std::vector{onTop(1e4)}, {-1, 0});
    ASSERT_EQ(supports.masses().size(), 1u);
    EXPECT_EQ(supports.masses()[0], bodies[1].mass);
    EXPECT_TRUE(supports.couplings().empty());
}

}  // namespace
}  // namespace jacket
