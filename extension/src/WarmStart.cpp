#include "WarmStart.h"

#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <algorithm>
#include <vector>

#include "Convert.h"

namespace jacket::bullet {
namespace {

constexpr int kDeepestPile = 8;  // bodies below the one that bears the load

/// A manifold of a body, and the impulse that it gave the body.
struct Support {
    btPersistentManifold* manifold;
    const btCollisionObject* other;
    Vec3 impulse;
};

std::vector<Support> supportsOf(btDispatcher& dispatcher, const btCollisionObject& body) {
    std::vector<Support> supports;
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
        btPersistentManifold* manifold = dispatcher.getManifoldByIndexInternal(m);
        const bool first = manifold->getBody0() == &body;
        if (!first && manifold->getBody1() != &body) continue;
        Support support{manifold, first ? manifold->getBody1() : manifold->getBody0(), Vec3::Zero()};
        if (!body.hasContactResponse() || !support.other->hasContactResponse()) continue;
        for (int k = 0; k < manifold->getNumContacts(); ++k) {
            const btManifoldPoint& point = manifold->getContactPoint(k);
            support.impulse +=
                (first ? 1.0 : -1.0) * double(point.m_appliedImpulse) * fromBullet(point.m_normalWorldOnB);
        }
        supports.push_back(support);
    }
    return supports;
}

void foretell(btDispatcher& dispatcher, const btCollisionObject& body, const Vec3& change, int depth) {
    const std::vector<Support> supports = supportsOf(dispatcher, body);
    Vec3 total = Vec3::Zero();
    for (const Support& support : supports) total += support.impulse;
    if (!(total.squaredNorm() > 0.0)) return;
    // What supports it bears the change along its own direction, every point by its share.
    const double factor = std::max(0.0, 1.0 - change.dot(total) / total.squaredNorm());
    for (const Support& support : supports) {
        for (int k = 0; k < support.manifold->getNumContacts(); ++k)
            support.manifold->getContactPoint(k).m_appliedImpulse *= btScalar(factor);
        if (depth < kDeepestPile && !support.other->isStaticOrKinematicObject() && support.impulse.dot(total) > 0.0)
            foretell(dispatcher, *support.other, (1.0 - factor) * support.impulse, depth + 1);
    }
}

}  // namespace

void foretellLoad(btDispatcher& dispatcher, const btCollisionObject& body, const Vec3& change) {
    if (!change.isZero(0.0)) foretell(dispatcher, body, change, 0);
}

}  // namespace jacket::bullet
