#pragma once
#include <filesystem>
#include <stdexcept>

#include "jacket/TriangleMesh.h"

namespace jacket {

/// A mesh file that cannot be read; what() is "FILE:LINE: what is wrong with which value, and the rule".
class MeshFileError : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// Reads a Wavefront OBJ file (v and f; polygons, which should be convex, are split into fans, texture seams are
/// welded, everything else is skipped). Throws MeshFileError; the mesh it returns has passed requireUsable.
TriangleMesh loadMesh(const std::filesystem::path& file);

/// The same without the final check and weld: for reporting what is wrong with a mesh.
TriangleMesh loadMeshUnchecked(const std::filesystem::path& file);

}  // namespace jacket
