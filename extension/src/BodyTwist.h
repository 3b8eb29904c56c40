#pragma once
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "Convert.h"
#include "jacket/Types.h"

namespace jacket::bullet {

/// Linear and angular velocity of a body, now and after the coming step if nothing touches it: forces as they stand,
/// gravity included, but for what its user moves.
Vec6 twistOf(const btRigidBody& body);
Vec6 freeTwistOf(const btRigidBody& body, double h);

/// Of the motion from one pose to another in a time.
Vec6 twistBetween(const Frame& before, const Frame& now, double time);

/// Velocity that a point of an object, which is at `at` in the world now, will have after a step of length h if nothing
/// touches the object; 0: the velocity that it has.
Vec3 pointVelocity(const btCollisionObject& object, const Vec3& at, double h);

}  // namespace jacket::bullet
