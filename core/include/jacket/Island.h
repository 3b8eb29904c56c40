#pragma once
#include <memory>
#include <span>

#include "jacket/Shell.h"
#include "jacket/WorkerTeam.h"

namespace jacket {

/// Everything that one solve couples: shells that share bodies, and those bodies.
struct IslandInput {
    double h = 1.0 / 60.0;       ///< length of the step [s], > 0
    Vec3 gravity{0, -9.81, 0};   ///< [m/s^2]
    const Wind* wind = nullptr;  ///< none: no air
    std::span<Shell* const> shells{};
    std::span<CoupledBody> bodies{};  ///< `twist` and `impulse` are written
    std::span<const BodyCoupling> couplings{};
    std::span<const RigidContact> rigidContacts{};
    std::span<Anchor> anchors{};          ///< at most one of a vertex; `impulse` is written
    ContactDetector* contacts = nullptr;  ///< none: no contacts
    bool isCalm = false;  ///< shells keep their places but for what solves leave over: they start from standing still
    bool inOnePiece = false;      ///< some body can move by nothing but one twist in a step
    double restingSpeed = 0.2;    ///< contacts that close no faster do not bounce [m/s]
    double (*clock)() = nullptr;  ///< [s]; null: no times are taken
    WorkerTeam* team = nullptr;   ///< shares the work of large islands; the same bits with and without

    double shellMass() const;  ///< of all shells [kg]
};

/// Solves for the velocities of one step: A v = b with contacts as filter, bodies as six unknowns each (see
/// core/README.md). Keeps its memory from step to step. Positions do not move: call Shell::advance when the bodies have
/// moved too.
class IslandSolver {
  public:
    IslandSolver();
    ~IslandSolver();
    IslandSolver(IslandSolver&&) noexcept;
    IslandSolver& operator=(IslandSolver&&) noexcept;
    /// The report stays as it is until the next solve.
    const StepReport& solve(const IslandInput& input);

  private:
    struct Impl;
    std::unique_ptr<Impl> m_impl;
};

}  // namespace jacket
