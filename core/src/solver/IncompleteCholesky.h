#pragma once
#include <vector>

#include "solver/FilteredMatrix.h"

namespace jacket {

/// Incomplete Cholesky factor of a block matrix on its own pattern, L D L^T ~ A, with diagonal blocks scaled by
/// (1 + shift) where the plain factor breaks down. The shift is remembered from factor to factor.
class IncompleteCholesky {
  public:
    /// The pattern of `matrix` must outlive this factor.
    void factor(const FilteredMatrix& matrix);
    /// z = (L D L^T)^-1 r over size() columns of 3 doubles.
    void apply(const double* r, double* z) const;
    double shift() const { return m_shift; }

  private:
    bool tryFactor(const FilteredMatrix& matrix);
    const BlockMatrix* m_pattern = nullptr;
    std::vector<Mat3> m_inverse;  ///< D^-1
    std::vector<Mat3> m_lower;    ///< L D, row by row
    mutable Points m_scratch;
    double m_shift = 0.0;
};

}  // namespace jacket
