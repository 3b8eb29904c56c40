#include "accuracy/Setup.h"

#include <algorithm>
#include <cmath>

namespace jacket::demo::accuracy {

bool holdsTangents(const BendingModel& model) {
    return std::holds_alternative<PatchBending>(model);
}

TriangleMesh makeSheet(const Case& how, const Vec2& size, const Eigen::Vector2i& cells, const Margins& clamped) {
    TriangleMesh mesh =
        sheet(how.mesh, size.x(), size.y(), cells.x(), cells.y(), holdsTangents(how.bending) ? Margins{} : clamped);
    mesh.positions.colwise() += 0.5 * Vec3(size.x(), size.y(), 0.0);
    return mesh;
}

TriangleMesh makeStrip(const Case& how, double length, double width, const Margins& clamped) {
    const int across = std::max(2, static_cast<int>(std::lround(how.cells * width / length)));
    return makeSheet(how, {length, width}, {how.cells, across}, clamped);
}

TriangleMesh bent(TriangleMesh flat, const std::function<Vec3(double u, double v)>& surface) {
    for (int i = 0; i < flat.positions.cols(); ++i) {
        const Vec3 at = flat.positions.col(i);
        flat.positions.col(i) = surface(at.x(), at.y());
    }
    return flat;
}

ShellMaterial plateMaterial(double bendingStiffness, double thickness, double poisson, double areaDensity) {
    return {.young = bendingStiffness * 12.0 * (1.0 - poisson * poisson) / std::pow(thickness, 3),
            .poisson = poisson,
            .thickness = thickness,
            .density = areaDensity / thickness};
}

void clampEdge(Shell& shell, const BendingModel& model, const std::vector<int>& vertices,
               std::optional<Vec3> direction) {
    if (holdsTangents(model)) return shell.clamp(vertices, direction);
    for (const int i : vertices) shell.pin(i);
}

void holdInPlane(Shell& shell) {
    const Points& x = shell.positions();
    const Vec3 low = x.rowwise().minCoeff(), high = x.rowwise().maxCoeff();
    const int corner = nearestVertex(x, low), other = nearestVertex(x, Vec3(high.x(), low.y(), low.z()));
    shell.guide(corner, Vec3::UnitX());
    shell.guide(corner, Vec3::UnitY());
    shell.guide(other, Vec3::UnitY());
}

void spreadForce(Shell& shell, const std::vector<int>& edge, int axis, const Vec3& force) {
    const Points& x = shell.restPositions();
    std::vector<int> sorted = edge;
    std::sort(sorted.begin(), sorted.end(), [&](int a, int b) { return x(axis, a) < x(axis, b); });
    const double length = x(axis, sorted.back()) - x(axis, sorted.front());
    for (std::size_t i = 0; i < sorted.size(); ++i) {
        const double from = x(axis, sorted[i == 0 ? 0 : i - 1]),
                     to = x(axis, sorted[std::min(i + 1, sorted.size() - 1)]);
        shell.setForce(sorted[i], 0.5 * (to - from) / length * force);
    }
}

Vec3 meanPosition(const Points& x, const std::vector<int>& vertices) {
    Vec3 sum = Vec3::Zero();
    for (const int i : vertices) sum += x.col(i);
    return sum / static_cast<double>(vertices.size());
}

int nearestVertex(const Points& x, const Vec3& to) {
    Eigen::Index nearest = 0;
    (x.colwise() - to).colwise().squaredNorm().minCoeff(&nearest);
    return static_cast<int>(nearest);
}

Measurement relative(double value, double reference, const Stopwatch& watch, const Shell& shell, bool converged) {
    return {.value = value,
            .reference = reference,
            .error = value / reference - 1.0,
            .seconds = watch.seconds(),
            .vertices = shell.vertexCount(),
            .converged = converged};
}

const Measurement& worse(const Measurement& a, const Measurement& b) {
    return std::abs(b.error) > std::abs(a.error) ? b : a;
}

}  // namespace jacket::demo::accuracy
