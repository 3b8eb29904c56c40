#include "SurfaceMesh.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>

#include "Segment.h"

namespace jacket::demo {

SurfaceMesh::SurfaceMesh(const Points& vertices, const Indices<3>& triangles)
    : m_vertices(vertices), m_triangles(triangles) {
    if (triangles.cols() == 0) throw std::invalid_argument("has no triangles");
    std::map<std::pair<int, int>, int> uses;
    const auto edge = [&](Eigen::Index t, int k) { return std::minmax({triangles(k, t), triangles((k + 1) % 3, t)}); };
    for (Eigen::Index t = 0; t < triangles.cols(); ++t)
        for (int k = 0; k < 3; ++k) ++uses[edge(t, k)];
    for (Eigen::Index t = 0; t < triangles.cols(); ++t) {
        Face face;
        for (int k = 0; k < 3; ++k) {
            face.corners[k] = vertices.col(triangles(k, t));
            face.isBorder[k] = uses[edge(t, k)] == 1;
        }
        const auto& [a, b, c] = face.corners;
        const Vec3 normal = (b - a).cross(c - a);
        if (!(normal.norm() > 0)) throw std::invalid_argument("triangle " + std::to_string(t) + " has no area");
        face.normal = normal.normalized();
        face.centre = (a + b + c) / 3.0;
        face.radius = 0;
        for (const Vec3& corner : face.corners) face.radius = std::max(face.radius, (corner - face.centre).norm());
        m_faces.push_back(face);
    }
}

/// At an edge or a corner several triangles are equally near; the one whose plane is farthest says which side it is.
double SurfaceMesh::signedDistance(const Vec3& point) const {
    double nearest = std::numeric_limits<double>::infinity(), farthestPlane = 0;
    bool isBehind = false;
    for (const Face& face : m_faces) {
        if ((point - face.centre).norm() - face.radius > nearest) continue;
        const double height = face.normal.dot(point - face.corners[0]);
        double distance = std::abs(height);
        bool isAbove = true, isBeyond = false;
        for (int k = 0; k < 3; ++k)
            isAbove =
                isAbove &&
                (face.corners[(k + 1) % 3] - face.corners[k]).cross(point - face.corners[k]).dot(face.normal) >= 0;
        if (!isAbove) {
            distance = std::numeric_limits<double>::infinity();
            for (int k = 0; k < 3; ++k) {
                const double d = distanceToSegment(point, face.corners[k], face.corners[(k + 1) % 3]);
                if (d < distance) isBeyond = face.isBorder[k];
                distance = std::min(distance, d);
            }
        }
        const double tie = 1e-9 * face.radius;
        if (distance > nearest + tie) continue;
        if (distance < nearest - tie) farthestPlane = -1;
        if (std::abs(height) > farthestPlane) {
            farthestPlane = std::abs(height);
            isBehind = height < 0 && !isBeyond;
        }
        nearest = std::min(nearest, distance);
    }
    return isBehind ? -nearest : nearest;
}

}  // namespace jacket::demo
