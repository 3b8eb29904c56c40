#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "ShellAssembly.h"
#include "jacket/Shell.h"

/// How a shell is held: guides, clamps, planes of symmetry, and edits of its rest shape.
namespace jacket {
namespace {

/// Vertices of `set` with a neighbour outside.
std::vector<int> frontOf(const HalfEdgeMesh& mesh, const std::vector<char>& set) {
    std::vector<int> front;
    for (int i = 0; i < mesh.vertexCount(); ++i) {
        const auto neighbours = mesh.neighbours(i);
        if (set[i] && std::any_of(neighbours.begin(), neighbours.end(), [&](int j) { return !set[j]; }))
            front.push_back(i);
    }
    return front;
}

/// Along which the shell leaves the edges between vertices of `set` into triangles that are not all in it; zero where
/// there are none.
Vec3 leavingDirection(const HalfEdgeMesh& mesh, const std::vector<char>& set, const Points& x) {
    Vec3 sum = Vec3::Zero();
    for (int t = 0; t < mesh.triangleCount(); ++t) {
        const auto c = mesh.triangles().col(t);
        for (int a = 0; a < 3; ++a) {
            const int i = c[a], j = c[(a + 1) % 3], k = c[(a + 2) % 3];
            if (!set[i] || !set[j] || set[k]) continue;
            const Vec3 edge = x.col(j) - x.col(i), in = x.col(k) - x.col(i);
            const Vec3 across = in - edge * (edge.dot(in) / edge.squaredNorm());
            sum += edge.norm() * across.normalized();
        }
    }
    return sum.norm() > 0.0 ? Vec3(sum.normalized()) : sum;
}

Vec3 meanOf(const std::vector<int>& vertices, const Points& x) {
    Vec3 sum = Vec3::Zero();
    for (const int i : vertices) sum += x.col(i);
    return sum / static_cast<double>(vertices.size());
}

/// Without the part along the line that the vertices lie on, if they lie on one.
Vec3 acrossLine(const std::vector<int>& vertices, const Points& x, const Vec3& direction) {
    const Vec3 first = x.col(vertices.front());
    const auto farthest = *std::max_element(vertices.begin(), vertices.end(), [&](int a, int b) {
        return (x.col(a) - first).norm() < (x.col(b) - first).norm();
    });
    const Vec3 line = x.col(farthest) - first;
    for (const int i : vertices)
        if ((x.col(i) - first).cross(line).norm() > 1e-3 * line.squaredNorm()) return direction.normalized();
    return (direction - line * (line.dot(direction) / line.squaredNorm())).normalized();
}

void requireOnPlane(const std::vector<int>& vertices, const Points& x, const Vec3& point, const Vec3& normal,
                    const std::string& what) {
    double size = 0.0;
    for (const int i : vertices) size = std::max(size, (x.col(i) - point).norm());
    for (const int i : vertices)
        if (!(std::abs((x.col(i) - point).dot(normal)) <= 0.01 * size))
            throw std::invalid_argument(what + ": vertex " + std::to_string(i) +
                                        " is not on one plane with the others across the direction in which the shell "
                                        "leaves them; hold a curved or angled edge piece by piece");
}

}  // namespace

void Shell::guide(int vertex, const Vec3& direction) {
    ++m_revision;
    requireVertex(vertex, "Shell::guide");
    if (!direction.allFinite() || !(direction.norm() > 0.0))
        throw std::invalid_argument("Shell::guide: direction must be finite and not zero");
    if (m_freedom.empty()) {
        m_freedom.assign(vertexCount(), Mat3::Identity());
        m_guided.assign(vertexCount(), 0);
    }
    m_pinCount += m_pinned[vertex] || m_guided[vertex] ? 0 : 1;
    m_guided[vertex] = 1;
    Mat3& free = m_freedom[vertex];
    const Vec3 fresh = free * direction.normalized();
    if (fresh.norm() > 1e-6) free -= fresh.normalized() * fresh.normalized().transpose();
    if (free.trace() < 0.5) free.setZero();
}

Mat3 Shell::freedom(int vertex) const {
    requireVertex(vertex, "Shell::freedom");
    if (m_pinned[vertex]) return Mat3::Zero();
    return m_freedom.empty() ? Mat3::Identity() : m_freedom[vertex];
}

void Shell::clamp(const std::vector<int>& vertices, std::optional<Vec3> direction) {
    ++m_revision;
    if (vertices.size() < 2) throw std::invalid_argument("Shell::clamp: needs at least two vertices");
    std::vector<char> set(vertexCount(), 0);
    for (const int i : vertices) {
        requireVertex(i, "Shell::clamp");
        set[i] = 1;
    }
    if (direction && (!direction->allFinite() || !(direction->norm() > 0.0)))
        throw std::invalid_argument("Shell::clamp: direction must be finite and not zero");
    const std::vector<int> front = frontOf(*m_mesh, set);
    const Vec3 restLeaving = leavingDirection(*m_mesh, set, m_rest);
    if (front.size() < 2 || !(restLeaving.norm() > 0.0))
        throw std::invalid_argument(
            "Shell::clamp: the vertices must contain an edge of the mesh with a free vertex beside it");
    MirrorPlane plane{.vertices = front,
                      .restPoint = meanOf(front, m_rest),
                      .restNormal = acrossLine(front, m_rest, restLeaving),
                      .point = meanOf(front, m_x),
                      .normal = acrossLine(front, m_x, direction.value_or(leavingDirection(*m_mesh, set, m_x)))};
    requireOnPlane(front, m_rest, plane.restPoint, plane.restNormal, "Shell::clamp");
    requireOnPlane(front, m_x, plane.point, plane.normal, "Shell::clamp");
    for (const int i : vertices) pin(i);
    m_design->clamped.resize(vertexCount(), 0);
    for (const int i : vertices) m_design->clamped[i] = 1;
    m_design->mirrors.push_back(std::move(plane));
    rebuild();
}

void Shell::mirror(const std::vector<int>& vertices, const Vec3& normal) {
    ++m_revision;
    if (vertices.empty()) throw std::invalid_argument("Shell::mirror: needs vertices");
    if (!normal.allFinite() || !(normal.norm() > 0.0))
        throw std::invalid_argument("Shell::mirror: normal must be finite and not zero");
    for (const int i : vertices) requireVertex(i, "Shell::mirror");
    const Vec3 unit = normal.normalized();
    MirrorPlane plane{.vertices = vertices,
                      .restPoint = meanOf(vertices, m_rest),
                      .restNormal = unit,
                      .point = meanOf(vertices, m_x),
                      .normal = unit};
    requireOnPlane(vertices, m_rest, plane.restPoint, unit, "Shell::mirror");
    for (const int i : vertices) guide(i, unit);
    m_design->mirrors.push_back(std::move(plane));
    rebuild();
}

void Shell::setRestPositions(const Points& rest) {
    ++m_revision;
    TriangleMesh mesh{rest, m_mesh->triangles()};
    if (rest.cols() != vertexCount())
        throw std::invalid_argument("Shell::setRestPositions: must have " + std::to_string(vertexCount()) +
                                    " columns, got " + std::to_string(rest.cols()));
    requireUsable(mesh);
    m_rest = rest;
    m_design->flattened = false;
    rebuild();
}

void Shell::flattenRest() {
    ++m_revision;
    m_design->flattened = true;
    rebuild();
}

}  // namespace jacket
