// Worlds that chance has drawn, of those that once threw bodies or strained a sheet with up to 1600 times the energy
// that there was. build/ci/tests/worlds_bench 1 SEED tells of one step by step.
#include <gtest/gtest.h>

#include <string>

#include "support/RandomWorld.h"

namespace jacket::bullet::testing {
namespace {

class RandomWorlds : public ::testing::TestWithParam<unsigned> {};

/// Beyond what a sheet may be strained by for a step in which a body strikes it.
TEST_P(RandomWorlds, GainNoEnergy) {
    const Outcome outcome = outcomeOf(GetParam(), 2.0);
    EXPECT_TRUE(outcome.finite) << outcome.what;
    EXPECT_LT(outcome.gain, 0.5) << outcome.what;
    EXPECT_LT(outcome.deepest, 5e-3) << outcome.what;
}

INSTANTIATE_TEST_SUITE_P(Drawn, RandomWorlds, ::testing::Values(37u, 63u, 79u, 80u, 88u, 177u),
                         [](const auto& world) { return std::to_string(world.param); });

}  // namespace
}  // namespace jacket::bullet::testing
