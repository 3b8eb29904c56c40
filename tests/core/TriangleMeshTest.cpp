#include "jacket/TriangleMesh.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>

#include "jacket/HalfEdgeMesh.h"

namespace jacket {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TriangleMesh meshOf(const std::vector<Vec3>& points, const std::vector<std::array<int, 3>>& triangles) {
    TriangleMesh mesh{Points(3, points.size()), Indices<3>(3, triangles.size())};
    for (std::size_t i = 0; i < points.size(); ++i) mesh.positions.col(i) = points[i];
    for (std::size_t t = 0; t < triangles.size(); ++t)
        mesh.triangles.col(t) = Eigen::Vector3i(triangles[t][0], triangles[t][1], triangles[t][2]);
    return mesh;
}

/// A unit square of two triangles.
TriangleMesh square() {
    return meshOf({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}});
}

int eulerCharacteristic(const TriangleMesh& mesh) {
    const HalfEdgeMesh half(mesh.triangles, static_cast<int>(mesh.positions.cols()));
    return half.vertexCount() - static_cast<int>(half.edges().size()) + half.triangleCount();
}

/// Follows the border from edge to edge; works where each border vertex has one border edge out.
int borderLoops(const TriangleMesh& mesh) {
    const HalfEdgeMesh half(mesh.triangles, static_cast<int>(mesh.positions.cols()));
    std::vector<int> next(half.vertexCount(), -1);
    for (const auto& edge : half.edges())
        if (edge.isBorder()) next[edge.v0] = edge.v1;
    int loops = 0;
    for (int v = 0; v < half.vertexCount(); ++v) {
        if (next[v] < 0) continue;
        ++loops;
        for (int at = v; next[at] >= 0;) at = std::exchange(next[at], -1);
    }
    return loops;
}

Vec3 corner(const TriangleMesh& mesh, int t, int k) {
    return mesh.positions.col(mesh.triangles(k, t));
}

Vec3 areaVector(const TriangleMesh& mesh, int t) {  // area times normal
    const Vec3 a = corner(mesh, t, 0);
    return 0.5 * (corner(mesh, t, 1) - a).cross(corner(mesh, t, 2) - a);
}

double area(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (int t = 0; t < mesh.triangles.cols(); ++t)
        sum += triangleArea(corner(mesh, t, 0), corner(mesh, t, 1), corner(mesh, t, 2));
    return sum;
}

Vec2 smallestAndLargestAngle(const TriangleMesh& mesh) {  // [degree]
    Vec2 range(180, 0);
    for (int t = 0; t < mesh.triangles.cols(); ++t)
        for (int k = 0; k < 3; ++k) {
            const Vec3 u = corner(mesh, t, (k + 1) % 3) - corner(mesh, t, k);
            const Vec3 v = corner(mesh, t, (k + 2) % 3) - corner(mesh, t, k);
            const double angle = std::atan2(u.cross(v).norm(), u.dot(v)) * 180.0 / std::numbers::pi;
            range = Vec2(std::min(range[0], angle), std::max(range[1], angle));
        }
    return range;
}

/// "fatal: ..." or "note: ..." of every finding, a line each.
std::string findings(const TriangleMesh& mesh) {
    std::string lines;
    for (const MeshProblem& problem : checkMesh(mesh))
        lines += (problem.fatal ? "fatal: " : "note: ") + problem.what + "\n";
    return lines;
}

