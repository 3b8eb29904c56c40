#include "jacket/Island.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "IslandImpl.h"
#include "LapTimer.h"
#include "StepParts.h"

namespace jacket {
namespace {

/// Whether a shell is factored completely: incomplete factors know little of bending that spreads over several edges,
/// and of what stands on its edge. The larger a shell, the more that costs; of large ones only sheet metal, no cloth,
/// and with bodies near them, whose contacts ask for more than bending in the air does.
bool isToBeFactored(const Shell& shell, double h, bool isNearBodies, bool givesWay) {
    constexpr int kTiny = 200, kSmall = 600, kMost = 4000;  // vertices
    constexpr double kEdges = 5.0;
    const int n = shell.vertexCount();
    if (n > kMost || shell.settings().preconditioner != Preconditioner::IncompleteCholesky) return false;
    if (n > kSmall) return isNearBodies && shell.bendingLength(h) > kEdges * shell.meanEdge();
    if (isNearBodies && !givesWay) return true;
    return n <= kTiny ? shell.isStiffAsAWhole(h) : shell.isStiff(h);
}

}  // namespace

double IslandInput::shellMass() const {
    double sum = 0.0;
    for (const Shell* shell : shells) sum += shell->masses().sum();
    return sum;
}

IslandSolver::IslandSolver() : m_impl(std::make_unique<Impl>()) {}
IslandSolver::~IslandSolver() = default;
IslandSolver::IslandSolver(IslandSolver&&) noexcept = default;
IslandSolver& IslandSolver::operator=(IslandSolver&&) noexcept = default;

const StepReport& IslandSolver::solve(const IslandInput& input) {
    if (!(input.h > 0.0) || !std::isfinite(input.h))
        throw std::invalid_argument("IslandInput.h [s] must be > 0 and finite");
    Impl& s = *m_impl;
    if (s.standing.find(input)) {
        s.solve(s.standing.input());
        s.standing.store();
    } else {
        s.solve(input);
    }
    return s.lastReport;
}

void IslandSolver::Impl::solve(const IslandInput& input) {
    const auto isFree = [](const CoupledBody& body) { return !body.prescribed; };
    if (std::any_of(input.bodies.begin(), input.bodies.end(), isFree)) patience = {};
    mayBeShorter = StepParts::areAllowed(input) && !patience.isOut();
    attempt(input);
    if (isWorthParts())
        solveInParts(input);
    else
        store(input);
    patience.endStep();
    pushShare = std::min(1.0, 2.0 * pushShare);
}

/// Everything but what others would see of it.
void IslandSolver::Impl::attempt(const IslandInput& input) {
    StepReport& report = lastReport;
    clearReport();
    impulseShare = 1.0;
    unsettled = isTooLong = isLeftDeep = false;
    times = {};
    givesWay = givesWay || !wouldBeStrained(input);
    gather(input);
    LapTimer lap(input);
    beginContacts(input);
    lap.addTo(times.contact);
    solveStep(input, report);  // A, b; filtered PCG until the contacts agree
    if (isTooLong && partOfStep == 1.0 && response.isAnyTakenOut()) pushLess(input, report);
    if (!isTooLong && !report.limited && pushesStrain(input)) {
        beginInFull(input);
        solveStep(input, report);
    }
    report.times = times;
    if (isTooLong) return;
    report.finite = u.allFinite() && unfiltered().allFinite();
    if (!report.finite) return;
    if (!dynamicBodies.empty()) limitBodies(input, report);
    LapTimer closing(input);
    isLeftDeep = endsDeep();
    report.passed = response.passes({v, endTwists(), unfiltered()}, y, unsettled || report.limited);
    closing.addTo(report.times.contact);
    report.settled = !unsettled;
    report.mayPass = response.hasFastBody() && (report.limited || unsettled);
}

/// What takes shells out of walls may be what makes the step too long: out of something round their edges would go by
/// many times the depth, as the linear solve has it. Less is as good, it only takes more steps.
void IslandSolver::Impl::pushLess(const IslandInput& input, StepReport& report) {
    constexpr double kLess = 0.25, kLeast = 0.01;
    do {
        if (!response.isQuick()) pushShare *= kLess;
        isTooLong = unsettled = false;
        beginInFull(input);
        solveStep(input, report);
    } while (isTooLong && pushShare > kLeast);
    if (isTooLong) pushShare = 1.0;
}

/// Whether contacts with a fast body did not settle in the whole of a step, or Newton's method, or what did not leaves
/// shells deep in free bodies.
bool IslandSolver::Impl::isWorthParts() const {
    return isTooLong || ((lastReport.passed || lastReport.mayPass || isLeftDeep) && mayBeShorter);
}

/// Whether contacts leave shells deep in free bodies: they used up their rounds, or what went on changing was given up.
bool IslandSolver::Impl::endsDeep() {
    constexpr double kDeep = 10.0;  // times the contacts' slop
    if (!mayBeShorter || dynamicBodies.empty() || response.isQuick()) return false;
    const double gap = unsettled ? response.gapAtEnd({v, endTwists(), unfiltered()}, y) : response.deepestGap();
    return gap < -kDeep * response.slop();
}

void IslandSolver::Impl::solveInParts(const IslandInput& input) {
    constexpr int kMostSolves = 1000;
    StepParts step(input, lastReport);
    while (!step.areDone()) {
        partOfStep = step.next().h / input.h;
        mayBeShorter = step.mayBeShorter();
        attempt(step.next());
        if (isWorthParts()) {
            step.shorten(lastReport);
            continue;
        }
        store(step.next());
        step.add(lastReport);
        if (isAmongWalls(input) && step.report().solves > kMostSolves) patience.workedInVain();
    }
    partOfStep = 1.0;
    lastReport = step.report();
}

void IslandSolver::Impl::clearReport() {
    std::vector<ContactImpulse> contacts = std::move(lastReport.contacts);  // and its memory
    contacts.clear();
    lastReport = {};
    lastReport.contacts = std::move(contacts);
}

void IslandSolver::Impl::gather(const IslandInput& input) {
    offsets.clear();
    int count = 0;
    for (const Shell* shell : input.shells) {
        offsets.push_back(count);
        count += shell->vertexCount();
    }
    start.resize(3, count);
    for (Points* seldomUsed : {&newtonFrom, &calmest}) seldomUsed->resize(3, count);
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const int n = input.shells[k]->vertexCount();
        start.middleCols(offsets[k], n) = input.shells[k]->velocities();
        for (int i = 0; input.isCalm && i < n; ++i)
            if (!input.shells[k]->isPinned(i)) start.col(offsets[k] + i).setZero();
    }
    y.setZero(3, count);
    isTwoStep = false;
    stepOf.assign(input.shells.size(), input.h);
    elasticAtStart.assign(input.shells.size(), std::numeric_limits<double>::quiet_NaN());
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        if (input.bodies.empty()) beginTwoStep(input, k);
    factored.clear();
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        factored.push_back(isToBeFactored(*input.shells[k], stepOf[k], !input.bodies.empty(), givesWay));
    dynamicIndex.assign(input.bodies.size(), -1);
    dynamicBodies.clear();
    for (std::size_t b = 0; b < input.bodies.size(); ++b) {
        if (input.bodies[b].prescribed) continue;
        dynamicIndex[b] = static_cast<int>(dynamicBodies.size());
        dynamicBodies.push_back(static_cast<int>(b));
    }
    bodyShare.assign(dynamicBodies.size(), 1.0);
    supports.begin(input.bodies, input.couplings, input.rigidContacts, dynamicIndex);
    if (lastChange.cols() != count) lastChange.setZero(3, count);
    expected = start + lastChange;
}

