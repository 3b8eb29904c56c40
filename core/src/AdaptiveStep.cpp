#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "jacket/Island.h"
#include "jacket/Shell.h"

namespace jacket {
namespace {

/// Largest change of an edge's length between two shapes, in rest lengths.
double largestStrain(const Shell& shell, const Points& from, const Points& to) {
    double most = 0.0;
    for (const auto& e : shell.mesh().edges()) {
        const double rest = (shell.restPositions().col(e.v1) - shell.restPositions().col(e.v0)).norm();
        const double change = (to.col(e.v1) - to.col(e.v0)).norm() - (from.col(e.v1) - from.col(e.v0)).norm();
        most = std::max(most, std::abs(change) / rest);
    }
    return most;
}

/// Kinetic, and elastic at positions `x` [J].
double ownEnergy(const Shell& shell, const Points& x) {
    return shell.elasticEnergy(x) + shell.kineticEnergy();
}

/// What gravity and forces do on the way from one shape to another [J].
double workOfLoads(const Shell& shell, const Points& from, const Points& to, const Vec3& gravity) {
    double sum = 0.0;
    for (int i = 0; i < shell.vertexCount(); ++i)
        sum += (shell.masses()[i] * gravity + shell.forces().col(i)).dot(to.col(i) - from.col(i));
    return sum;
}

}  // namespace

AdaptiveReport Shell::stepAdaptively(double duration, const Vec3& gravity, AdaptiveStep& control, const Wind* wind) {
    if (!(duration > 0.0) || !std::isfinite(duration))
        throw std::invalid_argument("Shell::stepAdaptively: duration [s] must be > 0 and finite");
    if (!(control.mostStrain > 0.0) || !(control.mostEnergyGain > 0.0) || !(control.shortest > 0.0))
        throw std::invalid_argument("AdaptiveStep: limits must be > 0");
    if (!m_ownSolver) m_ownSolver = std::make_unique<IslandSolver>();
    AdaptiveReport report;
    Shell* self = this;
    double left = duration;
    if (!(control.next > 0.0)) control.next = duration;
    while (left > 1e-12 * duration) {
        // what is left in equal parts, so that no splinter of a step remains
        const double h = left / std::ceil(left / std::min(control.next, left) - 1e-9);
        const Points v = m_v, lastX = m_lastX, lastV = m_lastV;
        const double lastH = m_lastH, before = ownEnergy(*this, m_x);
        IslandInput input{.h = h, .gravity = gravity, .wind = wind, .shells = {&self, 1}};
        const StepReport step = m_ownSolver->solve(input);
        const Points end = m_x + (m_stride * h) * m_v + m_y;
        const auto gain = [&] { return ownEnergy(*this, end) - before - workOfLoads(*this, m_x, end, gravity); };
        const bool acceptable = step.finite && largestStrain(*this, m_x, end) <= control.mostStrain &&
                                (wind || gain() <= control.mostEnergyGain * std::max(before, 1e-300));
        if (!acceptable && h > control.shortest) {
            m_v = v;
            m_y.setZero();
            m_lastX = lastX;
            m_lastV = lastV;
            m_lastH = lastH;
            m_stride = 1.0;
            control.next = std::max(0.5 * h, control.shortest);
            control.quiet = 0;
            ++report.rejected;
            continue;
        }
        report.finite = report.finite && step.finite;
        if (!step.finite) return report;
        advance(h);
        left -= h;
        ++report.steps;
        report.shortest = report.steps == 1 ? h : std::min(report.shortest, h);
        if (++control.quiet >= 4) {  // a while after the last rejection: try longer steps again
            control.next = std::min(2.0 * h, duration);
            control.quiet = 0;
        }
    }
    return report;
}

}  // namespace jacket
