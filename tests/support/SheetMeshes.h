#pragma once
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "jacket/HalfEdgeMesh.h"
#include "jacket/TriangleMesh.h"

namespace jacket::test {

enum class MeshKind { OneDiagonal, Alternating, Delaunay };
inline constexpr MeshKind kMeshKinds[] = {MeshKind::OneDiagonal, MeshKind::Alternating, MeshKind::Delaunay};
inline std::string nameOf(MeshKind kind) {
    return kind == MeshKind::OneDiagonal ? "one-diagonal" : kind == MeshKind::Alternating ? "alternating" : "Delaunay";
}

/// Flips edges until every one is locally Delaunay (Lawson). For flat meshes.
inline void makeDelaunay(TriangleMesh& mesh) {
    const auto angle = [&](int apex, int p, int q) {
        const Vec3 a = mesh.positions.col(p) - mesh.positions.col(apex),
                   b = mesh.positions.col(q) - mesh.positions.col(apex);
        return std::atan2(a.cross(b).norm(), a.dot(b));
    };
    for (bool changed = true; changed;) {
        changed = false;
        const HalfEdgeMesh connectivity(mesh.triangles, static_cast<int>(mesh.positions.cols()));
        std::vector<char> touched(mesh.triangles.cols(), 0);
        for (const auto& hinge : connectivity.hinges()) {
            const auto& edge = connectivity.edges()[hinge.edge];
            const int t0 = edge.halfEdge / 3, t1 = edge.twin / 3;
            const auto [a, b, c, d] = hinge.vertices;
            if (touched[t0] || touched[t1] || angle(c, a, b) + angle(d, a, b) <= std::numbers::pi + 1e-9) continue;
            mesh.triangles.col(t0) << a, d, c;
            mesh.triangles.col(t1) << d, b, c;
            touched[t0] = touched[t1] = 1;
            changed = true;
        }
    }
}

/// A rectangle in the xy plane centred at the origin; the Delaunay one has its inner vertices moved by up to 0.3 cells.
inline TriangleMesh sheet(MeshKind kind, double length, double width, int along, int across) {
    TriangleMesh mesh = makeGrid({.size = {length, width},
                                  .cells = {along, across},
                                  .diagonals = kind == MeshKind::OneDiagonal ? GridDiagonals::Right
                                                                             : GridDiagonals::Alternating,
                                  .plane = GridPlane::XY});
    if (kind != MeshKind::Delaunay) return mesh;
    std::mt19937 generator(1);
    std::uniform_real_distribution<double> shift(-0.3, 0.3);
    for (int i = 0; i < mesh.positions.cols(); ++i) {
        auto p = mesh.positions.col(i);
        const double dx = shift(generator) * length / along, dy = shift(generator) * width / across;
        const bool endX = std::abs(p.x()) > 0.5 * length * (1.0 - 1e-9),
                   endY = std::abs(p.y()) > 0.5 * width * (1.0 - 1e-9);
        if (!endX) p.x() += dx;
        if (!endY) p.y() += dy;
    }
    makeDelaunay(mesh);
    return mesh;
}

/// Vertices for which `chosen(position)` holds.
template <class Predicate>
std::vector<int> verticesWhere(const Points& x, const Predicate& chosen) {
    std::vector<int> result;
    for (int i = 0; i < x.cols(); ++i)
        if (chosen(Vec3(x.col(i)))) result.push_back(i);
    return result;
}

}  // namespace jacket::test
