#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "accuracy/References.h"
#include "accuracy/Setup.h"

/// Strips that bend in one plane, large deflections: what an elastica or a chain does.
namespace jacket::demo::accuracy {
namespace {

constexpr double kLength = 1.0, kWidth = 0.25;  // [m]
constexpr double kThin = 1e-3;                  // thickness [m]: hardly stretches
constexpr double kGravity = 9.81;               // [m/s^2]

std::string number(double value) {
    std::ostringstream text;
    text << value;
    return text.str();
}

Shell cantilever(const Case& how, const ShellMaterial& material) {
    const TriangleMesh mesh = makeStrip(how, kLength, kWidth, {.left = 1});
    Shell shell(mesh, material, {.bending = how.bending});
    clampEdge(shell, how.bending, verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() < 1e-9; }));
    return shell;
}

std::vector<int> tipOf(const Shell& shell) {
    return verticesWhere(shell.restPositions(), [](const Vec3& p) { return p.x() > kLength - 1e-9; });
}

/// How far the tip is from where it should be, in lengths; negative where it moved less far than it should.
Measurement tipError(const Shell& shell, double x, double drop, const Stopwatch& watch, bool converged) {
    const Vec3 tip = meanPosition(shell.positions(), tipOf(shell)) / kLength;
    const double distance = std::hypot(tip.x() - x, -tip.z() - drop);
    const double moved = std::hypot(1.0 - tip.x(), tip.z()), wanted = std::hypot(1.0 - x, drop);
    return {.value = -tip.z(),
            .reference = drop,
            .error = std::copysign(distance, moved - wanted),
            .seconds = watch.seconds(),
            .vertices = shell.vertexCount(),
            .converged = converged};
}

Measurement heavyCantilever(const Case& how, const HeavyTip& tip) {
    const Stopwatch watch;
    const double stiffness = kGravity * std::pow(kLength, 3) / tip.gamma;  // of 1 kg/m^2
    Shell shell = cantilever(how, plateMaterial(stiffness, kThin, how.poisson));
    const StaticReport report = settle(shell, {0, 0, -kGravity});
    return tipError(shell, tip.x, tip.drop, watch, report.converged);
}

Measurement endLoad(const Case& how, const LoadedTip& tip) {
    const Stopwatch watch;
    Shell shell = cantilever(how, plateMaterial(1.0, kThin, how.poisson));
    spreadForce(shell, tipOf(shell), 1, {0, 0, -tip.load * kWidth / (kLength * kLength)});  // D = 1
    const StaticReport report = settle(shell, Vec3::Zero());
    return tipError(shell, tip.x, tip.drop, watch, report.converged);
}

/// A moment about -y on the strip's end: forces across it, linear over its last two rows of vertices.
class EndCouple {
  public:
    explicit EndCouple(const Shell& shell, double cell) {
        const Points& x = shell.restPositions();
        m_vertices = verticesWhere(x, [&](const Vec3& p) { return p.x() > kLength - 1.4 * cell; });
        double first = 0.0, second = 0.0;
        for (const int i : m_vertices) {
            first += distance(x, i);
            second += distance(x, i) * distance(x, i);
        }
        const double count = static_cast<double>(m_vertices.size()), mean = first / count;
        for (const int i : m_vertices) m_shares.push_back((mean - distance(x, i)) / (second - first * mean));
    }
    void apply(Shell& shell, double moment, const Vec3& across) const {
        for (std::size_t i = 0; i < m_vertices.size(); ++i)
            shell.setForce(m_vertices[i], -moment * m_shares[i] * across);
    }
    Vec3 normal(const Shell& shell) const {
        Vec3 along = Vec3::Zero();  // shares weight the far row with + and the near one with -
        for (std::size_t i = 0; i < m_vertices.size(); ++i) along += m_shares[i] * shell.positions().col(m_vertices[i]);
        return along.cross(Vec3::UnitY()).normalized();
    }

  private:
    static double distance(const Points& x, int i) { return kLength - x(0, i); }
    std::vector<int> m_vertices;
    std::vector<double> m_shares;  ///< force per moment; they sum to zero [1/m]
};

/// Rolled by an end moment of `turns` full circles. The moment is a couple of forces that follow the end: they are
/// dead while the shell settles, and then turned with the end until it no longer turns. Their first direction in a step
/// is the one that the end would have if it were exact; the last one depends on the shell alone.
Measurement endMoment(const Case& how, double turns) {
    constexpr double kStep = 0.05;  // turns
    constexpr int kMostTurnings = 20;
    const Stopwatch watch;
    Shell shell = cantilever(how, plateMaterial(1.0, kThin, how.poisson));
    const EndCouple couple(shell, kLength / how.cells);
    bool converged = true;
    const int steps = static_cast<int>(std::lround(turns / kStep));
    for (int step = 1; step <= steps; ++step) {
        const double moment = 2.0 * std::numbers::pi * kStep * step * kWidth / kLength;  // D = 1
        bool settled = false;
        const double turned = 2.0 * std::numbers::pi * kStep * step;
        Vec3 across(-std::sin(turned), 0.0, -std::cos(turned));
        for (int turning = 0; turning < kMostTurnings && !settled; ++turning) {
            couple.apply(shell, moment, across);
            converged = settle(shell, Vec3::Zero()).converged && converged;
            const Vec3 now = couple.normal(shell);
            settled = (now - across).norm() < 1e-3;
            across = now;
        }
        converged = converged && settled;
    }
    const double angle = 2.0 * std::numbers::pi * turns;
    return tipError(shell, std::sin(angle) / angle, (1.0 - std::cos(angle)) / angle, watch, converged);
}

