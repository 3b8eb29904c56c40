#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include <random>

#include "ShellAssembly.h"
#include "energy/PatchEnergy.h"
#include "jacket/Shell.h"
#include "jacket/Statics.h"
#include "support/SheetMeshes.h"

namespace jacket {
namespace {

using test::kMeshKinds;
using test::MeshKind;
using test::nameOf;
using test::sheet;
using test::verticesWhere;

constexpr double kStiffness = 2.0, kPoisson = 0.3;
const PatchEnergy::Plate kPlate{kStiffness, kPoisson, std::numeric_limits<double>::infinity(), 0.0};

/// A surface over a flat sheet: points (x, y, height).
Points lifted(const Points& flat, const auto& height) {
    Points x = flat;
    for (int i = 0; i < x.cols(); ++i) x(2, i) = height(flat(0, i), flat(1, i));
    return x;
}

Points noisy(const Points& x, double size, unsigned seed) {
    std::mt19937 generator(seed);
    std::uniform_real_distribution<double> shift(-size, size);
    Points result = x;
    for (int i = 0; i < x.cols(); ++i)
        for (int k = 0; k < 3; ++k) result(k, i) += shift(generator);
    return result;
}

Points rotated(const Points& x) {
    const Mat3 turn = (Eigen::AngleAxisd(2.1, Vec3(1, -2, 0.5).normalized())).toRotationMatrix();
    return (turn * x).colwise() + Vec3(3, -1, 2);
}

/// A small mesh with an energy on it; `rest` may be curved, `mirrors` clamped.
struct Sheet {
    TriangleMesh mesh;
    HalfEdgeMesh connectivity;
    PatchEnergy energy;
    StepSystem system;

    Sheet(TriangleMesh m, std::vector<MirrorPlane> mirrors = {}, bool yields = false)
        : mesh(std::move(m)),
          connectivity(mesh.triangles, static_cast<int>(mesh.positions.cols())),
          energy(connectivity, {.positions = mesh.positions, .mirrors = std::move(mirrors)},
                 std::vector<PatchEnergy::Plate>(
                     mesh.triangles.cols(), yields ? PatchEnergy::Plate{kStiffness, kPoisson, 0.05, 0.1} : kPlate)) {
        std::vector<std::pair<int, int>> pairs;
        energy.collectPairs(pairs);
        system.matrix.setPattern(connectivity.vertexCount(), std::move(pairs));
        energy.bind(system.matrix);
    }

    Points gradient(const Points& x) const {
        Points g = Points::Zero(3, x.cols());
        energy.addGradient(x, g);
        return g;
    }
    /// What addTo makes of matrix and right side, and the constant Hessian: dense.
    Eigen::MatrixXd hessian(const Points& x, HessianKind kind) {
        system.begin(1.0, 0.0);
        energy.addTo(system, x, kind);
        const auto n = x.cols();
        Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(3 * n, 3 * n);
        const BlockMatrix& m = system.matrix;
        for (int i = 0; i < n; ++i) {
            dense.block<3, 3>(3 * i, 3 * i) += m.diagonal()[i];
            for (int k = m.rowBegin(i); k < m.rowEnd(i); ++k) {
                dense.block<3, 3>(3 * i, 3 * m.column(k)) += m.lower()[k];
                dense.block<3, 3>(3 * m.column(k), 3 * i) += m.lower()[k].transpose();
            }
        }
        const auto add = [&](const auto& scalars) {
            for (int i = 0; i < n; ++i)
                for (int k = scalars.start[i]; k < scalars.start[i + 1]; ++k)
                    dense.block<3, 3>(3 * i, 3 * scalars.column[k]).diagonal().array() += scalars.value[k];
        };
        energy.constantHessian()->visit([&](const auto& inside, const auto& beside) {
            add(inside);
            add(beside);
        });
        return dense;
    }
};

TriangleMesh curvedSheet(MeshKind kind) {
    TriangleMesh mesh = sheet(kind, 1.0, 0.8, 6, 5);
    mesh.positions =
        lifted(mesh.positions, [](double x, double y) { return 0.3 * x * x - 0.2 * x * y + 0.25 * y * y; });
    return mesh;
}

MirrorPlane leftEdge(const TriangleMesh& mesh) {
    MirrorPlane plane{.vertices = verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() < -0.5 + 1e-9; }),
                      .restPoint = Vec3(-0.5, 0, 0),
                      .restNormal = Vec3::UnitX(),
                      .point = Vec3(-0.5, 0, 0),
                      .normal = Vec3(0.9, 0.1, 0.4).normalized()};
    return plane;
}

class PatchBendingOn : public testing::TestWithParam<MeshKind> {};
INSTANTIATE_TEST_SUITE_P(Meshes, PatchBendingOn, testing::ValuesIn(kMeshKinds), [](const auto& parameter) {
    std::string name = nameOf(parameter.param);
    std::erase(name, '-');
    return name;
});

