#pragma once
#include <memory>
#include <vector>

#include "energy/Energy.h"

namespace jacket {

class Shell;
struct Wind;

/// A shell's energies, and the matrix of its step with the pattern they need.
class ShellAssembly {
  public:
    ShellAssembly(const Shell& shell, const Points& rest);
    /// A and b of the step from the shell's present state; valid until the next call. With `ahead`, an estimate of the
    /// velocities at the end of the step, the energies are linearised at the end that it leads to: one more Newton
    /// step.
    const StepSystem& assemble(const Shell& shell, double h, const Vec3& gravity, const Wind* wind,
                               const Eigen::Ref<const Points>& y, const Points* ahead = nullptr);
    const Energy& membrane() const { return *m_energies[0]; }
    const Energy& bending() const { return *m_energies[1]; }

  private:
    void addLoads(const Shell& shell, const Vec3& gravity);
    void addWind(const Shell& shell, const Wind& wind);
    std::vector<std::unique_ptr<Energy>> m_energies;  ///< membrane, then bending
    StepSystem m_system;
    Points m_end;  ///< where `ahead` leads
    std::vector<std::array<int, 3>> m_triangleSlots;
};

}  // namespace jacket