std::string messageOf(const auto& action) {
    try {
        action();
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "nothing was thrown";
}

class GridTest : public testing::TestWithParam<std::tuple<GridDiagonals, GridPlane, int, int>> {};

TEST_P(GridTest, IsADiscOfTheRightSizeFacingTheRightWay) {
    const auto [diagonals, plane, nx, ny] = GetParam();
    const TriangleMesh mesh = makeGrid({.size = {2.0, 3.0}, .cells = {nx, ny}, .diagonals = diagonals, .plane = plane});
    const int longRows = diagonals == GridDiagonals::Equilateral ? (ny + 1) / 2 : 0;
    EXPECT_EQ(mesh.positions.cols(), (nx + 1) * (ny + 1) + longRows);
    EXPECT_EQ(mesh.triangles.cols(), (2 * nx + (longRows > 0 ? 1 : 0)) * ny);
    EXPECT_NO_THROW(requireUsable(mesh));
    EXPECT_EQ(eulerCharacteristic(mesh), 1);
    EXPECT_EQ(borderLoops(mesh), 1);
    EXPECT_NEAR(area(mesh), 6.0, 1e-12);
    const Vec3 normal = plane == GridPlane::XZ ? Vec3(0, 1, 0) : plane == GridPlane::XY ? Vec3(0, 0, 1) : Vec3(1, 0, 0);
    for (int t = 0; t < mesh.triangles.cols(); ++t) EXPECT_GT(areaVector(mesh, t).dot(normal), 0.0) << "triangle " << t;
    const Vec3 half = plane == GridPlane::XZ   ? Vec3(1.0, 0, 1.5)
                      : plane == GridPlane::XY ? Vec3(1.0, 1.5, 0)
                                               : Vec3(0, 1.0, 1.5);
    EXPECT_EQ(mesh.positions.col(0), -half);
    EXPECT_EQ(mesh.positions.rightCols<1>(), half);
    EXPECT_EQ(Vec3(mesh.positions.rowwise().maxCoeff()), half);
    EXPECT_EQ(Vec3(mesh.positions.rowwise().minCoeff()), -half);
}

INSTANTIATE_TEST_SUITE_P(All, GridTest,
                         testing::Combine(testing::Values(GridDiagonals::Right, GridDiagonals::Alternating,
                                                          GridDiagonals::Equilateral),
                                          testing::Values(GridPlane::XZ, GridPlane::XY, GridPlane::YZ),
                                          testing::Values(1, 2, 5), testing::Values(1, 2, 3, 4)));

TEST(Grid, VerticesRunRowByRowAlongTheFirstAxis) {
    const TriangleMesh mesh = makeGrid({.size = {4.0, 2.0}, .cells = {4, 2}, .plane = GridPlane::XY});
    for (int j = 0; j <= 2; ++j)
        for (int i = 0; i <= 4; ++i) EXPECT_EQ(mesh.positions.col(j * 5 + i), Vec3(i - 2.0, j - 1.0, 0.0));
}

TEST(Grid, ThesisPatchHas121VerticesAnd200Triangles) {
    const TriangleMesh mesh = makeGrid({});
    EXPECT_EQ(mesh.positions.cols(), 121);
    EXPECT_EQ(mesh.triangles.cols(), 200);
}

TEST(Grid, AlternatingDiagonalsMakeStarsOfFourAndEight) {
    const TriangleMesh mesh = makeGrid({.cells = {4, 4}, .diagonals = GridDiagonals::Alternating});
    const HalfEdgeMesh half(mesh.triangles, 25);
    std::multiset<std::size_t> valences;
    for (const int v : {6, 7, 8, 11, 12, 13, 16, 17, 18}) valences.insert(half.neighbours(v).size());
    EXPECT_EQ(valences, (std::multiset<std::size_t>{4, 4, 4, 4, 8, 8, 8, 8, 8}));
}

TEST(Grid, EquilateralCellsMakeEquilateralTrianglesInside) {
    const double height = 6 * std::sqrt(0.75);
    const TriangleMesh mesh = makeGrid({.size = {5, height}, .cells = {5, 6}, .diagonals = GridDiagonals::Equilateral});
    int equilateral = 0;
    for (int t = 0; t < mesh.triangles.cols(); ++t) {
        bool unitEdges = true;
        for (int k = 0; k < 3; ++k)
            unitEdges = unitEdges && std::abs((corner(mesh, t, k) - corner(mesh, t, (k + 1) % 3)).norm() - 1.0) < 1e-12;
        equilateral += unitEdges;
    }
    EXPECT_EQ(equilateral, mesh.triangles.cols() - 2 * 6);  // all but the half ones at both ends of each row
    EXPECT_NEAR(smallestAndLargestAngle(mesh)[0], 30.0, 1e-9);
}

TEST(Grid, RefusesImpossibleOptions) {
    EXPECT_EQ(messageOf([] {
                  makeGrid({.size = {-1.0, 1.0}});
              }),
              "GridOptions.size[0] [m] must be > 0 and finite, got -1");
    EXPECT_EQ(messageOf([] {
                  makeGrid({.size = {1.0, kNaN}});
              }),
              "GridOptions.size[1] [m] must be > 0 and finite, got nan");
    EXPECT_EQ(messageOf([] { makeGrid({.cells = {0, 3}}); }), "GridOptions.cells[0] must be >= 1, got 0");
    EXPECT_EQ(messageOf([] { makeGrid({.cells = {3, -2}}); }), "GridOptions.cells[1] must be >= 1, got -2");
    EXPECT_NE(messageOf([] { makeGrid({.cells = {100000, 100000}}); }), "nothing was thrown");
}

TEST(Hemisphere, FiveRingsAreTheBowlOfTheThesis) {
    const TriangleMesh mesh = makeHemisphere(0.5, 5);
    EXPECT_EQ(mesh.positions.cols(), 77);
    EXPECT_EQ(mesh.triangles.cols(), 130);
    EXPECT_GT(smallestAndLargestAngle(mesh)[0], 42.0);
    EXPECT_LT(smallestAndLargestAngle(mesh)[1], 89.0);
}

TEST(Hemisphere, IsADiscOnTheSphereFacingOutwards) {
    for (int rings = 1; rings <= 20; ++rings) {
        const TriangleMesh mesh = makeHemisphere(2.0, rings);
        EXPECT_EQ(findings(mesh), "");
        EXPECT_EQ(eulerCharacteristic(mesh), 1);
        EXPECT_EQ(borderLoops(mesh), 1);
        EXPECT_EQ(mesh.positions.col(0), Vec3(0, 2, 0));
        EXPECT_EQ(mesh.positions.row(1).minCoeff(), 0.0);
        EXPECT_TRUE(((mesh.positions.colwise().norm().array() - 2.0).abs() < 1e-14).all());
        for (int t = 0; t < mesh.triangles.cols(); ++t) EXPECT_GT(areaVector(mesh, t).dot(corner(mesh, t, 0)), 0.0);
        EXPECT_GT(smallestAndLargestAngle(mesh)[0], 41.0) << rings << " rings";
        EXPECT_LT(smallestAndLargestAngle(mesh)[1], 92.0) << rings << " rings";
    }
    EXPECT_NEAR(area(makeHemisphere(1.0, 60)), 2 * std::numbers::pi, 2e-3);
    EXPECT_EQ(messageOf([] { makeHemisphere(1.0, 0); }), "makeHemisphere: rings must be 1..10000, got 0");
}

TEST(Cylinder, IsATubeFacingOutwards) {
    const TriangleMesh mesh = makeCylinder(0.5, 2.0, 12, 7);
    EXPECT_EQ(mesh.positions.cols(), 12 * 8);
    EXPECT_EQ(mesh.triangles.cols(), 2 * 12 * 7);
    EXPECT_EQ(findings(mesh), "");
    EXPECT_EQ(eulerCharacteristic(mesh), 0);
    EXPECT_EQ(borderLoops(mesh), 2);
    EXPECT_EQ(mesh.positions.row(1).minCoeff(), -1.0);
    EXPECT_EQ(mesh.positions.row(1).maxCoeff(), 1.0);
    for (int t = 0; t < mesh.triangles.cols(); ++t) {
        Vec3 outwards = corner(mesh, t, 0) + corner(mesh, t, 1) + corner(mesh, t, 2);
        outwards.y() = 0.0;
        EXPECT_GT(areaVector(mesh, t).dot(outwards), 0.0);
    }
    EXPECT_EQ(messageOf([] { makeCylinder(1.0, 1.0, 2, 1); }), "makeCylinder: around must be >= 3, got 2");
    EXPECT_EQ(messageOf([] { makeCylinder(0.0, 1.0, 3, 1); }),
              "makeCylinder: radius [m] must be > 0 and finite, got 0");
}

TEST(CheckMesh, FindsNothingWrongWithASquare) {
    EXPECT_EQ(findings(square()), "");
}

TEST(CheckMesh, EmptyMesh) {
    EXPECT_EQ(findings({}), "fatal: the mesh has 0 vertices and 0 triangles; it must have at least one triangle\n");
}

TEST(CheckMesh, CoordinateThatIsNotFinite) {
    TriangleMesh mesh = square();
    mesh.positions(1, 2) = kNaN;
    mesh.positions(2, 3) = -std::numeric_limits<double>::infinity();
    EXPECT_EQ(findings(mesh),
              "fatal: vertex 2: coordinate y is nan; must be finite\n"
              "fatal: vertex 3: coordinate z is -inf; must be finite\n");
}

TEST(CheckMesh, IndexOutOfRange) {
    TriangleMesh mesh = square();
    mesh.triangles(2, 1) = 4;
    mesh.triangles(0, 0) = -1;
    EXPECT_EQ(findings(mesh),
              "fatal: triangle 0 (-1 1 2): names vertex -1; indices must lie in 0..3\n"
              "fatal: triangle 1 (0 2 4): names vertex 4; indices must lie in 0..3\n"
              "fatal: vertex 3: belongs to no triangle and would have no mass; every vertex must be used\n");
}

TEST(CheckMesh, RepeatedVertex) {
    TriangleMesh mesh = square();
    mesh.triangles.col(1) << 3, 0, 3;
    EXPECT_EQ(findings(mesh), "fatal: triangle 1 (3 0 3): repeats vertex 3; the three must differ\n");
}

TEST(CheckMesh, ZeroAreaIsRelativeToTheMesh) {
    TriangleMesh mesh = meshOf({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {3, -3, 0}, {2, -1, 0}}, {{0, 1, 2}, {3, 4, 1}});
    EXPECT_EQ(findings(mesh),
              "note: vertex 1: joins 2 parts of the surface that share no edge there; they will turn "
              "freely about it\n");
    mesh.positions.col(4) << 2, -1.5, 0;  // on the line from 1 to 3
    EXPECT_EQ(checkMesh(mesh)[0].what,
              "triangle 1 (3 4 1): area 0 m^2; must be > 9.01388e-09 m^2, i.e. higher than 1e-09 of the mesh's size");
    EXPECT_TRUE(checkMesh(mesh)[0].fatal);
    EXPECT_EQ(checkMesh(mesh)[0].index, 1);
    mesh.positions *= 1e-6;  // micrometres instead of metres
    EXPECT_EQ(checkMesh(mesh).size(), 2u);
    mesh.positions.col(4) << 2e-6, -1e-6, 0;
    EXPECT_EQ(checkMesh(mesh).size(), 1u);
    mesh.positions.setConstant(7.0);
    EXPECT_EQ(checkMesh(mesh)[0].what,
              "triangle 0 (0 1 2): area 0 m^2; must be > 0 m^2, i.e. higher than 1e-09 of the mesh's size");
}

TEST(CheckMesh, SliverIsOnlyNoted) {
    EXPECT_EQ(findings(meshOf({{0, 0, 0}, {1, 0, 0}, {0.5, 0.01, 0}}, {{0, 1, 2}})),
              "note: triangle 0 (0 1 2): smallest angle 1.14576 degrees; below 5 the solver converges slowly\n");
}

TEST(CheckMesh, EdgeOfThreeTriangles) {
    const TriangleMesh mesh =
        meshOf({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}}, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}});
    EXPECT_EQ(findings(mesh), "fatal: edge 0-1: shared by 3 triangles (0, 1, 2); at most two may share an edge\n");
    EXPECT_EQ(checkMesh(mesh)[0].element, MeshProblem::Element::Edge);
    EXPECT_EQ(checkMesh(mesh)[0].index, 0);
}

