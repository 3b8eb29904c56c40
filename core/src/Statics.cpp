#include "jacket/Statics.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "ShellAssembly.h"

namespace jacket {

/// Newton's method over the free coordinates of one shell.
class StaticSolver {
  public:
    StaticSolver(Shell& shell, const Vec3& gravity) : m_shell(shell), m_gravity(gravity) {
        for (int i = 0; i < shell.vertexCount(); ++i) {
            m_offsets.push_back(m_size);
            const Mat3 free = shell.freedom(i);
            // columns span the directions in which the vertex may move
            const Eigen::SelfAdjointEigenSolver<Mat3> axes(free);
            const int count = static_cast<int>(std::lround(free.trace()));
            m_basis.push_back(axes.eigenvectors().rightCols(count));
            m_size += count;
        }
        for (int i = 0; i < shell.vertexCount(); ++i)
            if (shell.isPinned(i)) shell.m_x.col(i) = shell.pinTarget(i);
    }

    /// Balance under `load` times the full load. False leaves the positions where they were. `patient`: with the slow
    /// and sure method too.
    bool balance(double load, const StaticSettings& settings, StaticReport& report, bool patient);
    /// Negative pivots of the exact Hessian.
    int negativePivots() {
        assemble(0.0, HessianKind::Exact);
        m_factor.compute(m_matrix);
        return m_factor.info() == Eigen::Success ? static_cast<int>((m_factor.vectorD().array() < 0.0).count()) : -1;
    }

    std::vector<double> frequencies(int count);

  private:
    bool balanceMixed(double load, const StaticSettings& settings, StaticReport& report);
    bool balanceByEnergy(double load, const StaticSettings& settings, StaticReport& report);
    using Sparse = Eigen::SparseMatrix<double>;
    void assemble(double load, HessianKind kind);
    Eigen::VectorXd newtonStep(double load);
    bool isDescent(const Eigen::VectorXd& step) const { return step.allFinite() && step.dot(m_force) > 0.0; }
    double potential(double load) const;
    void move(const Eigen::VectorXd& step, double by);
    double largestForce(double load);