/// Half of a closed ring: both ends clamped where a half circle has them, at right angles to the line between them.
/// Measures the stored energy, D b pi^2 / (2 L), since the shape is given by symmetry whatever the stiffness.
Measurement ring(const Case& how) {
    const Stopwatch watch;
    const TriangleMesh mesh = makeStrip(how, kLength, kWidth, {.left = 1, .right = 1});
    Shell shell(mesh, plateMaterial(1.0, kThin, how.poisson), {.bending = how.bending});
    const double radius = kLength / std::numbers::pi;
    const TriangleMesh rolled = bent(mesh, [&](double u, double v) {  // straight beyond its ends
        const double angle = std::clamp(u, 0.0, kLength) / radius;
        return Vec3(u < 0.0 ? u : radius * std::sin(angle) - std::max(0.0, u - kLength), v,
                    -radius * (1.0 - std::cos(angle)));
    });
    shell.setPositions(rolled.positions);
    const auto start = verticesWhere(mesh.positions, [](const Vec3&p) { return p.x() < 1e-9; }), end = tipOf(shell);
    clampEdge(shell, how.bending, start, Vec3::UnitX());
    clampEdge(shell, how.bending, end, Vec3::UnitX());  // which leaves this end towards +x as well
    const StaticReport report = settle(shell, Vec3::Zero());
    const double exact = 0.5 * kWidth * std::pow(std::numbers::pi, 2) / kLength;  // D = 1
    return relative(shell.energy().bending, exact, watch, shell, report.converged);
}

/// An arc of a circle of length 1 over a chord `span`, lowest in the middle; s in [0, 1]. Half a per cent longer, so
/// that the sheet starts taut: slack ones wrinkle on their way.
Vec3 hangingArc(double span, double s, double y) {
    constexpr double kTaut = 1.005;
    double half = 3.0;  // half the arc's angle: kTaut sin(half) / half = span
    for (int i = 0; i < 50; ++i) half -= (kTaut * std::sin(half) - span * half) / (kTaut * std::cos(half) - span);
    const double radius = kTaut * 0.5 / half, angle = half * (2.0 * s - 1.0);
    return {radius * std::sin(angle), y, -radius * (std::cos(angle) - std::cos(half))};
}

Measurement hangingSheet(const Case& how, const HangingCurve& curve) {
    constexpr double kLimp = 1e5, kVeryThin = 1e-4;  // rho g t L^3 / D; thickness [m]
    const Stopwatch watch;
    const TriangleMesh mesh = makeStrip(how, kLength, kWidth);
    Shell shell(mesh, plateMaterial(kGravity / kLimp, kVeryThin, how.poisson), {.bending = how.bending});
    shell.setPositions(bent(mesh, [&](double u, double v) { return hangingArc(curve.span, u, v); }).positions);
    for (const int i :
         verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() < 1e-9 || p.x() > kLength - 1e-9; }))
        shell.pin(i);
    const StaticReport report = settle(shell, {0, 0, -kGravity});
    return relative(-shell.positions().row(2).minCoeff(), curve.sag, watch, shell, report.converged);
}

}  // namespace

void addStrips(std::vector<Problem>& problems) {
    for (const HeavyTip& tip : kHeavyTips)
        problems.push_back({.name = "heavy cantilever, Gamma " + number(tip.gamma),
                            .quantity = "position of the tip, in lengths",
                            .source = "elastica under its own weight, integrated",
                            .cells = {20, 40},
                            .targets = {0.01, 0.003},
                            .poissons = {0.0},
                            .meshes = kAllMeshes,
                            .solve = [tip](const Case& how) { return heavyCantilever(how, tip); }});
    for (const LoadedTip& tip : kLoadedTips)
        problems.push_back({.name = "end load, P L^2 / EI " + number(tip.load),
                            .quantity = "position of the tip, in lengths",
                            .source = "elastica; Sze, Liu, Lo 2004, problem 3.1",
                            .cells = {20, 40},
                            .targets = {0.02, 0.005},
                            .poissons = {0.0},
                            .meshes = kAllMeshes,
                            .solve = [tip](const Case& how) { return endLoad(how, tip); }});
    problems.push_back({.name = "end moment, quarter of a circle",
                        .quantity = "position of the tip, in lengths",
                        .source = "circle; Sze, Liu, Lo 2004, problem 3.2",
                        .cells = {20, 40},
                        .targets = {0.02, 0.005},
                        .poissons = {0.0},
                        .meshes = kAllMeshes,
                        .solve = [](const Case& how) { return endMoment(how, 0.25); }});
    problems.push_back({.name = "closed ring",
                        .quantity = "stored energy, relative",
                        .source = "D b L / (2 R^2)",
                        .cells = {20, 40},
                        .targets = {0.02, 0.005},
                        .poissons = {0.0},
                        .meshes = kAllMeshes,
                        .solve = ring});
    for (const HangingCurve& curve : kCatenaries)
        problems.push_back({.name = "catenary, span " + number(curve.span),
                            .quantity = "sag, relative",
                            .source = "catenary",
                            .cells = {20, 40},
                            .targets = {0.02, 0.005},
                            .poissons = {0.0},
                            .meshes = kAllMeshes,
                            .solve = [curve](const Case& how) { return hangingSheet(how, curve); }});
}

}  // namespace jacket::demo::accuracy
