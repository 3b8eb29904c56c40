#include "solver/ShellFactor.h"

#include <algorithm>

namespace jacket {
namespace {

constexpr double kLeast = 1e-14;  ///< of a direction's stiffness: less left over is rounding

using Neighbours = std::vector<std::vector<int>>;

/// Calls `visit(i, j, k)`, i > j, for block k of a matrix.
void forLower(const BlockMatrix& matrix, const auto& visit) {
    for (int i = 0; i < matrix.size(); ++i)
        for (int k = matrix.rowBegin(i); k < matrix.rowEnd(i); ++k) visit(i, matrix.column(k), k);
}

/// A number for every vertex, the same for two that share a block of the matrix; each of the two has the fewest others
/// to go with. A few are left alone.
std::vector<int> pairUp(const BlockMatrix& matrix) {
    const int n = matrix.size();
    const Neighbours neighbours = matrix.neighbours();
    std::vector<int> pairOf(n, -1), open(n);
    for (int i = 0; i < n; ++i) open[i] = static_cast<int>(neighbours[i].size());
    int pairs = 0;
    for (int i = 0; i < n; ++i) {
        if (pairOf[i] >= 0) continue;
        int mate = i;
        for (const int j : neighbours[i])
            if (pairOf[j] < 0 && (mate == i || open[j] < open[mate])) mate = j;
        for (const int taken : {i, mate}) {
            pairOf[taken] = pairs;
            for (const int j : neighbours[taken]) --open[j];
        }
        ++pairs;
    }
    return pairOf;
}

}  // namespace

/// Another matrix may stand where one was; of the same size, it is one of the same mesh.
bool ShellFactor::isOf(const BlockMatrix& matrix) const {
    const std::size_t count = matrix.beside() ? matrix.beside()->besideCount() : 0;
    return m_pattern == &matrix && m_beside == matrix.beside() && m_besideCount == count &&
           m_slot.size() == matrix.diagonal().size() && m_lowerPlace.size() == matrix.lower().size();
}

/// The pattern never changes, so that the elimination is ordered once.
void ShellFactor::analyse(const BlockMatrix& matrix) {
    m_pattern = &matrix;
    m_beside = matrix.beside();
    m_besideCount = m_beside ? m_beside->besideCount() : 0;
    const std::vector<int> pairOf = pairUp(matrix);
    const int pairs = 1 + *std::max_element(pairOf.begin(), pairOf.end());
    Neighbours neighbours(pairs), ordered(pairs);
    const auto join = [&](int i, int j, auto) {
        const int a = pairOf[i], b = pairOf[j];
        if (a == b) return;
        neighbours[a].push_back(b);
        neighbours[b].push_back(a);
    };
    forLower(matrix, join);
    forBeside(matrix, join);
    for (auto& list : neighbours) {
        std::sort(list.begin(), list.end());
        list.erase(std::unique(list.begin(), list.end()), list.end());
    }
    const std::vector<int> order = eliminationOrder(neighbours);
    for (int a = 0; a < pairs; ++a)
        for (const int b : neighbours[a]) ordered[order[a]].push_back(order[b]);
    m_factor.emplace(ordered);
    m_x.assign(static_cast<std::size_t>(BlockFactor::kRows) * pairs, 0.0);

    std::vector<int> taken(pairs, 0);
    m_slot.clear();
    for (const int pair : pairOf) m_slot.push_back(2 * order[pair] + taken[pair]++);
    m_free.clear();
    for (int pair = 0; pair < pairs; ++pair)
        if (taken[pair] < 2) m_free.push_back(2 * order[pair] + 1);
    m_lowerPlace.clear();
    m_besidePlace.clear();
    forLower(matrix, [&](int i, int j, int) { m_lowerPlace.push_back(placeOf(i, j)); });
    forBeside(matrix, [&](int i, int j, double) { m_besidePlace.push_back(placeOf(i, j)); });
}

int ShellFactor::placeOf(int i, int j) const {
    int row = m_slot[i], column = m_slot[j];
    const bool isTransposed = row < column;
    if (isTransposed) std::swap(row, column);
    const int place = BlockFactor::kSize * m_factor->index(row / 2, column / 2) +
                      3 * BlockFactor::kRows * (column % 2) + 3 * (row % 2);
    return isTransposed ? ~place : place;
}

void ShellFactor::add(int place, const Mat3& block) {
    using Part = Eigen::Map<Mat3, Eigen::Unaligned, Eigen::OuterStride<BlockFactor::kRows>>;
    double* const values = m_factor->block(0);
    if (place >= 0)
        Part(values + place) += block;
    else
        Part(values + ~place) += block.transpose();
}

bool ShellFactor::factor(const FilteredMatrix& filtered, const std::vector<const Mat3*>& free) {
    const BlockMatrix& matrix = filtered.pattern();
    if (!isOf(matrix)) analyse(matrix);
    m_factor->setZero();
    for (int i = 0; i < matrix.size(); ++i) add(placeOf(i, i), filtered.diagonal(i));
    for (std::size_t k = 0; k < m_lowerPlace.size(); ++k) add(m_lowerPlace[k], filtered.lower(static_cast<int>(k)));
    auto place = m_besidePlace.begin();
    forBeside(matrix, [&](int i, int j, double value) {
        Mat3 block = matrix.besideFactor() * value * Mat3::Identity();
        if (free[i]) block = *free[i] * block;
        if (free[j]) block = block * *free[j];
        add(*place++, block);
    });
    for (const int slot : m_free) Eigen::Map<Mat6>(m_factor->block(slot / 2)).diagonal().tail<3>().setOnes();
    return m_factor->factor(kLeast);
}

void ShellFactor::apply(const double* r, double* z) const {
    const int n = static_cast<int>(m_slot.size());
    for (int i = 0; i < n; ++i) Eigen::Map<Vec3>(m_x.data() + 3 * m_slot[i]) = Eigen::Map<const Vec3>(r + 3 * i);
    for (const int slot : m_free) Eigen::Map<Vec3>(m_x.data() + 3 * slot).setZero();
    m_factor->solve(m_x.data());
    for (int i = 0; i < n; ++i) Eigen::Map<Vec3>(z + 3 * i) = Eigen::Map<const Vec3>(m_x.data() + 3 * m_slot[i]);
}

}  // namespace jacket
