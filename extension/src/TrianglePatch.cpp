#include "TrianglePatch.h"

#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletCollision/CollisionShapes/btScaledBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btTriangleCallback.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "ClosedForms.h"

namespace jacket::bullet {
namespace {

constexpr double kFlat = 1e-4;      // sine of the bend below which an edge is no ridge
constexpr double kParallel = 0.02;  // sine of the angle below which two edges do not cross
constexpr double kAcross = 0.5;     // cosine of the angle to a fold's normal, beyond which it is pushed along it
constexpr double kSteep = 0.87;     // sine of the angle to a triangle beyond which its edges are not pushed into it
constexpr double kCone = 1e-6;      // how far, relative, a neighbour may stand out over a tip or a ridge

bool mirrors(const btVector3& scaling) {
    return scaling.x() * scaling.y() * scaling.z() < btScalar(0);
}

bool isMirrored(const btConcaveShape& shape) {
    bool mirrored = mirrors(shape.getLocalScaling());
    if (shape.getShapeType() == SCALED_TRIANGLE_MESH_SHAPE_PROXYTYPE)
        mirrored ^= mirrors(static_cast<const btScaledBvhTriangleMeshShape&>(shape).getChildShape()->getLocalScaling());
    return mirrored;
}

/// The front of a heightfield, whatever the winding of its triangles: where it has the larger heights. Zero for meshes.
Vec3 upOf(const btConcaveShape& shape) {
    if (shape.getShapeType() != TERRAIN_SHAPE_PROXYTYPE) return Vec3::Zero();
    const int axis = static_cast<const btHeightfieldTerrainShape&>(shape).getUpAxis();
    return shape.getLocalScaling()[axis] < btScalar(0) ? -Vec3::Unit(axis) : Vec3(Vec3::Unit(axis));
}

class Gatherer final : public btTriangleCallback {
  public:
    Gatherer(const btConcaveShape& shape, const Bounds& box, std::vector<Mat3>& triangles)
        : m_box(box), m_triangles(triangles), m_up(upOf(shape)), m_mirrored(isMirrored(shape)) {}

    void processTriangle(btVector3* corners, int, int) override {
        Mat3 triangle;
        for (int i = 0; i < 3; ++i) triangle.col(i) = fromBullet(corners[i]);
        if (!triangle.allFinite()) return;
        if (!m_box.overlaps({triangle.rowwise().minCoeff(), triangle.rowwise().maxCoeff()})) return;
        const Vec3 a = triangle.col(1) - triangle.col(0), b = triangle.col(2) - triangle.col(0), n = a.cross(b);
        if (!(n.norm() > 1e-12 * std::max({a.squaredNorm(), b.squaredNorm(), (b - a).squaredNorm()}))) return;
        if (m_up.isZero() ? m_mirrored : n.dot(m_up) < 0) triangle.col(1).swap(triangle.col(2));
        m_triangles.push_back(triangle);
    }

