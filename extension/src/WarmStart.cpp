#include "WarmStart.h"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <algorithm>

#include "Convert.h"

namespace jacket::bullet {
namespace {

/// Impulse that a manifold gave the body.
Vec3 impulseOn(const btCollisionObject& body, const btPersistentManifold& manifold) {
    const double sign = manifold.getBody0() == &body ? 1.0 : -1.0;
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < manifold.getNumContacts(); ++k) {
        const btManifoldPoint& point = manifold.getContactPoint(k);
        sum += sign * double(point.m_appliedImpulse) * fromBullet(point.m_normalWorldOnB);
    }
    return sum;
}

/// Calls `visit` for manifolds with what does not move: only that bears all of a load. Another body gives way.
void forGroundsOf(btDispatcher& dispatcher, const btCollisionObject& body, const auto& visit) {
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
        btPersistentManifold* manifold = dispatcher.getManifoldByIndexInternal(m);
        const bool first = manifold->getBody0() == &body;
        if (!first && manifold->getBody1() != &body) continue;
        const btCollisionObject& other = *(first ? manifold->getBody1() : manifold->getBody0());
        if (other.isStaticOrKinematicObject() && other.hasContactResponse() && body.hasContactResponse())
            visit(*manifold);
    }
}

}  // namespace

void foretellLoad(btDispatcher& dispatcher, const btCollisionObject& body, const Vec3& change) {
    if (change.isZero(0.0)) return;
    Vec3 total = Vec3::Zero();
    forGroundsOf(dispatcher, body, [&](const auto& manifold) { total += impulseOn(body, manifold); });
    if (!(total.squaredNorm() > 0.0)) return;
    // The ground bears the change along its own direction, every point by its share.
    const double factor = std::max(0.0, 1.0 - change.dot(total) / total.squaredNorm());
    forGroundsOf(dispatcher, body, [&](auto& manifold) {
        for (int k = 0; k < manifold.getNumContacts(); ++k)
            manifold.getContactPoint(k).m_appliedImpulse *= btScalar(factor);
    });
}

}  // namespace jacket::bullet
