// What shells cost that do nothing: sheets asleep on a floor, beside the same world without them.
#include <benchmark/benchmark.h>
#include <cmath>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

constexpr double kStep = 1.0 / 60;

/// A floor with sheets of 5 x 5 vertices side by side.
void fill(BulletScene& scene, int sheets) {
    scene.addBox(btVector3(1000, 1, 1000), 0, btVector3(0, -1, 0));
    const int side = int(std::ceil(std::sqrt(double(sheets))));
    for (int i = 0; i < sheets; ++i) {
        TriangleMesh mesh = squareSheet(0.4, 4);
        mesh.positions.colwise() += Vec3(0.6 * (i % side), 4e-4, 0.6 * (i / side));
        scene.shells->add(mesh, trampolineCloth());
    }
}

void sleepingShells(benchmark::State& state) {
    const int sheets = int(state.range(0));
    BulletScene scene;
    fill(scene, sheets);
    for (int second = 0; second < 10 && (second == 0 || scene.shells->lastStep().awake > 0); ++second)
        scene.run(1.0, kStep);
    if (scene.shells->lastStep().awake > 0) return state.SkipWithError("some stay awake");
    for (auto _ : state) scene.step(kStep);
    if (sheets > 0)
        state.counters["per shell"] = benchmark::Counter(
            double(sheets), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(sleepingShells)->Arg(0)->Arg(1)->Arg(10)->Arg(100)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace jacket::bullet::testing

BENCHMARK_MAIN();
