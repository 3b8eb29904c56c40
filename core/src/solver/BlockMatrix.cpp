#include "solver/BlockMatrix.h"

#include <algorithm>
#include <cassert>

#include "Kernel.h"
#include "solver/CompactShell.h"

namespace jacket {
namespace {

constexpr int kBlockRowsAtATime = 512;  ///< that a thread of a team takes

/// As plain memory. Blocks are nine numbers by columns; x is in fours, with a number before it that may be anything.
template <class Column>
struct Operands {
    const int *lowerStart, *lowerColumn, *upperStart, *upperRow, *upperSlot;
    const double *diagonal, *lower;
    ConstantHessian::Rows<Column> scalars;  ///< beside; null: none
    double besideFactor;
    const double* x;
};

/// Of a row: the first three places, the last three, and three sums that are still in parts.
struct RowSum {
    Double4 first{}, last{}, parts[3] = {};
};

JACKET_INLINE void load(const double* from, Double4& to) {
    std::memcpy(&to, from, sizeof(to));
}

/// Adds block times x.
JACKET_INLINE void addProduct(const double* block, const double* x, RowSum& sum) {
    Double4 column;
    load(block, column);
    sum.first += column * x[0];
    load(block + 3, column);
    sum.first += column * x[1];
    load(block + 5, column);  // from one place before: behind the block may be nothing
    sum.last += column * x[2];
}

/// Adds the block's transpose times x.
JACKET_INLINE void addTransposedProduct(const double* block, const double* x, RowSum& sum) {
    Double4 column, inFirst, inLast;
    load(x, inFirst);
    load(x - 1, inLast);
    load(block, column);
    sum.parts[0] += column * inFirst;
    load(block + 3, column);
    sum.parts[1] += column * inFirst;
    load(block + 5, column);
    sum.parts[2] += column * inLast;
}

template <class Column>
JACKET_INLINE void addBeside(const Operands<Column>& o, int row, RowSum& sum) {
    Double4 x, sums[2] = {};  // shorter chains of additions
    int k = o.scalars.start[row];
    const int end = o.scalars.start[row + 1];
    for (; k + 1 < end; k += 2)
        for (int i = 0; i < 2; ++i) {
            load(o.x + 4 * o.scalars.column[k + i], x);
            sums[i] += o.scalars.value[k + i] * x;
        }
    if (k < end) {
        load(o.x + 4 * o.scalars.column[k], x);
        sums[0] += o.scalars.value[k] * x;
    }
    sum.first += o.besideFactor * (sums[0] + sums[1]);
}

/// Rows begin to end - 1 of y, three numbers each.
template <class Column>
JACKET_KERNEL void multiplyKernel(const Operands<Column>& operands, int begin, int end, double* y) {
    const Operands<Column> o = operands;  // nobody writes there
    for (int i = begin; i < end; ++i) {
        RowSum sum;
        addProduct(o.diagonal + 9 * i, o.x + 4 * i, sum);
        for (int k = o.lowerStart[i]; k < o.lowerStart[i + 1]; ++k)
            addProduct(o.lower + 9 * k, o.x + 4 * o.lowerColumn[k], sum);
        for (int k = o.upperStart[i]; k < o.upperStart[i + 1]; ++k)
            addTransposedProduct(o.lower + 9 * o.upperSlot[k], o.x + 4 * o.upperRow[k], sum);
        if (o.scalars.value) addBeside(o, i, sum);
        const Double4* const p = sum.parts;
        y[3 * i] = sum.first[0] + sum.last[1] + (p[0][0] + p[0][1] + p[0][2]);
        y[3 * i + 1] = sum.first[1] + sum.last[2] + (p[1][0] + p[1][1] + p[1][2]);
        y[3 * i + 2] = sum.first[2] + sum.last[3] + (p[2][1] + p[2][2] + p[2][3]);
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
    findUpper();
}

void BlockMatrix::findUpper() {
    m_upperStart.assign(size() + 1, 0);
    m_upperRow.resize(m_column.size());
    m_upperSlot.resize(m_column.size());
    for (const int column : m_column) ++m_upperStart[column + 1];
    for (int i = 0; i < size(); ++i) m_upperStart[i + 1] += m_upperStart[i];
    std::vector<int> next(m_upperStart.begin(), m_upperStart.end() - 1);
    for (int i = 0; i < size(); ++i)
        for (int k = rowBegin(i); k < rowEnd(i); ++k) {
            const int place = next[m_column[k]]++;
            m_upperRow[place] = i;
            m_upperSlot[place] = k;
        }
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

void BlockMatrix::multiply(const double* x, double* y, WorkerTeam* team) const {
    double* const inFours = padded();
    runRanges(team, size(), kBlockRowsAtATime, [&](int begin, int end) {
        for (int i = begin; i < end; ++i) std::copy_n(x + 3 * i, 3, inFours + 4 * i);
    });
    const auto multiplyWith = [&](const auto& scalars) {
        const Operands operands{m_rowStart.data(),
                                m_column.data(),
                                m_upperStart.data(),
                                m_upperRow.data(),
                                m_upperSlot.data(),
                                m_diagonal.data()->data(),
                                m_lower.empty() ? nullptr : m_lower.data()->data(),
                                scalars,
                                m_besideFactor,
                                inFours};
        runRanges(team, size(), kBlockRowsAtATime,
                  [&](int begin, int end) { multiplyKernel(operands, begin, end, y); });
    };
    if (!m_beside) return multiplyWith(ConstantHessian::Rows<int>{});
    m_beside->visit([&](const auto&, const auto& scalars) { multiplyWith(scalars); });
}

void BlockMatrix::addColumn(int vertex, const Vec3& change, double* y) const {
    const auto add = [&](int row, const Vec3& by) { Eigen::Map<Vec3>(y + 3 * row) += by; };
    add(vertex, m_diagonal[vertex] * change);
    for (int k = rowBegin(vertex); k < rowEnd(vertex); ++k) add(m_column[k], m_lower[k].transpose() * change);
    for (int k = m_upperStart[vertex]; k < m_upperStart[vertex + 1]; ++k)
        add(m_upperRow[k], m_lower[m_upperSlot[k]] * change);
    if (!m_beside) return;
    m_beside->visit([&](const auto&, const auto& scalars) {
        for (int k = scalars.start[vertex]; k < scalars.start[vertex + 1]; ++k)  // symmetric: a row is a column
            add(scalars.column[k], m_besideFactor * scalars.value[k] * change);
    });
}

}  // namespace jacket
