#include "solver/CompactFactor.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "Kernel.h"

namespace jacket {
namespace {

/// What a factor is made of, as plain memory for the kernels. Blocks are nine numbers by columns.
struct Factoring {
    const int* vertexOf;
    CompactMatrix::Pattern pattern;
    const int *pairStart, *pairs, *inversePlace, *scaledPlace;
    FilteredMatrix::Blocks diagonal, values;
    double *inverse, *scaled;
    float *root, *lower;
    double shift;
};

JACKET_INLINE const double* blockAt(const FilteredMatrix::Blocks& blocks, int k) {
    const int place = blocks.place[k];
    return place < 0 ? blocks.own + 9 * static_cast<std::size_t>(k)
                     : blocks.altered + 9 * static_cast<std::size_t>(place);
}

/// By columns in the first three places; the last of each is anything. Loads and stores of four numbers stay within the
/// nine: pieces of two and one would wait for each other in memory.
JACKET_INLINE void loadBlock(const double* from, Double4 (&to)[3]) {
    std::memcpy(&to[0], from, sizeof(to[0]));
    std::memcpy(&to[1], from + 3, sizeof(to[1]));
    std::memcpy(&to[2], from + 5, sizeof(to[2]));
    to[2] = __builtin_shufflevector(to[2], to[2], 1, 2, 3, 3);
}

JACKET_INLINE void transpose(Double4 (&a)[3]) {
    const Double4 even = __builtin_shufflevector(a[0], a[1], 0, 4, 2, 6);
    const Double4 odd = __builtin_shufflevector(a[0], a[1], 1, 5, 3, 7);
    a[0] = __builtin_shufflevector(even, a[2], 0, 1, 4, 4);
    a[1] = __builtin_shufflevector(odd, a[2], 0, 1, 5, 5);
    a[2] = __builtin_shufflevector(even, a[2], 2, 3, 6, 6);
}

JACKET_INLINE void storeBlock(const Double4 (&from)[3], double* to) {
    const Double4 last = __builtin_shufflevector(from[1], from[2], 2, 4, 5, 6);
    std::memcpy(to, &from[0], sizeof(last));
    std::memcpy(to + 3, &from[1], sizeof(last));
    std::memcpy(to + 5, &last, sizeof(last));
}

/// The same in single precision.
JACKET_INLINE void storeRounded(const Double4 (&from)[3], float* to) {
    const Double4 last = __builtin_shufflevector(from[1], from[2], 2, 4, 5, 6);
    store4(to, __builtin_convertvector(from[0], Float4));
    store4(to + 3, __builtin_convertvector(from[1], Float4));
    store4(to + 5, __builtin_convertvector(last, Float4));
}

/// c -= a b^T of blocks.
JACKET_INLINE void subtractTransposedProduct(const Double4 (&a)[3], const double* b, Double4 (&c)[3]) {
    for (int column = 0; column < 3; ++column)
        c[column] -= a[0] * b[column] + a[1] * b[column + 3] + a[2] * b[column + 6];
}

/// Of a symmetric 3x3 block L D L^T: l10, l20, l21 of the unit L, and D.
struct Triangular {
    double l10, l20, l21, d0, d1, d2;
};

JACKET_INLINE Triangular triangular(const Double4 (&a)[3]) {
    Triangular t;
    t.d0 = a[0][0];
    t.l10 = a[0][1] / t.d0;
    t.l20 = a[0][2] / t.d0;
    t.d1 = a[1][1] - t.l10 * a[0][1];
    const double s21 = a[1][2] - t.l20 * a[0][1];
    t.l21 = s21 / t.d1;
    t.d2 = a[2][2] - t.l20 * a[0][2] - t.l21 * s21;
    return t;
}

/// W = D^-1/2 L^-1 of a block, so that its inverse is W^T W: in single precision this keeps the direction in which a
/// thin shell is soft apart from the others, and is positive whatever rounding does.
JACKET_INLINE void storeRoot(const Triangular& t, float* root, double* inverse) {
    const double w0 = 1.0 / std::sqrt(t.d0), w1 = 1.0 / std::sqrt(t.d1), w2 = 1.0 / std::sqrt(t.d2);
    const double w[9] = {w0, -t.l10 * w1, (t.l10 * t.l21 - t.l20) * w2, 0.0, w1, -t.l21 * w2, 0.0, 0.0, w2};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            root[3 * j + i] = static_cast<float>(w[3 * j + i]);
            inverse[3 * j + i] = w[3 * i] * w[3 * j] + w[3 * i + 1] * w[3 * j + 1] + w[3 * i + 2] * w[3 * j + 2];
        }
}

/// What a row will read that is not where the last rows read.
JACKET_INLINE void prefetchRow(const Factoring& f, int row) {
    __builtin_prefetch(blockAt(f.diagonal, f.vertexOf[row]));
    for (int k = f.pattern.lowerStart[row]; k < f.pattern.lowerStart[row + 1]; ++k) {
        const int source = f.pattern.source[k];
        const double* const values = blockAt(f.values, source >= 0 ? source : ~source);
        __builtin_prefetch(values);
        __builtin_prefetch(values + 8);
    }
}

/// Of rows begin to end - 1; `row`: room for the blocks of L in one of them. False where a pivot falls far below what
/// it was in the matrix: the factor has broken down.
JACKET_KERNEL bool factorKernel(const Factoring& factoring, int begin, int end, double* row) {
    constexpr double kLeast = 1e-3;
    constexpr int kRowsAhead = 4;   // rows between prefetch and use
    const Factoring f = factoring;  // nobody writes there
    const CompactMatrix::Pattern& p = f.pattern;
    for (int i = begin; i < end; ++i) {
        if (i + kRowsAhead < end) prefetchRow(f, i + kRowsAhead);
        Double4 d[3] = {};
        loadBlock(blockAt(f.diagonal, f.vertexOf[i]), d);
        const Triangular before = triangular(d);
        for (Double4& column : d) column *= 1.0 + f.shift;
        for (int k = p.lowerStart[i]; k < p.lowerStart[i + 1]; ++k) {
            Double4 block[3] = {}, left[3] = {};
            const bool isLower = p.source[k] >= 0;
            loadBlock(blockAt(f.values, isLower ? p.source[k] : ~p.source[k]), block);
            if (!isLower) transpose(block);
            for (int pair = f.pairStart[k]; pair < f.pairStart[k + 1]; ++pair) {
                loadBlock(row + 9 * f.pairs[2 * pair], left);
                subtractTransposedProduct(left, f.scaled + 9 * f.pairs[2 * pair + 1], block);
            }
            double* const scaled = f.scaled + 9 * f.scaledPlace[k];
            storeBlock(block, scaled);
            const double* inverse = f.inverse + 9 * f.inversePlace[p.lowerColumn[k]];
            for (int column = 0; column < 3; ++column)
                left[column] = block[0] * inverse[3 * column] + block[1] * inverse[3 * column + 1] +
                               block[2] * inverse[3 * column + 2];
            storeBlock(left, row + 9 * (k - p.lowerStart[i]));
            subtractTransposedProduct(left, scaled, d);
            storeRounded(left, f.lower + 9 * k);
        }
        const Triangular t = triangular(d);
        if (!(t.d0 > kLeast * before.d0 && t.d1 > kLeast * before.d1 && t.d2 > kLeast * before.d2)) return false;
        if (!(t.d0 > 0.0 && t.d1 > 0.0 && t.d2 > 0.0)) return false;
        storeRoot(t, f.root + 9 * i, f.inverse + 9 * f.inversePlace[i]);
    }
    return true;
}

JACKET_KERNEL void forwardKernel(const CompactFactor::Solving& solving, int begin, int end, const float* r, float* z) {
    const CompactFactor::Solving f = solving;  // nobody writes there
    const CompactMatrix::Pattern& p = f.pattern;
    for (int i = begin; i < end; ++i) {
        Float4 sum = load4(r + 4 * i);
        for (int k = p.lowerStart[i]; k < p.lowerStart[i + 1]; ++k)
            sum -= times(f.lower + 9 * k, load4(z + 4 * p.lowerColumn[k]));
        store4(z + 4 * i, sum);
    }
}

JACKET_KERNEL void backwardKernel(const CompactFactor::Solving& solving, int begin, int end, float* z) {
    const CompactFactor::Solving f = solving;  // nobody writes there
    const CompactMatrix::Pattern& p = f.pattern;
    for (int i = end - 1; i >= begin; --i) {
        Float4 sum = timesTransposed(f.root + 9 * i, times(f.root + 9 * i, load4(z + 4 * i)));
        for (int k = p.upperStart[i]; k < p.upperStart[i + 1]; ++k)
            sum -= timesTransposed(f.lower + 9 * p.upperBlock[k], load4(z + 4 * p.upperColumn[k]));
        store4(z + 4 * i, xyz0(sum));
    }
}

}  // namespace

