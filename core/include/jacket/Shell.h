#pragma once
#include <map>
#include <memory>
#include <optional>
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
struct ShellDesign;

enum class Preconditioner { BlockJacobi, IncompleteCholesky };

/// How the state moves through time.
enum class Integrator {
    BackwardEuler,  ///< one linear solve a step (Baraff & Witkin 1998), linearised again only where edges overstretch
    Newton,  ///< backward Euler solved to the end: Newton's method with a line search on the incremental potential
    Bdf2,    ///< Newton too, but second order, variable step, little damping; near bodies as Newton
};

/// How a shell is modelled and solved; the defaults are what most scenes want.
struct ShellSettings {
    MembraneModel membrane = StVenantKirchhoffMembrane{};
    BendingModel bending = PatchBending{};
    Integrator integrator = Integrator::BackwardEuler;
    Preconditioner preconditioner = Preconditioner::IncompleteCholesky;  ///< of an island: its first shell's
    /// Of the linear solve, relative, in the preconditioner's norm. Where shells bear bodies a tenth of it, and at most
    /// 1e-4, while they are at rest; where they move, at most 0.4 of it of what gravity does in the step. Near bodies
    /// what is left of a shell without pins is also at most a tenth of what gravity does in the step, or a hundredth of
    /// the tolerance.
    double tolerance = 1e-2;
    int maxIterations = 1000;  ///< of one linear solve
    bool plasticity = false;   ///< keep bends and stretches beyond the material's yield stress
};

/// Air that moves past the shells.
struct Wind {
    Vec3 velocity{0, 0, 0};        ///< [m/s]
    double airDensity = 1.2;       ///< [kg/m^3]
    double normalDrag = 1.0;       ///< C_n [-]
    double tangentialDrag = 0.02;  ///< C_t [-]
    bool operator==(const Wind&) const = default;
};

/// Throws std::invalid_argument naming the field, unless the velocity is finite and the rest finite and >= 0.
void validate(const Wind& wind);

/// Stored and moving energy of one shell, and what plastic flow has turned into heat so far [J].
struct ShellEnergy {
    double kinetic = 0.0, membrane = 0.0, bending = 0.0, plasticWork = 0.0;
};

/// Where a shell yielded in its last step.
struct Dent {
    int triangle = -1;             ///< with the most plastic work; -1: nothing yielded
    Vec3 position = Vec3::Zero();  ///< of its centre [m]
    double work = 0.0;             ///< of the whole shell in the step [J]
    int elements = 0;              ///< hinges or patches, and triangles in their plane, that yielded
};

/// How long steps may be that choose their length themselves: a step is taken back and halved where it strains an edge
/// or gains energy by more than this, and lengthened again after four that were not.
struct AdaptiveStep {
    double mostStrain = 0.02;  ///< change of an edge's length over its rest length, in one step [-]
    double mostEnergyGain =
        0.01;                ///< of kinetic plus elastic energy, in one step, besides what gravity and forces give
    double shortest = 1e-6;  ///< taken whatever it does [s]
    double next = 0.0;       ///< length to try next; 0: all at once [s]
    int quiet = 0;           ///< steps since the last rejection or change
};

struct AdaptiveReport {
    int steps = 0, rejected = 0;
    double shortest = 0.0;  ///< [s]
    bool finite = true;     ///< false: stopped at a step that was not, before the duration's end
};

/// One shell: rest shape, state, and how it is held. Positions and velocities are in the vertex order of the mesh.
class Shell {
  public:
    /// Throws std::invalid_argument on an unusable mesh or material.
    Shell(const TriangleMesh& mesh, const ShellMaterial& material, const ShellSettings& settings = {});
    ~Shell();
    Shell(Shell&&) noexcept;
    Shell& operator=(Shell&&) noexcept;

    /// The same of several materials: triangle t is of materials[ofTriangle[t]]. Damping is the first one's.
    Shell(const TriangleMesh& mesh, std::vector<ShellMaterial> materials, std::vector<int> ofTriangle,
          const ShellSettings& settings = {});

    const HalfEdgeMesh& mesh() const { return *m_mesh; }
    const ShellMaterial& material() const;  ///< the first one
    const ShellSettings& settings() const { return m_settings; }
    int vertexCount() const { return static_cast<int>(m_x.cols()); }
    const Points& restPositions() const { return m_rest; }
    const Points& positions() const { return m_x; }   ///< [m]
    const Points& velocities() const { return m_v; }  ///< [m/s]: what the next `advance` moves with
    double meanEdge() const { return m_meanEdge; }    ///< of the lengths of the edges at rest [m]
    double bendingLength(double h) const;             ///< over which bending spreads in a step: (h^2 D/rho t)^1/4 [m]
    bool isStiff(double h) const;                     ///< whether that is several edges: vertices move together
    bool isStiffAsAWhole(double h) const;             ///< whether all of it feels a corner within a few steps
    double side() const;                              ///< of a square with as many triangles of such edges [m]
    const Eigen::VectorXd& masses() const { return m_mass; }  ///< lumped, [kg]

    /// Place and motion; sizes must match (throws std::invalid_argument), values must be finite.
    void setPositions(const Points& x);
    void setVelocities(const Points& v);

    /// Holds a vertex where it is, or moves it to `target` during the next step.
    void pin(int vertex);
    void movePin(int vertex, const Vec3& target);
    void unpin(int vertex);
    bool isPinned(int vertex) const { return m_pinned[vertex] != 0; }
    const Vec3& pinTarget(int vertex) const { return m_pinTarget.at(vertex); }  ///< of a pinned one
    int pinCount() const { return m_pinCount; }