TEST(CheckMesh, NeighboursOfOppositeOrientation) {
    TriangleMesh mesh = square();
    mesh.triangles.col(1) << 0, 3, 2;
    EXPECT_EQ(findings(mesh),
              "fatal: edge 2-0: triangles 0 and 1 both run along it in this direction; neighbours must "
              "be oriented alike\n");
}

TEST(CheckMesh, UnusedVertex) {
    TriangleMesh mesh = square();
    mesh.positions.conservativeResize(3, 5);
    mesh.positions.col(4) << 1, 2, 3;
    EXPECT_EQ(findings(mesh),
              "fatal: vertex 4: belongs to no triangle and would have no mass; every vertex must be used\n");
}

TEST(CheckMesh, DuplicateTriangleWhateverItsOrderOrSide) {
    for (const Eigen::Vector3i& again : {Eigen::Vector3i(1, 2, 0), Eigen::Vector3i(0, 2, 1)}) {
        TriangleMesh mesh = square();
        mesh.triangles.conservativeResize(3, 3);
        mesh.triangles.col(2) = again;
        const std::string list =
            std::to_string(again[0]) + " " + std::to_string(again[1]) + " " + std::to_string(again[2]);
        EXPECT_EQ(findings(mesh), "fatal: triangle 2 (" + list +
                                      "): has the same vertices as triangle 0; each triangle must occur once\n");
    }
}

