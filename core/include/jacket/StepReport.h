#pragma once
#include <vector>

#include "jacket/Contact.h"

namespace jacket {

/// What one step did.
struct StepReport {
    int pcgIterations = 0;  ///< over all solves of the step
    int solves = 0;         ///< linear solves: 1 without contacts, more while the active set changes
    double residual = 0.0;  ///< relative residual of the last solve, in the preconditioner's norm [-]
    bool converged = true;  ///< false: a solve hit its iteration budget, or the active set its round budget
    bool finite = true;     ///< false: the step was rejected and the state is what it was before
    bool limited = false;   ///< Newton did not settle and the step would have gained energy: deformation was cut short
    bool passed = false;    ///< a fast body is through a shell at the end of the step
    double deepestGap = 0.0;  ///< most negative predicted gap that was left at the end of the step [m], <= 0
    std::vector<ContactImpulse> contacts;  ///< those that carried an impulse
};

}  // namespace jacket
