#include "solver/IncompleteCholesky.h"

#include <Eigen/LU>
#include <algorithm>

namespace jacket {
namespace {

/// Inverse of a symmetric 3x3 block; false unless it is safely positive definite against `scale`.
bool invertPositive(const Mat3& a, double scale, Mat3& inverse) {
    const double least = 1e-3 * scale;  // a pivot far below the original diagonal means that the factor has broken down
    const double d0 = a(0, 0);
    if (!(d0 > least)) return false;
    const double l10 = a(1, 0) / d0, l20 = a(2, 0) / d0;
    const double d1 = a(1, 1) - l10 * a(1, 0);
    if (!(d1 > least)) return false;
    const double l21 = (a(2, 1) - l20 * a(1, 0)) / d1;
    const double d2 = a(2, 2) - l20 * a(2, 0) - l21 * (a(2, 1) - l20 * a(1, 0));
    if (!(d2 > least)) return false;
    inverse = a.inverse();
    return true;
}

}  // namespace

void IncompleteCholesky::factor(const FilteredMatrix& matrix) {
    m_pattern = &matrix.pattern();
    m_inverse.resize(m_pattern->diagonal().size());
    m_lower.resize(m_pattern->lower().size());
    if (m_scratch.cols() != m_pattern->size()) m_scratch.resize(3, m_pattern->size());
    m_shift *= 0.7;  // let it shrink again when the breakdown is over
    if (m_shift < 1e-3) m_shift = 0.0;
    while (!tryFactor(matrix)) m_shift = std::max(2.0 * m_shift, 5e-3);
}

bool IncompleteCholesky::tryFactor(const FilteredMatrix& matrix) {
    const BlockMatrix& pattern = *m_pattern;
    if (m_shift > 1e3) {  // as good as block Jacobi; keeps the loop finite on garbage
        for (int i = 0; i < pattern.size(); ++i)
            m_inverse[i] = Mat3::Identity() / std::max(matrix.diagonal(i).trace() / 3.0, 1e-300);
        std::fill(m_lower.begin(), m_lower.end(), Mat3::Zero());
        m_shift = 0.0;
        return true;
    }
    for (int i = 0; i < pattern.size(); ++i) {
        const Mat3& diagonal = matrix.diagonal(i);
        Mat3 d = (1.0 + m_shift) * diagonal;
        const double scale = std::min({diagonal(0, 0), diagonal(1, 1), diagonal(2, 2)});
        for (int k = pattern.rowBegin(i); k < pattern.rowEnd(i); ++k) {
            const int j = pattern.column(k);
            Mat3 block = matrix.lower(k);
            int p = pattern.rowBegin(i), q = pattern.rowBegin(j);
            const int qEnd = pattern.rowEnd(j);
            while (p < k && q < qEnd) {  // columns that rows i and j share
                const int cp = pattern.column(p), cq = pattern.column(q);
                if (cp == cq) {
                    block.noalias() -= m_lower[p] * (m_inverse[cp] * m_lower[q].transpose());
                    ++p, ++q;
                } else if (cp < cq) {
                    ++p;
                } else {
                    ++q;
                }
            }
            m_lower[k] = block;
            d.noalias() -= block * (m_inverse[j] * block.transpose());
        }
        if (!invertPositive(d, scale, m_inverse[i])) return false;
    }
    return true;
}

void IncompleteCholesky::apply(const double* r, double* z) const {
    const BlockMatrix& pattern = *m_pattern;
    const int n = pattern.size();
    double* y = m_scratch.data();
    for (int i = 0; i < n; ++i) {  // y = D^-1 L^-1 r
        double t0 = r[3 * i], t1 = r[3 * i + 1], t2 = r[3 * i + 2];
        for (int k = pattern.rowBegin(i); k < pattern.rowEnd(i); ++k) {
            const double* a = m_lower[k].data();
            const double* yj = y + 3 * pattern.column(k);
            t0 -= a[0] * yj[0] + a[3] * yj[1] + a[6] * yj[2];
            t1 -= a[1] * yj[0] + a[4] * yj[1] + a[7] * yj[2];
            t2 -= a[2] * yj[0] + a[5] * yj[1] + a[8] * yj[2];
        }
        const double* d = m_inverse[i].data();
        y[3 * i] = d[0] * t0 + d[3] * t1 + d[6] * t2;
        y[3 * i + 1] = d[1] * t0 + d[4] * t1 + d[7] * t2;
        y[3 * i + 2] = d[2] * t0 + d[5] * t1 + d[8] * t2;
    }
    std::fill(z, z + 3 * n, 0.0);
    for (int i = n - 1; i >= 0; --i) {  // z = L^-T y; z collects sum_j (L D)_ji^T z_j before its turn
        const double* d = m_inverse[i].data();
        const double s0 = z[3 * i], s1 = z[3 * i + 1], s2 = z[3 * i + 2];
        const double z0 = y[3 * i] - (d[0] * s0 + d[3] * s1 + d[6] * s2);
        const double z1 = y[3 * i + 1] - (d[1] * s0 + d[4] * s1 + d[7] * s2);
        const double z2 = y[3 * i + 2] - (d[2] * s0 + d[5] * s1 + d[8] * s2);
        z[3 * i] = z0;
        z[3 * i + 1] = z1;
        z[3 * i + 2] = z2;
        for (int k = pattern.rowBegin(i); k < pattern.rowEnd(i); ++k) {
            const double* a = m_lower[k].data();
            double* zj = z + 3 * pattern.column(k);
            zj[0] += a[0] * z0 + a[1] * z1 + a[2] * z2;
            zj[1] += a[3] * z0 + a[4] * z1 + a[5] * z2;
            zj[2] += a[6] * z0 + a[7] * z1 + a[8] * z2;
        }
    }
}

}  // namespace jacket
