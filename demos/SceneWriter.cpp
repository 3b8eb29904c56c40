#include <array>

#include "ModelNames.h"
#include "Scene.h"

namespace jacket::demo {

namespace {

Json toJson(const GridOptions& grid) {
    constexpr std::array kDiagonals{"right", "alternating", "equilateral"}, kPlanes{"xz", "xy", "yz"};
    return {{"size", {grid.size.x(), grid.size.y()}},
            {"cells", {grid.cells.x(), grid.cells.y()}},
            {"diagonals", kDiagonals[static_cast<std::size_t>(grid.diagonals)]},
            {"plane", kPlanes[static_cast<std::size_t>(grid.plane)]}};
}

struct MeshToJson {
    Json operator()(const MeshFile& mesh) const { return {{"file", mesh.file.string()}}; }
    Json operator()(const GridOptions& grid) const { return {{"grid", toJson(grid)}}; }
    Json operator()(const HemisphereMesh& mesh) const {
        return {{"hemisphere", {{"radius", mesh.radius}, {"rings", mesh.rings}}}};
    }
    Json operator()(const TubeMesh& mesh) const {
        return {{"cylinder",
                 {{"radius", mesh.radius}, {"height", mesh.height}, {"cells", {mesh.cells.x(), mesh.cells.y()}}}}};
    }
};

struct ShapeToJson {
    Json operator()(const Sphere& s) const { return {{"sphere", s.radius}}; }
    Json operator()(const Box& s) const { return {{"box", demo::toJson(s.size)}}; }
    Json operator()(const Capsule& s) const { return {{"capsule", {s.radius, s.height}}}; }
    Json operator()(const Cylinder& s) const { return {{"cylinder", {s.radius, s.height}}}; }
    Json operator()(const Cone& s) const { return {{"cone", {s.radius, s.height}}}; }
    Json operator()(const Plane& s) const { return {{"plane", {s.normal.x(), s.normal.y(), s.normal.z(), s.offset}}}; }
    Json operator()(const Hull& s) const { return {{"hull", s.file.string()}}; }
    Json operator()(const Mesh& s) const { return {{"mesh", s.file.string()}}; }
    Json operator()(const Compound& s) const {
        Json parts = Json::array();
        for (const CompoundPart& part : s.parts) {
            parts.push_back(std::visit(*this, part.shape));
            parts.back()["position"] = demo::toJson(part.transform.position);
            parts.back()["rotation_deg"] = demo::toJson(part.transform.rotationDeg);
        }
        return {{"compound", parts}};
    }
};

Json toJson(const Selection& selection) {
    if (const auto* vertices = std::get_if<std::vector<int>>(&selection.what)) return {{"vertices", *vertices}};
    const auto& box = std::get<Selection::Bounds>(selection.what);
    return {{"box", Json::array({demo::toJson(box.min), demo::toJson(box.max)})}};
}

Json toJson(const ShellMaterial& material) {
    Json json{{"young", material.young},
              {"poisson", material.poisson},
              {"thickness", material.thickness},
              {"density", material.density}};
    if (material.stretchStiffnessOverride) json["stretch_stiffness"] = *material.stretchStiffnessOverride;
    if (material.bendingStiffnessOverride) json["bending_stiffness"] = *material.bendingStiffnessOverride;
    if (material.areaDensityOverride) json["area_density"] = *material.areaDensityOverride;
    if (material.yieldStress) json["yield"] = *material.yieldStress;
    if (material.hardening > 0) json["hardening"] = material.hardening;
    if (const auto& weave = material.orthotropy)
        json["orthotropy"] = {
            {"weft_young", weave->weftYoung}, {"shear", weave->shear}, {"warp", demo::toJson(weave->warpDirection)}};
    json["stiffness_damping"] = material.stiffnessDamping;
    json["mass_damping"] = material.massDamping;
    return json;
}

Json toJson(const Transform& pose) {
    return {{"position", demo::toJson(pose.position)}, {"rotation_deg", demo::toJson(pose.rotationDeg)}};
}

Json toJson(const ShellDescription& shell) {
    Json json{{"name", shell.name}, {"mesh", std::visit(MeshToJson{}, shell.mesh)}};
    if (shell.initialShape) json["initial_shape"] = std::visit(MeshToJson{}, *shell.initialShape);
    json["transform"] = toJson(shell.transform);
    json["material"] = toJson(shell.material);
    json["membrane"] = modelToJson(shell.membrane);
    json["bending"] = modelToJson(shell.bending);
    json["integrator"] = shell.integrator == Integrator::Newton ? "newton"
                         : shell.integrator == Integrator::Bdf2 ? "bdf2"
                                                                : "backward-euler";
    json["plasticity"] = shell.plasticity;
    json["flatten_rest"] = shell.flattenRest;
    json["friction"] = shell.friction;
    json["restitution"] = shell.restitution;
    json["tolerance"] = shell.tolerance;
    json["max_iterations"] = shell.maxIterations;
    if (shell.contactThickness >= 0) json["contact_thickness"] = shell.contactThickness;
    json["self_collision"] = false;
    json["pin"] = Json::array();
    for (const Selection& pin : shell.pins) json["pin"].push_back(toJson(pin));
    for (const char* key : {"clamp", "guide", "regions"}) json[key] = Json::array();
    for (const Clamp& clamp : shell.clamps) {
        json["clamp"].push_back(toJson(clamp.where));
        if (clamp.direction) json["clamp"].back()["direction"] = demo::toJson(*clamp.direction);
    }
    for (const Guide& guide : shell.guides) {
        json["guide"].push_back(toJson(guide.where));
        json["guide"].back()["direction"] = demo::toJson(guide.direction);
    }
    for (const Region& region : shell.regions)
        json["regions"].push_back({{"box", {demo::toJson(region.box.min), demo::toJson(region.box.max)}},
                                   {"material", toJson(region.material)}});
    json["force"] = Json::array();
    for (const Load& load : shell.loads) {
        json["force"].push_back(toJson(load.where));
        json["force"].back()["total"] = demo::toJson(load.total);
    }
    json["pressure"] = shell.pressure;
    json["initial_velocity"] = demo::toJson(shell.initialVelocity);
    json["perturbation"] = shell.perturbation;
    json["sleeping"] = shell.sleeping;
    return json;
}

Json toJson(const BodyDescription& body) {
    Json json{{"name", body.name}, {"shape", std::visit(ShapeToJson{}, body.shape)}, {"mass", body.mass}};
    json.update(toJson(body.transform));
    json["velocity"] = demo::toJson(body.velocity);
    json["angular_velocity"] = demo::toJson(body.angularVelocity);
    json["friction"] = body.friction;
    json["restitution"] = body.restitution;
    for (const auto& [velocity, until] : body.kinematic)
        json["kinematic"].push_back({{"velocity", demo::toJson(velocity)}, {"until", until}});
    return json;
}

Json jointedToJson(const BodyDescription& body) {
    return {{"shape", std::visit(ShapeToJson{}, body.shape)},
            {"mass", body.mass},
            {"position", demo::toJson(body.transform.position)},
            {"friction", body.friction},
            {"restitution", body.restitution}};
}

Json toJson(const Joint& joint) {
    if (joint.kind == Joint::Kind::Fixed) return {{"fixed", true}};
    return {{joint.kind == Joint::Kind::Prismatic ? "prismatic" : "revolute", demo::toJson(joint.axis)}};
}

Json toJson(const MultiBodyDescription& multiBody, const Scene& scene) {
    Json json{{"name", multiBody.name}, {"base", jointedToJson(scene.bodies[multiBody.base])}};
    json["links"] = Json::array();
    for (const LinkDescription& link : multiBody.links) {
        Json entry{{"name", scene.bodies[link.body].name}};
        entry["parent"] = link.parent < 0 ? "base" : scene.bodies[multiBody.links[link.parent].body].name;
        entry.update(jointedToJson(scene.bodies[link.body]));
        entry["joint"] = toJson(link.joint);
        entry["pivot"] = demo::toJson(link.joint.pivot);
        for (const auto& [velocity, maxForce, until] : link.joint.motor)
            entry["motor"].push_back({{"velocity", velocity}, {"max_force", maxForce}, {"until", until}});
        if (const auto& limits = link.joint.limits) entry["limits"] = *limits;
        json["links"].push_back(std::move(entry));
    }
    return json;
}

Json toJson(const ProbeDescription& probe, const Scene& scene) {
    Json json{{"name", probe.name}};
    if (probe.body >= 0) json["body"] = scene.bodies[probe.body].name;
    if (probe.shell >= 0) json["shell"] = scene.shells[probe.shell].name;
    if (probe.where) json.update(toJson(*probe.where));
    json["quantity"] = probe.quantity;
    return json;
}

Json toJson(const Wind& wind) {
    return {{"velocity", demo::toJson(wind.velocity)},
            {"air_density", wind.airDensity},
            {"normal_drag", wind.normalDrag},
            {"tangential_drag", wind.tangentialDrag}};
}

Json toJson(const CameraDescription& camera) {
    Json json{{"fov_deg", camera.fovDegrees}};
    if (camera.eye) json["eye"] = demo::toJson(*camera.eye);
    if (camera.target) json["target"] = demo::toJson(*camera.target);
    return json;
}

}  // namespace

Json toJson(const Scene& scene) {
    Json json{{"name", scene.name},
              {"description", scene.description},
              {"mode", scene.isStatic ? "static" : "dynamic"},
              {"dt", scene.dt},
              {"substeps", scene.substeps},
              {"seconds", scene.seconds},
              {"seed", scene.seed},
              {"load_increments", scene.loadIncrements},
              {"gravity", toJson(scene.gravity)}};
    if (scene.wind) json["wind"] = toJson(*scene.wind);
    json["shells"] = json["bodies"] = json["probes"] = Json::array();
    for (const auto& shell : scene.shells) json["shells"].push_back(toJson(shell));
    for (const auto& body : scene.bodies)
        if (!body.isOfMultiBody) json["bodies"].push_back(toJson(body));
    for (const auto& multiBody : scene.multiBodies) json["multibodies"].push_back(toJson(multiBody, scene));
    for (const auto& probe : scene.probes) json["probes"].push_back(toJson(probe, scene));
    json["camera"] = toJson(scene.camera);
    return json;
}

}  // namespace jacket::demo
