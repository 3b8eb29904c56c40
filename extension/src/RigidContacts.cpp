#include "RigidContacts.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <Eigen/Cholesky>
#include <algorithm>

#include "BodyTwist.h"
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

/// Of what holds a body at one of the points where the two touch. What is not held itself, though it may sleep, gives
/// way: its mass is spread over them.
double weightUnder(const btRigidBody& body, const btCollisionObject& other, double points) {
    const btRigidBody* under = btRigidBody::upcast(&other);
    const bool isHeld = !under || under->isStaticOrKinematicObject();
    return isHeld ? kSupport * linearMassOf(body) : linearMassOf(*under) / points;
}

/// By friction in Bullet's last solve, on the manifold's first body [N s].
Vec3 frictionOf(const btManifoldPoint& point) {
    return fromBullet(point.m_appliedImpulseLateral1 * point.m_lateralFrictionDir1 +
                      point.m_appliedImpulseLateral2 * point.m_lateralFrictionDir2);
}

/// Velocity of a body's point along a direction, from its twist.
Vec6 rowOf(const Vec3& direction, const Vec3& at, const Vec3& centre) {
    return (Vec6() << direction, (at - centre).cross(direction)).finished();
}

/// Adds them to the body's mass and momentum.
void holdBySupports(CoupledBody& body, const std::vector<BodySupport>& supports) {
    body.supports = supports;
    if (supports.empty()) return;
    Vec6 momentum = body.mass * body.freeTwist;
    for (const auto& [row, velocity, weight, range] : supports) {
        body.mass += weight * row * row.transpose();
        momentum += weight * velocity * row;
    }
    body.freeTwist = body.mass.ldlt().solve(momentum);
}

}  // namespace

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

void RigidContacts::indexJoints() {
    for (int i = 0; i < m_world.getNumConstraints(); ++i) {
        btTypedConstraint* joint = m_world.getConstraint(i);
        m_jointsOf[&joint->getRigidBodyA()].push_back(joint);
        m_jointsOf[&joint->getRigidBodyB()].push_back(joint);
    }
}

/// What a body will meet, but for what was looked at from the other side. Where two have borne load before they touch
/// by other points only if one of them tumbles.
void RigidContacts::foresee(const btCollisionObject& body) {
    const auto near = m_near.find(&body);
    if (near == m_near.end()) return;
    const double kick = m_h * double(m_world.getGravity().length());
    for (const btCollisionObject* other : near->second) {
        if (m_seen.count(other) > 0 || defectOf(*other)) continue;
        const std::span<btPersistentManifold* const> loaded = manifoldsOf(body);
        const bool isLoaded = std::any_of(loaded.begin(), loaded.end(), [&](const btPersistentManifold* manifold) {
            return otherThan(body, *manifold) == other;
        });
        if (isLoaded && speedBetween(body, *other) < kick) continue;
        foreseeImpact(m_world, body, *other, m_h, isLoaded ? kick : 0.0, m_impacts);
    }
}

/// But for those that were read from the other side.
void RigidContacts::readJoints(const btCollisionObject& body) {
    const auto joints = m_jointsOf.find(&body);
    if (joints == m_jointsOf.end()) return;
    for (btTypedConstraint* joint : joints->second) {
        const btRigidBody &first = joint->getRigidBodyA(), &second = joint->getRigidBodyB();
        const btRigidBody& other = &first == &body ? second : first;
        if (&other == &body || m_seen.count(&other) > 0 || defectOf(other)) continue;
        readJoint(*joint, m_jointSolver, m_h, m_joints);
    }
}

std::span<btPersistentManifold* const> RigidContacts::manifoldsOf(const btCollisionObject& object) const {
    const auto known = m_manifolds.find(&object);
    if (known == m_manifolds.end()) return {};
    return known->second;
}

/// Where a contact is on a body that has moved since Bullet found it, unless that motion is looked at. A ball's does
/// not turn with the ball.
Vec3 RigidContacts::pointOn(const btRigidBody& body, const btVector3& found) const {
    const Vec3 way = m_h * fromBullet(body.getLinearVelocity());
    return m_hasMoved ? fromBullet(found) : Vec3(fromBullet(found) + way);
}

/// How fast the two are to part at least, where they bore load before [m/s]. What rests sinks in by a little, at one
/// corner and another by turns: that is no push.
double RigidContacts::pushOf(const btPersistentManifold& manifold, const btManifoldPoint& point) const {
    constexpr double kDeep = 1e-3;  // [m]
    const double distance = distanceOf(manifold, point);
    return distance < -kDeep ? speedApart(m_world.getSolverInfo(), distance, m_h) : 0.0;
}

