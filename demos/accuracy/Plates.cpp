#include <cmath>

#include "accuracy/References.h"
#include "accuracy/Setup.h"

/// Square plates with small deflections.
namespace jacket::demo::accuracy {
namespace {

constexpr double kSide = 1.0;                       // [m]
constexpr double kStiffness = 1.0;                  // D [N m]
constexpr double kThickness = 0.02;                 // [m]; thin plate theory has no other effect of it
constexpr double kDeflection = 1e-3 * kThickness;   // about: large against rounding, and all but linear [m]
const StaticSettings kSettings{.tolerance = 1e-6};  // what rounding leaves of such small loads

enum class Edge { Supported, Clamped };
enum class Load { Uniform, Centre };

bool onBorder(const Vec3& p) {
    constexpr double kNear = 1e-9;
    return p.x() < kNear || p.y() < kNear || p.x() > kSide - kNear || p.y() > kSide - kNear;
}

void hold(Shell& shell, const Case& how, Edge edge) {
    const Points& x = shell.restPositions();
    if (edge == Edge::Supported) {
        for (const int i : verticesWhere(x, onBorder)) shell.guide(i, Vec3::UnitZ());
        return holdInPlane(shell);
    }
    constexpr double kNear = 1e-9;
    for (int axis = 0; axis < 2; ++axis) {
        clampEdge(shell, how.bending, verticesWhere(x, [&](const Vec3& p) { return p[axis] < kNear; }));
        clampEdge(shell, how.bending, verticesWhere(x, [&](const Vec3& p) { return p[axis] > kSide - kNear; }));
    }
}

Measurement deflection(const Case& how, Edge edge, Load load) {
    const Stopwatch watch;
    const TriangleMesh mesh =
        makeSheet(how, {kSide, kSide}, {how.cells, how.cells}, edge == Edge::Clamped ? Margins{1, 1, 1, 1} : Margins{});
    Shell shell(mesh, plateMaterial(kStiffness, kThickness, how.poisson), {.bending = how.bending});
    hold(shell, how, edge);
    const PlateDeflection& exact = edge == Edge::Supported ? kSupportedPlate : kClampedPlate;
    const double coefficient = load == Load::Uniform ? exact.uniform : exact.centre;
    const double size = kDeflection / coefficient;  // q a^4 / D, or P a^2 / D
    const int centre = nearestVertex(mesh.positions, {0.5 * kSide, 0.5 * kSide, 0.0});
    if (load == Load::Centre) shell.setForce(centre, {0, 0, -size});
    const StaticReport report = settle(shell, {0, 0, load == Load::Uniform ? -size : 0.0}, kSettings);
    return relative(-shell.positions()(2, centre) / size, coefficient, watch, shell, report.converged);
}

/// Three corners held, a force on the fourth: w = P a b / (2 D (1 - nu)), constant twist.
Measurement twist(const Case& how) {
    const Stopwatch watch;
    const TriangleMesh mesh = makeSheet(how, {kSide, kSide}, {how.cells, how.cells});
    Shell shell(mesh, plateMaterial(kStiffness, kThickness, how.poisson), {.bending = how.bending});
    for (const Vec3& corner : {Vec3(0, 0, 0), Vec3(kSide, 0, 0), Vec3(0, kSide, 0)})
        shell.guide(nearestVertex(mesh.positions, corner), Vec3::UnitZ());
    holdInPlane(shell);
    const double compliance = 0.5 * kSide * kSide / (kStiffness * (1.0 - how.poisson));
    const int loaded = nearestVertex(mesh.positions, {kSide, kSide, 0});
    const double force = kDeflection / compliance;
    shell.setForce(loaded, {0, 0, -force});
    const StaticReport report = settle(shell, Vec3::Zero(), kSettings);
    return relative(-shell.positions()(2, loaded) / force, compliance, watch, shell, report.converged);
}

}  // namespace

void addPlates(std::vector<Problem>& problems) {
    for (const Edge edge : {Edge::Supported, Edge::Clamped})
        for (const Load load : {Load::Uniform, Load::Centre})
            problems.push_back({.name = std::string(edge == Edge::Supported ? "supported" : "clamped") + " plate, " +
                                        (load == Load::Uniform ? "uniform load" : "centre load"),
                                .quantity = "deflection at the centre, relative",
                                .source = edge == Edge::Supported ? "Navier's series" : "Ritz; Timoshenko",
                                .cells = {16, 32},
                                .targets = {0.08, 0.02},
                                .poissons = {0.0, 0.3},
                                .meshes = kAllMeshes,
                                .solve = [edge, load](const Case& how) { return deflection(how, edge, load); }});
    problems.push_back({.name = "twisted plate",
                        .quantity = "deflection of the loaded corner, relative",
                        .source = "w = P a b / (2 D (1 - nu))",
                        .cells = {16, 32},
                        .targets = {0.04, 0.01},
                        .poissons = {0.0, 0.3},
                        .meshes = kAllMeshes,
                        .solve = twist});
}

}  // namespace jacket::demo::accuracy
