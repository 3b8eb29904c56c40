#pragma once
#include <Eigen/Eigenvalues>

#include <cmath>
#include <optional>

#include "jacket/models/StencilModel.h"
#include "jacket/models/StencilTools.h"
#include "jacket/models/TriangleTerm.h"

namespace jacket {

/// Stretch and shear of one triangle of an isotropic or orthotropic sheet, with Poisson's contraction.
///
///          x2        F = [x1-x0  x2-x0] Dm^-1       deformation gradient, 3 x 2, Dm from the rest triangle    [-]
///         /  \       e = 1/2 (F^T F - I)            Green strain                                              [-]
///       x0 -- x1     S = c ((1 - nu) e + nu tr(e) I)  second Piola-Kirchhoff stress times thickness           [N/m]
///                    c = E t / (1 - nu^2)
///     E(x) = A/2 S : e = A c/2 ((1 - nu) e:e + nu (tr e)^2)                                                   [J]
///
/// Orthotropic (weftStiffness and shearStiffness set): e in the frame of warp 1 and weft 2, and
///     S_11 = c (e_11 + nu_21 e_22),  S_22 = c (nu_21 e_11 + E_2/E_1 e_22),  S_12 = 2 G t e_12                [N/m]
///     nu_21 = nu E_2/E_1,  c = E_1 t / (1 - nu nu_21)
/// computed as an isotropic law with this shear and this coupling, plus a stiffness of warp and weft along themselves.
///
/// Hessian:  Positive is the material part plus the geometric part with S clamped to its positive semi-definite part;
///           exact wherever S has no compression, at rest in particular.
/// Error:    constant strain: exact for homogeneous deformations. Softens in strong compression (F = 0 stores a finite
///           energy): for sheets that buckle or stretch moderately, as cloth and metal do.
/// Source:   plane-stress St. Venant-Kirchhoff law, e.g. Bonet and Wood, Nonlinear Continuum Mechanics for Finite
///           Element Analysis, 2nd ed. 2008, ch. 6.
struct StVenantKirchhoffMembrane {
    std::optional<double> stretchStiffness{};  ///< E t, of warp if orthotropic [N/m], >= 0; unset: the material's
    std::optional<double> poisson{};           ///< nu (nu_12) [-], -1 < nu <= 0.5; unset: the material's
    std::optional<double> weftStiffness{};   ///< E_2 t [N/m], >= 0, nu^2 E_2 < E_1; unset: the material's, or isotropic
    std::optional<double> shearStiffness{};  ///< G t [N/m], >= 0; unset: the material's, or isotropic
    std::optional<Vec3> warp{};  ///< direction 1 at rest, projected into every triangle; unset: the material's, or x

    static constexpr std::string_view kName = "stvk";
    static constexpr StencilSite kSite = StencilSite::Triangle;
    static constexpr int kVertices = 3;

    struct Rest {
        Mat2 inverseFrame;  ///< Dm^-1, rows g1 and g2, columns 1 and 2 [1/m]
        double shear;       ///< A c (1 - nu), or 2 A G t [N m]
        double dilation;    ///< A c nu, or A c nu_21 [N m]
        double warp = 0.0;  ///< what warp adds to these along itself; 0 in an isotropic sheet [N m]
        double weft = 0.0;  ///< and weft [N m]
    };

    StVenantKirchhoffMembrane fittedTo(const ShellMaterial& material) const {
        const double k = stiffnessOr(stretchStiffness, material.stretchStiffness(),
                                     "StVenantKirchhoffMembrane.stretchStiffness [N/m]");
        const double nu = poisson.value_or(material.poisson);
        requireParameter(nu > -1.0 && nu <= 0.5, "StVenantKirchhoffMembrane.poisson [-]", "> -1 and <= 0.5", nu);
        StVenantKirchhoffMembrane model = *this;
        model.stretchStiffness = k;
        model.poisson = nu;
        if (material.orthotropy) {
            if (!warp) model.warp = material.orthotropy->warpDirection;
            if (!weftStiffness) model.weftStiffness = material.orthotropy->weftYoung * material.thickness;
            if (!shearStiffness) model.shearStiffness = material.orthotropy->shear * material.thickness;
        }
        if (model.weftStiffness || model.shearStiffness) model.completeOrthotropy();
        return model;
    }

    /// Throws std::invalid_argument if the sheet is orthotropic and `warp` normal to the triangle.
    template <class = void>
    Rest rest(const Stencil<3>& X, double area) const {
        requireTriangle(X.col(0), X.col(1), X.col(2), "StVenantKirchhoffMembrane");
        const double nu = poisson.value(), k = stretchStiffness.value();
        if (!weftStiffness) {
            const double weight = area * k / (1.0 - nu * nu);
            return {.inverseFrame = inverseRestFrame(X, X.col(1) - X.col(0)),
                    .shear = weight * (1.0 - nu),
                    .dilation = weight * nu};
        }
        const double ratio = k > 0.0 ? *weftStiffness / k : 0.0;  // E_2 / E_1
        const double weight = area / (1.0 - nu * nu * ratio);     // A c / (E_1 t)
        const double shear = 2.0 * area * shearStiffness.value(), coupling = weight * nu * ratio * k;
        return {.inverseFrame = inverseRestFrame(X, projectedDirection(X, warp.value(), "StVenantKirchhoffMembrane")),
                .shear = shear,
                .dilation = coupling,
                .warp = weight * k - coupling - shear,
                .weft = weight * *weftStiffness - coupling - shear};
    }

