// What rests stays, for as long as anybody may look.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/HardScenes.h"

namespace jacket::bullet::testing {
namespace {

/// The contacts with a rolling ball's lightest share of it slip now and then: in these steps the force is off by more.
TEST(Rest, ABallStaysForAHundredThousandSteps) {
    constexpr int kSteps = 100'000, kMean = 100;
    RestingBall resting(16, 0.5);
    resting.scene.run(10.0, kStep);
    const Vec3 start = resting.position();
    double moved = 0.0, sum = 0.0, worstMean = 0.0, worst = 0.0;
    int beyond = 0;
    for (int i = 1; i <= kSteps; ++i) {
        const double off = resting.step();
        sum += off;
        beyond += std::abs(off) > 1e-4 ? 1 : 0;
        worst = std::max(worst, std::abs(off));
        moved = std::max(moved, (resting.position() - start).norm());
        if (i % kMean != 0) continue;
        worstMean = std::max(worstMean, std::abs(sum / kMean));
        sum = 0.0;
    }
    EXPECT_LT(moved, 1e-3);
    EXPECT_LT(worstMean, 1e-4);
    EXPECT_LT(beyond, kSteps / 50);
    EXPECT_LT(worst, 5e-3);
}

}  // namespace
}  // namespace jacket::bullet::testing
