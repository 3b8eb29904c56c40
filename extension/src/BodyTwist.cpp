#include "BodyTwist.h"

#include <Eigen/Geometry>

namespace jacket::bullet {

Vec6 twistOf(const btRigidBody& body) {
    Vec6 twist;
    twist << fromBullet(body.getLinearVelocity()), fromBullet(body.getAngularVelocity());
    return twist;
}

Vec6 freeTwistOf(const btRigidBody& body, double h) {
    Vec6 twist = twistOf(body);
    if (!body.isActive() || body.isStaticOrKinematicObject()) return twist;
    twist.head<3>() += h * double(body.getInvMass()) * fromBullet(body.getTotalForce());
    twist.tail<3>() += h * (fromBullet(body.getInvInertiaTensorWorld()) * fromBullet(body.getTotalTorque()));
    return twist;
}

Vec6 twistBetween(const Frame& before, const Frame& now, double time) {
    const Eigen::AngleAxisd turn(Eigen::Quaterniond(now.linear() * before.linear().transpose()).normalized());
    Vec6 twist;
    twist << (now.translation() - before.translation()) / time, turn.angle() / time * turn.axis();
    return twist;
}

Vec3 pointVelocity(const btCollisionObject& object, const Vec3& at, double h) {
    const btRigidBody* body = btRigidBody::upcast(&object);
    if (!body) return Vec3::Zero();
    const Vec6 twist = freeTwistOf(*body, h);
    return twist.head<3>() + twist.tail<3>().cross(at - fromBullet(body->getCenterOfMassPosition()));
}

}  // namespace jacket::bullet