    /// The formula. With F_1, F_2 the columns of F and a_i = F g_i, the derivative of F S g_i by x_j is
    ///     (g_i . S g_j) I + shear / 2 ((g_i . g_j) F F^T + a_j a_i^T) + dilation a_i a_j^T
    ///     + warp g_i1 g_j1 F_1 F_1^T + weft g_i2 g_j2 F_2 F_2^T
    /// of which the coefficients of F_1 F_1^T, F_1 F_2^T, F_2 F_1^T and F_2 F_2^T are collected.
    JACKET_FORMULA static TriangleTerm term(const Triple& a, const Triple& b, const Rest& r, HessianKind kind) {
        const double g11 = r.inverseFrame(0, 0), g12 = r.inverseFrame(0, 1);
        const double g21 = r.inverseFrame(1, 0), g22 = r.inverseFrame(1, 1);
        const Triple F1 = g11 * a + g21 * b, F2 = g12 * a + g22 * b;
        const double e11 = 0.5 * (dot(F1, F1) - 1.0), e22 = 0.5 * (dot(F2, F2) - 1.0), e12 = 0.5 * dot(F1, F2);
        const double spread = r.dilation * (e11 + e22);
        const PlaneStress S{(r.shear + r.warp) * e11 + spread, (r.shear + r.weft) * e22 + spread, r.shear * e12};
        const PlaneStress G = kind == HessianKind::Exact ? S : positivePart(S);
        const Triple P1 = S.s11 * F1 + S.s12 * F2, P2 = S.s12 * F1 + S.s22 * F2;

        const double half = 0.5 * r.shear, along1 = half + r.dilation + r.warp, along2 = half + r.dilation + r.weft;
        const auto block = [&](double gi1, double gi2, double gj1, double gj2) __attribute__((always_inline)) {
            const double both = half * (gi1 * gj1 + gi2 * gj2);
            const double k11 = both + along1 * (gi1 * gj1), k22 = both + along2 * (gi2 * gj2);
            const double k12 = half * (gj1 * gi2) + r.dilation * (gi1 * gj2);
            const double k21 = half * (gj2 * gi1) + r.dilation * (gi2 * gj1);
            const double geometric = gi1 * (G.s11 * gj1 + G.s12 * gj2) + gi2 * (G.s12 * gj1 + G.s22 * gj2);
            return outerSum(F1, k11 * F1 + k12 * F2, F2, k21 * F1 + k22 * F2, geometric);
        };
        return {.energy = 0.5 * (S.s11 * e11 + S.s22 * e22) + S.s12 * e12,
                .gradient1 = g11 * P1 + g12 * P2,
                .gradient2 = g21 * P1 + g22 * P2,
                .block11 = block(g11, g12, g11, g12),
                .block22 = block(g21, g22, g21, g22),
                .block12 = block(g11, g12, g21, g22)};
    }

    template <class = void>
    StencilEval<3> evaluate(const Stencil<3>& x, const Rest& r, HessianKind kind) const {
        const TriangleTerm t = term(triple(x.col(1) - x.col(0)), triple(x.col(2) - x.col(0)), r, kind);
        StencilEval<3> result;
        result.energy = t.energy;
        result.gradient.col(1) = vec3(t.gradient1);
        result.gradient.col(2) = vec3(t.gradient2);
        result.gradient.col(0) = -result.gradient.col(1) - result.gradient.col(2);
        setTriangleMatrix(result.hessian, mat3(t.block11), mat3(t.block12), mat3(t.block22));
        return result;
    }

    template <class = void>
    double energy(const Stencil<3>& x, const Rest& r) const {
        return term(triple(x.col(1) - x.col(0)), triple(x.col(2) - x.col(0)), r, HessianKind::Exact).energy;
    }

    /// Area times thickness times stress S that the strain's first-order change along dx leads to from x [N m].
    template <class = void>
    Mat2 predictedStress(const Stencil<3>& x, const Stencil<3>& dx, const Rest& r) const {
        const Eigen::RowVector2d g1 = r.inverseFrame.row(0), g2 = r.inverseFrame.row(1);
        const Eigen::Matrix<double, 3, 2> F = (x.col(1) - x.col(0)) * g1 + (x.col(2) - x.col(0)) * g2;
        const Eigen::Matrix<double, 3, 2> dF = (dx.col(1) - dx.col(0)) * g1 + (dx.col(2) - dx.col(0)) * g2;
        const Mat2 e = 0.5 * (F.transpose() * F - Mat2::Identity() + dF.transpose() * F + F.transpose() * dF);
        return stressOf(e, r);
    }

