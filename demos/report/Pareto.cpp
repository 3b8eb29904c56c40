#include "Pareto.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace jacket::demo::report {

namespace {

bool isAtLeastAsFine(const Trial& a, const Trial& b) {
    return a.family == b.family && std::equal(a.fineness.begin(), a.fineness.end(), b.fineness.begin(), b.fineness.end(),
                                              [](double x, double y) { return x >= y * (1 - 1e-12); });
}

}  // namespace

std::vector<int> paretoFront(std::span<const Trial> trials) {
    std::vector<int> order(trials.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](int a, int b) {
        return trials[a].cost != trials[b].cost ? trials[a].cost < trials[b].cost : trials[a].error < trials[b].error;
    });
    std::vector<int> front;
    double least = std::numeric_limits<double>::infinity();
    for (const int i : order) {
        if (!(trials[i].error < least)) continue;
        least = trials[i].error;
        front.push_back(i);
    }
    return front;
}

bool isReliable(std::span<const Trial> trials, int index, double accepted) {
    return std::all_of(trials.begin(), trials.end(), [&](const Trial& other) {
        return !isAtLeastAsFine(other, trials[index]) || other.error <= accepted;
    });
}

int cheapestWithin(std::span<const Trial> trials, double accepted) {
    int best = -1;
    for (int i = 0; i < static_cast<int>(trials.size()); ++i)
        if (isReliable(trials, i, accepted) && (best < 0 || trials[i].cost < trials[best].cost)) best = i;
    return best;
}

}  // namespace jacket::demo::report
