#pragma once
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "jacket/models/StencilModel.h"
#include "jacket/models/StencilTools.h"

namespace jacket {

/// Bending of one interior edge by its dihedral angle, flat or curved at rest, bent by up to half a turn either way.
///
///         x2          E(x) = 1/2 D l^2 / (A0 + A1) (theta - theta0)^2                               [J]
///        /  \         D      bending stiffness, the plate's E t^3 / (12 (1 - nu^2))                 [N m]
///      x0 -- x1       l      rest length of x0 x1                                                   [m]
///        \  /         Ai     rest areas of triangles (x0 x1 x2) and (x1 x0 x3)                      [m^2]
///         x3          theta  angle from the normal of (x0 x1 x2) to that of (x1 x0 x3) about x1 - x0, in (-pi, pi]:
///                            zero when flat, positive where the surface bends away from its normals
///                            (a sphere seen from outside); the difference is wrapped to [-pi, pi]   [rad]
/// Hessian: Positive is the Gauss-Newton part, of rank one; exact wherever theta = theta0.
/// Error:   rolled to a cylinder, an equilateral mesh stores the plate's energy in every direction, other meshes see
///          QuadraticBending. Forces grow like 1 / height as a triangle collapses; below a millionth of l^2 of area,
///          the gradient is tapered to keep them finite.
/// Source:  Baraff and Witkin, Large Steps in Cloth Simulation, SIGGRAPH 1998, and Grinspun et al., Discrete Shells,
///          SCA 2003; rescaled to the plate.
struct DihedralBending {
    std::optional<double> stiffness{};  ///< D [N m], >= 0; unset: the material's

    static constexpr std::string_view kName = "dihedral";
    static constexpr StencilSite kSite = StencilSite::Hinge;
    static constexpr int kVertices = 4;

    struct Rest {
        double weight;  ///< D l^2 / (A0 + A1) [N m]
        double angle;   ///< theta0 [rad]
        double length;  ///< l [m]
    };

    DihedralBending fittedTo(const ShellMaterial& material) const {
        return {stiffnessOr(stiffness, material.bendingStiffness(), "DihedralBending.stiffness [N m]")};
    }

    template <class = void>
    Rest rest(const Stencil<4>& X, double area) const {
        requireHinge(X, "DihedralBending");
        const double length = (X.col(1) - X.col(0)).norm();
        return {.weight = stiffness.value() * length * length / area, .angle = angle(X), .length = length};
    }

    template <class = void>
    StencilEval<4> evaluate(const Stencil<4>& x, const Rest& r, HessianKind kind) const {
        const Shape s(x, r.length);
        const double bend = wrapped(s.angle() - r.angle);
        const Stencil<4> slope = s.slope();  // dtheta/dx

        StencilEval<4> result;
        result.energy = 0.5 * r.weight * bend * bend;
        result.gradient = (r.weight * bend) * slope;
        setOuterProduct(result.hessian, r.weight, slope);
        if (kind == HessianKind::Exact) result.hessian += (r.weight * bend) * s.curvature();
        return result;
    }

    template <class = void>
    double energy(const Stencil<4>& x, const Rest& r) const {
        const double bend = wrapped(Shape(x, r.length).angle() - r.angle);
        return 0.5 * r.weight * bend * bend;
    }

    /// Bending beyond the limit stays: the isotropic rule of O'Brien et al. 2002 with linear hardening, on the
    /// curvature e = l / (A0 + A1) (theta - theta0), `accumulated` in 1/m.
    template <class = void>
    bool flow(const Stencil<4>& x, double area, const YieldRule& rule, Rest& r, double& accumulated) const {
        const double bend = wrapped(angle(x) - r.angle), perAngle = r.length / area;
        const double limit = rule.curvature + rule.hardening * accumulated;
        const double excess = std::abs(bend) * perAngle - limit;
        if (!(excess > kYieldRounding * limit)) return false;
        const double slip = excess / (1.0 + rule.hardening);
        accumulated += slip;
        r.angle = wrapped(r.angle + std::copysign(slip / perAngle, bend));
        return true;
    }

