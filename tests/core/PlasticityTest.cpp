#include <gtest/gtest.h>

#include "jacket/Shell.h"
#include "support/SheetMeshes.h"

namespace jacket {
namespace {

constexpr double kYield = 0.02;  // e_0 [1/m]

/// Two triangles on a unit square's diagonal: hinge length 1 (edge along x), areas 1/2 each.
struct Hinge {
    Stencil<4> flat;
    double area = 1.0;
    Hinge() { flat << 0, 1, 0.5, 0.5, 0, 0, 1, -1, 0, 0, 0, 0; }
    /// Folded so that l / (A0 + A1) theta = curvature.
    Stencil<4> bent(double curvature) const {
        Stencil<4> x = flat;
        const double angle = curvature * area;
        x.col(3) = Eigen::AngleAxisd(angle, Vec3::UnitX()) * Vec3(flat.col(3));
        if (std::abs(DihedralBending::angle(x) - angle) > 1e-9)  // the sign that theta has
            x.col(3) = Eigen::AngleAxisd(-angle, Vec3::UnitX()) * Vec3(flat.col(3));
        return x;
    }
};

/// Loaded to km, released, reversed to -km: closed forms of tests/data/plastic_hinge.csv.
struct Cycle {
    double e0, hardening, km, kp, reversed;
};
class PlasticHinge : public testing::TestWithParam<Cycle> {};
INSTANTIATE_TEST_SUITE_P(Table, PlasticHinge,
                         testing::Values(Cycle{0.02, 0, 0.1, 0.08, -0.08}, Cycle{0.02, 0.25, 0.1, 0.064, -0.0384},
                                         Cycle{0.05, 1.0, 0.3, 0.125, 0.0}, Cycle{0.1, 0, 0.11, 0.01, -0.01},
                                         Cycle{0.1, 0.5, 1.0, 0.6, -0.2}));

template <class Model>
void runCycle(const Cycle& c) {
    const Hinge hinge;
    const Model model{.stiffness = 3.0};
    auto rest = model.rest(hinge.flat, hinge.area);
    const YieldRule rule{c.e0, 0.0, c.hardening, 0.0};
    double accumulated = 0.0;
    const auto kept = [&] {
        if constexpr (requires { rest.dihedral; })
            return rest.dihedral.angle / hinge.area;
        else
            return rest.angle / hinge.area;
    };
    EXPECT_FALSE(model.flow(hinge.bent(0.99 * c.e0), hinge.area, rule, rest, accumulated));
    EXPECT_TRUE(model.flow(hinge.bent(c.km), hinge.area, rule, rest, accumulated));
    EXPECT_NEAR(kept(), c.kp, 1e-9);
    EXPECT_NEAR(accumulated, c.kp, 1e-9);
    EXPECT_FALSE(model.flow(hinge.bent(c.km), hinge.area, rule, rest, accumulated));
    EXPECT_FALSE(model.flow(hinge.bent(c.kp), hinge.area, rule, rest, accumulated));  // released: elastic
    model.flow(hinge.bent(-c.km), hinge.area, rule, rest, accumulated);
    EXPECT_NEAR(kept(), c.reversed, 1e-9);
    // the new rest shape stores nothing and pulls nowhere
    const auto at = model.evaluate(hinge.bent(kept()), rest, HessianKind::Exact);
    EXPECT_LT(at.energy, 1e-16);
    EXPECT_LT(at.gradient.cwiseAbs().maxCoeff(), 1e-9);
}

TEST_P(PlasticHinge, DihedralFollowsTheClosedForm) {
    runCycle<DihedralBending>(GetParam());
}
TEST_P(PlasticHinge, CubicFollowsTheClosedForm) {
    runCycle<CubicShellBending>(GetParam());
}

TEST(PlasticStretching, UniaxialTensionReturnsToTheYieldStress) {
    // Pulled to a strain far beyond yield with free sides: the tension along is sigma_y t + H t a, none across; the
    // rest shape's area shrinks in depth only: plastic flow keeps the volume, so its width contracts by half.
    const double k = 1e4, nu = 0.3;  // E t [N/m]
    const YieldRule rule{0.0, 20.0, 0.1, 0.1 * k};
    const StVenantKirchhoffMembrane model{.stretchStiffness = k, .poisson = nu};
    Stencil<3> X;
    X << 0, 1, 0, 0, 0, 1, 0, 0, 0;
    auto rest = model.rest(X, 0.5);
    double accumulated = 0.0, width = 1.0;
    const double length = 1.05;
    const auto pulled = [&](double l, double w) {
        Stencil<3> x = X;
        x(0, 1) = l;
        x(1, 2) = w;
        return x;
    };
    constexpr int kSteps = 2000;  // the flow leaves the path of uniaxial tension by first order in the step
    for (int i = 1; i <= kSteps; ++i) {
        const double l = 1.0 + (length - 1.0) * i / kSteps;
        double low = 0.9, high = 1.1;  // the width at which nothing pulls across
        for (int halving = 0; halving < 60; ++halving) {
            width = 0.5 * (low + high);
            auto trial = rest;
            double ignored = accumulated;
            model.flow(pulled(l, width), 0.5, rule, trial, ignored);
            const bool tight = model.evaluate(pulled(l, width), trial, HessianKind::Exact).gradient(1, 2) > 0.0;
            (tight ? high : low) = width;
        }
        model.flow(pulled(l, width), 0.5, rule, rest, accumulated);
    }
    const Mat2 S = model.predictedStress(pulled(length, width), Stencil<3>::Zero(), rest) / 0.5;
    // The stress measure refers to the elastic rest frame, whose axes here are those of the sheet.
    EXPECT_NEAR(S(0, 0), 20.0 + 0.1 * k * accumulated, 1e-6);
    EXPECT_NEAR(S(1, 1), 0.0, 1e-6);
    EXPECT_NEAR(accumulated, std::log(length) - 0.5 * std::log1p(2.0 * S(0, 0) / k), 1e-4);
    EXPECT_NEAR(std::log(width), -0.5 * accumulated + 0.5 * std::log1p(-2.0 * nu * S(0, 0) / k), 1e-4);
}

TEST(PlasticStretching, WithinTheLimitNothingChanges) {
    const StVenantKirchhoffMembrane model{.stretchStiffness = 1e4, .poisson = 0.3};
    Stencil<3> X;
    X << 0, 1, 0, 0, 0, 1, 0, 0, 0;
    auto rest = model.rest(X, 0.5);
    double accumulated = 0.0;
    EXPECT_FALSE(model.flow(1.001 * X, 0.5, {0.0, 20.0, 0.0, 0.0}, rest, accumulated));
    EXPECT_EQ(accumulated, 0.0);
}

TEST(PlasticShell, ADentIsReportedWithPlaceAndWorkAndEntersTheLedger) {
    const TriangleMesh mesh = test::sheet(test::MeshKind::OneDiagonal, 1.0, 0.5, 20, 10);
    ShellMaterial material{.young = 7e10, .poisson = 0.3, .thickness = 1e-3, .density = 2700};
    material.yieldStress = 1e8;
    Shell shell(mesh, material, {.plasticity = true});
    Points bent = mesh.positions;
    for (int i = 0; i < bent.cols(); ++i) bent(2, i) = 2.0 * std::pow(std::max(0.0, bent(0, i)), 2);  // folds x > 0
    shell.setPositions(bent);
    const double before = shell.energy().bending + shell.energy().membrane;
    shell.advance(1e-9);
    const ShellEnergy after = shell.energy();
    EXPECT_GT(shell.lastDent().elements, 0);
    EXPECT_GT(shell.lastDent().position.x(), -0.1);
    EXPECT_GT(after.plasticWork, 0.0);
    EXPECT_NEAR(after.plasticWork, shell.lastDent().work, 1e-12 * after.plasticWork);
    EXPECT_NEAR(after.bending + after.membrane + after.plasticWork, before, 1e-9 * before);
    shell.advance(1e-9);
    EXPECT_EQ(shell.lastDent().elements, 0);
}

TEST(PlasticShell, OffByDefault) {
    const TriangleMesh mesh = test::sheet(test::MeshKind::OneDiagonal, 1.0, 0.5, 20, 10);
    ShellMaterial material{.young = 7e10, .poisson = 0.3, .thickness = 1e-3, .density = 2700};
    material.yieldStress = 1e6;
    Shell shell(mesh, material);
    Points bent = mesh.positions;
    for (int i = 0; i < bent.cols(); ++i) bent(2, i) = bent(0, i) * bent(0, i);
    shell.setPositions(bent);
    shell.advance(1e-9);
    EXPECT_EQ(shell.energy().plasticWork, 0.0);
}

}  // namespace
}  // namespace jacket
