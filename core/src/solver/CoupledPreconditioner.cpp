#include "solver/CoupledPreconditioner.h"

#include <Eigen/LU>
#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "solver/CompactShell.h"

namespace jacket {
void CoupledPreconditioner::build(const CoupledSystem& system, Preconditioner kind, bool keepsCoarse) {
    m_kind = system.precision() == Precision::Single ? Preconditioner::IncompleteCholesky : kind;
    m_factors.resize(system.shells().size());
    m_inverseBlocks.resize(system.shells().size());
    m_complete.resize(system.shells().size());
    for (std::size_t i = 0; i < system.shells().size(); ++i) buildShell(system, i, m_kind, keepsCoarse);
    updateBodies(system);
}

void CoupledPreconditioner::buildShell(const CoupledSystem& system, std::size_t shell, Preconditioner kind,
                                       bool keepsCoarse) {
    const auto& part = system.shells()[shell];
    m_filtered.begin(*part.matrix, kind == Preconditioner::BlockJacobi);
    addRows(system, part);
    filterBlocks(system, part);
    if (factorCompletely(system, shell)) return;
    if (isCompact(system, shell)) {
        CompactShell& compact = part.matrix->compact();
        compact.factor.factor(m_filtered, system.team());
        if (!keepsCoarse || !compact.coarse || !knowsContacts(system, part, *compact.coarse)) buildCoarse(system, part);
        return;
    }
    if (kind == Preconditioner::IncompleteCholesky) {
        m_factors[shell].factor(m_filtered);
    } else {
        m_inverseBlocks[shell].resize(part.matrix->diagonal().size());
        for (int i = 0; i < part.matrix->size(); ++i) m_inverseBlocks[shell][i] = m_filtered.diagonal(i).inverse();
    }
}

bool CoupledPreconditioner::factorCompletely(const CoupledSystem& system, std::size_t shell) {
    const auto& part = system.shells()[shell];
    if (!part.isFactored || !m_filtered.hasLower() || system.precision() == Precision::Single) {
        m_complete[shell].reset();
        return false;
    }
    if (!m_complete[shell]) m_complete[shell] = std::make_unique<ShellFactor>();
    findFree(system, part);
    if (m_complete[shell]->factor(m_filtered, m_free)) return true;
    m_complete[shell].reset();
    return false;
}

bool CoupledPreconditioner::isComplete() const {
    return std::any_of(m_complete.begin(), m_complete.end(), [](const auto& factor) { return factor != nullptr; });
}

void CoupledPreconditioner::findFree(const CoupledSystem& system, const CoupledSystem::ShellPart& part) {
    m_free.assign(part.matrix->size(), nullptr);
    for (const auto& c : system.constraints())
        if (part.has(c.vertex)) m_free[c.vertex - part.offset] = &c.free;
}

/// Whether about as many vertices are constrained as when it was built: no more have come or gone than it has patches.
bool CoupledPreconditioner::knowsContacts(const CoupledSystem& system, const CoupledSystem::ShellPart& part,
                                          const CoarseSpace& coarse) {
    const auto held = std::count_if(system.constraints().begin(), system.constraints().end(),
                                    [&](const auto& c) { return part.has(c.vertex); });
    return std::abs(static_cast<int>(held) - coarse.heldCount()) <= coarse.patchCount();
}

void CoupledPreconditioner::buildCoarse(const CoupledSystem& system, const CoupledSystem::ShellPart& part) {
    CompactShell& compact = part.matrix->compact();
    if (!part.positions) return compact.coarse.reset();
    if (!compact.coarse) compact.coarse = std::make_unique<CoarseSpace>(compact.matrix);
    const std::vector<int>& rowOf = compact.matrix.rowOf();
    m_free.assign(part.matrix->size(), nullptr);
    for (const auto& c : system.constraints())
        if (part.has(c.vertex)) m_free[rowOf[c.vertex - part.offset]] = &c.free;
    m_ties.clear();
    for (const auto& row : system.rows()) {
        if (!part.has(row.vertices[0])) continue;
        CoarseSpace::Tie tie{.rows = {}, .weights = row.weights, .stiffness = row.stiffness};
        for (int a = 0; a < 3; ++a) tie.rows[a] = rowOf[row.vertices[a] - part.offset];
        m_ties.push_back(tie);
    }
    compact.coarse->build(compact.matrix, *part.positions, m_free, m_ties, system.team());
}

bool CoupledPreconditioner::isCompact(const CoupledSystem& system, std::size_t shell) const {
    return system.precision() == Precision::Single || (system.shells()[shell].isCompact && !m_complete[shell]);
}

bool CoupledPreconditioner::isCoarse(const CoupledSystem& system) const {
    return system.precision() == Precision::Single &&
           std::all_of(system.shells().begin(), system.shells().end(),
                       [](const auto& part) { return part.matrix->compact().coarse != nullptr; });
}

void CoupledPreconditioner::addRows(const CoupledSystem& system, const CoupledSystem::ShellPart& part) {
    for (const auto& row : system.rows()) {
        if (!part.has(row.vertices[0])) continue;
        for (int a = 0; a < 3; ++a) {
            if (row.weights[a] == 0.0) continue;
            const int i = row.vertices[a] - part.offset;
            m_filtered.alterDiagonal(i) += row.weights[a] * row.weights[a] * row.stiffness;
            for (int b = 0; b < 3 && m_filtered.hasLower(); ++b) {
                const int j = row.vertices[b] - part.offset;
                if (j < i && row.weights[b] != 0.0)
                    m_filtered.alterLower(part.matrix->slot(i, j)) += row.weights[a] * row.weights[b] * row.stiffness;
            }
        }
    }
}

void CoupledPreconditioner::filterBlocks(const CoupledSystem& system, const CoupledSystem::ShellPart& part) {
    const auto free = [&](int vertex) { return system.constraintOf(vertex + part.offset); };
    for (int i = 0; i < part.matrix->size(); ++i) {
        const VertexConstraint* ci = free(i);
        if (ci) {
            Mat3& block = m_filtered.alterDiagonal(i);
            const double scale = block.trace() / 3.0;
            const Mat3 filtered = ci->free * block * ci->free;
            block = filtered + scale * (Mat3::Identity() - ci->free);
        }
        if (!m_filtered.hasLower()) continue;
        for (int k = part.matrix->rowBegin(i); k < part.matrix->rowEnd(i); ++k) {
            const VertexConstraint* cj = free(part.matrix->column(k));
            if (!ci && !cj) continue;
            Mat3& block = m_filtered.alterLower(k);
            if (ci) block = (ci->free * block).eval();
            if (cj) block = (block * cj->free).eval();
        }
    }
}

void CoupledPreconditioner::updateBodies(const CoupledSystem& system) {
    std::vector<Mat6>& blocks = m_bodyBlocks;
    blocks = system.mass();
    for (const auto& part : system.shells()) {
        for (int i = 0; i < part.matrix->size(); ++i) {
            const VertexConstraint* ci = system.constraintOf(i + part.offset);
            if (!ci || ci->body < 0) continue;
            blocks[ci->body] += pointStiffness(ci->tie * part.matrix->diagonal()[i] * ci->tie, ci->arm);
            for (int k = part.matrix->rowBegin(i); k < part.matrix->rowEnd(i); ++k) {
                const VertexConstraint* cj = system.constraintOf(part.matrix->column(k) + part.offset);
                if (!cj || cj->body != ci->body) continue;
                const Mat6 block = pointStiffness(ci->tie * part.matrix->lower()[k] * cj->tie, ci->arm, cj->arm);
                blocks[ci->body] += block + block.transpose();
            }
        }
    }
    for (const auto& row : system.rows())
        if (row.body >= 0) blocks[row.body] += pointStiffness(row.stiffness, row.arm);
    m_bodies.resize(blocks.size());
    for (std::size_t b = 0; b < blocks.size(); ++b) m_bodies[b].compute(blocks[b]);
    m_groupCount = 0;
    if (!system.couplings().empty()) factorGroups(system);
    m_isEliminating = isComplete() && system.bodyCount() > 0;
    if (m_isEliminating) eliminateShells(system);
}

/// C - B^T A^-1 B of the bodies, A and B those of the shells that are factored completely: a stiff shell and a body
/// that move as one have little inertia beside what each has against the other.
void CoupledPreconditioner::eliminateShells(const CoupledSystem& system) {
    const int size = 6 * system.bodyCount();
    Eigen::MatrixXd& schur = m_schurMatrix;
    schur.resize(size, size);
    CoupledVector& unit = m_unit;
    unit.resize(system.vertexCount(), system.bodyCount());
    m_columns.resize(size);
    m_solved.resize(size);
    for (int k = 0; k < size; ++k) {
        unit.w.setZero();
        unit.w(k % 6, k / 6) = 1.0;
        m_columns[k].resize(system.vertexCount(), system.bodyCount());
        m_solved[k].resize(system.vertexCount(), system.bodyCount());
        system.apply(unit, m_columns[k]);
        schur.col(k) = m_columns[k].w.reshaped();
        for (std::size_t i = 0; i < m_complete.size(); ++i) {
            const int offset = 3 * system.shells()[i].offset;
            if (m_complete[i]) m_complete[i]->apply(m_columns[k].s.data() + offset, m_solved[k].s.data() + offset);
        }
        system.filter(m_solved[k]);
    }
    for (int a = 0; a < size; ++a)
        for (int b = 0; b < size; ++b) schur(a, b) -= alongComplete(system, m_columns[a].s, m_solved[b].s);
    m_schur.compute(schur);
}

/// a . b over the shells that are factored completely.
double CoupledPreconditioner::alongComplete(const CoupledSystem& system, const Points& a, const Points& b) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < m_complete.size(); ++i) {
        const auto& part = system.shells()[i];
        if (!m_complete[i]) continue;
        sum += a.middleCols(part.offset, part.matrix->size())
                   .cwiseProduct(b.middleCols(part.offset, part.matrix->size()))
                   .sum();
    }
    return sum;
}

