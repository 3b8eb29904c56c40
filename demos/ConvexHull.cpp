#include "ConvexHull.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "Segment.h"

namespace jacket::demo {

namespace {

struct Face {
    std::array<int, 3> corners;
    Vec3 normal;
    double offset;
};

Face makeFace(const Points& x, int a, int b, int c) {
    const Vec3 pa = x.col(a), pb = x.col(b), pc = x.col(c);
    const Vec3 normal = (pb - pa).cross(pc - pa).normalized();
    return {{a, b, c}, normal, normal.dot((pa + pb + pc) / 3.0)};
}

int farthest(const Points& x, auto&& distance) {
    int best = 0;
    for (int i = 1; i < x.cols(); ++i)
        if (distance(x.col(i)) > distance(x.col(best))) best = i;
    return best;
}

/// Four points that span a solid, as its four faces.
std::vector<Face> firstTetrahedron(const Points& x, double tolerance) {
    const int a = farthest(x, [](const Vec3& p) { return p.x(); });
    const Vec3 pa = x.col(a);
    const int b = farthest(x, [&](const Vec3& p) { return (p - pa).norm(); });
    const Vec3 ab = (x.col(b) - pa).normalized();
    const int c = farthest(x, [&](const Vec3& p) { return (p - pa).cross(ab).norm(); });
    const Vec3 normal = ab.cross(x.col(c) - pa).normalized();
    const int d = farthest(x, [&](const Vec3& p) { return std::abs(normal.dot(p - pa)); });
    const double height = normal.dot(x.col(d) - pa);
    if (!(std::abs(height) > tolerance)) throw std::invalid_argument("the points lie in a plane and span no solid");
    if (height > 0) return {makeFace(x, a, c, b), makeFace(x, a, b, d), makeFace(x, b, c, d), makeFace(x, c, a, d)};
    return {makeFace(x, a, b, c), makeFace(x, a, d, b), makeFace(x, b, d, c), makeFace(x, c, d, a)};
}

/// Replaces the faces that see the point by a fan from it to their outline.
void addPoint(const Points& x, int point, double tolerance, std::vector<Face>& faces) {
    const auto sees = [&](const Face& face) { return face.normal.dot(x.col(point)) - face.offset > tolerance; };
    std::map<std::pair<int, int>, int> edges;  // directed edges of seen faces
    for (const Face& face : faces)
        if (sees(face))
            for (int k = 0; k < 3; ++k) ++edges[{face.corners[k], face.corners[(k + 1) % 3]}];
    if (edges.empty()) return;
    std::erase_if(faces, sees);
    for (const auto& [edge, count] : edges)
        if (!edges.contains({edge.second, edge.first})) faces.push_back(makeFace(x, edge.first, edge.second, point));
}

double distanceToTriangle(const Vec3& p, const std::array<Vec3, 3>& corners, const Vec3& normal) {
    bool isAbove = true;
    double distance = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
        const Vec3 &a = corners[k], &b = corners[(k + 1) % 3];
        isAbove = isAbove && (b - a).cross(p - a).dot(normal) >= 0;
        distance = std::min(distance, distanceToSegment(p, a, b));
    }
    return isAbove ? std::abs(normal.dot(p - corners[0])) : distance;
}

}  // namespace

ConvexHull::ConvexHull(const Points& points) {
    if (points.cols() < 4) throw std::invalid_argument("a solid needs at least 4 points");
    const double size = (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).norm();
    const double tolerance = 1e-10 * size;
    std::vector<Face> faces = firstTetrahedron(points, 1e-6 * size);
    for (int i = 0; i < points.cols(); ++i) addPoint(points, i, tolerance, faces);

    std::map<int, int> newIndex;
    for (const Face& face : faces)
        for (const int corner : face.corners) newIndex.emplace(corner, static_cast<int>(newIndex.size()));
    m_vertices.resize(3, static_cast<Eigen::Index>(newIndex.size()));
    for (const auto& [old, now] : newIndex) m_vertices.col(now) = points.col(old);

    const auto count = static_cast<Eigen::Index>(faces.size());
    m_triangles.resize(3, count);
    m_normals.resize(3, count);
    m_offsets.resize(count);
    for (Eigen::Index t = 0; t < count; ++t) {
        for (int k = 0; k < 3; ++k) m_triangles(k, t) = newIndex[faces[t].corners[k]];
        m_normals.col(t) = faces[t].normal;
        m_offsets[t] = faces[t].offset;
    }
    computeVolume();
}

void ConvexHull::computeVolume() {
    const Vec3 inside = m_vertices.rowwise().mean();
    Vec3 moment = Vec3::Zero();
    for (int t = 0; t < m_triangles.cols(); ++t) {
        const Vec3 a = m_vertices.col(m_triangles(0, t)), b = m_vertices.col(m_triangles(1, t)),
                   c = m_vertices.col(m_triangles(2, t));
        const double volume = (a - inside).dot((b - inside).cross(c - inside)) / 6.0;
        m_volume += volume;
        moment += volume * (a + b + c + inside) / 4.0;
    }
    m_centroid = moment / m_volume;
}

double ConvexHull::signedDistance(const Vec3& point) const {
    const double planes = (m_normals.transpose() * point - m_offsets).maxCoeff();
    if (planes <= 0) return planes;  // inside, the nearest face plane is the nearest face
    double distance = std::numeric_limits<double>::infinity();
    for (int t = 0; t < m_triangles.cols(); ++t) {
        const std::array<Vec3, 3> corners{m_vertices.col(m_triangles(0, t)), m_vertices.col(m_triangles(1, t)),
                                          m_vertices.col(m_triangles(2, t))};
        distance = std::min(distance, distanceToTriangle(point, corners, m_normals.col(t)));
    }
    return distance;
}

}  // namespace jacket::demo
