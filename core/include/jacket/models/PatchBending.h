#pragma once
#include <optional>
#include <string_view>

#include "jacket/Material.h"
#include "jacket/models/StencilTools.h"

namespace jacket {

/// Bending of the patch around each triangle: the thin plate's own energy, right on any mesh.
///
///     E(x) = D A / 2 ((1 - nu) (|r_uu|^2 + |r_vv|^2 + 2 |r_uv|^2) + nu |r_uu + r_vv|^2)                  [J]
///     r_ab = sum_i B_ab,i x_i - b_ab n(x)     a vector: change of curvature times normal                [1/m]
///     B    second derivatives, at the triangle's centre, of the quadratic fitted to the patch (all vertices that share
///          a vertex with the triangle), less its share within the triangle's plane at rest, so that r = 0 there
///     b    second fundamental form at rest, 0 for a flat sheet [1/m]; plastic bending moves it
///     n    unit normal of the triangle as it is now
///     A    rest area of the triangle [m^2]; D = E t^3 / (12 (1 - nu^2)) [N m]
///
/// Hessian:  Flat: a constant scalar matrix times I3, about 40 entries a row. Curved: that, and terms of the normal;
///           Positive keeps the Gauss-Newton part, exact at rest.
/// Error:    second order: a cantilever under its own weight 1.5 / 0.4 / 0.1 % too soft with 10 / 20 / 40 cells of a
///           one-diagonal grid, 2.8 / 1.0 / 0.4 % alternating, 2.7 / 1.0 / 0.4 % on jittered Delaunay meshes. Hinge
///           models do not converge at all (tests/core/physics).
/// Source:   moving least squares (Lancaster and Salkauskas 1981) as a Kirchhoff plate element of one triangle and its
///           neighbours, in the way of Onate and Zarate's rotation-free triangles (2000); balanced as in PatchFit.h.
struct PatchBending {
    std::optional<double> stiffness{};  ///< D [N m], >= 0; unset: the material's
    std::optional<double> poisson{};    ///< nu [-], -1 < nu <= 0.5; unset: the material's

    static constexpr std::string_view kName = "patch";

    PatchBending fittedTo(const ShellMaterial& material) const {
        const double nu = poisson.value_or(material.poisson);
        requireParameter(nu > -1.0 && nu <= 0.5, "PatchBending.poisson [-]", "> -1 and <= 0.5", nu);
        return {.stiffness = stiffnessOr(stiffness, material.bendingStiffness(), "PatchBending.stiffness [N m]"),
                .poisson = nu};
    }
};

}  // namespace jacket
