#include "solver/FilteredPcg.h"

#include <cmath>

namespace jacket {

double FilteredPcg::residualNorm2(const CoupledSystem& system, const CoupledPreconditioner& preconditioner,
                                  const CoupledVector& u) {
    for (CoupledVector* v : {&m_r, &m_z, &m_q})
        if (v->s.cols() != u.s.cols() || v->w.cols() != u.w.cols()) v->resize(system.vertexCount(), system.bodyCount());
    system.residual(u, m_r, m_unfiltered);
    preconditioner.apply(system, m_r, m_z);
    return m_r.dot(m_z);
}

PcgReport FilteredPcg::solve(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, double reference,
                             double tolerance, int maxIterations, CoupledVector& u) {
    PcgReport report;
    double rho = residualNorm2(system, preconditioner, u);
    const double target = tolerance * tolerance * reference;
    m_d = m_z;
    while (!(rho <= target) && report.iterations < maxIterations) {
        system.apply(m_d, m_q);
        const double curvature = m_d.dot(m_q);
        if (!(curvature > 0.0)) break;  // lost to rounding, or not finite
        const double alpha = rho / curvature;
        u.addScaled(alpha, m_d);
        m_r.addScaled(-alpha, m_q);
        preconditioner.apply(system, m_r, m_z);
        const double next = m_r.dot(m_z);
        m_d.scaleAndAdd(next / rho, m_z);
        rho = next;
        ++report.iterations;
    }
    report.converged = rho <= target;
    report.residual = reference > 0.0 ? std::sqrt(std::max(rho, 0.0) / reference) : 0.0;
    return report;
}

}  // namespace jacket
