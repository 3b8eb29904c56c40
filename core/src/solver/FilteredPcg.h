#pragma once
#include "solver/CoupledPreconditioner.h"
#include "solver/CoupledSystem.h"

namespace jacket {

struct PcgReport {
    int iterations = 0;
    double residual = 0.0;  ///< relative, in the preconditioner's norm
    bool converged = true;
};

/// Modified preconditioned conjugate gradients (Ascher & Boxerman 2003) over vertices and bodies. Memory is kept.
class FilteredPcg {
  public:
    /// Improves u, which must satisfy (I - S) s = z, until r^T P^-1 r <= tolerance^2 reference.
    PcgReport solve(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, double reference,
                    double tolerance, int maxIterations, CoupledVector& u);
    /// r^T P^-1 r at u: what a start costs, and the reference of a solve.
    double residualNorm2(const CoupledSystem& system, const CoupledPreconditioner& preconditioner,
                         const CoupledVector& u);
    /// (b - A v) at every vertex as of the last call of either.
    const Points& unfilteredResidual() const { return m_unfiltered; }

  private:
    CoupledVector m_r, m_z, m_d, m_q;
    Points m_unfiltered;
};

}  // namespace jacket
