#pragma once
#include <span>
#include <string>
#include <vector>

namespace jacket::demo::report {

/// What was measured of one way to solve a problem, as far as comparing goes.
struct Trial {
    std::string family;  ///< all that is not resolution: trials of one family differ in `fineness` alone
    std::vector<double>
        fineness;        ///< each larger where it should be more exact: cells, steps per second, 1 / tolerance
    double error = 0.0;  ///< >= 0; infinite: no result
    double cost = 0.0;   ///< [s]
};

/// Indices of the trials that no other beats in both error and cost, by rising cost.
std::vector<int> paretoFront(std::span<const Trial> trials);

/// The largest error of a trial and of all of its family that are at least as fine. A trial whose errors happen to
/// cancel is not taken for an exact one by that.
double reliableError(std::span<const Trial> trials, int index);

/// Index of the cheapest trial whose reliable error is within the accepted one; -1 when there is none.
int cheapestWithin(std::span<const Trial> trials, double accepted);
/// Index of the trial with the least reliable error; -1 without trials.
int mostExact(std::span<const Trial> trials);

}  // namespace jacket::demo::report
