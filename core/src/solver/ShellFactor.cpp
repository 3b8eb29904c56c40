#include "solver/ShellFactor.h"

#include <algorithm>

namespace jacket {

/// The pattern never changes, so that the elimination is ordered once.
void ShellFactor::analyse(const BlockMatrix& matrix) {
    const int n = matrix.size();
    std::vector<std::vector<int>> rows(n);
    for (int i = 0; i < n; ++i) {
        rows[i].push_back(i);
        for (int k = matrix.rowBegin(i); k < matrix.rowEnd(i); ++k) rows[matrix.column(k)].push_back(i);
    }
    if (const ConstantHessian* beside = matrix.beside())
        for (int i = 0; i < n; ++i)
            for (ConstantHessian::InnerIterator entry(*beside, i); entry; ++entry)
                if (entry.col() < i) rows[entry.col()].push_back(i);
    m_columnStart.assign(1, 0);
    m_row.clear();
    for (auto& column : rows) {
        std::sort(column.begin(), column.end());
        column.erase(std::unique(column.begin(), column.end()), column.end());
        m_row.insert(m_row.end(), column.begin(), column.end());
        m_columnStart.push_back(static_cast<int>(m_row.size()));
    }
    m_lowerSlot.resize(matrix.lower().size());
    for (int i = 0; i < n; ++i)
        for (int k = matrix.rowBegin(i); k < matrix.rowEnd(i); ++k) m_lowerSlot[k] = slot(i, matrix.column(k));
    m_blocks.assign(m_row.size(), Mat3::Zero());
    m_pattern = &matrix;
    m_beside = matrix.beside();
    expand();
    m_factor.analyzePattern(m_matrix);
}

int ShellFactor::slot(int row, int column) const {
    const auto first = m_row.begin() + m_columnStart[column], last = m_row.begin() + m_columnStart[column + 1];
    return static_cast<int>(std::lower_bound(first, last, row) - m_row.begin());
}

/// Blocks to scalars, on and below the diagonal.
void ShellFactor::expand() {
    const int n = static_cast<int>(m_columnStart.size()) - 1;
    const bool isNew = m_matrix.cols() != 3 * n;
    if (isNew) {
        m_matrix.resize(3 * n, 3 * n);
        m_matrix.resizeNonZeros(static_cast<Eigen::Index>(9 * m_row.size() - 3 * static_cast<std::size_t>(n)));
    }
    int next = 0;
    for (int column = 0; column < n; ++column)
        for (int c = 0; c < 3; ++c) {
            m_matrix.outerIndexPtr()[3 * column + c] = next;
            for (int k = m_columnStart[column]; k < m_columnStart[column + 1]; ++k)
                for (int r = m_row[k] == column ? c : 0; r < 3; ++r, ++next) {
                    m_matrix.innerIndexPtr()[next] = 3 * m_row[k] + r;
                    m_matrix.valuePtr()[next] = m_blocks[k](r, c);
                }
        }
    m_matrix.outerIndexPtr()[3 * n] = next;
}

bool ShellFactor::factor(const BlockMatrix& matrix, const std::vector<Mat3>& diagonal, const std::vector<Mat3>& lower,
                         const std::vector<const Mat3*>& free) {
    if (m_pattern != &matrix || m_beside != matrix.beside()) analyse(matrix);
    std::fill(m_blocks.begin(), m_blocks.end(), Mat3::Zero());
    for (int i = 0; i < matrix.size(); ++i) m_blocks[m_columnStart[i]] = diagonal[i];
    for (std::size_t k = 0; k < lower.size(); ++k) m_blocks[m_lowerSlot[k]] += lower[k];
    for (int i = 0; m_beside && i < matrix.size(); ++i)
        for (ConstantHessian::InnerIterator entry(*m_beside, i); entry; ++entry) {
            const int j = static_cast<int>(entry.col());
            if (j > i) continue;
            Mat3 block = matrix.besideFactor() * entry.value() * Mat3::Identity();
            if (free[i]) block = *free[i] * block;
            if (free[j]) block = block * *free[j];
            m_blocks[slot(i, j)] += block;
        }
    expand();
    m_factor.factorize(m_matrix);
    return m_factor.info() == Eigen::Success && (m_factor.vectorD().array() > 0.0).all();
}

void ShellFactor::apply(const double* r, double* z) const {
    const Eigen::Index size = m_matrix.cols();
    Eigen::Map<Eigen::VectorXd>(z, size) = m_factor.solve(Eigen::Map<const Eigen::VectorXd>(r, size));
}

}  // namespace jacket
