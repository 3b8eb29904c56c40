#pragma once
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "jacket/HalfEdgeMesh.h"
#include "jacket/TriangleMesh.h"

/// Sheets cut in the three ways on which the accuracy of a bending model is judged.
namespace jacket::demo::accuracy {

enum class MeshKind { OneDiagonal, Alternating, Delaunay };
inline constexpr MeshKind kMeshKinds[] = {MeshKind::OneDiagonal, MeshKind::Alternating, MeshKind::Delaunay};
inline std::string nameOf(MeshKind kind) {
    return kind == MeshKind::OneDiagonal ? "one-diagonal" : kind == MeshKind::Alternating ? "alternating" : "Delaunay";
}

/// Rows of cells beyond the sides of a sheet, for models that can hold a tangent only by two rows of vertices.
struct Margins {
    int left = 0, right = 0, bottom = 0, top = 0;
};

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

/// A rectangle in the xy plane centred at the origin, with margins around it. The Delaunay one has its vertices moved
/// by up to 0.3 cells; those on a side stay on it, and the one at the centre stays there.
inline TriangleMesh sheet(MeshKind kind, double length, double width, int along, int across,
                          const Margins& margins = {}) {
    const int columns = along + margins.left + margins.right, rows = across + margins.bottom + margins.top;
    const double dx = length / along, dy = width / across;
    TriangleMesh mesh =
        makeGrid({.size = {columns * dx, rows * dy},
                  .cells = {columns, rows},
                  .diagonals = kind == MeshKind::OneDiagonal ? GridDiagonals::Right : GridDiagonals::Alternating,
                  .plane = GridPlane::XY});
    mesh.positions.colwise() +=
        Vec3(0.5 * dx * (margins.right - margins.left), 0.5 * dy * (margins.top - margins.bottom), 0.0);
    if (kind != MeshKind::Delaunay) return mesh;
    std::mt19937 generator(1);
    std::uniform_real_distribution<double> shift(-0.3, 0.3);
    for (int v = 0; v < mesh.positions.cols(); ++v) {
        auto p = mesh.positions.col(v);
        const double byX = shift(generator) * dx, byY = shift(generator) * dy;
        const int i = v % (columns + 1), j = v / (columns + 1);
        const bool centre = p.norm() < 1e-9 * length;
        if (!centre && i != 0 && i != margins.left && i != columns - margins.right && i != columns) p.x() += byX;
        if (!centre && j != 0 && j != margins.bottom && j != rows - margins.top && j != rows) p.y() += byY;
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

}  // namespace jacket::demo::accuracy
