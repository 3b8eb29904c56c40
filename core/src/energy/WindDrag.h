#pragma once
#include "jacket/Shell.h"
#include "solver/StepSystem.h"

namespace jacket {

/// Wind on one triangle, an equal share for each corner: f = 1/2 rho A (C_n |w.n| (w.n) n + C_t |w_t| w_t) with w the
/// wind relative to the triangle; `drag` = -df_a/dv_b between any two of its corners, positive semi-definite.
struct WindOnTriangle {
    Vec3 force;  ///< on each corner [N]
    Mat3 drag;   ///< [N s/m]
};

inline WindOnTriangle windOnTriangle(const Wind& wind, const Stencil<3>& x, const Stencil<3>& v) {
    const Vec3 areaNormal = 0.5 * (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0));
    const double area = areaNormal.norm();
    if (!(area > 0.0)) return {Vec3::Zero(), Mat3::Zero()};
    const Vec3 n = areaNormal / area;
    const Vec3 w = wind.velocity - v.rowwise().mean();
    const double wn = w.dot(n);
    const Vec3 wt = w - wn * n;
    const double speed = wt.norm();
    const double cn = 0.5 * wind.airDensity * area * wind.normalDrag;
    const double ct = 0.5 * wind.airDensity * area * wind.tangentialDrag;
    Mat3 derivative = 2.0 * cn * std::abs(wn) * n * n.transpose();
    if (speed > 0.0) derivative += ct * (speed * (Mat3::Identity() - n * n.transpose()) + wt * wt.transpose() / speed);
    return {(cn * std::abs(wn) * wn * n + ct * speed * wt) / 3.0, derivative / 9.0};
}

}  // namespace jacket
