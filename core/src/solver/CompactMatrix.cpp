#include "solver/CompactMatrix.h"

#include <algorithm>
#include <numeric>

#include "Kernel.h"

namespace jacket {
namespace {

using Neighbours = std::vector<std::vector<int>>;

Neighbours neighboursIn(const BlockMatrix& matrix) {
    Neighbours result(matrix.size());
    for (int i = 0; i < matrix.size(); ++i)
        for (int k = matrix.rowBegin(i); k < matrix.rowEnd(i); ++k) {
            result[i].push_back(matrix.column(k));
            result[matrix.column(k)].push_back(i);
        }
    return result;
}

/// Appends what `start` is connected to, layer by layer, each layer's vertices by rising degree; returns where the last
/// layer begins.
std::size_t appendLayers(const Neighbours& neighbours, int start, std::vector<char>& seen, std::vector<int>& order) {
    std::size_t done = order.size(), layer = done;
    order.push_back(start);
    seen[start] = 1;
    for (std::size_t layerEnd = order.size(); done < order.size(); ++done) {
        if (done == layerEnd) {
            layer = done;
            layerEnd = order.size();
        }
        const std::size_t first = order.size();
        for (const int next : neighbours[order[done]])
            if (!seen[next]) {
                seen[next] = 1;
                order.push_back(next);
            }
        std::stable_sort(order.begin() + static_cast<std::ptrdiff_t>(first), order.end(),
                         [&](int a, int b) { return neighbours[a].size() < neighbours[b].size(); });
    }
    return layer;
}

/// Vertices by reverse Cuthill-McKee (George & Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981),
/// each part of the mesh from a vertex that is far from another.
std::vector<int> cuthillMcKee(const Neighbours& neighbours) {
    std::vector<int> order;
    std::vector<char> seen(neighbours.size());
    for (int first = 0; first < static_cast<int>(neighbours.size()); ++first) {
        if (seen[first]) continue;
        const std::size_t begin = order.size();
        int start = first;
        for (int pass = 0; pass < 3; ++pass) {  // the first ones only look for a far vertex
            for (std::size_t k = begin; k < order.size(); ++k) seen[order[k]] = 0;
            order.resize(begin);
            const std::size_t last = appendLayers(neighbours, start, seen, order);
            if (pass < 2) start = order[last];
        }
    }
    std::reverse(order.begin(), order.end());
    return order;
}

/// The same order but for steps that do not need one another: vertices by the length of the longest chain of earlier
/// neighbours. An incomplete factor stays the same; a processor can work on several rows at once.
std::vector<int> rowsByLevel(const Neighbours& neighbours, const std::vector<int>& order) {
    std::vector<int> place(order.size()), level(order.size()), rowOf(order.size());
    for (std::size_t k = 0; k < order.size(); ++k) place[order[k]] = static_cast<int>(k);
    for (const int i : order)
        for (const int j : neighbours[i])
            if (place[j] < place[i]) level[i] = std::max(level[i], level[j] + 1);
    std::vector<int> sorted = order;
    std::stable_sort(sorted.begin(), sorted.end(), [&](int a, int b) { return level[a] < level[b]; });
    for (std::size_t k = 0; k < sorted.size(); ++k) rowOf[sorted[k]] = static_cast<int>(k);
    return rowOf;
}

JACKET_KERNEL void multiplyKernel(const CompactMatrix::View& view, const float* x, float* y) {
    const CompactMatrix::View a = view;  // nobody writes there
    for (int i = 0; i < a.size; ++i) {
        const Float4 xi = load4(x + 4 * i);
        Float4 sum = times(a.rowSums + 9 * i, xi), other{};
        for (int k = a.rowStart[i]; k < a.rowStart[i + 1]; ++k)
            sum += times(a.blocks + 9 * k, load4(x + 4 * a.column[k]) - xi);
        for (int k = a.besideStart[i]; k < a.besideStart[i + 1]; ++k) {
            float* yj = y + 4 * a.besideColumn[k];  // an earlier row: already written
            const Float4 pull = a.beside[k] * a.besideFactor * (load4(x + 4 * a.besideColumn[k]) - xi);
            other += pull;
            store4(yj, load4(yj) - pull);
        }
        store4(y + 4 * i, xyz0(sum) + other);
    }
}

}  // namespace

CompactMatrix::CompactMatrix(const BlockMatrix& matrix) : m_size(matrix.size()) {
    const Neighbours neighbours = neighboursIn(matrix);
    m_rowOf = rowsByLevel(neighbours, cuthillMcKee(neighbours));
    std::vector<int> vertexOf(m_size);
    for (int i = 0; i < m_size; ++i) vertexOf[m_rowOf[i]] = i;
    m_rowStart.assign(1, 0);
    for (int row = 0; row < m_size; ++row) {
        const int i = vertexOf[row];
        const auto first = static_cast<std::ptrdiff_t>(m_column.size());
        for (const int j : neighbours[i]) m_column.push_back(m_rowOf[j]);
        std::sort(m_column.begin() + first, m_column.end());
        for (auto k = static_cast<std::size_t>(first); k < m_column.size(); ++k) {
            const int j = vertexOf[m_column[k]];
            m_source.push_back(i > j ? matrix.slot(i, j) : ~matrix.slot(j, i));
        }
        m_rowStart.push_back(static_cast<int>(m_column.size()));
    }
    m_blocks.assign(9 * m_column.size() + 3, 0.0f);
    m_rowSums.assign(9 * m_size + 3, 0.0f);
    m_besideStart.assign(m_size + 1, 0);
    m_besideSums.assign(m_size, 0.0);
}

void CompactMatrix::takeBeside(const ConstantHessian* scalars) {
    m_besideSource = scalars;
    m_besideCount = scalars ? scalars->nonZeros() : 0;
    m_besideStart.assign(m_size + 1, 0);
    m_besideSums.assign(m_size, 0.0);
    m_besideColumn.clear();
    m_beside.clear();
    if (!scalars) return;
    std::vector<int> vertexOf(m_size);
    for (int i = 0; i < m_size; ++i) vertexOf[m_rowOf[i]] = i;
    std::vector<std::pair<int, float>> entries;
    for (int row = 0; row < m_size; ++row) {
        entries.clear();
        for (ConstantHessian::InnerIterator it(*scalars, vertexOf[row]); it; ++it) {
            const int column = m_rowOf[it.col()];
            m_besideSums[row] += it.value();
            if (column < row) entries.emplace_back(column, static_cast<float>(it.value()));
        }
        std::sort(entries.begin(), entries.end());
        for (const auto& [column, value] : entries) {
            m_besideColumn.push_back(column);
            m_beside.push_back(value);
        }
        m_besideStart[row + 1] = static_cast<int>(m_beside.size());
    }
}

bool CompactMatrix::setValues(const BlockMatrix& matrix) {
    const Eigen::Index count = matrix.beside() ? matrix.beside()->nonZeros() : 0;
    const bool isNew = matrix.beside() != m_besideSource || count != m_besideCount;
    if (isNew) takeBeside(matrix.beside());
    m_besideFactor = matrix.besideFactor();
    for (int i = 0; i < m_size; ++i) {
        const int row = m_rowOf[i];
        Mat3 sum = matrix.diagonal()[i];
        sum.diagonal().array() += matrix.besideFactor() * m_besideSums[row];
        for (int k = m_rowStart[row]; k < m_rowStart[row + 1]; ++k) {
            const int source = m_source[k];
            const Mat3 block = source >= 0 ? matrix.lower()[source] : Mat3(matrix.lower()[~source].transpose());
            sum += block;
            Eigen::Map<Eigen::Matrix3f>(m_blocks.data() + 9 * k) = block.cast<float>();
        }
        Eigen::Map<Eigen::Matrix3f>(m_rowSums.data() + 9 * row) = sum.cast<float>();
    }
    return isNew;
}

void CompactMatrix::multiply(const float* x, float* y) const {
    multiplyKernel(view(), x, y);
}

}  // namespace jacket
