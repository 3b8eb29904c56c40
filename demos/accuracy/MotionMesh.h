#pragma once
#include <vector>

#include "Problem.h"
#include "jacket/Shell.h"

namespace jacket::demo::accuracy {

/// A flat rectangle in the plane y = 0, centred at the origin, normals up. The Delaunay one has its inner vertices
/// moved by up to 0.3 cells; the first `straightColumns` columns of vertices keep their place along x.
TriangleMesh makeSheet(MeshKind kind, const Vec2& size, const Eigen::Vector2i& cells, int straightColumns = 1);

/// A strip along x that leaves a wall at x = 0.
struct StripOptions {
    double length = 1.0, width = 0.25;  ///< of the free part [m]
    int cells = 20;                     ///< along the free part
    MeshKind mesh = MeshKind::OneDiagonal;
    BendingModel bending = PatchBending{};
};

struct Strip {
    Shell shell;
    std::vector<int> tip;  ///< vertices of the free end
};

/// The strip, clamped. Models that work hinge by hinge know no clamped edge: for them a row of cells inside the wall is
/// pinned too, as their users do. `settings.bending` is replaced by the options'.
Strip makeStrip(const StripOptions& options, const ShellMaterial& material, ShellSettings settings);

Vec3 meanPosition(const Shell& shell, const std::vector<int>& vertices);

}  // namespace jacket::demo::accuracy
