#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "jacket/models/StencilModel.h"
#include "jacket/models/StencilTools.h"

namespace jacket {

/// Stretch along warp and weft and shear between them, of one triangle of woven cloth; no Poisson's contraction.
///
///          x2        [w_u w_v] = F = [x1-x0  x2-x0] Dm^-1    images of the unit warp and weft vectors         [-]
///         /  \       conditions  c_u = |w_u| - b_u,  c_v = |w_v| - b_v,  c_s = w_u . w_v                      [-]
///       x0 -- x1     A           rest area                                                                    [m^2]
///     E(x) = A/2 (k_u c_u^2 + k_v c_v^2 + k_s c_s^2)                                                          [J]
///
/// Unset stiffnesses: k_u = k_v = E t, so that a strip pulled along warp or weft has the material's Young's modulus
/// (nothing couples the two: the plate's factor 1 / (1 - nu^2) has no place), and k_s = G t = E t / (2 (1 + nu)). Of an
/// orthotropic material E_1 t, E_2 t and its own G t.
/// b_u, b_v other than 1 shrink or widen the cloth along warp and weft.
///
/// Hessian:   Positive clamps the factor 1 - b/|w|, negative in compression, at zero and drops c_s times the second
///            derivative of c_s, which is indefinite. Exact at rest when b_u = b_v = 1.
/// Damping:   force -k_d sum_c (dC/dx) (dC/dt) with C = sqrt(A) c, or A c with areaSquared.
/// Error:     isotropic only for nu = 0; pulled at an angle to the warp it is softer than E t for nu > 0.
/// Source:    Baraff and Witkin, Large Steps in Cloth Simulation, SIGGRAPH 1998. They weight with A^2 (C = A c), which
///            makes the stiffness depend on the mesh: areaSquared, for reproduction only. Their second derivative of
///            |w| has w for the unit vector.
struct BaraffWitkinMembrane {
    std::optional<double> stretchU{};  ///< k_u [N/m], >= 0; unset: E t
    std::optional<double> stretchV{};  ///< k_v [N/m], >= 0; unset: E t, or the material's E_2 t
    std::optional<double> shear{};     ///< k_s [N/m], >= 0; unset: E t / (2 (1 + nu)), or the material's G t. Real
                                       ///< weaves: some 10 .. 100 N/m
    double bU = 1.0;                   ///< b_u [-], > 0
    double bV = 1.0;                   ///< b_v [-], > 0
    double conditionDamping = 0.0;     ///< k_d [N s/m], >= 0; with areaSquared [N s/m^3]
    bool areaSquared = false;          ///< weight A^2 as in the paper; the three stiffnesses are then in [N/m^3]
    std::optional<Vec3> warp{};  ///< direction of u at rest, projected into every triangle [-]; unset: an orthotropic
                                 ///< material's, else x, or y on triangles that face x

    static constexpr std::string_view kName = "baraff-witkin";
    static constexpr StencilSite kSite = StencilSite::Triangle;
    static constexpr int kVertices = 3;

    struct Rest {
        Mat2 inverseFrame;  ///< Dm^-1, rows g1 and g2, columns u and v [1/m]
        double weight;      ///< A [m^2], or A^2 [m^4]
    };

    BaraffWitkinMembrane fittedTo(const ShellMaterial& material) const {
        BaraffWitkinMembrane model = *this;
        const double k = material.stretchStiffness(), t = material.thickness;
        const auto& woven = material.orthotropy;
        model.stretchU = stiffnessOr(stretchU, k, "BaraffWitkinMembrane.stretchU [N/m]");
        model.stretchV = stiffnessOr(stretchV, woven ? woven->weftYoung * t : k, "BaraffWitkinMembrane.stretchV [N/m]");
        model.shear = stiffnessOr(shear, woven ? woven->shear * t : k / (2.0 * (1.0 + material.poisson)),
                                  "BaraffWitkinMembrane.shear [N/m]");
        requireParameter(bU > 0.0 && std::isfinite(bU), "BaraffWitkinMembrane.bU [-]", "> 0", bU);
        requireParameter(bV > 0.0 && std::isfinite(bV), "BaraffWitkinMembrane.bV [-]", "> 0", bV);
        requireParameter(conditionDamping >= 0.0 && std::isfinite(conditionDamping),
                         "BaraffWitkinMembrane.conditionDamping [N s/m]", ">= 0", conditionDamping);
        if (woven && !warp) model.warp = woven->warpDirection;
        const double length = model.warp ? model.warp->norm() : 1.0;
        requireParameter(length > 0.0 && std::isfinite(length), "BaraffWitkinMembrane.warp's length [-]", "> 0",
                         length);
        return model;
    }

    /// Throws std::invalid_argument if `warp` is set and normal to the triangle.
    template <class = void>
    Rest rest(const Stencil<3>& X, double area) const {
        requireTriangle(X.col(0), X.col(1), X.col(2), "BaraffWitkinMembrane");
        const Vec3 a = X.col(1) - X.col(0), b = X.col(2) - X.col(0);
        const bool facesX = std::abs(a.cross(b).normalized().x()) > 1.0 - 1e-5;  // within 0.3 degrees
        const Vec3 direction = warp.value_or(facesX ? Vec3::UnitY() : Vec3::UnitX());
        const Vec3 u = projectedDirection(X, direction, "BaraffWitkinMembrane");
        return {.inverseFrame = inverseRestFrame(X, u), .weight = areaSquared ? area * area : area};
    }

