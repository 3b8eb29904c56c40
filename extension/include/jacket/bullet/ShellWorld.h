#pragma once
#include <BulletDynamics/Dynamics/btActionInterface.h>

#include <memory>
#include <string>
#include <vector>

#include "jacket/bullet/ShellBody.h"
#include "jacket/loadMesh.h"

class btCollisionObject;
class btDynamicsWorld;

/// Shells of Bullet worlds. Link jacket::bullet (Bullet's float library) or jacket::bullet_float64.
namespace jacket::bullet {

struct Island;
class SolvedIslands;

/// Whether a body that goes such a way [m] in a time [s] is teleported, and does not move: faster than 50 m/s, and
/// farther than four times the radius of the ball about its origin that holds its shape. One that is pushes nothing.
bool isTeleport(const btCollisionObject& body, double way, double time);

/// What the last substep cost and did, over all shells. A substep counts once for each of its sums since the world was
/// made, however many shells there are and although those just added are solved for twice.
struct WorldReport {
    int shells = 0, awake = 0, contacts = 0, pcgIterations = 0, solves = 0;
    bool converged = true;
    bool settled = true;          ///< false: contacts of a shell have used up their rounds
    bool finite = true;           ///< false: a shell's step was rejected; it stood still
    bool passed = false;          ///< a body went through a shell, or may have
    int rejectedSteps = 0;        ///< since the world was made: not `finite`, or of no possible length
    int unconvergedSteps = 0;     ///< since the world was made
    int unsettledSteps = 0;       ///< since the world was made
    int passedSteps = 0;          ///< since the world was made
    bool limited = false;         ///< deformation was cut short, or a step would have gained energy
    StepTimes times{};            ///< of the solves, over all islands [s]
    double secondsContact = 0.0;  ///< of the narrow phase, which times.contact includes
    double secondsSolve = 0.0;    ///< of the solves in all, narrow phase included
    double secondsTotal = 0.0;    ///< of everything that shells do in a substep
};

/// The shells of one Bullet world. Registers itself as an action of the world and leaves it when destroyed; destroy it
/// before the world. Steps with world.stepSimulation; nothing else changes.
///
/// Contacts of shells are among the dispatcher's manifolds, with the shell's collision object as body 0 and the
/// triangle in m_index0: up to four per body, the strongest, with the impulse of the last substep. gContactStarted-,
/// -Processed- and -EndedCallback hear of them, and may remove any shell or body, except (as everywhere in Bullet) in
/// an end that a removal causes. Bullet's solvers never respond to them.
///
/// gContactAddedCallback is called, as Bullet does it, where the shell's collision object or the body has
/// CF_CUSTOM_MATERIAL_CALLBACK: once a substep for every vertex, edge or triangle of the shell that comes near, before
/// the solve, which takes the m_combinedFriction and m_combinedRestitution (at most 1) that it leaves. Body 0 is the
/// shell, m_index0 its triangle, index 1 is -1. The point is in no manifold: other changes to it have no effect, and
/// m_userPersistentData goes to gContactDestroyedCallback at once. It may not add or remove anything.
class ShellWorld : public btActionInterface {
  public:
    /// Throws std::invalid_argument for a btSimpleDynamicsWorld, which runs no actions.
    explicit ShellWorld(btDynamicsWorld& world);
    ~ShellWorld() override;
    ShellWorld(const ShellWorld&) = delete;
    ShellWorld& operator=(const ShellWorld&) = delete;

    /// Throws std::invalid_argument when mesh, material or options cannot be used. The reference stays valid until
    /// remove().
    ShellBody& add(const TriangleMesh& mesh, const ShellMaterial& material, const ShellOptions& options = {});
    void remove(ShellBody& shell);
    /// The shell behind a hit of Bullet's queries or a body of a manifold, or null.
    ShellBody* find(const btCollisionObject& object);
    int size() const { return static_cast<int>(m_shells.size()); }
    ShellBody& operator[](int i) { return *m_shells[i]; }
    const ShellBody& operator[](int i) const { return *m_shells[i]; }

    /// Wakes all shells unless it blows already. Throws std::invalid_argument, see validate(const Wind&).
    void setWind(const Wind& wind);
    void clearWind();
    /// How many threads share the solve of a large shell (1000 vertices or more, and no free body touches it), the one
    /// that steps the world included. Any number gives the same bits; more than there are processors gain nothing. 1,
    /// as it is at first, starts none. Throws std::invalid_argument below 1.
    void setThreads(int threads);
    int threads() const;
    const WorldReport& lastStep() const { return m_report; }
    /// Things the user should know once, e.g. a shape that shells cannot touch. Kept until read.
    std::vector<std::string> takeWarnings();

    void updateAction(btCollisionWorld* world, btScalar h) override;
    void debugDraw(btIDebugDraw* drawer) override;

  private:
    struct Impl;
    void releaseAnchors(btCollisionWorld& world);
    void followTeleports(double h);
    void followGravity(double h);
    void solveNewcomers(btCollisionWorld& world, double h);
    void alterBodies(btCollisionWorld& world, bool isSolvedAnew);
    void moveShells(btCollisionWorld& world, double h);
    void takeBackSolves(const btCollisionWorld& world, double h);
    void solveIsland(Island& island, double h, SolvedIslands* islands);
    void accept(Island& island, const StepReport& report, std::span<const CoupledBody> coupled, double h);
    void react(btCollisionObject& object, const Vec6& given);
    void forgetPushes(const btCollisionWorld& world);
    void updateAllBounds(double h);
    void updateBounds(ShellBody& shell, double fastest, double h);
    void countStep();
    btDynamicsWorld& m_world;
    std::vector<std::unique_ptr<ShellBody>> m_shells;
    WorldReport m_report;
    std::unique_ptr<Impl> m_impl;
};

}  // namespace jacket::bullet
