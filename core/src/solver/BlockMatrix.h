#pragma once
#include <span>
#include <utility>
#include <vector>

#include "jacket/Types.h"

namespace jacket {

/// Symmetric matrix of 3x3 blocks with a fixed pattern: the diagonal, and the blocks strictly below it by rows.
class BlockMatrix {
  public:
    /// `pairs`: vertex pairs that share a block, in any order and as often as they come. Values become zero.
    void setPattern(int size, std::vector<std::pair<int, int>> pairs);
    /// Index of block (row, column) in lower(), row > column. The pair must be in the pattern.
    int slot(int row, int column) const;
    void setZero();

    int size() const { return static_cast<int>(m_diagonal.size()); }
    std::vector<Mat3>& diagonal() { return m_diagonal; }
    const std::vector<Mat3>& diagonal() const { return m_diagonal; }
    std::vector<Mat3>& lower() { return m_lower; }
    const std::vector<Mat3>& lower() const { return m_lower; }
    int rowBegin(int row) const { return m_rowStart[row]; }
    int rowEnd(int row) const { return m_rowStart[row + 1]; }
    int column(int k) const { return m_column[k]; }

    /// y = A x over `size()` columns starting at x and y (3 doubles each). They must not overlap.
    void multiply(const double* x, double* y) const;

  private:
    std::vector<int> m_rowStart, m_column;
    std::vector<Mat3> m_diagonal, m_lower;
};

}  // namespace jacket
