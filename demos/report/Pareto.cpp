#include "Pareto.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace jacket::demo::report {

namespace {

bool isAtLeastAsFine(const Trial& a, const Trial& b) {
    return a.family == b.family &&
           std::equal(a.fineness.begin(), a.fineness.end(), b.fineness.begin(), b.fineness.end(),
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

double reliableError(std::span<const Trial> trials, int index) {
    double largest = 0.0;
    for (const Trial& other : trials)
        if (isAtLeastAsFine(other, trials[index])) largest = std::max(largest, other.error);
    return largest;
}

int cheapestWithin(std::span<const Trial> trials, double accepted) {
    int best = -1;
    for (int i = 0; i < static_cast<int>(trials.size()); ++i)
        if (reliableError(trials, i) <= accepted && (best < 0 || trials[i].cost < trials[best].cost)) best = i;
    return best;
}

int mostExact(std::span<const Trial> trials) {
    int best = -1;
    for (int i = 0; i < static_cast<int>(trials.size()); ++i)
        if (best < 0 || reliableError(trials, i) < reliableError(trials, best)) best = i;
    return best;
}

}  // namespace jacket::demo::report
