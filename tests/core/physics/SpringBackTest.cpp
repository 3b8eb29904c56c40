#include <gtest/gtest.h>

#include "jacket/Statics.h"
#include "support/SheetMeshes.h"

namespace jacket {
namespace {

using test::MeshKind;
using test::sheet;
using test::verticesWhere;

constexpr double kLength = 0.3, kWidth = 0.06, kThickness = 1e-3;
constexpr double kYieldCurvature = 1.0, kHardening = 0.25, kDie = 5.0;  // e_0 [1/m], H / E, 1 / R of the die [1/m]

/// Curvature that stays when a strip is laid on a die in so many steps and let go: mean over its length [1/m].
double curvatureLeft(MeshKind kind, int steps, const BendingModel& bending) {
    const TriangleMesh mesh = sheet(kind, kLength, kWidth, 40, 8);
    ShellMaterial material{.young = 2e11, .poisson = 0.0, .thickness = kThickness, .density = 7850.0};
    material.yieldStress = 0.5 * kYieldCurvature * material.young * kThickness;  // e_y = 2 sigma_y / (E t)
    material.hardening = kHardening * material.young;
    Shell shell(mesh, material, {.bending = bending, .plasticity = true});
    for (int step = 1; step <= steps; ++step) {
        const double k = kDie * step / steps;
        Points x = mesh.positions;
        for (int i = 0; i < x.cols(); ++i) {
            const double s = mesh.positions(0, i) + 0.5 * kLength;
            x(0, i) = std::sin(k * s) / k - 0.5 * kLength;
            x(2, i) = (1.0 - std::cos(k * s)) / k;
        }
        shell.setPositions(x);
        shell.advance(1e-12);  // yields
    }
    for (const int i : verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() < -0.5 * kLength + 1e-9; }))
        shell.pin(i);
    // Held at one end and free to turn about it; a third support keeps it from turning as a whole.
    const std::vector<int> tip =
        verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() > 0.5 * kLength - 1e-9; });
    for (const int i : tip) shell.guide(i, Vec3::UnitZ());
    const StaticReport report = settle(shell, Vec3::Zero());
    EXPECT_TRUE(report.converged);
    // The strip is an arc of its length over the chord between the ends: chord = 2 / k sin(k L / 2).
    Vec3 a = Vec3::Zero(), b = Vec3::Zero();
    int count = 0;
    for (int i = 0; i < mesh.positions.cols(); ++i)
        if (mesh.positions(0, i) < -0.5 * kLength + 1e-9) a += shell.positions().col(i), ++count;
    a /= count;
    for (const int i : tip) b += shell.positions().col(i) / static_cast<double>(tip.size());
    const double chord = (b - a).norm();
    double low = 1e-3, high = 2.0 * std::numbers::pi / kLength;
    for (int halving = 0; halving < 60; ++halving) {
        const double k = 0.5 * (low + high);
        (2.0 / k * std::sin(0.5 * k * kLength) > chord ? low : high) = k;
    }
    return low;
}

constexpr double kLeft = (kDie - kYieldCurvature) / (1.0 + kHardening);  // closed form: tests/data/plastic_hinge.csv

class SpringBack : public testing::TestWithParam<MeshKind> {};
INSTANTIATE_TEST_SUITE_P(Meshes, SpringBack, testing::ValuesIn(test::kMeshKinds), [](const auto& parameter) {
    std::string name = test::nameOf(parameter.param);
    std::erase(name, '-');
    return name;
});

TEST_P(SpringBack, APatchStripKeepsWhatTheClosedFormSaysInAnyNumberOfSteps) {
    double least = 1e9, most = 0.0;
    for (const int steps : {1, 4, 16}) {
        const double left = curvatureLeft(GetParam(), steps, PatchBending{});
        EXPECT_NEAR(left / kLeft, 1.0, 0.01) << steps << " steps";
        least = std::min(least, left);
        most = std::max(most, left);
    }
    EXPECT_LT(most / least - 1.0, 0.01);
}

TEST(SpringBackOfHinges, IsRightAlongTheAxesOfAGrid) {
    EXPECT_NEAR(curvatureLeft(MeshKind::OneDiagonal, 4, DihedralBending{}) / kLeft, 1.0, 0.02);
    EXPECT_NEAR(curvatureLeft(MeshKind::OneDiagonal, 4, CubicShellBending{}) / kLeft, 1.0, 0.02);
}

}  // namespace
}  // namespace jacket
