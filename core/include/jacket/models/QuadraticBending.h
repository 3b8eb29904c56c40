#pragma once
#include <optional>

#include "jacket/models/StencilModel.h"
#include "jacket/models/StencilTools.h"

namespace jacket {

/// Bending of one interior edge, for sheets that are flat at rest and hardly stretch.
///
///         x2          E(x) = 1/2 D / (A0 + A1) |l|^2,  l = sum_i c_i x_i                            [J]
///        /  \         D    bending stiffness, the plate's E t^3 / (12 (1 - nu^2))                   [N m]
///      x0 -- x1       Ai   rest areas of triangles (x0 x1 x2) and (x1 x0 x3)                        [m^2]
///        \  /         c_i  sums of rest cotangents, sum_i c_i = 0                                   [-]
///         x3
/// Unstretched, |l| = 2 L sin(theta/2) with L the edge's length: DihedralBending's energy for small angles.
/// Hessian: constant, positive semi-definite: D / (A0 + A1) c c^T times I3.
/// Error:   rolled to a cylinder, an equilateral mesh stores the plate's energy in every direction, and a square grid
///          along its axes. Otherwise a grid with one diagonal stores 0.75 to 3.0 of it (3 where the diagonals become
///          circles), with alternating diagonals 1.0 to 1.5 (tests/core/physics/CylinderTest.cpp). A rest shape that is
///          not flat is drawn towards flatness, and stores energy at rest: see CubicShellBending.
/// Source:  Bergou et al., A Quadratic Bending Model for Inextensible Surfaces, SGP 2006; rescaled to the plate.
struct QuadraticBending {
    std::optional<double> stiffness{};  ///< D [N m], >= 0; unset: the material's

    static constexpr std::string_view kName = "quadratic";
    static constexpr StencilSite kSite = StencilSite::Hinge;
    static constexpr int kVertices = 4;

    struct Rest {
        Vec4 cotangents;  ///< c [-]
        double weight;    ///< D / (A0 + A1) [N/m]
    };

    QuadraticBending fittedTo(const ShellMaterial& material) const {
        return {stiffnessOr(stiffness, material.bendingStiffness(), "QuadraticBending.stiffness [N m]")};
    }

    template <class = void>
    Rest rest(const Stencil<4>& X, double area) const {
        requireHinge(X, "QuadraticBending");
        return {.cotangents = cotangents(X), .weight = stiffness.value() / area};
    }

    template <class = void>
    StencilEval<4> evaluate(const Stencil<4>& x, const Rest& r, HessianKind) const {
        const Vec3 l = bend(x, r);
        const Vec4 weighted = r.weight * r.cotangents;
        return {.energy = 0.5 * r.weight * l.squaredNorm(),
                .gradient = l * weighted.transpose(),
                .hessian = timesIdentity3<4>(weighted * r.cotangents.transpose())};
    }

    template <class = void>
    double energy(const Stencil<4>& x, const Rest& r) const {
        return 0.5 * r.weight * bend(x, r).squaredNorm();
    }

    /// c, from the angles between the edges x0 x1 and those that leave it.
    template <class = void>
    static Vec4 cotangents(const Stencil<4>& X) {
        const Vec3 x0 = X.col(0), x1 = X.col(1), x2 = X.col(2), x3 = X.col(3);
        const double at0In0 = cotangent(x0, x1, x2), at1In0 = cotangent(x1, x0, x2);  // in triangle (x0 x1 x2)
        const double at0In1 = cotangent(x0, x1, x3), at1In1 = cotangent(x1, x0, x3);  // in triangle (x1 x0 x3)
        return {at1In0 + at1In1, at0In0 + at0In1, -at0In0 - at1In0, -at0In1 - at1In1};
    }

  private:
    /// l [m]
    template <class = void>
    static Vec3 bend(const Stencil<4>& x, const Rest& r) {
        const Stencil<3> fromX0 = x.rightCols<3>().colwise() - x.col(0);  // loses no digits far from the origin
        return fromX0 * r.cotangents.tail<3>();
    }
};
static_assert(StencilModel<QuadraticBending>);

}  // namespace jacket
