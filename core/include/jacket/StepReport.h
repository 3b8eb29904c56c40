#pragma once
#include <vector>

#include "jacket/Contact.h"

namespace jacket {

/// Where the time of a step went, by IslandInput::clock [s]. What is left of the whole step is spent on checks.
struct StepTimes {
    double assembly = 0.0;       ///< energies, their derivatives, A and b
    double factor = 0.0;         ///< building the preconditioner
    double solve = 0.0;          ///< conjugate gradients
    double contact = 0.0;        ///< finding contacts, and deciding what they do
    double selfCollision = 0.0;  ///< of shells with themselves and each other

    double sum() const { return assembly + factor + solve + contact + selfCollision; }
    StepTimes& operator+=(const StepTimes& other) {
        assembly += other.assembly;
        factor += other.factor;
        solve += other.solve;
        contact += other.contact;
        selfCollision += other.selfCollision;
        return *this;
    }
};

/// What one step did.
struct StepReport {
    int pcgIterations = 0;  ///< over all solves of the step
    int solves = 0;         ///< linear solves: 1 without contacts, more while the active set changes
    double residual = 0.0;  ///< relative residual of the last solve, in the preconditioner's norm [-]
    bool converged = true;  ///< false: a solve hit its iteration budget, or a contact ends deeper than allowed
    bool settled = true;    ///< false: contacts have used up their rounds, and may not agree with the motion
    bool finite = true;     ///< false: the step was rejected and the state is what it was before
    bool limited = false;   ///< Newton did not settle and the step would have gained energy: deformation was cut short
    bool passed = false;    ///< a body went through a shell in the step
    bool mayPass = false;   ///< contacts of a fast body did not settle: it may be on its way through
    double deepestGap = 0.0;  ///< most negative predicted gap that was left at the end of the step [m], <= 0
    StepTimes times;          ///< all zero without a clock
    std::vector<ContactImpulse> contacts;  ///< those that carried an impulse

    /// What another attempt at the step took.
    void addCosts(const StepReport& other) {
        pcgIterations += other.pcgIterations;
        solves += other.solves;
        times += other.times;
    }
};

}  // namespace jacket