CompactFactor::CompactFactor(const CompactMatrix& matrix)
    : m_matrix(matrix), m_size(matrix.size()), m_partStart(matrix.partStarts()) {
    findPairs();
    placeValues();
    m_root.assign(9 * m_size + 3, 0.0f);
    m_lower.assign(9 * static_cast<std::size_t>(matrix.lowerCount()) + 3, 0.0f);
    const int* const start = matrix.pattern().lowerStart;
    for (int row = 0; row < m_size; ++row) m_mostInRow = std::max(m_mostInRow, start[row + 1] - start[row]);
    m_rows.assign(9 * static_cast<std::size_t>(m_mostInRow) * stripCount(), 0.0);
}

int CompactFactor::Places::take() {
    if (m_free.empty()) return m_count++;
    const int place = m_free.back();
    m_free.pop_back();
    return place;
}

void CompactFactor::findPairs() {
    const CompactMatrix::Pattern at = m_matrix.pattern();
    m_pairStart.reserve(m_matrix.lowerCount() + 1);
    m_pairStart.assign(1, 0);
    for (int row = 0; row < m_size; ++row)
        for (int k = at.lowerStart[row]; k < at.lowerStart[row + 1]; ++k) {
            int q = at.lowerStart[at.lowerColumn[k]];
            const int qEnd = at.lowerStart[at.lowerColumn[k] + 1];
            for (int p = at.lowerStart[row]; p < k; ++p) {  // columns that the two rows share
                while (q < qEnd && at.lowerColumn[q] < at.lowerColumn[p]) ++q;
                if (q < qEnd && at.lowerColumn[q] == at.lowerColumn[p])
                    m_pairs.insert(m_pairs.end(), {p - at.lowerStart[row], q});
            }
            m_pairStart.push_back(static_cast<int>(m_pairs.size() / 2));
        }
    m_pairs.shrink_to_fit();
}

