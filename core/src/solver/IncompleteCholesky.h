#pragma once
#include <vector>

#include "solver/BlockMatrix.h"

namespace jacket {

/// Incomplete Cholesky factor of a block matrix on its own pattern, L D L^T ~ A, with diagonal blocks scaled by
/// (1 + shift) where the plain factor breaks down. The shift is remembered from factor to factor.
class IncompleteCholesky {
  public:
    /// `diagonal` and `lower` are the values, on the pattern of `matrix`, which must outlive this factor.
    void factor(const BlockMatrix& matrix, const std::vector<Mat3>& diagonal, const std::vector<Mat3>& lower);
    /// z = (L D L^T)^-1 r over size() columns of 3 doubles.
    void apply(const double* r, double* z) const;
    double shift() const { return m_shift; }

  private:
    bool tryFactor(const BlockMatrix& matrix, const std::vector<Mat3>& diagonal, const std::vector<Mat3>& lower);
    const BlockMatrix* m_pattern = nullptr;
    std::vector<Mat3> m_inverse;  ///< D^-1
    std::vector<Mat3> m_lower;    ///< L D, row by row
    mutable Points m_scratch;
    double m_shift = 0.0;
};

}  // namespace jacket
