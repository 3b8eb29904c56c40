#include "MotionMesh.h"

#include "SheetMeshes.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace jacket::demo::accuracy {

namespace {

/// Moves inner vertices at random, those of the outline along it. The same mesh in every run.
void shake(Points& x, const Vec2& size, const Eigen::Vector2i& cells, int straightColumns) {
    std::mt19937 generator(1);
    std::uniform_real_distribution<double> shift(-0.3, 0.3);
    for (int j = 0, vertex = 0; j <= cells.y(); ++j)
        for (int i = 0; i <= cells.x(); ++i, ++vertex) {
            const double dx = shift(generator) * size.x() / cells.x(), dz = shift(generator) * size.y() / cells.y();
            if (i >= straightColumns && i < cells.x()) x(0, vertex) += dx;
            if (j > 0 && j < cells.y()) x(2, vertex) += dz;
        }
}

}  // namespace

TriangleMesh makeSheet(MeshKind kind, const Vec2& size, const Eigen::Vector2i& cells, int straightColumns) {
    const auto diagonals = kind == MeshKind::OneDiagonal ? GridDiagonals::Right : GridDiagonals::Alternating;
    TriangleMesh mesh = makeGrid({.size = size, .cells = cells, .diagonals = diagonals, .plane = GridPlane::XZ});
    if (kind != MeshKind::Delaunay) return mesh;
    // makeGrid's second axis may run against z; shake() moves along axes, so either way is the same kind of mesh.
    shake(mesh.positions, size, cells, straightColumns);
    makeDelaunay(mesh);
    return mesh;
}

Strip makeStrip(const StripOptions& options, const ShellMaterial& material, ShellSettings settings) {
    const bool knowsClamps = std::holds_alternative<PatchBending>(options.bending);
    const int rowsInWall = knowsClamps ? 0 : 1;
    const double cell = options.length / options.cells, length = options.length + rowsInWall * cell;
    const int across = std::max(2, static_cast<int>(std::lround(options.cells * options.width / options.length)));
    TriangleMesh mesh =
        makeSheet(options.mesh, {length, options.width}, {options.cells + rowsInWall, across}, 1 + rowsInWall);
    mesh.positions.row(0).array() += options.length - 0.5 * length;

    settings.bending = options.bending;
    Strip strip{Shell(mesh, material, settings), {}};
    std::vector<int> wall;
    for (int i = 0; i < mesh.positions.cols(); ++i) {
        if (mesh.positions(0, i) < 1e-9 * options.length) wall.push_back(i);
        if (mesh.positions(0, i) > options.length * (1 - 1e-9)) strip.tip.push_back(i);
    }
    if (knowsClamps) strip.shell.clamp(wall, Vec3::UnitX());
    for (const int i : wall) strip.shell.pin(i);
    return strip;
}

Vec3 meanPosition(const Shell& shell, const std::vector<int>& vertices) {
    Vec3 sum = Vec3::Zero();
    for (const int i : vertices) sum += shell.positions().col(i);
    return sum / static_cast<double>(vertices.size());
}

}  // namespace jacket::demo::accuracy