/// For every body the first body of its group.
void CoupledPreconditioner::findLeaders(const CoupledSystem& system) {
    m_leader.resize(system.bodyCount());
    std::iota(m_leader.begin(), m_leader.end(), 0);
    for (const auto& coupling : system.couplings()) {
        const auto [low, high] = std::minmax(m_leader[coupling.a], m_leader[coupling.b]);
        std::replace(m_leader.begin(), m_leader.end(), int(high), int(low));
    }
}

void CoupledPreconditioner::factorGroups(const CoupledSystem& system) {
    findLeaders(system);
    m_place.resize(m_leader.size());
    for (int first = 0; first < system.bodyCount(); ++first) {
        const auto size = static_cast<std::size_t>(std::count(m_leader.begin(), m_leader.end(), first));
        if (size > 1) factorGroup(system, first, size);
    }
}

/// One that has the memory for so many bodies, if there is one.
CoupledPreconditioner::BodyGroup& CoupledPreconditioner::takeGroup(std::size_t size) {
    const std::size_t place = m_groupCount++;
    std::size_t fitting = place;
    while (fitting < m_groups.size() && m_groups[fitting].bodies.size() != size) ++fitting;
    if (fitting == m_groups.size()) m_groups.emplace_back();
    std::swap(m_groups[place], m_groups[fitting]);
    return m_groups[place];
}

