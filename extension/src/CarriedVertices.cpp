#include "CarriedVertices.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>

#include "ObjectId.h"
#include "SolvedIslands.h"
#include "jacket/Island.h"

namespace jacket::bullet {
namespace {

/// Velocity of a point at `arm` per unit of linear and angular velocity.
Eigen::Matrix<double, 3, 6> motionOf(const Vec3& arm) {
    Eigen::Matrix<double, 3, 6> rows;
    rows << Mat3::Identity(), Mat3::Zero();
    for (int k = 0; k < 3; ++k) rows.col(3 + k) = Vec3::Unit(k).cross(arm);
    return rows;
}

/// About what moving one vertex of a shell strains it by while its neighbours stay [J].
double strainOf(const Shell& shell, const Vec3& by) {
    constexpr double kNeighbourhood = 4.0;  // stiffness against that, in E t
    return 0.5 * kNeighbourhood * shell.material().stretchStiffness() * by.squaredNorm();
}

}  // namespace

void CarriedVertices::addTouching(ShellBody& shell, int vertex, const Obstacle& obstacle, const Frame& end,
                                  const Vec3& normal) {
    shell.m_ahead.resize(3, shell.m_shell.vertexCount());  // now, or a later step would ask for it
    m_vertices.push_back(
        {&shell, vertex, obstacle.object, obstacle.object->getBroadphaseHandle()->getUid(), end, std::nullopt, normal});
}

void CarriedVertices::addTied(ShellBody& shell, int vertex, const Obstacle& obstacle, const Frame& end,
                              const Vec3& point) {
    shell.m_ahead.resize(3, shell.m_shell.vertexCount());
    m_vertices.push_back({&shell, vertex, obstacle.object, obstacle.object->getBroadphaseHandle()->getUid(), end,
                          obstacle.start.inverse(Eigen::Isometry) * point, Vec3::Zero()});
}

void CarriedVertices::move(const btCollisionWorld& world, const Vec3& gravity, double h) {
    const bool areAllAsleep = m_vertices.empty() && !m_hasMoved;
    m_hasMoved = !m_vertices.empty();
    if (areAllAsleep) return;
    std::erase_if(m_vertices, [&](const Carried& c) { return idOf(world, c.object) != c.objectId; });
    m_goals.clear();
    for (const Carried& c : m_vertices) m_goals.push_back(fromBullet(c.object->getWorldTransform()));
    carry(m_vertices, m_goals, gravity, h);
    for (std::size_t i = 0; i < m_vertices.size(); ++i) m_vertices[i].end = m_goals[i];
    std::erase_if(m_moved, [](const Carried& c) { return !c.shell->isAsleep(); });
    m_moved.insert(m_moved.end(), m_vertices.begin(), m_vertices.end());
    m_vertices.clear();
}

void CarriedVertices::moveToStart(const btCollisionWorld& world, Obstacles& obstacles, const Vec3& gravity, double h) {
    std::erase_if(m_vertices, [](const Carried& c) { return !c.shell->m_hasVelocity; });  // of a solve that is void
    std::erase_if(m_moved, [&](const Carried& c) { return idOf(world, c.object) != c.objectId || !isLed(*c.object); });
    const auto isToMove = [](const Carried& c) { return !c.shell->m_hasVelocity && !c.shell->isAsleep(); };
    const auto others = std::partition(m_moved.begin(), m_moved.end(), isToMove);
    m_goals.clear();
    for (auto c = m_moved.begin(); c != others; ++c) {
        const bool isAsBefore = c != m_moved.begin() && std::prev(c)->object == c->object;
        m_goals.push_back(isAsBefore ? Frame(m_goals.back()) : obstacles.startOf(*c->object, h));
    }
    carry({m_moved.begin(), others}, m_goals, gravity, h);
    m_moved.erase(m_moved.begin(), others);
}

void CarriedVertices::forget(const ShellBody& shell) {
    for (auto* vertices : {&m_vertices, &m_moved})
        std::erase_if(*vertices, [&](const Carried& c) { return c.shell == &shell; });
}

void CarriedVertices::carry(std::span<const Carried> vertices, std::span<const Frame> goals, const Vec3& gravity,
                            double h) {
    m_shells.clear();
    for (const Carried& carried : vertices)
        if (!carried.shell->isAsleep() && std::find(m_shells.begin(), m_shells.end(), carried.shell) == m_shells.end())
            m_shells.push_back(carried.shell);
    for (ShellBody* body : m_shells) {
        findShifts(*body, vertices, goals, h);
        Shell& shell = body->m_shell;
        const bool isStiff = shell.isStiff(h);
        if (isStiff) moveAsOne(*body, m_shifts);
        bringAlong(*body, gravity, h);
        if (!isStiff) spare(*body, gravity, h);
        for (const auto& [carried, by] : m_shifts) shell.displace(carried->vertex, by);
    }
}

void CarriedVertices::findShifts(const ShellBody& shell, std::span<const Carried> vertices,
                                 std::span<const Frame> goals, double h) {
    m_shifts.clear();
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        const Carried& c = vertices[i];
        if (c.shell != &shell) continue;
        const Vec3 assumed = shell.shell().positions().col(c.vertex);
        const Vec3 local = c.anchor ? *c.anchor : c.end.inverse(Eigen::Isometry) * assumed;
        const Vec3 by = goals[i] * local - assumed;
        if (by.norm() < kTeleportSpeed * h && by.allFinite()) m_shifts.push_back({&c, by});
    }
}

