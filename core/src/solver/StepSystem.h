#pragma once
#include <array>
#include <vector>

#include "jacket/WorkerTeam.h"
#include "jacket/models/StencilModel.h"
#include "solver/BlockMatrix.h"

namespace jacket {

/// Where loops over many terms write: the right side by 3 numbers a vertex, blocks by 9, each with the factor that
/// takes a term's gradient and Hessian there.
struct TermSink {
    double *rhs, *diagonal, *lower;
    double gradientFactor, hessianFactor;
};

/// A and b of one shell's step, A v = b for the velocities v at its end (Baraff & Witkin 1998, eq. 16, with v = v_n +
/// dv):
///
///     A = M (1 + h alpha) + (h^2 + h beta) K + h D
///     b = M v_n + h D v_n + h (f + f_ext) - h K y
///
/// K = -df/dx (positive part), D = -df/dv, f the elastic force, alpha and beta the mass- and stiffness-proportional
/// damping, y the position alteration. This class alone knows the powers of h and the signs.
class StepSystem {
  public:
    BlockMatrix matrix;
    Points rhs;

    /// Threads that may share long loops over the system until this is called again; null: none.
    void setTeam(WorkerTeam* team) { m_team = team; }
    WorkerTeam* team() const { return m_team; }

    /// `constant`: the part of the Hessian that never changes [N/m], split for the matrix. It must outlive the system.
    void begin(double h, double stiffnessDamping, const ConstantHessian* constant = nullptr) {
        m_h = h;
        m_stiffnessFactor = h * h + h * stiffnessDamping;
        rhs.setZero(3, matrix.size());
        matrix.setBeside(constant, constant ? m_stiffnessFactor : 0.0);
        if (!constant) return matrix.setZero();
        constant->visit([&](const auto& inside, const auto&) { forVertices([&](int row) { fillRow(row, inside); }); });
    }

    /// One term of an energy. `slots`: see StencilSlots.
    template <int N>
    void add(const std::array<int, N>& vertices, const std::array<int, N*(N - 1) / 2>& slots,
             const StencilEval<N>& term) {
        for (int a = 0; a < N; ++a) rhs.col(vertices[a]) -= m_h * term.gradient.col(a);
        addMatrix<N>(vertices, slots, term.hessian, m_stiffnessFactor);
    }

    /// For terms that are written by the thousand.
    TermSink sink() {
        return {rhs.data(), matrix.diagonal().data()->data(),
                matrix.lower().empty() ? nullptr : matrix.lower().data()->data(), -m_h, m_stiffnessFactor};
    }

    /// The same piece by piece: dE/dx of one vertex; a block of the Hessian on the diagonal, or off it (see pairSlot).
    void addGradient(int vertex, const Vec3& gradient) { rhs.col(vertex) -= m_h * gradient; }
    void addDiagonal(int vertex, const Mat3& block) { matrix.diagonal()[vertex] += m_stiffnessFactor * block; }
    void addPair(int slot, const Mat3& block) {
        if (slot >= 0)
            matrix.lower()[slot] += m_stiffnessFactor * block;
        else
            matrix.lower()[~slot] += m_stiffnessFactor * block.transpose();
    }
    /// A linear damping force -D v; its h D v_n on the right cancels the force itself.
    template <int N>
    void addDamping(const std::array<int, N>& vertices, const std::array<int, N*(N - 1) / 2>& slots,
                    const Eigen::Matrix<double, 3 * N, 3 * N>& damping) {
        addMatrix<N>(vertices, slots, damping, m_h);
    }

    /// Memory for three numbers a vertex, of whoever asked last.
    Points& scratch() {
        m_scratch.resize(3, matrix.size());
        return m_scratch;
    }

    /// The force -K (scale y) of an alteration. Only after every energy and before anything else has been added.
    void addAlteration(const Eigen::Ref<const Points>& y, double scale = 1.0) {
        matrix.multiply(y.data(), scratch().data(), m_team);  // (h^2 + h beta) K y
        rhs -= (scale * m_h / m_stiffnessFactor) * m_scratch;
    }

