#pragma once
#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "jacket/models/StencilModel.h"
#include "jacket/models/StencilTools.h"

namespace jacket {

/// A spring along one edge: the sheet as a net.
///
///     x0 ~~~~~ x1    E(x) = 1/2 k_e (|x0 - x1| - l)^2       [J]
///                    l    rest length                       [m]
///                    k_e = E t (A0 + A1) / l^2,  Ai the rest areas of the adjacent triangles (one at the border) [N/m]
///
/// One-sided by default, for cloth that buckles between the vertices: no force while shorter than at rest (the force is
/// continuous, its derivative is not). With `compression`, two-sided, for shells.
/// Hessian: Positive clamps 1 - l/|x0 - x1| at zero, so it is exact in tension and at rest.
/// Error:   a sheet of modulus E, with Poisson's ratio 1/3 whatever the material's, on equilateral meshes. Square grids
///          are anisotropic. Pulled straight and free to contract: 1.2 E along their axes; with one diagonal 1 E along
///          and 0.33 E across it; with alternating ones 0.75 E at 45 degrees (tests/core/physics/MembraneTest.cpp).
/// Source:  Choi and Ko, Stable but Responsive Cloth, SIGGRAPH 2002; their printed force divides by the rest length.
struct SpringMembrane {
    std::optional<double> stretchStiffness{};  ///< E t [N/m], >= 0; unset: the material's
    bool compression = false;                  ///< resist compression too

    static constexpr std::string_view kName = "springs";
    static constexpr StencilSite kSite = StencilSite::Edge;
    static constexpr int kVertices = 2;

    struct Rest {
        double length;     ///< l [m]
        double stiffness;  ///< k_e [N/m]
    };

    SpringMembrane fittedTo(const ShellMaterial& material) const {
        if (material.orthotropy)
            throw std::invalid_argument("SpringMembrane is isotropic; an orthotropic material needs another membrane");
        return {.stretchStiffness =
                    stiffnessOr(stretchStiffness, material.stretchStiffness(), "SpringMembrane.stretchStiffness [N/m]"),
                .compression = compression};
    }

    template <class = void>
    Rest rest(const Stencil<2>& X, double area) const {
        const double length = (X.col(0) - X.col(1)).norm();
        requireParameter(length > 0.0 && std::isfinite(length), "SpringMembrane: rest length of an edge [m]", "> 0",
                         length);
        return {.length = length, .stiffness = stretchStiffness.value() * area / (length * length)};
    }

    template <class = void>
    StencilEval<2> evaluate(const Stencil<2>& x, const Rest& r, HessianKind kind) const {
        const Vec3 d = x.col(0) - x.col(1);
        const double length = std::max(d.norm(), 1e-9 * r.length);  // a collapsed spring has no direction
        const double elongation = length - r.length;
        if (elongation < 0.0 && !compression)
            return {.energy = 0.0, .gradient = Stencil<2>::Zero(), .hessian = Eigen::Matrix<double, 6, 6>::Zero()};

        const Vec3 direction = d / length;
        double across = elongation / length;  // 1 - l/|d|
        if (kind == HessianKind::Positive) across = std::max(0.0, across);
        Mat3 block = r.stiffness * (1.0 - across) * direction * direction.transpose();
        block.diagonal().array() += r.stiffness * across;

        StencilEval<2> result;
        result.energy = 0.5 * r.stiffness * elongation * elongation;
        result.gradient.col(0) = r.stiffness * elongation * direction;
        result.gradient.col(1) = -result.gradient.col(0);
        result.hessian << block, -block, -block, block;
        return result;
    }

    template <class = void>
    double energy(const Stencil<2>& x, const Rest& r) const {
        const double elongation = std::max((x.col(0) - x.col(1)).norm(), 1e-9 * r.length) - r.length;
        return elongation < 0.0 && !compression ? 0.0 : 0.5 * r.stiffness * elongation * elongation;
    }
};
static_assert(StencilModel<SpringMembrane>);

}  // namespace jacket
