#include "MultiBody.h"

#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyJointLimitConstraint.h>
#include <BulletDynamics/Featherstone/btMultiBodyJointMotor.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include <algorithm>

#include "Convert.h"

namespace jacket::demo {

namespace {

Vec3 startOf(const MultiBodyPart& part) {
    return part.description->transform.position + part.centre;
}

}  // namespace

MultiBody::MultiBody(btMultiBodyDynamicsWorld& world, const MultiBodyDescription& description,
                     std::span<const MultiBodyPart> parts)
    : m_world(world) {
    const double mass = parts[0].description->mass;
    m_body = std::make_unique<btMultiBody>(static_cast<int>(description.links.size()), btScalar(mass),
                                           toBullet(parts[0].inertia), !(mass > 0), false);
    m_body->setLinearDamping(0);  // rigid bodies have none either
    m_body->setAngularDamping(0);
    for (std::size_t i = 0; i < description.links.size(); ++i)
        setUpJoint(static_cast<int>(i), description.links[i], parts);
    m_body->setBasePos(toBullet(startOf(parts[0])));
    m_body->finalizeMultiDof();
    m_world.addMultiBody(m_body.get());
    for (std::size_t i = 0; i < parts.size(); ++i) addCollider(static_cast<int>(i) - 1, parts[i]);
    addConstraints(description);
}

MultiBody::~MultiBody() {
    for (const auto& limit : m_limits) m_world.removeMultiBodyConstraint(limit.get());
    for (const Motor& motor : m_motors) m_world.removeMultiBodyConstraint(motor.constraint.get());
    for (const auto& collider : m_colliders) m_world.removeCollisionObject(collider.get());
    m_world.removeMultiBody(m_body.get());
}

void MultiBody::setUpJoint(int link, const LinkDescription& description, std::span<const MultiBodyPart> parts) {
    const MultiBodyPart &part = parts[link + 1], &parent = parts[description.parent + 1];
    const auto mass = btScalar(part.description->mass);
    const btVector3 inertia = toBullet(part.inertia), axis = toBullet(description.joint.axis);
    const btVector3 toPivot = toBullet(Vec3(description.joint.pivot - startOf(parent)));
    const btVector3 fromPivot = toBullet(Vec3(startOf(part) - description.joint.pivot));
    const btQuaternion parallel = btQuaternion::getIdentity();
    switch (description.joint.kind) {
        case Joint::Kind::Fixed:
            m_body->setupFixed(link, mass, inertia, description.parent, parallel, toPivot, fromPivot);
            break;
        case Joint::Kind::Prismatic:
            m_body->setupPrismatic(link, mass, inertia, description.parent, parallel, axis, toPivot, fromPivot, true);
            break;
        case Joint::Kind::Revolute:
            m_body->setupRevolute(link, mass, inertia, description.parent, parallel, axis, toPivot, fromPivot, true);
            break;
    }
}

void MultiBody::addCollider(int link, const MultiBodyPart& part) {
    m_colliders.push_back(std::make_unique<btMultiBodyLinkCollider>(m_body.get(), link));
    btMultiBodyLinkCollider& collider = *m_colliders.back();
    collider.setCollisionShape(part.shape);
    collider.setFriction(btScalar(part.description->friction));
    collider.setRestitution(btScalar(part.description->restitution));
    collider.setActivationState(DISABLE_DEACTIVATION);
    collider.setWorldTransform(btTransform(btQuaternion::getIdentity(), toBullet(startOf(part))));
    if (link < 0)
        m_body->setBaseCollider(&collider);
    else
        m_body->getLink(link).m_collider = &collider;
    m_world.addCollisionObject(&collider, btBroadphaseProxy::DefaultFilter, btBroadphaseProxy::AllFilter);
}

void MultiBody::addConstraints(const MultiBodyDescription& description) {
    for (std::size_t i = 0; i < description.links.size(); ++i) {
        const Joint& joint = description.links[i].joint;
        const int link = static_cast<int>(i);
        if (!joint.motor.empty()) {
            m_motors.push_back({std::make_unique<btMultiBodyJointMotor>(m_body.get(), link, 0, 0, 0), joint.motor});
            m_world.addMultiBodyConstraint(m_motors.back().constraint.get());
        }
        if (joint.limits) {
            m_limits.push_back(std::make_unique<btMultiBodyJointLimitConstraint>(
                m_body.get(), link, btScalar((*joint.limits)[0]), btScalar((*joint.limits)[1])));
            m_world.addMultiBodyConstraint(m_limits.back().get());
        }
    }
}

void MultiBody::drive(double time, double h) {
    for (const Motor& motor : m_motors) {
        const auto phase = std::find_if(motor.phases.begin(), motor.phases.end(),
                                        [&](const MotorPhase& p) { return time < p.until - 1e-9; });
        const bool holds = phase == motor.phases.end();
        motor.constraint->setVelocityTarget(btScalar(holds ? 0.0 : phase->velocity));
        motor.constraint->setMaxAppliedImpulse(btScalar((holds ? motor.phases.back() : *phase).maxForce * h));
    }
}

MultiBody::Velocities MultiBody::velocities() const {
    const int count = m_body->getNumLinks() + 1;
    std::vector<btVector3> omega(count), linear(count);  // in the parts' own frames
    m_body->compTreeLinkVelocities(omega.data(), linear.data());
    Velocities result;
    for (int i = 0; i < count; ++i) {
        const btMatrix3x3& rotation = m_colliders[i]->getWorldTransform().getBasis();
        result.linear.push_back(fromBullet(rotation * linear[i]));
        result.angular.push_back(fromBullet(rotation * omega[i]));
    }
    return result;
}

}  // namespace jacket::demo
