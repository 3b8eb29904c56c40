#pragma once
#include <vector>

namespace jacket {

/// Place of each row in an order of elimination with little fill. `neighbours`: of each row, without itself.
std::vector<int> eliminationOrder(const std::vector<std::vector<int>>& neighbours);

/// Block-sparse factor L D L^T of a symmetric positive semi-definite matrix of 6x6 blocks with a fixed pattern.
class BlockFactor {
  public:
    static constexpr int kRows = 6, kSize = kRows * kRows;
    static constexpr double kLeast = 1e-9;
    /// `neighbours`: of each block row, in any order, without itself. Rows are eliminated as they are numbered.
    explicit BlockFactor(const std::vector<std::vector<int>>& neighbours);
    int size() const { return static_cast<int>(m_columnStart.size()) - 1; }
    int blockCount() const { return size() + static_cast<int>(m_row.size()); }
    /// Index of block (row, column), row >= column, which must be in the pattern; -1 above the diagonal. Diagonal
    /// blocks come first.
    int index(int row, int column) const;
    /// A block, 36 numbers by columns, to be filled before every `factor`; of diagonal ones what is on and below the
    /// diagonal counts.
    double* block(int index) { return m_values.data() + kSize * index; }
    const double* block(int index) const { return m_values.data() + kSize * index; }
    void setZero();
    /// In place. Directions of which the elimination leaves less than `least` of their stiffness are left out: the
    /// factor's inverse is zero there. False if there are any.
    bool factor(double least = kLeast);
    /// x = (L D L^T)^-1 x, six numbers a block row.
    void solve(double* x) const;

  private:
    std::vector<int> m_columnStart, m_row;  ///< strictly lower blocks by columns
    std::vector<double> m_values;           ///< diagonal blocks, then those
    std::vector<double> m_inverse, m_scaled;
};

}  // namespace jacket
