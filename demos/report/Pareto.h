#pragma once
#include <span>
#include <string>
#include <vector>

namespace jacket::demo::report {

/// What was measured of one way to solve a problem, as far as comparing goes.
struct Trial {
    std::string family;       ///< all that is not resolution: trials of one family differ in `fineness` alone
    std::vector<double> fineness;  ///< each larger where it should be more exact: cells, steps per second, 1 / tolerance
    double error = 0.0;       ///< >= 0; infinite: no result
    double cost = 0.0;        ///< [s]
};

/// Indices of the trials that no other beats in both error and cost, by rising cost.
std::vector<int> paretoFront(std::span<const Trial> trials);

/// True when no trial of its family that is at least as fine has a larger error than `accepted`, so that the trial is not
/// within it by errors that happen to cancel.
bool isReliable(std::span<const Trial> trials, int index, double accepted);

/// Index of the cheapest trial that is reliably within the error; -1 when there is none.
int cheapestWithin(std::span<const Trial> trials, double accepted);

}  // namespace jacket::demo::report