  private:
    const Bounds& m_box;
    std::vector<Mat3>& m_triangles;
    Vec3 m_up;
    bool m_mirrored;
};

Bounds boundsOf(const Mat3& triangle) {
    return {triangle.rowwise().minCoeff(), triangle.rowwise().maxCoeff()};
}

Bounds grown(Bounds bounds, double by) {
    bounds.lower.array() -= by;
    bounds.upper.array() += by;
    return bounds;
}

Vec3 unitOr(const Vec3& v, const Vec3& fallback) {
    const double length = v.norm();
    return length > 1e-12 ? Vec3(v / length) : fallback;
}

bool comesBefore(const Vec3& a, const Vec3& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

}  // namespace

TrianglePatch::TrianglePatch(const btConcaveShape& shape, const Bounds& box) : m_box(box) {
    std::vector<Mat3> triangles;
    Gatherer gatherer(shape, box, triangles);
    shape.processAllTriangles(&gatherer, toBullet(box.lower), toBullet(box.upper));
    weld(triangles);
    connect();
    std::vector<Bounds> bounds;
    for (const Mat3& t : triangles) bounds.push_back(boundsOf(t));
    m_tree = BoxTree(bounds);
    collectRidges();
}

void TrianglePatch::weld(const std::vector<Mat3>& triangles) {
    const auto at = [&](int i) -> Vec3 { return triangles[i / 3].col(i % 3); };
    std::vector<int> order(3 * triangles.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](int i, int j) { return comesBefore(at(i), at(j)); });
    m_triangles.resize(triangles.size());
    for (const int i : order) {
        if (m_corners.empty() || at(i) != m_corners.back().point) m_corners.push_back({.point = at(i)});
        m_triangles[i / 3][i % 3] = int(m_corners.size()) - 1;
    }
    for (const Mat3& t : triangles) m_normals.push_back(triangleNormal(t));
}

/// Edges, and the normals of edges and corners that tell front from back: see Baerentzen and Aanaes, Signed Distance
/// Computation Using the Angle Weighted Pseudonormal, 2005.
void TrianglePatch::connect() {
    struct Side {
        int low, high, face, corner;
    };
    std::vector<Side> sides;
    for (int t = 0; t < triangleCount(); ++t) {
        const auto& c = m_triangles[t];
        for (int i = 0; i < 3; ++i) {
            const int a = c[(i + 1) % 3], b = c[(i + 2) % 3];
            sides.push_back({std::min(a, b), std::max(a, b), t, i});
            const Vec3 u = m_corners[a].point - m_corners[c[i]].point, v = m_corners[b].point - m_corners[c[i]].point;
            m_corners[c[i]].normal += std::atan2(u.cross(v).norm(), u.dot(v)) * m_normals[t];
            m_corners[c[i]].faces.push_back(t);
        }
    }
    std::sort(sides.begin(), sides.end(), [](const Side& s, const Side& t) {
        return std::tie(s.low, s.high, s.face) < std::tie(t.low, t.high, t.face);
    });
    m_edgesOf.resize(m_triangles.size());
    for (std::size_t k = 0; k < sides.size(); ++k) {
        const Side& s = sides[k];
        const int opposite = m_triangles[s.face][s.corner];
        if (k == 0 || s.low != m_edges.back().a || s.high != m_edges.back().b)
            m_edges.push_back({s.low, s.high, {s.face, -1}, {opposite, opposite}, Vec3::Zero()});
        Edge& edge = m_edges.back();
        if (edge.faces[0] != s.face) edge.faces[1] = s.face, edge.opposite[1] = opposite;
        edge.normal += m_normals[s.face];
        m_edgesOf[s.face][s.corner] = int(m_edges.size()) - 1;
    }
    for (Corner& corner : m_corners) corner.normal = unitOr(corner.normal, m_normals[corner.faces[0]]);
    for (int e = 0; e < int(m_edges.size()); ++e) {
        Edge& edge = m_edges[e];
        edge.normal = unitOr(edge.normal, m_normals[edge.faces[0]]);
        for (const int end : {edge.a, edge.b}) {
            m_corners[end].edges.push_back(e);
            m_corners[end].isBorder |= edge.faces[1] < 0;
        }
    }
}

bool TrianglePatch::isRidge(const Edge& edge) const {
    if (edge.faces[1] < 0) return true;
    const Vec3 &a = m_corners[edge.a].point, &b = m_corners[edge.b].point, along = b - a;
    const auto rises = [&](int side) {
        const Vec3 across = m_corners[edge.opposite[side]].point - a;
        const Vec3 inward = across - across.dot(along) / along.squaredNorm() * along;
        return m_normals[edge.faces[1 - side]].dot(inward) / inward.norm();
    };
    return rises(0) < -kFlat && rises(1) < -kFlat;
}

void TrianglePatch::collectRidges() {
    std::vector<Bounds> bounds;
    std::vector<char> isTip(m_corners.size(), 0);
    for (const Edge& edge : m_edges) {
        if (!isRidge(edge)) continue;
        const Vec3 &a = m_corners[edge.a].point, &b = m_corners[edge.b].point;
        Ridge ridge{a, b - a, edge.normal, {}, {-1, -1}};
        for (int side = 0; side < 2; ++side)
            ridge.inward[side] = (m_corners[edge.opposite[side]].point - a).normalized();
        for (const int end : {edge.a, edge.b})
            if (!std::exchange(isTip[end], 1)) ridge.tips[end == edge.b] = end;
        m_ridges.push_back(ridge);
        bounds.push_back({a.cwiseMin(b), a.cwiseMax(b)});
    }
    m_ridgeTree = BoxTree(bounds);
}

Mat3 TrianglePatch::triangle(int face) const {
    Mat3 result;
    for (int i = 0; i < 3; ++i) result.col(i) = m_corners[m_triangles[face][i]].point;
    return result;
}

TrianglePatch::Nearest TrianglePatch::classify(int face, const Vec3& p, const Vec3& weights, const Vec3& point) const {
    const auto& corners = m_triangles[face];
    const auto taking = (weights.array() > 0).count();
    Vec3 normal = m_normals[face];
    bool isBorder = false;
    if (taking == 1) {
        int i = 0;
        weights.maxCoeff(&i);
        normal = m_corners[corners[i]].normal;
        isBorder = m_corners[corners[i]].isBorder;
    } else if (taking == 2) {
        int opposite = 0;
        weights.minCoeff(&opposite);
        const Edge& edge = m_edges[m_edgesOf[face][opposite]];
        normal = edge.normal;
        isBorder = edge.faces[1] < 0;
    }
    const Vec3 offset = p - point;
    const double distance = offset.norm(), height = normal.dot(offset);
    const double size = p.cwiseAbs().maxCoeff() + point.cwiseAbs().maxCoeff();
    Nearest result{face, weights, point, distance, normal, height < 0};
    if (isBorder && result.isBehind) {  // beyond it is outside; where a seam was left open, below it is not
        const double beyond = (offset - height * normal).norm();
        result.isBehind = beyond <= 1e-6 * distance;
    }
    // On the surface itself the way there has no direction.
    if (taking < 3 && distance > 1e-9 * size && std::abs(height) < (1 - 1e-12) * distance)
        result.normal = (result.isBehind ? -1 : 1) / distance * offset;
    return result;
}

std::optional<TrianglePatch::Nearest> TrianglePatch::nearest(const Vec3& p, double radius) const {
    std::optional<Nearest> best;
    m_tree.visitNearest(p, radius, [&](int face) {
        const Barycentric b = closestOnTriangle(p, triangle(face));
        const double distance = (p - b.point).norm();
        if (distance > radius || (best && !best->isBehind && distance >= best->distance)) return;
        const Nearest here = classify(face, p, b.weights, b.point);
        // Equally near in front and behind: a sheet of triangles on both sides.
        const double tie = 1e-12 * (distance + p.cwiseAbs().maxCoeff());
        if (best && here.isBehind && distance >= best->distance - tie) return;
        best = here;
        radius = std::min(radius, distance + tie);
    });
    return best;
}

/// Behind an edge or a corner there are several sides to be pushed out of.
void TrianglePatch::pushOut(const Nearest& nearest, const Vec3& p, std::vector<SurfacePoint>& touched) const {
    std::vector<int> faces{nearest.face};
    const auto& corners = m_triangles[nearest.face];
    const auto taking = (nearest.weights.array() > 0).count();
    int index = 0;
    if (taking == 1) {
        nearest.weights.maxCoeff(&index);
        faces = m_corners[corners[index]].faces;
    } else if (taking == 2) {
        nearest.weights.minCoeff(&index);
        for (const int face : m_edges[m_edgesOf[nearest.face][index]].faces)
            if (face >= 0 && face != nearest.face) faces.push_back(face);
    }
    for (const int face : faces) {
        const Vec3& n = m_normals[face];
        const double distance = n.dot(p - nearest.point);
        if (distance < 0) touched.push_back({p - distance * n, n, distance});
    }
}

void TrianglePatch::touch(const Vec3& p, double reach, double depth, std::vector<SurfacePoint>& touched) const {
    const auto first = nearest(p, std::max(reach, depth));
    if (!first) return;
    if (first->isBehind) {
        if (first->distance <= depth && -first->distance <= reach) pushOut(*first, p, touched);
    } else if (first->distance <= reach) {
        touched.push_back({first->point, first->normal, first->distance});
    } else {
        return;
    }
    if (!(reach > 0)) return;
    const double plane = first->normal.dot(first->point), above = 1e-6 * reach;
    const auto isAbove = [&](const Bounds& bounds) {
        return bounds.squaredDistance(p) <= reach * reach && bounds.farthestAlong(first->normal) > plane + above;
    };
    m_tree.visit(isAbove, [&](int face) {
        if (face == first->face) return;
        const Barycentric b = closestOnTriangle(p, triangle(face));
        if ((p - b.point).squaredNorm() > reach * reach || first->normal.dot(b.point) <= plane + above) return;
        const Nearest other = classify(face, p, b.weights, b.point);
        if (!other.isBehind) touched.push_back({other.point, other.normal, other.distance});
    });
}

std::optional<SurfacePoint> TrianglePatch::touchNearest(const Vec3& p, double reach, double depth) const {
    const auto found = nearest(p, std::max(reach, depth));
    if (!found || found->distance > (found->isBehind ? depth : reach)) return std::nullopt;
    return SurfacePoint{found->point, found->normal, found->isBehind ? -found->distance : found->distance};
}

bool TrianglePatch::isInside(const Vec3& p, double depth) const {
    const auto found = nearest(p, depth);
    return found && found->isBehind;
}

std::optional<TrianglePoint> TrianglePatch::touchTip(int index, const FaceQuery& query) const {
    const Corner& tip = m_corners[index];
    const Vec3 n = query.normal.dot(tip.normal) < 0 ? -query.normal : query.normal;
    if (!query.isNear(n.dot(query.triangle.col(0) - tip.point))) return std::nullopt;
    for (const int e : tip.edges) {
        const Vec3 away = m_corners[m_edges[e].a == index ? m_edges[e].b : m_edges[e].a].point - tip.point;
        if (n.dot(away) > kCone * away.norm()) return std::nullopt;
    }
    const Barycentric b = closestOnTriangle(tip.point, query.triangle);
    if (!(b.weights.minCoeff() > 0)) return std::nullopt;  // a ridge and an edge say it
    return TrianglePoint{{tip.point, n, n.dot(b.point - tip.point)}, b.weights};
}

/// Whether to push an edge of a triangle in a direction across it would be to push it along its sheet: one of the two
/// triangles there goes on against it, steeply, and it does not lead off their fold either.
bool TrianglePatch::isIntoSheet(const Vec3& direction, const ShellEdge& edge, const FaceQuery& query, int side) {
    const Vec3 start = query.triangle.col(side), along = query.triangle.col((side + 1) % 3) - start;
    const auto goesAgainst = [&](const Vec3& third) {
        const Vec3 way = third - start, inward = way - way.dot(along) / along.squaredNorm() * along;
        return direction.dot(inward) < -kSteep * inward.norm();
    };
    const bool isShared = edge.kind == ShellEdge::kShared;
    if (!goesAgainst(query.triangle.col((side + 2) % 3)) && !(isShared && goesAgainst(edge.beyond))) return false;
    if (!isShared) return true;
    const Vec3 fold = query.normal + unitOr((edge.beyond - start).cross(along), Vec3::Zero());
    return std::abs(direction.dot(fold)) < kAcross * fold.norm();
}

std::optional<TrianglePoint> TrianglePatch::touchRidge(const Ridge& ridge, const FaceQuery& query, int side,
                                                       const ShellEdge& edge) const {
    const int next = (side + 1) % 3;
    const Vec3 start = query.triangle.col(side), along = query.triangle.col(next) - start;
    Vec3 n = along.cross(ridge.along);
    const double length = std::copysign(n.norm(), n.dot(ridge.normal));
    if (!(std::abs(length) > kParallel * along.norm() * ridge.along.norm())) return std::nullopt;
    n /= length;
    if (n.dot(ridge.inward[0]) > kCone || n.dot(ridge.inward[1]) > kCone) return std::nullopt;
    if (isIntoSheet(n, edge, query, side)) return std::nullopt;
    const double distance = n.dot(start - ridge.start);  // of the two lines
    if (!query.isNear(distance)) return std::nullopt;
    const auto [s, t] = closestOfSegments(start, start + along, ridge.start, ridge.start + ridge.along);
    if (!(s > 1e-9 && s < 1 - 1e-9 && t > 1e-9 && t < 1 - 1e-9)) return std::nullopt;
    Vec3 weights = Vec3::Zero();
    weights[side] = 1 - s;
    weights[next] = s;
    return TrianglePoint{{ridge.start + t * ridge.along, n, distance}, weights};
}

void TrianglePatch::touch(const Mat3& triangle, const std::array<ShellEdge, 3>& edges, double reach, double depth,
                          std::vector<TrianglePoint>& touched) const {
    const FaceQuery query{triangle, triangleNormal(triangle), reach, depth};
    std::array<std::optional<TrianglePoint>, 4> deepest;  // of the edges, of the inside
    const auto offer = [&](int place, const std::optional<TrianglePoint>& t) {
        if (!t || (deepest[place] && t->surface.distance >= deepest[place]->surface.distance)) return;
        if (t->surface.distance >= 0 || isInside(triangle * t->weights, depth)) deepest[place] = t;
    };
    const Bounds near = grown(boundsOf(triangle), std::max(reach, depth));
    m_ridgeTree.visit([&](const Bounds& bounds) { return bounds.overlaps(near); },
                      [&](int index) {
                          const Ridge& ridge = m_ridges[index];
                          for (int side = 0; side < 3; ++side)
                              if (edges[side].kind != ShellEdge::kLeftOut)
                                  offer(side, touchRidge(ridge, query, side, edges[side]));
                          for (const int tip : ridge.tips)
                              if (tip >= 0) offer(3, touchTip(tip, query));
                      });
    for (const auto& t : deepest)
        if (t) touched.push_back(*t);
}

}  // namespace jacket::bullet
