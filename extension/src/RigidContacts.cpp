#include "RigidContacts.h"

#include <BulletCollision/BroadphaseCollision/btDispatcher.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <Eigen/Cholesky>
#include <algorithm>

#include "Checks.h"
#include "Obstacles.h"
#include "jacket/Types.h"

namespace jacket::bullet {
namespace {

constexpr std::size_t kMostJoined = 32;  // bodies of all piles: their masses are factored together

bool isFree(const btCollisionObject& object) {
    const btRigidBody* body = btRigidBody::upcast(&object);
    return body && body->getInvMass() > btScalar(0) && body->isActive() && !body->isStaticOrKinematicObject();
}

double linearMassOf(const btRigidBody& body) {
    return 1.0 / double(body.getInvMass());
}

bool bears(const btManifoldPoint& point) {
    return point.m_appliedImpulse > btScalar(0);
}

int loadedPoints(const btPersistentManifold& manifold) {
    int count = 0;
    for (int k = 0; k < manifold.getNumContacts(); ++k) count += bears(manifold.getContactPoint(k));
    return count;
}

const btCollisionObject* otherThan(const btCollisionObject& object, const btPersistentManifold& manifold) {
    return manifold.getBody0() == &object ? manifold.getBody1() : manifold.getBody0();
}

/// Velocity that a body's point will have after the coming step if nothing touches the body.
Vec3 pointVelocity(const btRigidBody& body, const Vec3& at, double h) {
    const Vec6 twist = body.isStaticOrKinematicObject() ? twistOf(body) : freeTwistOf(body, h);
    return twist.head<3>() + twist.tail<3>().cross(at - fromBullet(body.getCenterOfMassPosition()));
}

/// Velocity of a body's point along a direction, from its twist.
Vec6 rowOf(const Vec3& direction, const Vec3& at, const Vec3& centre) {
    return (Vec6() << direction, (at - centre).cross(direction)).finished();
}

}  // namespace

Vec6 twistOf(const btRigidBody& body) {
    Vec6 twist;
    twist << fromBullet(body.getLinearVelocity()), fromBullet(body.getAngularVelocity());
    return twist;
}

Vec6 freeTwistOf(const btRigidBody& body, double h) {
    Vec6 twist = twistOf(body);
    if (!body.isActive()) return twist;
    twist.head<3>() += h * double(body.getInvMass()) * fromBullet(body.getTotalForce());
    twist.tail<3>() += h * (fromBullet(body.getInvInertiaTensorWorld()) * fromBullet(body.getTotalTorque()));
    return twist;
}

void RigidContacts::index() {
    for (int m = 0; m < m_dispatcher.getNumManifolds(); ++m) {
        btPersistentManifold* manifold = m_dispatcher.getManifoldByIndexInternal(m);
        if (loadedPoints(*manifold) == 0) continue;
        const btCollisionObject *first = manifold->getBody0(), *second = manifold->getBody1();
        if (!first->hasContactResponse() || !second->hasContactResponse()) continue;  // a shell: see ContactManifolds
        m_manifolds[first].push_back(manifold);
        m_manifolds[second].push_back(manifold);
    }
}

std::span<btPersistentManifold* const> RigidContacts::manifoldsOf(const btCollisionObject& object) const {
    const auto known = m_manifolds.find(&object);
    if (known == m_manifolds.end()) return {};
    return known->second;
}

std::pmr::vector<btCollisionObject*> RigidContacts::join(std::span<btCollisionObject* const> bodies) {
    std::pmr::vector<btCollisionObject*> pile(&m_memory), fresh(&m_memory);
    for (btCollisionObject* body : bodies)
        if (isFree(*body) && m_joined.insert(body).second) pile.push_back(body);
    if (!pile.empty()) index();                             // most shells touch what stands still
    for (std::size_t next = 0; next < pile.size(); ++next)  // the nearest first
        for (const btPersistentManifold* manifold : manifoldsOf(*pile[next])) {
            auto* other = const_cast<btCollisionObject*>(otherThan(*pile[next], *manifold));
            if (m_joined.size() >= kMostJoined || !isFree(*other) || defectOf(*other) || !m_joined.insert(other).second)
                continue;
            pile.push_back(other);
            fresh.push_back(other);
        }
    return fresh;
}

void RigidContacts::addSupports(const btRigidBody& body, double h, CoupledBody& coupled,
                                std::vector<BodySupport>& supports) const {
    supports.clear();
    for (const btPersistentManifold* manifold : manifoldsOf(body)) {
        const btCollisionObject* otherObject = otherThan(body, *manifold);
        if (m_joined.count(&body) > 0 && m_joined.count(otherObject) > 0) continue;
        const bool first = manifold->getBody0() == &body;
        const auto* other = btRigidBody::upcast(otherObject);
        const double weight =  // a free body's is spread over its points
            isFree(*otherObject) ? linearMassOf(*other) / loadedPoints(*manifold) : kSupport * linearMassOf(body);
        for (int k = 0; k < manifold->getNumContacts(); ++k) {
            const btManifoldPoint& point = manifold->getContactPoint(k);
            if (!bears(point)) continue;
            const Vec3 n = (first ? 1.0 : -1.0) * fromBullet(point.m_normalWorldOnB);
            const Vec3 at = fromBullet(first ? point.getPositionWorldOnA() : point.getPositionWorldOnB());
            const double velocity = other ? pointVelocity(*other, at, h).dot(n) : 0.0;
            supports.push_back({rowOf(n, at, coupled.position), velocity, weight});
        }
    }
    coupled.supports = supports;
    if (supports.empty()) return;
    Vec6 momentum = coupled.mass * coupled.freeTwist;
    for (const auto& [row, velocity, weight] : supports) {
        coupled.mass += weight * row * row.transpose();
        momentum += weight * velocity * row;
    }
    coupled.freeTwist = coupled.mass.ldlt().solve(momentum);
}

std::pmr::vector<RigidContact> RigidContacts::between(std::span<const Obstacle> obstacles) const {
    std::pmr::unordered_map<const btCollisionObject*, int> indexOf(&m_memory);
    for (int b = 0; b < static_cast<int>(obstacles.size()); ++b)
        if (m_joined.count(obstacles[b].object) > 0) indexOf[obstacles[b].object] = b;
    std::pmr::vector<RigidContact> contacts(&m_memory);
    for (int b = 0; b < static_cast<int>(obstacles.size()); ++b) {
        if (indexOf.count(obstacles[b].object) == 0) continue;
        for (const btPersistentManifold* manifold : manifoldsOf(*obstacles[b].object)) {
            const auto other = indexOf.find(manifold->getBody1());
            if (manifold->getBody0() != obstacles[b].object || other == indexOf.end()) continue;
            const CoupledBody &first = obstacles[b].body, &second = obstacles[other->second].body;
            // Of the lighter one: a multiple of the heavier one's could be so large that rounding throws the lighter.
            const double weight = kSupport * std::min(linearMassOf(*btRigidBody::upcast(manifold->getBody0())),
                                                      linearMassOf(*btRigidBody::upcast(manifold->getBody1())));
            for (int k = 0; k < manifold->getNumContacts(); ++k) {
                const btManifoldPoint& point = manifold->getContactPoint(k);
                if (!bears(point) && point.getDistance() > btScalar(0)) continue;  // corners bear load by turns
                const Vec3 n = fromBullet(point.m_normalWorldOnB);
                contacts.push_back({b, other->second, rowOf(n, fromBullet(point.getPositionWorldOnA()), first.position),
                                    rowOf(-n, fromBullet(point.getPositionWorldOnB()), second.position), weight});
            }
        }
    }
    return contacts;
}

}  // namespace jacket::bullet
