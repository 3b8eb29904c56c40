#pragma once
#include <concepts>
#include <string_view>

#include "jacket/Material.h"
#include "jacket/Types.h"

namespace jacket {

template <int N>
using Stencil = Eigen::Matrix<double, 3, N>;  ///< positions of the N vertices that one term of an energy depends on

/// One term of an energy at x. Hessian rows and columns are ordered x0.x x0.y x0.z x1.x ... (3 N x 3 N).
template <int N>
struct StencilEval {
    double energy;                                ///< [J]
    Stencil<N> gradient;                          ///< dE/dx [N], a column per vertex
    Eigen::Matrix<double, 3 * N, 3 * N> hessian;  ///< d2E/dx2 [N/m]
};

/// Which second derivative `evaluate` returns.
enum class HessianKind {
    Exact,     ///< the derivative of the gradient; what the tests compare with central differences
    Positive,  ///< a positive semi-definite part of it, which keeps the step's matrix positive definite
};

/// What the N vertices are.
enum class StencilSite {
    Edge,      ///< N = 2, every edge
    Triangle,  ///< N = 3, counter-clockwise
    Hinge,     ///< N = 4, interior edge x0 x1 with x2, x3 opposite: triangles (x0 x1 x2) and (x1 x0 x3)
};

/// Formulas are written as `template <class = void>` so that whoever only names a model, as every user of ShellOptions
/// does, need not compile them.
///
/// A model: parameters and formula of one energy. It holds no mesh and no loop; `Rest` is what it remembers per
/// stencil. Where it has `energy(x, rest)` beside `evaluate`, checks of a step cost less.
template <class Model>
concept StencilModel = requires(const Model model, const Stencil<Model::kVertices> x, double area,
                                const typename Model::Rest rest, const ShellMaterial material) {
    { Model::kName } -> std::convertible_to<std::string_view>;  // as scene files spell it
    { Model::kSite } -> std::convertible_to<StencilSite>;
    { model.fittedTo(material) } -> std::same_as<Model>;  // fills the parameters that the caller left unset
    {
        model.rest(x, area)
        }
        -> std::same_as<typename Model::Rest>;  // x: rest positions; area: rest area of the triangles at the site [m^2]
    { model.evaluate(x, rest, HessianKind::Exact) } -> std::same_as<StencilEval<Model::kVertices>>;
};

/// A model with velocity-dependent damping of its own (Baraff & Witkin's condition damping): force -damping(x) v.
template <class Model>
concept DampedStencilModel = StencilModel<Model> &&
    requires(const Model model, const Stencil<Model::kVertices> x, const typename Model::Rest rest) {
    { model.isDamped() } -> std::same_as<bool>;
    /// [N s/m], symmetric positive semi-definite, zero on rigid motions
    { model.damping(x, rest) } -> std::same_as<Eigen::Matrix<double, 3 * Model::kVertices, 3 * Model::kVertices>>;
};

/// Where a sheet stops springing back.
struct YieldRule {
    double curvature;  ///< e_y [1/m]
    double tension;    ///< sigma_y t [N/m]
    double hardening;  ///< H / E: how much both grow with accumulated plastic strain, relative to the elastic slope [-]
    double stiffening;  ///< H t [N/m]
};

/// What has just been returned to the limit does not yield again.
inline constexpr double kYieldRounding = 1e-12;

/// A model whose rest data can yield. `flow` returns false and changes nothing within the elastic limit; else it moves
/// `rest` so that the strain is back on the limit, and adds the plastic strain to `accumulated`. `area` as for rest().
template <class Model>
concept PlasticStencilModel = StencilModel<Model> &&
    requires(const Model model, const Stencil<Model::kVertices> x, double area, const YieldRule rule,
             typename Model::Rest rest, double accumulated) {
    { model.flow(x, area, rule, rest, accumulated) } -> std::same_as<bool>;
};

/// The matrix  m (x) I3  of a scalar stencil matrix m.
template <int N>
Eigen::Matrix<double, 3 * N, 3 * N> timesIdentity3(const Eigen::Matrix<double, N, N>& m) {
    Eigen::Matrix<double, 3 * N, 3 * N> result = Eigen::Matrix<double, 3 * N, 3 * N>::Zero();
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j)
            for (int k = 0; k < 3; ++k) result(3 * i + k, 3 * j + k) = m(i, j);
    return result;
}

}  // namespace jacket
