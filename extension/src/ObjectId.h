#pragma once
#include <BulletCollision/CollisionDispatch/btCollisionWorld.h>

namespace jacket::bullet {

/// The broadphase's id of an object of this world, -1 if it is not there. An object that is allocated where a removed
/// one was has another id (with btDbvtBroadphase; broadphases that count slots may give the same again).
inline int idOf(const btCollisionWorld& world, const btCollisionObject* object) {
    const auto& objects = world.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i)
        if (objects[i] == object) return object->getBroadphaseHandle()->getUid();
    return -1;
}

}  // namespace jacket::bullet
