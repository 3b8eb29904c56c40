#pragma once
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "jacket/models/StencilModel.h"

/// What several models share when they check parameters, set up rest data and fill matrices.
namespace jacket {

/// Throws std::invalid_argument "<field> must be <rule>, got <value>" unless `holds`.
inline void requireParameter(bool holds, std::string_view field, std::string_view rule, double value) {
    if (holds) return;
    std::ostringstream message;
    message << field << " must be " << rule << ", got " << value;
    throw std::invalid_argument(message.str());
}

/// The caller's value where set, else the material's; finite and >= 0 either way.
inline double stiffnessOr(const std::optional<double>& chosen, double fromMaterial, std::string_view field) {
    const double value = chosen.value_or(fromMaterial);
    requireParameter(value >= 0.0 && std::isfinite(value), field, ">= 0", value);
    return value;
}

/// Throws std::invalid_argument unless the rest triangle (a b c) has an area; `model` says who asks.
template <class = void>
void requireTriangle(const Vec3& a, const Vec3& b, const Vec3& c, std::string_view model) {
    const double longestSquared =
        std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});  // [m^2]
    const double twiceArea = (b - a).cross(c - a).norm();
    if (twiceArea > 1e-10 * longestSquared && std::isfinite(twiceArea)) return;  // false for NaN
    std::ostringstream message;
    message << model << ": rest triangle has no area: " << 0.5 * twiceArea << " m^2 with a longest edge of "
            << std::sqrt(longestSquared) << " m";
    throw std::invalid_argument(message.str());
}

/// Both triangles of a hinge (x0 x1 x2 x3): (x0 x1 x2) and (x1 x0 x3).
template <class = void>
void requireHinge(const Stencil<4>& X, std::string_view model) {
    requireTriangle(X.col(0), X.col(1), X.col(2), model);
    requireTriangle(X.col(1), X.col(0), X.col(3), model);
}

/// Rows g1, g2 of Dm^-1 [1/m] of the rest triangle X, in the frame of its plane whose first axis is along `u`, so that
/// the deformation gradient is F = (x1 - x0) g1 + (x2 - x0) g2. `u` need not be of unit length, but must lie in the
/// plane.
template <class = void>
Mat2 inverseRestFrame(const Stencil<3>& X, const Vec3& u) {
    const Vec3 a = X.col(1) - X.col(0), b = X.col(2) - X.col(0);
    const Vec3 axisU = u.normalized(), axisV = a.cross(b).cross(axisU).normalized();
    Mat2 frame;  // Dm
    frame << axisU.dot(a), axisU.dot(b), axisV.dot(a), axisV.dot(b);
    const double determinant = frame(0, 0) * frame(1, 1) - frame(0, 1) * frame(1, 0);
    Mat2 inverse;
    inverse << frame(1, 1), -frame(0, 1), -frame(1, 0), frame(0, 0);
    return inverse / determinant;
}

/// The unit vector of `direction` projected into the plane of the rest triangle X. Throws std::invalid_argument if it
/// is normal to the plane (within about 0.1 degrees), where no direction is meant.
template <class = void>
Vec3 projectedDirection(const Stencil<3>& X, const Vec3& direction, std::string_view model) {
    const Vec3 normal = (X.col(1) - X.col(0)).cross(X.col(2) - X.col(0)).normalized(), d = direction.normalized();
    const Vec3 inPlane = d - d.dot(normal) * normal;
    if (inPlane.norm() >= 2e-3) return inPlane.normalized();
    std::ostringstream message;
    message << model << ": warp direction (" << direction.transpose() << ") is normal to a rest triangle, at ("
            << X.col(0).transpose() << ")";
    throw std::invalid_argument(message.str());
}

/// Cotangent of the angle at `apex` in the triangle (apex p q).
template <class = void>
double cotangent(const Vec3& apex, const Vec3& p, const Vec3& q) {
    return (p - apex).dot(q - apex) / (p - apex).cross(q - apex).norm();
}

/// Sets a triangle's 9 x 9 matrix from its blocks (x1,x1), (x1,x2), (x2,x2): moving all three vertices does nothing.
template <class = void>
void setTriangleMatrix(Eigen::Matrix<double, 9, 9>& m, const Mat3& m11, const Mat3& m12, const Mat3& m22) {
    const Mat3 m01 = -(m11 + m12.transpose()), m02 = -(m12 + m22);
    m.block<3, 3>(0, 0) = -(m01 + m02);
    m.block<3, 3>(0, 3) = m01;
    m.block<3, 3>(0, 6) = m02;
    m.block<3, 3>(3, 0) = m01.transpose();
    m.block<3, 3>(3, 3) = m11;
    m.block<3, 3>(3, 6) = m12;
    m.block<3, 3>(6, 0) = m02.transpose();
    m.block<3, 3>(6, 3) = m12.transpose();
    m.block<3, 3>(6, 6) = m22;
}

}  // namespace jacket
