#include "Obstacles.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

#include "BodyTwist.h"
#include "Checks.h"
#include "CoupledLinks.h"
#include "RigidContacts.h"
#include "jacket/Types.h"
#include "jacket/bullet/ShellWorld.h"

namespace jacket::bullet {
namespace {

// A direction in which Bullet does not let a body move takes part with this many times its mass.
constexpr double kLocked = 1e8;

Mat6 massOf(const btRigidBody& body) {
    const double mass = 1.0 / double(body.getInvMass());
    Mat6 result = Mat6::Zero();
    for (int k = 0; k < 3; ++k) result(k, k) = body.getLinearFactor()[k] == btScalar(0) ? kLocked * mass : mass;
    const Mat3 inverse = fromBullet(body.getInvInertiaTensorWorld());
    btVector3 centre;
    btScalar radius;
    body.getCollisionShape()->getBoundingSphere(centre, radius);
    const double floor = 1.0 / (kLocked * mass * std::max(double(radius * radius), 1e-12));
    Mat3 allowed = inverse;
    for (int k = 0; k < 3; ++k) {
        if (body.getAngularFactor()[k] != btScalar(0)) continue;
        allowed.row(k).setZero();
        allowed.col(k).setZero();
    }
    result.bottomRightCorner<3, 3>() = (allowed + floor * Mat3::Identity()).inverse();
    return result;
}

/// Of the ball about a body's origin that holds its shape, or a large one [m].
double radiusOf(const btCollisionShape& shape) {
    btVector3 centre;
    btScalar radius;
    shape.getBoundingSphere(centre, radius);
    return std::min(double(radius + centre.length()), 1e6);
}

/// Whether two twists lead a body nearly the same way in a time.
bool isNearly(const Vec6& a, const Vec6& b, double time) {
    constexpr double kShare = 1e-3, kTurn = 1e-3;  // of the way, [rad]
    const Vec6 off = a - b;
    return off.head<3>().norm() <= kShare * b.head<3>().norm() &&
           time * off.tail<3>().norm() <= kTurn + kShare * time * b.tail<3>().norm();
}

/// Radius of a ball that fits into a shape of triangles, for all that is known of it [m].
double innerRadiusOf(const btConcaveShape& shape) {
    constexpr double kThickness = 0.5;  // of its bounds
    btVector3 lower, upper;
    shape.getAabb(btTransform::getIdentity(), lower, upper);
    return 0.5 * kThickness * fromBullet(upper - lower).minCoeff();
}

}  // namespace

bool isTeleport(const btCollisionObject& body, double way, double time) {
    constexpr double kRadii = 4.0;
    return way > kTeleportSpeed * time && way > kRadii * radiusOf(*body.getCollisionShape());
}

Frame moved(const Frame& start, const Vec6& twist, double time) {
    Frame frame = start;
    frame.translation() += time * twist.head<3>();
    const double angle = twist.tail<3>().norm() * time;
    if (angle != 0.0)
        frame.linear() = Eigen::AngleAxisd(angle, twist.tail<3>().normalized()).toRotationMatrix() * start.linear();
    return frame;
}

Obstacle Obstacles::make(btCollisionObject& object, double h, const RigidContacts* contacts, bool hasMoved) {
    Obstacle obstacle{&object, &piecesOf(*object.getCollisionShape()), fromBullet(object.getWorldTransform()), {}};
    CoupledBody& coupled = obstacle.body;
    coupled.radius = radiusOf(*object.getCollisionShape());
    coupled.key = &object;
    for (const auto& piece : obstacle.shape->pieces)
        coupled.inner = std::min(coupled.inner, 0.5 * (piece->upper() - piece->lower()).minCoeff());
    if (!object.isStaticOrKinematicObject())
        for (const ConcavePiece& piece : obstacle.shape->concave)
            coupled.inner = std::min(coupled.inner, innerRadiusOf(*piece.shape));
    const btRigidBody* rigid = btRigidBody::upcast(&object);
    if (const auto* link = btMultiBodyLinkCollider::upcast(&object)) {
        coupled.freeTwist = coupled.startTwist = twistOf(*link);
        coupled.prescribed = isPrescribed(*link);
        if (hasMoved) obstacle.start = moved(obstacle.start, coupled.freeTwist, -h);
    } else if (!rigid || object.isStaticOrKinematicObject()) {
        coupled.prescribed = true;
        coupled.freeTwist = prescribedTwist(object, h);
        if (hasMoved) obstacle.start = moved(obstacle.start, coupled.freeTwist, -h);
    } else {
        const bool moves = rigid->isActive() && rigid->getInvMass() != btScalar(0);
        coupled.prescribed = !moves;
        coupled.startTwist = hasMoved ? madeTwist(*rigid, h) : twistOf(*rigid);
        coupled.freeTwist = moves && !hasMoved ? freeTwistOf(*rigid, h) : coupled.startTwist;
        if (hasMoved) obstacle.start = moved(obstacle.start, coupled.freeTwist, -h);
        coupled.position = obstacle.start.translation();
        if (moves && !hasMoved && m_gravityIsNoForce)
            coupled.freeTwist.head<3>() += h * fromBullet(rigid->getGravity());
        if (moves) coupled.mass = massOf(*rigid);
        if (moves && contacts) contacts->addSupports(*rigid, coupled, freeSupports());
    }
    coupled.position = obstacle.start.translation();
    // Of ground the place nearest to a vertex is where it comes down if it moves by less than a triangle.
    if (object.isStaticOrKinematicObject() && coupled.freeTwist.isZero(0.0))
        for (const ConcavePiece& piece : obstacle.shape->concave) coupled.inner = std::min(coupled.inner, piece.grain);
    return obstacle;
}

Frame Obstacles::startOf(const btCollisionObject& object, double h) {
    const Frame now = fromBullet(object.getWorldTransform());
    if (const auto* link = btMultiBodyLinkCollider::upcast(&object)) return moved(now, twistOf(*link), -h);
    const btRigidBody* rigid = btRigidBody::upcast(&object);
    const bool isFree = rigid && !object.isStaticOrKinematicObject();
    return moved(now, isFree ? twistOf(*rigid) : prescribedTwist(object, h), -h);
}

/// Of the motion that a free body has made in the last step. If it was not noted where that began, its velocity.
Vec6 Obstacles::madeTwist(const btRigidBody& body, double h) const {
    const auto start = m_starts.find(&body);
    return start == m_starts.end() ? twistOf(body)
                                   : twistBetween(start->second, fromBullet(body.getWorldTransform()), h);
}

std::vector<BodySupport>& Obstacles::freeSupports() {
    if (m_supportCount == m_supports.size()) m_supports.emplace_back();
    return m_supports[m_supportCount++];
}

/// Of a body that its user moves. Bullet's velocity, where it took one from the same poses, is the mean over all
/// substeps; else the last step's own motion, also where they are the same but for Bullet's rounding (in single
/// precision 3e-4 rad). A jump is no motion, neither in its step nor in the substeps after it.
Vec6 Obstacles::prescribedTwist(const btCollisionObject& object, double h) {
    const btTransform& now = object.getWorldTransform();
    const auto [entry, fresh] = m_poses.try_emplace(&object, Pose{m_step, now, now});
    Pose& pose = entry->second;
    if (!fresh && pose.step != m_step) pose = {m_step, now, pose.step == m_step - 1 ? pose.now : now, pose.ofTeleport};
    Vec6 given = Vec6::Zero();
    const btRigidBody* rigid = btRigidBody::upcast(&object);
    if (rigid && object.isKinematicObject() && object.isActive()) given = twistOf(*rigid);
    const Vec6 own = twistBetween(fromBullet(pose.before), fromBullet(pose.now), h);
    const bool isOwn = given.isZero(0.0) || given == pose.ofTeleport || isNearly(given, own, h);
    const Vec6& twist = isOwn ? own : given;
    const double speed = twist.head<3>().norm(), way = h * std::max(speed, own.head<3>().norm());
    if (twist.allFinite() && !isTeleport(object, way, way / speed)) return twist;
    pose.ofTeleport = given;
    return Vec6::Zero();
}

bool Obstacles::isUsable(const btCollisionObject& object) {
    const char* defect = defectOf(object);
    if (!defect) return true;
    if (std::find(m_warnedBodies.begin(), m_warnedBodies.end(), &object) == m_warnedBodies.end()) {
        m_warnedBodies.push_back(&object);
        m_warnings.push_back("shells ignore body " + std::to_string(object.getWorldArrayIndex()) + " (" +
                             object.getCollisionShape()->getName() + ") while its " + defect);
    }
    return false;
}

const ShapePieces& Obstacles::piecesOf(const btCollisionShape& shape) {
    const std::size_t fingerprint = fingerprintOf(shape);
    const auto [entry, fresh] = m_shapes.try_emplace(&shape);
    ShapePieces& known = entry->second;
    if (!fresh && known.fingerprint == fingerprint) return known;
    std::vector<std::string> unsupported;
    known.pieces = makeConvexPieces(shape, unsupported);
    known.concave = concavePieces(shape);
    known.fingerprint = fingerprint;
    for (const std::string& name : unsupported) {
        if (std::find(m_warnedNames.begin(), m_warnedNames.end(), name) != m_warnedNames.end()) continue;
        m_warnedNames.push_back(name);
        m_warnings.push_back("shells pass through shapes of type " + name + ": not supported yet");
    }
    return known;
}

}  // namespace jacket::bullet
