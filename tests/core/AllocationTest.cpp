#include <gtest/gtest.h>
#include <malloc.h>

#include "EdgeStretch.h"
#include "ShellAssembly.h"
#include "jacket/Island.h"
#include "support/AllocationCount.h"

namespace jacket {
namespace {

constexpr double kStep = 1.0 / 60;
const Vec3 kGravity{0, -9.81, 0};

TriangleMesh sheetOrBowl(bool curved) {
    TriangleMesh mesh = makeGrid({.size = {1, 1}, .cells = {30, 30}});
    if (curved)
        for (int i = 0; i < mesh.positions.cols(); ++i)
            mesh.positions(1, i) =
                0.3 * (mesh.positions(0, i) * mesh.positions(0, i) + mesh.positions(2, i) * mesh.positions(2, i));
    return mesh;
}

class AllocationOf : public testing::TestWithParam<std::pair<bool, bool>> {};  // curved, plastic
INSTANTIATE_TEST_SUITE_P(Shells, AllocationOf,
                         testing::Values(std::pair{false, false}, std::pair{true, false}, std::pair{false, true},
                                         std::pair{true, true}),
                         [](const auto& parameter) {
                             return std::string(parameter.param.first ? "Curved" : "Flat") +
                                    (parameter.param.second ? "Plastic" : "Elastic");
                         });

TEST_P(AllocationOf, AssemblyEnergyAndFlowAreFreeOfItAfterTheFirstStep) {
    const auto [curved, plastic] = GetParam();
    ShellMaterial material{.young = 2e9, .poisson = 0.3, .thickness = 1e-3, .density = 1000.0};
    if (plastic) material.yieldStress = 1e4;
    Shell shell(sheetOrBowl(curved), material, {.plasticity = plastic});
    for (int i = 0; i < 31; ++i) shell.pin(i);
    for (int k = 0; k < 4; ++k) shell.step(kStep, kGravity);

    ShellDesign design;
    design.materials.list = {material};
    ShellAssembly assembly(shell, design);
    const Points y = Points::Constant(3, shell.vertexCount(), 1e-5);
    const Eigen::Ref<const Points> ahead = shell.velocities();
    const auto once = [&] {
        assembly.assemble(shell, kStep, kGravity, nullptr, shell.velocities(), y);
        assembly.assemble(shell, kStep, kGravity, nullptr, shell.velocities(), y, &ahead);
        assembly.flow(shell.positions());
        const double energy = shell.elasticEnergy(shell.positions());
        shell.advance(kStep);
        return energy;
    };
    once();
    const long before = allocations;
    EXPECT_TRUE(std::isfinite(once()));
    EXPECT_EQ(allocations - before, 0);
}

/// Memory that a team would ask for in a step after the first.
TEST(Allocation, OfAStepIsTheSameWithATeam) {
    WorkerTeam team(3);
    const auto ofTheThirdStep = [&](WorkerTeam* helpers) {
        Shell shell(makeGrid({.size = {1, 1}, .cells = {60, 60}}), {.young = 1e6, .thickness = 1e-3, .density = 200.0});
        for (int i = 0; i < 61; ++i) shell.pin(i);
        Shell* const shells[] = {&shell};
        IslandSolver solver;
        long before = 0;
        for (int step = 0; step < 3; ++step) {
            IslandInput input;
            input.shells = shells;
            input.team = helpers;
            before = allocations;
            EXPECT_TRUE(solver.solve(input).finite);
            shell.advance(input.h);
        }
        return allocations - before;
    };
    EXPECT_EQ(ofTheThirdStep(&team), ofTheThirdStep(nullptr));
}

/// Bytes that have been asked for and not given back.
std::size_t heapInUse() {
    const struct mallinfo2 heap = mallinfo2();
    return heap.uordblks + heap.hblkhd;
}

/// Of a cloth with what its solver keeps, without contacts; matrices and factors are most of it.
TEST(Memory, OfAVertexOfClothIsBounded) {
    constexpr int kCells = 70;
    constexpr std::size_t kMostOfAVertex = 2500;
    const std::size_t before = heapInUse();
    Shell shell(makeGrid({.size = {1, 1}, .cells = {kCells, kCells}}),
                {.young = 1e6, .thickness = 1e-3, .density = 200.0});
    for (int i = 0; i <= kCells; ++i) shell.pin(i);
    Shell* const shells[] = {&shell};
    IslandSolver solver;
    for (int step = 0; step < 3; ++step) {
        IslandInput input;
        input.shells = shells;
        EXPECT_TRUE(solver.solve(input).finite);
        shell.advance(input.h);
    }
    EXPECT_LT((heapInUse() - before) / shell.vertexCount(), kMostOfAVertex);
}

TEST(Allocation, IsCounted) {
    const long before = allocations;
    const Points some = Points::Zero(3, 100);
    EXPECT_GT(allocations, before);
    EXPECT_EQ(some.norm(), 0.0);
}

}  // namespace
}  // namespace jacket