/// Where a body was stopped, or struck, a vertex that alone followed it would tear at the shell. If that is more than
/// its energy allows for, all of the shell follows. What even that would strain by more than its energy is left to the
/// next solve, and so is what bodies at rest stray by: that solve knows the shell's contacts.
void CarriedVertices::bringAlong(ShellBody& body, const Vec3& gravity, double h) {
    constexpr double kLittle = 0.01;  // of the energy of motion
    Shell& shell = body.m_shell;
    const double moving = energyOfMotion(shell, gravity, h);
    if (strainAlone(shell, true) <= kLittle * moving) return;
    const double before = shell.elasticEnergy(shell.positions());
    if (energyAfter(body, 0.0) <= before + kLittle * moving) return;
    const double little = kStrayAtRest * h * h * gravity.norm();
    const bool isLittle = std::all_of(m_shifts.begin(), m_shifts.end(), [&](const Shift& shift) {
        return !shift.carried->isTied() || shift.by.norm() < little;
    });
    const std::optional<Points> way = isLittle ? std::nullopt : wayOfAll(shell, h);
    if (way && energyAlong(body, *way) <= before + moving)
        follow(shell, *way);
    else
        std::erase_if(m_shifts, [](const Shift& shift) { return shift.carried->isTied(); });
}

/// How all of a shell follows what is tied to a body, by its inertia and its stiffness: as in a step from standing
/// still in which that is led to its anchor, less the same step with the anchors where they are. In that it springs
/// back from whatever holds it, and would go into what it lies on. Velocities stay as they are. None if a solve came to
/// nothing.
std::optional<Points> CarriedVertices::wayOfAll(Shell& shell, double h) const {
    const std::optional<Points> led = wayWhenLed(shell, h, 1.0), left = wayWhenLed(shell, h, 0.0);
    return led && left ? std::optional<Points>(*led - *left) : std::nullopt;
}

/// Way of all vertices without contacts and gravity, from standing still, while what is tied is led by a share of its
/// own.
std::optional<Points> CarriedVertices::wayWhenLed(Shell& shell, double h, double share) const {
    std::vector<CoupledBody> leaders;
    std::vector<Anchor> led;
    for (const auto& [carried, by] : m_shifts) {
        if (!carried->isTied()) continue;
        led.push_back({0, carried->vertex, static_cast<int>(leaders.size()), shell.positions().col(carried->vertex)});
        CoupledBody& leader = leaders.emplace_back();
        leader.prescribed = true;
        leader.freeTwist.head<3>() = share / h * by;
    }
    const Points velocities = shell.velocities();
    shell.setVelocities(Points::Zero(3, shell.vertexCount()));
    Shell* const one = &shell;
    IslandSolver solver;  // a new one: what others have solved is no start for this
    const bool isFinite =
        solver.solve({.h = h, .gravity = Vec3::Zero(), .shells = {&one, 1}, .bodies = leaders, .anchors = led}).finite;
    const Points way = h * shell.velocities();
    shell.setVelocities(velocities);
    return isFinite ? std::optional(way) : std::nullopt;
}

/// Elastic, when all vertices have gone a way, and what is tied all of its own [J].
double CarriedVertices::energyAlong(ShellBody& body, const Points& way) const {
    const Points& x = body.m_shell.positions();
    body.m_ahead = x + way;
    for (const auto& [carried, by] : m_shifts)
        if (carried->isTied()) body.m_ahead.col(carried->vertex) = x.col(carried->vertex) + by;
    return body.m_shell.elasticEnergy(body.m_ahead);
}

