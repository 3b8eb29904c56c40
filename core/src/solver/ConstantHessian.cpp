#include "solver/ConstantHessian.h"

#include <algorithm>

#include "solver/BlockMatrix.h"

namespace jacket {

void ConstantHessian::Part::append(int toColumn, double scalar) {
    column.push_back(toColumn);
    value.push_back(scalar);
}

/// To the memory that it needs.
void ConstantHessian::Part::resize(int size) {
    column.resize(size);
    value.resize(size);
    column.shrink_to_fit();
    value.shrink_to_fit();
}

void ConstantHessian::endRow() {
    for (Part* part : {&m_inside, &m_beside}) part->start.push_back(static_cast<int>(part->column.size()));
}

void ConstantHessian::split(const BlockMatrix& pattern) {
    int begin = 0, kept = 0;
    for (int row = 0; row + 1 < std::ssize(m_inside.start); ++row) {
        const int end = m_inside.start[row + 1];
        for (int k = begin; k < end; ++k) {
            const int column = m_inside.column[k];
            if (column == row || pattern.contains(std::max(row, column), std::min(row, column))) {
                m_inside.column[kept] = column;
                m_inside.value[kept++] = m_inside.value[k];
            } else {
                m_beside.append(column, m_inside.value[k]);
            }
        }
        begin = end;
        m_inside.start[row + 1] = kept;
        m_beside.start[row + 1] = static_cast<int>(m_beside.column.size());
    }
    m_inside.resize(kept);
    m_beside.resize(static_cast<int>(m_beside.column.size()));
}

}  // namespace jacket
