#pragma once
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "jacket/Types.h"
#include "jacket/WorkerTeam.h"
#include "solver/ConstantHessian.h"

namespace jacket {

struct CompactShell;

/// Symmetric matrix of 3x3 blocks with a fixed pattern: the diagonal, and the blocks strictly below it by rows. Scalars
/// times I3 outside the pattern may stand beside it.
class BlockMatrix {
  public:
    BlockMatrix();
    ~BlockMatrix();
    BlockMatrix(BlockMatrix&&) noexcept;
    BlockMatrix& operator=(BlockMatrix&&) noexcept;

    /// `pairs`: vertex pairs that share a block, in any order and as often as they come. Values become zero.
    void setPattern(int size, std::vector<std::pair<int, int>> pairs);
    /// Index of block (row, column) in lower(), row > column. The pair must be in the pattern.
    int slot(int row, int column) const;
    bool contains(int row, int column) const;  ///< row > column
    void setZero();

    int size() const { return static_cast<int>(m_diagonal.size()); }
    std::vector<Mat3>& diagonal() { return m_diagonal; }
    const std::vector<Mat3>& diagonal() const { return m_diagonal; }
    std::vector<Mat3>& lower() { return m_lower; }
    const std::vector<Mat3>& lower() const { return m_lower; }
    int rowBegin(int row) const { return m_rowStart[row]; }
    int rowEnd(int row) const { return m_rowStart[row + 1]; }
    int column(int k) const { return m_column[k]; }
    const std::vector<int>& rowStarts() const { return m_rowStart; }  ///< rowBegin of all rows, and the last one's end
    const std::vector<int>& columns() const { return m_column; }      ///< of all blocks
    std::vector<std::vector<int>> neighbours() const;                 ///< per vertex those that it shares a block with

    /// From now on the matrix has `factor` times those of the scalars that stand beside its pattern beside its blocks.
    /// They must outlive it and never change; null: nothing.
    void setBeside(const ConstantHessian* scalars, double factor) {
        m_beside = scalars;
        m_besideFactor = factor;
    }
    const ConstantHessian* beside() const { return m_beside; }
    double besideFactor() const { return m_besideFactor; }

    /// y = A x over `size()` columns starting at x and y (3 doubles each). They must not overlap. Row by row, so that
    /// threads can share it: each block is read for its row and once more for its column.
    void multiply(const double* x, double* y, WorkerTeam* team = nullptr) const;
    /// y += A e, e being `change` at one vertex and 0 at all others.
    void addColumn(int vertex, const Vec3& change, double* y) const;

    /// Memory for a vector in fours, for the machine's sake, which the next product takes too. The last ones are 0, and
    /// before it are more numbers.
    double* padded() const {
        m_padded.resize(4 * (m_diagonal.size() + 1));
        return m_padded.data() + 4;
    }

    /// Place for the copy in single precision that solves work with, and what they keep of it. Made with the pattern
    /// alone when first asked for; its values are whatever the last solve gave it.
    CompactShell& compact() const;

  private:
    void findUpper();
    std::vector<int> m_rowStart, m_column;
    std::vector<int> m_upperStart, m_upperRow, m_upperSlot;  ///< of each column: rows, and indices in lower()
    std::vector<Mat3> m_diagonal, m_lower;
    const ConstantHessian* m_beside = nullptr;
    double m_besideFactor = 0.0;
    mutable std::vector<double> m_padded;
    mutable std::unique_ptr<CompactShell> m_compact;
};

/// Calls `visit(i, j, scalar)`, i > j, for what stands beside the blocks; besideFactor() is not in it.
void forBeside(const BlockMatrix& matrix, const auto& visit) {
    if (!matrix.beside()) return;
    matrix.beside()->visit([&](const auto&, const auto& scalars) {
        for (int i = 0; i < matrix.size(); ++i)
            for (int k = scalars.start[i]; k < scalars.start[i + 1] && scalars.column[k] < i; ++k)
                visit(i, scalars.column[k], scalars.value[k]);
    });
}

}  // namespace jacket