TEST_P(PatchBendingOn, AffineMapsOfAFlatSheetStoreNothing) {
    const Sheet s(sheet(GetParam(), 1.0, 0.8, 10, 8));
    Mat3 any;
    any << 1.3, 0.2, 0.0, -0.4, 0.9, 0.1, 0.3, -0.6, 1.0;
    const Points x = (any * s.mesh.positions).colwise() + Vec3(1, 2, 3);
    EXPECT_LT(s.energy.value(x), 1e-22);
    EXPECT_LT(s.gradient(x).cwiseAbs().maxCoeff(), 1e-10);
}

TEST_P(PatchBendingOn, AQuadraticHeightHasItsCurvatureInEveryTriangle) {
    const Sheet s(sheet(GetParam(), 1.0, 0.8, 10, 8), {}, /*yields=*/true);  // keeps every triangle's patch
    const Sheet elastic(sheet(GetParam(), 1.0, 0.8, 10, 8));
    constexpr double kSmall = 1e-4;                                      // slopes whose squares are rounding
    const double a = 1.0 * kSmall, b = -0.7 * kSmall, c = 0.4 * kSmall;  // w_xx, w_yy, w_xy
    const Points x =
        lifted(s.mesh.positions, [&](double u, double v) { return 0.5 * a * u * u + 0.5 * b * v * v + c * u * v; });
    for (int t = 0; t < s.connectivity.triangleCount(); ++t) {
        const Vec3 k = s.energy.bendingStrain(t, x);
        // invariants, as every triangle has a frame of its own
        EXPECT_NEAR(k[0] + k[1], a + b, 1e-6 * kSmall);
        EXPECT_NEAR(k[0] * k[1] - k[2] * k[2], a * b - c * c, 1e-6 * kSmall * kSmall);
    }
    const double density =
        0.5 * kStiffness * ((1 - kPoisson) * (a * a + b * b + 2 * c * c) + kPoisson * (a + b) * (a + b));
    EXPECT_NEAR(s.energy.value(x), density * 0.8, 1e-9 * density);
    EXPECT_NEAR(elastic.energy.value(x), density * 0.8, 1e-9 * density);
    const Points far = rotated(x).colwise() + Vec3(1e3, 2e3, -1e3);
    EXPECT_NEAR(elastic.energy.value(far), s.energy.value(far), 1e-9 * density + 1e-4 * s.energy.value(far));
}

TEST_P(PatchBendingOn, ACurvedSheetIsAtRestAtRestAndWhereItIsTurned) {
    const Sheet s(curvedSheet(GetParam()));
    for (const Points& x : {s.mesh.positions, rotated(s.mesh.positions)}) {
        EXPECT_LT(s.energy.value(x), 1e-20);
        EXPECT_LT(s.gradient(x).cwiseAbs().maxCoeff(), 1e-10);
    }
}

TEST_P(PatchBendingOn, ForcesDoNotPushOrTurnTheWhole) {
    const Sheet s(curvedSheet(GetParam()));
    const Points x = noisy(s.mesh.positions, 0.03, 5), g = s.gradient(x);
    Vec3 moment = Vec3::Zero();
    double largest = 0.0;
    for (int i = 0; i < x.cols(); ++i) {
        moment += x.col(i).cross(g.col(i));
        largest = std::max(largest, g.col(i).norm());
    }
    EXPECT_LT(g.rowwise().sum().norm(), 1e-10 * largest);
    EXPECT_LT(moment.norm(), 1e-10 * largest);
    EXPECT_NEAR(s.energy.value(rotated(x)), s.energy.value(x), 1e-10 * s.energy.value(x));
}

void expectDerivatives(Sheet& s, const Points& x, double tolerance) {
    constexpr double kShift = 1e-6;
    const Points g = s.gradient(x);
    const Eigen::MatrixXd exact = s.hessian(x, HessianKind::Exact);
    EXPECT_LT((s.system.rhs + g).cwiseAbs().maxCoeff(), 1e-9 * g.cwiseAbs().maxCoeff());  // addTo's own gradient
    double worstGradient = 0.0, worstHessian = 0.0;
    for (int i = 0; i < x.size(); ++i) {
        Points up = x, down = x;
        up.data()[i] += kShift;
        down.data()[i] -= kShift;
        worstGradient =
            std::max(worstGradient, std::abs((s.energy.value(up) - s.energy.value(down)) / (2 * kShift) - g.data()[i]));
        const Points column = (s.gradient(up) - s.gradient(down)) / (2 * kShift);
        worstHessian = std::max(worstHessian, (column.reshaped() - exact.col(i)).cwiseAbs().maxCoeff());
    }
    EXPECT_LT(worstGradient, tolerance * g.cwiseAbs().maxCoeff());
    EXPECT_LT(worstHessian, tolerance * exact.cwiseAbs().maxCoeff());
    EXPECT_LT((exact - exact.transpose()).cwiseAbs().maxCoeff(), 1e-12 * exact.cwiseAbs().maxCoeff());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> positive(s.hessian(x, HessianKind::Positive));
    EXPECT_GT(positive.eigenvalues()[0], -1e-11 * positive.eigenvalues().tail(1)[0]);
}

