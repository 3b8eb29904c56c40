#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>

/// Jacket: thin shells. Everything in core is double precision and SI units.
namespace jacket {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Vec4 = Eigen::Vector4d;
using Vec6 =
    Eigen::Matrix<double, 6, 1>;  ///< twist: linear [m/s] over angular [rad/s]; or impulse over angular impulse
using Mat2 = Eigen::Matrix2d;
using Mat3 = Eigen::Matrix3d;
using Mat6 = Eigen::Matrix<double, 6, 6>;
using Points = Eigen::Matrix<double, 3, Eigen::Dynamic>;  ///< one column per vertex
template <int N>
using Indices = Eigen::Matrix<int, N, Eigen::Dynamic>;  ///< one column per element

/// Matrix of the cross product: skew(a) * b = a x b.
inline Mat3 skew(const Vec3& a) {
    Mat3 m;
    m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return m;
}

}  // namespace jacket
