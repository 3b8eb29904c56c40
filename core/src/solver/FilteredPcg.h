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
    /// The least tolerance that a system in single precision should be asked for: below, rounding is in the way.
    static constexpr double kLeastSingleTolerance = 1e-5;

    /// Starts at u, which must satisfy (I - S) s = z as every u does here; returns r^T P^-1 r there.
    double begin(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, const CoupledVector& u);
    /// After begin: improves u until r^T P^-1 r <= tolerance^2 reference. Of a system in single precision the
    /// iterations are; the residual that they end with is computed in double, and where it is not what they took it for
    /// they start again from it. Where they have made it much worse, u is left as it was.
    PcgReport finish(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, double reference,
                     double tolerance, int maxIterations, CoupledVector& u);
    /// All of it, from u.
    PcgReport solve(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, double reference,
                    double tolerance, int maxIterations, CoupledVector& u) {
        begin(system, preconditioner, u);
        return finish(system, preconditioner, reference, tolerance, maxIterations, u);
    }
    /// Nothing but unfilteredResidual at any u.
    void computeResidual(const CoupledSystem& system, const CoupledVector& u);
    /// (b - A v) at every vertex as of the last call of any: at the u that it left.
    const Points& unfilteredResidual() const { return m_unfiltered; }

  private:
    void resize(const CoupledSystem& system);
    double dot(WorkerTeam* team, const CompactVector& a, const CompactVector& b);
    double precondition(const CoupledSystem& system, const CoupledPreconditioner& preconditioner);
    double iterate(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, double rho, double target,
                   int maxIterations, int& iterations, CoupledVector& u);
    double iterateCompact(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, double rho,
                          double target, int maxIterations, int& iterations, CoupledVector& u);
    void takeBack(const CoupledSystem& system, CoupledVector& u) const;
    bool isAsIterated(const CoupledSystem& system);
    CoupledVector m_r, m_z, m_d, m_q;  ///< in single precision r.w alone
    double m_rho = 0.0;                ///< r^T P^-1 r
    CompactVector m_compactR, m_compactD;
    CompactVector m_compactZ;        ///< P^-1 r, and A d until the next r is known
    std::vector<double> m_partSums;  ///< of a dot product
    std::vector<double> m_change;    ///< of u.s, four a vertex as in a CompactVector; then what u.s was before
    Eigen::Matrix<double, 6, Eigen::Dynamic> m_twistsBefore;  ///< what u.w was
    Points m_unfiltered;
};

}  // namespace jacket
