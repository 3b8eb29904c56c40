// Worlds drawn by chance: how many of them gain energy, let a shell stand inside a body, or leave contacts unsettled;
// and the worst, by the number that makes each again.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "support/RandomWorld.h"

namespace jacket::bullet::testing {
namespace {

constexpr double kSeconds = 3.0;

void print(const Outcome& o) {
    std::printf(
        "  world %-5u gain %8.2g, deepest %8.2g mm, unsettled %3.0f %%, unconverged %3.0f %%, %4.0f iterations: %s\n",
        o.seed, o.gain, 1e3 * o.deepest, 100 * o.unsettled, 100 * o.unconverged, o.iterations, o.what.c_str());
}

/// With every step that changes the energy by more than a hundredth.
void tellOf(unsigned seed) {
    double most = 0.0;
    print(outcomeOf(seed, kSeconds, [&](int step, const auto& now, double by, const WorldReport& report) {
        most = std::max(most, now.total());
        if (std::abs(by) < 0.01 * most && !report.limited) return;
        std::printf(
            "  step %4d: %9.3g J, by %9.3g; bodies %9.3g + %9.3g, shell %9.3g + %9.3g, membrane %9.3g, bending "
            "%9.3g; %d contacts, %d solves, %d iterations%s%s%s\n",
            step, now.total(), by, now.kineticOfBodies, now.potentialOfBodies, now.kineticOfShells,
            now.potentialOfShells, now.membrane, now.bending, report.contacts, report.solves, report.pcgIterations,
            report.settled ? "" : ", unsettled", report.converged ? "" : ", unconverged",
            report.limited ? ", limited" : "");
    }));
}

template <class Measure>
void worst(std::vector<Outcome> outcomes, const char* by, Measure measure) {
    constexpr std::size_t kMost = 12;
    std::sort(outcomes.begin(), outcomes.end(),
              [&](const Outcome& a, const Outcome& b) { return measure(a) > measure(b); });
    std::printf("worst by %s:\n", by);
    for (std::size_t i = 0; i < std::min(kMost, outcomes.size()); ++i) print(outcomes[i]);
}

void runAll(int worlds, unsigned first) {
    std::vector<Outcome> outcomes;
    for (int i = 0; i < worlds; ++i) outcomes.push_back(outcomeOf(first + unsigned(i), kSeconds));
    const auto count = [&](auto holds) { return int(std::count_if(outcomes.begin(), outcomes.end(), holds)); };
    std::printf(
        "of %d worlds: %d not finite; energy grows by more than 2 %% in %d, doubles in %d; at the end %d are deeper "
        "than 0.1 mm, %d than 5 mm; %d have more than 5 %% unsettled steps\n",
        worlds, count([](const Outcome& o) { return !o.finite; }),
        count([](const Outcome& o) { return o.gain > 0.02; }), count([](const Outcome& o) { return o.gain > 1.0; }),
        count([](const Outcome& o) { return o.deepest > 1e-4; }),
        count([](const Outcome& o) { return o.deepest > 5e-3; }),
        count([](const Outcome& o) { return o.unsettled > 0.05; }));
    worst(outcomes, "energy", [](const Outcome& o) { return o.finite ? o.gain : HUGE_VAL; });
    worst(outcomes, "depth", [](const Outcome& o) { return o.deepest; });
    worst(outcomes, "unsettled steps", [](const Outcome& o) { return o.unsettled; });
}

}  // namespace
}  // namespace jacket::bullet::testing

int main(int argc, char** argv) {
    const int worlds = argc > 1 ? std::atoi(argv[1]) : 200, first = argc > 2 ? std::atoi(argv[2]) : 0;
    if (argc > 3 || worlds < 1 || first < 0) {
        std::fprintf(stderr,
                     "usage: worlds_bench [WORLDS [FIRST]]\n  WORLDS  how many, > 0; 200 if not given; one is "
                     "told of step by step\n  FIRST   number of the first, >= 0\n");
        return 2;
    }
    if (worlds == 1)
        jacket::bullet::testing::tellOf(unsigned(first));
    else
        jacket::bullet::testing::runAll(worlds, unsigned(first));
}