TEST(CheckMesh, TwoPartsAreOnlyNoted) {
    EXPECT_EQ(
        findings(meshOf({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 0, 0}, {6, 0, 0}, {5, 1, 0}}, {{0, 1, 2}, {3, 4, 5}})),
        "note: the mesh has 2 parts that are not connected; each will move on its own\n");
}

TEST(RequireUsable, ThrowsTheFirstFatalProblemAndCountsTheOthers) {
    EXPECT_NO_THROW(requireUsable(square()));
    EXPECT_NO_THROW(requireUsable(meshOf({{0, 0, 0}, {1, 0, 0}, {0.5, 0.01, 0}}, {{0, 1, 2}})));  // a mere sliver
    TriangleMesh mesh = square();
    mesh.positions(0, 0) = kNaN;
    EXPECT_EQ(messageOf([&] { requireUsable(mesh); }), "vertex 0: coordinate x is nan; must be finite");
    mesh.positions(0, 3) = kNaN;
    mesh.positions(1, 3) = kNaN;
    EXPECT_EQ(messageOf([&] { requireUsable(mesh); }), "vertex 0: coordinate x is nan; must be finite (and 2 more)");
}

/// A tube cut open along its first column: the seam's vertices exist twice, `gap` apart along each axis.
TriangleMesh cutCylinder(int around, int along, double gap) {
    TriangleMesh mesh = makeGrid({.size = {1.0, 1.0}, .cells = {around, along}, .plane = GridPlane::XY});
    for (int v = 0; v < mesh.positions.cols(); ++v) {
        const double turn = 2 * std::numbers::pi * (mesh.positions(0, v) + 0.5);
        mesh.positions.col(v) = Vec3(std::sin(turn), mesh.positions(1, v), std::cos(turn));
        if (v % (around + 1) == around) mesh.positions.col(v) += Vec3::Constant(gap);
    }
    return mesh;
}