    Shell& m_shell;
    Vec3 m_gravity;
    int m_size = 0;
    std::vector<int> m_offsets;
    std::vector<Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>> m_basis;
    Sparse m_matrix;
    Eigen::VectorXd m_force;  ///< unbalanced, on the free coordinates [N]
    Eigen::SimplicialLDLT<Sparse> m_factor;
    double m_largestForce = 1e-300;  ///< [N]
};

void StaticSolver::assemble(double load, HessianKind kind) {
    const StepSystem& system = m_shell.m_assembly->assembleStatic(m_shell, m_gravity, load, kind);
    const BlockMatrix& k = system.matrix;
    std::vector<Eigen::Triplet<double>> entries;
    const auto add = [&](int i, int j, const Mat3& block) {  // lower triangle
        const auto reduced = (m_basis[i].transpose() * block * m_basis[j]).eval();
        for (int a = 0; a < reduced.rows(); ++a)
            for (int b = 0; b < reduced.cols(); ++b)
                if (m_offsets[i] + a >= m_offsets[j] + b)
                    entries.emplace_back(m_offsets[i] + a, m_offsets[j] + b, reduced(a, b));
    };
    m_force.resize(m_size);
    for (int i = 0; i < k.size(); ++i) {
        add(i, i, k.diagonal()[i]);
        for (int s = k.rowBegin(i); s < k.rowEnd(i); ++s) add(i, k.column(s), k.lower()[s]);
        m_force.segment(m_offsets[i], m_basis[i].cols()) = m_basis[i].transpose() * system.rhs.col(i);
    }
    forBeside(k, [&](int i, int j, double scalar) { add(i, j, k.besideFactor() * scalar * Mat3::Identity()); });
    m_matrix.resize(m_size, m_size);
    m_matrix.setFromTriplets(entries.begin(), entries.end());
}

/// The exact Hessian's step where that matrix is positive definite, else that of its positive part, lifted until it is.
Eigen::VectorXd StaticSolver::newtonStep(double load) {
    assemble(load, HessianKind::Exact);
    m_factor.compute(m_matrix);
    if (m_factor.info() == Eigen::Success && m_factor.vectorD().minCoeff() > 0.0) return m_factor.solve(m_force);
    assemble(load, HessianKind::Positive);
    const double scale = m_matrix.diagonal().mean();
    for (double lift = 1e-9; lift < 1e3; lift *= 100.0) {
        m_factor.setShift(lift * scale);
        m_factor.compute(m_matrix);
        m_factor.setShift(0.0);
        if (m_factor.info() == Eigen::Success && m_factor.vectorD().minCoeff() > 0.0) return m_factor.solve(m_force);
    }
    throw std::runtime_error("settle: the shell's stiffness matrix cannot be factored; is it held anywhere?");
}

double StaticSolver::potential(double load) const {
    double work = 0.0;
    for (int i = 0; i < m_shell.vertexCount(); ++i)
        work += (m_shell.m_mass[i] * m_gravity + m_shell.m_force.col(i)).dot(m_shell.m_x.col(i));
    return m_shell.elasticEnergy(m_shell.m_x) - load * work;
}

void StaticSolver::move(const Eigen::VectorXd& step, double by) {
    for (int i = 0; i < m_shell.vertexCount(); ++i)
        m_shell.m_x.col(i) += by * (m_basis[i] * step.segment(m_offsets[i], m_basis[i].cols()));
}

/// What residuals are compared with: the largest load or inner force on a vertex so far, as a released shell has none
/// at the end.
double StaticSolver::largestForce(double load) {
    double most = m_largestForce;
    const Points inner = m_shell.elasticForces();
    for (int i = 0; i < m_shell.vertexCount(); ++i) {
        most = std::max(most, load * (m_shell.m_mass[i] * m_gravity + m_shell.m_force.col(i)).norm());
        most = std::max(most, inner.col(i).norm());
    }
    m_largestForce = most;
    return most;
}

/// Full Newton steps on positions and stresses. False where they do not settle.
bool StaticSolver::balanceMixed(double load, const StaticSettings& settings, StaticReport& report) {
    constexpr int kMost = 30;
    constexpr double kDiverged = 1e6;
    Energy& membrane = m_shell.m_assembly->membrane();
    const double size = (m_shell.m_rest.rowwise().maxCoeff() - m_shell.m_rest.rowwise().minCoeff()).norm();
    double first = -1.0;
    bool settled = false;
    for (int iteration = 0; iteration < std::min(kMost, settings.maxIterations); ++iteration) {
        ++report.iterations;
        assemble(load, HessianKind::Exact);
        report.residual = m_force.cwiseAbs().maxCoeff();
        if (first < 0.0) first = report.residual;
        settled = iteration > 0 && report.residual <= settings.tolerance * largestForce(load);
        if (settled || !(report.residual < kDiverged * std::max(first, largestForce(load)))) break;
        m_factor.compute(m_matrix);
        if (m_factor.info() != Eigen::Success) break;
        Eigen::VectorXd step = m_factor.solve(m_force);
        if (!step.allFinite()) break;
        const double longest = step.cwiseAbs().maxCoeff();
        if (longest > 0.5 * size) step *= 0.5 * size / longest;
        const Points before = m_shell.m_x;
        move(step, 1.0);
        membrane.predictStress(before, m_shell.m_x - before);
    }
    membrane.predictStress({}, {});
    return settled;
}

/// Newton steps with a line search on the energy, which find their way from anywhere, if slowly.
bool StaticSolver::balanceByEnergy(double load, const StaticSettings& settings, StaticReport& report) {
    constexpr int kMostHalvings = 20;
    const bool hasEnergy = m_shell.m_pressure == 0.0;  // pressure on an open sheet is no potential's gradient
    double edge = 0.0;
    for (const auto& e : m_shell.mesh().edges())
        edge = std::max(edge, (m_shell.m_rest.col(e.v0) - m_shell.m_rest.col(e.v1)).norm());
    for (int iteration = 0; iteration < settings.maxIterations; ++iteration) {
        ++report.iterations;
        Eigen::VectorXd step = newtonStep(load);
        report.residual = m_force.cwiseAbs().maxCoeff();
        if (report.residual <= settings.tolerance * largestForce(load)) return true;
        if (!step.allFinite()) return false;
        const double longest = step.cwiseAbs().maxCoeff();
        if (longest > 2.0 * edge) step *= 2.0 * edge / longest;  // beyond that the quadratic model says nothing
        const double before = potential(load), slope = step.dot(m_force);
        const double rounding = 1e-13 * (std::abs(before) + std::abs(slope));
        const Points from = m_shell.m_x;
        double by = 1.0;
        for (int halving = 0; halving < kMostHalvings; ++halving, by *= 0.5) {
            m_shell.m_x = from;
            move(step, by);
            if (!hasEnergy || potential(load) <= before - 1e-4 * by * slope + rounding) break;
        }
    }
    return false;
}

bool StaticSolver::balance(double load, const StaticSettings& settings, StaticReport& report, bool patient) {
    const Points start = m_shell.m_x;
    largestForce(load);
    if (balanceMixed(load, settings, report)) return true;
    m_shell.m_x = start;
    if (patient && balanceByEnergy(load, settings, report)) return true;
    m_shell.m_x = start;
    return false;
}

/// Subspace iteration (Bathe) on (K + s M)^-1 M; the shift s keeps rigid motions solvable.
std::vector<double> StaticSolver::frequencies(int count) {
    constexpr int kMostIterations = 200;
    assemble(0.0, HessianKind::Exact);
    Eigen::VectorXd mass(m_size);
    for (std::size_t i = 0; i < m_basis.size(); ++i)
        mass.segment(m_offsets[i], m_basis[i].cols()).setConstant(m_shell.m_mass[i]);
    const int width = std::min(m_size, std::max(2 * count, count + 8));
    count = std::min(count, width);
    double shift = 1e-7 * (m_matrix.diagonal().array() / mass.array()).mean();  // below the lowest elastic ones
    Eigen::MatrixXd basis = Eigen::MatrixXd::NullaryExpr(m_size, width, [](Eigen::Index i, Eigen::Index j) {
        return std::sin(static_cast<double>(1 + i) * static_cast<double>(1 + 7 * j) * 0.61803398875);
    });
    Eigen::VectorXd last = Eigen::VectorXd::Zero(count);
    Sparse shifted = m_matrix;
    for (int i = 0; i < m_size; ++i) shifted.coeffRef(i, i) += shift * mass[i];
    m_factor.compute(shifted);
    for (int iteration = 0; iteration < kMostIterations; ++iteration) {
        const Eigen::MatrixXd next = m_factor.solve((mass.asDiagonal() * basis).eval());
        const Eigen::MatrixXd k = next.transpose() * (mass.asDiagonal() * basis),
                              m = next.transpose() * mass.asDiagonal() * next;
        const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> ritz(0.5 * (k + k.transpose()), m);
        if (ritz.info() != Eigen::Success) throw std::runtime_error("naturalFrequencies: no convergence");
        basis = next * ritz.eigenvectors();
        const Eigen::VectorXd now = ritz.eigenvalues().head(count);
        if ((now - last).cwiseAbs().maxCoeff() <= 1e-10 * now.cwiseAbs().maxCoeff()) break;
        last = now;
    }
    std::vector<double> result;
    for (int i = 0; i < count; ++i) result.push_back(std::sqrt(std::max(0.0, last[i] - shift)));
    return result;
}

StaticReport settle(Shell& shell, const Vec3& gravity, const StaticSettings& settings) {
    if (settings.increments < 1) throw std::invalid_argument("StaticSettings.increments must be >= 1");
    if (settings.maxIterations < 1) throw std::invalid_argument("StaticSettings.maxIterations must be >= 1");
    if (!(settings.tolerance > 0.0)) throw std::invalid_argument("StaticSettings.tolerance must be > 0");
    if (!gravity.allFinite()) throw std::invalid_argument("settle: gravity must be finite");
    constexpr double kSmallest = 1.0 / 1024.0, kSmall = 1.0 / 64.0;  // of an increment
    StaticReport report;
    StaticSolver solver(shell, gravity);
    const double full = 1.0 / settings.increments;
    double load = 0.0, increment = full;
    while (load < 1.0 - 1e-12) {
        const double next = std::min(1.0, load + increment);
        ++report.increments;
        if (solver.balance(next, settings, report, increment < kSmall * full)) {
            load = next;
            increment = std::min(2.0 * increment, full);
        } else if ((increment *= 0.5) < kSmallest * full) {
            report.converged = false;
            break;
        }
    }
    shell.setVelocities(Points::Zero(3, shell.vertexCount()));
    report.negativePivots = solver.negativePivots();
    return report;
}

int unstableDirections(Shell& shell) {
    return StaticSolver(shell, Vec3::Zero()).negativePivots();
}

std::vector<double> naturalFrequencies(Shell& shell, int count) {
    if (count < 1) throw std::invalid_argument("naturalFrequencies: count must be >= 1");
    return StaticSolver(shell, Vec3::Zero()).frequencies(count);
}

}  // namespace jacket
