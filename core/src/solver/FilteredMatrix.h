#pragma once
#include <vector>

#include "solver/BlockMatrix.h"

namespace jacket {

/// A block matrix with some of its blocks altered, as constraints and soft rows do it for a preconditioner: these alone
/// are copied, all others are read from the matrix. What stands beside its blocks is as it was.
class FilteredMatrix {
  public:
    FilteredMatrix() = default;
    explicit FilteredMatrix(const BlockMatrix& matrix) { begin(matrix); }
    /// As `matrix`, which must stay as it is until the next call. `isDiagonal`: without blocks off its diagonal.
    void begin(const BlockMatrix& matrix, bool isDiagonal = false);

    const BlockMatrix& pattern() const { return *m_matrix; }
    bool hasLower() const { return m_hasLower; }
    const Mat3& diagonal(int row) const {
        const int place = m_diagonalPlace[row];
        return place < 0 ? m_matrix->diagonal()[row] : m_altered[place];
    }
    /// Block k of those below the diagonal.
    const Mat3& lower(int k) const {
        const int place = m_lowerPlace[k];
        return place < 0 ? m_matrix->lower()[k] : m_altered[place];
    }
    /// The block, to be altered before the next one is.
    Mat3& alterDiagonal(int row) { return alter(m_diagonalPlace[row], m_matrix->diagonal()[row]); }
    Mat3& alterLower(int k) { return alter(m_lowerPlace[k], m_matrix->lower()[k]); }
    std::size_t alteredCount() const { return m_altered.size(); }

    /// Blocks as plain memory, for kernels: nine numbers by columns.
    struct Blocks {
        const int* place;  ///< among those that are altered, < 0: it is not
        const double *own, *altered;
    };
    Blocks diagonalBlocks() const { return {m_diagonalPlace.data(), first(m_matrix->diagonal()), first(m_altered)}; }
    Blocks lowerBlocks() const { return {m_lowerPlace.data(), first(m_matrix->lower()), first(m_altered)}; }

  private:
    static const double* first(const std::vector<Mat3>& blocks) {
        return blocks.empty() ? nullptr : blocks.front().data();
    }
    Mat3& alter(int& place, const Mat3& block);
    const BlockMatrix* m_matrix = nullptr;
    bool m_hasLower = false;
    std::vector<int> m_diagonalPlace, m_lowerPlace;  ///< of each block in m_altered, -1: it is the matrix' own
    std::vector<Mat3> m_altered;
};

}  // namespace jacket
