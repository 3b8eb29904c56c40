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

/// Triangles that a clamp holds altogether.
std::vector<char> rigidTriangles(const HalfEdgeMesh& mesh, const std::vector<char>& clamped) {
    if (clamped.empty()) return {};
    std::vector<char> rigid(mesh.triangleCount());
    for (int t = 0; t < mesh.triangleCount(); ++t) {
        const auto c = mesh.triangles().col(t);
        rigid[t] = clamped[c[0]] && clamped[c[1]] && clamped[c[2]];
    }
    return rigid;
}

/// On each corner of a triangle [N].
Vec3 forceOfPressure(const Stencil<3>& x, double pressure) {
    const Vec3 areaNormal = 0.5 * (x.col(1) - x.col(0)).cross(x.col(2) - x.col(0));
    return pressure / 3.0 * areaNormal;
}

Vec3 sumOver(const std::array<int, 3>& corners, const Eigen::Ref<const Points>& v) {
    return v.col(corners[0]) + v.col(corners[1]) + v.col(corners[2]);
}

/// Calls use(corners, what pressure and wind do to each of them) for every triangle, as the start of a step has it.
void forAir(const Shell& shell, const Wind* wind, const auto& use) {
    if (!wind && shell.pressure() == 0.0) return;
    for (int t = 0; t < shell.mesh().triangleCount(); ++t) {
        const auto corners = cornersOf(shell, t);
        const Stencil<3> x = gather(shell.positions(), corners);
        WindOnTriangle air{Vec3::Zero(), Mat3::Zero()};
        if (wind) air = windOnTriangle(*wind, x, gather(shell.velocities(), corners));
        air.force += forceOfPressure(x, shell.pressure());
        use(corners, air);
    }
}

}  // namespace

ShellAssembly::ShellAssembly(const Shell& shell, const ShellDesign& design)
    : m_energies(makeEnergies(shell.mesh(),
                              {.positions = shell.restPositions(),
                               .mirrors = design.mirrors,
                               .rigid = rigidTriangles(shell.mesh(), design.clamped),
                               .flattened = design.flattened},
                              design.materials, shell.settings())) {
    std::vector<std::pair<int, int>> pairs;
    pairs.reserve(2 * shell.mesh().edges().size());
    for (const auto& edge : shell.mesh().edges()) pairs.emplace_back(edge.v0, edge.v1);  // wind, soft rows
    for (const auto& energy : m_energies) energy->collectPairs(pairs);
    m_system.matrix.setPattern(shell.mesh().vertexCount(), std::move(pairs));
    for (const auto& energy : m_energies) energy->bind(m_system.matrix);
    for (const auto& energy : m_energies)
        if (energy->constantHessian()) m_constant = energy->constantHessian();
}

/// Of all triangles, when wind or pressure first asks for them.
const std::vector<std::array<int, 3>>& ShellAssembly::triangleSlots(const Shell& shell) {
    if (!m_triangleSlots.empty()) return m_triangleSlots;
    m_triangleSlots.reserve(shell.mesh().triangleCount());
    for (int t = 0; t < shell.mesh().triangleCount(); ++t)
        m_triangleSlots.push_back(stencilSlots<3>(m_system.matrix, cornersOf(shell, t)));
    return m_triangleSlots;
}

void ShellAssembly::addEnergies(const Points& x, HessianKind kind) {
    for (const auto& energy : m_energies) energy->addTo(m_system, x, kind);
}

PlasticFlow ShellAssembly::flow(const Points& x) {
    PlasticFlow sum;
    for (const auto& energy : m_energies) {
        const PlasticFlow flow = energy->flow(x);
        if (flow.elements == 0) continue;
        sum.work += flow.work;
        sum.elements += flow.elements;
        if (sum.triangle < 0 || flow.most > sum.most) sum.most = flow.most, sum.triangle = flow.triangle;
    }
    return sum;
}

const StepSystem& ShellAssembly::assembleStatic(const Shell& shell, const Vec3& gravity, double load,
                                                HessianKind kind) {
    m_system.setTeam(nullptr);
    m_system.begin(1.0, 0.0, m_constant);  // a step of 1 s without mass: A = K, b = f
    addEnergies(shell.positions(), kind);
    addLoads(shell, gravity, load);
    if (kind == HessianKind::Exact && shell.pressure() != 0.0) addPressureStiffness(shell, load * shell.pressure());
    return m_system;
}