TEST(WeldSeams, ClosesACutCylinder) {
    const TriangleMesh cut = cutCylinder(16, 5, 1.7e-6);  // of 1.73e-6: the tube's diagonal is 3 m
    EXPECT_EQ(eulerCharacteristic(cut), 1);
    std::vector<int> map;
    const TriangleMesh welded = weldSeams(cut, 1e-6, &map);
    EXPECT_EQ(welded.positions.cols(), 16 * 6);
    EXPECT_EQ(eulerCharacteristic(welded), 0);
    EXPECT_EQ(borderLoops(welded), 2);
    EXPECT_EQ(findings(welded), "");
    ASSERT_EQ(map.size(), 17u * 6u);
    for (int v = 0; v < 17 * 6; ++v)
        EXPECT_LT((cut.positions.col(v) - welded.positions.col(map[v])).norm(), 3e-6) << "vertex " << v;
    for (int t = 0; t < cut.triangles.cols(); ++t)
        for (int k = 0; k < 3; ++k) EXPECT_EQ(welded.triangles(k, t), map[cut.triangles(k, t)]);
}

TEST(WeldSeams, KeepsWhatIsFartherApartThanTheTolerance) {
    const TriangleMesh cut = cutCylinder(16, 5, 1e-4);
    EXPECT_EQ(weldSeams(cut).positions.cols(), cut.positions.cols());
    EXPECT_EQ(weldSeams(cut, 1e-3).positions.cols(), 16 * 6);
}

