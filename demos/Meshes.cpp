#include "Meshes.h"

#include <random>
#include <stdexcept>

#include "jacket/loadMesh.h"

namespace jacket::demo {

namespace {

struct MakeMesh {
    TriangleMesh operator()(const MeshFile& mesh) const { return loadMesh(mesh.file); }
    TriangleMesh operator()(const GridOptions& grid) const { return makeGrid(grid); }
    TriangleMesh operator()(const HemisphereMesh& mesh) const { return makeHemisphere(mesh.radius, mesh.rings); }
    TriangleMesh operator()(const TubeMesh& mesh) const {
        return makeCylinder(mesh.radius, mesh.height, mesh.cells.x(), mesh.cells.y());
    }
};

}  // namespace

TriangleMesh makeMesh(const MeshSource& source, const std::string& label) {
    try {
        return std::visit(MakeMesh{}, source);
    } catch (const MeshFileError& error) {
        throw InputError(error.what());
    } catch (const std::invalid_argument& error) {
        throw InputError(label + ": " + error.what());
    }
}

std::shared_ptr<const ConvexHull> loadHull(const std::filesystem::path& file, const std::string& label) {
    try {
        return std::make_shared<const ConvexHull>(loadMeshUnchecked(file).positions);
    } catch (const MeshFileError& error) {
        throw InputError(error.what());
    } catch (const std::invalid_argument& error) {
        throw InputError(label + ".shape.hull: " + file.string() + ": " + error.what());
    }
}

std::shared_ptr<const SurfaceMesh> loadSurface(const std::filesystem::path& file, const std::string& label) {
    try {
        const TriangleMesh mesh = loadMeshUnchecked(file);
        return std::make_shared<const SurfaceMesh>(mesh.positions, mesh.triangles);
    } catch (const MeshFileError& error) {
        throw InputError(error.what());
    } catch (const std::invalid_argument& error) {
        throw InputError(label + ".shape.mesh: " + file.string() + ": " + error.what());
    }
}

Points startPositions(const ShellDescription& shell, const TriangleMesh& rest) {
    Points x = rest.positions;
    if (shell.initialShape) {
        const TriangleMesh shape = makeMesh(*shell.initialShape, shell.label + ".initial_shape");
        if (shape.positions.cols() != x.cols() || shape.triangles != rest.triangles)
            throw InputError(shell.label + ".initial_shape must have the vertices and triangles of mesh: got " +
                             std::to_string(shape.positions.cols()) + " vertices and " +
                             std::to_string(shape.triangles.cols()) + " triangles, mesh has " +
                             std::to_string(x.cols()) + " and " + std::to_string(rest.triangles.cols()) +
                             ", and the same order of them");
        x = shape.positions;
    }
    return (shell.transform.rotation() * x).colwise() + shell.transform.position;
}

void perturb(Points& x, double size, const std::vector<char>& isPinned, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const auto uniform = [&] { return 2.0 * static_cast<double>(random() >> 11) * 0x1p-53 - 1.0; };
    for (int i = 0; i < x.cols(); ++i) {
        const Vec3 shift(uniform(), uniform(), uniform());
        if (!isPinned[i]) x.col(i) += size * shift;
    }
}

}  // namespace jacket::demo
