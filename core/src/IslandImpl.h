#pragma once
#include <algorithm>
#include <cstddef>
#include <iterator>
#include <memory_resource>
#include <span>
#include <vector>

#include "StandingBodies.h"
#include "contact/ContactResponse.h"
#include "jacket/Island.h"
#include "solver/BodySupports.h"
#include "solver/CoupledPreconditioner.h"
#include "solver/CoupledSystem.h"
#include "solver/FilteredPcg.h"

namespace jacket {

using BodyVectors = Eigen::Matrix<double, 6, Eigen::Dynamic>;  ///< twists or momenta

/// Steps among walls that settle in no part of them, as in a sheet between bodies that overlap, cost thousands of
/// solves and come to nothing. After one that did, the next ones are not worth that much: twice as many each time.
class Patience {
  public:
    bool isOut() const { return m_left > 0; }
    void workedInVain() {
        if (isOut()) return;
        m_wait = std::clamp(2 * m_wait, 1, kMostSteps);
        m_left = m_wait + 1;
    }
    void endStep() {
        if (isOut())
            --m_left;
        else
            m_wait = 0;
    }

  private:
    static constexpr int kMostSteps = 256;
    int m_wait = 0, m_left = 0;  ///< [steps], with the present one
};

/// What an island's step knows and does. A file for each group of functions.
struct IslandSolver::Impl {
    static constexpr double kEnergyGain = 0.02;     ///< of a step that is linearised again: see energyGain
    static constexpr double kMostEnergyGain = 1.0;  ///< of a step that is accepted as it is
    static constexpr double kMostOvertaking = 3.0;  ///< of a shell that is pushed: its speed over the pushing body's
    static constexpr int kLeastForTeam = 1000;      ///< vertices of an island from which on threads pay

    std::pmr::unsynchronized_pool_resource pool;  ///< what a step gives back, the next one takes
    CoupledSystem system;
    CoupledPreconditioner preconditioner;
    FilteredPcg pcg;
    BodySupports supports;
    StandingBodies standing;
    ContactResponse response;
    std::vector<int> offsets, dynamicIndex;
    std::vector<int> dynamicBodies;  ///< index in IslandInput.bodies of each dynamic body
    Points v, start, y;              ///< all shells
    Points twoStepFrom;              ///< see from(); of BDF2 alone
    bool isTwoStep = false;          ///< whether some shell takes a step of BDF2
    std::vector<double> stepOf;      ///< of each shell, as its integrator counts it [s]
    std::vector<char> factored;      ///< shells: completely
    bool mayBeShorter = false;       ///< the step that is being solved
    bool isTooLong = false;          ///< the step that was attempted, to be solved
    Patience patience;               ///< among walls
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
    BodyVectors twistChange;                     ///< of the bodies' twists, by the shells
    mutable BodyVectors twistsAtEnd;             ///< of the bodies
    BodyVectors momentum;                        ///< of the bodies
    bool unsettled = false;                      ///< contacts of this step have used up their rounds
    bool isLeftDeep = false;                     ///< see endsDeep
    double reference = -1.0;                     ///< r^T P^-1 r that the tolerance refers to; < 0: not known
    int lastRounds = 1;                          ///< changes of the contacts in the last step, and one
    mutable std::vector<double> elasticAtStart;  ///< of each shell at the start of the step; NaN: not yet asked for [J]
    mutable std::vector<double> energyMemory;    ///< see Energy::valueBeside
    StepTimes times;                             ///< of the step so far
    StepReport lastReport;
    double pushShare = 1.0;         ///< of what moves shells out of bodies at once: see pushLess
    double partOfStep = 1.0;        ///< that is being solved: what a step may gain, its parts may together
    double impulseShare = 1.0;      ///< of the solved contacts that a step cut short takes: see limitDeformation
    std::vector<double> bodyShare;  ///< of that, what each dynamic body takes: see limitBodies