/// A step, or a try at it, in which shells do not give way: see pushesStrain.
void IslandSolver::Impl::beginInFull(const IslandInput& input, bool onlyStops) {
    givesWay = false;
    stepsInFull = 0;
    gather(input);
    beginContacts(input, onlyStops);
}

/// Those at the start of the step, and y.
void IslandSolver::Impl::beginContacts(const IslandInput& input, bool onlyStops) {
    response.begin(input,
                   {offsets, dynamicIndex, stepOf, isAnyFactored(), givesWay, mayBeShorter, patience.isOut(),
                    partOfStep, pushShare, onlyStops},
                   expected, y);
    givesWay = givesWay || !response.hasContacts();
}

/// BDF2 with steps h and h' before it, r = h / h', gamma = (1 + r) / (1 + 2 r):
///     q_n+1 = ((1 + r)^2 q_n - r^2 q_n-1) / (1 + 2 r) + gamma h dq/dt_n+1
/// for positions and velocities: a step of backward Euler of length gamma h from other positions and velocities.
void IslandSolver::Impl::beginTwoStep(const IslandInput& input, std::size_t k) {
    Shell& shell = *input.shells[k];
    shell.m_stride = 1.0;
    if (shell.settings().integrator != Integrator::Bdf2 || !(shell.m_lastH > 0.0)) return;
    const double r = input.h / shell.m_lastH, scale = 1.0 / (1.0 + 2.0 * r);
    const double now = (1.0 + r) * (1.0 + r) * scale, before = -r * r * scale;
    if (!isTwoStep) twoStepFrom = start;
    isTwoStep = true;
    shell.m_stride = (1.0 + r) * scale;
    stepOf[k] = shell.m_stride * input.h;
    twoStepFrom.middleCols(offsets[k], shell.vertexCount()) = now * shell.velocities() + before * shell.m_lastV;
    y.middleCols(offsets[k], shell.vertexCount()) = (now - 1.0) * shell.positions() + before * shell.m_lastX;
}

