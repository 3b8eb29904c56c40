#pragma once
#include <cstddef>
#include <vector>

#include "solver/Columns.h"

namespace jacket {

class BlockMatrix;

/// A symmetric matrix of one scalar per vertex pair, which stands for that scalar times I3, by whole rows in two parts:
/// the scalars for which the pattern of a block matrix has a block, and those that stand beside it.
class ConstantHessian {
  public:
    /// Scalars by rows, in each by rising columns, as plain memory. A row ends where the next one starts.
    template <class Column>
    struct Rows {
        const int* start;
        const Column* column;
        const double* value;
    };

    /// Fills row after row, by rising columns.
    void append(int column, double value);
    void endRow() { m_listed.start.push_back(static_cast<int>(m_listed.value.size())); }
    /// Then, once: parts the rows. Before, there is nothing in either part.
    void split(const BlockMatrix& pattern);

    /// visit(rows inside, rows beside)
    decltype(auto) visit(const auto& visit) const {
        return m_inside.column.isNarrow() ? visit(m_inside.rows<Columns::Narrow>(), m_beside.rows<Columns::Narrow>())
                                          : visit(m_inside.rows<int>(), m_beside.rows<int>());
    }
    std::size_t besideCount() const { return m_beside.value.size(); }  ///< of all rows

  private:
    struct Part {
        std::vector<int> start{0};
        Columns column;
        std::vector<double> value;
        void begin(int size, std::size_t count);
        void append(int toColumn, double scalar);
        void endRow() { start.push_back(static_cast<int>(value.size())); }
        template <class Column>
        Rows<Column> rows() const {
            return {start.data(), column.data<Column>(), value.data()};
        }
    };
    struct List {
        std::vector<int> start{0}, column;
        std::vector<double> value;
    };
    List m_listed;  ///< rows until they are parted
    Part m_inside, m_beside;
};

}  // namespace jacket
