#include "CarriedVertices.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "ObjectId.h"

namespace jacket::bullet {
namespace {

constexpr double kTeleport = 50.0;  // a body that strays faster than this from what was solved was teleported [m/s]

/// Velocity of a point at `arm` per unit of linear and angular velocity.
Eigen::Matrix<double, 3, 6> motionOf(const Vec3& arm) {
    Eigen::Matrix<double, 3, 6> rows;
    rows << Mat3::Identity(), Mat3::Zero();
    for (int k = 0; k < 3; ++k) rows.col(3 + k) = Vec3::Unit(k).cross(arm);
    return rows;
}

}  // namespace

void CarriedVertices::add(ShellBody& shell, int vertex, const Obstacle& obstacle, const Vec6& twist,
                          const Vec3* anchor) {
    std::optional<Vec3> local;
    if (anchor) local = obstacle.start.inverse(Eigen::Isometry) * *anchor;
    m_vertices.push_back({&shell, vertex, obstacle.object, obstacle.object->getBroadphaseHandle()->getUid(),
                          obstacle.start, twist, local});
}

void CarriedVertices::move(const btCollisionWorld& world, double h) {
    m_shells.clear();
    for (const Carried& carried : m_vertices)
        if (!carried.shell->isAsleep() && std::find(m_shells.begin(), m_shells.end(), carried.shell) == m_shells.end())
            m_shells.push_back(carried.shell);
    for (ShellBody* body : m_shells) {
        findShifts(*body, world, h);
        Shell& shell = body->m_shell;
        if (shell.isStiff(h)) moveAsOne(*body, m_shifts);
        for (const auto& [carried, by] : m_shifts) shell.displace(carried->vertex, by);
    }
    m_vertices.clear();
}

void CarriedVertices::findShifts(const ShellBody& shell, const btCollisionWorld& world, double h) {
    m_shifts.clear();
    for (const Carried& c : m_vertices) {
        if (c.shell != &shell || idOf(world, c.object) != c.objectId) continue;
        const Vec3 assumed = shell.shell().positions().col(c.vertex);
        const Vec3 local = c.anchor ? *c.anchor : moved(c.start, c.twist, h).inverse(Eigen::Isometry) * assumed;
        const Vec3 by = fromBullet(c.object->getWorldTransform()) * local - assumed;
        if (by.norm() < kTeleport * h && by.allFinite()) m_shifts.push_back({&c, by});
    }
}

/// The vertices of a stiff shell move together, or contacts would bend it: the rigid motion that is nearest to what
/// those that touch are to do, the least one of them. What is tied to a body has the rest of its way to go.
void CarriedVertices::moveAsOne(ShellBody& body, std::vector<Shift>& shifts) {
    constexpr double kInertia = 1e-6;  // weight of the vertices that are not carried
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
    const Vec6 motion = shell.pinCount() > 0 ? Vec6(Vec6::Zero()) : Vec6(matrix.ldlt().solve(rhs));
    std::erase_if(shifts, [](const Shift& shift) { return !shift.carried->anchor; });
    for (auto& [carried, by] : shifts) by -= motionOf(x.col(carried->vertex) - centre) * motion;
    for (int i = 0; i < shell.vertexCount() && shell.pinCount() == 0; ++i)
        shell.displace(i, motionOf(x.col(i) - centre) * motion);
}

}  // namespace jacket::bullet