/// What was solved goes to the bodies and then to the shells, unless it is not finite.
void IslandSolver::Impl::store(const IslandInput& input) {
    StepReport& report = lastReport;
    if (!report.finite) return reject();
    response.finish(report.contacts);
    if (impulseShare == 0.0) report.contacts.clear();
    const BodyVectors& twists = endTwists();
    twistChange = twists - freeTwist;
    system.momentum(twistChange, momentum);
    for (ContactImpulse& contact : report.contacts) {
        const int dynamic = dynamicIndex[contact.contact.body];
        contact.impulse *= impulseShare * (dynamic < 0 ? 1.0 : bodyShare[dynamic]);
    }
    for (std::size_t b = 0; b < input.bodies.size(); ++b) {
        CoupledBody& body = input.bodies[b];
        body.twist = body.prescribed ? body.freeTwist : Vec6(twists.col(dynamicIndex[b]));
        body.motion = input.h * body.twist;
        // The solved change of momentum, not the sum of the contacts' impulses: a light body would feel their residual.
        body.impulse = body.prescribed ? Vec6::Zero() : Vec6(momentum.col(dynamicIndex[b]));
    }
    if ((report.limited || !report.settled) && dynamicBodies.empty()) makePossible(input, report.contacts);
    balance(input, report.contacts);
    if (!report.limited) pushOut(input, report);
    if (!isFinite(input)) return reject();
    report.deepestGap = response.deepestGap();
    if (report.deepestGap < -20.0 * response.slop()) report.converged = false;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        Shell& shell = *input.shells[k];
        const int n = shell.vertexCount();
        lastChange.middleCols(offsets[k], n) = v.middleCols(offsets[k], n) - shell.velocities();
        if (shell.settings().integrator == Integrator::Bdf2) {
            shell.m_lastX = shell.m_x;
            shell.m_lastV = shell.m_v;
            shell.m_lastH = input.h;
        }
        shell.m_v = v.middleCols(offsets[k], n);
        shell.m_y = y.middleCols(offsets[k], n);
    }
}

/// The state is as it was; the caller decides.
void IslandSolver::Impl::reject() {
    lastReport.finite = lastReport.converged = false;
    lastReport.contacts.clear();
}

bool IslandSolver::Impl::isFinite(const IslandInput& input) const {
    const auto isGiven = [](const CoupledBody& b) { return b.twist.allFinite() && b.impulse.allFinite(); };
    return v.allFinite() && y.allFinite() && std::all_of(input.bodies.begin(), input.bodies.end(), isGiven);
}

}  // namespace jacket
