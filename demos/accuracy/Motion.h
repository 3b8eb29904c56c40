#pragma once
#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "Clocks.h"
#include "Problem.h"
#include "jacket/Shell.h"

/// Problems of motion with known answers, or with one computed far more finely than any case that is compared with it.
namespace jacket::demo::accuracy {

std::string nameOf(Integrator integrator);
std::string nameOf(const BendingModel& bending);

/// One way to compute a motion.
struct MotionCase {
    BendingModel bending = PatchBending{};
    Integrator integrator = Integrator::BackwardEuler;
    double dt = 1.0 / 120;  ///< [s]
    double tolerance = 1e-3;
    MeshKind mesh = MeshKind::OneDiagonal;
    int cells = 20;
    bool isSoftBody = false;  ///< Bullet's btSoftBody instead; of the above only dt and cells count
};

struct MotionResult {
    double error = 0.0;    ///< as the problem says; infinite when the run gave no finite numbers [-]
    double seconds = 0.0;  ///< CPU time of stepping, per simulated second
    int vertices = 0;
    bool converged = true;
};

struct MotionProblem {
    std::string name, quantity, source;
    double simulated = 0.0;                                    ///< [s]
    std::function<std::vector<MotionCase>(bool quick)> sweep;  ///< what to compare
    std::string sweepText;                                     ///< which, in words
    std::function<MotionResult(const MotionCase&)> run;        ///< once
};

std::span<const MotionProblem> motionProblems();

/// What an integrator does to the amplitude and period of a vibration.
struct Vibration {
    double amplitudeLeft = 0.0;  ///< after one of its periods, as a part [-]
    double periodRatio = 0.0;    ///< computed over true [-]
};
/// For x'' = -w^2 x in `stepsPerPeriod` steps: from the root of the method's characteristic polynomial.
Vibration vibrationInTheory(Integrator integrator, double stepsPerPeriod);
/// Of the strip's lowest mode about its flat state, without gravity, with a tight tolerance.
Vibration vibrationMeasured(Integrator integrator, int stepsPerPeriod);

/// A spinning sheet, alone or hit by a spinning ball, with nothing to hold either.
struct MomentumDrift {
    double linear = 0.0;   ///< largest change, relative to the sum of mass times speed, per second [1/s]
    double angular = 0.0;  ///< largest change about the origin, relative to that at the start, per second [1/s]
    double energy = 0.0;   ///< change of kinetic and elastic energy relative to that at the start, per second [1/s]
};
MomentumDrift momentumDrift(Integrator integrator, bool withBall, double dt);

/// Computes the stored references anew and returns them as the lines of code they are kept in. Takes minutes.
std::string computeReferences(const std::function<bool(int done, int all)>& progress);

// The parts, each in its file.
MotionProblem heavyStrip();
MotionProblem vibratingStrip();
MotionProblem trampoline();
double trampolineHeight(const MotionCase& motion, double simulated, MotionResult& result);
std::string computeStripReference();

}  // namespace jacket::demo::accuracy
