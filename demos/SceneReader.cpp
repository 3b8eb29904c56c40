#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "ModelNames.h"
#include "Scene.h"

namespace jacket::demo {

namespace fs = std::filesystem;

namespace {

using Names = std::vector<std::string>;

constexpr std::array kSceneKeys{"name",        "description",     "dt",      "substeps", "seconds", "seed",
                                "mode",        "load_increments", "gravity", "wind",     "shells",  "bodies",
                                "multibodies", "probes",          "camera"};
constexpr std::array kShellKeys{"name",           "mesh",
                                "initial_shape",  "transform",
                                "material",       "membrane",
                                "bending",        "friction",
                                "restitution",    "tolerance",
                                "max_iterations", "pin",
                                "clamp",          "guide",
                                "regions",        "plasticity",
                                "flatten_rest",   "force",
                                "pressure",       "initial_velocity",
                                "integrator",     "contact_thickness",
                                "perturbation",   "self_collision",
                                "sleeping"};
constexpr std::array kBodyKeys{
    "name",     "shape",       "mass",     "position", "rotation_deg", "velocity", "angular_velocity",
    "friction", "restitution", "kinematic"};
constexpr std::array kMultiBodyKeys{"name", "base", "links"};
constexpr std::array kBaseKeys{"shape", "mass", "position", "friction", "restitution"};
constexpr std::array kLinkKeys{"name",     "parent", "shape",  "mass",     "joint",      "pivot",
                               "position", "motor",  "limits", "friction", "restitution"};
constexpr std::array kProbeKeys{"name", "shell", "body", "box", "vertices", "quantity"};
constexpr std::array kMaterialKeys{
    "preset",      "young",      "poisson",           "thickness",         "density",      "yield",
    "hardening",   "orthotropy", "stretch_stiffness", "bending_stiffness", "area_density", "stiffness_damping",
    "mass_damping"};
constexpr Range kRestitution{.low = 0, .high = 1};

/// Before anything else is said about an object: a misspelt key explains more than a missing one.
void checkKeys(ObjectReader& in, std::span<const char* const> known) {
    for (const char* key : known) in.find(key);
    in.finish();
}

fs::path readFile(ObjectReader& in, std::string_view key, const fs::path& folder) {
    const fs::path given = in.text(key);
    const fs::path besideScene = folder / given;
    std::error_code ignored;
    for (const fs::path& file : {besideScene, given})
        if (fs::is_regular_file(file, ignored)) return fs::weakly_canonical(file);
    throw InputError(in.label(key) + ": there is no file " + besideScene.lexically_normal().string());
}

/// Of a direction that the scene keeps at length 1. One that has it but for rounding keeps its bits: normalised again
/// with every reading, a scene that was written and read would end elsewhere.
double lengthOf(const Vec3& direction) {
    constexpr double kRounding = 8 * std::numeric_limits<double>::epsilon();
    const double length = direction.norm();
    return std::abs(length - 1.0) <= kRounding ? 1.0 : length;
}

Eigen::Vector2i readCells(ObjectReader& in, std::string_view key, int low) {
    const auto cells = in.numbers(key, 2, Range{.low = static_cast<double>(low), .high = 10000});
    for (const double n : cells)
        if (n != std::floor(n)) in.fail(key, "must be two whole numbers, got " + shortNumber(n));
    return {static_cast<int>(cells[0]), static_cast<int>(cells[1])};
}

GridOptions readGrid(ObjectReader in) {
    const auto size = in.numbers("size", 2, Range::positive("m"));
    GridOptions grid{.size = {size[0], size[1]}, .cells = readCells(in, "cells", 1)};
    const Names diagonals{"right", "alternating", "equilateral"}, planes{"xz", "xy", "yz"};
    const std::string diagonal = in.choice("diagonals", diagonals, "right"), plane = in.choice("plane", planes, "xz");
    grid.diagonals =
        static_cast<GridDiagonals>(std::find(diagonals.begin(), diagonals.end(), diagonal) - diagonals.begin());
    grid.plane = static_cast<GridPlane>(std::find(planes.begin(), planes.end(), plane) - planes.begin());
    in.finish();
    return grid;
}

HemisphereMesh readHemisphere(ObjectReader in) {
    const HemisphereMesh mesh{.radius = in.number("radius", Range::positive("m")), .rings = in.integer("rings", 1)};
    in.finish();
    return mesh;
}

TubeMesh readTube(ObjectReader in) {
    TubeMesh mesh{.radius = in.number("radius", Range::positive("m")),
                  .height = in.number("height", Range::positive("m")),
                  .cells = readCells(in, "cells", 1)};
    if (mesh.cells.x() < 3)
        in.fail("cells", "must have at least 3 cells around, got " + std::to_string(mesh.cells.x()));
    in.finish();
    return mesh;
}

MeshSource readMesh(ObjectReader in, const fs::path& folder) {
    static const Names kinds{"file", "grid", "hemisphere", "cylinder"};
    const std::string kind = in.oneOf(kinds);
    in.finish();
    if (kind == "file") return MeshFile{readFile(in, kind, folder)};
    if (kind == "grid") return readGrid(in.object(kind));
    if (kind == "hemisphere") return readHemisphere(in.object(kind));
    return readTube(in.object(kind));
}

Transform readPose(ObjectReader& in) {
    return {.position = in.vector("position", Vec3::Zero()), .rotationDeg = in.vector("rotation_deg", Vec3::Zero())};
}

Selection readSelection(ObjectReader& in) {
    static const Names kinds{"box", "vertices"};
    if (in.oneOf(kinds) == "vertices") return {in.indices("vertices"), in.label()};
    const Json& box = in.require("box");
    if (!box.is_array() || box.size() != 2) in.fail("box", "must be [[min x, y, z], [max x, y, z]]");
    const Json corners{{"0", box[0]}, {"1", box[1]}};
    ObjectReader reader(corners, in.path("box"), in.source());
    const Selection::Bounds bounds{reader.vector("0"), reader.vector("1")};
    if ((bounds.min.array() > bounds.max.array()).any()) in.fail("box", "must have its smaller corner first");
    return {bounds, in.label()};
}

std::optional<double> readOverride(ObjectReader& in, std::string_view key, const Range& range,
                                   std::optional<double> fallback) {
    return in.has(key) ? in.optionalNumber(key, range) : fallback;
}

ShellMaterial::Orthotropy readOrthotropy(ObjectReader in) {
    static constexpr std::array kKeys{"weft_young", "shear", "warp"};
    checkKeys(in, kKeys);
    ShellMaterial::Orthotropy orthotropy;
    orthotropy.weftYoung = in.number("weft_young", Range::positive("Pa"));
    orthotropy.shear = in.number("shear", Range::positive("Pa"));
    orthotropy.warpDirection = in.vector("warp", orthotropy.warpDirection);
    if (!(orthotropy.warpDirection.norm() > 0)) in.fail("warp", "must be a direction, got [0, 0, 0]");
    return orthotropy;
}

/// What no range of a single field says: no pair of stretches may release energy.
void requirePositiveDefinite(ObjectReader& in, const ShellMaterial& m) {
    try {
        validate(m);
    } catch (const std::invalid_argument& error) {
        in.fail("orthotropy", std::string("must be positive definite: ") + error.what());
    }
}

/// Fields on top of `material`. What nothing else determines must be given: `start` is a whole preset, or absent.
ShellMaterial readMaterialFields(ObjectReader& in, const std::optional<ShellMaterial>& start) {
    ShellMaterial material = start.value_or(ShellMaterial{});
    const bool stiffnessKnown = start || (in.has("stretch_stiffness") && in.has("bending_stiffness"));
    const bool massKnown = start || in.has("area_density");
    const auto fallback = [](bool known, double value) { return known ? std::optional(value) : std::nullopt; };
    material.young = in.number("young", Range::positive("Pa"), fallback(stiffnessKnown, material.young));
    material.poisson = in.number("poisson", Range{.low = -1, .includesLow = false, .high = 0.5}, material.poisson);
    material.thickness =
        in.number("thickness", Range::positive("m"), fallback(stiffnessKnown && massKnown, material.thickness));
    material.density = in.number("density", Range::positive("kg/m^3"), fallback(massKnown, material.density));
    material.stretchStiffnessOverride =
        readOverride(in, "stretch_stiffness", Range::positive("N/m"), material.stretchStiffnessOverride);
    material.bendingStiffnessOverride =
        readOverride(in, "bending_stiffness", Range::nonNegative("N m"), material.bendingStiffnessOverride);
    material.areaDensityOverride =
        readOverride(in, "area_density", Range::positive("kg/m^2"), material.areaDensityOverride);
    material.stiffnessDamping = in.number("stiffness_damping", Range::nonNegative("s"), material.stiffnessDamping);
    material.massDamping = in.number("mass_damping", Range::nonNegative("1/s"), material.massDamping);
    if (in.has("yield")) material.yieldStress = in.number("yield", Range::positive("Pa"));
    material.hardening = in.number("hardening", Range::nonNegative("Pa"), material.hardening);
    if (in.has("orthotropy")) {
        material.orthotropy = readOrthotropy(in.object("orthotropy"));
        requirePositiveDefinite(in, material);
    }
    return material;
}

const materials::Preset& findPreset(const std::string& name, const std::string& label) {
    Names names;
    for (const auto& preset : materials::presets()) {
        if (preset.name == name) return preset;
        names.emplace_back(preset.name);
    }
    throw InputError(label + ": unknown material \"" + name + "\"" + suggestion(name, names));
}

void readMaterial(ObjectReader& in, ShellDescription& shell) {
    const Json& value = in.require("material");
    if (value.is_string()) {
        shell.preset = value.get<std::string>();
        const auto& preset = findPreset(shell.preset, in.label("material"));
        shell.material = preset.make(preset.usual.thickness);
        return;
    }
    ObjectReader fields = in.object("material");
    checkKeys(fields, kMaterialKeys);
    shell.preset = fields.text("preset", "");
    std::optional<ShellMaterial> start;
    if (!shell.preset.empty()) {
        const auto& preset = findPreset(shell.preset, fields.label("preset"));
        start = preset.make(fields.number("thickness", Range::positive("m"), preset.usual.thickness));
    }
    shell.material = readMaterialFields(fields, start);
}

Vec3 readDirection(ObjectReader& in) {
    const Vec3 direction = in.vector("direction");
    if (!(direction.norm() > 0)) in.fail("direction", "must not be zero");
    return direction / lengthOf(direction);
}

template <class Variant>
Variant readModel(ObjectReader& in, std::string_view key) {
    const Json* value = in.find(key);
    if (!value) return Variant{};
    std::string name;
    if (value->is_object()) {
        ObjectReader model = in.object(key);
        name = model.text("model");
        Variant result = modelByName<Variant>(name, model.label("model"));
        std::visit([&](auto& m) { readParameters(model, m); }, result);
        model.finish();
        return result;
    }
    return modelByName<Variant>(in.text(key), in.label(key));
}

void readNotYet(ObjectReader& in) {
    if (in.flag("self_collision", false)) in.notYet("self_collision", "self-collision");
}

/// How edges and vertices are held besides pins.
void readSupports(ObjectReader& in, ShellDescription& shell) {
    in.forEach("clamp", [&](ObjectReader clamp) {
        Clamp entry{readSelection(clamp), {}};
        if (clamp.has("direction")) entry.direction = readDirection(clamp);
        shell.clamps.push_back(std::move(entry));
        clamp.finish();
    });
    in.forEach("guide", [&](ObjectReader guide) {
        shell.guides.push_back({readSelection(guide), readDirection(guide)});
        guide.finish();
    });
}

void readRegions(ObjectReader& in, ShellDescription& shell) {
    in.forEach("regions", [&](ObjectReader region) {
        const Selection where = readSelection(region);
        const auto* box = std::get_if<Selection::Bounds>(&where.what);
        if (!box) region.fail("vertices", "regions are boxes: the triangles whose centres lie inside");
        ShellDescription part;
        readMaterial(region, part);
        shell.regions.push_back({*box, region.label(), part.material});
        region.finish();
    });
}

void readMotion(ObjectReader& in, ShellDescription& shell) {
    static const Names integrators{"backward-euler", "newton", "bdf2"};
    const std::string integrator = in.choice("integrator", integrators, "backward-euler");
    shell.integrator = integrator == "newton" ? Integrator::Newton
                       : integrator == "bdf2" ? Integrator::Bdf2
                                              : Integrator::BackwardEuler;
    bool yields = shell.material.yieldStress.has_value();
    for (const Region& region : shell.regions) yields = yields || region.material.yieldStress.has_value();
    shell.plasticity = in.flag("plasticity", yields);
    shell.flattenRest = in.flag("flatten_rest", false);
}

ShellDescription readShell(ObjectReader in, const fs::path& folder, std::size_t index) {
    ShellDescription shell;
    shell.name = in.text("name", "shell" + std::to_string(index));
    shell.label = in.label();
    checkKeys(in, kShellKeys);
    shell.mesh = readMesh(in.object("mesh"), folder);
    if (in.has("initial_shape")) shell.initialShape = readMesh(in.object("initial_shape"), folder);
    if (in.has("transform")) {
        ObjectReader transform = in.object("transform");
        shell.transform = readPose(transform);
        transform.finish();
    }
    readMaterial(in, shell);
    readRegions(in, shell);
    readMotion(in, shell);
    shell.membrane = readModel<MembraneModel>(in, "membrane");
    shell.bending = readModel<BendingModel>(in, "bending");
    shell.friction = in.number("friction", Range::nonNegative(), shell.friction);
    shell.restitution = in.number("restitution", kRestitution, shell.restitution);
    shell.tolerance = in.number("tolerance", Range{.low = 0, .includesLow = false, .high = 1}, shell.tolerance);
    shell.maxIterations = in.integer("max_iterations", 1, shell.maxIterations);
    shell.contactThickness = in.number("contact_thickness", Range::nonNegative("m"), shell.contactThickness);
    in.forEach("pin", [&](ObjectReader pin) {
        shell.pins.push_back(readSelection(pin));
        pin.finish();
    });
    readSupports(in, shell);
    in.forEach("force", [&](ObjectReader force) {
        shell.loads.push_back({readSelection(force), force.vector("total")});
        force.finish();
    });
    shell.pressure = in.number("pressure", Range::any("Pa"), shell.pressure);
    shell.initialVelocity = in.vector("initial_velocity", Vec3::Zero());
    shell.perturbation = in.number("perturbation", Range::nonNegative("m"), shell.perturbation);
    shell.sleeping = in.flag("sleeping", shell.sleeping);
    readNotYet(in);
    return shell;
}

Plane readPlane(ObjectReader& in) {
    const auto plane = in.numbers("plane", 4, Range::any());
    const Vec3 normal(plane[0], plane[1], plane[2]);
    if (!(normal.norm() > 0)) in.fail("plane", "[nx, ny, nz, d] must have a normal that is not zero");
    return {normal / lengthOf(normal), plane[3] / lengthOf(normal)};
}

Shape readShape(ObjectReader& in, const fs::path& folder);

/// Each part has its shape, position and rotation side by side.
Compound readCompound(ObjectReader& in, const fs::path& folder) {
    Compound compound;
    in.forEach("compound", [&](ObjectReader part) {
        const Transform transform = readPose(part);
        compound.parts.push_back({readShape(part, folder), transform});
        if (std::holds_alternative<Plane>(compound.parts.back().shape))
            part.fail("plane", "is endless: it can only be a body of its own");
    });
    if (compound.parts.empty()) in.fail("compound", "must have at least one part");
    return compound;
}

Shape readShape(ObjectReader& in, const fs::path& folder) {
    static const Names kinds{"sphere", "box", "capsule", "cylinder", "cone", "plane", "hull", "mesh", "compound"};
    const std::string kind = in.oneOf(kinds);
    in.finish();
    if (kind == "sphere") return Sphere{in.number(kind, Range::positive("m"))};
    if (kind == "plane") return readPlane(in);
    if (kind == "hull") return Hull{readFile(in, kind, folder), nullptr};
    if (kind == "mesh") return Mesh{readFile(in, kind, folder), nullptr};
    if (kind == "compound") return readCompound(in, folder);
    const auto sizes = in.numbers(kind, kind == "box" ? 3 : 2, Range::positive("m"));
    if (kind == "box") return Box{{sizes[0], sizes[1], sizes[2]}};
    if (kind == "capsule") return Capsule{sizes[0], sizes[1]};
    if (kind == "cylinder") return Cylinder{sizes[0], sizes[1]};
    return Cone{sizes[0], sizes[1]};
}

bool hasMesh(const Shape& shape) {
    const auto* compound = std::get_if<Compound>(&shape);
    return std::holds_alternative<Mesh>(shape) ||
           (compound && std::any_of(compound->parts.begin(), compound->parts.end(),
                                    [](const CompoundPart& part) { return hasMesh(part.shape); }));
}

/// Refuses what would silently do nothing.
void checkBody(const ObjectReader& in, const BodyDescription& body) {
    const bool moves = body.velocity.norm() > 0 || body.angularVelocity.norm() > 0;
    if (!body.kinematic.empty() && body.mass > 0)
        in.fail("kinematic", "needs mass 0: nothing can push a body whose motion is given");
    if (body.mass == 0 && moves)
        in.fail("velocity", "needs a mass > 0, or \"kinematic\": a body of mass 0 stands still");
    if (std::holds_alternative<Plane>(body.shape) && (body.mass > 0 || !body.kinematic.empty()))
        in.fail("shape", "is a plane, which must be static: mass 0 and not kinematic");
    if (hasMesh(body.shape) && body.mass > 0)
        in.fail("shape", "is a triangle mesh, which needs mass 0; use \"hull\" for moving bodies");
}

/// One phase, or a list of them in order of time.
std::vector<Kinematic> readKinematic(ObjectReader& in) {
    std::vector<Kinematic> phases;
    const auto read = [&](ObjectReader motion) {
        const double start = phases.empty() ? 0.0 : phases.back().until;
        phases.push_back({motion.vector("velocity"), motion.number("until", Range::nonNegative("s"), 1e9)});
        if (phases.back().until < start) motion.fail("until", "must not be before the phase that precedes it ends");
        motion.finish();
    };
    const Json* value = in.find("kinematic");
    if (value && value->is_array())
        in.forEach("kinematic", read);
    else if (value)
        read(in.object("kinematic"));
    return phases;
}

BodyDescription readBody(ObjectReader in, const fs::path& folder, std::size_t index) {
    BodyDescription body;
    body.name = in.text("name", "body" + std::to_string(index));
    body.label = in.label();
    checkKeys(in, kBodyKeys);
    ObjectReader shape = in.object("shape");
    body.shape = readShape(shape, folder);
    body.mass = in.number("mass", Range::nonNegative("kg"), body.mass);
    body.transform = readPose(in);
    body.velocity = in.vector("velocity", Vec3::Zero());
    body.angularVelocity = in.vector("angular_velocity", Vec3::Zero());
    body.friction = in.number("friction", Range::nonNegative(), body.friction);
    body.restitution = in.number("restitution", kRestitution, body.restitution);
    body.kinematic = readKinematic(in);
    checkBody(in, body);
    return body;
}

/// What bodies of multibodies have in common with others.
BodyDescription readJointedBody(ObjectReader& in, const fs::path& folder) {
    BodyDescription body;
    body.label = in.label();
    ObjectReader shape = in.object("shape");
    body.shape = readShape(shape, folder);
    if (std::holds_alternative<Plane>(body.shape)) in.fail("shape", "is a plane, which cannot be jointed");
    body.transform.position = in.vector("position", Vec3::Zero());
    body.friction = in.number("friction", Range::nonNegative(), body.friction);
    body.restitution = in.number("restitution", kRestitution, body.restitution);
    body.isOfMultiBody = true;
    return body;
}

Joint readJointKind(ObjectReader in) {
    static const Names kinds{"fixed", "prismatic", "revolute"};
    const std::string kind = in.oneOf(kinds);
    in.finish();
    Joint joint;
    if (kind == "fixed") {
        if (!in.flag(kind, true)) in.fail(kind, "must be true");
        return joint;
    }
    joint.kind = kind == "prismatic" ? Joint::Kind::Prismatic : Joint::Kind::Revolute;
    joint.axis = in.vector(kind);
    if (!(joint.axis.norm() > 0)) in.fail(kind, "must be an axis, got [0, 0, 0]");
    joint.axis /= lengthOf(joint.axis);
    return joint;
}

Joint readJoint(ObjectReader& in, const Vec3& position) {
    Joint joint = readJointKind(in.object("joint"));
    joint.pivot = in.vector("pivot", position);
    in.forEach("motor", [&](ObjectReader phase) {
        const double start = joint.motor.empty() ? 0.0 : joint.motor.back().until;
        joint.motor.push_back({phase.number("velocity", Range::any("m/s or rad/s")),
                               phase.number("max_force", Range::nonNegative("N or N m")),
                               phase.number("until", Range::nonNegative("s"), 1e9)});
        if (joint.motor.back().until < start) phase.fail("until", "must not be before the phase that precedes it ends");
        phase.finish();
    });
    if (in.has("limits")) {
        const auto limits = in.numbers("limits", 2, Range::any("m or rad"));
        if (!(limits[0] <= 0.0 && limits[1] >= 0.0)) in.fail("limits", "must be [low <= 0, high >= 0]");
        joint.limits = {limits[0], limits[1]};
    }
    if (joint.kind == Joint::Kind::Fixed && (!joint.motor.empty() || joint.limits))
        in.fail("joint", "is fixed, and can have neither a motor nor limits");
    return joint;
}

/// Its base and links join the scene's bodies.
void readMultiBody(ObjectReader in, const fs::path& folder, Scene& scene) {
    checkKeys(in, kMultiBodyKeys);
    MultiBodyDescription multiBody;
    multiBody.name = in.text("name", "multibody" + std::to_string(scene.multiBodies.size()));
    ObjectReader base = in.object("base");
    checkKeys(base, kBaseKeys);
    multiBody.base = static_cast<int>(scene.bodies.size());
    scene.bodies.push_back(readJointedBody(base, folder));
    scene.bodies.back().name = multiBody.name;
    scene.bodies.back().mass = base.number("mass", Range::nonNegative("kg"), 0.0);
    Names parents{"base"};
    in.forEach("links", [&](ObjectReader link) {
        checkKeys(link, kLinkKeys);
        BodyDescription body = readJointedBody(link, folder);
        body.name = link.text("name");
        body.mass = link.number("mass", Range::positive("kg"));
        const std::string parent = link.choice("parent", parents, "base");
        const auto index = std::find(parents.begin(), parents.end(), parent) - parents.begin();
        multiBody.links.push_back({static_cast<int>(scene.bodies.size()), static_cast<int>(index) - 1,
                                   readJoint(link, body.transform.position)});
        parents.push_back(body.name);
        scene.bodies.push_back(std::move(body));
    });
    scene.multiBodies.push_back(std::move(multiBody));
}

template <class Things>
int indexByName(ObjectReader& in, std::string_view key, const Things& things) {
    Names names;
    for (const auto& thing : things) names.push_back(thing.name);
    const std::string name = in.choice(key, names, {});
    return static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin());
}

ProbeDescription readProbe(ObjectReader in, const Scene& scene) {
    static const Names targets{"shell", "body"}, ofBody{"position", "velocity"};
    static const Names ofShell{"mean_position", "max_displacement", "reaction", "elastic_force"};
    checkKeys(in, kProbeKeys);
    ProbeDescription probe;
    probe.name = in.text("name");
    probe.label = in.label();
    if (in.oneOf(targets) == "body") {
        probe.body = indexByName(in, "body", scene.bodies);
        probe.quantity = in.choice("quantity", ofBody, {});
    } else {
        probe.shell = indexByName(in, "shell", scene.shells);
        if (in.has("box") || in.has("vertices")) probe.where = readSelection(in);
        probe.quantity = in.choice("quantity", ofShell, {});
    }
    return probe;
}

std::optional<Wind> readWind(ObjectReader& in) {
    const Json* value = in.find("wind");
    if (!value) return std::nullopt;
    if (!value->is_object()) return Wind{.velocity = in.vector("wind")};
    ObjectReader air = in.object("wind");
    Wind wind;
    wind.velocity = air.vector("velocity");
    wind.airDensity = air.number("air_density", Range::nonNegative("kg/m^3"), wind.airDensity);
    wind.normalDrag = air.number("normal_drag", Range::nonNegative(), wind.normalDrag);
    wind.tangentialDrag = air.number("tangential_drag", Range::nonNegative(), wind.tangentialDrag);
    air.finish();
    return wind;
}

CameraDescription readCamera(ObjectReader in) {
    CameraDescription camera;
    if (in.has("eye")) camera.eye = in.vector("eye");
    if (in.has("target")) camera.target = in.vector("target");
    camera.fovDegrees = in.number("fov_deg", Range{.unit = "degrees", .low = 1, .high = 150}, camera.fovDegrees);
    in.finish();
    if (camera.eye && camera.target && (*camera.eye - *camera.target).norm() < 1e-9)
        in.fail("eye", "must not be where the target is");
    return camera;
}

/// Parts of a frame. A million take a minute in the smallest scene, hours in others: more are a slip of the keyboard.
int readParts(ObjectReader& in, std::string_view key, int fallback) {
    constexpr int kMost = 1000000;
    const int parts = in.integer(key, 1, fallback);
    if (parts > kMost) in.fail(key, "must be <= " + std::to_string(kMost) + ", got " + std::to_string(parts));
    return parts;
}

/// Numbers of the whole run.
void readRun(ObjectReader& in, Scene& scene) {
    scene.description = in.text("description", "");
    scene.name = in.text("name", scene.name);
    scene.dt = in.duration("dt", scene.dt);
    scene.substeps = readParts(in, "substeps", scene.substeps);
    scene.seconds = in.duration("seconds", scene.seconds);
    scene.seed = static_cast<std::uint64_t>(in.integer("seed", 0, 0));
    scene.gravity = in.vector("gravity", scene.gravity);
    scene.wind = readWind(in);
    if (in.has("camera")) scene.camera = readCamera(in.object("camera"));
    static const Names modes{"dynamic", "static"};
    scene.isStatic = in.choice("mode", modes, "dynamic") == "static";
    scene.loadIncrements = readParts(in, "load_increments", scene.loadIncrements);
    constexpr double kMostFrames = 1e8;
    if (scene.seconds / scene.dt > kMostFrames)
        in.fail("seconds", "[s] must be <= 1e8 frames of dt, got " + shortNumber(scene.seconds));
}

template <class Things>
void requireDistinctNames(const Things& things, std::string_view what) {
    for (std::size_t i = 0; i < things.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            if (things[i].name == things[j].name)
                throw InputError(things[i].label + ".name: two " + std::string(what) + " are called \"" +
                                 things[i].name + "\"");
}

}  // namespace

Scene readScene(const Json& document, const SceneOrigin& origin) {
    ObjectReader in(document, "", origin.source);
    Scene scene;
    scene.name = fs::path(origin.source.file).stem().string();
    checkKeys(in, kSceneKeys);
    readRun(in, scene);
    in.forEach("shells", [&](ObjectReader shell) {
        scene.shells.push_back(readShell(std::move(shell), origin.folder, scene.shells.size()));
    });
    in.forEach("bodies", [&](ObjectReader body) {
        scene.bodies.push_back(readBody(std::move(body), origin.folder, scene.bodies.size()));
    });
    in.forEach("multibodies", [&](ObjectReader body) { readMultiBody(std::move(body), origin.folder, scene); });
    if (scene.shells.empty()) throw InputError(in.label("shells") + " must have at least one shell");
    requireDistinctNames(scene.shells, "shells");
    requireDistinctNames(scene.bodies, "bodies");
    in.forEach("probes", [&](ObjectReader probe) { scene.probes.push_back(readProbe(std::move(probe), scene)); });
    requireDistinctNames(scene.probes, "probes");
    return scene;
}

}  // namespace jacket::demo
