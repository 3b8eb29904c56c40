#include "ShellAssembly.h"

#include "energy/WindDrag.h"
#include "jacket/Shell.h"

namespace jacket {
namespace {

std::array<int, 3> cornersOf(const Shell& shell, int triangle) {
    const auto corners = shell.mesh().triangles().col(triangle);
    return {corners[0], corners[1], corners[2]};
}

Stencil<3> gather(const Points& points, const std::array<int, 3>& corners) {
    Stencil<3> result;
    for (int a = 0; a < 3; ++a) result.col(a) = points.col(corners[a]);
    return result;
}

}  // namespace

ShellAssembly::ShellAssembly(const Shell& shell, const Points& rest)
    : m_energies(makeEnergies(shell.mesh(), rest, shell.material(), shell.settings())) {
    std::vector<std::pair<int, int>> pairs;
    for (const auto& edge : shell.mesh().edges()) pairs.emplace_back(edge.v0, edge.v1);  // wind, soft rows
    for (const auto& energy : m_energies) energy->collectPairs(pairs);
    m_system.matrix.setPattern(shell.mesh().vertexCount(), std::move(pairs));
    for (const auto& energy : m_energies) energy->bind(m_system.matrix);
    for (int t = 0; t < shell.mesh().triangleCount(); ++t)
        m_triangleSlots.push_back(stencilSlots<3>(m_system.matrix, cornersOf(shell, t)));
}

const StepSystem& ShellAssembly::assemble(const Shell& shell, double h, const Vec3& gravity, const Wind* wind,
                                          const Eigen::Ref<const Points>& y, const Points* ahead) {
    if (ahead) m_end = shell.positions() + h * *ahead + y;
    m_system.begin(h, shell.material().stiffnessDamping);  // A = 0, b = 0
    for (const auto& energy : m_energies)
        energy->addTo(m_system, ahead ? m_end : shell.positions());  // A += (h^2 + h beta) K, b += h f
    if (ahead)
        m_system.addAlteration(-h * *ahead);  // b += h^2 K v', linearised at the end
    else if (!y.isZero(0.0))
        m_system.addAlteration(y);                                                       // b -= h K y
    addLoads(shell, gravity);                                                            // b += h f_ext
    if (wind) addWind(shell, *wind);                                                     // A += h D, b += h (f + D v)
    m_system.addMass(shell.masses(), shell.velocities(), shell.material().massDamping);  // A += M, b += M v
    return m_system;
}

void ShellAssembly::addLoads(const Shell& shell, const Vec3& gravity) {
    for (int i = 0; i < shell.vertexCount(); ++i)
        m_system.addForce(i, shell.masses()[i] * gravity + shell.forces().col(i));
    if (shell.pressure() == 0.0) return;
    for (int t = 0; t < shell.mesh().triangleCount(); ++t) {
        const auto corners = cornersOf(shell, t);
        const Stencil<3> x = gather(shell.positions(), corners);
        const Vec3 areaNormal = 0.5 * (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0));
        for (const int i : corners) m_system.addForce(i, shell.pressure() / 3.0 * areaNormal);
    }
}

void ShellAssembly::addWind(const Shell& shell, const Wind& wind) {
    for (int t = 0; t < shell.mesh().triangleCount(); ++t) {
        const auto corners = cornersOf(shell, t);
        const WindOnTriangle w =
            windOnTriangle(wind, gather(shell.positions(), corners), gather(shell.velocities(), corners));
        m_system.addDrag(corners, m_triangleSlots[t], w.force, w.drag, shell.velocities());
    }
}

}  // namespace jacket
