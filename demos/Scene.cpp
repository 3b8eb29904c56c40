#include "Scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace jacket::demo {

Mat3 Transform::rotation() const {
    const Vec3 angle = rotationDeg * (std::numbers::pi / 180.0);
    return (Eigen::AngleAxisd(angle.z(), Vec3::UnitZ()) * Eigen::AngleAxisd(angle.y(), Vec3::UnitY()) *
            Eigen::AngleAxisd(angle.x(), Vec3::UnitX()))
        .toRotationMatrix();
}

namespace {

std::string bracketed(const Vec3& v) {
    return "[" + shortNumber(v.x()) + ", " + shortNumber(v.y()) + ", " + shortNumber(v.z()) + "]";
}

std::vector<int> insideBox(const Selection::Bounds& box, const Points& positions, const std::string& label) {
    std::vector<int> inside;
    for (int i = 0; i < positions.cols(); ++i)
        if ((positions.col(i).array() >= box.min.array()).all() && (positions.col(i).array() <= box.max.array()).all())
            inside.push_back(i);
    if (inside.empty())
        throw InputError(label + ".box selects no vertex: it reaches from " + bracketed(box.min) + " to " +
                         bracketed(box.max) + ", the shell from " + bracketed(positions.rowwise().minCoeff()) + " to " +
                         bracketed(positions.rowwise().maxCoeff()));
    return inside;
}

}  // namespace

std::vector<int> Selection::vertices(const Points& positions) const {
    if (const auto* box = std::get_if<Bounds>(&what)) return insideBox(*box, positions, label);
    auto vertices = std::get<std::vector<int>>(what);
    for (std::size_t i = 0; i < vertices.size(); ++i)
        if (vertices[i] >= positions.cols())
            throw InputError(label + ".vertices." + std::to_string(i) + ": vertex " + std::to_string(vertices[i]) +
                             " does not exist; the shell has the vertices 0.." + std::to_string(positions.cols() - 1));
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    return vertices;
}

int Scene::frames() const {
    if (isStatic) return 1;
    return std::max(1, static_cast<int>(std::ceil(seconds / dt - 1e-6)));
}

bool Scene::usesSeed() const {
    return std::any_of(shells.begin(), shells.end(), [](const auto& shell) { return shell.perturbation > 0; });
}

bool Scene::maySleep() const {
    return std::any_of(shells.begin(), shells.end(), [](const auto& shell) { return shell.sleeping; });
}

}  // namespace jacket::demo
