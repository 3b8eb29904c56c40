#include "jacket/Island.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory_resource>
#include <stdexcept>
#include <utility>

#include "EdgeStretch.h"
#include "ShellAssembly.h"
#include "StepParts.h"
#include "contact/ContactResponse.h"
#include "solver/BodySupports.h"
#include "solver/FilteredPcg.h"

namespace jacket {
namespace {

constexpr double kEnergyGain = 0.02;       ///< of a step that is linearised again: see energyGain
constexpr double kEnergyGainAlone = 0.25;  ///< the same where nothing can be thrown
constexpr double kMostGainOfFast = 0.1;    ///< the same where a body goes farther than it is thick
constexpr double kMostOvertaking = 3.0;    ///< of a shell that is pushed: its speed over the pushing body's
constexpr double kMostEnergyGain = 1.0;    ///< of a step that is accepted as it is

constexpr double kRough = 0.03;  ///< tolerance of a rough solve

constexpr int kLeastForTeam = 1000;  ///< vertices of an island from which on threads pay
constexpr int kLeastCompact = 200;   ///< vertices of a shell from which on a coarse space pays in double precision

/// Gives the time since the last call, by the caller's clock if there is one.
class LapTimer {
  public:
    explicit LapTimer(const IslandInput& input) : m_clock(input.clock), m_last(m_clock ? m_clock() : 0.0) {}
    void addTo(double& sum) {
        if (!m_clock) return;
        const double now = m_clock();
        sum += now - m_last;
        m_last = now;
    }

  private:
    double (*m_clock)();
    double m_last;
};

/// From a body's centre of mass to where the shell touches it, at the start of the step.
Vec3 contactArm(const IslandInput& input, const Contact& contact) {
    Vec3 arm = -input.bodies[contact.body].position;
    for (int a = 0; a < 3; ++a)
        arm += contact.weights[a] * input.shells[contact.shell]->positions().col(contact.vertices[a]);
    return arm;
}

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

/// Of a shell that is strained by as much everywhere [J].
double strainEnergy(const Shell& shell, double strain) {
    const double area = shell.masses().sum() / shell.material().areaDensity();
    return 0.5 * shell.material().stretchStiffness() * area * strain * strain;
}

/// Whether other bodies or joints hold it in some directions: its mass against a force at its centre is by far less in
/// the one that it yields to most than in others.
bool isHeldInSome(const Mat6& mass) {
    constexpr double kMost = 0.1;
    const Mat3 coupling = mass.topRightCorner<3, 3>();
    const Mat3 moved =
        mass.topLeftCorner<3, 3>() - coupling * mass.bottomRightCorner<3, 3>().ldlt().solve(Mat3(coupling.transpose()));
    Eigen::SelfAdjointEigenSolver<Mat3> modes;
    return modes.computeDirect(moved, Eigen::EigenvaluesOnly).eigenvalues()[0] <
           kMost * mass.topLeftCorner<3, 3>().trace() / 3.0;
}

using BodyVectors = Eigen::Matrix<double, 6, Eigen::Dynamic>;  ///< twists or momenta

/// By how much damping makes a mass harder to move.
double damping(const IslandInput& input, const Shell& shell) {
    return 1.0 + input.h * shell.material().massDamping;
}

}  // namespace

struct IslandSolver::Impl {
    std::pmr::unsynchronized_pool_resource pool;  ///< what a step gives back, the next one takes
    CoupledSystem system;
    CoupledPreconditioner preconditioner;
    FilteredPcg pcg;
    BodySupports supports;
    ContactResponse response;
    std::vector<int> offsets, dynamicIndex;
    std::vector<int> dynamicBodies;  ///< index in IslandInput.bodies of each dynamic body
    Points v, start, y;              ///< all shells
    Points twoStepFrom;              ///< see from(); of BDF2 alone
    bool isTwoStep = false;          ///< whether some shell takes a step of BDF2
    std::vector<double> stepOf;      ///< of each shell, as its integrator counts it [s]
    std::vector<char> factored;      ///< shells: completely
    bool mayBeShorter = false;       ///< the step that is being solved
    bool givesWay = true;            ///< false for as long as wouldBeStrained says: see pushesStrain
    int stepsInFull = 0;             ///< that have been taken since givesWay became false
    Points lastChange;               ///< dv of the last step
    Points expected;                 ///< velocities if that goes on
    CoupledVector u;
    const Points* guess = nullptr;  ///< velocities that a solve starts from: `expected`, or `v`
    Points newtonFrom, calmest;     ///< where the last Newton step was linearised, and where one that gained least was
    /// Velocities of shells that do not deform, and what the last solve led to: asked for once Newton steps are over.
    Points &rigid = newtonFrom, &reached = calmest;
    std::vector<CoupledSystem::ShellPart> parts;
    BodyVectors freeTwist, guessTwist;
    BodyVectors twistChange;  ///< of the bodies' twists, by the shells
    mutable BodyVectors twistsAtEnd, freeMomentum,
        momentum;                                ///< of the bodies: twists at the end of the step, and momenta
    bool unsettled = false;                      ///< contacts of this step have used up their rounds
    double reference = -1.0;                     ///< r^T P^-1 r that the tolerance refers to; < 0: not known
    int lastRounds = 1;                          ///< changes of the contacts in the last step, and one
    mutable std::vector<double> elasticAtStart;  ///< of each shell at the start of the step; NaN: not yet asked for [J]
    mutable std::vector<double> energyMemory;    ///< see Energy::valueBeside
    StepTimes times;                             ///< of the step so far
    StepReport lastReport;
    double partOfStep = 1.0;        ///< that is being solved: what a step may gain, its parts may together
    double impulseShare = 1.0;      ///< of the solved contacts that a step cut short takes: see limitDeformation
    std::vector<double> bodyShare;  ///< of that, what each dynamic body takes: see limitBodies