    template <class = void>
    StencilEval<3> evaluate(const Stencil<3>& x, const Rest& r, HessianKind kind) const {
        const double kS = r.weight * *shear;
        const Eigen::Matrix<double, 3, 2> w = deformation(x, r);
        const Stretch u = stretch(w.col(0), r.weight * *stretchU, bU, kind);
        const Stretch v = stretch(w.col(1), r.weight * *stretchV, bV, kind);
        const double cS = w.col(0).dot(w.col(1));
        const double g1u = r.inverseFrame(0, 0), g1v = r.inverseFrame(0, 1);
        const double g2u = r.inverseFrame(1, 0), g2v = r.inverseFrame(1, 1);
        const Vec3 s1 = g1u * w.col(1) + g1v * w.col(0), s2 = g2u * w.col(1) + g2v * w.col(0);  // dc_s/dx1, dc_s/dx2

        StencilEval<3> result;
        result.energy = energyOf(w, r);
        result.gradient.col(1) = g1u * u.gradient + g1v * v.gradient + kS * cS * s1;
        result.gradient.col(2) = g2u * u.gradient + g2v * v.gradient + kS * cS * s2;
        result.gradient.col(0) = -result.gradient.col(1) - result.gradient.col(2);

        const double shearCurvature = kind == HessianKind::Exact ? kS * cS : 0.0;
        const auto block = [&](double giu, double giv, double gju, double gjv, const Vec3& si, const Vec3& sj) {
            Mat3 m = (giu * gju) * u.hessian + (giv * gjv) * v.hessian + kS * si * sj.transpose();
            m.diagonal().array() += shearCurvature * (giu * gjv + giv * gju);
            return m;
        };
        setTriangleMatrix(result.hessian, block(g1u, g1v, g1u, g1v, s1, s1), block(g1u, g1v, g2u, g2v, s1, s2),
                          block(g2u, g2v, g2u, g2v, s2, s2));
        return result;
    }

    template <class = void>
    double energy(const Stencil<3>& x, const Rest& r) const {
        return energyOf(deformation(x, r), r);
    }

    bool isDamped() const { return conditionDamping > 0.0; }

    template <class = void>
    Eigen::Matrix<double, 9, 9> damping(const Stencil<3>& x, const Rest& r) const {
        const Eigen::Matrix<double, 3, 2> w = deformation(x, r);
        const Vec3 u = w.col(0) / safeLength(w.col(0)), v = w.col(1) / safeLength(w.col(1));
        const double k = conditionDamping * r.weight;
        const auto slopes = [&](int row) {  // dc/dx of the vertex that belongs to this row of Dm^-1
            const double gu = r.inverseFrame(row, 0), gv = r.inverseFrame(row, 1);
            return std::array<Vec3, 3>{gu * u, gv * v, gu * w.col(1) + gv * w.col(0)};
        };
        const auto s1 = slopes(0), s2 = slopes(1);
        const auto block = [&](const std::array<Vec3, 3>& si, const std::array<Vec3, 3>& sj) -> Mat3 {
            return k * (si[0] * sj[0].transpose() + si[1] * sj[1].transpose() + si[2] * sj[2].transpose());
        };
        Eigen::Matrix<double, 9, 9> m;
        setTriangleMatrix(m, block(s1, s1), block(s1, s2), block(s2, s2));
        return m;
    }

  private:
    struct Stretch {
        Vec3 gradient;  ///< by w
        Mat3 hessian;   ///< by w
    };

    template <class = void>
    static double safeLength(const Vec3& w) {
        return std::max(w.norm(), 1e-9);
    }  // a collapsed thread has no direction

    template <class = void>
    static Eigen::Matrix<double, 3, 2> deformation(const Stencil<3>& x, const Rest& r) {
        const Vec3 a = x.col(1) - x.col(0), b = x.col(2) - x.col(0);
        return a * r.inverseFrame.row(0) + b * r.inverseFrame.row(1);
    }

    template <class = void>
    double energyOf(const Eigen::Matrix<double, 3, 2>& w, const Rest& r) const {
        const double cU = safeLength(w.col(0)) - bU, cV = safeLength(w.col(1)) - bV, cS = w.col(0).dot(w.col(1));
        return 0.5 * r.weight * (*stretchU * cU * cU + *stretchV * cV * cV + *shear * cS * cS);
    }

    /// Derivatives of 1/2 k (|w| - b)^2.
    template <class = void>
    static Stretch stretch(const Vec3& w, double k, double b, HessianKind kind) {
        const double length = safeLength(w), c = length - b;
        const Vec3 direction = w / length;
        const double across = kind == HessianKind::Exact ? c / length : std::max(0.0, c / length);  // 1 - b/|w|
        Mat3 hessian = k * (1.0 - across) * direction * direction.transpose();
        hessian.diagonal().array() += k * across;
        return {.gradient = k * c * direction, .hessian = hessian};
    }
};
static_assert(DampedStencilModel<BaraffWitkinMembrane>);

}  // namespace jacket