void CoupledPreconditioner::factorGroup(const CoupledSystem& system, int first, std::size_t count) {
    BodyGroup& group = takeGroup(count);
    group.bodies.clear();
    for (int b = first; b < system.bodyCount(); ++b) {
        if (m_leader[b] != first) continue;
        m_place[b] = 6 * static_cast<int>(group.bodies.size());
        group.bodies.push_back(b);
    }
    const auto size = 6 * static_cast<Eigen::Index>(group.bodies.size());
    group.matrix.setZero(size, size);
    group.part.resize(size);
    for (const int b : group.bodies) group.matrix.block<6, 6>(m_place[b], m_place[b]) = m_bodyBlocks[b];
    for (const auto& c : system.couplings()) {
        if (m_leader[c.a] != first) continue;
        group.matrix.block<6, 6>(m_place[c.a], m_place[c.b]) += c.mass;
        group.matrix.block<6, 6>(m_place[c.b], m_place[c.a]) += c.mass.transpose();
    }
    group.factor.compute(group.matrix);
}

/// In single precision what is computed with in double: iterations need to know P no better.
void CoupledPreconditioner::applyCompact(const CoupledSystem::ShellPart& part, const Points& r, Points& z,
                                         WorkerTeam* team) const {
    constexpr int kRowsAtATime = 1024;
    const CompactShell& compact = part.matrix->compact();
    const std::vector<int>& vertexOf = compact.matrix.vertexOf();
    const int count = static_cast<int>(vertexOf.size());
    m_rounded.resize(4 * vertexOf.size());
    m_roundedZ.resize(4 * vertexOf.size());
    const auto forRows = [&](const auto& visit) {
        runRanges(team, count, kRowsAtATime, [&](int begin, int end) {
            for (int row = begin; row < end; ++row)
                visit(4 * static_cast<std::size_t>(row), part.offset + vertexOf[row]);
        });
    };
    forRows([&](std::size_t at, int vertex) {
        Eigen::Map<Eigen::Vector4f>(m_rounded.data() + at) << r.col(vertex).cast<float>(), 0.0f;
    });
    compact.precondition(m_rounded.data(), m_roundedZ.data(), team);
    forRows([&](std::size_t at, int vertex) {
        z.col(vertex) = Eigen::Map<const Eigen::Vector3f>(m_roundedZ.data() + at).cast<double>();
    });
}

