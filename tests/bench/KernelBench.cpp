// Kernels of a step on the draped sheet's matrix, n vertices a side: assembly, product, preconditioner, whole step.
#include <benchmark/benchmark.h>

#include "ShellAssembly.h"
#include "jacket/Shell.h"
#include "solver/CompactShell.h"
#include "solver/IncompleteCholesky.h"
#include "solver/ShellFactor.h"

namespace jacket {
namespace {

constexpr double kStep = 1.0 / 60;
const Vec3 kGravity{0, -9.81, 0};

/// The drape scene's sheet (E t = 1e4 N/m, D = 1e-4 N m, 0.2 kg/m^2), one edge pinned, after half a second of swinging.
Shell swingingSheet(int n, const BendingModel& bending = PatchBending{}) {
    ShellMaterial m{.young = 3.03e7, .poisson = 0.3, .thickness = 3.3e-4, .density = 605.0};
    m.stretchStiffnessOverride = 1e4;
    m.bendingStiffnessOverride = 1e-4;
    m.areaDensityOverride = 0.2;
    Shell sheet(makeGrid({.size = {2, 2}, .cells = {n - 1, n - 1}}), m, {.bending = bending});
    for (int i = 0; i < sheet.vertexCount(); ++i)
        if (sheet.restPositions()(0, i) < -1 + 1e-9) sheet.pin(i);
    for (int k = 0; k < 30; ++k) sheet.step(kStep, kGravity);
    return sheet;
}

ShellDesign designOf(const Shell& shell) {
    ShellDesign design;
    design.materials.list = {shell.material()};
    return design;
}

void perVertex(benchmark::State& state) {
    state.counters["ns/vertex"] =
        benchmark::Counter(double(state.range(0) * state.range(0)),
                           benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

template <class Bending>
void assembly(benchmark::State& state) {
    const Shell sheet = swingingSheet(int(state.range(0)), Bending{});
    ShellAssembly assembly(sheet, designOf(sheet));
    const Points y = Points::Zero(3, sheet.vertexCount());
    for (auto _ : state)
        benchmark::DoNotOptimize(&assembly.assemble(sheet, kStep, kGravity, nullptr, sheet.velocities(), y));
    perVertex(state);
}
BENCHMARK(assembly<PatchBending>)->Arg(31)->Arg(101);
BENCHMARK(assembly<DihedralBending>)->Arg(31)->Arg(101);
BENCHMARK(assembly<QuadraticBending>)->Arg(31)->Arg(101);
BENCHMARK(assembly<CubicShellBending>)->Arg(31)->Arg(101);
BENCHMARK(assembly<DihedralDifferenceBending>)->Arg(31);

void product(benchmark::State& state) {
    const Shell sheet = swingingSheet(int(state.range(0)));
    ShellAssembly assembly(sheet, designOf(sheet));
    const Points y = Points::Zero(3, sheet.vertexCount());
    const BlockMatrix& matrix = assembly.assemble(sheet, kStep, kGravity, nullptr, sheet.velocities(), y).matrix;
    Points result(3, sheet.vertexCount());
    for (auto _ : state) {
        matrix.multiply(sheet.positions().data(), result.data());
        benchmark::ClobberMemory();
    }
    perVertex(state);
}
BENCHMARK(product)->Arg(31)->Arg(101);

void factorOrApply(benchmark::State& state, bool factorEach) {
    const Shell sheet = swingingSheet(int(state.range(0)));
    ShellAssembly assembly(sheet, designOf(sheet));
    const Points y = Points::Zero(3, sheet.vertexCount());
    const BlockMatrix& matrix = assembly.assemble(sheet, kStep, kGravity, nullptr, sheet.velocities(), y).matrix;
    const FilteredMatrix filtered(matrix);
    IncompleteCholesky factor;
    factor.factor(filtered);
    Points result(3, sheet.vertexCount());
    for (auto _ : state) {
        if (factorEach)
            factor.factor(filtered);
        else
            factor.apply(sheet.positions().data(), result.data());
        benchmark::ClobberMemory();
    }
    perVertex(state);
}
BENCHMARK_CAPTURE(factorOrApply, factor, true)->Arg(31)->Arg(101);
BENCHMARK_CAPTURE(factorOrApply, apply, false)->Arg(31)->Arg(101);

void completeFactor(benchmark::State& state) {
    const Shell sheet = swingingSheet(int(state.range(0)));
    ShellAssembly assembly(sheet, designOf(sheet));
    const Points y = Points::Zero(3, sheet.vertexCount());
    const BlockMatrix& matrix = assembly.assemble(sheet, kStep, kGravity, nullptr, sheet.velocities(), y).matrix;
    const std::vector<const Mat3*> free(sheet.vertexCount(), nullptr);
    const FilteredMatrix filtered(matrix);
    ShellFactor factor;
    for (auto _ : state) benchmark::DoNotOptimize(factor.factor(filtered, free));
    perVertex(state);
}
BENCHMARK(completeFactor)->Arg(13)->Arg(27)->Arg(35)->Arg(51)->Unit(benchmark::kMillisecond);

/// What a solve in single precision is made of.
enum class Compact { Take, Product, Factor, Apply, CoarseBuild, CoarseApply };

void compact(benchmark::State& state, Compact part) {
    const Shell sheet = swingingSheet(int(state.range(0)));
    ShellAssembly assembly(sheet, designOf(sheet));
    const Points y = Points::Zero(3, sheet.vertexCount());
    const BlockMatrix& blocks = assembly.assemble(sheet, kStep, kGravity, nullptr, sheet.velocities(), y).matrix;
    CompactShell shell(blocks);
    shell.matrix.setValues(blocks);
    const FilteredMatrix filtered(blocks);
    shell.factor.factor(filtered);
    CoarseSpace coarse(shell.matrix);
    const std::vector<const Mat3*> free(sheet.vertexCount(), nullptr);
    coarse.build(shell.matrix, sheet.positions(), free, {});
    std::vector<float> x(4 * static_cast<std::size_t>(sheet.vertexCount()), 0.0f), result(x.size(), 0.0f);
    for (std::size_t i = 0; i < x.size(); i += 4)
        Eigen::Map<Eigen::Vector3f>(x.data() + i) = sheet.positions().col(static_cast<int>(i / 4)).cast<float>();
    for (auto _ : state) {
        switch (part) {
            case Compact::Take:
                shell.matrix.setValues(blocks);
                break;
            case Compact::Product:
                shell.matrix.multiply(x.data(), result.data());
                break;
            case Compact::Factor:
                shell.factor.factor(filtered);
                break;
            case Compact::Apply:
                shell.factor.apply(x.data(), result.data());
                break;
            case Compact::CoarseBuild:
                coarse.build(shell.matrix, sheet.positions(), free, {});
                break;
            case Compact::CoarseApply:
                coarse.addTo(x.data(), result.data());
                break;
        }
        benchmark::ClobberMemory();
    }
    perVertex(state);
}
BENCHMARK_CAPTURE(compact, take, Compact::Take)->Arg(31)->Arg(101);
BENCHMARK_CAPTURE(compact, product, Compact::Product)->Arg(31)->Arg(101);
BENCHMARK_CAPTURE(compact, factor, Compact::Factor)->Arg(31)->Arg(101);
BENCHMARK_CAPTURE(compact, apply, Compact::Apply)->Arg(31)->Arg(101);
BENCHMARK_CAPTURE(compact, coarseBuild, Compact::CoarseBuild)->Arg(31)->Arg(101);
BENCHMARK_CAPTURE(compact, coarseApply, Compact::CoarseApply)->Arg(31)->Arg(101);

void wholeStep(benchmark::State& state) {
    Shell sheet = swingingSheet(int(state.range(0)));
    for (auto _ : state) benchmark::DoNotOptimize(sheet.step(kStep, kGravity));
    perVertex(state);
}
BENCHMARK(wholeStep)->Arg(11)->Arg(31)->Arg(101)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace jacket

BENCHMARK_MAIN();
