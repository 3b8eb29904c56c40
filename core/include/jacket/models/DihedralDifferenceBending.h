#pragma once
#include <optional>

#include "jacket/models/DihedralBending.h"

namespace jacket {

/// DihedralBending's energy with every derivative of the angle by central differences: 25 angles per evaluation for
/// gradient and Gauss-Newton part. The baseline that analytic derivatives are measured against, for nothing else.
///
/// Hessian: Positive is the Gauss-Newton part; Exact adds the second differences.
/// Error:   within some edge lengths of the origin, gradient 1e-8, exact Hessian 1e-5 of DihedralBending's; both lose
///          digits in proportion to the distance from the origin.
struct DihedralDifferenceBending {
    std::optional<double> stiffness{};  ///< D [N m], >= 0; unset: the material's

    static constexpr std::string_view kName = "dihedral-difference";
    static constexpr StencilSite kSite = StencilSite::Hinge;
    static constexpr int kVertices = 4;

    using Rest = DihedralBending::Rest;

    DihedralDifferenceBending fittedTo(const ShellMaterial& material) const {
        return {stiffnessOr(stiffness, material.bendingStiffness(), "DihedralDifferenceBending.stiffness [N m]")};
    }

    template <class = void>
    Rest rest(const Stencil<4>& X, double area) const {
        return DihedralBending{stiffness}.rest(X, area);
    }

    template <class = void>
    StencilEval<4> evaluate(const Stencil<4>& x, const Rest& r, HessianKind kind) const {
        const auto angleAt = [&](int i, double di, int j, double dj) {
            Stencil<4> y = x;
            y.reshaped()(i) += di;
            y.reshaped()(j) += dj;
            return DihedralBending::angle(y);
        };
        const double bend = DihedralBending::wrapped(DihedralBending::angle(x) - r.angle);

        const double h = 5e-6 * r.length;  // about the cube root of the rounding error
        Stencil<4> slope;
        for (int i = 0; i < 12; ++i)
            slope.reshaped()(i) = DihedralBending::wrapped(angleAt(i, h, i, 0.0) - angleAt(i, -h, i, 0.0)) / (2.0 * h);

        StencilEval<4> result;
        result.energy = 0.5 * r.weight * bend * bend;
        result.gradient = (r.weight * bend) * slope;
        DihedralBending::setOuterProduct(result.hessian, r.weight, slope);
        if (kind == HessianKind::Positive) return result;

        const double h2 = 1e-4 * r.length;  // about its fourth root
        for (int i = 0; i < 12; ++i)
            for (int j = 0; j <= i; ++j) {
                const double towards = DihedralBending::wrapped(angleAt(i, h2, j, h2) - angleAt(i, h2, j, -h2));
                const double away = DihedralBending::wrapped(angleAt(i, -h2, j, h2) - angleAt(i, -h2, j, -h2));
                const double second = r.weight * bend * (towards - away) / (4.0 * h2 * h2);
                result.hessian(i, j) += second;
                if (i != j) result.hessian(j, i) += second;
            }
        return result;
    }

    template <class = void>
    double energy(const Stencil<4>& x, const Rest& r) const {
        return DihedralBending{stiffness}.energy(x, r);
    }
};
static_assert(StencilModel<DihedralDifferenceBending>);

}  // namespace jacket
