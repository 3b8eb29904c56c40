#include "solver/CoarseSpace.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "Kernel.h"

namespace jacket {
namespace {

constexpr int kPatchSize = 64;                             ///< vertices
constexpr int kAhead = 4;                                  ///< rows between prefetch and use
constexpr int kPatchesAtATime = 16, kBlocksAtATime = 128;  ///< that a thread of a team takes

/// Steps along blocks from `start` to each of `rows`, whose `inside` is set; parts without a way to it come after.
void measureDistances(const CompactMatrix& matrix, const std::vector<int>& rows, const std::vector<char>& inside,
                      int start, std::vector<int>& distance, std::vector<int>& queue) {
    for (const int row : rows) distance[row] = -1;
    queue.assign(1, start);
    distance[start] = 0;
    std::size_t unseen = 0;
    for (std::size_t done = 0; done < rows.size(); ++done) {
        if (done == queue.size()) {
            while (distance[rows[unseen]] >= 0) ++unseen;
            distance[rows[unseen]] = distance[queue.back()] + 1;
            queue.push_back(rows[unseen]);
        }
        const int row = queue[done];
        matrix.forColumns(row, [&](int next) {
            if (!inside[next] || distance[next] >= 0) return;
            distance[next] = distance[row] + 1;
            queue.push_back(next);
        });
    }
}

/// Patches of about kPatchSize rows: halves of halves, cut across where they are longest.
std::vector<int> dividePatches(const CompactMatrix& matrix) {
    struct Part {
        std::vector<int> rows;
        int patches;
    };
    const int n = matrix.size();
    std::vector<int> patchOf(n), fromOne(n), fromOther(n), queue;
    std::vector<char> inside(n);
    std::vector<Part> open(1);
    open[0].rows.resize(n);
    std::iota(open[0].rows.begin(), open[0].rows.end(), 0);
    open[0].patches = std::max(1, (n + kPatchSize / 2) / kPatchSize);
    for (int patches = 0; !open.empty();) {
        Part part = std::move(open.back());
        open.pop_back();
        if (part.patches == 1) {
            for (const int row : part.rows) patchOf[row] = patches;
            ++patches;
            continue;
        }
        for (const int row : part.rows) inside[row] = 1;
        measureDistances(matrix, part.rows, inside, part.rows[0], fromOne, queue);
        const int one = queue.back();
        measureDistances(matrix, part.rows, inside, one, fromOne, queue);
        const int other = queue.back();
        measureDistances(matrix, part.rows, inside, other, fromOther, queue);
        for (const int row : part.rows) inside[row] = 0;
        std::stable_sort(part.rows.begin(), part.rows.end(),
                         [&](int a, int b) { return fromOne[a] - fromOther[a] < fromOne[b] - fromOther[b]; });
        const int firstPatches = part.patches / 2;
        const auto cut =
            part.rows.begin() + static_cast<std::ptrdiff_t>(part.rows.size()) * firstPatches / part.patches;
        open.push_back({{part.rows.begin(), cut}, firstPatches});
        open.push_back({{cut, part.rows.end()}, part.patches - firstPatches});
    }
    return patchOf;
}

std::vector<std::vector<int>> patchNeighbours(const CompactMatrix& matrix, const std::vector<int>& patchOf) {
    const int patches = 1 + *std::max_element(patchOf.begin(), patchOf.end());
    std::vector<std::vector<int>> neighbours(patches);
    const auto join = [&](int row, int column) {
        const int p = patchOf[row], q = patchOf[column];
        if (p == q) return;
        for (const auto& [from, to] : {std::pair{p, q}, std::pair{q, p}})
            if (std::find(neighbours[from].begin(), neighbours[from].end(), to) == neighbours[from].end())
                neighbours[from].push_back(to);
    };
    for (int row = 0; row < matrix.size(); ++row) {
        matrix.forColumns(row, [&](int column) { join(row, column); });
        for (int k = matrix.besideBegin(row); k < matrix.besideEnd(row); ++k) join(row, matrix.besideColumns()[k]);
    }
    return neighbours;
}

/// Patches numbered in an order of elimination with little fill.
std::vector<int> orderPatches(const CompactMatrix& matrix, std::vector<int> patchOf) {
    const std::vector<int> place = eliminationOrder(patchNeighbours(matrix, patchOf));
    for (int& patch : patchOf) patch = place[patch];
    return patchOf;
}

constexpr int kSums = 48, kMoments = 16;  ///< numbers a block: see CoarseSpace::m_sums, m_moments

JACKET_INLINE Float4 cross(Float4 a, Float4 b) {
    using Order = int __attribute__((vector_size(16)));
    constexpr Order yzx{1, 2, 0, 3}, zxy{2, 0, 1, 3};
    return __builtin_shuffle(a, yzx) * __builtin_shuffle(b, zxy) -
           __builtin_shuffle(a, zxy) * __builtin_shuffle(b, yzx);
}

/// t += block times the modes' rotations at arm r: e_c x r for c = x, y, z.
JACKET_INLINE void addRotations(const Float4 (&block)[3], Float4 r, Float4* t) {
    t[0] += block[2] * r[1] - block[1] * r[2];
    t[1] += block[0] * r[2] - block[2] * r[0];
    t[2] += block[1] * r[0] - block[0] * r[1];
}

/// sums += (modes at arm r)^T t, t of six columns.
JACKET_INLINE void addModes(Float4 r, const Float4* t, double* sums) {
    for (int column = 0; column < 6; ++column) {
        Double4 linear, angular;
        std::memcpy(&linear, sums + 8 * column, sizeof(linear));
        std::memcpy(&angular, sums + 8 * column + 4, sizeof(angular));
        linear += __builtin_convertvector(t[column], Double4);
        angular += __builtin_convertvector(cross(r, t[column]), Double4);
        std::memcpy(sums + 8 * column, &linear, sizeof(linear));
        std::memcpy(sums + 8 * column + 4, &angular, sizeof(angular));
    }
}

struct Galerkin {
    CompactMatrix::Pattern pattern;
    const int *patchStart, *members, *target, *patchOf;
    const int *besideStart, *scalarStart;
    const std::uint16_t* scalars;
    const float *blocks, *rowSums, *beside, *arms;
    const char *isHeld, *isNearHeld;  ///< see CoarseSpace
    double *sums, *besideSums;
    float* moments;
};

/// What the next rows of a patch need, which are far apart in memory.
JACKET_INLINE void prefetch(const void* from, const void* to) {
    constexpr std::ptrdiff_t kLine = 64;
    for (const char* at = static_cast<const char*>(from); at < to; at += kLine) __builtin_prefetch(at);
}

/// The part of block (i, j) in row i of P^T A P; it is block k below the diagonal, or that one's transpose. `own`: what
/// the row has with its own patch. Only blocks of the row's patch are written to, here and below.
JACKET_INLINE void addBlock(const Galerkin& g, int i, int j, int k, const Float4 (&block)[3], Float4* own) {
    const Float4 ri = load4(g.arms + 4 * i), rj = load4(g.arms + 4 * j);
    if (g.patchOf[j] == g.patchOf[i]) return addRotations(block, rj - ri, own + 3);
    const Float4 minus[3] = {-block[0], -block[1], -block[2]};
    for (int c = 0; c < 3; ++c) own[c] += minus[c];
    addRotations(minus, ri, own + 3);
    if (g.patchOf[j] > g.patchOf[i]) return;
    Float4 other[6] = {block[0], block[1], block[2]};
    addRotations(block, rj, other + 3);
    addModes(ri, other, g.sums + kSums * g.target[k]);
}

/// Of a patch's rows.
JACKET_KERNEL void addBlocks(const Galerkin& g, int patch) {
    const CompactMatrix::Pattern& p = g.pattern;
    for (int m = g.patchStart[patch]; m < g.patchStart[patch + 1]; ++m) {
        const int i = g.members[m];
        if (m + kAhead < g.patchStart[patch + 1]) {
            const int next = g.members[m + kAhead];
            prefetch(g.rowSums + 9 * next, g.rowSums + 9 * next + 9);
            prefetch(g.blocks + 9 * p.lowerStart[next], g.blocks + 9 * p.lowerStart[next + 1]);
            prefetch(p.lowerColumn + p.lowerStart[next], p.lowerColumn + p.lowerStart[next + 1]);
            prefetch(g.target + p.lowerStart[next], g.target + p.lowerStart[next + 1]);
        }
        if (g.isNearHeld[i]) continue;  // see addHeldRow
        const Float4 ri = load4(g.arms + 4 * i);
        const float* rowSum = g.rowSums + 9 * i;
        Float4 own[6] = {load4(rowSum), load4(rowSum + 3), load4(rowSum + 6)};
        const Float4 sum[3] = {own[0], own[1], own[2]};
        addRotations(sum, ri, own + 3);
        for (int k = p.lowerStart[i]; k < p.lowerStart[i + 1]; ++k) {
            const float* a = g.blocks + 9 * k;
            addBlock(g, i, p.lowerColumn[k], k, {load4(a), load4(a + 3), load4(a + 6)}, own);
        }
        for (int k = p.upperStart[i]; k < p.upperStart[i + 1]; ++k) {
            Float4 block[3];
            loadTransposed(g.blocks + 9 * p.upperBlock[k], block);
            addBlock(g, i, p.upperColumn[k], p.upperBlock[k], block, own);
        }
        addModes(ri, own, g.sums + kSums * g.patchOf[i]);
    }
}

/// moments += s (r_i, 1) (r_j, 1)^T
JACKET_INLINE void addMoment(float s, Float4 ri, Float4 rj, Float4 (&moments)[4]) {
    for (int c = 0; c < 4; ++c) moments[c] += s * ri[c] * rj;
}

JACKET_INLINE void addMomentAt(float s, Float4 ri, Float4 rj, float* moments) {
    for (int c = 0; c < 4; ++c) store4(moments + 4 * c, load4(moments + 4 * c) + s * ri[c] * rj);
}

/// What is held is taken as held in all directions: near it the shell seems stiffer than it is, which harms less than
/// taking the trouble. Its pairs with others stay, or what bending has, which is of both signs, would not be positive.
template <class Column>
JACKET_KERNEL void addScalars(const Galerkin& g, const Column* besideColumn, int patch) {
    Float4 own[4] = {};
    double ownSum = 0.0;
    for (int m = g.patchStart[patch]; m < g.patchStart[patch + 1]; ++m) {
        const int i = g.members[m];
        if (m + kAhead < g.patchStart[patch + 1]) {
            const int next = g.members[m + kAhead];
            prefetch(g.beside + g.besideStart[next], g.beside + g.besideStart[next + 1]);
            prefetch(besideColumn + g.besideStart[next], besideColumn + g.besideStart[next + 1]);
            prefetch(g.scalars + g.scalarStart[next], g.scalars + g.scalarStart[next + 1]);
        }
        const bool isHeld = g.isHeld[i];
        const Float4 ri = load4(g.arms + 4 * i);
        float crossSum = 0.0f;  // of scalars to other patches
        const int first = g.besideStart[i];
        const std::uint16_t* at = g.scalars + g.scalarStart[i];
        const std::uint16_t* const ownEnd = at + 2 + at[0];
        int places = at[1];
        for (at += 2; at < ownEnd; ++at) {
            const int j = besideColumn[first + *at];
            const float s = g.beside[first + *at];
            const Float4 rj = load4(g.arms + 4 * j);
            if (!isHeld && !g.isHeld[j]) {
                addMoment(-s, rj - ri, rj - ri, own);
            } else if (!isHeld || !g.isHeld[j]) {
                addMoment(-s, isHeld ? rj : ri, isHeld ? rj : ri, own);
                ownSum -= s;
            }
        }
        if (isHeld) continue;
        for (; places > 0; --places) {
            const int target = at[0] | at[1] << 16;
            const std::uint16_t* const end = at + 3 + at[2];
            Float4 sum{};  // of s (r_j, 1)
            float toHeld = 0.0f;
            for (at += 3; at < end; ++at) {
                const int j = besideColumn[first + *at];
                const float s = g.beside[first + *at];
                if (g.isHeld[j])
                    toHeld += s;
                else
                    sum += s * load4(g.arms + 4 * j);
            }
            crossSum -= sum[3] + toHeld;
            addMomentAt(1.0f, ri, sum, g.moments + kMoments * target);
            g.besideSums[target] += sum[3];
        }
        for (const std::uint16_t* const end = g.scalars + g.scalarStart[i + 1]; at < end; ++at)
            crossSum -= g.beside[first + *at];
        ownSum += crossSum;
        addMoment(crossSum, ri, ri, own);
    }
    for (int c = 0; c < 4; ++c) store4(g.moments + kMoments * patch + 4 * c, own[c]);
    g.besideSums[patch] = ownSum;
}

/// P^T A P's part of a row that is held, or next to one that is. What is held keeps its mass, which is what the blocks
/// of its row add up to: where all but a few of a patch' vertices are held, rounding is else all that resists motions
/// that move these few by nothing, and once a contact has let go P^-1 makes 1e10 times too much of them.
void addHeldRow(const Galerkin& g, int i, const std::vector<const Mat3*>& free) {
    using Block = Eigen::Matrix3f;
    const auto projector = [&](int row) -> Block {
        return free[row] ? Block(free[row]->cast<float>()) : Block::Identity();
    };
    const auto add = [&](const Block& block, int j, double* sums) {
        Float4 columns[3], t[6] = {};
        for (int c = 0; c < 3; ++c) t[c] = columns[c] = Float4{block(0, c), block(1, c), block(2, c), 0.0f};
        addRotations(columns, load4(g.arms + 4 * j), t + 3);
        addModes(load4(g.arms + 4 * i), t, sums);
    };
    const Block si = projector(i);
    Block own = Eigen::Map<const Block>(g.rowSums + 9 * i);
    const float mass = std::max(0.0f, own.trace() / 3.0f);
    double* ownSums = g.sums + kSums * g.patchOf[i];
    const auto addPair = [&](int j, int k, const Block& block) {
        own -= block;
        if (g.patchOf[j] > g.patchOf[i]) return;
        add(si * block * projector(j), j, g.patchOf[j] == g.patchOf[i] ? ownSums : g.sums + kSums * g.target[k]);
    };
    const auto blockAt = [&](int k) { return Eigen::Map<const Block>(g.blocks + 9 * k); };
    const CompactMatrix::Pattern& p = g.pattern;
    for (int k = p.lowerStart[i]; k < p.lowerStart[i + 1]; ++k) addPair(p.lowerColumn[k], k, blockAt(k));
    for (int k = p.upperStart[i]; k < p.upperStart[i + 1]; ++k)
        addPair(p.upperColumn[k], p.upperBlock[k], blockAt(p.upperBlock[k]).transpose());
    add(si * own * si, i, ownSums);
    if (free[i]) add(mass * (Block::Identity() - si), i, ownSums);
}

}  // namespace

CoarseSpace::CoarseSpace(const CompactMatrix& matrix)
    : m_patchOf(orderPatches(matrix, dividePatches(matrix))), m_factor(patchNeighbours(matrix, m_patchOf)) {
    m_patchStart.assign(patchCount() + 1, 0);
    for (const int patch : m_patchOf) ++m_patchStart[patch + 1];
    std::partial_sum(m_patchStart.begin(), m_patchStart.end(), m_patchStart.begin());
    m_members.resize(matrix.size());
    std::vector<int> next(m_patchStart.begin(), m_patchStart.end() - 1);
    for (int row = 0; row < matrix.size(); ++row) m_members[next[m_patchOf[row]]++] = row;
    m_arms.resize(4 * matrix.size());
    m_coarse.resize(BlockFactor::kRows * patchCount());
    findTargets(matrix);
}

void CoarseSpace::findTargets(const CompactMatrix& matrix) {
    m_placeOf.assign(m_factor.blockCount(), -1);
    for (int p = 0; p < patchCount(); ++p) placeOf(p, p);
    const CompactMatrix::Pattern pattern = matrix.pattern();
    m_target.reserve(matrix.lowerCount());
    m_scalarStart.assign(1, 0);
    for (int row = 0; row < matrix.size(); ++row) {
        for (int k = pattern.lowerStart[row]; k < pattern.lowerStart[row + 1]; ++k)
            m_target.push_back(placeOf(m_patchOf[row], m_patchOf[pattern.lowerColumn[k]]));
        listScalars(matrix, row);
        m_scalarStart.push_back(static_cast<int>(m_scalars.size()));
    }
    m_scalars.shrink_to_fit();
}

/// Of what two patches have with each other.
int CoarseSpace::placeOf(int p, int q) {
    const int block = m_factor.index(std::max(p, q), std::min(p, q));
    if (m_placeOf[block] < 0) {
        m_placeOf[block] = static_cast<int>(m_blockOf.size());
        m_blockOf.push_back(block);
    }
    return m_placeOf[block];
}

void CoarseSpace::listScalars(const CompactMatrix& matrix, int row) {
    const int p = m_patchOf[row], begin = matrix.besideBegin(row);
    const auto number = [](int value) { return static_cast<std::uint16_t>(value); };
    std::vector<std::uint16_t> own, mirrored;
    std::map<std::pair<int, int>, std::vector<std::uint16_t>> beyond;  // by the factor's block, and place
    for (int k = begin; k < matrix.besideEnd(row); ++k) {
        const int column = matrix.besideColumns()[k], q = m_patchOf[column];
        if (q > p)
            mirrored.push_back(number(k - begin));
        else if (q < p)
            beyond[{m_factor.index(p, q), placeOf(p, q)}].push_back(number(k - begin));
        else if (column < row)
            own.push_back(number(k - begin));
    }
    const auto append = [&](const auto& list) { m_scalars.insert(m_scalars.end(), list.begin(), list.end()); };
    append(std::array{number(static_cast<int>(own.size())), number(static_cast<int>(beyond.size()))});
    append(own);
    for (const auto& [at, scalars] : beyond) {
        const int place = at.second;
        append(std::array{number(place & 0xffff), number(place >> 16), number(static_cast<int>(scalars.size()))});
        append(scalars);
    }
    append(mirrored);
}

void CoarseSpace::placeArms(const CompactMatrix& matrix, const Points& positions) {
    m_centre.assign(patchCount(), Vec3::Zero());
    m_size.assign(patchCount(), 0.0);
    const auto members = [&](int patch) { return std::max(1, m_patchStart[patch + 1] - m_patchStart[patch]); };
    const std::vector<int>& rowOf = matrix.rowOf();
    for (int i = 0; i < matrix.size(); ++i) m_centre[m_patchOf[rowOf[i]]] += positions.col(i);
    for (int p = 0; p < patchCount(); ++p) m_centre[p] /= members(p);
    for (int i = 0; i < matrix.size(); ++i) {
        const int p = m_patchOf[rowOf[i]];
        m_size[p] += (positions.col(i) - m_centre[p]).squaredNorm();
    }
    for (int p = 0; p < patchCount(); ++p) m_size[p] = std::max(std::sqrt(m_size[p] / members(p)), 1e-30);
    for (int i = 0; i < matrix.size(); ++i) {
        const int p = m_patchOf[rowOf[i]];
        const Vec3 arm = (positions.col(i) - m_centre[p]) / m_size[p];
        float* to = m_arms.data() + 4 * rowOf[i];
        for (int c = 0; c < 3; ++c) to[c] = static_cast<float>(arm[c]);
        to[3] = 1.0f;
    }
}

/// The matrices are added up by the kernels in forms of their own; here they become the factor's blocks.
void CoarseSpace::collect(double besideFactor, int begin, int end) {
    for (int b = begin; b < end; ++b) {
        Eigen::Map<Mat6> block(m_factor.block(m_blockOf[b]));
        const double* sums = m_sums.data() + kSums * b;
        for (int column = 0; column < 6; ++column)
            for (int c = 0; c < 3; ++c) {
                block(c, column) = sums[8 * column + c];
                block(3 + c, column) = sums[8 * column + 4 + c];
            }
        const Eigen::Matrix4d m =
            besideFactor *
            Eigen::Map<const Eigen::Matrix4f>(m_moments.data() + kMoments * b).cast<double>().transpose();  // (i, j)
        block.topLeftCorner<3, 3>().diagonal().array() += besideFactor * m_besideSums[b];
        block.topRightCorner<3, 3>() -= skew(m.row(3).head<3>().transpose());
        block.bottomLeftCorner<3, 3>() += skew(m.col(3).head<3>());
        const Mat3 second = m.topLeftCorner<3, 3>();
        block.bottomRightCorner<3, 3>() += second.trace() * Mat3::Identity() - second.transpose();
    }
}

void CoarseSpace::addTies(const std::vector<const Mat3*>& free, std::span<const Tie> ties) {
    for (const Tie& tie : ties)
        for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b) {
                const int i = tie.rows[a], j = tie.rows[b], target = m_factor.index(m_patchOf[i], m_patchOf[j]);
                if (target < 0 || tie.weights[a] * tie.weights[b] == 0.0) continue;
                const auto modes = [&](int row) {
                    const float* arm = m_arms.data() + 4 * row;
                    Eigen::Matrix<double, 3, 6> result;
                    result << Mat3::Identity(), -skew(Vec3(arm[0], arm[1], arm[2]));
                    return free[row] ? Eigen::Matrix<double, 3, 6>(*free[row] * result) : result;
                };
                const Mat3 stiffness = tie.weights[a] * tie.weights[b] * tie.stiffness;
                Eigen::Map<Mat6>(m_factor.block(target)) += modes(i).transpose() * stiffness * modes(j);
            }
}

