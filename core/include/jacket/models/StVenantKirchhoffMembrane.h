#pragma once
#include <cmath>
#include <optional>

#include "jacket/models/StencilModel.h"
#include "jacket/models/StencilTools.h"

namespace jacket {

/// Stretch and shear of one triangle of an isotropic sheet, with Poisson's contraction.
///
///          x2        F = [x1-x0  x2-x0] Dm^-1       deformation gradient, 3 x 2, Dm from the rest triangle    [-]
///         /  \       e = 1/2 (F^T F - I)            Green strain                                              [-]
///       x0 -- x1     S = c ((1 - nu) e + nu tr(e) I)  second Piola-Kirchhoff stress times thickness           [N/m]
///                    c = E t / (1 - nu^2)
///     E(x) = A/2 S : e = A c/2 ((1 - nu) e:e + nu (tr e)^2)                                                   [J]
///
/// Hessian:  Positive is the material part plus the geometric part with S clamped to its positive semi-definite part;
///           exact wherever S has no compression, at rest in particular.
/// Error:    constant strain: exact for homogeneous deformations. Softens in strong compression (F = 0 stores a finite
///           energy): for sheets that buckle or stretch moderately, as cloth and metal do.
/// Source:   plane-stress St. Venant-Kirchhoff law, e.g. Bonet and Wood, Nonlinear Continuum Mechanics for Finite
///           Element Analysis, 2nd ed. 2008, ch. 6.
struct StVenantKirchhoffMembrane {
    std::optional<double> stretchStiffness{};  ///< E t [N/m], >= 0; unset: the material's
    std::optional<double> poisson{};           ///< nu [-], -1 < nu <= 0.5; unset: the material's

    static constexpr std::string_view kName = "stvk";
    static constexpr StencilSite kSite = StencilSite::Triangle;
    static constexpr int kVertices = 3;

    struct Rest {
        Mat2 inverseFrame;  ///< Dm^-1, rows g1 and g2 [1/m]
        double shear;       ///< A c (1 - nu) [N m]
        double dilation;    ///< A c nu [N m]
    };

    StVenantKirchhoffMembrane fittedTo(const ShellMaterial& material) const {
        const double k = stiffnessOr(stretchStiffness, material.stretchStiffness(),
                                     "StVenantKirchhoffMembrane.stretchStiffness [N/m]");
        const double nu = poisson.value_or(material.poisson);
        requireParameter(nu > -1.0 && nu <= 0.5, "StVenantKirchhoffMembrane.poisson [-]", "> -1 and <= 0.5", nu);
        return {.stretchStiffness = k, .poisson = nu};
    }

    template <class = void>
    Rest rest(const Stencil<3>& X, double area) const {
        requireTriangle(X.col(0), X.col(1), X.col(2), "StVenantKirchhoffMembrane");
        const double nu = poisson.value(), weight = area * stretchStiffness.value() / (1.0 - nu * nu);
        return {.inverseFrame = inverseRestFrame(X, X.col(1) - X.col(0)),
                .shear = weight * (1.0 - nu),
                .dilation = weight * nu};
    }

    template <class = void>
    StencilEval<3> evaluate(const Stencil<3>& x, const Rest& r, HessianKind kind) const {
        const Eigen::RowVector2d g1 = r.inverseFrame.row(0), g2 = r.inverseFrame.row(1);
        const Vec3 a = x.col(1) - x.col(0), b = x.col(2) - x.col(0);
        const Eigen::Matrix<double, 3, 2> F = a * g1 + b * g2;
        const Mat2 e = 0.5 * (F.transpose() * F - Mat2::Identity());
        const Mat2 S = r.shear * e + r.dilation * e.trace() * Mat2::Identity();  // times A

        StencilEval<3> result;
        result.energy = 0.5 * S.cwiseProduct(e).sum();
        const Eigen::Matrix<double, 3, 2> P = F * S;
        result.gradient.col(1) = P * g1.transpose();
        result.gradient.col(2) = P * g2.transpose();
        result.gradient.col(0) = -result.gradient.col(1) - result.gradient.col(2);

        // the derivative of F S g_i by x_j, with a_i = F g_i:
        // (g_i . S g_j) I + shear / 2 ((g_i . g_j) F F^T + a_j a_i^T) + dilation a_i a_j^T
        const Mat2 geometric = kind == HessianKind::Exact ? S : positivePart(S);
        const Mat3 FFt = (0.5 * r.shear) * (F * F.transpose());
        const Vec3 a1 = F * g1.transpose(), a2 = F * g2.transpose();
        const auto block = [&](const Eigen::RowVector2d& gi, const Eigen::RowVector2d& gj, const Vec3& ai,
                               const Vec3& aj) {
            const Vec3 shearAi = (0.5 * r.shear) * ai, dilationAi = r.dilation * ai;
            Mat3 m = gi.dot(gj) * FFt + aj * shearAi.transpose() + dilationAi * aj.transpose();
            m.diagonal().array() += gi.dot(gj * geometric);  // S is symmetric
            return m;
        };
        setTriangleMatrix(result.hessian, block(g1, g1, a1, a1), block(g1, g2, a1, a2), block(g2, g2, a2, a2));
        return result;
    }

  private:
    /// Nearest positive semi-definite matrix to a symmetric S, in closed form.
    template <class = void>
    static Mat2 positivePart(const Mat2& S) {
        const double mean = 0.5 * (S(0, 0) + S(1, 1));
        const double radius = std::hypot(0.5 * (S(0, 0) - S(1, 1)), S(0, 1));
        if (mean - radius >= 0.0) return S;
        if (mean + radius <= 0.0) return Mat2::Zero();
        return (mean + radius) / (2.0 * radius) * (S - (mean - radius) * Mat2::Identity());
    }
};
static_assert(StencilModel<StVenantKirchhoffMembrane>);

}  // namespace jacket
