#include <algorithm>
#include <cmath>
#include <limits>

#include "EdgeStretch.h"
#include "IslandImpl.h"
#include "LapTimer.h"
#include "ShellAssembly.h"

/// Solves for the velocities of a step: linearisations, and in each the rounds of contacts with a linear solve.
namespace jacket {
namespace {

constexpr double kEnergyGainAlone = 0.25;  ///< as kEnergyGain where nothing can be thrown
constexpr double kMostGainOfFast = 0.1;    ///< as kMostEnergyGain where a body goes farther than it is thick

constexpr double kRough = 0.03;      ///< tolerance of a rough solve
constexpr double kMostOfFew = 1e-3;  ///< tolerance of few vertices: what a guess leaves over would always be the same
constexpr int kLeastCompact = 200;   ///< vertices of a shell from which on a coarse space pays in double precision

/// Of a shell that is strained by as much everywhere [J].
double strainEnergy(const Shell& shell, double strain) {
    const double area = shell.masses().sum() / shell.material().areaDensity();
    return 0.5 * shell.material().stretchStiffness() * area * strain * strain;
}

}  // namespace

/// One linear solve, as Baraff & Witkin have it. Only where it has stretched an edge far beyond what it was, which the
/// linearisation at the start did not see coming (an unstressed sheet resists no motion out of its plane), it is
/// linearised again at the end that it found. The other integrators go on until the velocities no longer change: one
/// linearisation would cost BDF2 its second order wherever a shell turns far.
void IslandSolver::Impl::solveStep(const IslandInput& input, StepReport& report) {
    constexpr int kMostNewtonSteps = 5, kMostToTheEnd = 30;
    const bool toTheEnd = std::any_of(input.shells.begin(), input.shells.end(), [](const Shell* shell) {
        return shell->settings().integrator != Integrator::BackwardEuler;
    });
    const int most = toTheEnd ? kMostToTheEnd : patience.isOut() ? 1 : kMostNewtonSteps;
    double leastGain = std::numeric_limits<double>::infinity();
    int calmestStep = 1;
    assemble(input, false);
    for (int newton = 1;; ++newton) {
        if (newton > 1) newtonFrom = v;  // most steps are over after the first
        solveRounds(input, report);
        if (!unfiltered().allFinite()) return;
        const bool goOn = toTheEnd ? newton == 1 || improves(input) : overstretches(input, newton > 1);
        if (!goOn) return;
        isTooLong = newton == 1 && mayBeInParts() && energyGain(input) > partOfStep * kMostEnergyGain;
        if (isTooLong) return;
        if (const double gain = energyGain(input); gain < leastGain) {
            leastGain = gain;
            calmestStep = newton;
            if (newton > 1) calmest.swap(newtonFrom);
        }
        if (newton == most) break;
        assemble(input, true);
    }
    report.converged = report.converged && !toTheEnd;
    if (energyGain(input) > std::max(leastGain, kEnergyGain)) {
        v = calmestStep > 1 ? calmest : expected;  // as it is now, it may be anything
        assemble(input, calmestStep > 1);          // back to what threw the shell about least
        solveRounds(input, report);
    }
    const double mostGain = response.hasFastBody() && bodiesLead(input) ? kMostGainOfFast : kMostEnergyGain;
    if (!unfiltered().allFinite()) return;
    const double mostAlone = input.bodies.empty() ? kMostEnergyGain : kEnergyGainAlone;
    if (dynamicBodies.empty() && energyGain(input) > partOfStep * mostAlone) {
        isTooLong = mayBeInParts();
        if (isTooLong || (!patience.isOut() && descend(input, report))) return;
    }
    if (energyGain(input) > partOfStep * mostGain) limitDeformation(input, report);
}

bool IslandSolver::Impl::isAmongWalls(const IslandInput& input) const {
    return dynamicBodies.empty() && !input.bodies.empty();
}

/// A sheet that comes down flat on the edge of a box: what is beyond goes on by more than its triangles are large, and
/// no linearisation at either end of that knows of the other. Shorter steps do not go as far.
bool IslandSolver::Impl::mayBeInParts() const {
    return mayBeShorter && response.hasContacts() && !response.isAnyBouncy();
}

/// Where Newton's method does not settle, nor in the shortest parts of a step among walls: once more from standing
/// still, which no contact forbids that only stops, and always downhill. So it gains no energy, wherever it ends; and
/// what is stiff, flat and in a gale moves on, which no share of the solved motion would let it. False if it did not
/// come to that.
bool IslandSolver::Impl::descend(const IslandInput& input, StepReport& report) {
    constexpr int kMostSteps = 20, kMostHalvings = 20;
    constexpr double kSettled = 1e-3;  // of what the first step brings
    beginInFull(input, true);
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        elasticAtStart[k] = input.shells[k]->elasticEnergy(input.shells[k]->positions());
    limitPushes(input, kEnergyGain);
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        for (int i = 0; i < input.shells[k]->vertexCount(); ++i)
            if (!input.shells[k]->isPinned(i)) v.col(offsets[k] + i).setZero();
    double least = incrementalPotential(input, v), first = 0.0;
    for (int step = 0; step < kMostSteps; ++step) {
        newtonFrom = v;
        assemble(input, true);
        solveRounds(input, report);
        if (!unfiltered().allFinite()) return false;
        double now = incrementalPotential(input, v);
        for (int i = 0; i < kMostHalvings && !(now < least); ++i) {
            v = 0.5 * (v + newtonFrom);
            now = incrementalPotential(input, v);
        }
        if (!(now < least)) v = newtonFrom;
        const double gained = least - std::min(now, least);
        least -= gained;
        first = std::max(first, gained);
        if (gained <= kSettled * first) break;
    }
    readImpulses(input);
    report.limited = true;
    return energyGain(input) <= partOfStep * kMostEnergyGain;
}

/// What contacts give with the present velocities, which no solve has led to: those of the last one may be hundreds of
/// times as large, and its shells would have gone elsewhere.
void IslandSolver::Impl::readImpulses(const IslandInput& input) {
    assemble(input, true);
    response.writeTo(system);
    system.express(v, freeTwist, u);
    pcg.computeResidual(system, u);
    response.readImpulses(system, {v, u.w, unfiltered()});
}

/// After one more Newton step: goes back along it until the incremental potential is not above what it was, and says
/// whether it was long enough to be worth another.
bool IslandSolver::Impl::improves(const IslandInput& input) {
    constexpr double kSettled = 1e-3;  // of the step's change of velocity, or of what gravity does in it
    constexpr int kMostHalvings = 8;
    if (input.bodies.empty()) {
        const double least = incrementalPotential(input, newtonFrom);
        for (int i = 0; i < kMostHalvings && incrementalPotential(input, v) > least + 1e-12 * std::abs(least); ++i)
            v = 0.5 * (v + newtonFrom);
        system.start(v, freeTwist, u);
    }
    double change = 0.0, all = floorOfReference(input, 0.1);
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        for (int i = 0; i < input.shells[k]->vertexCount(); ++i) {
            const double mass = input.shells[k]->masses()[i];
            const int column = offsets[k] + i;
            change += mass * (v.col(column) - newtonFrom.col(column)).squaredNorm();
            all += mass * (v.col(column) - start.col(column)).squaredNorm();
        }
    return change > kSettled * kSettled * all;
}

/// Whether the solved step must be linearised again: it stretches an edge by far, or it gains energy. Backward Euler
/// itself gains none; its one linear solve does where stiff shells turn far in a step. That is looked for only where
/// edges change their lengths at all; `isAgain`: in a step that has been linearised again, for much of it in any case,
/// and so where little strain may be much energy, as in sheet metal.
bool IslandSolver::Impl::overstretches(const IslandInput& input, bool isAgain) const {
    constexpr double kMost = 0.1, kSuspect = 1e-3;  // change of an edge in one step, in rest lengths
    bool isSuspect = false, isToBeAsked = isAgain;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        const auto edges = shell.mesh().edges();
        const EdgeStretch stretch =
            edgeStretch(edges.data(), static_cast<int>(edges.size()), shell.m_restLength.data(),
                        shell.positions().data(), v.data() + 3 * offsets[k], stepOf[k], teamFor(input));
        if (stretch.lengthening > kMost) return true;
        isSuspect = isSuspect || stretch.change > kSuspect;
        isToBeAsked = isToBeAsked || strainEnergy(shell, stretch.change) > energyOfMotion(input, k);
    }
    if (!isSuspect) return isToBeAsked && energyGain(input) > kMostEnergyGain;
    return energyGain(input) > (dynamicBodies.empty() ? kEnergyGainAlone : kEnergyGain);
}