    void clearReport();
    void gather(const IslandInput& input);
    void beginContacts(const IslandInput& input, bool onlyStops = false);
    void beginTwoStep(const IslandInput& input, std::size_t shell);
    void assemble(const IslandInput& input, bool atEnd);
    /// Velocities that the step's momentum starts from (BDF2: not `start`).
    const Points& from() const { return isTwoStep ? twoStepFrom : start; }
    /// (b - A v) at the solution, soft rows included.
    const Points& unfiltered() const { return pcg.unfilteredResidual(); }
    bool isAnyFactored() const { return std::count(factored.begin(), factored.end(), 0) < std::ssize(factored); }
    void readFreeTwists();
    bool overstretches(const IslandInput& input, bool isAgain) const;
    Points& endAfter(std::size_t shell, const IslandInput& input, const Points& velocities) const;
    double elasticEnergyAfter(const IslandInput& input, std::size_t shell, const Points& velocities) const;
    double elasticEnergyGain(const IslandInput& input, std::size_t shell) const;
    WorkerTeam* teamFor(const IslandInput& input) const { return start.cols() < kLeastForTeam ? nullptr : input.team; }
    double energyGain(const IslandInput& input) const;
    double energyOfMotion(const IslandInput& input, std::size_t shell) const;
    bool bodiesLead(const IslandInput& input) const;
    bool descend(const IslandInput& input, StepReport& report);
    void limitDeformation(const IslandInput& input, StepReport& report);
    void limitPushes(const IslandInput& input, double mostGain);
    double gainOfCoasting(const IslandInput& input);
    void blend(const IslandInput& input, const Points& other);
    void coast(const IslandInput& input, const Points& coasting);
    double shareWithin(const IslandInput& input, const CoupledBody& body, int dynamic, const Vec6& after,
                       double speed) const;
    void limitBodies(const IslandInput& input, StepReport& report);
    void makeRigid(const IslandInput& input, Points& velocities, double time) const;
    const BodyVectors& endTwists() const;
    bool improves(const IslandInput& input);
    double incrementalPotential(const IslandInput& input, const Points& velocities) const;
    void solveStep(const IslandInput& input, StepReport& report);
    double linearTolerance(const IslandInput& input) const;
    double floorOfReference(const IslandInput& input, double share) const;
    PcgReport solveOnce(const IslandInput& input, bool roughly, int maxIterations, StepReport& report);
    void solveRound(const IslandInput& input, bool roughly, int& freshIterations, StepReport& report);
    void solveRounds(const IslandInput& input, StepReport& report);
    void store(const IslandInput& input);
    void attempt(const IslandInput& input);
    bool isWorthParts() const;
    void solveInParts(const IslandInput& input);
    bool isFinite(const IslandInput& input) const;
    void reject();
    bool pushesStrain(const IslandInput& input);
    bool wouldBeStrained(const IslandInput& input);
    void pushOut(const IslandInput& input, StepReport& report);
    void balance(const IslandInput& input, std::vector<ContactImpulse>& impulses);
    Vec6 excessOf(int body, const Vec6& residual) const;
    void shift(const IslandInput& input, std::span<const Vec3> onShells, std::vector<ContactImpulse>& impulses);
    bool giveToWalls(const IslandInput& input, int shell, const Vec3& impulse,
                     std::vector<ContactImpulse>& impulses) const;
};

IslandSolver::IslandSolver() : m_impl(std::make_unique<Impl>()) {}
IslandSolver::~IslandSolver() = default;
IslandSolver::IslandSolver(IslandSolver&&) noexcept = default;
IslandSolver& IslandSolver::operator=(IslandSolver&&) noexcept = default;

const StepReport& IslandSolver::solve(const IslandInput& input) {
    if (!(input.h > 0.0) || !std::isfinite(input.h))
        throw std::invalid_argument("IslandInput.h [s] must be > 0 and finite");
    Impl& s = *m_impl;
    s.mayBeShorter = StepParts::areAllowed(input);
    s.attempt(input);
    if (s.isWorthParts())
        s.solveInParts(input);
    else
        s.store(input);
    return s.lastReport;
}

/// Everything but what others would see of it.
void IslandSolver::Impl::attempt(const IslandInput& input) {
    StepReport& report = lastReport;
    clearReport();
    impulseShare = 1.0;
    unsettled = false;
    times = {};
    givesWay = givesWay || !wouldBeStrained(input);
    gather(input);
    LapTimer lap(input);
    beginContacts(input);
    lap.addTo(times.contact);
    solveStep(input, report);  // A, b; filtered PCG until the contacts agree
    if (!report.limited && pushesStrain(input)) {
        givesWay = false;
        stepsInFull = 0;
        gather(input);
        beginContacts(input);
        solveStep(input, report);
    }
    report.times = times;
    report.finite = u.allFinite() && unfiltered().allFinite();
    if (!report.finite) return;
    if (!dynamicBodies.empty()) limitBodies(input, report);
    LapTimer closing(input);
    report.passed = response.passes({v, endTwists(), unfiltered()}, y);
    closing.addTo(report.times.contact);
    report.settled = !unsettled;
    report.mayPass = response.hasFastBody() && (report.limited || unsettled);
}

/// Whether contacts with a fast body did not settle in the whole of a step.
bool IslandSolver::Impl::isWorthParts() const {
    return (lastReport.passed || lastReport.mayPass) && mayBeShorter;
}

void IslandSolver::Impl::solveInParts(const IslandInput& input) {
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

/// Those at the start of the step, and y.
void IslandSolver::Impl::beginContacts(const IslandInput& input, bool onlyStops) {
    response.begin(input, {offsets, dynamicIndex, stepOf, isAnyFactored(), givesWay, mayBeShorter, onlyStops}, expected,
                   y);
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

/// One linear solve, as Baraff & Witkin have it. Only where it has stretched an edge far beyond what it was, which the
/// linearisation at the start did not see coming (an unstressed sheet resists no motion out of its plane), it is
/// linearised again at the end that it found. The other integrators go on until the velocities no longer change: one
/// linearisation would cost BDF2 its second order wherever a shell turns far.
void IslandSolver::Impl::solveStep(const IslandInput& input, StepReport& report) {
    constexpr int kMostNewtonSteps = 5, kMostToTheEnd = 30;
    const bool toTheEnd = std::any_of(input.shells.begin(), input.shells.end(), [](const Shell* shell) {
        return shell->settings().integrator != Integrator::BackwardEuler;
    });
    const int most = toTheEnd ? kMostToTheEnd : kMostNewtonSteps;
    double leastGain = std::numeric_limits<double>::infinity();
    int calmestStep = 1;
    assemble(input, false);
    for (int newton = 1;; ++newton) {
        if (newton > 1) newtonFrom = v;  // most steps are over after the first
        solveRounds(input, report);
        if (!unfiltered().allFinite()) return;
        const bool goOn = toTheEnd ? newton == 1 || improves(input) : overstretches(input, newton > 1);
        if (!goOn) return;
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
    const bool isAmongWalls = dynamicBodies.empty() && !input.bodies.empty();
    if (isAmongWalls && energyGain(input) > partOfStep * kEnergyGainAlone && descend(input, report)) return;
    if (energyGain(input) > partOfStep * mostGain) limitDeformation(input, report);
}

/// Where Newton's method does not settle among walls: once more from standing still, which no contact forbids that only
/// stops, and always downhill. So it gains no energy, wherever it ends. False if it did not come to that.
bool IslandSolver::Impl::descend(const IslandInput& input, StepReport& report) {
    constexpr int kMostSteps = 20, kMostHalvings = 20;
    constexpr double kSettled = 1e-3;  // of what the first step brings
    givesWay = false;
    stepsInFull = 0;
    gather(input);
    beginContacts(input, true);
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
    system.start(v, freeTwist, u);
    report.limited = true;
    return energyGain(input) <= partOfStep * kMostEnergyGain;
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

/// What a step of backward Euler minimises: 1/2 |v - v_0|^2_M + W(x + y + h v) - h f_ext . v   [J]
double IslandSolver::Impl::incrementalPotential(const IslandInput& input, const Points& velocities) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        const int n = shell.vertexCount();
        const auto part = velocities.middleCols(offsets[k], n);
        const auto since = part - from().middleCols(offsets[k], n);
        for (int i = 0; i < n; ++i)
            sum += shell.masses()[i] * (0.5 * since.col(i).squaredNorm() - stepOf[k] * input.gravity.dot(part.col(i))) -
                   stepOf[k] * shell.forces().col(i).dot(part.col(i));
        sum += elasticEnergyAfter(input, k, velocities);
    }
    return sum;
}

/// Where velocities lead a shell, in its scratch.
Points& IslandSolver::Impl::endAfter(std::size_t k, const IslandInput& input, const Points& velocities) const {
    const Shell& shell = *input.shells[k];
    const int n = shell.vertexCount();
    Points& end = shell.m_assembly->scratch();
    end = shell.positions() + y.middleCols(offsets[k], n) + stepOf[k] * velocities.middleCols(offsets[k], n);
    return end;
}

double IslandSolver::Impl::elasticEnergyAfter(const IslandInput& input, std::size_t k, const Points& velocities) const {
    return input.shells[k]->elasticEnergy(endAfter(k, input, velocities));
}

/// Of a shell in the solved step [J]. Its sums have one order and cannot be shared, but there are four of them: of
/// either energy at the end and, unless it is known, at the start. They stand so that two threads that take them from
/// both ends have as much to do.
double IslandSolver::Impl::elasticEnergyGain(const IslandInput& input, std::size_t k) const {
    const Shell& shell = *input.shells[k];
    WorkerTeam* const team = teamFor(input);
    const Points& end = endAfter(k, input, v);
    const bool isStartKnown = !std::isnan(elasticAtStart[k]);
    if (!team || !end.allFinite()) {
        if (!isStartKnown) elasticAtStart[k] = shell.elasticEnergy(shell.positions());
        return shell.elasticEnergy(end) - elasticAtStart[k];
    }
    const Energy &membrane = shell.m_assembly->membrane(), &bending = shell.m_assembly->bending();
    std::array<double, 4> sums{};
    runParts(team, isStartKnown ? 2 : 4, [&](int i) {
        if (i == 0) sums[i] = bending.value(end);
        if (i == 1) sums[i] = membrane.value(end);
        if (i == 2) sums[i] = bending.valueBeside(shell.positions(), energyMemory);
        if (i == 3) sums[i] = membrane.value(shell.positions());
    });
    if (!isStartKnown) elasticAtStart[k] = sums[3] + sums[2];
    return sums[1] + sums[0] - elasticAtStart[k];
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

/// Where Newton's method does not settle, as in a stiff shell pinched between bodies, the step would throw the shell
/// about. Its linear and angular momentum are kept then, and of the motion besides that only as much as gains no
/// energy: it stands stiff for a step. If that still gains energy, contacts give only a share of what was solved, to
/// shells and bodies alike. They may give way by that much until the next step, and a fast body may pass.
void IslandSolver::Impl::limitDeformation(const IslandInput& input, StepReport& report) {
    constexpr int kMostHalvings = 40;
    report.limited = true;
    limitPushes(input, kMostEnergyGain);
    const double most = std::max(kEnergyGain, gainOfCoasting(input));
    rigid = v;
    makeRigid(input, rigid, input.h);
    const bool isHeld =
        std::any_of(input.shells.begin(), input.shells.end(), [](const Shell* shell) { return shell->pinCount() > 0; });
    for (int halving = 0; halving < kMostHalvings && energyGain(input) > most; ++halving) {
        blend(input, rigid);
        if (isHeld) impulseShare *= 0.5;  // its pins take the momentum; a light body would keep the shell's old speed
    }
    rigid = start.colwise() + input.h * input.gravity;
    makeRigid(input, rigid, input.h);  // coasting
    for (int halving = 0; halving < kMostHalvings && energyGain(input) > most; ++halving) {
        blend(input, rigid);
        impulseShare *= 0.5;
    }
    if (!(energyGain(input) <= most)) coast(input, rigid);
    for (std::size_t b = 0; impulseShare < 1.0 && b < input.bodies.size(); ++b) response.forget(static_cast<int>(b));
}

/// What moves vertices out of bodies goes half way to a rigid motion until it no longer gains more than that share of
/// the energy: their neighbours will not give way as they were to, and may turn with the shell.
void IslandSolver::Impl::limitPushes(const IslandInput& input, double mostGain) {
    constexpr int kMostHalvings = 40;
    reached = y;
    makeRigid(input, reached, 1.0);
    rigid = start.colwise() + input.h * input.gravity;
    makeRigid(input, rigid, input.h);
    double most = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        most += elasticAtStart[k] + partOfStep * mostGain * (elasticAtStart[k] + energyOfMotion(input, k));
    const auto energyAfter = [&] {
        double sum = 0.0;
        for (std::size_t k = 0; k < input.shells.size(); ++k) sum += elasticEnergyAfter(input, k, rigid);
        return sum;
    };
    for (int halving = 0; halving < kMostHalvings && energyAfter() > most; ++halving) y = 0.5 * (y + reached);
}

/// Of a step in which shells take nothing from their contacts but what moves them out of bodies: see energyGain.
double IslandSolver::Impl::gainOfCoasting(const IslandInput& input) {
    reached = v;
    v = start.colwise() + input.h * input.gravity;
    makeRigid(input, v, input.h);
    const double share = std::exchange(impulseShare, 0.0), gain = energyGain(input);
    impulseShare = share;
    v.swap(reached);
    return gain;
}

/// Half way from the solved velocities to others, where vertices are free.
void IslandSolver::Impl::blend(const IslandInput& input, const Points& other) {
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        for (int i = 0; i < input.shells[k]->vertexCount(); ++i)
            if (!input.shells[k]->isPinned(i))
                v.col(offsets[k] + i) = 0.5 * (v.col(offsets[k] + i) + other.col(offsets[k] + i));
}

/// As if nothing had been solved: what was is so far off that no share of it can be used. What can yield is moved out
/// of bodies as a whole: it would keep the strain.
void IslandSolver::Impl::coast(const IslandInput& input, const Points& coasting) {
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        for (int i = 0; i < shell.vertexCount(); ++i)
            if (!shell.isPinned(i)) v.col(offsets[k] + i) = coasting.col(offsets[k] + i);
        if (input.bodies.empty() || !shell.settings().plasticity || shell.pinCount() > 0) continue;
        auto alteration = y.middleCols(offsets[k], shell.vertexCount());
        Eigen::Index most = 0;
        alteration.colwise().squaredNorm().maxCoeff(&most);
        alteration.colwise() = Vec3(alteration.col(most));
    }
    impulseShare = 0.0;
}

/// Leaves of velocities the rigid motion of each shell with their momentum; none of shells that are held. It is what
/// leads them in `time` to where they have turned: along the tangents they would be stretched.
void IslandSolver::Impl::makeRigid(const IslandInput& input, Points& velocities, double time) const {
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        auto part = velocities.middleCols(offsets[k], shell.vertexCount());
        if (shell.pinCount() > 0) {
            part.setZero();
            continue;
        }
        const Eigen::VectorXd& mass = shell.masses();
        const Vec3 centre = shell.positions() * mass / mass.sum(), mean = part * mass / mass.sum();
        Mat3 inertia = Mat3::Zero();
        Vec3 spin = Vec3::Zero();
        for (int i = 0; i < shell.vertexCount(); ++i) {
            const Vec3 r = shell.positions().col(i) - centre;
            inertia += mass[i] * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
            spin += mass[i] * r.cross(Vec3(part.col(i)));
        }
        const Vec3 omega = inertia.ldlt().solve(spin);
        const Mat3 turn = Eigen::AngleAxisd(time * omega.norm(), omega.normalized()).toRotationMatrix();
        const Mat3 chord = (turn - Mat3::Identity()) / time;
        for (int i = 0; i < shell.vertexCount(); ++i) part.col(i) = mean + chord * (shell.positions().col(i) - centre);
    }
}

/// Twists of the dynamic bodies at the end of the step.
const BodyVectors& IslandSolver::Impl::endTwists() const {
    const Eigen::Map<const Eigen::RowVectorXd> share(bodyShare.data(), freeTwist.cols());
    return twistsAtEnd = freeTwist + impulseShare * ((u.w - freeTwist).array().rowwise() * share.array()).matrix();
}

/// The largest share of its change of twist to `after` with which a body keeps within its energy without the shells and
/// that of its mass at `speed`. Where it is held in some directions, that mass says nothing of the others: there its
/// speed is asked for too, besides what gravity may do to it.
double IslandSolver::Impl::shareWithin(const IslandInput& input, const CoupledBody& body, int dynamic,
                                       const Vec6& after, double speed) const {
    constexpr int kMostHalvings = 40;
    const Vec6 before = freeTwist.col(dynamic), change = impulseShare * (after - before);
    const auto energy = [&](const Vec6& twist) { return 0.5 * twist.dot(supports.ownMass(dynamic) * twist); };
    const double mass = body.mass.topLeftCorner<3, 3>().trace() / 3.0;
    const double most = std::max(energy(body.freeTwist), energy(before)) + 0.5 * mass * speed * speed;
    double most2 = std::numeric_limits<double>::infinity();
    if (isHeldInSome(body.mass))
        most2 = std::max(body.freeTwist.head<3>().squaredNorm(), before.head<3>().squaredNorm()) + speed * speed +
                (input.h * input.gravity).squaredNorm();
    double share = 1.0;
    for (int i = 0; i < kMostHalvings; ++i, share *= 0.5) {
        const Vec6 twist = before + share * change;
        if (energy(twist) <= most && twist.head<3>().squaredNorm() <= most2) return share;
    }
    return 0.0;
}

/// What a shell pushes cannot become much faster than the shell: a body that does, as light ones may where contacts did
/// not settle, takes a share of their impulses only, and what they remember is forgotten. Where they did not settle,
/// the shell's velocities at the start are what is known of it, and what bears a body may have been solved as pulling
/// it back from where the shell then throws it.
void IslandSolver::Impl::limitBodies(const IslandInput& input, StepReport& report) {
    const bool isSure = !unsettled && !report.limited;
    const std::vector<double>& speeds = response.speedsBeside(start, isSure ? v : start);
    if (!isSure) {
        twistChange = u.w - freeTwist;
        system.momentum(twistChange, momentum);
    }
    const BodyVectors& after = isSure ? u.w : supports.respond(momentum, input.h * input.gravity.norm());
    double least = 1.0;
    for (std::size_t b = 0; b < dynamicBodies.size(); ++b) {
        const int body = dynamicBodies[b], dynamic = static_cast<int>(b);
        const bool isAnchored = std::any_of(input.anchors.begin(), input.anchors.end(),
                                            [&](const auto& anchor) { return anchor.body == body; });
        if (isAnchored || !(speeds[body] >= 0.0)) continue;
        const double speed = (isSure ? kMostOvertaking : 1.0) * speeds[body];
        bodyShare[b] = shareWithin(input, input.bodies[body], dynamic, after.col(dynamic), speed);
        least = std::min(least, bodyShare[b]);
        if (bodyShare[b] < 1.0) response.forget(body);
    }
    if (least == 1.0) return;
    report.limited = true;
    if (!input.couplings.empty() || !input.rigidContacts.empty())  // what joins them must not be torn
        std::fill(bodyShare.begin(), bodyShare.end(), least);
}

/// Whether most of the energy comes with the bodies.
bool IslandSolver::Impl::bodiesLead(const IslandInput& input) const {
    double inShells = 0.0, inBodies = 0.0;
    for (const Shell* shell : input.shells) {
        const ShellEnergy energy = shell->energy();
        inShells += energy.kinetic + energy.membrane + energy.bending;
    }
    for (const int b : dynamicBodies)
        inBodies += 0.5 * input.bodies[b].freeTwist.dot(input.bodies[b].mass * input.bodies[b].freeTwist);
    return inBodies > inShells;
}

/// Of a shell at the start of the step, or what gravity would give it in one [J].
double IslandSolver::Impl::energyOfMotion(const IslandInput& input, std::size_t k) const {
    const Shell& shell = *input.shells[k];
    return shell.kineticEnergy(from().middleCols(offsets[k], shell.vertexCount())) +
           0.5 * shell.masses().sum() * (stepOf[k] * input.gravity).squaredNorm();
}

/// What shells and bodies gain in the solved step besides what gravity, forces and moved supports do, over the energy
/// that they start with, or that gravity gives what starts from rest.
double IslandSolver::Impl::energyGain(const IslandInput& input) const {
    if (input.wind) return 0.0;  // what wind and pressure give is not known
    double atStart = 0.0, gain = 0.0, pushed = 0.0, mass = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        const int n = shell.vertexCount();
        const auto part = v.middleCols(offsets[k], n);
        const auto before = from().middleCols(offsets[k], n);
        if (shell.pressure() != 0.0) return 0.0;
        for (int i = 0; i < n; ++i) {
            const Vec3 mean = 0.5 * (part.col(i) + before.col(i));
            const double kinetic = 0.5 * shell.masses()[i] * before.col(i).squaredNorm();
            const Vec3 load = shell.masses()[i] * input.gravity + shell.forces().col(i);
            atStart += kinetic + 0.5 * shell.masses()[i] * (stepOf[k] * input.gravity).squaredNorm();
            mass += shell.masses()[i];
            pushed += 0.5 * shell.masses()[i] * part.col(i).squaredNorm() - stepOf[k] * load.dot(mean);
            gain += 0.5 * shell.masses()[i] * part.col(i).squaredNorm() - kinetic - stepOf[k] * load.dot(mean);
        }
        gain += elasticEnergyGain(input, k);
        atStart += elasticAtStart[k];
    }
    system.momentum(freeTwist, freeMomentum);
    const BodyVectors& twists = endTwists();
    system.momentum(twists, momentum);
    for (std::size_t b = 0; b < dynamicBodies.size(); ++b) {
        const double kinetic = 0.5 * freeTwist.col(b).dot(freeMomentum.col(b));
        atStart += kinetic;
        gain += 0.5 * twists.col(b).dot(momentum.col(b)) - kinetic;
    }
    double fastest2 = 0.0;
    for (const auto& held : system.constraints()) {  // work of pins and bodies that are moved
        if (held.body >= 0) continue;
        gain -= std::max(0.0, -unfiltered().col(held.vertex).dot(held.carried));
        fastest2 = std::max(fastest2, held.carried.squaredNorm());
    }
    for (const auto& row : system.rows()) {
        if (row.body >= 0) continue;
        gain -= std::max(0.0, system.rowImpulse(row, v, u.w).dot(row.carried));
        fastest2 = std::max(fastest2, row.carried.squaredNorm());
    }
    // Jammed between walls the work is any number; but what they push cannot be much faster than they are.
    const double most = std::max(atStart + 0.5 * kMostOvertaking * kMostOvertaking * mass * fastest2, 1e-300);
    return std::max(gain / std::max(atStart, 1e-300), pushed / most - 1.0);
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
    // Bodies that rest on the solution feel what single precision leaves over: soft rows and stacks lose their balance.
    const bool isSingle = dynamicBodies.empty() && !isAnyFactored() &&
                          linearTolerance(input) >= FilteredPcg::kLeastSingleTolerance && isIncomplete;
    system.begin(parts, static_cast<int>(start.cols()), supports.masses(), supports.freeTwists(), supports.couplings(),
                 isSingle ? Precision::Single : Precision::Double, team);
    readFreeTwists();
    reference = -1.0;
    lap.addTo(times.assembly);
}

/// The least of the shells'. Bodies rest on the solution: what the solve leaves over is a force on them.
double IslandSolver::Impl::linearTolerance(const IslandInput& input) const {
    constexpr double kMostWithBodies = 1e-4;
    double tolerance = input.shells[0]->settings().tolerance;
    for (const Shell* shell : input.shells) tolerance = std::min(tolerance, shell->settings().tolerance);
    return dynamicBodies.empty() ? tolerance : std::min(kMostWithBodies, 0.1 * tolerance);
}

void IslandSolver::Impl::readFreeTwists() {
    freeTwist.resize(6, static_cast<Eigen::Index>(dynamicBodies.size()));
    for (int b = 0; b < freeTwist.cols(); ++b) freeTwist.col(b) = supports.freeTwists()[b];
}

/// What gravity does in a step, so that a scene at rest is not solved to the last bit of nothing; a tenth of it where
/// the preconditioner's norm makes little of what is left of it.
double IslandSolver::Impl::floorOfReference(const IslandInput& input, double share) const {
    double sum = 0.0;
    for (const Shell* shell : input.shells) sum += shell->masses().sum();
    const double kick = share * input.h * std::max(input.gravity.norm(), 1e-6);
    return sum * kick * kick;
}

/// From `guess`, with the present contacts and preconditioner. The first solve of a step, but for small shells and in
/// double precision, is from no change of velocity: the last change is in part what the last solve left over, to be
/// undone and not to be repeated.
PcgReport IslandSolver::Impl::solveOnce(const IslandInput& input, bool roughly, int maxIterations, StepReport& report) {
    constexpr double kCompleteTolerance = 1e-6;  // of what a solve starts with, where it takes a few iterations
    constexpr double kShare = 0.1;               // which leaves at most this of the residual that it starts with
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
    double target2 = tolerance * tolerance * reference;
    if (preconditioner.isComplete()) target2 = std::min(target2, kCompleteTolerance * kCompleteTolerance * rho);
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
        // What stiff shells do while their contacts are not settled would tip a body off what bears it.
        const bool isTelling = !preconditioner.isComplete() || (!changed && !response.isLast(round));
        const bool lifted = isTelling && supports.update(u.w, input.h * input.gravity.norm());
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

/// Sheet metal is strained by every push, of however little, for as long as anything touches it; cloth that once was
/// lies as before soon after.
bool IslandSolver::Impl::wouldBeStrained(const IslandInput& input) {
    constexpr int kSteps = 10;
    const double kick = (input.h * input.gravity).squaredNorm();
    return ++stepsInFull < kSteps || std::any_of(input.shells.begin(), input.shells.end(), [&](const Shell* shell) {
        return strainOfPush(*shell, response.slop()) > kMostEnergyGain * 0.5 * shell->masses().sum() * kick;
    });
}

/// Whether pushOut would strain the shells, which then do not give way to it: sheet metal that stands on its edge, a
/// bowl on its rim.
bool IslandSolver::Impl::pushesStrain(const IslandInput& input) {
    const double most = partOfStep * kMostEnergyGain;
    if (!response.isQuick() || !unfiltered().allFinite()) return false;
    const auto& pushes = response.pushes(v);
    const auto energyAfter = [&] {
        double sum = 0.0;
        for (std::size_t k = 0; k < input.shells.size(); ++k) sum += elasticEnergyAfter(input, k, v);
        return sum;
    };
    double moving = 0.0, stretching = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        moving += shell.kineticEnergy(v.middleCols(offsets[k], shell.vertexCount()));
        moving += 0.5 * shell.masses().sum() * (stepOf[k] * input.gravity).squaredNorm();
        const auto end = pushes.lower_bound(offsets[k] + shell.vertexCount());
        for (auto one = pushes.lower_bound(offsets[k]); one != end; ++one)
            stretching += strainOfPush(shell, one->second.norm());
    }
    if (stretching <= most * moving) return false;
    reached = v;
    const double before = energyAfter();
    for (const auto& [vertex, by] : pushes) v.col(vertex) += by / input.h;
    const double after = energyAfter();
    v.swap(reached);
    return after - before > most * (moving + before);
}

/// The contacts' last word where they were settled in few rounds.
void IslandSolver::Impl::pushOut(const IslandInput& input, StepReport& report) {
    const auto solved = report.contacts.size();
    response.pushOut(v, report.contacts);
    for (std::size_t i = solved; i < report.contacts.size(); ++i) {
        const auto& [contact, impulse, sticks, slip] = report.contacts[i];
        input.bodies[contact.body].impulse -= pointImpulse(impulse, contactArm(input, contact));
    }
}

/// Makes the ledger exact whatever the tolerance: what the contacts report, what the bodies got and what the shells'
/// momentum changed by are the same to rounding. The residual that the solve left is spread over contacts and vertices.
void IslandSolver::Impl::balance(const IslandInput& input, std::vector<ContactImpulse>& impulses) {
    const auto count = input.bodies.size();
    std::pmr::vector<Vec6> onBodies(count, Vec6::Zero(), &pool);
    std::pmr::vector<double> pressed(count, 0.0, &pool);
    const auto add = [&](int body, const Vec3& impulse, const Vec3& arm) {
        onBodies[body] -= pointImpulse(impulse, arm);
        pressed[body] += impulse.norm();
    };
    std::pmr::vector<char> isTouched(count, 0, &pool);
    for (const auto& [contact, impulse, sticks, slip] : impulses) {
        add(contact.body, impulse, contactArm(input, contact));
        isTouched[contact.body] = 1;
    }
    for (Anchor& anchor : input.anchors) {
        anchor.impulse = impulseShare * unfiltered().col(offsets[anchor.shell] + anchor.vertex);
        add(anchor.body, -anchor.impulse, anchor.point - input.bodies[anchor.body].position);
    }
    for (std::size_t b = 0; b < count; ++b) {
        Vec6& impulse = input.bodies[b].impulse;
        if (input.bodies[b].prescribed || !(pressed[b] > 0.0))
            impulse = onBodies[b];
        else if (!isTouched[b])
            impulse -= excessOf(static_cast<int>(b), impulse - onBodies[b]);
    }
    std::pmr::vector<Vec3> onShells(input.shells.size(), Vec3::Zero(), &pool);
    const auto missing = [&](int body, const Vec3& impulse) -> Vec3 {
        if (!(pressed[body] > 0.0)) return Vec3::Zero();
        const Vec3 all = input.bodies[body].impulse.head<3>() - onBodies[body].head<3>();
        return all * (impulse.norm() / pressed[body]);
    };
    for (auto& [contact, impulse, sticks, slip] : impulses) {
        impulse -= missing(contact.body, impulse);
        onShells[contact.shell] += impulse;
    }
    for (Anchor& anchor : input.anchors) {
        anchor.impulse += missing(anchor.body, anchor.impulse);
        onShells[anchor.shell] -= anchor.impulse;
    }
    shift(input, onShells, impulses);
}

/// What of a change of momentum is to be taken back so that a body's equations, of which the solve has left `residual`
/// over, are fulfilled with the shells' velocities around it. Neither what its anchors give it nor its solved change of
/// momentum would do: a light body far from its anchor would spin by that, and one that rests on something would be
/// lifted off it.
Vec6 IslandSolver::Impl::excessOf(int body, const Vec6& residual) const {
    const int dynamic = dynamicIndex[body];
    return supports.masses()[dynamic] * preconditioner.twistBy(dynamic, residual);
}

/// The shells' part of it. Walls take what is missing: a shell that they hold is stiff, and its mass would turn little
/// force into much speed. A shell that touches none moves by it.
void IslandSolver::Impl::shift(const IslandInput& input, std::span<const Vec3> onShells,
                               std::vector<ContactImpulse>& impulses) {
    system.velocities(u, reached);  // `v` may have been cut short since
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        if (shell.pinCount() > 0) continue;
        Vec3 given = -unfiltered().middleCols(offsets[k], shell.vertexCount()).rowwise().sum();
        for (const auto& row : system.rows())
            if (row.vertices[0] >= offsets[k] && row.vertices[0] < offsets[k] + shell.vertexCount())
                given += system.rowImpulse(row, reached, u.w);
        const Vec3 missing = impulseShare * given - onShells[k];
        if (giveToWalls(input, static_cast<int>(k), missing, impulses)) continue;
        v.middleCols(offsets[k], shell.vertexCount()).colwise() -=
            (missing / (shell.masses().sum() * damping(input, shell))).eval();
    }
}

/// Adds an impulse to those that walls have given a shell; false if there are none.
bool IslandSolver::Impl::giveToWalls(const IslandInput& input, int shell, const Vec3& impulse,
                                     std::vector<ContactImpulse>& impulses) const {
    const auto isWalls = [&](const ContactImpulse& one) {
        return one.contact.shell == shell && input.bodies[one.contact.body].prescribed;
    };
    double pressed = 0.0;
    for (const ContactImpulse& one : impulses)
        if (isWalls(one)) pressed += one.impulse.norm();
    if (!(pressed > 0.0)) return false;
    for (ContactImpulse& one : impulses) {
        if (!isWalls(one)) continue;
        const Vec3 part = impulse * (one.impulse.norm() / pressed);
        one.impulse += part;
        input.bodies[one.contact.body].impulse -= pointImpulse(part, contactArm(input, one.contact));
    }
    return true;
}

}  // namespace jacket