    /// A force on one vertex [N].
    void addForce(int vertex, const Vec3& force) { rhs.col(vertex) += m_h * force; }

    /// A force that depends on the velocities of a triangle's corners alike: `force` on each at v_n, `drag` =
    /// -df_a/dv_b between any two of its corners.
    void addDrag(const std::array<int, 3>& vertices, const std::array<int, 3>& slots, const Vec3& force,
                 const Mat3& drag, const Points& v) {
        const Vec3 sum = v.col(vertices[0]) + v.col(vertices[1]) + v.col(vertices[2]);
        for (const int i : vertices) rhs.col(i) += m_h * (force + drag * sum);
        for (const int i : vertices) matrix.diagonal()[i] += m_h * drag;
        for (const int s : slots) matrix.lower()[s >= 0 ? s : ~s] += m_h * drag;  // symmetric
    }

    void addMass(const Eigen::VectorXd& mass, const Eigen::Ref<const Points>& v, double massDamping) {
        forVertices([&](int i) {
            matrix.diagonal()[i].diagonal().array() += mass[i] * (1.0 + m_h * massDamping);
            rhs.col(i) += mass[i] * v.col(i);
        });
    }

    /// visit(vertex) for all of them, which the team may share.
    void forVertices(const auto& visit) const {
        constexpr int kVerticesAtATime = 512;
        runRanges(m_team, matrix.size(), kVerticesAtATime, [&](int begin, int end) {
            for (int i = begin; i < end; ++i) visit(i);
        });
    }

  private:
    void fillRow(int row, const auto& scalars) {
        matrix.diagonal()[row].setZero();
        for (int k = matrix.rowBegin(row); k < matrix.rowEnd(row); ++k) matrix.lower()[k].setZero();
        int block = matrix.rowBegin(row);
        for (int k = scalars.start[row]; k < scalars.start[row + 1] && scalars.column[k] <= row; ++k) {
            const int column = scalars.column[k];
            while (column < row && matrix.column(block) != column) ++block;
            Mat3& to = column < row ? matrix.lower()[block] : matrix.diagonal()[row];
            to.diagonal().setConstant(m_stiffnessFactor * scalars.value[k]);
        }
    }

    template <int N>
    void addMatrix(const std::array<int, N>& vertices, const std::array<int, N*(N - 1) / 2>& slots,
                   const Eigen::Matrix<double, 3 * N, 3 * N>& term, double factor) {
        int pair = 0;
        for (int a = 0; a < N; ++a) {
            matrix.diagonal()[vertices[a]] += factor * term.template block<3, 3>(3 * a, 3 * a);
            for (int b = 0; b < a; ++b, ++pair) {
                const int s = slots[pair];
                if (s >= 0)
                    matrix.lower()[s] += factor * term.template block<3, 3>(3 * a, 3 * b);
                else
                    matrix.lower()[~s] += factor * term.template block<3, 3>(3 * b, 3 * a);
            }
        }
    }

    WorkerTeam* m_team = nullptr;
    double m_h = 0.0, m_stiffnessFactor = 0.0;
    Points m_scratch;
};

/// Where block (a, b) of two different vertices lives in the matrix: the slot of lower block (a, b), or ~slot of (b, a)
/// when b > a.
inline int pairSlot(const BlockMatrix& matrix, int a, int b) {
    return a > b ? matrix.slot(a, b) : ~matrix.slot(b, a);
}

/// The pairSlot of each block (a, b), b < a, of a stencil.
template <int N>
std::array<int, N*(N - 1) / 2> stencilSlots(const BlockMatrix& matrix, const std::array<int, N>& vertices) {
    std::array<int, N*(N - 1) / 2> slots;
    int pair = 0;
    for (int a = 0; a < N; ++a)
        for (int b = 0; b < a; ++b, ++pair) slots[pair] = pairSlot(matrix, vertices[a], vertices[b]);
    return slots;
}

}  // namespace jacket