std::pmr::vector<btCollisionObject*> RigidContacts::join(std::span<btCollisionObject* const> bodies) {
    std::pmr::vector<btCollisionObject*> pile(&m_memory), fresh(&m_memory);
    for (btCollisionObject* body : bodies)
        if (isFree(*body) && m_joined.insert(body).second) pile.push_back(body);
    if (pile.empty()) return fresh;  // most shells touch what stands still
    index();
    indexJoints();
    if (!m_hasMoved) indexNear();
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
        const std::size_t rows = m_joints.size();
        readJoints(*pile[next]);
        for (std::size_t i = rows; i < m_joints.size(); ++i)
            add(m_joints[i].first == pile[next] ? m_joints[i].second : m_joints[i].first);
        m_seen.insert(pile[next]);
    }
    return fresh;
}

bool RigidContacts::areJoined(const btCollisionObject& a, const btCollisionObject& b) const {
    return m_joined.count(&a) > 0 && m_joined.count(&b) > 0;
}

void RigidContacts::addSupports(const btRigidBody& body, CoupledBody& coupled,
                                std::vector<BodySupport>& supports) const {
    supports.clear();
    addLoaded(body, coupled.position, supports);
    addImpacts(body, coupled.position, supports);
    addJoints(body, supports);
    if (m_hasMoved)  // what holds it has let it do that
        for (BodySupport& support : supports) support.velocity = support.row.dot(coupled.startTwist);
    holdBySupports(coupled, supports);
    if (!m_hasMoved) addFriction(body, coupled);
}

/// A contact of a body that bore load, as seen from the body.
struct RigidContacts::LoadedPoint {
    const btCollisionObject& other;
    const btPersistentManifold& manifold;
    const btManifoldPoint& point;
    double side;  ///< 1: the body is the manifold's first one, -1: the second
    Vec3 at;
};

void RigidContacts::forEachLoaded(const btRigidBody& body, const auto& use) const {
    for (const btPersistentManifold* manifold : manifoldsOf(body)) {
        const bool first = manifold->getBody0() == &body;
        for (int k = 0; k < manifold->getNumContacts(); ++k) {
            const btManifoldPoint& point = manifold->getContactPoint(k);
            if (!bears(point)) continue;
            const Vec3 at = pointOn(body, first ? point.getPositionWorldOnA() : point.getPositionWorldOnB());
            use(LoadedPoint{*otherThan(body, *manifold), *manifold, point, first ? 1.0 : -1.0, at});
        }
    }
}

/// As a load, which the shells do not change in the step; but by no more than Coulomb's law has it for what presses
/// now: an impact may be over. What slides, it may stop but not turn around, and what nothing pushes any more it does
/// not push either: it is the share that leaves the least sliding.
void RigidContacts::addFriction(const btRigidBody& body, CoupledBody& coupled) const {
    Vec6 impulse = Vec6::Zero();
    double power = 0.0;  // of all of it, by the sliding that is left without it
    double sum = 0.0, most = 0.0;
    std::size_t support = 0;  // those of loaded points are the first
    forEachLoaded(body, [&](const LoadedPoint& loaded) {
        const auto& [other, manifold, point, side, at] = loaded;
        const Vec3 friction = side * frictionOf(point);
        const Vec6 own = rowOf(friction, at, coupled.position);
        impulse += own;
        power += own.dot(coupled.freeTwist) - friction.dot(pointVelocity(other, at, 0.0));
        const double pressing = areJoined(body, other) ? double(point.m_appliedImpulse)
                                                       : coupled.supports[support++].impulseOn(coupled.freeTwist);
        sum += friction.norm();
        most += double(point.m_combinedFriction) * std::max(0.0, pressing);
    });
    if (power >= 0.0) return;
    const Vec6 change = coupled.mass.ldlt().solve(impulse);
    coupled.freeTwist += std::min({1.0, most / sum, -power / impulse.dot(change)}) * change;
}

void RigidContacts::addLoaded(const btRigidBody& body, const Vec3& centre, std::vector<BodySupport>& supports) const {
    forEachLoaded(body, [&](const LoadedPoint& loaded) {
        const auto& [other, manifold, point, side, at] = loaded;
        if (areJoined(body, other)) return;
        const Vec3 n = side * fromBullet(point.m_normalWorldOnB);
        const double velocity = pointVelocity(other, at, m_h).dot(n) + pushOf(manifold, point);
        supports.push_back({rowOf(n, at, centre), velocity, weightUnder(body, other, loadedPoints(manifold))});
    });
}

