// Bodies that their user moves against sheets: which of them come into a sheet, throw it, or leave contacts unsettled.
#include <cstdio>

#include "support/KinematicScenes.h"

namespace jacket::bullet::testing {
namespace {

bool isFaulty(const char* material, const KinematicScene& scene) {
    const SheetOutcome outcome = scene.run();
    const char* const fault = outcome.fault();
    if (!fault) return false;
    std::printf("  %-9s %s %s: %s, %d cells, 1/%.0f s: %.2g mm deep, at most %.2g m/s, %d steps unsettled\n", fault,
                scene.pusher.name, scene.course.name, material, scene.cells, 1.0 / scene.h, 1e3 * outcome.deepest,
                outcome.fastest, outcome.unsettled);
    return true;
}

void run(const char* name, const ShellMaterial& material) {
    int faulty = 0, all = 0;
    for (const Course* course :
         {&courses::kPress, &courses::kLift, &courses::kShake, &courses::kTurn, &courses::kPush, &courses::kSpin})
        for (const Pusher& pusher : kPushers)
            for (const int cells : {5, 12})
                for (const double h : {1.0 / 60, 1.0 / 240}) {
                    faulty += isFaulty(name, {material, *course, pusher, cells, h}) ? 1 : 0;
                    ++all;
                }
    std::printf("%s: %d of %d go wrong\n", name, faulty, all);
    std::fflush(stdout);
}

}  // namespace
}  // namespace jacket::bullet::testing

int main() {
    using namespace jacket;
    bullet::testing::run("cotton", materials::cotton());
    bullet::testing::run("paper", materials::paper());
    bullet::testing::run("rubber", materials::rubber());
    bullet::testing::run("steel 0.5 mm", materials::steel(5e-4));
}