void IslandSolver::Impl::assemble(const IslandInput& input, bool atEnd) {
    LapTimer lap(input);
    WorkerTeam* const team = teamFor(input);
    const bool isIncomplete = input.shells[0]->settings().preconditioner == Preconditioner::IncompleteCholesky;
    parts.clear();
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const int n = input.shells[k]->vertexCount();
        const Eigen::Ref<const Points> ahead = (atEnd ? v : start).middleCols(offsets[k], n);
        const StepSystem& step = input.shells[k]->m_assembly->assemble(
            *input.shells[k], stepOf[k], input.gravity, input.wind, from().middleCols(offsets[k], n),
            y.middleCols(offsets[k], n), atEnd ? &ahead : nullptr, team);
        parts.push_back({&step.matrix, &step.rhs, offsets[k], &input.shells[k]->positions(), factored[k] != 0,
                         isIncomplete && !factored[k] && n >= kLeastCompact});
    }
    const bool isSingle = (dynamicBodies.empty() || response.isQuickForBodies()) && !isAnyFactored() &&
                          linearTolerance(input) >= FilteredPcg::kLeastSingleTolerance && isIncomplete;
    system.begin(parts, static_cast<int>(start.cols()), supports.masses(), supports.freeTwists(), supports.couplings(),
                 isSingle ? Precision::Single : Precision::Double, team);
    readFreeTwists();
    reference = -1.0;
    lap.addTo(times.assembly);
}