void CoarseSpace::build(const CompactMatrix& matrix, const Points& positions, const std::vector<const Mat3*>& free,
                        std::span<const Tie> ties, WorkerTeam* team) {
    placeArms(matrix, positions);
    m_isHeld.assign(matrix.size(), 0);
    m_isNearHeld.assign(matrix.size(), 0);
    m_heldCount = 0;
    for (int row = 0; row < matrix.size(); ++row) {
        if (!free[row]) continue;
        m_isHeld[row] = m_isNearHeld[row] = 1;
        ++m_heldCount;
        matrix.forColumns(row, [&](int column) { m_isNearHeld[column] = 1; });
    }
    m_sums.assign(kSums * m_blockOf.size(), 0.0);
    m_moments.assign(kMoments * m_blockOf.size(), 0.0f);
    m_besideSums.assign(m_blockOf.size(), 0.0);
    const auto view = matrix.view();
    const Galerkin g{view.pattern,        m_patchStart.data(),  m_members.data(), m_target.data(),     m_patchOf.data(),
                     view.besideStart,    m_scalarStart.data(), m_scalars.data(), view.blocks,         view.rowSums,
                     view.beside,         m_arms.data(),        m_isHeld.data(),  m_isNearHeld.data(), m_sums.data(),
                     m_besideSums.data(), m_moments.data()};
    runParts(team, patchCount(), [&](int patch) {
        addBlocks(g, patch);
        for (int m = m_patchStart[patch]; m < m_patchStart[patch + 1]; ++m)
            if (m_isNearHeld[m_members[m]]) addHeldRow(g, m_members[m], free);
        matrix.besideColumns().visit([&](const auto* columns) { addScalars(g, columns, patch); });
    });
    m_factor.setZero();
    runRanges(team, static_cast<int>(m_blockOf.size()), kBlocksAtATime,
              [&](int begin, int end) { collect(matrix.besideFactor(), begin, end); });
    addTies(free, ties);
    m_factor.factor();
}

