#include "solver/BlockFactor.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

#include <algorithm>

#include "Kernel.h"

namespace jacket {

std::vector<int> eliminationOrder(const std::vector<std::vector<int>>& neighbours) {
    const int size = static_cast<int>(neighbours.size());
    std::vector<Eigen::Triplet<double>> entries;
    for (int i = 0; i < size; ++i) {
        entries.emplace_back(i, i, 1.0);  // the ordering puts rows without a diagonal last, as if they were dense
        for (const int j : neighbours[i]) entries.emplace_back(i, j, 1.0);
    }
    Eigen::SparseMatrix<double> pattern(size, size);
    pattern.setFromTriplets(entries.begin(), entries.end());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
    Eigen::AMDOrdering<int>()(pattern, order);
    std::vector<int> place(size);
    for (int k = 0; k < size; ++k) place[order.indices()[k]] = k;
    return place;
}

namespace {

/// Inverse of a symmetric positive semi-definite block, without the directions that have less than `least` left of the
/// stiffness that they had before the elimination. False if there are any.
JACKET_INLINE bool invertBlock(const double* a, const double* original, double least, double* inverse) {
    constexpr int m = BlockFactor::kRows;
    double l[m][m], root[m][m];  // root: D^-1/2 L^-1
    double pivot[m];
    bool isWhole = true;
    for (int i = 0; i < m; ++i) {
        for (int j = 0; j < i; ++j) {
            double sum = a[m * j + i];
            for (int k = 0; k < j; ++k) sum -= l[i][k] * l[j][k] * pivot[k];
            l[i][j] = pivot[j] > 0.0 ? sum / pivot[j] : 0.0;
        }
        pivot[i] = a[m * i + i];
        for (int k = 0; k < i; ++k) pivot[i] -= l[i][k] * l[i][k] * pivot[k];
        if (pivot[i] > least * original[i]) continue;
        pivot[i] = 0.0;
        isWhole = false;
    }
    for (int i = 0; i < m; ++i) {
        for (int j = 0; j < m; ++j) {
            root[i][j] = i == j ? 1.0 : 0.0;
            for (int k = j; k < i; ++k) root[i][j] -= l[i][k] * root[k][j];
        }
    }
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < m; ++j) {
            double sum = 0.0;
            for (int k = std::max(i, j); k < m; ++k)
                if (pivot[k] > 0.0) sum += root[k][i] * root[k][j] / pivot[k];
            inverse[m * j + i] = sum;
        }
    return isWhole;
}

struct Elimination {
    int size;
    const int *columnStart, *row;
    double *values, *inverse, *scaled;
    double least;
};

/// c = a b
JACKET_INLINE void multiplyBlocks(const double* a, const double* b, double* c) {
    constexpr int m = BlockFactor::kRows;
    for (int column = 0; column < m; ++column) {
        double sum[m] = {};
        for (int k = 0; k < m; ++k)
            for (int i = 0; i < m; ++i) sum[i] += a[m * k + i] * b[m * column + k];
        for (int i = 0; i < m; ++i) c[m * column + i] = sum[i];
    }
}

/// c -= a b^T
JACKET_INLINE void subtractTransposed(const double* a, const double* b, double* c) {
    constexpr int m = BlockFactor::kRows;
    for (int column = 0; column < m; ++column) {
        double sum[m];
        for (int i = 0; i < m; ++i) sum[i] = c[m * column + i];
        for (int k = 0; k < m; ++k)
            for (int i = 0; i < m; ++i) sum[i] -= a[m * k + i] * b[m * k + column];
        for (int i = 0; i < m; ++i) c[m * column + i] = sum[i];
    }
}

JACKET_KERNEL bool eliminate(const Elimination& e) {
    constexpr int m = BlockFactor::kRows, size = BlockFactor::kSize;
    double* lower = e.values + size * e.size;
    bool isWhole = true;
    for (int j = 0; j < e.size; ++j)  // the scaled blocks' memory holds what the pivots are measured against
        for (int i = 0; i < m; ++i) e.inverse[size * j + i] = e.values[size * j + (m + 1) * i];
    for (int j = 0; j < e.size; ++j) {
        double original[m], *inverse = e.inverse + size * j;
        for (int i = 0; i < m; ++i) original[i] = inverse[i];
        isWhole = invertBlock(e.values + size * j, original, e.least, inverse) && isWhole;
        const int begin = e.columnStart[j], end = e.columnStart[j + 1];
        for (int k = begin; k < end; ++k) multiplyBlocks(lower + size * k, inverse, e.scaled + size * (k - begin));
        for (int k = begin; k < end; ++k) {
            const int column = e.row[k];
            const double* scaled = e.scaled + size * (k - begin);
            subtractTransposed(lower + size * k, scaled, e.values + size * column);
            int target = e.columnStart[column];
            for (int below = k + 1; below < end; ++below) {
                while (e.row[target] < e.row[below]) ++target;
                subtractTransposed(lower + size * below, scaled, lower + size * target);
            }
        }
        for (int k = size * begin; k < size * end; ++k) lower[k] = e.scaled[k - size * begin];
    }
    return isWhole;
}

struct Substitution {
    int size;
    const int *columnStart, *row;
    const double *lower, *inverse;
};

JACKET_KERNEL void substitute(const Substitution& s, double* x) {
    constexpr int m = BlockFactor::kRows, size = BlockFactor::kSize;
    for (int j = 0; j < s.size; ++j)
        for (int k = s.columnStart[j]; k < s.columnStart[j + 1]; ++k) {
            const double *block = s.lower + size * k, *from = x + m * j;
            double sum[m] = {}, *to = x + m * s.row[k];
            for (int c = 0; c < m; ++c)
                for (int i = 0; i < m; ++i) sum[i] += block[m * c + i] * from[c];
            for (int i = 0; i < m; ++i) to[i] -= sum[i];
        }
    for (int j = s.size - 1; j >= 0; --j) {
        double sum[m] = {};
        const double* inverse = s.inverse + size * j;
        for (int c = 0; c < m; ++c)
            for (int i = 0; i < m; ++i) sum[i] += inverse[m * c + i] * x[m * j + c];
        for (int k = s.columnStart[j]; k < s.columnStart[j + 1]; ++k) {
            const double *block = s.lower + size * k, *from = x + m * s.row[k];
            for (int i = 0; i < m; ++i)
                for (int c = 0; c < m; ++c) sum[i] -= block[m * i + c] * from[c];
        }
        for (int i = 0; i < m; ++i) x[m * j + i] = sum[i];
    }
}

}  // namespace

