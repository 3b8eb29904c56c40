#include "Motion.h"

#include <cmath>
#include <complex>
#include <cstdio>
#include <limits>
#include <numbers>

#include "MotionMesh.h"
#include "StripReference.h"
#include "jacket/Statics.h"

namespace jacket::demo::accuracy {

namespace {

constexpr double kLength = 1.0, kWidth = 0.25, kThickness = 1e-3, kDensity = 1000.0, kGravity = 9.81;
constexpr double kAreaDensity = kDensity * kThickness;
const Integrator kIntegrators[] = {Integrator::BackwardEuler, Integrator::Newton, Integrator::Bdf2};

/// Poisson's ratio 0, so that a strip bends as a beam does.
ShellMaterial stripOfStiffness(double bendingStiffness) {
    return {.young = 12 * bendingStiffness / std::pow(kThickness, 3),
            .poisson = 0.0,
            .thickness = kThickness,
            .density = kDensity};
}

Strip stripFor(const MotionCase& motion, double bendingStiffness) {
    return makeStrip(
        {.length = kLength, .width = kWidth, .cells = motion.cells, .mesh = motion.mesh, .bending = motion.bending},
        stripOfStiffness(bendingStiffness), {.integrator = motion.integrator, .tolerance = motion.tolerance});
}

/// Steps a shell and calls sample(k) at the times k / rate, to the end; dt must divide 1 / rate. Fills all of the
/// result but the error; false when numbers stop being finite.
template <class Sample>
bool stepShell(Shell& shell, const MotionCase& motion, double simulated, int rate, const Vec3& gravity,
               MotionResult& result, const Sample& sample) {
    const int stepsPerSample = static_cast<int>(std::lround(1.0 / (rate * motion.dt)));
    const int samples = static_cast<int>(std::lround(simulated * rate));
    result.vertices = shell.vertexCount();
    for (int k = 1; k <= samples; ++k) {
        const double start = cpuSeconds();
        for (int i = 0; i < stepsPerSample; ++i) {
            const StepReport report = shell.step(motion.dt, gravity);
            result.converged = result.converged && report.converged;
            if (!report.finite) return false;
        }
        result.seconds += (cpuSeconds() - start) / simulated;
        sample(k);
    }
    return true;
}

// --- heavy strip ------------------------------------------------------------------------------------------------

constexpr double kGamma = 10.0;

Strip heavyStripFor(const MotionCase& motion) {
    return stripFor(motion, kAreaDensity * kGravity * std::pow(kLength, 3) / kGamma);
}

MotionResult runHeavyStrip(const MotionCase& motion) {
    MotionResult result;
    Strip strip = heavyStripFor(motion);
    double sum = 0.0;
    const bool finite =
        stepShell(strip.shell, motion, kStripSeconds, kStripRate, Vec3(0, -kGravity, 0), result, [&](int k) {
            const Vec3 tip = meanPosition(strip.shell, strip.tip);
            sum += std::pow(tip.x() - kStripTip[k - 1][0], 2) + std::pow(tip.y() - kStripTip[k - 1][1], 2);
        });
    const double rms = std::sqrt(sum / std::size(kStripTip)) / kLength;
    result.error = finite && std::isfinite(rms) ? rms : std::numeric_limits<double>::infinity();
    return result;
}

// --- vibrating strip --------------------------------------------------------------------------------------------

constexpr double kFrequency = 5.0;   // of the lowest mode [Hz]
constexpr double kAmplitude = 1e-5;  // of the tip [m]: so small that nothing but the linear theory matters
constexpr double kRoot = 1.8751040687119612, kSigma = 0.7340955137589128;  // of a beam that is clamped at one end

double vibrationStiffness() {
    const double omega = 2 * std::numbers::pi * kFrequency;
    return kAreaDensity * std::pow(omega * kLength * kLength / (kRoot * kRoot), 2);
}

/// The lowest mode of a clamped beam, 1 at the tip.
double modeShape(double x) {
    const double b = kRoot * std::max(0.0, x) / kLength;
    return 0.5 * (std::cosh(b) - std::cos(b) - kSigma * (std::sinh(b) - std::sin(b)));
}

void bendIntoMode(Shell& shell) {
    Points x = shell.positions();
    for (int i = 0; i < x.cols(); ++i) x(1, i) = kAmplitude * modeShape(x(0, i));
    shell.setPositions(x);
}

/// How much of the mode the shell is in, 1 at the start.
double partOfMode(const Shell& shell) {
    double part = 0.0, whole = 0.0;
    for (int i = 0; i < shell.vertexCount(); ++i) {
        const double shape = modeShape(shell.restPositions()(0, i)), mass = shell.masses()[i];
        part += mass * shape * shell.positions()(1, i);
        whole += mass * shape * shape;
    }
    return part / (whole * kAmplitude);
}

MotionResult runVibratingStrip(const MotionCase& motion) {
    constexpr double kSimulated = 0.6;
    constexpr int kRate = 30;
    MotionResult result;
    Strip strip = stripFor(motion, vibrationStiffness());
    bendIntoMode(strip.shell);
    double sum = 0.0;
    const bool finite = stepShell(strip.shell, motion, kSimulated, kRate, Vec3::Zero(), result, [&](int k) {
        sum += std::pow(partOfMode(strip.shell) - std::cos(2 * std::numbers::pi * kFrequency * k / kRate), 2);
    });
    const double rms = std::sqrt(sum / (kSimulated * kRate));
    result.error = finite && std::isfinite(rms) ? rms : std::numeric_limits<double>::infinity();
    return result;
}

// --- what to compare --------------------------------------------------------------------------------------------

struct SweepRange {
    std::vector<double> dts;
    std::vector<int> cells;
    std::vector<double> dtsOfOthers;  ///< steps at which other models, meshes and tolerances are tried
};

/// All of integrator x step x cells for patch bending; the rest one at a time around that.
std::vector<MotionCase> sweepAround(const SweepRange& range, bool quick) {
    std::vector<MotionCase> cases;
    for (const Integrator integrator : kIntegrators)
        for (const double dt : range.dts)
            for (const int cells : range.cells) cases.push_back({.integrator = integrator, .dt = dt, .cells = cells});
    const BendingModel hinges[] = {DihedralBending{}, QuadraticBending{}, CubicShellBending{}};
    for (const double dt : range.dtsOfOthers) {
        for (const BendingModel& bending : hinges)
            for (const Integrator integrator : {Integrator::BackwardEuler, Integrator::Bdf2})
                for (const int cells : range.cells)
                    if (!quick || integrator == Integrator::Bdf2)
                        cases.push_back({.bending = bending, .integrator = integrator, .dt = dt, .cells = cells});
        for (const BendingModel& bending : {BendingModel(PatchBending{}), hinges[0], hinges[1], hinges[2]})
            for (const int cells : range.cells)
                if (!quick || cells == range.cells.back())
                    cases.push_back({.bending = bending,
                                     .integrator = Integrator::Bdf2,
                                     .dt = dt,
                                     .mesh = MeshKind::Delaunay,
                                     .cells = cells});
        for (const double tolerance : {1e-2, 1e-4})
            for (const Integrator integrator : kIntegrators)
                if (!quick || integrator == Integrator::Bdf2)
                    cases.push_back({.integrator = integrator,
                                     .dt = dt,
                                     .tolerance = tolerance,
                                     .cells = range.cells[range.cells.size() / 2]});
    }
    return cases;
}

std::vector<MotionCase> stripSweep(bool quick) {
    if (quick) return sweepAround({{1.0 / 30, 1.0 / 120, 1.0 / 480}, {10, 20}, {1.0 / 480}}, true);
    return sweepAround(
        {{1.0 / 30, 1.0 / 60, 1.0 / 120, 1.0 / 240, 1.0 / 480, 1.0 / 960}, {10, 20, 40}, {1.0 / 60, 1.0 / 480}}, false);
}

constexpr const char* kSweepText =
    "every integrator x step x cells with patch bending on the grid with one diagonal at tolerance 0.001; around that, "
    "one at a time: the hinge models (their clamp is one more pinned row of cells), the irregular mesh, and the "
    "tolerances 0.01 and 0.0001";

}  // namespace

std::string nameOf(Integrator integrator) {
    return integrator == Integrator::BackwardEuler ? "backward-euler"
           : integrator == Integrator::Newton      ? "newton"
                                                   : "bdf2";
}

std::string nameOf(const BendingModel& bending) {
    return std::visit([](const auto& model) { return std::string(model.kName); }, bending);
}

MotionProblem heavyStrip() {
    return {.name = "heavy strip",
            .quantity =
                "tip of a 1 m strip, clamped level and let go (Gamma = 10): RMS distance from its path over 1 s / "
                "length",
            .source = kStripSource,
            .simulated = kStripSeconds,
            .sweep = stripSweep,
            .sweepText = kSweepText,
            .run = runHeavyStrip};
}

MotionProblem vibratingStrip() {
    return {.name = "vibrating strip",
            .quantity = "lowest mode of a clamped strip, 5 Hz, three periods: RMS distance from the cosine / amplitude",
            .source = "Euler-Bernoulli beam, beta L = 1.8751",
            .simulated = 0.6,
            .sweep = stripSweep,
            .sweepText = kSweepText,
            .run = runVibratingStrip};
}

std::span<const MotionProblem> motionProblems() {
    static const std::vector<MotionProblem> problems{heavyStrip(), vibratingStrip(), trampoline()};
    return problems;
}

std::string computeStripReference() {
    MotionCase finest{
        .integrator = Integrator::Bdf2, .dt = 1.0 / 960, .tolerance = 1e-5, .mesh = MeshKind::Alternating, .cells = 80};
    Strip strip = heavyStripFor(finest);
    std::string text = "inline constexpr double kStripTip[][2] = {";
    MotionResult ignored;
    stepShell(strip.shell, finest, kStripSeconds, kStripRate, Vec3(0, -kGravity, 0), ignored, [&](int) {
        const Vec3 tip = meanPosition(strip.shell, strip.tip);
        char entry[64];
        std::snprintf(entry, sizeof entry, "\n    {%.6f, %.6f},", tip.x(), tip.y());
        text += entry;
    });
    return text + "\n};\n";
}

// --- integrators against theory ---------------------------------------------------------------------------------

Vibration vibrationInTheory(Integrator integrator, double stepsPerPeriod) {
    const std::complex<double> rotation(0.0, 2 * std::numbers::pi / stepsPerPeriod);  // i w h
    // Backward Euler: z (1 - i w h) = 1. BDF2: (3/2 - i w h) z^2 - 2 z + 1/2 = 0, the root that tends to 1.
    const std::complex<double> z = integrator == Integrator::Bdf2
                                       ? (2.0 + std::sqrt(1.0 + 2.0 * rotation)) / (3.0 - 2.0 * rotation)
                                       : 1.0 / (1.0 - rotation);
    const double stepsPerTurn = 2 * std::numbers::pi / std::arg(z);
    return {.amplitudeLeft = std::pow(std::abs(z), stepsPerTurn), .periodRatio = stepsPerTurn / stepsPerPeriod};
}

namespace {

/// The damped oscillation that a series is: q_n+1 = a q_n - b q_n-1 by least squares.
Vibration fitOscillation(std::span<const double> q, double stepsPerPeriod) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (std::size_t n = 1; n + 1 < q.size(); ++n) {
        const Eigen::Vector2d row(q[n], -q[n - 1]);
        normal += row * row.transpose();
        right += row * q[n + 1];
    }
    const Eigen::Vector2d ab = normal.ldlt().solve(right);
    const double radius = std::sqrt(ab[1]), stepsPerTurn = 2 * std::numbers::pi / std::acos(0.5 * ab[0] / radius);
    return {.amplitudeLeft = std::pow(radius, stepsPerTurn), .periodRatio = stepsPerTurn / stepsPerPeriod};
}

}  // namespace

Vibration vibrationMeasured(Integrator integrator, int stepsPerPeriod) {
    constexpr int kPeriods = 3, kStartup = 4;  // the first steps hold what else than the mode was in the start
    Strip strip = stripFor({.integrator = integrator, .tolerance = 1e-9, .cells = 20}, vibrationStiffness());
    const double omega = naturalFrequencies(strip.shell, 1).front();  // of this mesh: only time is at stake
    bendIntoMode(strip.shell);
    const double h = 2 * std::numbers::pi / (omega * stepsPerPeriod);
    std::vector<double> q;
    for (int step = 0; step < kPeriods * stepsPerPeriod; ++step) {
        strip.shell.step(h, Vec3::Zero());
        if (step >= kStartup) q.push_back(partOfMode(strip.shell));
    }
    return fitOscillation(q, stepsPerPeriod);
}

}  // namespace jacket::demo::accuracy