/// All vertices go a way. What is tied has the rest of its own to go.
void CarriedVertices::follow(Shell& shell, const Points& way) {
    for (int i = 0; i < shell.vertexCount(); ++i) shell.displace(i, way.col(i));
    for (auto& [carried, by] : m_shifts)
        if (carried->isTied()) by -= way.col(carried->vertex);
}

/// Of vertices that moved alone, each about what strainOf says: of those that are tied, or of those that touch [J].
double CarriedVertices::strainAlone(const Shell& shell, bool ofTied) const {
    double sum = 0.0;
    for (const auto& [carried, by] : m_shifts)
        if (carried->isTied() == ofTied) sum += strainOf(shell, by);
    return sum;
}

/// Or what gravity would give it in a step, if it rests [J].
double CarriedVertices::energyOfMotion(const Shell& shell, const Vec3& gravity, double h) {
    return shell.kineticEnergy() + 0.5 * shell.masses().sum() * (h * gravity).squaredNorm();
}

/// Where bodies have done something else by far, what touches them would strain the shell by it, by any amount. It goes
/// along as far as that does not double the shell's energy, and if it cannot go all of the way, along the normals
/// alone: what is left of the way the next solve sees, as a gap or a depth, with what it costs.
void CarriedVertices::spare(ShellBody& body, const Vec3& gravity, double h) {
    constexpr int kMostHalvings = 6;
    const Shell& shell = body.m_shell;
    const double stretching = strainAlone(shell, false);
    if (stretching == 0.0) return;
    const double moving = energyOfMotion(shell, gravity, h);
    if (stretching <= moving) return;
    const double before = energyAfter(body, 0.0), most = moving + 2.0 * before;
    if (energyAfter(body, 1.0) <= most) return;
    for (auto& [carried, by] : m_shifts)
        if (!carried->isTied()) by = carried->normal.dot(by) * carried->normal;
    double share = 1.0;
    for (int halving = 0; halving < kMostHalvings && energyAfter(body, share) > most; ++halving) share *= 0.5;
    if (energyAfter(body, share) > most) share = 0.0;
    for (auto& [carried, by] : m_shifts)
        if (!carried->isTied()) by *= share;
}

/// Elastic, when what is tied has gone all of its way and what touches a share of it [J].
double CarriedVertices::energyAfter(ShellBody& body, double share) const {
    body.m_ahead = body.m_shell.positions();
    for (const auto& [carried, by] : m_shifts)
        body.m_ahead.col(carried->vertex) += (carried->isTied() ? 1.0 : share) * by;
    return body.m_shell.elasticEnergy(body.m_ahead);
}

/// The vertices of a stiff shell move together, or contacts would bend it: the rigid motion that is nearest to what
/// those that touch are to do, the least one of them. What is tied to a body has the rest of its way to go.
void CarriedVertices::moveAsOne(ShellBody& body, std::vector<Shift>& shifts) {
    constexpr double kInertia = 1e-6;  // weight of the vertices that are not carried
    constexpr double kMostTurn = 0.2;  // [rad]
    Shell& shell = body.m_shell;
    const Points& x = shell.positions();
    const Vec3 centre = x.rowwise().mean();
    Mat6 matrix = Mat6::Zero();
    Vec6 rhs = Vec6::Zero();
    for (int i = 0; i < shell.vertexCount(); ++i) {
        const Eigen::Matrix<double, 3, 6> rows = motionOf(x.col(i) - centre);
        matrix += kInertia / shell.vertexCount() * rows.transpose() * rows;
    }
    for (const auto& [carried, by] : shifts) {
        const Eigen::Matrix<double, 3, 6> rows = motionOf(x.col(carried->vertex) - centre);
        matrix += rows.transpose() * rows;
        rhs += rows.transpose() * by;
    }
    Vec6 motion = shell.pinCount() > 0 ? Vec6(Vec6::Zero()) : Vec6(matrix.ldlt().solve(rhs));
    const double angle = motion.tail<3>().norm();
    if (angle > kMostTurn) motion *= kMostTurn / angle;
    const Mat3 turn = Eigen::AngleAxisd(std::min(angle, kMostTurn), motion.tail<3>().normalized()).toRotationMatrix();
    const auto way = [&](int i) -> Vec3 {  // a turn that is none to first order alone: that would stretch the shell
        const Vec3 arm = x.col(i) - centre;
        return motion.head<3>() + turn * arm - arm;
    };
    std::erase_if(shifts, [](const Shift& shift) { return !shift.carried->isTied(); });
    for (auto& [carried, by] : shifts) by -= way(carried->vertex);
    for (int i = 0; i < shell.vertexCount() && shell.pinCount() == 0; ++i) shell.displace(i, way(i));
}

}  // namespace jacket::bullet