namespace {

struct Transfer {
    const int *start, *members;
    const float* arms;
};

JACKET_KERNEL void restrictTo(const Transfer& t, int begin, int end, const float* r, double* coarse) {
    for (int p = begin; p < end; ++p) {
        Float4 force{}, torque{};
        for (int k = t.start[p]; k < t.start[p + 1]; ++k) {
            const Float4 f = load4(r + 4 * t.members[k]);
            force += f;
            torque += cross(load4(t.arms + 4 * t.members[k]), f);
        }
        for (int c = 0; c < 3; ++c) {
            coarse[6 * p + c] = force[c];
            coarse[6 * p + 3 + c] = torque[c];
        }
    }
}

JACKET_KERNEL void addProlonged(const Transfer& t, int begin, int end, const double* coarse, float* z) {
    for (int p = begin; p < end; ++p) {
        Float4 linear{}, angular{};
        for (int c = 0; c < 3; ++c) {
            linear[c] = static_cast<float>(coarse[6 * p + c]);
            angular[c] = static_cast<float>(coarse[6 * p + 3 + c]);
        }
        for (int k = t.start[p]; k < t.start[p + 1]; ++k) {
            float* to = z + 4 * t.members[k];
            store4(to, load4(to) + xyz0(linear + cross(angular, load4(t.arms + 4 * t.members[k]))));
        }
    }
}

}  // namespace

void CoarseSpace::restrictFrom(const float* r, WorkerTeam* team) const {
    const Transfer transfer{m_patchStart.data(), m_members.data(), m_arms.data()};
    runRanges(team, patchCount(), kPatchesAtATime,
              [&](int begin, int end) { restrictTo(transfer, begin, end, r, m_coarse.data()); });
}

void CoarseSpace::prolongTo(float* z, WorkerTeam* team) const {
    const Transfer transfer{m_patchStart.data(), m_members.data(), m_arms.data()};
    runRanges(team, patchCount(), kPatchesAtATime,
              [&](int begin, int end) { addProlonged(transfer, begin, end, m_coarse.data(), z); });
}

void CoarseSpace::addTo(const float* r, float* z) const {
    restrictFrom(r, nullptr);
    solve();
    prolongTo(z, nullptr);
}

}  // namespace jacket
