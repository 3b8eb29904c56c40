#pragma once
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>

namespace jacket::demo {

/// Memory that a collision configuration takes at its start. Bullet's own choice, 6.5 MB, is for thousands of bodies;
/// what goes beyond it is asked for piece by piece.
inline btDefaultCollisionConstructionInfo smallPools() {
    btDefaultCollisionConstructionInfo info;
    info.m_defaultMaxPersistentManifoldPoolSize = 256;
    info.m_defaultMaxCollisionAlgorithmPoolSize = 256;
    return info;
}

}  // namespace jacket::demo