    /// A deformed hinge: the angle and its derivatives. `restLength` sets below what sizes it counts as collapsed.
    class Shape {
      public:
        Shape(const Stencil<4>& x, double restLength)
            : e(x.col(1) - x.col(0)),
              b(x.col(2) - x.col(0)),
              c(x.col(3) - x.col(0)),
              n0(e.cross(b)),
              n1(c.cross(e)),
              length(std::max(e.norm(), 1e-6 * restLength)) {
            const double tiny = 1e-6 * restLength * restLength;
            n0n0 = std::max(n0.squaredNorm(), tiny * tiny);
            n1n1 = std::max(n1.squaredNorm(), tiny * tiny);
            m0 = n0 / n0n0;
            m1 = n1 / n1n1;
            alongB = b.dot(e) / length;
            alongC = c.dot(e) / length;
        }

        /// theta [rad]
        double angle() const { return std::atan2(n0.cross(n1).dot(e) / length, n0.dot(n1)); }

        /// dtheta/dx [1/m]
        Stencil<4> slope() const {
            Stencil<4> s;
            s.col(1) = alongB * m0 + alongC * m1;
            s.col(2) = -length * m0;
            s.col(3) = -length * m1;
            s.col(0) = -(s.col(1) + s.col(2) + s.col(3));
            return s;
        }

        /// d2theta/dx2 [1/m^2], from the second derivatives by e, b and c
        Eigen::Matrix<double, 12, 12> curvature() const {
            const Vec3 direction = e / length;
            const Mat3 M0 = (Mat3::Identity() - 2.0 * m0 * n0.transpose()) / n0n0;  // dm0/dn0
            const Mat3 M1 = (Mat3::Identity() - 2.0 * m1 * n1.transpose()) / n1n1;
            const Mat3 M0b = M0 * skew(b), M1c = M1 * skew(c);  // dn0/de = -skew(b), dn1/de = skew(c)
            const Mat3 ee = (m0 * b.transpose() + m1 * c.transpose()) / length -
                            (alongB * m0 + alongC * m1) * direction.transpose() / length - alongB * M0b + alongC * M1c;
            const Mat3 be = length * M0b - m0 * direction.transpose();
            const Mat3 ce = -length * M1c - m1 * direction.transpose();
            Eigen::Matrix<double, 12, 12> m;
            auto byVertices = m.bottomRightCorner<9, 9>();
            byVertices << ee, be.transpose(), ce.transpose(),  //
                be, -length * M0 * skew(e), Mat3::Zero(),      //
                ce, Mat3::Zero(), length * M1 * skew(e);
            // moving all four vertices does nothing
            m.bottomLeftCorner<9, 3>() =
                -(byVertices.leftCols<3>() + byVertices.middleCols<3>(3) + byVertices.rightCols<3>());
            m.topRightCorner<3, 9>() = m.bottomLeftCorner<9, 3>().transpose();
            m.topLeftCorner<3, 3>() = -(m.block<3, 3>(3, 0) + m.block<3, 3>(6, 0) + m.block<3, 3>(9, 0));
            return m;
        }

      private:
        Vec3 e, b, c;           // edges x0 x1, x0 x2, x0 x3
        Vec3 n0, n1;            // normals, as long as twice the area
        Vec3 m0, m1;            // n / |n|^2
        double length;          // |e|
        double n0n0, n1n1;      // |n|^2
        double alongB, alongC;  // extents of b and c along e
    };

    /// m = factor slope slope^T, over the twelve coordinates
    template <class = void>
    static void setOuterProduct(Eigen::Matrix<double, 12, 12>& m, double factor, const Stencil<4>& slope) {
        const auto flat = slope.reshaped();
        for (int i = 0; i < 12; ++i) m.col(i) = (factor * flat(i)) * flat;
    }

    /// theta [rad]
    template <class = void>
    static double angle(const Stencil<4>& x) {
        const Vec3 e = x.col(1) - x.col(0);
        const Vec3 n0 = e.cross(x.col(2) - x.col(0)), n1 = (x.col(3) - x.col(0)).cross(e);
        return std::atan2(n0.cross(n1).dot(e.normalized()), n0.dot(n1));
    }

    /// The same angle in [-pi, pi].
    static double wrapped(double angle) {
        return std::abs(angle) <= std::numbers::pi ? angle : std::remainder(angle, 2.0 * std::numbers::pi);
    }
};
static_assert(StencilModel<DihedralBending> && PlasticStencilModel<DihedralBending>);

}  // namespace jacket
