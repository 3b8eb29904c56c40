#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <numbers>

#include "jacket/HalfEdgeMesh.h"
#include "jacket/Models.h"
#include "jacket/TriangleMesh.h"

/// Homogeneous deformations of a flat sheet, against closed forms.
namespace jacket {
namespace {

ShellMaterial sheetMaterial() {
    ShellMaterial material;
    material.young = 1e6;
    material.poisson = 0.3;
    material.thickness = 1e-3;
    return material;
}
const double kStretch = 1e3;  // E t [N/m]

TriangleMesh sheet(GridDiagonals diagonals, int width) {  // in cells of 0.1 m
    const double row = diagonals == GridDiagonals::Equilateral ? std::sqrt(0.75) : 1.0;
    return makeGrid(
        {.size = Vec2(0.1 * width, 0.6 * row), .cells = {width, 6}, .diagonals = diagonals, .plane = GridPlane::XY});
}

double areaOf(const TriangleMesh& mesh, int triangle) {
    const auto corner = [&](int k) -> Vec3 { return mesh.positions.col(mesh.triangles(k, triangle)); };
    return triangleArea(corner(0), corner(1), corner(2));
}

/// x = F X in the plane of the sheet, tilted and moved.
Points deformed(const Points& X, const Mat2& F) {
    const Vec3 u(2.0 / 3.0, 2.0 / 3.0, 1.0 / 3.0), v(-2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0);
    Points x(3, X.cols());
    for (Eigen::Index i = 0; i < X.cols(); ++i) {
        const Vec2 y = F * X.col(i).head<2>();
        x.col(i) = y(0) * u + y(1) * v + Vec3(1.0, 2.0, 3.0);
    }
    return x;
}

/// Energy of a sheet under x = F X [J].
template <class Model>
double energyOf(const Model& model, const Mat2& F, const TriangleMesh& mesh) {
    const Points x = deformed(mesh.positions, F);
    double energy = 0.0;
    const auto add = [&](const auto& vertices, double area) {
        Stencil<Model::kVertices> X, y;
        for (int i = 0; i < Model::kVertices; ++i) {
            X.col(i) = mesh.positions.col(vertices[i]);
            y.col(i) = x.col(vertices[i]);
        }
        energy += model.evaluate(y, model.rest(X, area), HessianKind::Positive).energy;
    };
    if constexpr (Model::kSite == StencilSite::Triangle) {
        for (int t = 0; t < mesh.triangles.cols(); ++t) add(Eigen::Vector3i(mesh.triangles.col(t)), areaOf(mesh, t));
    } else {
        const HalfEdgeMesh edges(mesh.triangles, static_cast<int>(mesh.positions.cols()));
        for (const auto& edge : edges.edges())
            add(std::array{edge.v0, edge.v1},
                areaOf(mesh, edge.halfEdge / 3) + (edge.isBorder() ? 0.0 : areaOf(mesh, edge.twin / 3)));
    }
    return energy;
}

/// Energy per rest area [J/m^2] under x = F X: what a wider sheet stores more than a narrower one, so that the halved
/// triangles at the ends of an equilateral mesh do not count.
template <class Model>
double density(Model model, const Mat2& F, GridDiagonals diagonals = GridDiagonals::Right,
               const ShellMaterial& material = sheetMaterial()) {
    model = model.fittedTo(material);
    const TriangleMesh wide = sheet(diagonals, 8), narrow = sheet(diagonals, 4);
    double area = 0.0;
    for (int t = 0; t < wide.triangles.cols(); ++t) area += areaOf(wide, t);
    for (int t = 0; t < narrow.triangles.cols(); ++t) area -= areaOf(narrow, t);
    return (energyOf(model, F, wide) - energyOf(model, F, narrow)) / area;
}

/// Stretch by `along` in a direction, by `across` at right angles to it.
Mat2 stretched(double along, double across, double direction = 0.0) {
    Mat2 turn;
    turn << std::cos(direction), -std::sin(direction), std::sin(direction), std::cos(direction);
    return turn * Vec2(along, across).asDiagonal() * turn.transpose();
}

/// Stretch factor that has Green strain e.
double factorOf(double e) {
    return std::sqrt(1.0 + 2.0 * e);
}

TEST(StVenantKirchhoffSheetTest, PulledStripHasYoungsModulus) {
    for (const double e : {-0.1, 0.02, 0.3})
        for (const double direction : {0.0, 0.4, 1.9}) {  // free sides: e_v = -nu e
            const double energy =
                density(StVenantKirchhoffMembrane{}, stretched(factorOf(e), factorOf(-0.3 * e), direction));
            EXPECT_NEAR(energy, 0.5 * kStretch * e * e, 1e-9 * kStretch);
        }
}

TEST(StVenantKirchhoffSheetTest, FreeSidesStoreLeast) {  // so that the contraction is Poisson's
    const double e = 0.05;
    const auto stored = [&](double across) {
        return density(StVenantKirchhoffMembrane{}, stretched(factorOf(e), factorOf(across)));
    };
    const double least = stored(-0.3 * e);
    EXPECT_LT(least, stored(-0.29 * e));
    EXPECT_LT(least, stored(-0.31 * e));
}

TEST(StVenantKirchhoffSheetTest, PureShearHasTheShearModulus) {
    const double shearStiffness = kStretch / (2.0 * 1.3);  // G t
    for (const double e : {0.01, 0.2})                     // strains e and -e at right angles: a shear of 2 e
        for (const double direction : {0.0, std::numbers::pi / 4, 1.0})
            EXPECT_NEAR(density(StVenantKirchhoffMembrane{}, stretched(factorOf(e), factorOf(-e), direction)),
                        0.5 * shearStiffness * 4.0 * e * e, 1e-9 * kStretch);
}

TEST(StVenantKirchhoffSheetTest, EvenStretchHasTheBiaxialModulus) {
    for (const double e : {-0.1, 0.1})
        EXPECT_NEAR(density(StVenantKirchhoffMembrane{}, stretched(factorOf(e), factorOf(e))),
                    kStretch / (1.0 - 0.3) * e * e, 1e-9 * kStretch);
}

constexpr double kWeft = 300.0, kShear = 50.0;  // E_2 t, G t [N/m]

ShellMaterial weave(double warpDirection = 0.0) {
    ShellMaterial material = sheetMaterial();
    material.orthotropy = {.weftYoung = kWeft / material.thickness,
                           .shear = kShear / material.thickness,  // the part normal to the sheet does not count
                           .warpDirection = Vec3(std::cos(warpDirection), std::sin(warpDirection), 0.7)};
    return material;
}

/// x = F X with Green strain (e_11, e_22, e_12) in the frame that is turned by `direction`.
Mat2 strained(const Vec3& e, double direction) {
    Mat2 turn, C;
    turn << std::cos(direction), -std::sin(direction), std::sin(direction), std::cos(direction);
    C << 1.0 + 2.0 * e(0), 2.0 * e(2), 2.0 * e(2), 1.0 + 2.0 * e(1);
    const Eigen::SelfAdjointEigenSolver<Mat2> eigen(turn * C * turn.transpose());
    return eigen.operatorSqrt();
}

/// Strain of a weave under the stress s [N/m], both in the frame of warp and weft.
Vec3 strainOf(const Vec3& s) {
    return {s(0) / kStretch - 0.3 / kStretch * s(1), s(1) / kWeft - 0.3 / kStretch * s(0), s(2) / (2.0 * kShear)};
}

TEST(OrthotropicSheetTest, PulledStripHasTheModulusOfItsDirection) {
    const double bias = 4.0 / (1.0 / kStretch + 1.0 / kWeft + 1.0 / kShear - 2.0 * 0.3 / kStretch);  // E_45 t
    for (const double warp : {0.0, 0.4, 1.9})
        for (const double stress : {-20.0, 3.0, 20.0}) {  // all other stresses are zero
            const auto stored = [&](const Vec3& s) {
                return density(StVenantKirchhoffMembrane{}, strained(strainOf(s), warp), GridDiagonals::Right,
                               weave(warp));
            };
            const double work = 0.5 * stress * stress;
            EXPECT_NEAR(stored({stress, 0.0, 0.0}), work / kStretch, 1e-9);
            EXPECT_NEAR(stored({0.0, stress, 0.0}), work / kWeft, 1e-9);
            EXPECT_NEAR(stored(0.5 * stress * Vec3(1.0, 1.0, 1.0)), work / bias, 1e-9);
            EXPECT_NEAR(stored({0.0, 0.0, stress}), work / kShear, 1e-9);
        }
}

TEST(OrthotropicSheetTest, ContractsTheWeftByPoissonsRatioWhenTheWarpIsPulled) {
    const double e = 0.05;
    const auto stored = [&](double across) {
        return density(StVenantKirchhoffMembrane{}, strained({e, across, 0.0}, 0.4), GridDiagonals::Right, weave(0.4));
    };
    EXPECT_LT(stored(-0.3 * e), stored(-0.29 * e));
    EXPECT_LT(stored(-0.3 * e), stored(-0.31 * e));
}

TEST(OrthotropicSheetTest, EveryMeshStoresTheSame) {
    const Mat2 F = strained({0.04, -0.03, 0.05}, 0.7);
    const double expected = density(StVenantKirchhoffMembrane{}, F, GridDiagonals::Right, weave(1.2));
    for (const auto diagonals : {GridDiagonals::Alternating, GridDiagonals::Equilateral})
        EXPECT_NEAR(density(StVenantKirchhoffMembrane{}, F, diagonals, weave(1.2)), expected, 1e-9);
}

TEST(OrthotropicSheetTest, WithTheModuliOfAnIsotropicOneIsOne) {
    ShellMaterial material = sheetMaterial();
    material.orthotropy = {.weftYoung = material.young, .shear = material.young / 2.6, .warpDirection = Vec3(1, 2, 0)};
    const Mat2 F = strained({0.2, -0.1, 0.15}, 0.3);
    EXPECT_NEAR(density(StVenantKirchhoffMembrane{}, F, GridDiagonals::Right, material),
                density(StVenantKirchhoffMembrane{}, F), 1e-9 * kStretch);
}

TEST(OrthotropicSheetTest, BaraffWitkinHasTheModuliAlongTheYarns) {
    const double e = 0.1, angle = 0.2;
    const auto stored = [&](const Mat2& F) {
        return density(BaraffWitkinMembrane{}, F, GridDiagonals::Right, weave(0.6));
    };
    EXPECT_NEAR(stored(stretched(1.0 + e, 1.0, 0.6)), 0.5 * kStretch * e * e, 1e-9 * kStretch);
    EXPECT_NEAR(stored(stretched(1.0, 1.0 + e, 0.6)), 0.5 * kWeft * e * e, 1e-9 * kStretch);
    Mat2 turn, shear;  // yarns keep their lengths
    turn << std::cos(0.6), -std::sin(0.6), std::sin(0.6), std::cos(0.6);
    shear << 1.0, std::sin(angle), 0.0, std::cos(angle);
    EXPECT_NEAR(stored(turn * shear * turn.transpose()), 0.5 * kShear * std::pow(std::sin(angle), 2), 1e-9 * kStretch);
}

TEST(BaraffWitkinSheetTest, PulledAlongTheYarnsHasYoungsModulus) {
    for (const double e : {-0.1, 0.01, 0.3}) {
        EXPECT_NEAR(density(BaraffWitkinMembrane{}, stretched(1.0 + e, 1.0)), 0.5 * kStretch * e * e, 1e-9 * kStretch);
        EXPECT_NEAR(density(BaraffWitkinMembrane{}, stretched(1.0, 1.0 + e)), 0.5 * kStretch * e * e, 1e-9 * kStretch);
    }
}

TEST(BaraffWitkinSheetTest, ShearBetweenTheYarnsHasTheShearModulus) {
    const double angle = 0.2;  // yarns keep their lengths, the right angle between them becomes pi/2 - angle
    Mat2 F;
    F << 1.0, std::sin(angle), 0.0, std::cos(angle);
    EXPECT_NEAR(density(BaraffWitkinMembrane{}, F), 0.5 * kStretch / 2.6 * std::pow(std::sin(angle), 2),
                1e-9 * kStretch);
}

TEST(BaraffWitkinSheetTest, WarpDirectionIsTheMaterialsNotTheMeshs) {
    BaraffWitkinMembrane model;
    model.stretchU = 700.0;
    model.stretchV = 50.0;
    model.warp = Vec3(std::cos(0.6), std::sin(0.6), 4.0);  // the part normal to the sheet does not count
    for (const auto diagonals : {GridDiagonals::Right, GridDiagonals::Alternating, GridDiagonals::Equilateral}) {
        EXPECT_NEAR(density(model, stretched(1.1, 1.0, 0.6), diagonals), 0.5 * 700.0 * 0.01, 1e-9);
        EXPECT_NEAR(density(model, stretched(1.0, 1.1, 0.6), diagonals), 0.5 * 50.0 * 0.01, 1e-9);
    }
}

TEST(BaraffWitkinSheetTest, RestSizesAreThoseAsked) {
    BaraffWitkinMembrane model;
    model.bU = 1.2;
    model.bV = 0.9;
    EXPECT_NEAR(density(model, stretched(1.2, 0.9)), 0.0, 1e-12);
}

TEST(SpringSheetTest, EquilateralNetHasYoungsModulusInEveryDirection) {  // and Poisson's ratio 1/3
    const double e = 1e-5;
    const SpringMembrane springs{.compression = true};
    for (int i = 0; i < 12; ++i) {
        const double direction = i * std::numbers::pi / 12;
        const Mat2 pulled = stretched(1.0 + e, 1.0 - e / 3.0, direction);
        EXPECT_NEAR(density(springs, pulled, GridDiagonals::Equilateral) / (0.5 * kStretch * e * e), 1.0, 1e-4);
        EXPECT_LT(density(springs, pulled, GridDiagonals::Equilateral),
                  density(springs, stretched(1.0 + e, 1.0 - 0.32 * e, direction), GridDiagonals::Equilateral));
        EXPECT_LT(density(springs, pulled, GridDiagonals::Equilateral),
                  density(springs, stretched(1.0 + e, 1.0 - 0.35 * e, direction), GridDiagonals::Equilateral));
    }
}

// A square grid stores 1/2 E t times the sum of the squared strains along its three (or four) directions of springs.
TEST(SpringSheetTest, GridNetsAddTheStrainsAlongTheirSprings) {
    const double e = 1e-6;
    const SpringMembrane springs{.compression = true};
    for (const Vec3& strain : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(1, -0.2, 0.5), Vec3(-1, 0.3, -0.7)}) {
        Mat2 F;
        F << 1.0 + e * strain(0), 0.5 * e * strain(2), 0.5 * e * strain(2), 1.0 + e * strain(1);
        const double axes = strain(0) * strain(0) + strain(1) * strain(1), mean = 0.5 * (strain(0) + strain(1));
        const double along = std::pow(mean + 0.5 * strain(2), 2), across = std::pow(mean - 0.5 * strain(2), 2);
        const double unit = 0.5 * kStretch * e * e;
        EXPECT_NEAR(density(springs, F, GridDiagonals::Right) / unit, axes + along, 1e-4);
        EXPECT_NEAR(density(springs, F, GridDiagonals::Alternating) / unit, axes + 0.5 * (along + across), 1e-4);
    }
}

TEST(SpringSheetTest, TwoSidedNetStoresAsMuchInCompression) {
    const double e = 1e-5;
    const SpringMembrane springs{.compression = true};
    for (const auto diagonals : {GridDiagonals::Equilateral, GridDiagonals::Right, GridDiagonals::Alternating})
        EXPECT_NEAR(
            density(springs, stretched(1.0 - e, 1.0), diagonals) / density(springs, stretched(1.0 + e, 1.0), diagonals),
            1.0, 1e-4);
}

TEST(SpringSheetTest, OneSidedNetDoesNotResistShrinking) {
    EXPECT_EQ(density(SpringMembrane{}, stretched(0.9, 0.8)), 0.0);
    EXPECT_GT(density(SpringMembrane{}, stretched(1.1, 0.8)), 0.0);
}

}  // namespace
}  // namespace jacket
