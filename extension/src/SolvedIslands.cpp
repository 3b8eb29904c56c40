#include "SolvedIslands.h"

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "BodyTwist.h"
#include "Convert.h"
#include "ObjectId.h"
#include "jacket/bullet/ShellWorld.h"

namespace jacket::bullet {
namespace {

/// Whether a shell may meet a body in the step that the body has made: a vertex is near the body's bounds.
bool isNear(const Shell& shell, const btRigidBody& body, const Vec3& way) {
    btVector3 lower, upper;
    body.getAabb(lower, upper);
    const Vec3 room = Vec3::Constant(shell.meanEdge()) + way.cwiseAbs();
    const Eigen::AlignedBox3d bounds(fromBullet(lower) - room, fromBullet(upper) + room);
    for (const auto& x : shell.positions().colwise())
        if (bounds.contains(x)) return true;
    return false;
}

/// Whether a body has moved otherwise than it was solved to: by more than bodies at rest do, and than the stiff terms
/// for what holds it give way. `impulse`: of the solve.
bool hasStrayed(const btRigidBody& body, double radius, const Vec6& off, const Vec3& impulse, const Vec3& gravity,
                double h) {
    constexpr double kOfRadius = 1e-3;
    const double give = impulse.norm() * double(body.getInvMass()) / kSupport;
    const double way = h * (off.head<3>().norm() + radius * off.tail<3>().norm());
    return way > h * (kStrayAtRest * h * gravity.norm() + give) && way > kOfRadius * radius;
}

bool isFreeBody(const Obstacle& obstacle) {
    return !obstacle.body.prescribed && btRigidBody::upcast(obstacle.object);
}

}  // namespace

void SolvedIslands::begin(const Island& island) {
    if (std::none_of(island.obstacles.begin(), island.obstacles.end(), isFreeBody)) return;
    for (ShellBody* shell : island.shells) {
        shell->m_before.velocities = shell->m_shell.velocities();
        shell->m_before.exchanged = shell->m_exchanged;
        shell->m_before.frictionLoss = shell->m_frictionLoss;
    }
}

void SolvedIslands::end(const Island& island, std::span<const CoupledBody> coupled, double h) {
    Solved solved(&m_memory);
    for (std::size_t b = 0; b < coupled.size(); ++b) {
        if (coupled[b].prescribed) continue;
        if (!isFreeBody(island.obstacles[b])) return;  // what a link was given moves others
        btCollisionObject* object = island.obstacles[b].object;
        solved.bodies.push_back({object,
                                 object->getBroadphaseHandle()->getUid(),
                                 coupled[b].radius,
                                 coupled[b].motion / h,
                                 {island.obstacles[b].start, coupled[b].impulse}});
    }
    if (solved.bodies.empty()) return;
    solved.shells.assign(island.shells.begin(), island.shells.end());
    for (ShellBody* shell : solved.shells) shell->m_before.revision = shell->shell().revision();
    m_islands.push_back(std::move(solved));
}

void SolvedIslands::forget(const ShellBody& shell) {
    std::erase_if(m_islands, [&](const Solved& island) {
        return std::find(island.shells.begin(), island.shells.end(), &shell) != island.shells.end();
    });
}

/// Where its user has changed a shell or taken a body away, a solve is not done again.
bool SolvedIslands::isVoid(const btCollisionWorld& world, const Solved& island, const Vec3& gravity, double h) const {
    for (const ShellBody* shell : island.shells)
        if (shell->isAsleep() || !shell->m_hasVelocity || shell->shell().revision() != shell->m_before.revision)
            return false;
    bool hasAnyStrayed = false;
    for (const auto& [object, id, radius, solved, solve] : island.bodies) {
        if (idOf(world, object) != id || object->isStaticOrKinematicObject() || !object->isActive()) return false;
        const btRigidBody& body = *btRigidBody::upcast(object);
        const Vec6 twist = twistBetween(solve.start, fromBullet(object->getWorldTransform()), h);
        if (!hasStrayed(body, radius, twist - solved, solve.impulse.head<3>(), gravity, h)) continue;
        const Vec3 way = h * twist.head<3>();
        if (!way.allFinite() || isTeleport(*object, way.norm(), h)) return false;
        hasAnyStrayed = hasAnyStrayed || std::any_of(island.shells.begin(), island.shells.end(),
                                                     [&](const ShellBody* s) { return isNear(s->shell(), body, way); });
    }
    return hasAnyStrayed;
}

AllTakenBack SolvedIslands::takeBack(const btCollisionWorld& world, const Vec3& gravity, double h) const {
    AllTakenBack given(&m_memory);
    for (const Solved& island : m_islands) {
        if (!isVoid(world, island, gravity, h)) continue;
        for (const Body& body : island.bodies) given[body.object] = body.solve;
        for (ShellBody* shell : island.shells) {
            shell->m_shell.setVelocities(shell->m_before.velocities);
            shell->m_exchanged = shell->m_before.exchanged;
            shell->m_frictionLoss = shell->m_before.frictionLoss;
            shell->forgetSolvedVelocity();
        }
    }
    return given;
}

}  // namespace jacket::bullet
