#include "RigidContacts.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>
#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

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

/// Whether it is no shell or soft body, whose own collision code would act, nor a link, which gives way as no body
/// does.
bool isRigid(const btCollisionObject& object) {
    return object.getInternalType() == btCollisionObject::CO_RIGID_BODY ||
           object.getInternalType() == btCollisionObject::CO_COLLISION_OBJECT;
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

/// The most by which points of two objects approach each other, roughly [m/s].
double speedBetween(const btCollisionObject& a, const btCollisionObject& b) {
    Vec3 between = Vec3::Zero();
    double spins = 0.0;
    for (const btCollisionObject* object : {&a, &b}) {
        const btRigidBody* body = btRigidBody::upcast(object);
        if (!body) continue;
        between = fromBullet(body->getLinearVelocity()) - between;
        btVector3 centre;
        btScalar radius;
        body->getCollisionShape()->getBoundingSphere(centre, radius);
        if (!body->isStaticOrKinematicObject()) spins += double(radius * body->getAngularVelocity().length());
    }
    return between.norm() + spins;
}

/// Of a point where the bodies are now: negative where they overlap [m].
double distanceOf(const btPersistentManifold& manifold, const btManifoldPoint& point) {
    const btVector3 first = manifold.getBody0()->getWorldTransform() * point.m_localPointA;
    const btVector3 second = manifold.getBody1()->getWorldTransform() * point.m_localPointB;
    return double((first - second).dot(point.m_normalWorldOnB));
}

/// Of the lighter one: a multiple of the heavier one's could be so large that rounding throws the lighter.
double weightBetween(const btCollisionObject& a, const btCollisionObject& b) {
    return kSupport * std::min(linearMassOf(*btRigidBody::upcast(&a)), linearMassOf(*btRigidBody::upcast(&b)));
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
    btDispatcher& dispatcher = *m_world.getDispatcher();
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
        btPersistentManifold* manifold = dispatcher.getManifoldByIndexInternal(m);
        if (loadedPoints(*manifold) == 0) continue;
        const btCollisionObject *first = manifold->getBody0(), *second = manifold->getBody1();
        if (!first->hasContactResponse() || !second->hasContactResponse()) continue;  // a shell: see ContactManifolds
        m_manifolds[first].push_back(manifold);
        m_manifolds[second].push_back(manifold);
    }
}

void RigidContacts::indexNear() {
    const btOverlappingPairCache& cache = *m_world.getPairCache();
    for (int i = 0; i < cache.getNumOverlappingPairs(); ++i) {
        const btBroadphasePair& pair = cache.getOverlappingPairArrayPtr()[i];
        auto* first = static_cast<btCollisionObject*>(pair.m_pProxy0->m_clientObject);
        auto* second = static_cast<btCollisionObject*>(pair.m_pProxy1->m_clientObject);
        if (isFree(*first) && isRigid(*second)) m_near[first].push_back(second);
        if (isFree(*second) && isRigid(*first)) m_near[second].push_back(first);
    }
}

/// What a body will meet, but for what was looked at from the other side. Where two have borne load before they touch
/// by other points only if one of them tumbles.
void RigidContacts::foresee(const btCollisionObject& body) {
    const auto near = m_near.find(&body);
    if (near == m_near.end()) return;
    const double kick = m_h * double(m_world.getGravity().length());
    for (const btCollisionObject* other : near->second) {
        const auto isOther = [&](const btPersistentManifold* manifold) { return otherThan(body, *manifold) == other; };
        const std::span<btPersistentManifold* const> loaded = manifoldsOf(body);
        const bool isLoaded = std::any_of(loaded.begin(), loaded.end(), isOther);
        const bool isKnown = std::any_of(m_impacts.begin(), m_impacts.end(), [&](const RigidImpact& impact) {
            return impact.first == other && impact.second == &body;
        });
        if (isKnown || defectOf(*other) || (isLoaded && speedBetween(body, *other) < kick)) continue;
        foreseeImpact(m_world, body, *other, m_h, isLoaded ? kick : 0.0, m_impacts);
    }
}

std::span<btPersistentManifold* const> RigidContacts::manifoldsOf(const btCollisionObject& object) const {
    const auto known = m_manifolds.find(&object);
    if (known == m_manifolds.end()) return {};
    return known->second;
}