/// Of the shells'.
double IslandSolver::Impl::leastTolerance(const IslandInput& input) const {
    double tolerance = input.shells[0]->settings().tolerance;
    if (start.cols() <= ContactResponse::kFew) tolerance = std::min(tolerance, kMostOfFew);
    for (const Shell* shell : input.shells) tolerance = std::min(tolerance, shell->settings().tolerance);
    return tolerance;
}

/// Bodies that rest on shells rest on the solution: what the solve leaves over is a force on them.
double IslandSolver::Impl::linearTolerance(const IslandInput& input) const {
    constexpr double kMostWithBodies = 1e-4;
    const double tolerance = leastTolerance(input);
    return dynamicBodies.empty() || response.isQuickForBodies() ? tolerance
                                                                : std::min(kMostWithBodies, 0.1 * tolerance);
}

/// Where bodies are solved for and shells move: what may be left over is as much less than how they move, and than what
/// gravity does to the lightest body, as the tolerance says. At rest it is nothing.
double IslandSolver::Impl::enoughForBodies(const IslandInput& input) const {
    constexpr double kShare = 0.4;
    if (dynamicBodies.empty() || preconditioner.isComplete()) return 0.0;
    const double mass = input.shellMass(), tolerance = leastTolerance(input);
    double lightest = mass;
    for (int b = 0; b < std::ssize(dynamicBodies); ++b) lightest = std::min(lightest, supports.lightest(b));
    const double enough = kShare * kShare * lightest / mass * floorOfReference(input, 1.0);
    double motion = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        motion += 2.0 * input.shells[k]->kineticEnergy(start.middleCols(offsets[k], input.shells[k]->vertexCount()));
    return tolerance * tolerance * std::min(motion, enough);
}

void IslandSolver::Impl::readFreeTwists() {
    freeTwist.resize(6, static_cast<Eigen::Index>(dynamicBodies.size()));
    for (int b = 0; b < freeTwist.cols(); ++b) freeTwist.col(b) = supports.freeTwists()[b];
}

/// What gravity does in a step, so that a scene at rest is not solved to the last bit of nothing; a tenth of it where
/// the preconditioner's norm makes little of what is left of it.
double IslandSolver::Impl::floorOfReference(const IslandInput& input, double share) const {
    const double kick = share * input.h * std::max(input.gravity.norm(), 1e-6);
    return input.shellMass() * kick * kick;
}

/// Whether what a solve leaves over may be the weight of a shell that bodies alone hold: balance takes from it what no
/// contact has given.
bool IslandSolver::Impl::mayFallIn(const IslandInput& input) const {
    return response.hasContacts() && !input.gravity.isZero(0.0) &&
           std::any_of(input.shells.begin(), input.shells.end(), [](const Shell* s) { return s->pinCount() == 0; });
}

