#include "solver/FilteredPcg.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "Kernel.h"

namespace jacket {
namespace {

constexpr int kFloatsAtATime = 8192;  ///< that a thread of a team takes: a multiple of four; decides how sums are made
constexpr int kFloatsToStep = 4096;   ///< the same where nothing is summed

JACKET_KERNEL double dotKernel(std::size_t size, const float* a, const float* b) {
    Double4 sum{};
    for (std::size_t i = 0; i < size; i += 4)
        sum += __builtin_convertvector(load4(a + i), Double4) * __builtin_convertvector(load4(b + i), Double4);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/// u += alpha d, r -= alpha q
JACKET_KERNEL void stepKernel(std::size_t size, double alpha, const float* d, const float* q, double* u, float* r) {
    const float a = static_cast<float>(alpha);
    for (std::size_t i = 0; i < size; i += 4) {
        Double4 next;
        std::memcpy(&next, u + i, sizeof(next));
        next += alpha * __builtin_convertvector(load4(d + i), Double4);
        std::memcpy(u + i, &next, sizeof(next));
        store4(r + i, load4(r + i) - a * load4(q + i));
    }
}

/// d = z + beta d
JACKET_KERNEL void turnKernel(std::size_t size, float beta, const float* z, float* d) {
    for (std::size_t i = 0; i < size; i += 4) store4(d + i, load4(z + i) + beta * load4(d + i));
}

}  // namespace

void FilteredPcg::resize(const CoupledSystem& system) {
    const int n = system.vertexCount(), bodies = system.bodyCount();
    const auto fits = [&](const CoupledVector& v) { return v.s.cols() == n && v.w.cols() == bodies; };
    if (system.precision() == Precision::Double) {
        for (CoupledVector* v : {&m_r, &m_z, &m_q})
            if (!fits(*v)) v->resize(n, bodies);
        return;
    }
    m_change.resize(4 * static_cast<std::size_t>(n));
    for (CompactVector* v : {&m_compactR, &m_compactZ, &m_compactD})
        if (v->s.size() != m_change.size() || v->w.cols() != bodies) v->resize(n, bodies);
}

/// Range by range, then in order: the same for any number of threads.
double FilteredPcg::dot(WorkerTeam* team, const CompactVector& a, const CompactVector& b) {
    const int size = static_cast<int>(a.s.size());
    m_partSums.resize((size + kFloatsAtATime - 1) / kFloatsAtATime);
    runRanges(team, size, kFloatsAtATime, [&](int begin, int end) {
        m_partSums[begin / kFloatsAtATime] = dotKernel(end - begin, a.s.data() + begin, b.s.data() + begin);
    });
    return std::accumulate(m_partSums.begin(), m_partSums.end(), 0.0) + a.w.cwiseProduct(b.w).sum();
}

/// Of the residual, into z; returns r^T P^-1 r.
double FilteredPcg::precondition(const CoupledSystem& system, const CoupledPreconditioner& preconditioner) {
    if (system.precision() == Precision::Double) {
        preconditioner.apply(system, m_r, m_z);
        return m_rho = m_r.dot(m_z);
    }
    system.round(m_unfiltered, m_r.w, m_compactR);
    preconditioner.apply(system, m_compactR, m_compactZ);
    return m_rho = dot(system.team(), m_compactR, m_compactZ);
}

double FilteredPcg::begin(const CoupledSystem& system, const CoupledPreconditioner& preconditioner,
                          const CoupledVector& u) {
    computeResidual(system, u);
    return precondition(system, preconditioner);
}

void FilteredPcg::computeResidual(const CoupledSystem& system, const CoupledVector& u) {
    resize(system);
    system.residual(u, m_r, m_unfiltered);
}

PcgReport FilteredPcg::finish(const CoupledSystem& system, const CoupledPreconditioner& preconditioner,
                              double reference, double tolerance, int maxIterations, CoupledVector& u) {
    constexpr int kMostStarts = 5;
    constexpr double kMostGrowth = 100.0;  // of r^T P^-1 r: beyond, rounding has led the iterations astray
    const bool isSingle = system.precision() == Precision::Single;
    const double target = tolerance * tolerance * reference;
    PcgReport report;
    for (int start = 0; start < kMostStarts && !(m_rho <= target) && report.iterations < maxIterations; ++start) {
        if (isSingle) {
            const double before = m_rho;
            m_rho = iterateCompact(system, preconditioner, m_rho, target, maxIterations, report.iterations, u);
            system.residual(u, m_r, m_unfiltered);
            if (m_rho <= target && isAsIterated(system)) break;
            if (precondition(system, preconditioner) <= kMostGrowth * before) continue;
            takeBack(system, u);
            begin(system, preconditioner, u);
            break;
        }
        m_rho = iterate(system, preconditioner, m_rho, target, maxIterations, report.iterations, u);
        system.residual(u, m_r, m_unfiltered);
        break;
    }
    report.converged = m_rho <= target;
    report.residual = reference > 0.0 ? std::sqrt(std::max(m_rho, 0.0) / reference) : 0.0;
    return report;
}

double FilteredPcg::iterate(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, double rho,
                            double target, int maxIterations, int& iterations, CoupledVector& u) {
    m_d = m_z;
    while (!(rho <= target) && iterations < maxIterations) {
        system.apply(m_d, m_q);
        const double curvature = m_d.dot(m_q);
        if (!(curvature > 0.0)) break;  // lost to rounding, or not finite
        const double alpha = rho / curvature;
        u.addScaled(alpha, m_d);
        m_r.addScaled(-alpha, m_q);
        preconditioner.apply(system, m_r, m_z);
        const double next = m_r.dot(m_z);
        m_d.scaleAndAdd(-alpha * m_z.dot(m_q) / rho, m_z);  // next / rho, but for a P that is not quite symmetric
        rho = next;
        ++iterations;
    }
    return rho;
}

/// Whether the residual is what the iterations took it for, so that its norm need not be measured.
bool FilteredPcg::isAsIterated(const CoupledSystem& system) {
    constexpr double kSame = 0.05;
    system.round(m_unfiltered, m_r.w, m_compactZ);
    runRanges(system.team(), static_cast<int>(m_compactZ.s.size()), kFloatsAtATime,
              [&](int i, int end) { turnKernel(end - i, -1.0f, m_compactR.s.data() + i, m_compactZ.s.data() + i); });
    m_compactZ.w = m_compactR.w - m_compactZ.w;
    return dot(system.team(), m_compactZ, m_compactZ) <= kSame * kSame * dot(system.team(), m_compactR, m_compactR);
}

/// Returns r^T P^-1 r as it knows it.
double FilteredPcg::iterateCompact(const CoupledSystem& system, const CoupledPreconditioner& preconditioner, double rho,
                                   double target, int maxIterations, int& iterations, CoupledVector& u) {
    constexpr double kMargin = 0.9;  // the residual as the iterations know it is not quite the true one
    WorkerTeam* const team = system.team();
    const int size = static_cast<int>(m_change.size());
    CompactVector &r = m_compactR, &z = m_compactZ, &d = m_compactD, &q = m_compactZ;
    std::fill(m_change.begin(), m_change.end(), 0.0);
    m_twistsBefore = u.w;
    d.s = z.s;
    d.w = z.w;
    while (!(rho <= kMargin * target) && iterations < maxIterations) {
        system.apply(d, q);
        const double curvature = dot(team, d, q);
        if (!(curvature > 0.0)) break;  // lost to rounding, or not finite
        const double alpha = rho / curvature;
        runRanges(team, size, kFloatsToStep, [&](int i, int end) {
            stepKernel(end - i, alpha, d.s.data() + i, q.s.data() + i, m_change.data() + i, r.s.data() + i);
        });
        u.w += alpha * d.w;
        r.w -= alpha * q.w;
        preconditioner.apply(system, r, z);
        const double next = dot(team, r, z);
        runRanges(team, size, kFloatsToStep, [&](int i, int end) {
            turnKernel(end - i, static_cast<float>(next / rho), z.s.data() + i, d.s.data() + i);
        });
        d.w = z.w + (next / rho) * d.w;
        rho = next;
        ++iterations;
    }
    const std::vector<int>& place = system.compactPlaces();
    runRanges(team, system.vertexCount(), kFloatsToStep / 4, [&](int begin, int end) {
        for (int i = begin; i < end; ++i) {
            Eigen::Map<Vec3> change(m_change.data() + 4 * static_cast<std::size_t>(place[i]));
            const Vec3 before = u.s.col(i);
            u.s.col(i) += change;
            change = before;
        }
    });
    return rho;
}

/// What iterateCompact has made of u.
void FilteredPcg::takeBack(const CoupledSystem& system, CoupledVector& u) const {
    const std::vector<int>& place = system.compactPlaces();
    for (int i = 0; i < system.vertexCount(); ++i)
        u.s.col(i) = Eigen::Map<const Vec3>(m_change.data() + 4 * static_cast<std::size_t>(place[i]));
    u.w = m_twistsBefore;
}

}  // namespace jacket
