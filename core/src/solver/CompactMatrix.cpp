#include "solver/CompactMatrix.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

#include "Kernel.h"

namespace jacket {
namespace {

constexpr int kRowsAtATime = 512;

using Neighbours = std::vector<std::vector<int>>;

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

/// Vertices in the order of elimination, and how many parts of it there are (see CompactMatrix::stripCount).
struct Division {
    int strips = 1;
    std::vector<int> order;
    std::vector<int> partOf;  ///< each vertex
};

/// How many strips a shell is cut into: the same for any number of threads. Each costs some iterations.
int stripCountOf(int size, int bandwidth) {
    constexpr int kLeastSize = 2500, kRowsAStrip = 5000, kMostStrips = 8;
    constexpr int kLeastWidth = 4;  // in bandwidths: at two, separators may meet
    if (size < kLeastSize) return 1;
    return std::min(std::clamp(size / kRowsAStrip, 2, kMostStrips), std::max(1, size / (kLeastWidth * bandwidth)));
}

/// Cuts an order into strips of as many vertices. What has a neighbour in the next strip is a separator, and comes
/// last. A strip is taken from where it is farthest from any of them, which spares more iterations than it costs to be
/// cut.
Division divide(const Neighbours& neighbours, const std::vector<int>& order) {
    const int n = static_cast<int>(order.size());
    std::vector<int> place(n), rank(n);
    for (int k = 0; k < n; ++k) place[order[k]] = k;
    int bandwidth = 1;
    for (int i = 0; i < n; ++i)
        for (const int j : neighbours[i]) bandwidth = std::max(bandwidth, place[j] - place[i]);
    const int strips = stripCountOf(n, bandwidth);
    Division result{.strips = strips, .order = order, .partOf = std::vector<int>(n)};
    const auto begin = [&](std::int64_t strip) { return static_cast<int>(strip * n / strips); };
    for (int strip = 0; strip < strips; ++strip)
        for (int k = begin(strip); k < begin(strip + 1); ++k) {
            const auto& near = neighbours[order[k]];
            const bool isSeparator =
                std::any_of(near.begin(), near.end(), [&](int j) { return place[j] >= begin(strip + 1); });
            const int fromLast = strip > 0 ? k - begin(strip) : n;
            const int toNext = strip < strips - 1 ? begin(strip + 1) - k : n;
            result.partOf[order[k]] = isSeparator ? strips + strip : strip;
            rank[order[k]] = isSeparator ? 0 : -std::min(fromLast, toNext);
        }
    std::stable_sort(result.order.begin(), result.order.end(), [&](int a, int b) {
        return std::pair(result.partOf[a], rank[a]) < std::pair(result.partOf[b], rank[b]);
    });
    return result;
}

/// The same order but for steps that do not need one another: in each part, vertices by the length of the longest chain
/// of earlier neighbours. An incomplete factor stays the same; a processor can work on several rows at once.
void sortByLevel(const Neighbours& neighbours, Division& division) {
    std::vector<int>& order = division.order;
    const std::vector<int>& part = division.partOf;
    std::vector<int> place(order.size()), level(order.size());
    for (std::size_t k = 0; k < order.size(); ++k) place[order[k]] = static_cast<int>(k);
    for (const int i : order)
        for (const int j : neighbours[i])
            if (part[j] == part[i] && place[j] < place[i]) level[i] = std::max(level[i], level[j] + 1);
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return std::pair(part[a], level[a]) < std::pair(part[b], level[b]); });
}

/// `source`: see CompactMatrix::Pattern.
JACKET_INLINE Mat3 blockFrom(const BlockMatrix& matrix, int source) {
    return source >= 0 ? matrix.lower()[source] : Mat3(matrix.lower()[~source].transpose());
}

template <class Column>
JACKET_KERNEL void multiplyKernel(const CompactMatrix::View& view, const Column* besideColumn, int begin, int end,
                                  const float* x, float* y) {
    const CompactMatrix::View a = view;  // nobody writes there
    const CompactMatrix::Pattern& p = a.pattern;
    for (int i = begin; i < end; ++i) {
        const Float4 xi = load4(x + 4 * i);
        Float4 sum = times(a.rowSums + 9 * i, xi), even{}, odd{};  // two sums: shorter chains of additions
        for (int k = p.lowerStart[i]; k < p.lowerStart[i + 1]; ++k)
            sum += times(a.blocks + 9 * k, load4(x + 4 * p.lowerColumn[k]) - xi);
        for (int k = p.upperStart[i]; k < p.upperStart[i + 1]; ++k)
            sum += timesTransposed(a.blocks + 9 * p.upperBlock[k], load4(x + 4 * p.upperColumn[k]) - xi);
        int k = a.besideStart[i];
        const int besideEnd = a.besideStart[i + 1];
        for (; k + 1 < besideEnd; k += 2) {
            even += a.beside[k] * (load4(x + 4 * besideColumn[k]) - xi);
            odd += a.beside[k + 1] * (load4(x + 4 * besideColumn[k + 1]) - xi);
        }
        if (k < besideEnd) even += a.beside[k] * (load4(x + 4 * besideColumn[k]) - xi);
        store4(y + 4 * i, xyz0(sum) + a.besideFactor * (even + odd));
    }
}

}  // namespace

