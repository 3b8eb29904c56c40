#pragma once
#include <memory>
#include <utility>
#include <vector>

#include "jacket/HalfEdgeMesh.h"
#include "jacket/Models.h"
#include "solver/StepSystem.h"

namespace jacket {

/// One energy of one shell: a sum over stencils.
class Energy {
  public:
    virtual ~Energy() = default;
    virtual void collectPairs(std::vector<std::pair<int, int>>& pairs) const = 0;  ///< vertex pairs it couples
    virtual void bind(const BlockMatrix& matrix) = 0;                              ///< looks up its blocks, once
    virtual void addTo(StepSystem& system, const Points& x) const = 0;             ///< A and b at x
    virtual double value(const Points& x) const = 0;                               ///< [J]
    virtual void addGradient(const Points& x, Points& gradient) const = 0;         ///< += dE/dx [N]
};

struct ShellSettings;

/// Membrane first, bending second; parameters that the models leave unset follow from the material.
std::vector<std::unique_ptr<Energy>> makeEnergies(const HalfEdgeMesh& mesh, const Points& rest,
                                                  const ShellMaterial& material, const ShellSettings& settings);

}  // namespace jacket
