#pragma once
#include <LinearMath/btTransform.h>

#include <Eigen/Geometry>

#include "jacket/Types.h"

/// btScalar (float or double, as the Bullet library was built) and double meet here and nowhere else. Lengths in metres
/// on both sides.
namespace jacket::bullet {

using Frame = Eigen::Isometry3d;  ///< a pose: rotation and origin [m]

inline Vec3 fromBullet(const btVector3& v) {
    return {double(v.x()), double(v.y()), double(v.z())};
}

inline Mat3 fromBullet(const btMatrix3x3& m) {
    Mat3 result;
    for (int row = 0; row < 3; ++row) result.row(row) = fromBullet(m[row]).transpose();
    return result;
}

/// The rotation is made orthogonal in double precision: Bullet's is so to btScalar only.
inline Frame fromBullet(const btTransform& t) {
    Frame frame = Frame::Identity();
    frame.linear() = Eigen::Quaterniond(fromBullet(t.getBasis())).normalized().toRotationMatrix();
    frame.translation() = fromBullet(t.getOrigin());
    return frame;
}

inline btVector3 toBullet(const Vec3& v) {
    return {btScalar(v.x()), btScalar(v.y()), btScalar(v.z())};
}

inline btMatrix3x3 toBullet(const Mat3& m) {
    return {btScalar(m(0, 0)), btScalar(m(0, 1)), btScalar(m(0, 2)), btScalar(m(1, 0)), btScalar(m(1, 1)),
            btScalar(m(1, 2)), btScalar(m(2, 0)), btScalar(m(2, 1)), btScalar(m(2, 2))};
}

inline btTransform toBullet(const Frame& frame) {
    return btTransform(toBullet(Mat3(frame.linear())), toBullet(Vec3(frame.translation())));
}

}  // namespace jacket::bullet
