#include <gtest/gtest.h>

#include "jacket/Shell.h"
#include "jacket/Statics.h"
#include "support/SheetMeshes.h"

namespace jacket {
namespace {

using test::MeshKind;
using test::sheet;
using test::verticesWhere;

const ShellMaterial kPlate{.young = 1e7, .poisson = 0.3, .thickness = 1e-3, .density = 1000.0};

TEST(Regions, HaveTheirOwnMassAndStiffness) {
    const TriangleMesh mesh = sheet(MeshKind::OneDiagonal, 1.0, 0.5, 10, 4);
    ShellMaterial heavy = kPlate;
    heavy.density = 3000.0;
    heavy.young = 4e7;
    std::vector<int> region;
    for (int t = 0; t < mesh.triangles.cols(); ++t) {
        const auto c = mesh.triangles.col(t);
        region.push_back(mesh.positions(0, c[0]) + mesh.positions(0, c[1]) + mesh.positions(0, c[2]) > 0.0 ? 1 : 0);
    }
    for (const BendingModel& bending : {BendingModel(PatchBending{}), BendingModel(DihedralBending{})}) {
        const Shell light(mesh, kPlate, {.bending = bending});
        Shell both(mesh, {kPlate, heavy}, region, {.bending = bending});
        EXPECT_NEAR(both.masses().sum(), 2.0 * light.masses().sum(), 1e-12);
        // the same stretch everywhere: half the sheet stores four times as much
        const Points stretched = 1.001 * mesh.positions;
        EXPECT_NEAR(both.elasticEnergy(stretched), 2.5 * light.elasticEnergy(stretched),
                    1e-6 * light.elasticEnergy(stretched));
    }
    EXPECT_THROW(Shell(mesh, {kPlate, heavy}, {0, 1}, {}), std::invalid_argument);
    region[0] = 2;
    EXPECT_THROW(Shell(mesh, {kPlate, heavy}, region, {}), std::invalid_argument);
    EXPECT_THROW(Shell(mesh, std::vector<ShellMaterial>{}, {}, {}), std::invalid_argument);
}

TEST(RestShape, FlattenedForgetsItsCurvatureAndNotItsLengths) {
    const TriangleMesh mesh = makeCylinder(0.5, 0.4, 40, 8);
    for (const BendingModel& bending : {BendingModel(PatchBending{}), BendingModel(DihedralBending{})}) {
        Shell shell(mesh, kPlate, {.bending = bending});
        EXPECT_LT(shell.energy().bending, 1e-15);
        shell.flattenRest();
        // rolled from flat to curvature 2 /m: D / 2 k^2 per area
        const double expected = 0.5 * kPlate.bendingStiffness() * 4.0 * 2.0 * std::numbers::pi * 0.5 * 0.4;
        EXPECT_NEAR(shell.energy().bending, expected, 0.06 * expected);
        EXPECT_LT(shell.energy().membrane, 1e-12);
    }
}

TEST(RestShape, CanBeReplaced) {
    const TriangleMesh mesh = sheet(MeshKind::Alternating, 1.0, 0.5, 10, 5);
    Shell shell(mesh, kPlate);
    shell.setRestPositions(1.1 * mesh.positions);  // 10 % larger: what it stands in now is compressed
    EXPECT_GT(shell.energy().membrane, 0.0);
    EXPECT_EQ(shell.maxStretch(), 0.0);
    EXPECT_THROW(shell.setRestPositions(Points::Zero(3, 4)), std::invalid_argument);
    EXPECT_THROW(shell.setRestPositions(Points::Zero(3, mesh.positions.cols())), std::invalid_argument);
    shell.setRestPositions(mesh.positions);
    EXPECT_LT(shell.energy().membrane, 1e-20);
}

TEST(Guides, LetAVertexSlideAcrossAndHoldItAlong) {
    Shell shell(sheet(MeshKind::OneDiagonal, 1.0, 1.0, 2, 2), kPlate);
    for (int i = 0; i < shell.vertexCount(); ++i) shell.guide(i, Vec3::UnitX());
    const Points start = shell.positions();
    for (int k = 0; k < 10; ++k) shell.step(0.01, Vec3(9.81, -9.81, 0));
    EXPECT_LT((shell.positions().row(0) - start.row(0)).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((shell.positions().row(1) - start.row(1)).maxCoeff(), -0.04);
    shell.unpin(4);
    EXPECT_TRUE(shell.freedom(4).isIdentity());
    shell.guide(4, Vec3::UnitX());
    shell.guide(4, Vec3(1, 1, 0));
    EXPECT_NEAR(shell.freedom(4).trace(), 1.0, 1e-12);
    EXPECT_THROW(shell.guide(4, Vec3::Zero()), std::invalid_argument);
    EXPECT_THROW(shell.guide(99, Vec3::UnitX()), std::out_of_range);
}

TEST(Clamps, AnswerWhatTheyCannotHold) {
    Shell shell(makeCylinder(0.5, 0.4, 24, 6), kPlate);
    EXPECT_THROW(shell.clamp({3}), std::invalid_argument);      // no edge
    EXPECT_THROW(shell.clamp({0, 12}), std::invalid_argument);  // no edge between them
    EXPECT_THROW(shell.clamp({0, 999}), std::out_of_range);
    EXPECT_THROW(shell.clamp({0, 1}, Vec3::Zero()), std::invalid_argument);
    std::vector<int> rim(24);
    for (int i = 0; i < 24; ++i) rim[i] = i;
    shell.clamp(rim);  // a circle, which the tube leaves along its axis
    EXPECT_EQ(shell.pinCount(), 24);
    Shell bowl(makeHemisphere(0.3, 5), kPlate);
    std::vector<int> ring;
    for (int i = 0; i < bowl.vertexCount(); ++i)
        if (bowl.restPositions()(1, i) < 0.1) ring.push_back(i);
    EXPECT_NO_THROW(bowl.clamp(ring));
}

TEST(Clamps, HoldASteepTangentGivenByTheCaller) {
    // A strip that must leave its clamp at 60 degrees upwards, weightless: it turns there as a whole.
    const TriangleMesh mesh = sheet(MeshKind::Alternating, 1.0, 0.25, 20, 5);
    Shell shell(mesh, kPlate);
    const double angle = std::numbers::pi / 3.0;
    shell.clamp(verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() < -0.5 + 1e-9; }),
                Vec3(std::cos(angle), 0, std::sin(angle)));
    ASSERT_TRUE(settle(shell, Vec3::Zero()).converged);
    EXPECT_NEAR(shell.positions()(2, 20), std::sin(angle), 1e-3);
    EXPECT_NEAR(shell.positions()(0, 20) + 0.5, std::cos(angle), 1e-3);
}

TEST(Pressure, SettlesAClosedSurfaceWithItsStiffnessInTheHessian) {
    // The whole sphere's force is zero, so the pole rises by half of what the poles of a sphere move apart.
    const TriangleMesh half = makeHemisphere(0.5, 12);
    ShellMaterial rubber = kPlate;
    Shell shell(half, rubber);
    for (int i = 0; i < shell.vertexCount(); ++i)
        if (half.positions(1, i) < 1e-9) shell.guide(i, Vec3::UnitY());
    shell.guide(0, Vec3::UnitX());
    shell.guide(0, Vec3::UnitZ());
    shell.guide(1, Vec3(-half.positions(2, 1), 0, half.positions(0, 1)));
    constexpr double kPressure = 10.0;
    shell.setPressure(kPressure);
    const StaticReport report = settle(shell, Vec3::Zero());
    ASSERT_TRUE(report.converged);
    EXPECT_LT(report.iterations, 20);
    const double expected = kPressure * 0.25 * (1.0 - 0.3) / (2.0 * 1e4);  // p R^2 (1 - nu) / (2 E t)
    EXPECT_NEAR(shell.positions()(1, 0) - 0.5, expected, 0.05 * expected);
}

}  // namespace
}  // namespace jacket