    /// Holds a vertex in one direction: it slides freely across it. Up to three directions add up; unpin frees it.
    void guide(int vertex, const Vec3& direction);
    bool isGuided(int vertex) const { return !m_freedom.empty() && !m_pinned[vertex] && m_guided[vertex]; }
    /// Projector on the directions in which a vertex may move.
    Mat3 freedom(int vertex) const;

    /// Pins an edge of the shell together with its tangent plane. Fixing two rows of vertices instead would clamp half
    /// a cell too late. All vertices given are pinned; those that have free neighbours must lie on one line (or on one
    /// plane that the shell leaves at a right angle). `direction`: along which the shell leaves the clamp [any length];
    /// without it, as it does now. Only patch bending can hold the tangent: with other models this pins and no more.
    void clamp(const std::vector<int>& vertices, std::optional<Vec3> direction = {});
    /// Says that the shell goes on beyond these border vertices as its mirror image: they are guided along the plane's
    /// normal, and the tangent there stays at right angles to the plane. For halves and quarters of symmetric scenes.
    void mirror(const std::vector<int>& vertices, const Vec3& normal);

    /// Another rest shape for the same triangles [m], with its own lengths and curvature. What has been bent or
    /// stretched for good is forgotten. Throws std::invalid_argument as the constructor does.
    void setRestPositions(const Points& rest);
    /// Bending forgets the curvature of the rest shape: the shell wants to be flat.
    void flattenRest();

    /// Constant force on a vertex [N], besides gravity.
    void setForce(int vertex, const Vec3& force);
    const Points& forces() const { return m_force; }
    /// Pressure on the side that the normals point away from, so that > 0 inflates a closed shell [Pa].
    void setPressure(double pressure);
    double pressure() const { return m_pressure; }

    /// Changes whenever the caller changed the shell: state, supports, loads or rest shape; not as it moves by itself,
    /// nor by a pin, force or pressure that is set to what it is.
    unsigned revision() const { return m_revision; }

    ShellEnergy energy() const;
    double kineticEnergy() const;  ///< sum of 1/2 m v^2 over the vertices [J]
    /// The same with other velocities than the present ones.
    double kineticEnergy(const Eigen::Ref<const Points>& v) const;
    Vec3 linearMomentum() const;                    ///< [N s]
    Vec3 angularMomentum(const Vec3& about) const;  ///< [N m s]
    double maxStretch() const;                      ///< largest edge length / rest length - 1 [-]
    Points vertexNormals() const;                   ///< area weighted, unit
    /// Total elastic energy at other positions than the present ones [J].
    double elasticEnergy(const Points& x) const;
    /// Force that holds a pinned or guided vertex in static balance: what its own forces leave over [N].
    Vec3 reaction(int vertex, const Vec3& gravity) const;
    /// Where it yielded when it last moved.
    const Dent& lastDent() const { return m_dent; }
    /// Internal forces -dW/dx of the current shape, without damping [N].
    Points elasticForces() const;

    /// One step without bodies or contacts: solve for velocities, then move.
    StepReport step(double h, const Vec3& gravity, const Wind* wind = nullptr);
    /// Steps over a duration [s] in as many steps as `control` asks for, without bodies.
    AdaptiveReport stepAdaptively(double duration, const Vec3& gravity, AdaptiveStep& control,
                                  const Wind* wind = nullptr);
    /// Moves every vertex by h v, after a solve.
    void advance(double h);
    /// Puts a vertex somewhere without touching its velocity: for contacts carried along by their body.
    void displace(int vertex, const Vec3& by);

  private:
    friend class IslandSolver;
    friend class StaticSolver;
    friend class StepParts;
    void rebuild();  ///< energies, after the rest shape or how it is clamped changed
    void setMasses();
    void flow();
    void requireVertex(int vertex, const char* what) const;  ///< throws std::out_of_range
    std::unique_ptr<HalfEdgeMesh> m_mesh;
    ShellSettings m_settings;
    Points m_rest, m_x, m_v, m_force;
    Points m_y;               ///< what the next `advance` adds besides m_stride times velocity [m]
    double m_stride = 1.0;    ///< part of the step that velocities count for in it (BDF2: gamma)
    Points m_lastX, m_lastV;  ///< a step ago, for BDF2
    double m_lastH = 0.0;     ///< length of that step; 0: there is none [s]
    Eigen::VectorXd m_mass;
    Eigen::VectorXd m_restLength;  ///< of the mesh's edges [m]
    double m_meanEdge = 0.0;       ///< [m]
    std::vector<char> m_pinned;
    std::map<int, Vec3> m_pinTarget;  ///< of pinned vertices
    std::vector<Mat3> m_freedom;      ///< of guided vertices; empty while there are none
    std::vector<char> m_guided;
    double m_plasticWork = 0.0;
    Dent m_dent;
    int m_pinCount = 0;
    unsigned m_revision = 0;
    double m_pressure = 0.0;
    std::unique_ptr<ShellDesign> m_design;      ///< rest shape beyond positions, materials
    std::unique_ptr<ShellAssembly> m_assembly;  ///< energies and the step's matrix
    std::unique_ptr<IslandSolver> m_ownSolver;  ///< for step()
};

}  // namespace jacket
