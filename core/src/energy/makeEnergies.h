#pragma once
#include "energy/Energy.h"

namespace jacket {

struct ShellSettings;

/// What each triangle of a shell is made of.
struct Materials {
    std::vector<ShellMaterial> list;  ///< at least one
    std::vector<int> ofTriangle;      ///< index in `list`; empty: all are of the first
    const ShellMaterial& at(int triangle) const { return list[ofTriangle.empty() ? 0 : ofTriangle[triangle]]; }
};

/// Membrane first, bending second; parameters that the models leave unset follow from the material.
std::vector<std::unique_ptr<Energy>> makeEnergies(const HalfEdgeMesh& mesh, const RestShape& rest,
                                                  const Materials& materials, const ShellSettings& settings);

}  // namespace jacket