CompactMatrix::CompactMatrix(const BlockMatrix& matrix) : m_size(matrix.size()) {
    const Neighbours neighbours = matrix.neighbours();
    Division division = divide(neighbours, cuthillMcKee(neighbours));
    sortByLevel(neighbours, division);
    m_partStart.assign(2 * division.strips, 0);
    for (const int part : division.partOf) ++m_partStart[part + 1];
    std::partial_sum(m_partStart.begin(), m_partStart.end(), m_partStart.begin());
    m_vertexOf = std::move(division.order);
    m_rowOf.resize(m_size);
    for (int row = 0; row < m_size; ++row) m_rowOf[m_vertexOf[row]] = row;
    takePattern(matrix, neighbours);
    m_blocks.assign(9 * m_lowerColumn.size() + 3, 0.0f);
    m_rowSums.assign(9 * m_size + 3, 0.0f);
    m_besideStart.assign(m_size + 1, 0);
    m_besideSums.assign(m_size, 0.0);
}

void CompactMatrix::takePattern(const BlockMatrix& matrix, const Neighbours& neighbours) {
    const std::size_t count = matrix.lower().size();
    for (auto* perBlock : {&m_lowerColumn, &m_source, &m_upperColumn}) perBlock->reserve(count);
    m_upperBlock.resize(count);
    for (auto* perRow : {&m_lowerStart, &m_upperStart}) perRow->assign(m_size + 1, 0);
    std::vector<int> columns;
    for (int row = 0; row < m_size; ++row) {
        columns.clear();
        for (const int j : neighbours[m_vertexOf[row]]) columns.push_back(m_rowOf[j]);
        std::sort(columns.begin(), columns.end());
        for (const int column : columns) (column < row ? m_lowerColumn : m_upperColumn).push_back(column);
        m_lowerStart[row + 1] = static_cast<int>(m_lowerColumn.size());
        m_upperStart[row + 1] = static_cast<int>(m_upperColumn.size());
    }
    std::vector<int> next(m_upperStart.begin(), m_upperStart.end() - 1);
    for (int row = 0; row < m_size; ++row)
        for (int k = m_lowerStart[row]; k < m_lowerStart[row + 1]; ++k) {
            const int i = m_vertexOf[row], j = m_vertexOf[m_lowerColumn[k]];
            m_source.push_back(i > j ? matrix.slot(i, j) : ~matrix.slot(j, i));
            m_upperBlock[next[m_lowerColumn[k]]++] = k;
        }
}

void CompactMatrix::takeBeside(const ConstantHessian* scalars) {
    m_besideSource = scalars;
    m_besideCount = scalars ? scalars->besideCount() : 0;
    m_besideStart.assign(m_size + 1, 0);
    m_besideSums.assign(m_size, 0.0);
    m_besideColumn.begin(m_size, m_besideCount);
    m_beside.clear();
    if (!scalars) return;
    m_beside.reserve(m_besideCount);
    std::vector<std::pair<int, float>> entries;
    scalars->visit([&](const auto&, const auto& from) {
        for (int row = 0; row < m_size; ++row) {
            entries.clear();
            const int vertex = m_vertexOf[row];
            for (int k = from.start[vertex]; k < from.start[vertex + 1]; ++k) {
                m_besideSums[row] += from.value[k];
                entries.emplace_back(m_rowOf[from.column[k]], static_cast<float>(from.value[k]));
            }
            std::sort(entries.begin(), entries.end());
            for (const auto& [column, value] : entries) {
                m_besideColumn.push_back(column);
                m_beside.push_back(value);
            }
            m_besideStart[row + 1] = static_cast<int>(m_beside.size());
        }
    });
}

bool CompactMatrix::setValues(const BlockMatrix& matrix, WorkerTeam* team) {
    const std::size_t count = matrix.beside() ? matrix.beside()->besideCount() : 0;
    const bool isNew = matrix.beside() != m_besideSource || count != m_besideCount;
    if (isNew) takeBeside(matrix.beside());
    m_besideFactor = matrix.besideFactor();
    runRanges(team, m_size, kRowsAtATime, [&](int begin, int end) { takeRows(matrix, begin, end); });
    return isNew;
}

void CompactMatrix::takeRows(const BlockMatrix& matrix, int begin, int end) {
    for (int row = begin; row < end; ++row) {
        Mat3 sum = matrix.diagonal()[m_vertexOf[row]];
        sum.diagonal().array() += matrix.besideFactor() * m_besideSums[row];
        for (int k = m_lowerStart[row]; k < m_lowerStart[row + 1]; ++k) {
            const Mat3 block = blockFrom(matrix, m_source[k]);
            sum += block;
            Eigen::Map<Eigen::Matrix3f>(m_blocks.data() + 9 * k) = block.cast<float>();
        }
        for (int k = m_upperStart[row]; k < m_upperStart[row + 1]; ++k)
            sum += blockFrom(matrix, ~m_source[m_upperBlock[k]]);
        Eigen::Map<Eigen::Matrix3f>(m_rowSums.data() + 9 * row) = sum.cast<float>();
    }
}

void CompactMatrix::multiply(const float* x, float* y, WorkerTeam* team) const {
    m_besideColumn.visit([&](const auto* columns) {
        runRanges(team, m_size, kRowsAtATime,
                  [&](int begin, int end) { multiplyKernel(view(), columns, begin, end, x, y); });
    });
}

}  // namespace jacket
