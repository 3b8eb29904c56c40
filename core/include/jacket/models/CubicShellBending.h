#pragma once
#include <cmath>
#include <optional>

#include "jacket/models/DihedralBending.h"
#include "jacket/models/QuadraticBending.h"
#include "jacket/models/StencilModel.h"
#include "jacket/models/StencilTools.h"

namespace jacket {

/// Bending of one interior edge, flat or curved at rest, for shells that hardly stretch: a cubic polynomial in x.
///
///         x2          E = D L^2 / (A0 + A1) (1 - cos(theta - theta0))   when no edge is stretched   [J]
///        /  \         with  2 (1 - cos theta) L^2 = |l|^2,  l = sum_i c_i x_i as in QuadraticBending
///      x0 -- x1       and   sin theta = -L (e0 x e1) . e2 / (4 A0 A1),  e0 = x1-x0, e1 = x2-x0, e2 = x3-x0,
///        \  /         theta as in DihedralBending; L, Ai and c_i always those at rest
///         x3
///     E(x) = cos(theta0) D/(2 (A0 + A1)) |l|^2 + sin(theta0) D L^3/(4 A0 A1 (A0 + A1)) (e0 x e1).e2
///            + 1/2 sum_edges q_e (|x_e|^2 - |X_e|^2) + constant
///
/// The paper's polynomial, without the sum over the five edges, pushes in the triangles' planes at rest when theta0 is
/// not zero. The sum vanishes where nothing is stretched; its q_e [N/m], about D theta0^2 / L^2, are such that
/// the rest shape is free of forces.
///
/// Folds:   where cos(theta0) < 0 the quadratic part is not convex: such a hinge uses DihedralBending.
/// Hessian: Positive is, for a flat rest shape, the exact constant D / (A0 + A1) c c^T times I3; for a curved one the
///          Gauss-Newton part of the angle, D L^2 / (A0 + A1) dtheta/dx dtheta/dx^T, exact against bending at rest. The
///          polynomial's own constant part would not do there: alone, without the cubic part, it answers a rigid
///          rotation with a moment, and an implicit step would stop a curved shell's spinning.
/// Error:   as QuadraticBending on a cylinder. A stretch s multiplies the energy's terms by s^2 and s^3.
/// Source:  Garg et al., Cubic Shells, SCA 2007; rescaled to the plate; the rest-force correction is ours.
struct CubicShellBending {
    std::optional<double> stiffness{};  ///< D [N m], >= 0; unset: the material's

    static constexpr std::string_view kName = "cubic";
    static constexpr StencilSite kSite = StencilSite::Hinge;
    static constexpr int kVertices = 4;

    struct Rest {
        bool flat;                         ///< |theta0| < 1e-6
        bool folded;                       ///< cos(theta0) < 0: `dihedral` alone counts
        DihedralBending::Rest dihedral;    ///< theta0 and what DihedralBending needs
        QuadraticBending::Rest quadratic;  ///< c [-] and D / (A0 + A1) [N/m]
        Eigen::Matrix4d matrix;            ///< quadratic part, times I3 [N/m]; its rows sum to zero
        double volume;                     ///< factor of (e0 x e1).e2 [N/m^2]
        double constant;                   ///< makes the energy at rest zero [J]
        Stencil<4> shape;                  ///< at rest [m]
    };

    CubicShellBending fittedTo(const ShellMaterial& material) const {
        return {stiffnessOr(stiffness, material.bendingStiffness(), "CubicShellBending.stiffness [N m]")};
    }

    template <class = void>
    Rest rest(const Stencil<4>& X, double area) const {
        requireHinge(X, "CubicShellBending");
        Rest r;
        r.shape = X;
        r.dihedral = DihedralBending{stiffness}.rest(X, area);
        r.quadratic = QuadraticBending{stiffness}.rest(X, area);
        const double cosine = std::cos(r.dihedral.angle), sine = std::sin(r.dihedral.angle);
        r.flat = std::abs(r.dihedral.angle) < 1e-6;
        r.folded = cosine < 0.0;
        const Stencil<3> e = X.rightCols<3>().colwise() - X.col(0);
        const double fourAreas = e.col(0).cross(e.col(1)).norm() * e.col(2).cross(e.col(0)).norm();  // 4 A0 A1
        r.matrix = cosine * r.quadratic.weight * r.quadratic.cotangents * r.quadratic.cotangents.transpose();
        r.volume = sine * r.dihedral.weight * r.dihedral.length / fourAreas;

        // The gradient at rest has no part along the bending, so five forces along the edges balance it.
        const Stencil<4> g = gradientOf(e, r);
        const auto alongEdges = [](const Vec3& p, const Vec3& q, const Vec3& f) -> Vec2 {  // (a, b): a p + b q = f
            Mat2 m;
            m << p.dot(p), p.dot(q), p.dot(q), q.dot(q);
            const Vec2 rhs(p.dot(f), q.dot(f));
            return Vec2(m(1, 1) * rhs(0) - m(0, 1) * rhs(1), m(0, 0) * rhs(1) - m(0, 1) * rhs(0)) /
                   (m(0, 0) * m(1, 1) - m(0, 1) * m(0, 1));
        };
        const Vec2 q2 = alongEdges(e.col(1), e.col(1) - e.col(0), -g.col(2));  // edges x0 x2 and x1 x2
        const Vec2 q3 = alongEdges(e.col(2), e.col(2) - e.col(0), -g.col(3));  // edges x0 x3 and x1 x3
        const Vec3 left = g.col(1) - q2(1) * (e.col(1) - e.col(0)) - q3(1) * (e.col(2) - e.col(0));
        const double q01 = -left.dot(e.col(0)) / e.col(0).squaredNorm();
        const auto addEdge = [&](int i, int j, double q) {
            r.matrix(i, i) += q;
            r.matrix(j, j) += q;
            r.matrix(i, j) -= q;
            r.matrix(j, i) -= q;
        };
        addEdge(0, 1, q01);
        addEdge(0, 2, q2(0));
        addEdge(1, 2, q2(1));
        addEdge(0, 3, q3(0));
        addEdge(1, 3, q3(1));
        r.constant = 0.0;
        r.constant = -energyOf(e, r);
        return r;
    }

