#include "jacket/HalfEdgeMesh.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <string>

#include "jacket/TriangleMesh.h"

namespace jacket {
namespace {

Indices<3> columns(const std::vector<std::array<int, 3>>& triangles) {
    Indices<3> result(3, triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t)
        result.col(t) << triangles[t][0], triangles[t][1], triangles[t][2];
    return result;
}

std::string messageOf(const std::vector<std::array<int, 3>>& triangles, int vertexCount) {
    try {
        HalfEdgeMesh(columns(triangles), vertexCount);
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "nothing was thrown";
}

TEST(HalfEdgeMesh, TwoTrianglesMakeOneHinge) {
    const HalfEdgeMesh mesh(columns({{0, 1, 2}, {1, 0, 3}}), 4);
    ASSERT_EQ(mesh.hinges().size(), 1u);
    EXPECT_EQ(mesh.hinges()[0].vertices, (std::array<int, 4>{0, 1, 2, 3}));
    EXPECT_EQ(mesh.edges().size(), 5u);
    EXPECT_EQ(mesh.hinges()[0].edge, mesh.edgeOf(0));
    EXPECT_EQ(mesh.twin(0), 3);
    EXPECT_EQ(mesh.triangleAcross(0, 0), 1);
    EXPECT_EQ(mesh.triangleAcross(0, 1), -1);
    EXPECT_EQ(mesh.neighbours(0), (std::vector{1, 2, 3}));
    EXPECT_EQ(mesh.neighbours(3).size(), 2u);
    EXPECT_EQ(mesh.trianglesAround(1).size(), 2u);
    EXPECT_EQ(mesh.trianglesAround(2).size(), 1u);
}

TEST(HalfEdgeMesh, ClosedSurfaceHasNoBorder) {
    const HalfEdgeMesh tetrahedron(columns({{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}), 4);
    EXPECT_EQ(tetrahedron.edges().size(), 6u);
    EXPECT_EQ(tetrahedron.hinges().size(), 6u);
    for (int v = 0; v < 4; ++v) EXPECT_FALSE(tetrahedron.isBorderVertex(v));
}

TEST(HalfEdgeMesh, BorderOfAGridIsItsOutline) {
    const TriangleMesh grid = makeGrid({.cells = {4, 3}});
    const HalfEdgeMesh mesh(grid.triangles, 20);
    for (int j = 0; j <= 3; ++j)
        for (int i = 0; i <= 4; ++i)
            EXPECT_EQ(mesh.isBorderVertex(j * 5 + i), i == 0 || i == 4 || j == 0 || j == 3) << i << ", " << j;
    EXPECT_EQ(mesh.neighbours(6).size(), 6u);  // the ring of an inner vertex
    EXPECT_EQ(std::count_if(mesh.edges().begin(), mesh.edges().end(), [](const auto& e) { return e.isBorder(); }), 14);
}

TEST(HalfEdgeMesh, TakesSeveralPartsUnusedVerticesAndNothingAtAll) {
    const HalfEdgeMesh parts(columns({{0, 1, 2}, {3, 4, 5}}), 7);
    EXPECT_EQ(parts.edges().size(), 6u);
    EXPECT_TRUE(parts.neighbours(6).empty());
    EXPECT_TRUE(parts.trianglesAround(6).empty());
    EXPECT_FALSE(parts.isBorderVertex(6));
    const HalfEdgeMesh nothing(Indices<3>(3, 0), 0);
    EXPECT_TRUE(nothing.edges().empty());
}

TEST(HalfEdgeMesh, RefusesWhatIsNoOrientedSurface) {
    EXPECT_EQ(messageOf({{0, 1, 2}, {1, 0, 3}, {0, 1, 4}}, 5),
              "edge 0-1: has 3 triangles; at most two may share an edge");
    EXPECT_EQ(messageOf({{0, 1, 2}, {3, 0, 1}}, 4),
              "edge 0-1: triangles 0 and 1 both run along it in this direction; "
              "neighbours must be oriented alike");
    EXPECT_EQ(messageOf({{0, 1, 2}, {0, 2, 7}}, 4), "triangle 1 (0 2 7): names vertex 7; indices must lie in 0..3");
    EXPECT_EQ(messageOf({{0, -1, 2}}, 4), "triangle 0 (0 -1 2): names vertex -1; indices must lie in 0..3");
    EXPECT_EQ(messageOf({{0, 1, 0}}, 4), "triangle 0 (0 1 0): repeats vertex 0; the three must differ");
}

/// Rebuilds from the triangles alone what HalfEdgeMesh says, and compares.
void checkInvariants(const HalfEdgeMesh& mesh) {
    const auto from = [&](int h) { return mesh.triangles()(h % 3, h / 3); };
    const auto to = [&](int h) { return mesh.triangles()((h + 1) % 3, h / 3); };
    std::set<std::pair<int, int>> undirected;
    std::vector<std::set<int>> ring(mesh.vertexCount()), around(mesh.vertexCount());
    std::vector<char> border(mesh.vertexCount(), 0);
    const int halfEdges = 3 * mesh.triangleCount();
    int withTwin = 0;
    for (int h = 0; h < halfEdges; ++h) {
        undirected.insert(std::minmax(from(h), to(h)));
        ring[from(h)].insert(to(h));
        ring[to(h)].insert(from(h));
        around[from(h)].insert(h / 3);
        const int other = mesh.twin(h);
        const auto& edge = mesh.edges()[mesh.edgeOf(h)];
        RC_ASSERT(edge.halfEdge == h || edge.twin == h);
        RC_ASSERT(mesh.triangleAcross(h / 3, h % 3) == (other < 0 ? -1 : other / 3));
        if (other < 0) {
            border[from(h)] = border[to(h)] = 1;
            RC_ASSERT(edge.isBorder());
            continue;
        }
        ++withTwin;
        RC_ASSERT(other != h);
        RC_ASSERT(mesh.twin(other) == h);
        RC_ASSERT(from(other) == to(h));
        RC_ASSERT(to(other) == from(h));
        RC_ASSERT(mesh.edgeOf(other) == mesh.edgeOf(h));
    }
    RC_ASSERT(mesh.edges().size() == undirected.size());
    RC_ASSERT(2 * static_cast<int>(mesh.hinges().size()) == withTwin);
    for (const auto& edge : mesh.edges()) {
        RC_ASSERT(edge.v0 == from(edge.halfEdge));
        RC_ASSERT(edge.v1 == to(edge.halfEdge));
        RC_ASSERT(edge.twin == mesh.twin(edge.halfEdge));
    }
    for (const auto& hinge : mesh.hinges()) {
        const auto& [x0, x1, x2, x3] = hinge.vertices;
        const auto& edge = mesh.edges()[hinge.edge];
        RC_ASSERT((edge.v0 == x0 && edge.v1 == x1));
        RC_ASSERT(to((edge.halfEdge / 3) * 3 + (edge.halfEdge + 1) % 3) == x2);
        RC_ASSERT(to((edge.twin / 3) * 3 + (edge.twin + 1) % 3) == x3);
    }
    for (int v = 0; v < mesh.vertexCount(); ++v) {
        RC_ASSERT(std::ranges::equal(mesh.neighbours(v), ring[v]));  // ascending, each once
        const auto triangles = mesh.trianglesAround(v);
        RC_ASSERT(triangles.size() == around[v].size());
        RC_ASSERT((std::set<int>(triangles.begin(), triangles.end()) == around[v]));
        RC_ASSERT(mesh.isBorderVertex(v) == (border[v] != 0));
    }
}

RC_GTEST_PROP(HalfEdgeMeshProperty, HoldsForGridsWithRandomHoles, ()) {
    const int nx = *rc::gen::inRange(1, 8), ny = *rc::gen::inRange(1, 8);
    const auto diagonals =
        *rc::gen::element(GridDiagonals::Right, GridDiagonals::Alternating, GridDiagonals::Equilateral);
    const TriangleMesh grid = makeGrid({.cells = {nx, ny}, .diagonals = diagonals});
    const auto keep = *rc::gen::container<std::vector<bool>>(grid.triangles.cols(), rc::gen::arbitrary<bool>());
    const auto turns = *rc::gen::container<std::vector<int>>(grid.triangles.cols(), rc::gen::inRange(0, 3));
    std::vector<std::array<int, 3>> kept;
    for (int t = 0; t < grid.triangles.cols(); ++t) {
        if (!keep[t]) continue;
        std::array<int, 3> triangle{grid.triangles(0, t), grid.triangles(1, t), grid.triangles(2, t)};
        std::rotate(triangle.begin(), triangle.begin() + turns[t], triangle.end());  // another first corner
        kept.push_back(triangle);
    }
    checkInvariants(HalfEdgeMesh(columns(kept), static_cast<int>(grid.positions.cols())));
}

RC_GTEST_PROP(HalfEdgeMeshProperty, RefusesWhatCheckMeshRefuses, ()) {
    // Random triangles of few vertices: mostly broken, in every way. Geometry plays no part, so positions are generic.
    const int vertexCount = *rc::gen::inRange(3, 7);
    const auto corner = rc::gen::inRange(0, vertexCount);
    const auto triangles = *rc::gen::container<std::vector<std::array<int, 3>>>(
        *rc::gen::inRange(1, 5), rc::gen::container<std::array<int, 3>>(corner));
    TriangleMesh mesh{Points(3, vertexCount), columns(triangles)};
    for (int v = 0; v < vertexCount; ++v) mesh.positions.col(v) << v, v * v, v * v * v;  // no three on a line
    bool accepted = true;
    try {
        const HalfEdgeMesh half(mesh.triangles, vertexCount);
        checkInvariants(half);
    } catch (const std::invalid_argument&) {
        accepted = false;
    }
    bool fatalConnectivity = false, fatalDuplicate = false;
    for (const MeshProblem& problem : checkMesh(mesh)) {
        if (!problem.fatal || problem.element == MeshProblem::Element::Vertex) continue;  // unused vertices are taken
        (problem.what.find("same vertices") != std::string::npos ? fatalDuplicate : fatalConnectivity) = true;
    }
    if (fatalConnectivity) RC_ASSERT(!accepted);
    if (!accepted) RC_ASSERT(fatalConnectivity || fatalDuplicate);
}

}  // namespace
}  // namespace jacket
