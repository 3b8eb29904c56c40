#pragma once
#include <Eigen/Cholesky>
#include <memory>
#include <vector>

#include "jacket/Shell.h"
#include "solver/CoarseSpace.h"
#include "solver/CoupledSystem.h"
#include "solver/FilteredMatrix.h"
#include "solver/IncompleteCholesky.h"
#include "solver/ShellFactor.h"

namespace jacket {

/// P^-1 of an island: per shell 3x3 blocks or an incomplete factor of the filtered matrix, per body the 6x6 block
/// M_b + sum_ij G_i^T A_ij G_j of the operator; bodies whose masses are coupled are factored together. Where shells are
/// factored completely they are eliminated, and what is left of the bodies is too: P is the operator then, but for
/// other shells.
class CoupledPreconditioner {
  public:
    /// `keepsCoarse`: coarse spaces may stay as they are, as contacts alone have changed since they were built. They
    /// know the shell as a whole, and are half of the work. Where many contacts have come or gone they are made anew.
    void build(const CoupledSystem& system, Preconditioner kind, bool keepsCoarse = false);
    /// Only the bodies' blocks, after the contacts of an otherwise unchanged system have changed: the shells' factor of
    /// the old contacts, filtered by the new, is still positive definite. In double precision that is cheaper than a
    /// new one; in single a solve takes half the iterations with a new one, and leaves less of rigid motions over.
    void updateBodies(const CoupledSystem& system);
    void apply(const CoupledSystem& system, const CoupledVector& r, CoupledVector& z) const;
    /// The same, of a system in single precision, which is always factored: with an incomplete factor and, where the
    /// shell is large and its positions are known, a coarse space.
    void apply(const CoupledSystem& system, const CompactVector& r, CompactVector& z) const;
    /// Whether this is of a system in single precision, and every shell has a coarse space: r^T P^-1 r then weighs
    /// rigid motions of parts as the others. Without, it makes little of them.
    bool isCoarse(const CoupledSystem& system) const;
    /// Whether some shell is factored completely.
    bool isComplete() const;
    /// What an impulse does to a body's twist where the vertices that it carries hang on others that stay.
    Vec6 twistBy(int body, const Vec6& impulse) const { return m_bodies[body].solve(impulse); }

  private:
    /// Bodies that couplings join, directly or through others.
    struct BodyGroup {
        std::vector<int> bodies;
        Eigen::MatrixXd matrix;
        Eigen::LDLT<Eigen::MatrixXd> factor;
        mutable Eigen::VectorXd part;
    };

    void buildShell(const CoupledSystem& system, std::size_t shell, Preconditioner kind, bool keepsCoarse);
    bool factorCompletely(const CoupledSystem& system, std::size_t shell);
    bool isCompact(const CoupledSystem& system, std::size_t shell) const;
    /// What the other apply does to a system in single precision, of one shell of a system in double.
    void applyCompact(const CoupledSystem::ShellPart& part, const Points& r, Points& z, WorkerTeam* team) const;
    void findFree(const CoupledSystem& system, const CoupledSystem::ShellPart& part);
    void buildCoarse(const CoupledSystem& system, const CoupledSystem::ShellPart& part);
    static bool knowsContacts(const CoupledSystem& system, const CoupledSystem::ShellPart& part,
                              const CoarseSpace& coarse);
    void eliminateShells(const CoupledSystem& system);
    double alongComplete(const CoupledSystem& system, const Points& a, const Points& b) const;
    void applyToBodies(const Eigen::Matrix<double, 6, Eigen::Dynamic>& r,
                       Eigen::Matrix<double, 6, Eigen::Dynamic>& z) const;
    void addRows(const CoupledSystem& system, const CoupledSystem::ShellPart& part);
    void filterBlocks(const CoupledSystem& system, const CoupledSystem::ShellPart& part);
    void factorGroups(const CoupledSystem& system);
    void findLeaders(const CoupledSystem& system);
    BodyGroup& takeGroup(std::size_t size);
    void factorGroup(const CoupledSystem& system, int first, std::size_t size);

    FilteredMatrix m_filtered;                         ///< scratch: of one shell
    std::vector<const Mat3*> m_free;                   ///< scratch
    std::vector<CoarseSpace::Tie> m_ties;              ///< scratch
    mutable std::vector<float> m_rounded, m_roundedZ;  ///< scratch: a shell's r and z, four floats a row
    std::vector<IncompleteCholesky> m_factors;
    std::vector<std::unique_ptr<ShellFactor>> m_complete;  ///< of each shell; null: not factored completely
    bool m_isEliminating = false;                          ///< shells, from the bodies' equations:
    std::vector<CoupledVector> m_columns, m_solved;        ///< shells' part of the bodies' columns, and A^-1 of it
    CoupledVector m_unit;                                  ///< scratch
    Eigen::MatrixXd m_schurMatrix;                         ///< of all bodies' twists
    Eigen::LDLT<Eigen::MatrixXd> m_schur;
    mutable Eigen::VectorXd m_twists;  ///< scratch
    std::vector<std::vector<Mat3>> m_inverseBlocks;
    std::vector<Mat6> m_bodyBlocks;  ///< masses of the bodies with what touches them
    std::vector<Eigen::LDLT<Mat6>> m_bodies;
    std::vector<int> m_leader, m_place;  ///< of each body: the first of its group, its row in that one's matrix
    std::vector<BodyGroup> m_groups;     ///< the first m_groupCount of them; the others keep their memory
    std::size_t m_groupCount = 0;
    Preconditioner m_kind = Preconditioner::BlockJacobi;
};

}  // namespace jacket
