#include "energy/StencilEnergy.h"
#include "jacket/Shell.h"

namespace jacket {
namespace {

/// Rest area of the triangles at an edge [m^2].
double areaAt(const HalfEdgeMesh::Edge& edge, const std::vector<double>& triangleAreas) {
    const double first = triangleAreas[edge.halfEdge / 3];
    return edge.isBorder() ? first : first + triangleAreas[edge.twin / 3];
}

template <StencilModel Model>
std::unique_ptr<Energy> makeEnergy(const Model& model, const HalfEdgeMesh& mesh, const Points& rest,
                                   const std::vector<double>& triangleAreas) {
    std::vector<std::array<int, Model::kVertices>> stencils;
    std::vector<double> areas;
    if constexpr (Model::kSite == StencilSite::Triangle) {
        for (int t = 0; t < mesh.triangleCount(); ++t) {
            const auto corners = mesh.triangles().col(t);
            stencils.push_back({corners[0], corners[1], corners[2]});
        }
        areas = triangleAreas;
    } else if constexpr (Model::kSite == StencilSite::Edge) {
        for (const auto& edge : mesh.edges()) {
            stencils.push_back({edge.v0, edge.v1});
            areas.push_back(areaAt(edge, triangleAreas));
        }
    } else {
        for (const auto& hinge : mesh.hinges()) {
            stencils.push_back(hinge.vertices);
            areas.push_back(areaAt(mesh.edges()[hinge.edge], triangleAreas));
        }
    }
    return std::make_unique<StencilEnergy<Model>>(model, std::move(stencils), areas, rest);
}

}  // namespace

std::vector<std::unique_ptr<Energy>> makeEnergies(const HalfEdgeMesh& mesh, const Points& rest,
                                                  const ShellMaterial& material, const ShellSettings& settings) {
    std::vector<double> areas(mesh.triangleCount());
    for (int t = 0; t < mesh.triangleCount(); ++t) {
        const auto corners = mesh.triangles().col(t);
        areas[t] = triangleArea(rest.col(corners[0]), rest.col(corners[1]), rest.col(corners[2]));
    }
    std::vector<std::unique_ptr<Energy>> energies;
    const auto append = [&](const auto& model) {
        energies.push_back(makeEnergy(model.fittedTo(material), mesh, rest, areas));
    };
    std::visit(append, settings.membrane);
    std::visit(append, settings.bending);
    return energies;
}

}  // namespace jacket