    /// What a stress adds to the exact Hessian, times I3 [N/m].
    template <class = void>
    Mat3 geometricHessian(const Mat2& S, const Rest& r) const {
        Eigen::Matrix<double, 3, 2> g;
        g << -r.inverseFrame.colwise().sum(), r.inverseFrame;
        return g * S * g.transpose();
    }

    /// Stretching beyond the limit stays: von Mises' rule in plane stress with the associated flow, which keeps the
    /// volume (the sheet thins where it stretches), and linear hardening; `accumulated` is the equivalent plastic
    /// strain. The rest metric moves along the principal strains. Orthotropic sheets do not yield in their plane.
    /// Source: cutting-plane return mapping, Simo and Hughes, Computational Inelasticity, 1998, ch. 3.
    template <class = void>
    bool flow(const Stencil<3>& x, double area, const YieldRule& rule, Rest& r, double& accumulated) const {
        if (weftStiffness) return false;
        const Eigen::Matrix<double, 3, 2> F =
            (x.col(1) - x.col(0)) * r.inverseFrame.row(0) + (x.col(2) - x.col(0)) * r.inverseFrame.row(1);
        const Eigen::SelfAdjointEigenSolver<Mat2> principal(F.transpose() * F);
        const Vec2 squared = principal.eigenvalues();  // of the stretches
        Mat2 law;                                      // thickness times stress from Green strain [N/m]
        law << r.shear + r.dilation, r.dilation, r.dilation, r.shear + r.dilation;
        law /= area;
        Vec2 plastic = Vec2::Zero();  // logarithmic strains
        bool yields = false;
        for (int iteration = 0; iteration < 50; ++iteration) {
            const Vec2 left = squared.cwiseProduct((-2.0 * plastic).array().exp().matrix());
            const Vec2 tension = law * (0.5 * (left - Vec2::Ones()));
            const double mises = std::sqrt(tension.squaredNorm() - tension[0] * tension[1]);
            const double excess = mises - rule.tension - rule.stiffening * accumulated;
            if (!(excess > kYieldRounding * (rule.tension + rule.stiffening * accumulated))) break;
            const Vec2 direction = Vec2(2.0 * tension[0] - tension[1], 2.0 * tension[1] - tension[0]) / (2.0 * mises);
            const double slip =
                excess / (direction.dot(law * left.cwiseProduct(direction)) + rule.stiffening);  // Newton's step
            plastic += slip * direction;
            accumulated += slip;
            yields = true;
        }
        if (!yields) return false;
        const Mat2& axes = principal.eigenvectors();
        r.inverseFrame =
            (r.inverseFrame * axes * (-plastic).array().exp().matrix().asDiagonal() * axes.transpose()).eval();
        return true;
    }

  private:
    /// Times A.
    template <class = void>
    Mat2 stressOf(const Mat2& e, const Rest& r) const {
        Mat2 S = r.shear * e + r.dilation * e.trace() * Mat2::Identity();
        if (weftStiffness) {
            S(0, 0) += r.warp * e(0, 0);
            S(1, 1) += r.weft * e(1, 1);
        }
        return S;
    }

    /// Fills what of weft and shear is still unset as in the isotropic sheet, and checks all of it.
    void completeOrthotropy() {
        const double k = *stretchStiffness, nu = *poisson;
        weftStiffness = stiffnessOr(weftStiffness, k, "StVenantKirchhoffMembrane.weftStiffness [N/m]");
        shearStiffness =
            stiffnessOr(shearStiffness, k / (2.0 * (1.0 + nu)), "StVenantKirchhoffMembrane.shearStiffness [N/m]");
        requireParameter(nu == 0.0 || nu * nu * *weftStiffness < k || *weftStiffness == 0.0,
                         "StVenantKirchhoffMembrane.weftStiffness [N/m]",
                         "< E_1 t / nu_12^2 (positive definite stiffness)", *weftStiffness);
        if (!warp) warp = Vec3::UnitX();
        const double length = warp->norm();
        requireParameter(length > 0.0 && std::isfinite(length), "StVenantKirchhoffMembrane.warp's length [-]", "> 0",
                         length);
    }

    struct PlaneStress {
        double s11, s22, s12;
    };

    /// Nearest positive semi-definite matrix to a symmetric S, in closed form: f (S - l I), where the smaller
    /// eigenvalue l is negative.
    JACKET_FORMULA static PlaneStress positivePart(const PlaneStress& S) {
        constexpr double kTiny = 1e-300;  // keeps 0 / 0 out where nothing has to be cut off
        const double mean = 0.5 * (S.s11 + S.s22), difference = 0.5 * (S.s11 - S.s22);
        const double radius = std::sqrt(difference * difference + S.s12 * S.s12);
        const double smaller = mean - radius, larger = mean + radius, share = larger / (2.0 * radius + kTiny);
        const double partial = larger > 0.0 ? share : 0.0;
        const double factor = smaller >= 0.0 ? 1.0 : partial, cut = smaller >= 0.0 ? 0.0 : smaller;
        return {factor * (S.s11 - cut), factor * (S.s22 - cut), factor * S.s12};
    }
};
static_assert(TriangleTermModel<StVenantKirchhoffMembrane> && PlasticStencilModel<StVenantKirchhoffMembrane>);

}  // namespace jacket