    template <class = void>
    StencilEval<4> evaluate(const Stencil<4>& x, const Rest& r, HessianKind kind) const {
        if (r.folded) return DihedralBending{stiffness}.evaluate(x, r.dihedral, kind);
        const Stencil<3> e = x.rightCols<3>().colwise() - x.col(0);
        StencilEval<4> result;
        result.energy = energyOf(e, r);
        result.gradient = gradientOf(e, r);
        if (kind == HessianKind::Positive) {
            const Vec4& c = r.quadratic.cotangents;
            if (r.flat)
                result.hessian = timesIdentity3<4>((r.quadratic.weight * c) * c.transpose());
            else
                DihedralBending::setOuterProduct(result.hessian, r.dihedral.weight,
                                                 DihedralBending::Shape(x, r.dihedral.length).slope());
            return result;
        }
        result.hessian = timesIdentity3<4>(r.matrix);
        const Mat3 E0 = r.volume * skew(e.col(0)), E1 = r.volume * skew(e.col(1)), E2 = r.volume * skew(e.col(2));
        const auto add = [&](int i, int j, const Mat3& m) {
            result.hessian.block<3, 3>(3 * i, 3 * j) += m;
            result.hessian.block<3, 3>(3 * j, 3 * i) += m.transpose();
        };
        // (e0 x e1).e2 by e0 and e1: -skew(e2); by e1 and e2: -skew(e0); by e2 and e0: -skew(e1). Rows sum to zero.
        add(1, 2, -E2);
        add(2, 3, -E0);
        add(3, 1, -E1);
        add(0, 1, -E2 + E1);
        add(0, 2, E2 - E0);
        add(0, 3, E0 - E1);
        return result;
    }

    template <class = void>
    double energy(const Stencil<4>& x, const Rest& r) const {
        if (r.folded) return DihedralBending{stiffness}.energy(x, r.dihedral);
        return energyOf(x.rightCols<3>().colwise() - x.col(0), r);
    }

    /// As DihedralBending; the polynomial is set up again for the hinge folded to its new angle.
    template <class = void>
    bool flow(const Stencil<4>& x, double area, const YieldRule& rule, Rest& r, double& accumulated) const {
        DihedralBending::Rest dihedral = r.dihedral;
        if (!DihedralBending{stiffness}.flow(x, area, rule, dihedral, accumulated)) return false;
        Stencil<4> folded = r.shape;
        const Vec3 axis = (folded.col(1) - folded.col(0)).normalized();
        // theta grows as x3 turns against its normal's side
        folded.col(3) = folded.col(0) +
                        Eigen::AngleAxisd(dihedral.angle - r.dihedral.angle, axis) * (r.shape.col(3) - r.shape.col(0));
        r = rest(folded, area);
        r.dihedral.angle = dihedral.angle;
        return true;
    }

  private:
    template <class = void>
    static double energyOf(const Stencil<3>& e, const Rest& r) {
        return 0.5 * (e * r.matrix.bottomRightCorner<3, 3>()).cwiseProduct(e).sum() +
               r.volume * e.col(0).cross(e.col(1)).dot(e.col(2)) + r.constant;
    }

    template <class = void>
    static Stencil<4> gradientOf(const Stencil<3>& e, const Rest& r) {
        Stencil<4> g;
        g.rightCols<3>() = e * r.matrix.bottomRightCorner<3, 3>();
        g.col(1) += r.volume * e.col(1).cross(e.col(2));
        g.col(2) += r.volume * e.col(2).cross(e.col(0));
        g.col(3) += r.volume * e.col(0).cross(e.col(1));
        g.col(0) = -(g.col(1) + g.col(2) + g.col(3));
        return g;
    }
};
static_assert(StencilModel<CubicShellBending> && PlasticStencilModel<CubicShellBending>);

}  // namespace jacket
