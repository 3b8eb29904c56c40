#pragma once
#include <cstddef>
#include <vector>

namespace jacket {

class BlockMatrix;

/// A symmetric matrix of one scalar per vertex pair, which stands for that scalar times I3, by whole rows in two parts:
/// the scalars for which the pattern of a block matrix has a block, and those that stand beside it.
class ConstantHessian {
  public:
    /// Scalars by rows, in each by rising columns, as plain memory. A row ends where the next one starts.
    struct Rows {
        const int *start, *column;
        const double* value;
    };

    /// Fills row after row, by rising columns.
    void append(int column, double value) { m_inside.append(column, value); }
    void endRow();
    /// Then, once: parts the rows. Before, nothing stands beside.
    void split(const BlockMatrix& pattern);

    Rows inside() const { return m_inside.rows(); }
    Rows beside() const { return m_beside.rows(); }
    std::size_t besideCount() const { return m_beside.value.size(); }  ///< of all rows

  private:
    struct Part {
        std::vector<int> start{0}, column;
        std::vector<double> value;
        void append(int toColumn, double scalar);
        void resize(int size);
        Rows rows() const { return {start.data(), column.data(), value.data()}; }
    };
    Part m_inside, m_beside;
};

}  // namespace jacket