/// From `guess`, with the present contacts and preconditioner. To the tolerance; but where a shell is strained, or
/// moves fast, that may be more than its weight: see mayFallIn. The first solve of a step, but for small shells and in
/// double precision, is from no change of velocity: the last change is in part what the last solve left over, to be
/// undone and not to be repeated.
PcgReport IslandSolver::Impl::solveOnce(const IslandInput& input, bool roughly, int maxIterations, StepReport& report) {
    constexpr double kCompleteTolerance = 1e-6;  // of what a solve starts with, where it takes a few iterations
    constexpr double kShare = 0.1;               // which leaves at most this of the residual that it starts with
    constexpr double kMostOfGravity = 0.1;       // of what gravity does in a step
    constexpr double kMostDigits = 0.01;         // of the tolerance
    constexpr int kLarge = 200;                  // vertices
    const double tolerance = linearTolerance(input);
    const bool isCoarse = preconditioner.isCoarse(system);
    double rho = 0.0;
    if (reference < 0.0 || system.precision() == Precision::Double) {
        system.start(start, freeTwist, u);  // dv = 0
        rho = pcg.begin(system, preconditioner, u);
        reference = std::max(rho, floorOfReference(input, isCoarse ? 1.0 : 0.1));
    }
    if (report.solves > 0 || !isCoarse || start.cols() < kLarge) {
        system.start(*guess, guessTwist, u);
        rho = pcg.begin(system, preconditioner, u);
    }
    double target2 = std::max(tolerance * tolerance * reference, enoughForBodies(input));
    if (preconditioner.isComplete()) target2 = std::min(target2, kCompleteTolerance * kCompleteTolerance * rho);
    if (mayFallIn(input))
        target2 = std::clamp(floorOfReference(input, kMostOfGravity), kMostDigits * kMostDigits * target2, target2);
    if (roughly) target2 = std::max(target2, std::min(kRough * kRough * reference, kShare * kShare * rho));
    const PcgReport solve = pcg.finish(system, preconditioner, target2, 1.0, maxIterations, u);
    ++report.solves;
    report.pcgIterations += solve.iterations;
    report.residual = solve.residual * std::sqrt(target2 / reference);
    report.converged = solve.converged;
    return solve;
}

/// With the factor of the last solve, or with a new one where there is none, `freshIterations` < 0, and where contacts
/// have become others than it knows: then it uses up more than twice the iterations that it took when it was new.
void IslandSolver::Impl::solveRound(const IslandInput& input, bool roughly, int& freshIterations, StepReport& report) {
    int maxIterations = 0;
    for (const Shell* shell : input.shells) maxIterations = std::max(maxIterations, shell->settings().maxIterations);
    const bool isNew = freshIterations < 0 || preconditioner.isComplete() || system.precision() == Precision::Single;
    if (!isNew) {
        LapTimer lap(input);
        preconditioner.updateBodies(system);
        lap.addTo(times.factor);
        const int most = std::min(maxIterations, 20 + 2 * freshIterations);
        const bool isDone = solveOnce(input, roughly, most, report).converged || most == maxIterations;
        lap.addTo(times.solve);
        if (isDone) return;
        system.velocities(u, v);
        guess = &v;
        guessTwist = u.w;
    }
    LapTimer lap(input);
    const bool keepsCoarse = freshIterations >= 0 && system.precision() == Precision::Single;
    preconditioner.build(system, input.shells[0]->settings().preconditioner, keepsCoarse);
    lap.addTo(times.factor);
    freshIterations = solveOnce(input, roughly, maxIterations, report).iterations;
    lap.addTo(times.solve);
}

/// Until the contacts agree with the motion that they lead to. Where that is asked only once, and they changed in the
/// last step, a rough solve tells enough, if it is by far cheaper than one to the tolerance.
void IslandSolver::Impl::solveRounds(const IslandInput& input, StepReport& report) {
    guess = report.solves == 0 ? &expected : &v;
    guessTwist = report.solves == 0 ? freeTwist : u.w;
    u.resize(static_cast<int>(start.cols()), system.bodyCount());
    int freshIterations = -1;  // of the first solve with the present factor
    const bool isCheap = linearTolerance(input) < 0.1 * kRough;
    bool roughly = isCheap && response.isQuick() && response.hasContacts() && lastRounds > 1;
    int round = 0;
    for (;;) {
        LapTimer writing(input);
        response.writeTo(system);
        writing.addTo(times.contact);
        solveRound(input, roughly, freshIterations, report);
        LapTimer lap(input);
        if (!u.allFinite() || !unfiltered().allFinite()) return;
        system.velocities(u, v);
        lap.addTo(times.solve);
        const bool changed = response.update(system, {v, u.w, unfiltered()}, y, round, roughly);
        lap.addTo(times.contact);
        // What stiff shells do while their contacts are not settled would tip a body off what bears it. But motors, and
        // bodies that only touch, must let go: contacts with shells would press against them ever more.
        const bool isTelling = !preconditioner.isComplete() || (!changed && !response.isLast(round));
        const bool lifted = supports.update(u.w, input.h * input.gravity.norm(), !isTelling);
        if (lifted) {
            system.setBodies(supports.masses(), supports.freeTwists(), supports.couplings());
            readFreeTwists();
        }
        if (!changed && !lifted && !roughly) break;
        roughly = false;
        if (changed) ++round;
        guess = &v;
        guessTwist = u.w;
    }
    lastRounds = round + 1;
    unsettled |= !response.isQuick() && response.isLast(round);
}

}  // namespace jacket
