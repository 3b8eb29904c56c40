#pragma once
#include <vector>

#include "jacket/WorkerTeam.h"
#include "solver/BlockMatrix.h"

namespace jacket {

/// The product of a block matrix in double precision row by row, so that threads can share it: each block is read for
/// its row and once more for its column.
class BlockProduct {
  public:
    /// Takes the pattern.
    explicit BlockProduct(const BlockMatrix& matrix);
    /// y = A x of a matrix with that pattern, three doubles a vertex. They must not overlap.
    void multiply(const BlockMatrix& matrix, const double* x, double* y, WorkerTeam* team) const;
    /// y += A e, e being `change` at one vertex and 0 at all others.
    void addColumn(const BlockMatrix& matrix, int vertex, const Vec3& change, double* y) const;

  private:
    std::vector<int> m_upperStart, m_upperRow, m_upperSlot;  ///< of each column: rows, and indices in lower()
};

}  // namespace jacket
