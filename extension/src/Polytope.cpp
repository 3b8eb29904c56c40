#include "Polytope.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

namespace jacket::bullet {

bool Polytope::start(const std::array<Vec3, 4>& points) {
    m_points.assign(points.begin(), points.end());
    m_faces.clear();
    const Vec3 a = points[1] - points[0], b = points[2] - points[0], c = points[3] - points[0];
    const double volume = a.cross(b).dot(c), size = std::max({a.norm(), b.norm(), c.norm()});
    if (!(std::abs(volume) > 1e-12 * a.cross(b).norm() * size)) return false;
    const int i = volume > 0 ? 2 : 1, j = 3 - i;
    addFace(0, i, j);
    addFace(0, j, 3);
    addFace(j, i, 3);
    addFace(i, 0, 3);
    return true;
}

bool Polytope::add(const Vec3& point, double tolerance) {
    m_loose.clear();
    std::erase_if(m_faces, [&](const Face& face) {
        const bool visible = face.normal.dot(point) > face.offset + tolerance;
        if (visible)
            for (int i = 0; i < 3; ++i) m_loose.push_back({face.corners[i], face.corners[(i + 1) % 3]});
        return visible;
    });
    if (m_loose.empty()) return false;
    const int apex = int(m_points.size());
    m_points.push_back(point);
    for (const Edge& edge : m_loose)
        if (isHorizon(edge)) addFace(edge.from, edge.to, apex);
    return true;
}

bool Polytope::isHorizon(const Edge& edge) const {
    return std::none_of(m_loose.begin(), m_loose.end(),
                        [&](const Edge& other) { return other.from == edge.to && other.to == edge.from; });
}

void Polytope::addFace(int a, int b, int c) {
    const Vec3 u = m_points[b] - m_points[a], v = m_points[c] - m_points[a], across = u.cross(v);
    const double area = across.norm();
    const bool sliver = !(area > 1e-13 * std::max(u.squaredNorm(), v.squaredNorm()));
    const Vec3 normal = sliver ? Vec3(Vec3::Zero()) : Vec3(across / area);
    const double offset = normal.dot(m_points[a] + m_points[b] + m_points[c]) / 3;
    m_faces.push_back({{a, b, c}, normal, sliver ? std::numeric_limits<double>::infinity() : offset});
}

}  // namespace jacket::bullet