BlockFactor::BlockFactor(const std::vector<std::vector<int>>& neighbours) : m_columnStart(1, 0) {
    const int n = static_cast<int>(neighbours.size());
    std::vector<std::vector<int>> columns(n), children(n);
    std::vector<int> mark(n, -1);
    std::size_t longest = 0;
    for (int j = 0; j < n; ++j) {  // a column has its own blocks and those of the columns that are eliminated into it
        const auto add = [&](int row) {
            if (row <= j || mark[row] == j) return;
            mark[row] = j;
            columns[j].push_back(row);
        };
        for (const int i : neighbours[j]) add(i);
        for (const int child : children[j])
            for (const int row : columns[child]) add(row);
        std::sort(columns[j].begin(), columns[j].end());
        if (!columns[j].empty()) children[columns[j][0]].push_back(j);
        m_row.insert(m_row.end(), columns[j].begin(), columns[j].end());
        m_columnStart.push_back(static_cast<int>(m_row.size()));
        longest = std::max(longest, columns[j].size());
    }
    m_values.assign(static_cast<std::size_t>(kSize) * blockCount(), 0.0);
    m_inverse.assign(static_cast<std::size_t>(kSize) * n, 0.0);
    m_scaled.assign(kSize * longest, 0.0);
}

int BlockFactor::index(int row, int column) const {
    if (row <= column) return row == column ? row : -1;
    const auto begin = m_row.begin() + m_columnStart[column], end = m_row.begin() + m_columnStart[column + 1];
    return size() + static_cast<int>(std::lower_bound(begin, end, row) - m_row.begin());
}

void BlockFactor::setZero() {
    std::fill(m_values.begin(), m_values.end(), 0.0);
}

bool BlockFactor::factor(double least) {
    return eliminate(
        {size(), m_columnStart.data(), m_row.data(), m_values.data(), m_inverse.data(), m_scaled.data(), least});
}

void BlockFactor::solve(double* x) const {
    substitute({size(), m_columnStart.data(), m_row.data(), m_values.data() + kSize * size(), m_inverse.data()}, x);
}

}  // namespace jacket
