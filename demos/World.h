#pragma once
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "Scene.h"

/// A scene as a running Bullet world with shells. This header says nothing of Bullet: its precision is that of the
/// library this is linked to.
namespace jacket::demo {

/// Where a body is and how it moves.
struct BodyState {
    const BodyDescription* description = nullptr;
    bool isDynamic = false;
    Vec3 position = Vec3::Zero();         ///< of the frame that the shape is given in [m]
    Mat3 rotation = Mat3::Identity();     ///< of that frame
    Vec3 centre = Vec3::Zero();           ///< centre of mass [m]
    Vec3 velocity = Vec3::Zero();         ///< of the centre of mass [m/s]
    Vec3 angularVelocity = Vec3::Zero();  ///< [rad/s]
    Mat3 inertia = Mat3::Zero();          ///< about the centre, in the frame's axes [kg m^2]
};

/// Where the wall time of steps went, each part inside the one below it [s].
struct StepSeconds {
    double narrowPhase = 0.0;  ///< finding where shells meet bodies
    StepTimes parts{};         ///< of the shells' solves
    double solves = 0.0;       ///< of islands of shells
    double shells = 0.0;       ///< everything that shells do
};

/// What the steps of one frame did and cost.
struct FrameReport {
    int contacts = 0;        ///< that carried an impulse in the last step
    int pcgIterations = 0;   ///< over all steps of the frame
    int mostIterations = 0;  ///< of one of its steps
    int solves = 0;
    bool converged = true, finite = true;
    std::vector<Dent> dents;  ///< of each shell: where it yielded most, and how much in all steps of the frame
    double seconds = 0.0;     ///< of wall time in stepSimulation
    double cpuSeconds = 0.0;  ///< of this thread's time there
    StepSeconds where{};      ///< of `seconds`
};

class World {
  public:
    /// Reads the meshes and builds everything; throws InputError. `threads`: as for ShellWorld::setThreads.
    explicit World(const Scene& scene, int threads = 1);
    ~World();

    /// One frame of scene.dt. It ends before the next of its steps, or of its static shells, where `isCancelled` says
    /// so.
    FrameReport step(const std::function<bool()>& isCancelled = [] { return false; });
    double time() const;

    const Scene& scene() const;
    int threads() const;
    int shellCount() const;
    const Shell& shell(int index) const;
    int contactCount(int shell) const;  ///< that carried an impulse in the last step
    /// Impulses of the last step's contacts on the vertices of a shell, as forces [N].
    Points contactForces(int shell) const;
    const Points& initialPositions(int shell) const;
    std::vector<BodyState> bodies() const;
    /// Of a shell's vertices at the moment of the bodies' and of all positions: shell() holds in its velocities already
    /// the gravity of the coming step, which Bullet's bodies receive only then [m/s].
    Points velocities(int shell) const;
    Vec3 linearMomentum() const;   ///< of shells and dynamic bodies, at one moment [N s]
    int rejectedSteps() const;     ///< since the start
    int unconvergedSteps() const;  ///< since the start: a solve used up its iterations, or a contact ended too deep
    int unsettledSteps() const;    ///< since the start: contacts used up their rounds
    int passedSteps() const;       ///< since the start: those in which a body went through a shell or may have
    bool isAsleep(int shell) const;

    std::vector<std::string> takeWarnings();
    static std::string precision();      ///< "double" or "float": Bullet's
    static std::string bulletVersion();  ///< "3.24"

  private:
    struct Impl;
    std::unique_ptr<Impl> m_impl;
};

}  // namespace jacket::demo