/// How fast the two are to part at least, where they bore load before [m/s]. What rests sinks in by a little, at one
/// corner and another by turns: that is no push.
double RigidContacts::openingOf(const btPersistentManifold& manifold, const btManifoldPoint& point) const {
    constexpr double kDeep = 1e-3;  // [m]
    const double distance = distanceOf(manifold, point);
    return m_h > 0.0 && distance < -kDeep ? speedApart(m_world.getSolverInfo(), distance, m_h) : 0.0;
}

std::pmr::vector<btCollisionObject*> RigidContacts::join(std::span<btCollisionObject* const> bodies) {
    std::pmr::vector<btCollisionObject*> pile(&m_memory), fresh(&m_memory);
    for (btCollisionObject* body : bodies)
        if (isFree(*body) && m_joined.insert(body).second) pile.push_back(body);
    if (pile.empty()) return fresh;  // most shells touch what stands still
    index();
    if (m_h > 0.0) indexNear();
    const auto add = [&](const btCollisionObject* object) {
        auto* other = const_cast<btCollisionObject*>(object);
        if (m_joined.size() >= kMostJoined || !isFree(*other) || defectOf(*other) || !m_joined.insert(other).second)
            return;
        pile.push_back(other);
        fresh.push_back(other);
    };
    for (std::size_t next = 0; next < pile.size(); ++next) {  // the nearest first
        for (const btPersistentManifold* manifold : manifoldsOf(*pile[next])) add(otherThan(*pile[next], *manifold));
        const std::size_t known = m_impacts.size();
        foresee(*pile[next]);
        for (std::size_t i = known; i < m_impacts.size(); ++i) add(m_impacts[i].second);
    }
    return fresh;
}

void RigidContacts::addSupports(const btRigidBody& body, CoupledBody& coupled,
                                std::vector<BodySupport>& supports) const {
    supports.clear();
    const auto add = [&](const btRigidBody* other, const Vec3& n, const Vec3& at, double opening, double weight) {
        const double velocity = other ? pointVelocity(*other, at, m_h).dot(n) : 0.0;
        supports.push_back({rowOf(n, at, coupled.position), velocity + opening, weight});
    };
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
            add(other, n, at, openingOf(*manifold, point), weight);
        }
    }
    for (const RigidImpact& impact : m_impacts) {
        if (impact.first != &body && impact.second != &body) continue;
        const bool first = impact.first == &body;
        const btCollisionObject* otherObject = first ? impact.second : impact.first;
        if (m_joined.count(&body) > 0 && m_joined.count(otherObject) > 0) continue;
        const auto* other = btRigidBody::upcast(otherObject);
        const bool isHeld = !other || other->isStaticOrKinematicObject();  // one that sleeps will wake
        const double weight =
            isHeld ? kSupport * linearMassOf(body) : linearMassOf(*other) / double(impact.points.size());
        for (const auto& [onFirst, onSecond, normal, opening] : impact.points)
            add(other, first ? normal : Vec3(-normal), first ? onFirst : onSecond, opening, weight);
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
            const double weight = weightBetween(*manifold->getBody0(), *manifold->getBody1());
            for (int k = 0; k < manifold->getNumContacts(); ++k) {
                const btManifoldPoint& point = manifold->getContactPoint(k);
                if (!bears(point) && point.getDistance() > btScalar(0)) continue;  // corners bear load by turns
                const Vec3 n = fromBullet(point.m_normalWorldOnB);
                contacts.push_back({b, other->second, rowOf(n, fromBullet(point.getPositionWorldOnA()), first.position),
                                    rowOf(-n, fromBullet(point.getPositionWorldOnB()), second.position), weight,
                                    openingOf(*manifold, point)});
            }
        }
    }
    for (const RigidImpact& impact : m_impacts) {
        const auto first = indexOf.find(impact.first), second = indexOf.find(impact.second);
        if (first == indexOf.end() || second == indexOf.end()) continue;
        const double weight = weightBetween(*impact.first, *impact.second);
        for (const auto& [onFirst, onSecond, normal, opening] : impact.points)
            contacts.push_back({first->second, second->second,
                                rowOf(normal, onFirst, obstacles[first->second].body.position),
                                rowOf(-normal, onSecond, obstacles[second->second].body.position), weight, opening});
    }
    return contacts;
}

}  // namespace jacket::bullet