/// Rows need those of the last few levels, or of the strips beside a separator: few of all.
void CompactFactor::placeValues() {
    const int* const start = m_matrix.pattern().lowerStart;
    std::vector<int> lastUse(m_matrix.lowerCount(), -1);  // row that needs L D
    for (int row = 0; row < m_size; ++row)
        for (int pair = m_pairStart[start[row]]; pair < m_pairStart[start[row + 1]]; ++pair)
            lastUse[m_pairs[2 * pair + 1]] = row;
    m_inversePlace.resize(m_size);
    m_scaledPlace.resize(lastUse.size());
    Places inverse, scaled;
    for (std::size_t part = 0; part + 1 < m_partStart.size(); ++part) {
        inverse.keepTaken();  // other parts may be factored at the same time
        scaled.keepTaken();
        for (int row = m_partStart[part]; row < m_partStart[part + 1]; ++row) {
            placeInverse(row, m_partStart[part], inverse);
            placeScaled(row, m_partStart[part], lastUse, scaled);
        }
    }
    m_inverse.assign(9 * static_cast<std::size_t>(inverse.count()), 0.0);
    m_scaled.assign(9 * static_cast<std::size_t>(scaled.count()), 0.0);
}

/// Takes a row's place, and gives back those of its part, which begins with row `first`, that it is the last to need.
void CompactFactor::placeInverse(int row, int first, Places& places) {
    const CompactMatrix::Pattern at = m_matrix.pattern();
    const auto isLast = [&](int user, int of) {
        const int end = at.upperStart[of + 1];
        return at.upperStart[of] == end ? user == of : user == at.upperColumn[end - 1];
    };
    m_inversePlace[row] = places.take();
    for (int k = at.lowerStart[row]; k < at.lowerStart[row + 1]; ++k) {
        const int column = at.lowerColumn[k];
        if (column >= first && isLast(row, column)) places.giveBack(m_inversePlace[column]);
    }
    if (isLast(row, row)) places.giveBack(m_inversePlace[row]);
}