TEST(WeldSeams, ToleranceOfZeroMeansEqualPositions) {
    TriangleMesh soup = makeGrid({.cells = {3, 3}});
    const TriangleMesh grid = soup;
    soup.positions.resize(3, 54);
    for (int t = 0; t < 18; ++t)
        for (int k = 0; k < 3; ++k) {
            soup.positions.col(3 * t + k) = corner(grid, t, k);
            soup.triangles(k, t) = 3 * t + k;
        }
    const TriangleMesh welded = weldSeams(soup, 0.0);
    EXPECT_EQ(welded.positions.cols(), 16);
    EXPECT_EQ(eulerCharacteristic(welded), 1);
}

TEST(WeldSeams, NeverWeldsTwoVerticesOfOneTriangle) {
    // Triangle 0 has an edge far below the tolerance; triangle 1 touches its tip with vertices of its own.
    const TriangleMesh mesh =
        meshOf({{0, 0, 0}, {1e-9, 0, 0}, {0, 1, 0}, {0, 0, 0}, {0, -1, 0}, {1e-9, 0, 0}}, {{0, 1, 2}, {3, 4, 5}});
    const TriangleMesh welded = weldSeams(mesh);
    EXPECT_EQ(welded.positions.cols(), 4);
    for (int t = 0; t < 2; ++t)
        EXPECT_EQ(std::set<int>(welded.triangles.col(t).begin(), welded.triangles.col(t).end()).size(), 3u);
}

TEST(WeldSeams, LeavesTheInsideAloneAndSurvivesBrokenMeshes) {
    TriangleMesh folded = makeGrid({.cells = {2, 2}});
    folded.positions.col(4) = folded.positions.col(0);  // an inner vertex that touches a corner
    EXPECT_EQ(weldSeams(folded).positions.cols(), 9);
    TriangleMesh broken = square();
    broken.triangles(0, 0) = 99;
    broken.positions(0, 1) = kNaN;
    EXPECT_EQ(weldSeams(broken).positions.cols(), 4);
    EXPECT_EQ(weldSeams({}).positions.cols(), 0);
}

TEST(WeldSeams, IsExactFarFromTheOrigin) {
    TriangleMesh cut = cutCylinder(16, 5, 0.0);
    cut.positions.colwise() += Vec3(1e6, -1e6, 3e5);
    EXPECT_EQ(weldSeams(cut).positions.cols(), 16 * 6);
}

}  // namespace
}  // namespace jacket
