#pragma once
#include <Eigen/SparseCholesky>

#include <vector>

#include "solver/BlockMatrix.h"

namespace jacket {

/// Complete Cholesky factor of one shell's filtered matrix, with what stands beside its blocks. For small shells that
/// are stiff for their mesh, where incomplete factors know so little of bending that iterations end far from the
/// solution.
class ShellFactor {
  public:
    /// `diagonal` and `lower` are the filtered values, on the pattern of `matrix`; `free`: of each vertex the projector
    /// that filters what stands beside, null: the identity. False if the values are not positive definite.
    bool factor(const BlockMatrix& matrix, const std::vector<Mat3>& diagonal, const std::vector<Mat3>& lower,
                const std::vector<const Mat3*>& free);
    /// z = A^-1 r over size() columns of 3 doubles. They may be the same.
    void apply(const double* r, double* z) const;

  private:
    using Sparse = Eigen::SparseMatrix<double>;
    void analyse(const BlockMatrix& matrix);
    int slot(int row, int column) const;
    void expand();

    const BlockMatrix* m_pattern = nullptr;
    const ConstantHessian* m_beside = nullptr;
    std::vector<int> m_columnStart, m_row;  ///< blocks on and below the diagonal, by columns
    std::vector<int> m_lowerSlot;           ///< of each block of the matrix
    std::vector<Mat3> m_blocks;
    Sparse m_matrix;
    Eigen::SimplicialLDLT<Sparse> m_factor;
};

}  // namespace jacket
