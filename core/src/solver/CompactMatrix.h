#pragma once
#include <vector>

#include "jacket/WorkerTeam.h"
#include "solver/BlockMatrix.h"

namespace jacket {

/// A block matrix in single precision, in a numbering of its own, for the products of a solve. What it does to a vector
/// is written in differences,
///
///     y_i = (sum_j A_ij) x_i + sum_j A_ij (x_j - x_i),
///
/// with the sum in brackets taken in double precision: a shell that moves as one feels its mass alone, which is many
/// orders smaller than its stiffness, and no false ground.
class CompactMatrix {
  public:
    /// Takes the pattern; no values yet.
    explicit CompactMatrix(const BlockMatrix& matrix);
    /// Takes the values of a matrix with that pattern. What stands beside its blocks is taken once, and again only when
    /// another matrix of scalars stands there: then it returns true.
    bool setValues(const BlockMatrix& matrix, WorkerTeam* team = nullptr);

    int size() const { return m_size; }
    /// Row of each vertex. Neighbours are close to each other (reverse Cuthill-McKee), and rows that do not need one
    /// another in a triangular solve follow on each other.
    const std::vector<int>& rowOf() const { return m_rowOf; }
    const std::vector<int>& vertexOf() const { return m_vertexOf; }  ///< of each row
    /// Rows come in strips across the shell and then in the separators between them, one fewer. No row of a strip has a
    /// block with another strip's, nor one of a separator with another separator's. Small shells are one strip.
    int stripCount() const { return (static_cast<int>(m_partStart.size())) / 2; }
    /// First row of each strip, then of each separator, then the number of rows.
    const std::vector<int>& partStarts() const { return m_partStart; }
    /// Calls visit(column) for the blocks of a row but its own, by rising columns.
    void forColumns(int row, const auto& visit) const {
        for (int k = m_lowerStart[row]; k < m_lowerStart[row + 1]; ++k) visit(m_lowerColumn[k]);
        for (int k = m_upperStart[row]; k < m_upperStart[row + 1]; ++k) visit(m_upperColumn[k]);
    }
    int lowerCount() const { return static_cast<int>(m_lowerColumn.size()); }  ///< blocks below the diagonal
    /// Scalars beside the blocks, without their common factor: all columns in rising order, none the row's own.
    int besideBegin(int row) const { return m_besideStart[row]; }
    int besideEnd(int row) const { return m_besideStart[row + 1]; }
    const Columns& besideColumns() const { return m_besideColumn; }
    double besideFactor() const { return m_besideFactor; }

    /// Where the blocks are, as plain memory for kernels: those below the diagonal by rows, and by columns above it, of
    /// which `upperBlock` is the one below the diagonal that each of them is the transpose of.
    struct Pattern {
        const int *lowerStart, *lowerColumn, *upperStart, *upperColumn, *upperBlock;
        const int* source;  ///< of each block below: its slot in the block matrix, or ~slot of its transpose
    };
    Pattern pattern() const {
        return {m_lowerStart.data(),  m_lowerColumn.data(), m_upperStart.data(),
                m_upperColumn.data(), m_upperBlock.data(),  m_source.data()};
    }

    /// All of it for kernels. Blocks are nine floats by columns.
    struct View {
        int size;
        Pattern pattern;
        const int* besideStart;
        const float *blocks, *rowSums, *beside;  ///< rowSums: sum_j A_ij
        float besideFactor;
    };
    View view() const {
        return {m_size,
                pattern(),
                m_besideStart.data(),
                m_blocks.data(),
                m_rowSums.data(),
                m_beside.data(),
                static_cast<float>(m_besideFactor)};
    }

    /// y = A x; four floats a row, the last of them 0. They must not overlap.
    void multiply(const float* x, float* y, WorkerTeam* team = nullptr) const;

  private:
    void takePattern(const BlockMatrix& matrix, const std::vector<std::vector<int>>& neighbours);
    void takeBeside(const ConstantHessian* scalars);
    void takeRows(const BlockMatrix& matrix, int begin, int end);
    int m_size;
    std::vector<int> m_partStart;
    std::vector<int> m_rowOf, m_vertexOf;
    std::vector<int> m_lowerStart, m_lowerColumn, m_upperStart, m_upperColumn, m_upperBlock, m_source;
    std::vector<float> m_blocks, m_rowSums;  ///< blocks: below the diagonal
    const ConstantHessian* m_besideSource = nullptr;
    std::size_t m_besideCount = 0;  ///< scalars when it was taken
    std::vector<int> m_besideStart;
    Columns m_besideColumn;
    std::vector<float> m_beside;
    std::vector<double> m_besideSums;  ///< of whole rows
    double m_besideFactor = 0.0;
};

}  // namespace jacket
