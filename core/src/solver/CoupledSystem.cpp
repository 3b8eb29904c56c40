#include "solver/CoupledSystem.h"

#include <Eigen/Geometry>
#include <cassert>

#include "solver/CompactShell.h"

namespace jacket {
namespace {

constexpr int kVerticesAtATime = 2048, kConstraintsAtATime = 128;  ///< that a thread of a team takes

}  // namespace

void CoupledVector::resize(int vertices, int bodies) {
    s.setZero(3, vertices);
    w.setZero(6, bodies);
}

void CompactVector::resize(int vertices, int bodies) {
    s.assign(4 * static_cast<std::size_t>(vertices), 0.0f);
    w.setZero(6, bodies);
}

Mat3 chordsOf(const Vec3& spin, double time) {
    const Mat3 turn = Eigen::AngleAxisd(time * spin.norm(), spin.normalized()).toRotationMatrix();
    return (turn - Mat3::Identity()) / time;
}

Mat6 pointStiffness(const Mat3& k, const Vec3& armI, const Vec3& armJ) {
    const Mat3 ri = skew(armI), rj = skew(armJ);
    Mat6 m;
    m.topLeftCorner<3, 3>() = k;
    m.topRightCorner<3, 3>() = -k * rj;
    m.bottomLeftCorner<3, 3>() = ri * k;
    m.bottomRightCorner<3, 3>() = -ri * k * rj;
    return m;
}

Mat6 pointStiffness(const Mat3& k, const Vec3& arm) {
    return pointStiffness(k, arm, arm);
}

void CoupledSystem::begin(const std::vector<ShellPart>& shells, int vertexCount, const std::vector<Mat6>& mass,
                          const std::vector<Vec6>& freeTwist, const std::vector<BodyCoupling>& couplings,
                          Precision precision, WorkerTeam* team) {
    m_shells = shells;
    m_vertexCount = vertexCount;
    setBodies(mass, freeTwist, couplings);
    m_v.resize(3, vertexCount);
    m_constraintOf.assign(vertexCount, -1);
    m_constraints.clear();
    m_rows.clear();
    m_precision = precision;
    m_team = team;
    m_isProductKnown = false;
    m_compactPlaces.resize(vertexCount);
    for (const auto& shell : m_shells) {
        if (precision == Precision::Double && !shell.isCompact) continue;
        CompactShell& compact = shell.matrix->compact();
        if (compact.matrix.setValues(*shell.matrix, m_team)) compact.coarse.reset();
        for (int i = 0; i < shell.matrix->size(); ++i)
            m_compactPlaces[shell.offset + i] = shell.offset + compact.matrix.rowOf()[i];
    }
}

void CoupledSystem::setContacts(const std::vector<VertexConstraint>& constraints, const std::vector<SoftRow>& rows) {
    for (const auto& c : m_constraints) m_constraintOf[c.vertex] = -1;
    m_constraints = constraints;
    m_rows = rows;
    for (std::size_t i = 0; i < m_constraints.size(); ++i) {
        assert(m_constraintOf[m_constraints[i].vertex] < 0);
        m_constraintOf[m_constraints[i].vertex] = static_cast<int>(i);
    }
}

void CoupledSystem::start(const Points& v, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w, CoupledVector& u) const {
    express(v, w, u);
    for (const auto& c : m_constraints) u.s.col(c.vertex) = (c.free * u.s.col(c.vertex) + c.z).eval();
}

void CoupledSystem::express(const Points& v, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w,
                            CoupledVector& u) const {
    u.s = v;
    u.w = w;
    for (const auto& c : m_constraints) {
        Vec3 moved = c.carried;
        if (c.body >= 0) moved += pointVelocity(w.col(c.body), c.arm);
        u.s.col(c.vertex) -= c.tie * moved;
    }
}

void CoupledSystem::velocities(const CoupledVector& u, Points& v) const {
    v = u.s;
    for (const auto& c : m_constraints) v.col(c.vertex) = velocityOf(u, c.vertex);
}

Vec3 CoupledSystem::velocityOf(const CoupledVector& u, int vertex) const {
    const VertexConstraint* c = constraintOf(vertex);
    if (!c) return u.s.col(vertex);
    Vec3 moved = c->carried;
    if (c->body >= 0) moved += pointVelocity(u.w.col(c->body), c->arm);
    return u.s.col(vertex) + c->tie * moved;
}

void CoupledSystem::multiply(const Points& v, Points& q) const {
    for (const auto& shell : m_shells)
        shell.matrix->multiply(v.data() + 3 * shell.offset, q.data() + 3 * shell.offset, m_team);
}

/// v at u, and A v. Where few vertices move otherwise than they did the last time, only their part is computed anew.
void CoupledSystem::multiplyFromLast(const CoupledVector& u) const {
    constexpr int kFew = 8;  // of so many vertices one: a column takes longer than a row
    bool isFew = m_isProductKnown;
    m_moved.clear();
    for (int i = 0; isFew && i < m_vertexCount; ++i) {
        const Vec3 velocity = velocityOf(u, i);
        if (velocity != m_v.col(i)) m_moved.push_back({i, velocity});
        isFew = kFew * static_cast<int>(m_moved.size()) <= m_vertexCount;
    }
    m_isProductKnown = m_precision == Precision::Single;  // in double iterations use m_v and m_q
    if (!isFew) {
        velocities(u, m_v);
        m_q.resize(3, m_vertexCount);
        return multiply(m_v, m_q);
    }
    auto shell = m_shells.begin();
    for (const auto& [i, velocity] : m_moved) {
        while (i >= shell->offset + shell->matrix->size()) ++shell;
        shell->matrix->addColumn(i - shell->offset, velocity - m_v.col(i), m_q.data() + 3 * shell->offset);
        m_v.col(i) = velocity;
    }
}

Vec3 CoupledSystem::rowVelocity(const SoftRow& row, const Points& v,
                                const Eigen::Matrix<double, 6, Eigen::Dynamic>& w) const {
    Vec3 u = -row.carried;
    for (int a = 0; a < 3; ++a) u += row.weights[a] * v.col(row.vertices[a]);
    if (row.body >= 0) u -= pointVelocity(w.col(row.body), row.arm);
    return u;
}

Vec3 CoupledSystem::rowImpulse(const SoftRow& row, const Points& v,
                               const Eigen::Matrix<double, 6, Eigen::Dynamic>& w) const {
    return row.load - row.stiffness * rowVelocity(row, v, w);
}

void CoupledSystem::momentum(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w,
                             Eigen::Matrix<double, 6, Eigen::Dynamic>& result) const {
    result.resize(6, bodyCount());
    for (int b = 0; b < bodyCount(); ++b) result.col(b) = m_mass[b] * w.col(b);
    for (const auto& c : m_couplings) {
        result.col(c.a) += c.mass * w.col(c.b);
        result.col(c.b) += c.mass.transpose() * w.col(c.a);
    }
}

void CoupledSystem::apply(const CoupledVector& u, CoupledVector& q) const {
    m_v = u.s;
    for (const auto& c : m_constraints)
        if (c.body >= 0) m_v.col(c.vertex) += c.tie * pointVelocity(u.w.col(c.body), c.arm);
    m_q.resize(3, m_vertexCount);
    multiply(m_v, m_q);
    momentum(u.w, q.w);
    for (const auto& row : m_rows) {
        Vec3 velocity = Vec3::Zero();
        for (int a = 0; a < 3; ++a) velocity += row.weights[a] * m_v.col(row.vertices[a]);
        if (row.body >= 0) velocity -= pointVelocity(u.w.col(row.body), row.arm);
        const Vec3 f = row.stiffness * velocity;
        for (int a = 0; a < 3; ++a) m_q.col(row.vertices[a]) += row.weights[a] * f;
        if (row.body >= 0) q.w.col(row.body) -= pointImpulse(f, row.arm);
    }
    q.s = m_q;
    for (const auto& c : m_constraints) {
        const Vec3 f = m_q.col(c.vertex);
        if (c.body >= 0) q.w.col(c.body) += pointImpulse(c.tie * f, c.arm);
        q.s.col(c.vertex) = c.free * f;
    }
}

namespace {

Eigen::Map<Eigen::Vector3f> at(std::vector<float>& s, int place) {
    return Eigen::Map<Eigen::Vector3f>(s.data() + 4 * static_cast<std::size_t>(place));
}

}  // namespace

void CoupledSystem::apply(CompactVector& u, CompactVector& q) const {
    m_saved.clear();
    for (const auto& c : m_constraints) {
        if (c.body < 0) continue;
        auto v = at(u.s, m_compactPlaces[c.vertex]);
        m_saved.push_back(v);
        v += (c.tie * pointVelocity(u.w.col(c.body), c.arm)).cast<float>();
    }
    for (const auto& shell : m_shells)
        shell.matrix->compact().matrix.multiply(u.s.data() + 4 * shell.offset, q.s.data() + 4 * shell.offset, m_team);
    momentum(u.w, q.w);
    for (const auto& row : m_rows) {
        Vec3 velocity = Vec3::Zero();
        for (int a = 0; a < 3; ++a)
            velocity += row.weights[a] * at(u.s, m_compactPlaces[row.vertices[a]]).cast<double>();
        if (row.body >= 0) velocity -= pointVelocity(u.w.col(row.body), row.arm);
        const Vec3 f = row.stiffness * velocity;
        for (int a = 0; a < 3; ++a) at(q.s, m_compactPlaces[row.vertices[a]]) += (row.weights[a] * f).cast<float>();
        if (row.body >= 0) q.w.col(row.body) -= pointImpulse(f, row.arm);
    }
    if (bodyCount() == 0) return filter(q);
    std::size_t saved = 0;
    for (const auto& c : m_constraints) {
        auto force = at(q.s, m_compactPlaces[c.vertex]);
        const Vec3 f = force.cast<double>();
        force = (c.free * f).cast<float>();
        if (c.body < 0) continue;
        q.w.col(c.body) += pointImpulse(c.tie * f, c.arm);
        at(u.s, m_compactPlaces[c.vertex]) = m_saved[saved++];
    }
}

void CoupledSystem::filter(CompactVector& u) const {
    runRanges(m_team, static_cast<int>(m_constraints.size()), kConstraintsAtATime, [&](int begin, int end) {
        for (int i = begin; i < end; ++i) {
            auto v = at(u.s, m_compactPlaces[m_constraints[i].vertex]);
            v = (m_constraints[i].free * v.cast<double>()).cast<float>();
        }
    });
}

void CoupledSystem::round(const Points& s, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w,
                          CompactVector& result) const {
    runRanges(m_team, m_vertexCount, kVerticesAtATime, [&](int begin, int end) {
        for (int i = begin; i < end; ++i) at(result.s, m_compactPlaces[i]) = s.col(i).cast<float>();
    });
    for (const auto& c : m_constraints)
        at(result.s, m_compactPlaces[c.vertex]) = (c.free * s.col(c.vertex)).cast<float>();
    result.w = w;
}

void CoupledSystem::residual(const CoupledVector& u, CoupledVector& r, Points& unfiltered) const {
    multiplyFromLast(u);
    unfiltered.resize(3, m_vertexCount);
    for (const auto& shell : m_shells)
        runRanges(m_team, static_cast<int>(shell.rhs->cols()), kVerticesAtATime, [&](int begin, int end) {
            unfiltered.middleCols(shell.offset + begin, end - begin) =
                shell.rhs->middleCols(begin, end - begin) - m_q.middleCols(shell.offset + begin, end - begin);
        });
    m_w.resize(6, bodyCount());
    for (int b = 0; b < bodyCount(); ++b) m_w.col(b) = m_freeTwist[b] - u.w.col(b);
    momentum(m_w, r.w);
    for (const auto& row : m_rows) {
        const Vec3 f = rowImpulse(row, m_v, u.w);
        for (int a = 0; a < 3; ++a) unfiltered.col(row.vertices[a]) += row.weights[a] * f;
        if (row.body >= 0) r.w.col(row.body) -= pointImpulse(f, row.arm);
    }
    for (const auto& c : m_constraints)
        if (c.body >= 0) r.w.col(c.body) += pointImpulse(c.tie * unfiltered.col(c.vertex), c.arm);
    if (m_precision == Precision::Single) return;
    r.s = unfiltered;
    for (const auto& c : m_constraints) r.s.col(c.vertex) = c.free * unfiltered.col(c.vertex);
}

void CoupledSystem::filter(CoupledVector& u) const {
    for (const auto& c : m_constraints) u.s.col(c.vertex) = (c.free * u.s.col(c.vertex)).eval();
}

}  // namespace jacket
