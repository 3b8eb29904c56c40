// Things as users build them of a shell and bodies: what their steps cost, and what is thrown, deep in a body or does
// not settle. Times are of this machine; compare those of one run.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "support/UseScenes.h"

namespace jacket::bullet::testing {
namespace {

/// One line a scene, over its materials and steps; one besides for each run that goes wrong.
void tell(const UseScene& scene, int fineness) {
    UseScene::Run sum;
    int all = 0, faulty = 0;
    scene.runAll(fineness, [&](const UseScene::Run& run, const std::string& material, double h) {
        const char* const fault = run.outcome.fault(scene.fastest);
        if (fault)
            std::printf("  %-9s %s, 1/%.0f s: at most %.2g m/s, %.2g mm deep, %d unsettled\n", fault, material.c_str(),
                        1.0 / h, run.outcome.fastest, 1e3 * run.outcome.deepest, run.outcome.unsettled);
        sum.add(run);
        sum.fastestBody = std::max(sum.fastestBody, run.fastestBody);
        faulty += fault ? 1 : 0;
        ++all;
    });
    std::printf(
        "%-32s %5.1f solves, at most %4d; %6.2f ms, at most %5.0f; sheet at most %5.2f m/s, bodies %5.2f; "
        "%d of %d go wrong\n",
        scene.name, double(sum.solves) / sum.steps, sum.most, 1e3 * sum.seconds / sum.steps, 1e3 * sum.longest,
        sum.outcome.fastest, sum.fastestBody, faulty, all);
    std::fflush(stdout);
}

}  // namespace
}  // namespace jacket::bullet::testing

int main(int argc, char** argv) {
    using namespace jacket::bullet::testing;
    const std::string only = argc > 1 ? argv[1] : "";
    const int fineness = argc > 2 ? std::atoi(argv[2]) : 1;
    if (argc > 3 || fineness < 1) {
        std::fprintf(stderr, "usage: uses_bench [part of a scene's name [fineness, 1 or more]]\n");
        return 2;
    }
    for (const UseScene& scene : use_scenes::all())
        if (std::string(scene.name).find(only) != std::string::npos) tell(scene, fineness);
}
