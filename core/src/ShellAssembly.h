#pragma once
#include <memory>
#include <vector>

#include "energy/makeEnergies.h"

namespace jacket {

class Shell;
struct Wind;

/// What a shell is made as, besides its rest positions.
struct ShellDesign {
    Materials materials;
    std::vector<MirrorPlane> mirrors;
    std::vector<char> clamped;  ///< per vertex
    bool flattened = false;
};

/// A shell's energies, and the matrix of its step with the pattern they need.
class ShellAssembly {
  public:
    ShellAssembly(const Shell& shell, const ShellDesign& design);
    /// A and b of the step from the shell's present state; valid until the next call. With `ahead`, an estimate of the
    /// velocities at the end of the step, the energies are linearised at the end that it leads to: one more Newton
    /// step. `team` may help.
    const StepSystem& assemble(const Shell& shell, double h, const Vec3& gravity, const Wind* wind,
                               const Eigen::Ref<const Points>& start, const Eigen::Ref<const Points>& y,
                               const Eigen::Ref<const Points>* ahead = nullptr, WorkerTeam* team = nullptr);
    /// What pressure and wind do in a step as assemble has them, from velocities `before` to `v` [J].
    static double workOfAir(const Shell& shell, double h, const Wind* wind, const Eigen::Ref<const Points>& before,
                            const Eigen::Ref<const Points>& v);
    /// Of which their impulse in such a step is minus the gradient by `v` [J].
    static double potentialOfAir(const Shell& shell, double h, const Wind* wind, const Eigen::Ref<const Points>& v);
    /// K and the unbalanced force in `rhs`, at the shell's positions, under `load` times gravity, forces and pressure.
    const StepSystem& assembleStatic(const Shell& shell, const Vec3& gravity, double load, HessianKind kind);
    const Energy& membrane() const { return *m_energies[0]; }
    Energy& membrane() { return *m_energies[0]; }
    const Energy& bending() const { return *m_energies[1]; }
    PlasticFlow flow(const Points& x);
    /// See StepSystem::scratch.
    Points& scratch() { return m_system.scratch(); }

  private:
    void addPressureStiffness(const Shell& shell, double pressure);
    const std::vector<std::array<int, 3>>& triangleSlots(const Shell& shell);
    void addEnergies(const Points& x, HessianKind kind);
    void addLoads(const Shell& shell, const Vec3& gravity, double load);
    void addWind(const Shell& shell, const Wind& wind);
    std::vector<std::unique_ptr<Energy>> m_energies;  ///< membrane, then bending
    StepSystem m_system;
    const ConstantHessian* m_constant = nullptr;      ///< of one of them, at most
    std::vector<std::array<int, 3>> m_triangleSlots;  ///< as of stencilSlots; empty until something asks for them
};

}  // namespace jacket
