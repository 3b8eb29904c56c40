#include "Measure.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

namespace jacket::demo {

namespace {

double kineticEnergy(const BodyState& body) {
    const Vec3 spin = body.rotation.transpose() * body.angularVelocity;
    return 0.5 * body.description->mass * body.velocity.squaredNorm() + 0.5 * spin.dot(body.inertia * spin);
}

EnergyBalance energyOf(const World& world, const std::vector<BodyState>& bodies) {
    const Vec3& gravity = world.scene().gravity;
    EnergyBalance sum;
    for (int k = 0; k < world.shellCount(); ++k) {
        const Shell& shell = world.shell(k);
        const ShellEnergy energy = shell.energy();
        sum.kinetic += shell.kineticEnergy(world.velocities(k));
        sum.membrane += energy.membrane;
        sum.bending += energy.bending;
        sum.plasticWork += energy.plasticWork;
        sum.potential -= gravity.dot(shell.positions() * shell.masses());
    }
    for (const BodyState& body : bodies) {
        if (!body.isDynamic) continue;
        sum.kinetic += kineticEnergy(body);
        sum.potential -= body.description->mass * gravity.dot(body.centre);
    }
    return sum;
}

double momentumScale(const World& world, const std::vector<BodyState>& bodies) {
    double scale = 0.0;
    for (int k = 0; k < world.shellCount(); ++k)
        scale += world.velocities(k).colwise().norm().dot(world.shell(k).masses());
    for (const BodyState& body : bodies)
        if (body.isDynamic) scale += body.description->mass * body.velocity.norm();
    return scale;
}

bool isFinite(const World& world, const std::vector<BodyState>& bodies) {
    for (int k = 0; k < world.shellCount(); ++k)
        if (!world.shell(k).positions().allFinite() || !world.shell(k).velocities().allFinite()) return false;
    return std::all_of(bodies.begin(), bodies.end(), [](const BodyState& body) {
        return body.position.allFinite() && body.rotation.allFinite() && body.velocity.allFinite() &&
               body.angularVelocity.allFinite();
    });
}

/// FNV-1a of whatever is added.
class Hash {
  public:
    template <class Matrix>
    void add(const Matrix& values) {
        const auto* bytes = reinterpret_cast<const unsigned char*>(values.data());
        for (std::size_t i = 0; i < sizeof(double) * static_cast<std::size_t>(values.size()); ++i)
            m_value = (m_value ^ bytes[i]) * 1099511628211ull;
    }
    std::string text() const {
        char digits[17];
        std::snprintf(digits, sizeof digits, "%016llx", m_value);
        return digits;
    }

