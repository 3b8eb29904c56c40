#pragma once
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "Json.h"
#include "Shape.h"
#include "jacket/Shell.h"
#include "jacket/TriangleMesh.h"

/// What a scene file says, after every check that needs nothing but the file. SI units, y up.
namespace jacket::demo {

struct MeshFile {
    std::filesystem::path file;  ///< Wavefront OBJ
};
struct HemisphereMesh {
    double radius;  ///< [m]
    int rings;
};
struct TubeMesh {
    double radius, height;  ///< [m]
    Eigen::Vector2i cells;  ///< around, along
};
using MeshSource = std::variant<MeshFile, GridOptions, HemisphereMesh, TubeMesh>;

/// Vertices of one shell, by number or by an axis-aligned box in world coordinates.
struct Selection {
    struct Bounds {
        Vec3 min, max;  ///< [m]
    };
    std::variant<Bounds, std::vector<int>> what;
    std::string label;  ///< where the scene file says so, for messages

    /// Never empty: throws InputError when nothing is selected, or a vertex does not exist.
    std::vector<int> vertices(const Points& positions) const;
};

struct Load {
    Selection where;
    Vec3 total;  ///< [N]
};

/// An edge held together with its tangent.
struct Clamp {
    Selection where;
    std::optional<Vec3> direction;  ///< along which the shell leaves it; without it, as it does at the start
};

/// Vertices that slide freely across a direction.
struct Guide {
    Selection where;
    Vec3 direction;
};

/// Part of a shell that is of another material: the triangles whose centres lie in a box at the start.
struct Region {
    Selection::Bounds box;
    std::string label;
    ShellMaterial material;
};

struct ShellDescription {
    std::string name, label;
    MeshSource mesh;
    std::optional<MeshSource> initialShape;  ///< same triangles, deformed; without it the shell starts at rest
    Transform transform;
    std::string preset;  ///< name of the material preset, or ""
    ShellMaterial material;
    MembraneModel membrane;
    BendingModel bending;
    double friction = 0.5;         ///< [-]
    double restitution = 0.0;      ///< 0 to 1 [-]
    double tolerance = 1e-2;       ///< of the linear solve, relative
    int maxIterations = 1000;      ///< of one linear solve
    double contactThickness = -1;  ///< [m]; < 0: half the thickness
    Integrator integrator = Integrator::BackwardEuler;
    bool plasticity = false;   ///< keep bends and stretches beyond the yield stress
    bool flattenRest = false;  ///< bending forgets the curvature of the mesh
    bool sleeping = false;     ///< it may fall asleep; figures of a scene do not depend on it unless they ask to
    std::vector<Region> regions;
    std::vector<Selection> pins;
    std::vector<Clamp> clamps;
    std::vector<Guide> guides;
    std::vector<Load> loads;
    double pressure = 0.0;                ///< [Pa]
    Vec3 initialVelocity = Vec3::Zero();  ///< [m/s]
    double perturbation = 0.0;            ///< free vertices start up to this far away, at random [m]
};

/// Prescribed motion of a body, which goes on with the next such phase, and then stands still.
struct Kinematic {
    Vec3 velocity;  ///< [m/s]
    double until;   ///< [s]
};

struct BodyDescription {
    std::string name, label;
    Shape shape;
    double mass = 0.0;  ///< 0: static, or kinematic [kg]
    Transform transform;
    Vec3 velocity = Vec3::Zero();         ///< [m/s]
    Vec3 angularVelocity = Vec3::Zero();  ///< [rad/s]
    double friction = 0.5;                ///< [-]
    double restitution = 0.0;             ///< 0 to 1 [-]
    std::vector<Kinematic> kinematic;     ///< phases, in order of time; empty: not kinematic
    bool isOfMultiBody = false;           ///< base or link of one of Scene::multiBodies
};

/// What a motor of a joint does until some time; after the last phase it holds the joint with that phase's force.
struct MotorPhase {
    double velocity;  ///< of the joint that it aims at [m/s, rad/s]
    double maxForce;  ///< [N, N m]
    double until;     ///< [s]
};

struct Joint {
    enum class Kind { Fixed, Prismatic, Revolute };
    Kind kind = Kind::Fixed;
    Vec3 axis = Vec3::UnitY();                    ///< in the world at the start, unit
    Vec3 pivot = Vec3::Zero();                    ///< in the world at the start [m]
    std::vector<MotorPhase> motor;                ///< empty: the joint moves freely
    std::optional<std::array<double, 2>> limits;  ///< of its travel from the start [m, rad]
};

/// A link of a multibody: how one of the scene's bodies is joined to its parent.
struct LinkDescription {
    int body;    ///< in Scene::bodies
    int parent;  ///< among the links; -1: the base
    Joint joint;
};

/// Bodies joined in a tree (btMultiBody). The base is fixed if its mass is 0.
struct MultiBodyDescription {
    std::string name;
    int base;  ///< in Scene::bodies
    std::vector<LinkDescription> links;
};

struct ProbeDescription {
    std::string name, label;
    int shell = -1, body = -1;  ///< one of them
    std::optional<Selection> where;
    std::string quantity;
};

struct CameraDescription {
    std::optional<Vec3> eye, target;  ///< chosen so that the whole motion is seen when not given [m]
    double fovDegrees = 30.0;         ///< vertical
};

struct Scene {
    std::string name, description;
    double dt = 1.0 / 60.0;  ///< length of a frame [s]
    int substeps = 1;        ///< steps of a frame
    double seconds = 2.0;
    std::uint64_t seed = 0;
    Vec3 gravity{0, -9.81, 0};  ///< [m/s^2]
    std::optional<Wind> wind;
    bool isStatic = false;   ///< one frame, in which every shell goes to its equilibrium
    int loadIncrements = 1;  ///< in which gravity, forces and pressure grow there
    std::vector<ShellDescription> shells;
    std::vector<BodyDescription> bodies;
    std::vector<MultiBodyDescription> multiBodies;
    std::vector<ProbeDescription> probes;
    CameraDescription camera;

    int frames() const;  ///< fewest that cover `seconds`
    bool usesSeed() const;
    bool maySleep() const;  ///< bodies may if a shell may
};

/// Where relative file names in a scene are looked for.
struct SceneOrigin {
    JsonSource source;
    std::filesystem::path folder;
};

/// Checks and reads a whole scene; throws InputError naming file, path, value and rule.
Scene readScene(const Json& document, const SceneOrigin& origin);

/// The scene with every default written out and files absolute, so that readScene gives the same one again.
Json toJson(const Scene& scene);

}  // namespace jacket::demo
