#include "solver/ConstantHessian.h"

#include <algorithm>
#include <utility>

#include "solver/BlockMatrix.h"

namespace jacket {

void ConstantHessian::append(int column, double value) {
    m_listed.column.push_back(column);
    m_listed.value.push_back(value);
}

void ConstantHessian::Part::begin(int size, std::size_t count) {
    start.reserve(size + 1);
    column.begin(size, count);
    value.reserve(count);
}

void ConstantHessian::Part::append(int toColumn, double scalar) {
    column.push_back(toColumn);
    value.push_back(scalar);
}

void ConstantHessian::split(const BlockMatrix& pattern) {
    const List listed = std::exchange(m_listed, {});
    const auto forEntries = [&](const auto& visit, const auto& endRow) {
        for (int row = 0; row + 1 < std::ssize(listed.start); ++row) {
            for (int k = listed.start[row]; k < listed.start[row + 1]; ++k) {
                const int column = listed.column[k];
                visit(column == row || pattern.contains(std::max(row, column), std::min(row, column)), k);
            }
            endRow();
        }
    };
    std::size_t inside = 0;
    forEntries([&](bool isInside, int) { inside += isInside ? 1 : 0; }, [] {});
    m_inside.begin(pattern.size(), inside);
    m_beside.begin(pattern.size(), listed.value.size() - inside);
    const auto place = [&](bool isInside, int k) {
        (isInside ? m_inside : m_beside).append(listed.column[k], listed.value[k]);
    };
    forEntries(place, [&] {
        m_inside.endRow();
        m_beside.endRow();
    });
}

}  // namespace jacket