    /// Velocities that the step's momentum starts from (BDF2: not `start`).
    const Points& from() const { return isTwoStep ? twoStepFrom : start; }
    /// (b - A v) at the solution, soft rows included.
    const Points& unfiltered() const { return pcg.unfilteredResidual(); }
    bool isAnyFactored() const { return std::count(factored.begin(), factored.end(), 0) < std::ssize(factored); }
    WorkerTeam* teamFor(const IslandInput& input) const { return start.cols() < kLeastForTeam ? nullptr : input.team; }

    // Island.cpp: the course of a step, from what is given to what is stored
    void solve(const IslandInput& input);
    void attempt(const IslandInput& input);
    void pushLess(const IslandInput& input, StepReport& report);
    bool isWorthParts() const;
    bool endsDeep();
    void solveInParts(const IslandInput& input);
    void clearReport();
    void gather(const IslandInput& input);
    void beginInFull(const IslandInput& input, bool onlyStops = false);
    void beginContacts(const IslandInput& input, bool onlyStops = false);
    void beginTwoStep(const IslandInput& input, std::size_t shell);
    void store(const IslandInput& input);
    void reject();
    bool isFinite(const IslandInput& input) const;

    // IslandSolve.cpp: the solve, linearised as often as it takes, and in rounds with the contacts
    void solveStep(const IslandInput& input, StepReport& report);
    bool isAmongWalls(const IslandInput& input) const;
    bool mayBeInParts() const;
    bool descend(const IslandInput& input, StepReport& report);
    void readImpulses(const IslandInput& input);
    bool improves(const IslandInput& input);
    bool overstretches(const IslandInput& input, bool isAgain) const;
    void assemble(const IslandInput& input, bool atEnd);
    double linearTolerance(const IslandInput& input) const;
    double leastTolerance(const IslandInput& input) const;
    double enoughForBodies(const IslandInput& input) const;
    void readFreeTwists();
    double floorOfReference(const IslandInput& input, double share) const;
    bool mayFallIn(const IslandInput& input) const;
    PcgReport solveOnce(const IslandInput& input, bool roughly, int maxIterations, StepReport& report);
    void solveRound(const IslandInput& input, bool roughly, int& freshIterations, StepReport& report);
    void solveRounds(const IslandInput& input, StepReport& report);

    // IslandEnergy.cpp: what a step starts with and gains
    Points& endAfter(std::size_t shell, const IslandInput& input, const Points& velocities) const;
    double elasticEnergyAfter(const IslandInput& input, std::size_t shell, const Points& velocities) const;
    double elasticEnergyGain(const IslandInput& input, std::size_t shell) const;
    double incrementalPotential(const IslandInput& input, const Points& velocities) const;
    double energyOfMotion(const IslandInput& input, std::size_t shell) const;
    double energyGain(const IslandInput& input) const;
    bool bodiesLead(const IslandInput& input) const;
    const BodyVectors& endTwists() const;

    // IslandLimits.cpp: how much of what was solved shells and bodies take
    void limitDeformation(const IslandInput& input, StepReport& report);
    void limitPushes(const IslandInput& input, double mostGain);
    double gainOfCoasting(const IslandInput& input);
    void blend(const IslandInput& input, const Points& other);
    void coast(const IslandInput& input, const Points& coasting);
    void makeRigid(const IslandInput& input, Points& velocities, double time) const;
    void limitBodies(const IslandInput& input, StepReport& report);
    double shareWithin(const IslandInput& input, const CoupledBody& body, int dynamic, const Vec6& after,
                       double speed) const;
    bool wouldBeStrained(const IslandInput& input);
    bool pushesStrain(const IslandInput& input);

    // IslandLedger.cpp: impulses that add up
    void pushOut(const IslandInput& input, StepReport& report);
    void makePossible(const IslandInput& input, std::span<ContactImpulse> impulses);
    Vec6 givenTo(const IslandInput& input, std::size_t k, const Points& solved, const Vec3& centre) const;
    void balance(const IslandInput& input, std::vector<ContactImpulse>& impulses);
    Vec6 excessOf(int body, const Vec6& residual) const;
    void shift(const IslandInput& input, std::span<const Vec3> onShells, std::vector<ContactImpulse>& impulses);
    bool giveToWalls(const IslandInput& input, int shell, const Vec3& impulse,
                     std::vector<ContactImpulse>& impulses) const;
};

}  // namespace jacket
