#pragma once
#include <BulletCollision/BroadphaseCollision/btDispatcher.h>

#include "jacket/Types.h"

class btCollisionObject;

namespace jacket::bullet {

/// Tells Bullet's next contact solve of a load on a body that is new or gone. That solve starts from the impulses of
/// the last one, and ends after few iterations: under a load of many times the body's weight, the error of that start
/// would press it into what it stands on, or throw it up once the load vanishes. `change`: of the impulse on the body
/// in a step [N s].
void foretellLoad(btDispatcher& dispatcher, const btCollisionObject& body, const Vec3& change);

}  // namespace jacket::bullet
