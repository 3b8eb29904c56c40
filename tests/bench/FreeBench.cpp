// Fine sheets among bodies that move freely, as games and previews have them: what a step costs, and what goes wrong,
// over several starts of each scene. Times are of this machine; compare those of one run.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "support/FreeScenes.h"

namespace jacket::bullet::testing {
namespace {

/// One line a scene and mesh: milliseconds a step in the mean and at most, linear solves and iterations a step, and how
/// many starts went wrong, by what.
void tell(const FreeScene& scene, const std::string& material, int cells, int starts) {
    double seconds = 0.0, longest = 0.0, deepest = 0.0, solves = 0.0, iterations = 0.0;
    int steps = 0, faulty = 0, unsettled = 0, deep = 0;
    for (int start = 0; start < starts; ++start) {
        const FreeScene::Run run = scene.run(materials::byName(material), cells, start);
        seconds += run.seconds;
        longest = std::max(longest, run.longest);
        deepest = std::max(deepest, run.outcome.deepest);
        solves += run.solves;
        iterations += run.iterations;
        steps += run.steps;
        const char* const fault = run.outcome.fault(scene.fastest);
        faulty += fault ? 1 : 0;
        deep += fault && fault == std::string("deep") ? 1 : 0;
        unsettled += run.outcome.unsettled;
    }
    std::printf(
        "%-32s %-7s %2d cells: %6.2f ms, at most %5.0f; %4.1f solves, %4.0f iterations; %d of %d go wrong, %d deep "
        "(%.2g mm), %d steps unsettled\n",
        scene.name, material.c_str(), cells, 1e3 * seconds / steps, 1e3 * longest, solves / steps, iterations / steps,
        faulty, starts, deep, 1e3 * deepest, unsettled);
    std::fflush(stdout);
}

}  // namespace
}  // namespace jacket::bullet::testing

int main(int argc, char** argv) {
    using namespace jacket::bullet::testing;
    using namespace jacket::bullet::testing::free_scenes;
    const FreeScene scenes[] = {ballUnderCloth("cloth over a ball that is fixed", 0.0),
                                ballUnderCloth("cloth over a ball of 300 g", 0.3),
                                ballUnderCloth("cloth over a ball of 3 kg", 3.0),
                                pileUnderCloth("cloth over boxes of 2 kg", 2.0),
                                onTrampoline("ball of 1 kg on a trampoline", false, 1.0),
                                onTrampoline("box of 100 g on a trampoline", true, 0.1),
                                onTrampoline("box of 5 kg on a trampoline", true, 5.0),
                                boxesInHammock("boxes of 300 g in a hammock", 0.3),
                                ballAtCurtain("ball of 100 g at a curtain", 0.1),
                                ballAtCurtain("ball of 1 kg at a curtain", 1.0),
                                fallingTogether("box of 1 kg on a falling cloth", 1.0),
                                clothOnFallingBox("cloth on a box of 1 kg that lands", 1.0),
                                crateOnSlope("cloth over a crate on a slope", 20.0),
                                clothOnRoller("cloth over a cylinder that rolls", 2.0),
                                tiedToBlocks("cloth tied to blocks of 1 kg", 1.0),
                                clothOnBridge("cloth on a bridge of 9 planks", 0.1),
                                clothOnRagdoll("cloth on a figure that falls")};
    const std::string material = argc > 1 ? argv[1] : "cotton", only = argc > 2 ? argv[2] : "";
    const int starts = argc > 3 ? std::atoi(argv[3]) : 6;
    for (const int cells : {24, 48})
        for (const FreeScene& scene : scenes)
            if (std::string(scene.name).find(only) != std::string::npos) tell(scene, material, cells, starts);
}