/// The same of its blocks. `lastUse`: row that needs each of them, < 0: none but its own.
void CompactFactor::placeScaled(int row, int first, const std::vector<int>& lastUse, Places& places) {
    const int* const start = m_matrix.pattern().lowerStart;
    const int begin = start[row], end = start[row + 1];
    for (int k = begin; k < end; ++k) m_scaledPlace[k] = places.take();
    for (int k = begin; k < end; ++k)
        if (lastUse[k] < 0) places.giveBack(m_scaledPlace[k]);
    for (int pair = m_pairStart[begin]; pair < m_pairStart[end]; ++pair) {
        int& q = m_pairs[2 * pair + 1];
        const bool isOver = q >= start[first] && lastUse[q] == row;
        q = m_scaledPlace[q];
        if (isOver) places.giveBack(q);
    }
}

void CompactFactor::factor(const FilteredMatrix& matrix, WorkerTeam* team) {
    constexpr double kMostShift = 1e3;  // as good as block Jacobi; keeps the loop finite on garbage
    m_shift *= 0.9;  // let it shrink again when the breakdown is over; a factor cares little for its size
    if (m_shift < 1e-3) m_shift = 0.0;
    Factoring f{m_matrix.vertexOf().data(),
                m_matrix.pattern(),
                m_pairStart.data(),
                m_pairs.data(),
                m_inversePlace.data(),
                m_scaledPlace.data(),
                matrix.diagonalBlocks(),
                matrix.lowerBlocks(),
                m_inverse.data(),
                m_scaled.data(),
                m_root.data(),
                m_lower.data(),
                m_shift};
    const int strips = stripCount();
    const auto factorParts = [&](int first, int count) {
        std::atomic<bool> works = true;
        runParts(team, count, [&](int i) {
            double* const row = m_rows.data() + 9 * static_cast<std::size_t>(m_mostInRow) * i;
            if (!factorKernel(f, m_partStart[first + i], m_partStart[first + i + 1], row)) works = false;
        });
        return works.load();
    };
    while (!factorParts(0, strips) || !factorParts(strips, strips - 1)) {
        m_shift = std::max(2.0 * m_shift, 5e-3);
        f.shift = m_shift;
        if (m_shift > kMostShift) return factorDiagonally(matrix);
    }
}

void CompactFactor::factorDiagonally(const FilteredMatrix& matrix) {
    for (int row = 0; row < m_size; ++row) {
        const double mean = std::max(matrix.diagonal(m_matrix.vertexOf()[row]).trace() / 3.0, 1e-30);
        Eigen::Map<Eigen::Matrix3f>(m_root.data() + 9 * row) =
            Eigen::Matrix3f::Identity() * static_cast<float>(1.0 / std::sqrt(mean));
    }
    std::fill(m_lower.begin(), m_lower.end(), 0.0f);
    m_shift = 0.0;
}

void CompactFactor::apply(const float* r, float* z) const {
    const int strips = stripCount();
    for (int i = 0; i < strips; ++i) forward(i, r, z);
    for (int i = 0; i < strips - 1; ++i) solveSeparator(i, r, z);
    for (int i = 0; i < strips; ++i) backward(i, z);
}

CompactFactor::Solving CompactFactor::solving() const {
    return {m_matrix.pattern(), m_root.data(), m_lower.data()};
}

void CompactFactor::forward(int strip, const float* r, float* z) const {
    forwardKernel(solving(), m_partStart[strip], m_partStart[strip + 1], r, z);
}

void CompactFactor::solveSeparator(int separator, const float* r, float* z) const {
    const int part = stripCount() + separator;
    forwardKernel(solving(), m_partStart[part], m_partStart[part + 1], r, z);
    backwardKernel(solving(), m_partStart[part], m_partStart[part + 1], z);
}

void CompactFactor::backward(int strip, float* z) const {
    backwardKernel(solving(), m_partStart[strip], m_partStart[strip + 1], z);
}

}  // namespace jacket