void CoupledPreconditioner::apply(const CoupledSystem& system, const CoupledVector& r, CoupledVector& z) const {
    for (std::size_t i = 0; i < system.shells().size(); ++i) {
        const auto& part = system.shells()[i];
        if (m_complete[i]) {
            m_complete[i]->apply(r.s.data() + 3 * part.offset, z.s.data() + 3 * part.offset);
        } else if (isCompact(system, i)) {
            applyCompact(part, r.s, z.s, system.team());
        } else if (m_kind == Preconditioner::IncompleteCholesky) {
            m_factors[i].apply(r.s.data() + 3 * part.offset, z.s.data() + 3 * part.offset);
        } else {
            for (int k = 0; k < part.matrix->size(); ++k)
                z.s.col(k + part.offset).noalias() = m_inverseBlocks[i][k] * r.s.col(k + part.offset);
        }
    }
    system.filter(z);
    if (!m_isEliminating) return applyToBodies(r.w, z.w);
    Eigen::VectorXd& twists = m_twists;
    twists = r.w.reshaped();
    for (Eigen::Index k = 0; k < twists.size(); ++k) twists[k] -= alongComplete(system, m_columns[k].s, z.s);
    m_schur.solveInPlace(twists);
    for (Eigen::Index k = 0; k < twists.size(); ++k) z.s -= twists[k] * m_solved[k].s;
    z.w.reshaped() = twists;
}

void CoupledPreconditioner::apply(const CoupledSystem& system, const CompactVector& r, CompactVector& z) const {
    for (const auto& part : system.shells()) {
        const std::size_t first = 4 * static_cast<std::size_t>(part.offset);
        part.matrix->compact().precondition(r.s.data() + first, z.s.data() + first, system.team());
    }
    applyToBodies(r.w, z.w);
    system.filter(z);
}

void CoupledPreconditioner::applyToBodies(const Eigen::Matrix<double, 6, Eigen::Dynamic>& r,
                                          Eigen::Matrix<double, 6, Eigen::Dynamic>& z) const {
    for (std::size_t b = 0; b < m_bodies.size(); ++b) z.col(b) = m_bodies[b].solve(r.col(b));
    for (const BodyGroup& group : std::span(m_groups).first(m_groupCount)) {
        for (std::size_t k = 0; k < group.bodies.size(); ++k) group.part.segment<6>(6 * k) = r.col(group.bodies[k]);
        group.factor.solveInPlace(group.part);
        for (std::size_t k = 0; k < group.bodies.size(); ++k) z.col(group.bodies[k]) = group.part.segment<6>(6 * k);
    }
}

}  // namespace jacket
