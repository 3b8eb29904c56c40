#include "solver/BlockMatrix.h"

#include <algorithm>
#include <cassert>

#include "Kernel.h"
#include "solver/CompactShell.h"

namespace jacket {
namespace {

/// Scalars by rows, and what those beside the blocks are multiplied with, in fours.
template <class Column>
struct ScalarRows {
    ConstantHessian::Rows<Column> scalars;
    const double* x;
    double factor;
    int count;
};

/// y += factor K x, three numbers a row of y.
template <class Column>
JACKET_KERNEL void addScalarRows(const ScalarRows<Column>& beside, double* y) {
    const ScalarRows<Column> rows = beside;  // nobody writes there
    const ConstantHessian::Rows<Column>& scalars = rows.scalars;
    for (int i = 0; i < rows.count; ++i) {
        Double4 even{}, odd{};  // two sums: shorter chains of additions
        int k = scalars.start[i];
        const int end = scalars.start[i + 1];
        Double4 x;
        for (; k + 1 < end; k += 2) {
            std::memcpy(&x, rows.x + 4 * scalars.column[k], sizeof(x));
            even += scalars.value[k] * x;
            std::memcpy(&x, rows.x + 4 * scalars.column[k + 1], sizeof(x));
            odd += scalars.value[k + 1] * x;
        }
        if (k < end) {
            std::memcpy(&x, rows.x + 4 * scalars.column[k], sizeof(x));
            even += scalars.value[k] * x;
        }
        even = rows.factor * (even + odd);
        for (int c = 0; c < 3; ++c) y[3 * i + c] += even[c];
    }
}

}  // namespace

BlockMatrix::BlockMatrix() = default;
BlockMatrix::~BlockMatrix() = default;
BlockMatrix::BlockMatrix(BlockMatrix&&) noexcept = default;
BlockMatrix& BlockMatrix::operator=(BlockMatrix&&) noexcept = default;

CompactShell& BlockMatrix::compact() const {
    if (!m_compact) m_compact = std::make_unique<CompactShell>(*this);
    return *m_compact;
}

void BlockMatrix::setPattern(int size, std::vector<std::pair<int, int>> pairs) {
    for (auto& [row, column] : pairs)
        if (row < column) std::swap(row, column);
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());

    m_rowStart.assign(size + 1, 0);
    m_column.clear();
    m_column.reserve(pairs.size());
    for (const auto& [row, column] : pairs) {
        assert(row > column && row < size);
        ++m_rowStart[row + 1];
        m_column.push_back(column);
    }
    for (int i = 0; i < size; ++i) m_rowStart[i + 1] += m_rowStart[i];
    m_diagonal.assign(size, Mat3::Zero());
    m_lower.assign(pairs.size(), Mat3::Zero());
    m_compact.reset();
}

int BlockMatrix::slot(int row, int column) const {
    const auto begin = m_column.begin() + m_rowStart[row], end = m_column.begin() + m_rowStart[row + 1];
    const auto found = std::lower_bound(begin, end, column);
    assert(found != end && *found == column);
    return static_cast<int>(found - m_column.begin());
}

bool BlockMatrix::contains(int row, int column) const {
    const auto begin = m_column.begin() + m_rowStart[row], end = m_column.begin() + m_rowStart[row + 1];
    return std::binary_search(begin, end, column);
}

std::vector<std::vector<int>> BlockMatrix::neighbours() const {
    std::vector<std::vector<int>> result(size());
    for (int i = 0; i < size(); ++i)
        for (int k = rowBegin(i); k < rowEnd(i); ++k) {
            result[i].push_back(column(k));
            result[column(k)].push_back(i);
        }
    return result;
}

void BlockMatrix::setZero() {
    std::fill(m_diagonal.begin(), m_diagonal.end(), Mat3::Zero());
    std::fill(m_lower.begin(), m_lower.end(), Mat3::Zero());
}

void BlockMatrix::multiply(const double* x, double* y) const {
    const int n = size();
    for (int i = 0; i < n; ++i) {
        const double x0 = x[3 * i], x1 = x[3 * i + 1], x2 = x[3 * i + 2];
        const double* d = m_diagonal[i].data();
        double y0 = d[0] * x0 + d[3] * x1 + d[6] * x2;
        double y1 = d[1] * x0 + d[4] * x1 + d[7] * x2;
        double y2 = d[2] * x0 + d[5] * x1 + d[8] * x2;
        for (int k = m_rowStart[i]; k < m_rowStart[i + 1]; ++k) {
            const double* a = m_lower[k].data();  // column major
            const double* xj = x + 3 * m_column[k];
            double* yj = y + 3 * m_column[k];  // an earlier row: already written
            y0 += a[0] * xj[0] + a[3] * xj[1] + a[6] * xj[2];
            y1 += a[1] * xj[0] + a[4] * xj[1] + a[7] * xj[2];
            y2 += a[2] * xj[0] + a[5] * xj[1] + a[8] * xj[2];
            yj[0] += a[0] * x0 + a[1] * x1 + a[2] * x2;
            yj[1] += a[3] * x0 + a[4] * x1 + a[5] * x2;
            yj[2] += a[6] * x0 + a[7] * x1 + a[8] * x2;
        }
        y[3 * i] = y0;
        y[3 * i + 1] = y1;
        y[3 * i + 2] = y2;
    }
    if (m_beside) addBeside(x, y);
}

void BlockMatrix::addBeside(const double* x, double* y) const {
    double* const inFours = padded();
    for (int i = 0; i < size(); ++i) std::copy_n(x + 3 * i, 3, inFours + 4 * i);
    m_beside->visit([&](const auto&, const auto& scalars) {
        addScalarRows(ScalarRows{scalars, inFours, m_besideFactor, size()}, y);
    });
}

}  // namespace jacket