TEST_P(PatchBendingOn, DerivativesOfAFlatSheet) {
    Sheet s(sheet(GetParam(), 1.0, 0.8, 6, 5));
    expectDerivatives(s, noisy(s.mesh.positions, 0.03, 1), 2e-7);
}
TEST_P(PatchBendingOn, DerivativesOfACurvedSheet) {
    Sheet s(curvedSheet(GetParam()));
    expectDerivatives(s, noisy(rotated(s.mesh.positions), 0.03, 2), 2e-7);
}
TEST_P(PatchBendingOn, DerivativesOfAClampedSheet) {
    TriangleMesh mesh = sheet(GetParam(), 1.0, 0.8, 6, 5);
    const MirrorPlane plane = leftEdge(mesh);
    Sheet s(std::move(mesh), {plane});
    expectDerivatives(s, noisy(s.mesh.positions, 0.03, 3), 2e-7);
}
TEST_P(PatchBendingOn, DerivativesOfASheetThatYielded) {
    Sheet s(sheet(GetParam(), 1.0, 0.8, 6, 5), {leftEdge(sheet(GetParam(), 1.0, 0.8, 6, 5))}, /*yields=*/true);
    const PlasticFlow flow = s.energy.flow(lifted(s.mesh.positions, [](double x, double) { return 0.4 * x * x; }));
    EXPECT_GT(flow.elements, 0);
    EXPECT_GT(flow.work, 0.0);
    expectDerivatives(s, noisy(s.mesh.positions, 0.03, 4), 2e-7);
}

TEST_P(PatchBendingOn, GaussNewtonIsExactAtRest) {
    Sheet s(curvedSheet(GetParam()));
    const Eigen::MatrixXd exact = s.hessian(s.mesh.positions, HessianKind::Exact);
    EXPECT_LT((exact - s.hessian(s.mesh.positions, HessianKind::Positive)).cwiseAbs().maxCoeff(),
              1e-10 * exact.cwiseAbs().maxCoeff());
}

TEST_P(PatchBendingOn, AMirroredHalfIsTheWhole) {
    const TriangleMesh half = sheet(GetParam(), 0.5, 0.8, 10, 8);  // x in -0.25 .. 0.25, cut at -0.25
    const ShellMaterial material{.young = 1e7, .poisson = 0.3, .thickness = 1e-3};
    Shell shell(half, material);
    shell.mirror(verticesWhere(half.positions, [](const Vec3& p) { return p.x() < -0.25 + 1e-9; }), Vec3::UnitX());
    // bent symmetrically about the cut, the half stores the energy of a constant curvature up to its very edge
    const double k = 1e-3;
    const Points x = lifted(half.positions, [&](double u, double) { return 0.5 * k * (u + 0.25) * (u + 0.25); });
    shell.setPositions(x);
    EXPECT_NEAR(shell.energy().bending, 0.5 * material.bendingStiffness() * k * k * 0.4,
                1e-5 * material.bendingStiffness() * k * k);
}

TEST(PatchBending, YieldsAsTheRuleSays) {
    // Of a curvature k, (k - e_y) / (1 + H / E) stays; and again only beyond e_y + H / E times that.
    Sheet s(sheet(MeshKind::OneDiagonal, 1.0, 0.8, 10, 8), {}, /*yields=*/true);
    const Points bent = lifted(s.mesh.positions, [](double x, double) { return 0.1 * x * x; });
    const int middle = s.connectivity.triangleCount() / 2;
    const double k = s.energy.bendingStrain(middle, bent).head<2>().sum();
    EXPECT_NEAR(k, 0.2, 2e-3);
    s.energy.flow(bent);
    const double kept = s.energy.restCurvature(middle).head<2>().sum();
    EXPECT_NEAR(kept, (k - 0.05) / 1.1, 1e-12);
    EXPECT_NEAR(s.energy.bendingStrain(middle, bent).head<2>().sum(), 0.05 + 0.1 * kept, 1e-12);
    EXPECT_EQ(s.energy.flow(bent).elements, 0);
}

TEST(PatchBending, MeshesTooSmallForAQuadraticBendSomehow) {
    TriangleMesh mesh;
    mesh.positions.resize(3, 4);
    mesh.positions << 0, 1, 0.5, 0.5, 0, 0, 1, -1, 0, 0, 0, 0;
    mesh.triangles.resize(3, 2);
    mesh.triangles << 0, 1, 1, 0, 2, 3;
    Sheet s(mesh);
    EXPECT_LT(s.energy.value(rotated(mesh.positions)), 1e-18);
    Points folded = mesh.positions;
    folded(2, 2) = folded(2, 3) = 0.5;
    EXPECT_GT(s.energy.value(folded), 1e-3);
    expectDerivatives(s, folded, 1e-6);
}

}  // namespace
}  // namespace jacket
