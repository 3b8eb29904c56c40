#include <gtest/gtest.h>

#include "jacket/Island.h"

namespace jacket {
namespace {

/// A clock that is one second later whenever it is looked at.
double seconds = 0.0;
double tick() {
    return seconds += 1.0;
}

TEST(StepTimes, AreTakenByTheCallersClockAlone) {
    Shell sheet(makeGrid({.size = {1, 1}, .cells = {3, 3}}), materials::cotton());
    Shell* shells[] = {&sheet};
    IslandSolver solver;
    IslandInput input;
    input.shells = shells;
    EXPECT_EQ(solver.solve(input).times.sum(), 0.0);
    input.clock = &tick;
    const StepTimes times = solver.solve(input).times;
    EXPECT_GE(times.assembly, 1.0);
    EXPECT_GE(times.factor, 1.0);
    EXPECT_GE(times.solve, 1.0);
    EXPECT_GE(times.contact, 1.0);
    EXPECT_LE(times.sum(), seconds);
}

}  // namespace
}  // namespace jacket
