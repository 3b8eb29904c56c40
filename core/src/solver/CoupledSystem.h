#pragma once
#include <array>
#include <span>
#include <vector>

#include "jacket/Contact.h"
#include "jacket/WorkerTeam.h"
#include "solver/BlockMatrix.h"

namespace jacket {

/// The unknowns of an island: a velocity per vertex, relative to its body where it is constrained, and a twist per
/// body.
struct CoupledVector {
    Points s;                                    ///< 3 x vertices of all shells [m/s]
    Eigen::Matrix<double, 6, Eigen::Dynamic> w;  ///< 6 x dynamic bodies

    void resize(int vertices, int bodies);
    double dot(const CoupledVector& o) const { return s.cwiseProduct(o.s).sum() + w.cwiseProduct(o.w).sum(); }
    void addScaled(double a, const CoupledVector& o) { s += a * o.s, w += a * o.w; }
    void scaleAndAdd(double a, const CoupledVector& o) { s = a * s + o.s, w = a * w + o.w; }
    bool allFinite() const { return s.allFinite() && w.allFinite(); }
};

/// The same in single precision but for the twists: four floats a vertex, the last of them 0, in the order of the
/// shells' compact matrices.
struct CompactVector {
    std::vector<float> s;
    Eigen::Matrix<double, 6, Eigen::Dynamic> w;

    void resize(int vertices, int bodies);
};

/// What the iterations of a solve compute with. Residuals, and so what bodies feel, are double in any case.
enum class Precision { Double, Single };

/// The modified filter of one vertex (Ascher & Boxerman 2003), relative to what it touches:
/// v = s + T (G w_b + carried), S s free, (I - S) s = z. T is I where the vertex moves with the body, and I - S where
/// it slides over it: only in the constrained directions are its velocities then relative to the body, or a light body
/// would be as hard to solve for as the vertices are heavy.
struct VertexConstraint {
    int vertex;                   ///< in the island's numbering
    int body = -1;                ///< dynamic body, or -1: the world, or a body of prescribed motion
    Mat3 free = Mat3::Zero();     ///< S: projector on the free directions
    Vec3 z = Vec3::Zero();        ///< prescribed part of s [m/s]
    Vec3 arm = Vec3::Zero();      ///< vertex minus centre of mass [m]
    Vec3 carried = Vec3::Zero();  ///< surface velocity of a prescribed body [m/s]
    Mat3 tie = Mat3::Identity();  ///< T
};

/// An implicit soft row on the velocity u of a shell's point relative to a body: adds 1/2 u.(stiffness u) - load.u.
struct SoftRow {
    std::array<int, 3> vertices{};
    Vec3 weights{1, 0, 0};
    int body = -1;
    Vec3 arm = Vec3::Zero();
    Vec3 carried = Vec3::Zero();
    Mat3 stiffness = Mat3::Zero();  ///< [kg]
    Vec3 load = Vec3::Zero();       ///< [N s]
};

/// G = [1, -[arm]x]: velocity of a body's point from its twist.
inline Vec3 pointVelocity(const Vec6& twist, const Vec3& arm) {
    return twist.head<3>() + twist.tail<3>().cross(arm);
}
/// Mean velocity from arm, in a time, of what turns: along the chord of its way, (exp(time [spin]x) - 1) / time.
Mat3 chordsOf(const Vec3& spin, double time);
/// G^T f: impulse and angular impulse of an impulse at the point.
inline Vec6 pointImpulse(const Vec3& impulse, const Vec3& arm) {
    Vec6 result;
    result << impulse, arm.cross(impulse);
    return result;
}
/// G^T k G.
Mat6 pointStiffness(const Mat3& k, const Vec3& arm);
/// Gi^T k Gj.
Mat6 pointStiffness(const Mat3& k, const Vec3& armI, const Vec3& armJ);

/// The linear system of an island, symmetric positive definite in (s, w). Holds the constraints; borrows the matrices.
class CoupledSystem {
  public:
    struct ShellPart {
        const BlockMatrix* matrix;
        const Points* rhs;
        int offset;                         ///< first vertex in the island's numbering
        const Points* positions = nullptr;  ///< for a coarse space; null: without
        bool isFactored = false;            ///< completely
        bool isCompact = false;             ///< preconditioned in single precision, with a coarse space, in any case
        /// Whether a vertex, in the island's numbering, is this shell's.
        bool has(int vertex) const { return vertex >= offset && vertex < offset + matrix->size(); }
    };