void RigidContacts::addImpacts(const btRigidBody& body, const Vec3& centre, std::vector<BodySupport>& supports) const {
    for (const RigidImpact& impact : m_impacts) {
        const bool first = impact.first == &body;
        const btCollisionObject& other = first ? *impact.second : *impact.first;
        if ((!first && impact.second != &body) || areJoined(body, other)) continue;
        const double weight = weightUnder(body, other, double(impact.points.size()));
        for (const auto& [onFirst, onSecond, normal, opening] : impact.points) {
            const Vec3 n = first ? normal : Vec3(-normal);
            const Vec3& at = first ? onFirst : onSecond;
            supports.push_back({rowOf(n, at, centre), pointVelocity(other, at, m_h).dot(n) + opening, weight});
        }
    }
}

void RigidContacts::addJoints(const btRigidBody& body, std::vector<BodySupport>& supports) const {
    for (const JointRow& row : m_joints) {
        const bool first = row.first == &body;
        const btRigidBody& other = first ? *row.second : *row.first;
        if ((!first && row.second != &body) || areJoined(body, other)) continue;
        const Vec6 &own = first ? row.alongFirst : row.alongSecond, &others = first ? row.alongSecond : row.alongFirst;
        const double give = std::max(mobilityAlong(other, others), mobilityAlong(body, own) / kSupport);
        const double velocity = row.velocity - others.dot(freeTwistOf(other, m_h));
        supports.push_back({own, velocity, 1.0 / (give + row.ease), row.range});
    }
}

std::pmr::vector<RigidContact> RigidContacts::between(std::span<const Obstacle> obstacles) const {
    ObstacleIndex indexOf(&m_memory);
    for (int b = 0; b < static_cast<int>(obstacles.size()); ++b)
        if (m_joined.count(obstacles[b].object) > 0) indexOf[obstacles[b].object] = b;
    std::pmr::vector<RigidContact> contacts(&m_memory);
    for (int b = 0; b < static_cast<int>(obstacles.size()); ++b)
        if (indexOf.count(obstacles[b].object) > 0) addLoadedBetween(obstacles, b, indexOf, contacts);
    for (const RigidImpact& impact : m_impacts) {
        const auto first = indexOf.find(impact.first), second = indexOf.find(impact.second);
        if (first == indexOf.end() || second == indexOf.end()) continue;
        const double weight = weightBetween(*impact.first, *impact.second);
        for (const auto& [onFirst, onSecond, normal, opening] : impact.points)
            contacts.push_back({first->second, second->second,
                                rowOf(normal, onFirst, obstacles[first->second].body.position),
                                rowOf(-normal, onSecond, obstacles[second->second].body.position), weight, opening});
    }
    for (const JointRow& row : m_joints) {
        const auto first = indexOf.find(row.first), second = indexOf.find(row.second);
        if (first == indexOf.end() || second == indexOf.end()) continue;
        const double mobility = mobilityAlong(*row.first, row.alongFirst) + mobilityAlong(*row.second, row.alongSecond);
        contacts.push_back({first->second, second->second, row.alongFirst, row.alongSecond,
                            1.0 / (mobility / kSupport + row.ease), row.velocity, row.range});
    }
    if (m_hasMoved)
        for (RigidContact& pair : contacts)
            pair.velocity =
                pair.rowA.dot(obstacles[pair.a].body.startTwist) + pair.rowB.dot(obstacles[pair.b].body.startTwist);
    return contacts;
}

/// What bears load, or nearly does, between one of the obstacles, as the first of a manifold, and others.
void RigidContacts::addLoadedBetween(std::span<const Obstacle> obstacles, int own, const ObstacleIndex& indexOf,
                                     std::pmr::vector<RigidContact>& contacts) const {
    for (const btPersistentManifold* manifold : manifoldsOf(*obstacles[own].object)) {
        const auto other = indexOf.find(manifold->getBody1());
        if (manifold->getBody0() != obstacles[own].object || other == indexOf.end()) continue;
        const CoupledBody &first = obstacles[own].body, &second = obstacles[other->second].body;
        const double weight = weightBetween(*manifold->getBody0(), *manifold->getBody1());
        for (int k = 0; k < manifold->getNumContacts(); ++k) {
            const btManifoldPoint& point = manifold->getContactPoint(k);
            if (!bears(point) && point.getDistance() > btScalar(0)) continue;  // corners bear load by turns
            const Vec3 n = fromBullet(point.m_normalWorldOnB);
            const Vec3 onFirst = pointOn(*btRigidBody::upcast(manifold->getBody0()), point.getPositionWorldOnA());
            const Vec3 onSecond = pointOn(*btRigidBody::upcast(manifold->getBody1()), point.getPositionWorldOnB());
            contacts.push_back({own, other->second, rowOf(n, onFirst, first.position),
                                rowOf(-n, onSecond, second.position), weight, pushOf(*manifold, point)});
        }
    }
}

}  // namespace jacket::bullet
