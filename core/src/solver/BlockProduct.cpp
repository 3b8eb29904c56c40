#include "solver/BlockProduct.h"

#include "Kernel.h"

namespace jacket {
namespace {

constexpr int kBlockRowsAtATime = 512;

template <class Column>
struct Blocks {
    const int *lowerStart, *lowerColumn, *upperStart, *upperRow, *upperSlot;
    const double *diagonal, *lower;         ///< nine numbers a block, by columns
    ConstantHessian::Rows<Column> scalars;  ///< beside; null: none
    double besideFactor;
};

template <class Column>
JACKET_KERNEL void multiplyKernel(const Blocks<Column>& blocks, int begin, int end, const double* x, double* y) {
    const Blocks<Column> b = blocks;  // nobody writes there
    for (int i = begin; i < end; ++i) {
        double sum[3], beside[3] = {};
        const double *d = b.diagonal + 9 * i, *xi = x + 3 * i;
        for (int c = 0; c < 3; ++c) sum[c] = d[c] * xi[0] + d[3 + c] * xi[1] + d[6 + c] * xi[2];
        for (int k = b.lowerStart[i]; k < b.lowerStart[i + 1]; ++k) {
            const double *a = b.lower + 9 * k, *xj = x + 3 * b.lowerColumn[k];
            for (int c = 0; c < 3; ++c) sum[c] += a[c] * xj[0] + a[3 + c] * xj[1] + a[6 + c] * xj[2];
        }
        for (int k = b.upperStart[i]; k < b.upperStart[i + 1]; ++k) {
            const double *a = b.lower + 9 * b.upperSlot[k], *xj = x + 3 * b.upperRow[k];
            for (int c = 0; c < 3; ++c) sum[c] += a[3 * c] * xj[0] + a[3 * c + 1] * xj[1] + a[3 * c + 2] * xj[2];
        }
        if (b.scalars.value)
            for (int k = b.scalars.start[i]; k < b.scalars.start[i + 1]; ++k)
                for (int c = 0; c < 3; ++c) beside[c] += b.scalars.value[k] * x[3 * b.scalars.column[k] + c];
        for (int c = 0; c < 3; ++c) y[3 * i + c] = sum[c] + b.besideFactor * beside[c];
    }
}

}  // namespace

BlockProduct::BlockProduct(const BlockMatrix& matrix)
    : m_upperStart(matrix.size() + 1, 0), m_upperRow(matrix.lower().size()), m_upperSlot(matrix.lower().size()) {
    for (const int column : matrix.columns()) ++m_upperStart[column + 1];
    for (int i = 0; i < matrix.size(); ++i) m_upperStart[i + 1] += m_upperStart[i];
    std::vector<int> next(m_upperStart.begin(), m_upperStart.end() - 1);
    for (int i = 0; i < matrix.size(); ++i)
        for (int k = matrix.rowBegin(i); k < matrix.rowEnd(i); ++k) {
            const int place = next[matrix.column(k)]++;
            m_upperRow[place] = i;
            m_upperSlot[place] = k;
        }
}

void BlockProduct::multiply(const BlockMatrix& matrix, const double* x, double* y, WorkerTeam* team) const {
    const auto multiplyWith = [&](const auto& scalars) {
        const Blocks blocks{matrix.rowStarts().data(),
                            matrix.columns().data(),
                            m_upperStart.data(),
                            m_upperRow.data(),
                            m_upperSlot.data(),
                            matrix.diagonal().data()->data(),
                            matrix.lower().empty() ? nullptr : matrix.lower().data()->data(),
                            scalars,
                            matrix.besideFactor()};
        runRanges(team, matrix.size(), kBlockRowsAtATime,
                  [&](int begin, int end) { multiplyKernel(blocks, begin, end, x, y); });
    };
    if (!matrix.beside()) return multiplyWith(ConstantHessian::Rows<int>{});
    matrix.beside()->visit([&](const auto&, const auto& scalars) { multiplyWith(scalars); });
}

void BlockProduct::addColumn(const BlockMatrix& matrix, int vertex, const Vec3& change, double* y) const {
    const auto add = [&](int row, const Vec3& by) { Eigen::Map<Vec3>(y + 3 * row) += by; };
    add(vertex, matrix.diagonal()[vertex] * change);
    for (int k = matrix.rowBegin(vertex); k < matrix.rowEnd(vertex); ++k)
        add(matrix.column(k), matrix.lower()[k].transpose() * change);
    for (int k = m_upperStart[vertex]; k < m_upperStart[vertex + 1]; ++k)
        add(m_upperRow[k], matrix.lower()[m_upperSlot[k]] * change);
    if (!matrix.beside()) return;
    matrix.beside()->visit([&](const auto&, const auto& scalars) {
        for (int k = scalars.start[vertex]; k < scalars.start[vertex + 1]; ++k)  // symmetric: a row is a column
            add(scalars.column[k], matrix.besideFactor() * scalars.value[k] * change);
    });
}

}  // namespace jacket
