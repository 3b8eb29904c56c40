#pragma once
#include <optional>
#include <vector>

#include "solver/BlockFactor.h"
#include "solver/FilteredMatrix.h"

namespace jacket {

/// Complete Cholesky factor of one shell's filtered matrix, with what stands beside its blocks. For shells that are
/// stiff for their mesh, where incomplete factors know so little of bending that iterations end far from the solution.
/// Vertices are eliminated two at a time: blocks of six rows keep a processor busy.
class ShellFactor {
  public:
    /// `free`: of each vertex the projector that filters what stands beside the blocks, null: the identity. False if
    /// the filtered matrix is not positive definite.
    bool factor(const FilteredMatrix& filtered, const std::vector<const Mat3*>& free);
    /// z = A^-1 r over size() columns of 3 doubles. They may be the same.
    void apply(const double* r, double* z) const;

  private:
    bool isOf(const BlockMatrix& matrix) const;
    void analyse(const BlockMatrix& matrix);
    int placeOf(int i, int j) const;
    void add(int place, const Mat3& block);

    const BlockMatrix* m_pattern = nullptr;
    const ConstantHessian* m_beside = nullptr;
    std::size_t m_besideCount = 0;
    std::vector<int> m_slot;  ///< of each vertex: half block rows
    std::vector<int> m_free;  ///< half block rows of no vertex
    /// Where the factor keeps a block of the matrix, or one that stands beside it below the diagonal; ~: its transpose.
    std::vector<int> m_lowerPlace, m_besidePlace;
    std::optional<BlockFactor> m_factor;
    mutable std::vector<double> m_x;  ///< in the factor's order
};

}  // namespace jacket
