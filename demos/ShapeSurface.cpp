#include "ShapeSurface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace jacket::demo {

namespace {

constexpr int kAround = 48;    ///< segments around the axis
constexpr int kPerStripe = 6;  ///< segments of one stripe
constexpr int kAlongArc = 12;  ///< segments of a quarter circle
constexpr float kStripeTint = 0.78f;

/// A point of the outline of a shape that is round about y, with the outline's normal.
struct OutlinePoint {
    double radius, y, normalRadius, normalY;
};
using Outline = std::vector<OutlinePoint>;

/// From angle a to b above the equator of a sphere, centred at height y.
void addArc(Outline& outline, double radius, double y, double a, double b) {
    const int segments =
        std::max(1, static_cast<int>(std::lround(std::abs(b - a) / (0.5 * std::numbers::pi) * kAlongArc)));
    for (int i = 0; i <= segments; ++i) {
        const double angle = a + (b - a) * i / segments;
        const double c = std::cos(angle), s = std::sin(angle);
        outline.push_back({radius * std::max(c, 0.0), y + radius * s, c, s});
    }
}

void addLine(Outline& outline, const Vec2& a, const Vec2& b) {
    const Vec2 normal = Vec2(b.y() - a.y(), a.x() - b.x()).normalized();
    outline.push_back({a.x(), a.y(), normal.x(), normal.y()});
    outline.push_back({b.x(), b.y(), normal.x(), normal.y()});
}

/// Turns an outline, which runs from the bottom up, about y.
Surface revolve(const Outline& outline) {
    const int rows = static_cast<int>(outline.size());
    Surface surface;
    surface.positions.resize(3, rows * kAround);
    surface.normals.resize(3, rows * kAround);
    std::vector<Eigen::Vector3i> triangles;
    for (int i = 0; i < rows; ++i)
        for (int j = 0; j < kAround; ++j) {
            const double angle = 2 * std::numbers::pi * j / kAround;
            const Vec3 outward(std::cos(angle), 0, -std::sin(angle));
            const OutlinePoint& p = outline[i];
            surface.positions.col(i * kAround + j) = (p.radius * outward + Vec3(0, p.y, 0)).cast<float>();
            surface.normals.col(i * kAround + j) = (p.normalRadius * outward + Vec3(0, p.normalY, 0)).cast<float>();
            if (i + 1 == rows) continue;
            const int next = (j + 1) % kAround;
            const int a = i * kAround + j, b = i * kAround + next, c = a + kAround, d = b + kAround;
            triangles.emplace_back(a, b, d);
            triangles.emplace_back(a, d, c);
            const float tint = (j / kPerStripe) % 2 == 0 ? 1.0f : kStripeTint;
            surface.tints.insert(surface.tints.end(), 2, tint);
        }
    surface.triangles.resize(3, static_cast<Eigen::Index>(triangles.size()));
    for (std::size_t t = 0; t < triangles.size(); ++t) surface.triangles.col(t) = triangles[t];
    return surface;
}

/// Every triangle with corners of its own, so that edges look sharp.
Surface flat(const Points& vertices, const Indices<3>& triangles) {
    Surface surface;
    const Eigen::Index count = 3 * triangles.cols();
    surface.positions.resize(3, count);
    surface.normals.resize(3, count);
    surface.triangles.resize(3, triangles.cols());
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        const Vec3 a = vertices.col(triangles(0, t)), b = vertices.col(triangles(1, t)),
                   c = vertices.col(triangles(2, t));
        const Eigen::Vector3f normal = (b - a).cross(c - a).normalized().cast<float>();
        for (int k = 0; k < 3; ++k) {
            surface.positions.col(3 * t + k) = vertices.col(triangles(k, t)).cast<float>();
            surface.normals.col(3 * t + k) = normal;
            surface.triangles(k, t) = static_cast<int>(3 * t + k);
        }
    }
    return surface;
}

void append(Surface& all, const Surface& part, const Transform& transform) {
    const Eigen::Index vertices = all.positions.cols(), triangles = all.triangles.cols();
    const Eigen::Matrix3f rotation = transform.rotation().cast<float>();
    const Eigen::Vector3f position = transform.position.cast<float>();
    all.positions.conservativeResize(3, vertices + part.positions.cols());
    all.normals.conservativeResize(3, vertices + part.positions.cols());
    all.triangles.conservativeResize(3, triangles + part.triangles.cols());
    all.positions.rightCols(part.positions.cols()) = (rotation * part.positions).colwise() + position;
    all.normals.rightCols(part.positions.cols()) = rotation * part.normals;
    all.triangles.rightCols(part.triangles.cols()) = part.triangles.array() + static_cast<int>(vertices);
    all.tints.resize(triangles, 1.0f);
    all.tints.insert(all.tints.end(), part.tints.begin(), part.tints.end());
    all.tints.resize(all.triangles.cols(), 1.0f);
}

constexpr double kQuarter = 0.5 * std::numbers::pi;

struct Triangulate {
    Surface operator()(const Sphere& s) const {
        Outline outline;
        addArc(outline, s.radius, 0, -kQuarter, kQuarter);
        return revolve(outline);
    }
    Surface operator()(const Box& s) const {
        Points corners(3, 8);
        for (int i = 0; i < 8; ++i)
            corners.col(i) = 0.5 * s.size.cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
        const ConvexHull hull(corners);
        return flat(hull.vertices(), hull.triangles());
    }
    Surface operator()(const Capsule& s) const {
        Outline outline;
        addArc(outline, s.radius, -0.5 * s.height, -kQuarter, 0);
        addArc(outline, s.radius, 0.5 * s.height, 0, kQuarter);
        return revolve(outline);
    }
    Surface operator()(const Cylinder& s) const {
        const double y = 0.5 * s.height;
        Outline outline;
        addLine(outline, {0, -y}, {s.radius, -y});
        addLine(outline, {s.radius, -y}, {s.radius, y});
        addLine(outline, {s.radius, y}, {0, y});
        return revolve(outline);
    }
    Surface operator()(const Cone& s) const {
        const double y = 0.5 * s.height;
        Outline outline;
        addLine(outline, {0, -y}, {s.radius, -y});
        addLine(outline, {s.radius, -y}, {0, y});
        return revolve(outline);
    }
    Surface operator()(const Plane&) const { return {}; }
    Surface operator()(const Hull& s) const { return flat(s.geometry->vertices(), s.geometry->triangles()); }
    Surface operator()(const Mesh& s) const { return flat(s.geometry->vertices(), s.geometry->triangles()); }
    Surface operator()(const Compound& s) const {
        Surface all;
        for (const CompoundPart& part : s.parts) append(all, triangulate(part.shape), part.transform);
        return all;
    }
};

}  // namespace

Surface triangulate(const Shape& shape) {
    return std::visit(Triangulate{}, shape);
}

}  // namespace jacket::demo
