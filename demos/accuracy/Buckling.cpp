#include <cmath>
#include <stdexcept>

#include "accuracy/References.h"
#include "accuracy/Setup.h"

/// Stability of a flat sheet that carries load in its plane.
namespace jacket::demo::accuracy {
namespace {

constexpr double kLength = 1.0, kWidth = 0.25, kThickness = 1e-3;  // [m]

double criticalWeight(double poisson) {
    for (const CriticalWeight& entry : kLateralBuckling)
        if (entry.poisson == poisson) return entry.gamma;
    throw std::invalid_argument("lateral buckling: no reference for this Poisson's ratio");
}

/// A strip on edge, clamped at one end, which carries its weight in its plane; up: whichever side gravity leaves.
class StripOnEdge {
  public:
    StripOnEdge(const Case& how, double up)
        : m_up(up),
          m_shell(makeStrip(how, kLength, kWidth, {.left = 1}), plateMaterial(1.0, kThickness, how.poisson),
                  {.bending = how.bending}) {
        clampEdge(m_shell, how.bending,
                  verticesWhere(m_shell.restPositions(), [](const Vec3& p) { return p.x() < 1e-9; }));
    }
    bool isStable(double gamma) {
        m_shell.setPositions(m_shell.restPositions());
        const StaticReport report = settle(m_shell, {0, -m_up * gamma, 0}, {.tolerance = 1e-6});
        m_converged = m_converged && report.converged;
        return unstableDirections(m_shell) == 0;
    }
    bool converged() const { return m_converged; }
    const Shell& shell() const { return m_shell; }

  private:
    double m_up;
    Shell m_shell;
    bool m_converged = true;
};

Measurement critical(const Case& how, double up) {
    constexpr double kEnough = 5e-4;  // width of the last bracket, relative
    const Stopwatch watch;
    const double exact = criticalWeight(how.poisson);
    StripOnEdge strip(how, up);
    double low = 0.0, high = exact;
    while (strip.isStable(high)) {
        low = high;
        high *= 1.25;
    }
    while (high - low > kEnough * exact) {
        const double middle = 0.5 * (low + high);
        (strip.isStable(middle) ? low : high) = middle;
    }
    return relative(0.5 * (low + high), exact, watch, strip.shell(), strip.converged());
}

/// Upside down the same mesh has its diagonals the other way.
Measurement lateralBuckling(const Case& how) {
    const Measurement upright = critical(how, 1.0), upsideDown = critical(how, -1.0);
    Measurement result = worse(upright, upsideDown);
    result.seconds = upright.seconds + upsideDown.seconds;
    result.converged = upright.converged && upsideDown.converged;
    return result;
}

}  // namespace

void addBuckling(std::vector<Problem>& problems) {
    problems.push_back({.name = "lateral buckling under own weight",
                        .quantity = "critical rho g t L^3 / D, relative; the worse of both directions of the diagonals",
                        .source = "Ritz",
                        .cells = {24, 48},
                        .targets = {0.06, 0.03},
                        .poissons = {0.0, 0.3},
                        .meshes = kAllMeshes,
                        .solve = lateralBuckling});
}

}  // namespace jacket::demo::accuracy