  private:
    unsigned long long m_value = 14695981039346656037ull;
};

/// Force of the shell's pressure on each vertex, a third of each triangle's.
Points pressureForces(const Shell& shell) {
    const Points& x = shell.positions();
    Points forces = Points::Zero(3, x.cols());
    const auto& triangles = shell.mesh().triangles();
    for (int t = 0; t < triangles.cols(); ++t) {
        const Vec3 a = x.col(triangles(0, t)), b = x.col(triangles(1, t)), c = x.col(triangles(2, t));
        const Vec3 third = shell.pressure() / 6.0 * (b - a).cross(c - a);
        for (int k = 0; k < 3; ++k) forces.col(triangles(k, t)) += third;
    }
    return forces;
}

/// What holds the pinned vertices among `vertices`: the opposite of all that pulls at them. Damping and wind on those
/// very vertices are left out.
Vec3 pinReaction(const World& world, int index, const std::vector<int>& vertices) {
    const Shell& shell = world.shell(index);
    const Points pulls = shell.elasticForces() + shell.forces() + pressureForces(shell) + world.contactForces(index) +
                         world.scene().gravity * shell.masses().transpose();
    Vec3 reaction = Vec3::Zero();
    for (const int v : vertices)
        if (shell.isPinned(v)) reaction -= pulls.col(v);
    return reaction;
}

Json shellProbe(const ProbeDescription& probe, const World& world) {
    const Shell& shell = world.shell(probe.shell);
    const Points& start = world.initialPositions(probe.shell);
    std::vector<int> vertices(shell.vertexCount());
    std::iota(vertices.begin(), vertices.end(), 0);
    if (probe.where) vertices = probe.where->vertices(start);
    if (probe.quantity == "reaction") return toJson(pinReaction(world, probe.shell, vertices));

    const Points forces = probe.quantity == "elastic_force" ? shell.elasticForces() : Points::Zero(3, start.cols());
    Vec3 force = Vec3::Zero(), mean = Vec3::Zero();
    double farthest = 0.0;
    for (const int v : vertices) {
        force += forces.col(v);
        mean += shell.positions().col(v) / static_cast<double>(vertices.size());
        farthest = std::max(farthest, (shell.positions().col(v) - start.col(v)).norm());
    }
    if (probe.quantity == "elastic_force") return toJson(force);
    if (probe.quantity == "max_displacement") return farthest;
    return toJson(mean);
}

}  // namespace

FrameRecord measure(const World& world, int frame, const FrameReport& report) {
    const auto bodies = world.bodies();
    FrameRecord record;
    record.frame = frame;
    record.time = world.time();
    record.report = report;
    record.energy = energyOf(world, bodies);
    record.isFinite = isFinite(world, bodies) && std::isfinite(record.energy.total() + record.energy.plasticWork);
    record.momentum = world.linearMomentum();
    record.momentumScale = momentumScale(world, bodies);
    for (int k = 0; k < world.shellCount(); ++k)
        record.maxStretch =
            k == 0 ? world.shell(k).maxStretch() : std::max(record.maxStretch, world.shell(k).maxStretch());
    record.penetration = deepestPenetration(world);
    return record;
}

double depthIn(const BodyState& body, const Points& x, const HalfEdgeMesh& mesh) {
    const Shape& shape = body.description->shape;
    const double radius = boundingRadius(shape);
    const Mat3 toBody = body.rotation.transpose();
    double deepest = 0.0;
    const auto see = [&](const Vec3& point) {
        const Vec3 offset = point - body.position;
        if (offset.squaredNorm() < radius * radius)
            deepest = std::max(deepest, -signedDistance(shape, toBody * offset));
    };
    for (int i = 0; i < x.cols(); ++i) see(x.col(i));
    for (const auto& edge : mesh.edges()) see(0.5 * (x.col(edge.v0) + x.col(edge.v1)));
    for (const auto& t : mesh.triangles().colwise()) see((x.col(t[0]) + x.col(t[1]) + x.col(t[2])) / 3.0);
    return deepest;
}

std::string stateHash(const World& world) {
    Hash hash;
    for (int k = 0; k < world.shellCount(); ++k) {
        hash.add(world.shell(k).positions());
        hash.add(world.shell(k).velocities());
    }
    for (const BodyState& body : world.bodies()) {
        hash.add(body.position);
        hash.add(body.rotation);
        hash.add(body.velocity);
        hash.add(body.angularVelocity);
    }
    return hash.text();
}

Penetration deepestPenetration(const World& world) {
    Penetration deepest;
    const auto bodies = world.bodies();
    for (std::size_t b = 0; b < bodies.size(); ++b)
        for (int k = 0; k < world.shellCount(); ++k)
            if (const double depth = depthIn(bodies[b], world.shell(k).positions(), world.shell(k).mesh());
                depth > deepest.depth)
                deepest = {depth, k, static_cast<int>(b)};
    return deepest;
}

double movingMass(const World& world) {
    double mass = 0.0;
    for (int k = 0; k < world.shellCount(); ++k) mass += world.shell(k).masses().sum();
    for (const auto& body : world.scene().bodies) mass += body.mass;
    return mass;
}

bool isFree(const Scene& scene) {
    const bool shellsFree = std::all_of(scene.shells.begin(), scene.shells.end(), [](const ShellDescription& shell) {
        return shell.pins.empty() && shell.clamps.empty() && shell.guides.empty() && shell.loads.empty() &&
               shell.pressure == 0 && shell.material.massDamping == 0;
    });
    const bool bodiesFree =
        std::all_of(scene.bodies.begin(), scene.bodies.end(), [](const auto& body) { return body.mass > 0; });
    return shellsFree && bodiesFree && !scene.wind && !scene.isStatic;
}

Json probeValue(const ProbeDescription& probe, const World& world) {
    if (probe.shell >= 0) return shellProbe(probe, world);
    const BodyState body = world.bodies()[probe.body];
    return toJson(probe.quantity == "position" ? body.position : body.velocity);
}

}  // namespace jacket::demo
