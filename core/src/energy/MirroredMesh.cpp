#include "energy/MirroredMesh.h"

#include <cmath>

namespace jacket {
namespace {

AffineMap reflection(const Vec3& point, const Vec3& normal) {
    return {Mat3::Identity() - 2.0 * normal * normal.transpose(), 2.0 * normal.dot(point) * normal};
}

AffineMap after(const AffineMap& second, const AffineMap& first) {
    return {second.linear * first.linear, second.linear * first.offset + second.offset};
}

}  // namespace

MirroredMesh::MirroredMesh(const HalfEdgeMesh& mesh, const std::vector<MirrorPlane>& planes,
                           const std::vector<char>& leftOut)
    : m_leftOut(leftOut), m_images(1) {
    m_leftOut.resize(mesh.triangleCount(), 0);
    for (int i = 0; i < mesh.vertexCount(); ++i) {
        m_nodes.push_back({i, 0});
        m_around.emplace_back();
        for (const int t : mesh.trianglesAround(i))
            if (!m_leftOut[t]) m_around.back().push_back(t);
    }
    for (int t = 0; t < mesh.triangleCount(); ++t) {
        const auto corners = mesh.triangles().col(t);
        m_triangles.push_back({corners[0], corners[1], corners[2]});
    }
    m_onPlane.assign(mesh.vertexCount(), 0);
    for (const auto& plane : planes)
        for (const int v : plane.vertices) m_onPlane[v] = 1;
    for (const auto& plane : planes) reflect(plane, mesh.vertexCount());
}

/// Adds the images of all triangles within two rings of the plane. Images of other planes are reflected too where the
/// planes are square to each other, as at the corner of a clamped plate; elsewhere they would lie on top of one
/// another.
void MirroredMesh::reflect(const MirrorPlane& plane, int vertexCount) {
    constexpr double kSquare = 0.1;  // most |cosine| between planes
    std::vector<char> onPlane(vertexCount, 0);
    for (const int v : plane.vertices) onPlane[v] = 1;
    std::vector<char> near(nodeCount(), 0), taken(m_triangles.size(), 0);
    for (int i = 0; i < nodeCount(); ++i) near[i] = onPlane[m_nodes[i].vertex];
    for (int ring = 0; ring < 2; ++ring) {
        for (std::size_t t = 0; t < m_triangles.size(); ++t)
            for (const int i : m_triangles[t]) taken[t] |= near[i];
        for (std::size_t t = 0; t < m_triangles.size(); ++t)
            if (taken[t])
                for (const int i : m_triangles[t]) near[i] = 1;
    }
    const int before = static_cast<int>(m_images.size());
    std::vector<int> imageOf(before, -1), nodeOf(nodeCount(), -1);
    const std::size_t triangles = m_triangles.size();
    for (std::size_t t = 0; t < triangles; ++t) {
        bool reflects = taken[t] && !(t < m_leftOut.size() && m_leftOut[t]);
        for (const int i : m_triangles[t]) {
            const Image& image = m_images[m_nodes[i].image];
            if (image.ofImage || std::abs(image.normal.dot(plane.restNormal)) > kSquare) reflects = false;
        }
        if (!reflects) continue;
        std::array<int, 3> mirrored;
        for (int a = 0; a < 3; ++a) mirrored[a] = imageNode(m_triangles[t][a], plane, onPlane, imageOf, nodeOf);
        std::swap(mirrored[1], mirrored[2]);  // a reflection turns the orientation
        for (const int i : mirrored) m_around[i].push_back(static_cast<int>(m_triangles.size()));
        m_triangles.push_back(mirrored);
    }
}

int MirroredMesh::imageNode(int node, const MirrorPlane& plane, const std::vector<char>& onPlane,
                            std::vector<int>& imageOf, std::vector<int>& nodeOf) {
    const Node original = m_nodes[node];
    if (onPlane[original.vertex]) return node;
    if (nodeOf[node] >= 0) return nodeOf[node];
    if (imageOf[original.image] < 0) {
        imageOf[original.image] = static_cast<int>(m_images.size());
        const Image& seen = m_images[original.image];
        m_images.push_back({after(reflection(plane.restPoint, plane.restNormal), seen.rest),
                            after(reflection(plane.point, plane.normal), seen.world),
                            original.image == 0 ? plane.restNormal : Vec3::Zero(), original.image != 0});
    }
    nodeOf[node] = nodeCount();
    m_nodes.push_back({original.vertex, imageOf[original.image]});
    m_around.emplace_back();
    return nodeOf[node];
}

}  // namespace jacket
