#include "energy/makeEnergies.h"

#include <limits>
#include <map>

#include "energy/PatchEnergy.h"
#include "energy/StencilEnergy.h"
#include "jacket/Shell.h"

namespace jacket {
namespace {

YieldRule yieldRule(const ShellMaterial& m) {
    constexpr double kNever = std::numeric_limits<double>::infinity();
    if (!m.yieldStress) return {kNever, kNever, 0.0, 0.0};
    return {m.yieldCurvature(), *m.yieldStress * m.thickness, m.hardening / m.young, m.hardening * m.thickness};
}

/// The material of a hinge between two: each triangle's stiffness counts with its area. It yields where the weaker
/// does.
ShellMaterial between(const ShellMaterial& a, const ShellMaterial& b, double areaA, double areaB) {
    ShellMaterial m = a.yieldCurvature() <= b.yieldCurvature() ? a : b;
    m.bendingStiffnessOverride = (areaA * a.bendingStiffness() + areaB * b.bendingStiffness()) / (areaA + areaB);
    m.stretchStiffnessOverride = (areaA * a.stretchStiffness() + areaB * b.stretchStiffness()) / (areaA + areaB);
    return m;
}

/// Sorts stencils into groups of one material.
template <StencilModel Model>
class Grouping {
    using Group = typename StencilEnergy<Model>::Group;

  public:
    Grouping(const Model& model, const HalfEdgeMesh& mesh, const Materials& materials, const Points& rest)
        : m_model(model), m_materials(materials) {
        for (int t = 0; t < mesh.triangleCount(); ++t) {
            const auto corners = mesh.triangles().col(t);
            m_areas.push_back(triangleArea(rest.col(corners[0]), rest.col(corners[1]), rest.col(corners[2])));
        }
    }
    /// `second`: the other triangle at the site, or -1.
    void add(const std::array<int, Model::kVertices>& stencil, int first, int second) {
        const auto& of = m_materials.ofTriangle;
        const int a = of.empty() ? 0 : of[first], b = of.empty() || second < 0 ? a : of[second];
        const double areaA = m_areas[first], areaB = second < 0 ? 0.0 : m_areas[second];
        auto [found, isNew] = m_groupOf.try_emplace(std::minmax(a, b), static_cast<int>(m_groups.size()));
        if (isNew) {
            const ShellMaterial material =
                a == b ? m_materials.list[a] : between(m_materials.list[a], m_materials.list[b], areaA, areaB);
            m_groups.push_back({.model = m_model.fittedTo(material),
                                .yield = yieldRule(material),
                                .stencils = {},
                                .areas = {},
                                .triangles = {}});
        }
        Group& group = m_groups[found->second];
        group.stencils.push_back(stencil);
        group.areas.push_back(areaA + areaB);
        group.triangles.push_back(first);
    }
    std::vector<Group> take() {
        for (Group& group : m_groups) {
            group.stencils.shrink_to_fit();
            group.areas.shrink_to_fit();
            group.triangles.shrink_to_fit();
        }
        return std::move(m_groups);
    }

  private:
    const Model& m_model;
    const Materials& m_materials;
    std::vector<double> m_areas;
    std::map<std::pair<int, int>, int> m_groupOf;
    std::vector<Group> m_groups;
};

template <StencilModel Model>
std::unique_ptr<Energy> makeEnergy(const Model& model, const HalfEdgeMesh& mesh, const RestShape& rest,
                                   const Materials& materials) {
    Grouping<Model> grouping(model, mesh, materials, rest.positions);
    const auto across = [](const HalfEdgeMesh::Edge& edge) { return edge.isBorder() ? -1 : edge.twin / 3; };
    if constexpr (Model::kSite == StencilSite::Triangle) {
        for (int t = 0; t < mesh.triangleCount(); ++t) {
            const auto corners = mesh.triangles().col(t);
            grouping.add({corners[0], corners[1], corners[2]}, t, -1);
        }
    } else if constexpr (Model::kSite == StencilSite::Edge) {
        for (const auto& edge : mesh.edges()) grouping.add({edge.v0, edge.v1}, edge.halfEdge / 3, across(edge));
    } else {
        for (const auto& hinge : mesh.hinges()) {
            const auto& edge = mesh.edges()[hinge.edge];
            grouping.add(hinge.vertices, edge.halfEdge / 3, across(edge));
        }
    }
    return std::make_unique<StencilEnergy<Model>>(grouping.take(), rest);
}

std::unique_ptr<Energy> makeEnergy(const PatchBending& model, const HalfEdgeMesh& mesh, const RestShape& rest,
                                   const Materials& materials) {
    std::vector<PatchEnergy::Plate> plates;
    plates.reserve(mesh.triangleCount());
    for (int t = 0; t < mesh.triangleCount(); ++t) {
        const ShellMaterial& material = materials.at(t);
        const PatchBending fitted = model.fittedTo(material);
        const YieldRule yield = yieldRule(material);
        plates.push_back({*fitted.stiffness, *fitted.poisson, yield.curvature, yield.hardening});
    }
    return std::make_unique<PatchEnergy>(mesh, rest, plates);
}

}  // namespace

std::vector<std::unique_ptr<Energy>> makeEnergies(const HalfEdgeMesh& mesh, const RestShape& rest,
                                                  const Materials& materials, const ShellSettings& settings) {
    std::vector<std::unique_ptr<Energy>> energies;
    const auto append = [&](const auto& model) { energies.push_back(makeEnergy(model, mesh, rest, materials)); };
    std::visit(append, settings.membrane);
    std::visit(append, settings.bending);
    return energies;
}

}  // namespace jacket
