#pragma once
#include "World.h"

/// What is reported of a running scene, computed from positions and velocities alone.
namespace jacket::demo {

/// Of all shells and moving bodies [J].
struct EnergyBalance {
    double kinetic = 0.0, membrane = 0.0, bending = 0.0;
    double plasticWork = 0.0;  ///< turned into heat since the start; not part of the total
    double potential = 0.0;    ///< in the field of gravity, 0 at the origin
    double total() const { return kinetic + membrane + bending + potential; }
};

/// The point of a shell that is deepest inside a body.
struct Penetration {
    double depth = 0.0;         ///< 0: none is inside [m]
    int shell = -1, body = -1;  ///< which, if any
};

/// One line of log.csv.
struct FrameRecord {
    int frame = 0;
    double time = 0.0;  ///< [s]
    EnergyBalance energy;
    Vec3 momentum = Vec3::Zero();  ///< linear [N s]
    double momentumScale = 0.0;    ///< sum of mass times speed [N s]
    double maxStretch = 0.0;       ///< largest edge length / rest length - 1 [-]
    Penetration penetration;
    bool isFinite = true;  ///< every position, velocity and energy
    FrameReport report;
};

FrameRecord measure(const World& world, int frame, const FrameReport& report = {});

/// Of vertices, edge midpoints and centroids, inside the true surface of a body.
Penetration deepestPenetration(const World& world);

/// How deep a surface reaches into a body: of its vertices, edge midpoints and centroids [m]; 0: not at all.
double depthIn(const BodyState& body, const Points& positions, const HalfEdgeMesh& mesh);

/// 16 hexadecimal digits that stand for every bit of the shells' positions and velocities and the bodies' poses and
/// velocities (FNV-1a).
std::string stateHash(const World& world);

/// Mass of shells and moving bodies [kg].
double movingMass(const World& world);

/// Nothing but gravity acts from outside, so that linear momentum must be kept: no pins, no bodies that stand or are
/// moved, no wind, pressure or force, no damping against the ground.
bool isFree(const Scene& scene);

/// A number or a list of three.
Json probeValue(const ProbeDescription& probe, const World& world);

}  // namespace jacket::demo