    /// `couplings`: off-diagonal blocks of the mass, between dynamic bodies by their index here. `team` may help with
    /// whatever is done with this system until the next begin.
    void begin(const std::vector<ShellPart>& shells, int vertexCount, const std::vector<Mat6>& mass,
               const std::vector<Vec6>& freeTwist, const std::vector<BodyCoupling>& couplings = {},
               Precision precision = Precision::Double, WorkerTeam* team = nullptr);
    /// Replaces the bodies' masses and free twists.
    void setBodies(const std::vector<Mat6>& mass, const std::vector<Vec6>& freeTwist,
                   const std::vector<BodyCoupling>& couplings) {
        m_mass = mass;
        m_freeTwist = freeTwist;
        m_couplings = couplings;
    }
    /// Replaces all constraints and rows. At most one constraint per vertex.
    void setContacts(const std::vector<VertexConstraint>& constraints, const std::vector<SoftRow>& rows);

    std::span<const ShellPart> shells() const { return m_shells; }
    std::span<const VertexConstraint> constraints() const { return m_constraints; }
    std::span<const SoftRow> rows() const { return m_rows; }
    const VertexConstraint* constraintOf(int vertex) const {
        return m_constraintOf[vertex] < 0 ? nullptr : &m_constraints[m_constraintOf[vertex]];
    }
    Precision precision() const { return m_precision; }
    WorkerTeam* team() const { return m_team; }  ///< that shares the work; null: none
    /// Place of each vertex in a CompactVector.
    const std::vector<int>& compactPlaces() const { return m_compactPlaces; }
    int vertexCount() const { return m_vertexCount; }
    int bodyCount() const { return static_cast<int>(m_mass.size()); }
    const std::vector<Mat6>& mass() const { return m_mass; }
    std::span<const BodyCoupling> couplings() const { return m_couplings; }
    const std::vector<Vec6>& freeTwist() const { return m_freeTwist; }
    /// Momentum of the bodies that move with the twists w: M w.
    void momentum(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w,
                  Eigen::Matrix<double, 6, Eigen::Dynamic>& result) const;

    /// u with (I - S) s = z, and s, w such that free vertices move with v and bodies with w.
    void start(const Points& v, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w, CoupledVector& u) const;
    /// The same whose velocities are v and w, whether (I - S) s = z or not.
    void express(const Points& v, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w, CoupledVector& u) const;
    /// Absolute velocities of the vertices.
    void velocities(const CoupledVector& u, Points& v) const;
    /// q = filtered operator applied to u (homogeneous: nothing carried).
    void apply(const CoupledVector& u, CoupledVector& q) const;
    /// The same in single precision. `u` is changed on the way, and left as it was.
    void apply(CompactVector& u, CompactVector& q) const;
    void filter(CompactVector& u) const;
    /// s filtered and rounded, and w.
    void round(const Points& s, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w, CompactVector& result) const;
    /// r = filtered right side minus operator at u; in single precision r.w alone, as `round` makes the rest of
    /// `unfiltered`, which receives (b - A v) of every vertex: minus the reactions. Where a solve starts it differs
    /// from the last one's only where contacts do.
    void residual(const CoupledVector& u, CoupledVector& r, Points& unfiltered) const;
    /// Zero in the constrained directions.
    void filter(CoupledVector& u) const;
    /// What a soft row does: its impulse on the shell at absolute velocities v.
    Vec3 rowImpulse(const SoftRow& row, const Points& v, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w) const;
    /// Velocity of a row's point relative to its body.
    Vec3 rowVelocity(const SoftRow& row, const Points& v, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w) const;

  private:
    struct Moved {
        int vertex;
        Vec3 velocity;
    };
    Vec3 velocityOf(const CoupledVector& u, int vertex) const;
    void multiply(const Points& v, Points& q) const;
    void multiplyFromLast(const CoupledVector& u) const;
    std::vector<ShellPart> m_shells;
    int m_vertexCount = 0;
    std::vector<Mat6> m_mass;
    std::vector<Vec6> m_freeTwist;
    std::vector<BodyCoupling> m_couplings;
    std::vector<VertexConstraint> m_constraints;
    std::vector<SoftRow> m_rows;
    std::vector<int> m_constraintOf;
    Precision m_precision = Precision::Double;
    WorkerTeam* m_team = nullptr;
    std::vector<int> m_compactPlaces;
    mutable std::vector<Eigen::Vector3f> m_saved;
    mutable Points m_v, m_q;                ///< velocities, and A v of all shells
    mutable bool m_isProductKnown = false;  ///< of the present matrices; in single precision
    mutable std::vector<Moved> m_moved;     ///< see multiplyFromLast
    mutable Eigen::Matrix<double, 6, Eigen::Dynamic> m_w;
};

}  // namespace jacket
