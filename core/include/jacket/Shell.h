#pragma once
#include <memory>
#include <span>
#include <vector>

#include "jacket/Contact.h"
#include "jacket/HalfEdgeMesh.h"
#include "jacket/Material.h"
#include "jacket/Models.h"
#include "jacket/StepReport.h"
#include "jacket/TriangleMesh.h"

namespace jacket {

class IslandSolver;
class ShellAssembly;

enum class Preconditioner { BlockJacobi, IncompleteCholesky };

/// How a shell is modelled and solved; the defaults are what most scenes want.
struct ShellSettings {
    MembraneModel membrane = StVenantKirchhoffMembrane{};
    BendingModel bending = DihedralBending{};
    Preconditioner preconditioner = Preconditioner::IncompleteCholesky;  ///< of an island: its first shell's
    double tolerance = 1e-3;   ///< of the linear solve, relative, in the preconditioner's norm
    int maxIterations = 1000;  ///< of one linear solve
};

/// Air that moves past the shells.
struct Wind {
    Vec3 velocity{0, 0, 0};        ///< [m/s]
    double airDensity = 1.2;       ///< [kg/m^3]
    double normalDrag = 1.0;       ///< C_n [-]
    double tangentialDrag = 0.02;  ///< C_t [-]
};

/// Stored and moving energy of one shell [J].
struct ShellEnergy {
    double kinetic = 0.0, membrane = 0.0, bending = 0.0;
};

/// One shell: rest shape, state, and how it is held. Positions and velocities are in the vertex order of the mesh.
class Shell {
  public:
    /// Throws std::invalid_argument on an unusable mesh or material.
    Shell(const TriangleMesh& mesh, const ShellMaterial& material, const ShellSettings& settings = {});
    ~Shell();
    Shell(Shell&&) noexcept;
    Shell& operator=(Shell&&) noexcept;

    const HalfEdgeMesh& mesh() const { return *m_mesh; }
    const ShellMaterial& material() const { return m_material; }
    const ShellSettings& settings() const { return m_settings; }
    int vertexCount() const { return static_cast<int>(m_x.cols()); }
    const Points& restPositions() const { return m_rest; }
    const Points& positions() const { return m_x; }           ///< [m]
    const Points& velocities() const { return m_v; }          ///< [m/s]: what the next `advance` moves with
    const Eigen::VectorXd& masses() const { return m_mass; }  ///< lumped, [kg]

    /// Place and motion; sizes must match (throws std::invalid_argument), values must be finite.
    void setPositions(const Points& x);
    void setVelocities(const Points& v);

    /// Holds a vertex where it is, or moves it to `target` during the next step.
    void pin(int vertex);
    void movePin(int vertex, const Vec3& target);
    void unpin(int vertex);
    bool isPinned(int vertex) const { return m_pinned[vertex] != 0; }
    const Vec3& pinTarget(int vertex) const { return m_pinTarget[vertex]; }
    int pinCount() const { return m_pinCount; }

    /// Constant force on a vertex [N], besides gravity.
    void setForce(int vertex, const Vec3& force);
    const Points& forces() const { return m_force; }
    /// Pressure on the side that the normals point away from, so that > 0 inflates a closed shell [Pa].
    void setPressure(double pressure);
    double pressure() const { return m_pressure; }

    ShellEnergy energy() const;
    Vec3 linearMomentum() const;                    ///< [N s]
    Vec3 angularMomentum(const Vec3& about) const;  ///< [N m s]
    double maxStretch() const;                      ///< largest edge length / rest length - 1 [-]
    Points vertexNormals() const;                   ///< area weighted, unit
    /// Internal forces -dW/dx of the current shape, without damping [N].
    Points elasticForces() const;

    /// One step without bodies or contacts: solve for velocities, then move.
    StepReport step(double h, const Vec3& gravity, const Wind* wind = nullptr);
    /// Moves every vertex by h v, after a solve.
    void advance(double h);
    /// Puts a vertex somewhere without touching its velocity: for contacts carried along by their body.
    void displace(int vertex, const Vec3& by) { m_x.col(vertex) += by; }

  private:
    friend class IslandSolver;
    void requireVertex(int vertex, const char* what) const;  ///< throws std::out_of_range
    std::unique_ptr<HalfEdgeMesh> m_mesh;
    ShellMaterial m_material;
    ShellSettings m_settings;
    Points m_rest, m_x, m_v, m_force;
    Points m_y;  ///< position alteration that the next `advance` adds [m]
    Eigen::VectorXd m_mass, m_restArea;
    std::vector<char> m_pinned;
    std::vector<Vec3> m_pinTarget;
    int m_pinCount = 0;
    double m_pressure = 0.0;
    std::unique_ptr<ShellAssembly> m_assembly;  ///< energies and the step's matrix
    std::unique_ptr<IslandSolver> m_ownSolver;  ///< for step()
};

}  // namespace jacket