/// How pressure follows the surface: force p/6 (x1 - x0) x (x2 - x0) on each corner. Symmetric summed over a closed
/// surface; of an open one the symmetric part.
void ShellAssembly::addPressureStiffness(const Shell& shell, double pressure) {
    const auto& slots = triangleSlots(shell);
    for (int t = 0; t < shell.mesh().triangleCount(); ++t) {
        const auto corners = cornersOf(shell, t);
        const Stencil<3> x = gather(shell.positions(), corners);
        const auto byCorner = [&](int j) -> Mat3 {  // -df/dx_j: the edge opposite to it
            return -pressure / 6.0 * skew(x.col((j + 1) % 3) - x.col((j + 2) % 3));
        };
        int pair = 0;
        for (int a = 0; a < 3; ++a) {
            m_system.addDiagonal(corners[a], 0.5 * (byCorner(a) + byCorner(a).transpose()));
            for (int b = 0; b < a; ++b, ++pair)
                m_system.addPair(slots[t][pair], 0.5 * (byCorner(b) + byCorner(a).transpose()));
        }
    }
}

const StepSystem& ShellAssembly::assemble(const Shell& shell, double h, const Vec3& gravity, const Wind* wind,
                                          const Eigen::Ref<const Points>& start, const Eigen::Ref<const Points>& y,
                                          const Eigen::Ref<const Points>* ahead, WorkerTeam* team) {
    m_system.setTeam(team);
    Points& end = m_system.scratch();  // where `ahead` leads
    if (ahead) end = shell.positions() + h * *ahead + y;
    m_system.begin(h, shell.material().stiffnessDamping, m_constant);     // A = (h^2 + h beta) K_constant, b = 0
    addEnergies(ahead ? end : shell.positions(), HessianKind::Positive);  // A += (h^2 + h beta) K, b += h f
    if (ahead)
        m_system.addAlteration(*ahead, -h);  // b += h^2 K v', linearised at the end
    else if (!y.isZero(0.0))
        m_system.addAlteration(y);                                          // b -= h K y
    addLoads(shell, gravity, 1.0);                                          // b += h f_ext
    if (wind) addWind(shell, *wind);                                        // A += h D, b += h (f + D v)
    m_system.addMass(shell.masses(), start, shell.material().massDamping);  // A += M, b += M v
    return m_system;
}

void ShellAssembly::addLoads(const Shell& shell, const Vec3& gravity, double load) {
    m_system.forVertices(
        [&](int i) { m_system.addForce(i, load * (shell.masses()[i] * gravity + shell.forces().col(i))); });
    if (shell.pressure() == 0.0) return;
    for (int t = 0; t < shell.mesh().triangleCount(); ++t) {
        const auto corners = cornersOf(shell, t);
        const Vec3 force = forceOfPressure(gather(shell.positions(), corners), load * shell.pressure());
        for (const int i : corners) m_system.addForce(i, force);
    }
}

double ShellAssembly::workOfAir(const Shell& shell, double h, const Wind* wind, const Eigen::Ref<const Points>& before,
                                const Eigen::Ref<const Points>& v) {
    double work = 0.0;
    forAir(shell, wind, [&](const std::array<int, 3>& corners, const WindOnTriangle& air) {
        const Vec3 change = sumOver(corners, v) - sumOver(corners, shell.velocities());
        const Vec3 mean = 0.5 * (sumOver(corners, before) + sumOver(corners, v));
        work += h * mean.dot(air.force - air.drag * change);
    });
    return work;
}

double ShellAssembly::potentialOfAir(const Shell& shell, double h, const Wind* wind,
                                     const Eigen::Ref<const Points>& v) {
    double sum = 0.0;
    forAir(shell, wind, [&](const std::array<int, 3>& corners, const WindOnTriangle& air) {
        const Vec3 change = sumOver(corners, v) - sumOver(corners, shell.velocities());
        sum += h * change.dot(0.5 * air.drag * change - air.force);
    });
    return sum;
}

void ShellAssembly::addWind(const Shell& shell, const Wind& wind) {
    const auto& slots = triangleSlots(shell);
    for (int t = 0; t < shell.mesh().triangleCount(); ++t) {
        const auto corners = cornersOf(shell, t);
        const WindOnTriangle w =
            windOnTriangle(wind, gather(shell.positions(), corners), gather(shell.velocities(), corners));
        m_system.addDrag(corners, slots[t], w.force, w.drag, shell.velocities());
    }
}

}  // namespace jacket
