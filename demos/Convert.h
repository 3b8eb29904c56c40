#pragma once
#include <LinearMath/btTransform.h>

#include "Shape.h"
#include "jacket/Types.h"

/// Between the program's doubles and btScalar, as Bullet's library was built.
namespace jacket::demo {

inline btVector3 toBullet(const Vec3& v) {
    return {btScalar(v.x()), btScalar(v.y()), btScalar(v.z())};
}
inline Vec3 fromBullet(const btVector3& v) {
    return {v.x(), v.y(), v.z()};
}

inline btMatrix3x3 toBullet(const Mat3& m) {
    return {btScalar(m(0, 0)), btScalar(m(0, 1)), btScalar(m(0, 2)), btScalar(m(1, 0)), btScalar(m(1, 1)),
            btScalar(m(1, 2)), btScalar(m(2, 0)), btScalar(m(2, 1)), btScalar(m(2, 2))};
}

inline Mat3 fromBullet(const btMatrix3x3& m) {
    Mat3 result;
    for (int i = 0; i < 3; ++i) result.row(i) = fromBullet(m[i]).transpose();
    return result;
}

inline btTransform toBullet(const Transform& transform) {
    return btTransform(toBullet(transform.rotation()), toBullet(transform.position));
}

}  // namespace jacket::demo
