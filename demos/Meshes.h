#pragma once
#include <memory>

#include "Scene.h"

/// Meshes of a scene, with its mistakes named as the scene file spells them.
namespace jacket::demo {

/// The triangles a description stands for; throws InputError starting with `label`.
TriangleMesh makeMesh(const MeshSource& source, const std::string& label);

/// Convex hull of the vertices of a mesh file; throws InputError.
std::shared_ptr<const ConvexHull> loadHull(const std::filesystem::path& file, const std::string& label);

/// The triangles of a mesh as a body's surface. Throws InputError.
std::shared_ptr<const SurfaceMesh> loadSurface(const std::filesystem::path& file, const std::string& label);

/// Where the vertices of a shell start, in the world; throws InputError when its initial shape is of another mesh.
Points startPositions(const ShellDescription& shell, const TriangleMesh& rest);

/// Moves the vertices that are not pinned by up to `size` [m] along each axis.
void perturb(Points& x, double size, const std::vector<char>& isPinned, std::uint64_t seed);

}  // namespace jacket::demo
