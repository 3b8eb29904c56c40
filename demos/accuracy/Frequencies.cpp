#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "accuracy/References.h"
#include "accuracy/Setup.h"

/// Natural frequencies: of stress-free plates, and of a sheet that its weight keeps taut.
namespace jacket::demo::accuracy {
namespace {

/// The one of the given frequencies that is farthest off.
Measurement farthestOff(const std::vector<double>& found, std::size_t first, std::span<const double> exact, double unit,
                        const Stopwatch& watch, const Shell& shell, bool converged) {
    Measurement result = relative(found.at(first) / unit, exact[0], watch, shell, converged);
    for (std::size_t i = 1; i < exact.size(); ++i)
        result = worse(result, relative(found.at(first + i) / unit, exact[i], watch, shell, converged));
    return result;
}

const PlateFrequencies& plateFrequencies(double poisson) {
    for (const PlateFrequencies& entry : kPlateFrequencies)
        if (entry.poisson == poisson) return entry;
    throw std::invalid_argument("plate frequencies: no reference for this Poisson's ratio");
}

/// A square plate of side, mass per area and D one, so that frequencies are lambda; free, or clamped along x = 0.
Measurement plate(const Case& how, bool clamped) {
    constexpr double kThickness = 0.01;  // [m]: motions in its plane are a hundred times as fast
    constexpr std::size_t kRigidMotions = 6;
    const Stopwatch watch;
    const TriangleMesh mesh = makeSheet(how, {1.0, 1.0}, {how.cells, how.cells}, {.left = clamped ? 1 : 0});
    Shell shell(mesh, plateMaterial(1.0, kThickness, how.poisson), {.bending = how.bending});
    if (clamped)
        clampEdge(shell, how.bending, verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() < 1e-9; }));
    const PlateFrequencies& exact = plateFrequencies(how.poisson);
    const auto& wanted = clamped ? exact.cantilever : exact.free;
    const std::size_t first = clamped ? 0 : kRigidMotions;
    const auto found = naturalFrequencies(shell, static_cast<int>(first + wanted.size()));
    return farthestOff(found, first, wanted, 1.0, watch, shell, true);
}

/// A narrow piece of a wide limp sheet, which goes on as its mirror image at both sides, hung from its upper edge.
Measurement hangingSheet(const Case& how) {
    constexpr double kLength = 1.0, kWidth = 0.05, kThickness = 1e-4, kGravity = 9.81, kLimp = 1e5;
    const Stopwatch watch;
    const TriangleMesh mesh = makeStrip(how, kLength, kWidth);
    Shell shell(mesh, plateMaterial(kGravity / kLimp, kThickness, how.poisson), {.bending = how.bending});
    for (const double side : {0.0, kWidth})
        shell.mirror(verticesWhere(mesh.positions, [&](const Vec3& p) { return std::abs(p.y() - side) < 1e-9; }),
                     Vec3::UnitY());
    for (const int i : verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() < 1e-9; })) shell.pin(i);
    const StaticReport report = settle(shell, {kGravity, 0, 0});
    const auto found = naturalFrequencies(shell, static_cast<int>(kHangingFrequencies.size()));
    return farthestOff(found, 0, kHangingFrequencies, std::sqrt(kGravity / kLength), watch, shell, report.converged);
}

}  // namespace

void addFrequencies(std::vector<Problem>& problems) {
    for (const bool clamped : {false, true})
        problems.push_back({.name = clamped ? "cantilever plate, frequencies" : "free plate, frequencies",
                            .quantity = "of the first five elastic ones the farthest off, relative",
                            .source = "Ritz",
                            .cells = {16, 32},
                            .targets = {0.08, 0.02},
                            .poissons = {0.0, 0.3},
                            .meshes = kAllMeshes,
                            .solve = [clamped](const Case& how) { return plate(how, clamped); }});
    problems.push_back({.name = "hanging sheet, frequencies",
                        .quantity = "of the first three the farthest off, relative",
                        .source = "half the zeros of J0",
                        .cells = {20, 40},
                        .targets = {0.04, 0.01},
                        .poissons = {0.0},
                        .meshes = kAllMeshes,
                        .solve = hangingSheet});
}

}  // namespace jacket::demo::accuracy
