#include <cmath>
#include <numbers>

#include "accuracy/References.h"
#include "accuracy/Setup.h"

/// Shells that are curved at rest; a quarter of each, with planes of symmetry. Units of the sources.
namespace jacket::demo::accuracy {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

/// Vertices of the flat sheet with coordinate `axis` at `value`.
std::vector<int> sideOf(const TriangleMesh& flat, int axis, double value) {
    return verticesWhere(flat.positions, [&](const Vec3& p) { return std::abs(p[axis] - value) < 1e-9; });
}

/// A roof's quarter: u around from the crown, v along from the middle [lengths]; a cylinder about the y axis.
Vec3 onRoof(double radius, double u, double v) {
    return {radius * std::sin(u / radius), v, radius * std::cos(u / radius)};
}

Measurement scordelisLo(const Case& how) {
    constexpr double kRadius = 25.0, kHalfLength = 25.0, kHalfArc = kRadius * 40.0 * kDegree, kWeight = 90.0;
    constexpr double kScale = 1e-4;  // of the load, so that everything is linear
    const Stopwatch watch;
    const TriangleMesh flat = makeSheet(how, {kHalfArc, kHalfLength}, {how.cells, how.cells});
    const TriangleMesh mesh = bent(flat, [](double u, double v) { return onRoof(kRadius, u, v); });
    Shell shell(mesh, {.young = 4.32e8, .poisson = how.poisson, .thickness = 0.25, .density = 4.0},
                {.bending = how.bending});
    shell.mirror(sideOf(flat, 0, 0.0), Vec3::UnitX());
    shell.mirror(sideOf(flat, 1, 0.0), Vec3::UnitY());
    for (const int i : sideOf(flat, 1, kHalfLength)) {
        shell.guide(i, Vec3::UnitX());
        shell.guide(i, Vec3::UnitZ());
    }
    const StaticReport report = settle(shell, {0, 0, -kScale * kWeight}, {.tolerance = 1e-6});
    const int measured = nearestVertex(mesh.positions, onRoof(kRadius, kHalfArc, 0.0));
    const double drop = (mesh.positions(2, measured) - shell.positions()(2, measured)) / kScale;
    return relative(drop, kScordelisLo, watch, shell, report.converged);
}

/// Pulled along y and pushed along x at the equator, by 1 on the quarter.
Measurement hemisphere(const Case& how) {
    static constexpr double kRadius = 10.0, kForce = 1e-2;  // a hundredth of the load, so that everything is linear
    const Stopwatch watch;
    const TriangleMesh flat = makeSheet(how, {90.0 * kDegree, 72.0 * kDegree}, {how.cells, how.cells});
    const TriangleMesh mesh = bent(flat, [](double u, double v) {
        return Vec3(kRadius * Vec3(std::cos(u) * std::cos(v), std::sin(u) * std::cos(v), std::sin(v)));
    });
    Shell shell(mesh, {.young = 6.825e7, .poisson = how.poisson, .thickness = 0.04}, {.bending = how.bending});
    shell.mirror(sideOf(flat, 0, 0.0), Vec3::UnitY());
    shell.mirror(sideOf(flat, 0, 90.0 * kDegree), Vec3::UnitX());
    const int pushed = nearestVertex(mesh.positions, {kRadius, 0, 0}),
              pulled = nearestVertex(mesh.positions, {0, kRadius, 0});
    shell.guide(pushed, Vec3::UnitZ());
    shell.setForce(pushed, {-kForce, 0, 0});
    shell.setForce(pulled, {0, kForce, 0});
    const StaticReport report = settle(shell, Vec3::Zero(), {.tolerance = 1e-6});
    const double in = kRadius - shell.positions()(0, pushed), out = shell.positions()(1, pulled) - kRadius;
    return relative(0.5 * (in + out) / kForce, kHemisphere, watch, shell, report.converged);
}

/// Hinged along its straight edges; the crown's middle is pushed down, and the force read there.
Measurement hingedRoof(const Case& how, const SnapThrough& point) {
    constexpr double kRadius = 2540.0, kHalfLength = 254.0, kHalfArc = 0.1 * kRadius, kFullLoad = 3000.0;
    constexpr double kStep = 2.0;  // of the deflection, at most
    const Stopwatch watch;
    const TriangleMesh flat = makeSheet(how, {kHalfArc, kHalfLength}, {how.cells, how.cells});
    const TriangleMesh mesh = bent(flat, [](double u, double v) { return onRoof(kRadius, u, v); });
    Shell shell(mesh, {.young = 3102.75, .poisson = how.poisson, .thickness = 12.7}, {.bending = how.bending});
    shell.mirror(sideOf(flat, 0, 0.0), Vec3::UnitX());
    shell.mirror(sideOf(flat, 1, 0.0), Vec3::UnitY());
    for (const int i : sideOf(flat, 0, kHalfArc)) shell.pin(i);
    const Vec3 crown(0, 0, kRadius);
    const int loaded = nearestVertex(mesh.positions, crown);
    shell.pin(loaded);
    bool converged = true;
    const int steps = static_cast<int>(std::ceil(point.deflection / kStep));
    for (int step = 1; step <= steps; ++step) {
        shell.movePin(loaded, crown - Vec3(0, 0, point.deflection * step / steps));
        converged = settle(shell, Vec3::Zero(), {.tolerance = 1e-6}).converged && converged;
    }
    const double load = -4.0 * shell.reaction(loaded, Vec3::Zero()).z() / kFullLoad;
    return relative(load, point.load, watch, shell, converged);
}

}  // namespace

void addCurvedShells(std::vector<Problem>& problems) {
    problems.push_back({.name = "Scordelis-Lo roof",
                        .quantity = "drop of the free edge's middle, relative",
                        .source = "Kirchhoff-Love, isogeometric",
                        .cells = {32, 64},
                        .targets = {0.03, 0.02},
                        .poissons = {0.0},
                        .meshes = kAllMeshes,
                        .flatRest = false,
                        .solve = scordelisLo});
    problems.push_back({.name = "pinched hemisphere",
                        .quantity = "mean displacement under the loads, relative",
                        .source = "Simo, Fox, Rifai 1989; 0.093 to 0.094 in the literature",
                        .cells = {32, 64},
                        .targets = {0.03, 0.02},
                        .poissons = {0.3},
                        .meshes = kAllMeshes,
                        .flatRest = false,
                        .solve = hemisphere});
    problems.push_back({.name = "hinged roof, limit load",
                        .quantity = "load at its greatest, relative",
                        .source = "Sze, Liu, Lo 2004",
                        .cells = {16, 32},
                        .targets = {0.04, 0.02},
                        .poissons = {0.3},
                        .meshes = kAllMeshes,
                        .flatRest = false,
                        .solve = [](const Case& how) { return hingedRoof(how, kRoofLimit); }});
    problems.push_back({.name = "hinged roof, valley",
                        .quantity = "load at its least after snapping through, relative",
                        .source = "Sze, Liu, Lo 2004",
                        .cells = {16, 32},
                        .targets = {0.08, 0.04},
                        .poissons = {0.3},
                        .meshes = kAllMeshes,
                        .flatRest = false,
                        .solve = [](const Case& how) { return hingedRoof(how, kRoofValley); }});
}

}  // namespace jacket::demo::accuracy
