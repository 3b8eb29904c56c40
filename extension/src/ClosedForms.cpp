#include "ClosedForms.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace jacket::bullet {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Parameter in [0, 1] of the point of segment a b nearest to p; exactly 0 or 1 at the ends.
double closestOnSegment(const Vec3& p, const Vec3& a, const Vec3& b) {
    const Vec3 ab = b - a;
    const double length2 = ab.squaredNorm();
    return length2 > 0 ? std::clamp((p - a).dot(ab) / length2, 0.0, 1.0) : 0.0;
}

/// Unit vector from the y axis to p; x on the axis itself.
Vec3 radialDirection(const Vec3& p) {
    const double rho = std::hypot(p.x(), p.z());
    return rho > 0 ? Vec3(p.x() / rho, 0, p.z() / rho) : Vec3::UnitX();
}

/// Surface point of the ball of given radius about `centre`, for p; `fallback` is the normal if p is the centre.
SurfacePoint onBall(const Vec3& p, const Vec3& centre, double radius, const Vec3& fallback) {
    const double distance = (p - centre).stableNorm();
    const Vec3 normal = distance > 0 ? Vec3((p - centre) / distance) : fallback;
    return {centre + radius * normal, normal, distance - radius};
}

SurfacePoint onPlane(const Vec3& p, const Vec3& normal, double distance) {
    return {p - distance * normal, normal, distance};
}

/// The triangle's point `p` with the given weights is where the least translation by -distance along normal starts.
TrianglePoint touching(const Barycentric& b, const Vec3& normal, double distance) {
    return {onPlane(b.point, normal, distance), b.weights};
}

}  // namespace

std::array<double, 2> closestOfSegments(const Vec3& a0, const Vec3& a1, const Vec3& b0, const Vec3& b1) {
    const Vec3 a = a1 - a0, b = b1 - b0, ab = a0 - b0;
    const double aa = a.squaredNorm(), bb = b.squaredNorm();
    const double determinant = a.cross(b).squaredNorm();
    double s = 0;
    if (determinant > 1e-24 * aa * bb)  // else parallel: any s will do, and the clamps below find the overlap
        s = std::clamp((a.dot(b) * b.dot(ab) - bb * a.dot(ab)) / determinant, 0.0, 1.0);
    const double t = closestOnSegment(a0 + s * a, b0, b1);
    return {closestOnSegment(b0 + t * b, a0, a1), t};
}

Vec3 anyPerpendicular(const Vec3& v) {
    int smallest = 0;
    v.cwiseAbs().minCoeff(&smallest);
    const Vec3 across = v.cross(Vec3::Unit(smallest));
    const double length = across.stableNorm();
    return length > 0 ? Vec3(across / length) : Vec3::UnitY();
}

Vec3 triangleNormal(const Mat3& triangle) {
    const Vec3 e0 = triangle.col(1) - triangle.col(0), e1 = triangle.col(2) - triangle.col(1);
    const Vec3 e2 = triangle.col(0) - triangle.col(2);
    const double longest = std::sqrt(std::max({e0.squaredNorm(), e1.squaredNorm(), e2.squaredNorm()}));
    const Vec3 n = e0.cross(e1);
    if (n.norm() > 1e-12 * longest * longest) return n.normalized();
    return anyPerpendicular(e0.norm() >= longest ? e0 : e1.norm() >= longest ? e1 : e2);
}

Barycentric closestOnTriangle(const Vec3& p, const Mat3& triangle) {
    const Vec3 e0 = triangle.col(1) - triangle.col(0), e1 = triangle.col(2) - triangle.col(0);
    const Vec3 n = e0.cross(e1), d = p - triangle.col(0);
    const double area2 = n.squaredNorm(), size2 = std::max(e0.squaredNorm(), e1.squaredNorm());
    if (area2 > 1e-16 * size2 * size2) {  // else a sliver: its edges are near enough
        const double w1 = d.cross(e1).dot(n) / area2, w2 = e0.cross(d).dot(n) / area2;
        const Vec3 w(1 - w1 - w2, w1, w2);
        if (w.minCoeff() > 0) return {w, triangle * w};
    }
    Barycentric best;
    double least = kInfinity;
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3;
        const double t = closestOnSegment(p, triangle.col(i), triangle.col(j));
        Vec3 w = Vec3::Zero();
        w[i] = 1 - t;
        w[j] = t;
        const Vec3 q = triangle * w;
        if (const double d2 = (p - q).squaredNorm(); d2 < least) {
            least = d2;
            best = {w, q};
        }
    }
    return best;
}

// ---------------------------------------------------------------------------------------------------------- sphere

SurfacePoint SphereForm::nearest(const Vec3& p) const {
    return onBall(p, Vec3::Zero(), radius, Vec3::UnitY());
}

TrianglePoint SphereForm::nearestOfTriangle(const Mat3& triangle) const {
    const Barycentric b = closestOnTriangle(Vec3::Zero(), triangle);
    const double distance = b.point.norm();
    if (distance <= 1e-12 * radius) return touching(b, triangleNormal(triangle), -radius);
    return touching(b, b.point / distance, distance - radius);
}

bool SphereForm::isBeyond(const Mat3& triangle, double reach) const {
    const Vec3 corner = triangle.col(0), e0 = triangle.col(1) - corner, e1 = triangle.col(2) - corner;
    const Vec3 n = e0.cross(e1);
    const double size = std::sqrt(std::max(e0.squaredNorm(), e1.squaredNorm())), area2 = n.squaredNorm();
    const double far = radius + reach + 1e-7 * (size + radius);  // more than rounding can add
    if (!(far >= 0)) return false;
    if (corner.squaredNorm() > (far + size) * (far + size)) return true;
    const double height = n.dot(corner);
    const bool isSliver = !(area2 > 1e-16 * size * size * size * size);  // its normal may be any
    return !isSliver && height * height > far * far * area2;
}

Vec3 SphereForm::support(const Vec3& direction) const {
    return radius * direction;
}

// ------------------------------------------------------------------------------------------------------------- box

SurfacePoint BoxForm::nearest(const Vec3& p) const {
    const Vec3 clamped = p.cwiseMax(-half).cwiseMin(half);
    const double outside = (p - clamped).norm();
    if (outside > 0) return {clamped, (p - clamped) / outside, outside};
    int axis = 0;
    const double distance = (p.cwiseAbs() - half).maxCoeff(&axis);
    Vec3 normal = Vec3::Zero();
    normal[axis] = p[axis] < 0 ? -1 : 1;
    return onPlane(p, normal, distance);
}

Vec3 BoxForm::support(const Vec3& direction) const {
    return (direction.array() < 0).select(-half, half);
}

// --------------------------------------------------------------------------------------------------------- capsule

SurfacePoint CapsuleForm::nearest(const Vec3& p) const {
    const Vec3 onAxis(0, std::clamp(p.y(), -halfHeight, halfHeight), 0);
    return onBall(p, onAxis, radius, Vec3::UnitX());
}

Vec3 CapsuleForm::support(const Vec3& direction) const {
    return Vec3(0, direction.y() < 0 ? -halfHeight : halfHeight, 0) + radius * direction;
}

namespace {

/// Nearest points of the capsule's axis and a triangle.
struct AxisPair {
    double y;  // on the axis [m]
    Barycentric onTriangle;
    double distance;  // [m]
};

AxisPair closestOfAxisAndTriangle(double halfHeight, const Mat3& triangle) {
    AxisPair best{0, {}, kInfinity};
    const auto offer = [&](double y, const Barycentric& b) {
        const double distance = (b.point - Vec3(0, y, 0)).norm();
        if (distance < best.distance) best = {y, b, distance};
    };
    for (const double y : {-halfHeight, halfHeight}) offer(y, closestOnTriangle(Vec3(0, y, 0), triangle));
    for (int i = 0; i < 3; ++i) {
        const int j = (i + 1) % 3;
        const Vec3 low(0, -halfHeight, 0), high(0, halfHeight, 0);
        const auto [s, t] = closestOfSegments(low, high, triangle.col(i), triangle.col(j));
        Vec3 w = Vec3::Zero();
        w[i] = 1 - t;
        w[j] = t;
        offer((2 * s - 1) * halfHeight, {w, triangle * w});
    }
    const Vec3 n = triangleNormal(triangle);
    if (std::abs(n.y()) > 1e-12) {  // where the axis meets the plane
        const double y = std::clamp(n.dot(triangle.col(0)) / n.y(), -halfHeight, halfHeight);
        offer(y, closestOnTriangle(Vec3(0, y, 0), triangle));
    }
    return best;
}

/// Least translation of a triangle that the axis pierces, clear of the axis alone: the Minkowski sum of both is a prism
/// with the triangle's normal and the products of axis and edges for faces. distance <= 0 is to the axis, not the
/// surface.
TrianglePoint pulledOffAxis(double halfHeight, const Mat3& triangle) {
    double least = kInfinity;
    Vec3 normal = Vec3::UnitX();
    int edge = -1;  // the edge that touches; -1: an end of the axis touches the triangle
    const auto offer = [&](const Vec3& n, int touchingEdge) {
        const double depth = halfHeight * std::abs(n.y()) - (n.transpose() * triangle).minCoeff();
        if (depth < least) {
            least = depth;
            normal = n;
            edge = touchingEdge;
        }
    };
    const Vec3 n = triangleNormal(triangle);
    offer(n, -1);
    offer(-n, -1);
    for (int i = 0; i < 3; ++i) {
        const Vec3 across = Vec3::UnitY().cross(triangle.col((i + 1) % 3) - triangle.col(i));
        const double length = across.norm();
        if (!(length > 1e-12 * (triangle.col((i + 1) % 3) - triangle.col(i)).norm())) continue;
        offer(across / length, i);
        offer(-across / length, i);
    }
    if (edge < 0) {
        const Vec3 end(0, std::copysign(halfHeight, normal.y()), 0);
        return touching(closestOnTriangle(end - least * normal, triangle), normal, -least);
    }
    const int next = (edge + 1) % 3;
    const auto [s, t] = closestOfSegments(Vec3(0, -halfHeight, 0), Vec3(0, halfHeight, 0),
                                          triangle.col(edge) + least * normal, triangle.col(next) + least * normal);
    Vec3 w = Vec3::Zero();
    w[edge] = 1 - t;
    w[next] = t;
    return touching({w, triangle * w}, normal, -least);
}

}  // namespace

TrianglePoint CapsuleForm::nearestOfTriangle(const Mat3& triangle) const {
    const AxisPair pair = closestOfAxisAndTriangle(halfHeight, triangle);
    if (pair.distance > 1e-12 * (radius + halfHeight)) {
        const Vec3 normal = (pair.onTriangle.point - Vec3(0, pair.y, 0)) / pair.distance;
        return touching(pair.onTriangle, normal, pair.distance - radius);
    }
    const TrianglePoint pulled = pulledOffAxis(halfHeight, triangle);
    return touching({pulled.weights, triangle * pulled.weights}, pulled.surface.normal,
                    pulled.surface.distance - radius);
}

// -------------------------------------------------------------------------------------------------- cylinder, cone

SurfacePoint CylinderForm::nearest(const Vec3& p) const {
    const Vec3 outward = radialDirection(p);
    const double side = p.y() < 0 ? -1 : 1;
    const double beyondSide = outward.dot(p) - radius, beyondCap = std::abs(p.y()) - halfHeight;
    if (beyondSide > 0 && beyondCap > 0) {
        const double distance = std::hypot(beyondSide, beyondCap);
        const Vec3 normal = (beyondSide * outward + beyondCap * side * Vec3::UnitY()) / distance;
        return {radius * outward + side * halfHeight * Vec3::UnitY(), normal, distance};
    }
    if (beyondSide > beyondCap) return onPlane(p, outward, beyondSide);
    return onPlane(p, side * Vec3::UnitY(), beyondCap);
}

/// No translation out of a body is shorter than what takes out one point of the triangle, here the one nearest to the
/// axis; and along its normal no point lies lower. No two points are nearer to each other than to the endless cylinder.
std::optional<TrianglePoint> CylinderForm::sideOfTriangle(const Mat3& triangle) const {
    Mat3 seenAlong = triangle;
    seenAlong.row(1).setZero();
    const Barycentric b = closestOnTriangle(Vec3::Zero(), seenAlong);
    const double rho = b.point.norm(), distance = rho - radius, rounding = 1e-9 * (radius + rho);
    if (!(rho > rounding)) return std::nullopt;
    const Vec3 normal = b.point / rho, point = triangle * b.weights;
    if (std::abs(point.y()) > halfHeight + std::min(0.0, distance)) return std::nullopt;
    if ((normal.transpose() * triangle).minCoeff() < rho - rounding) return std::nullopt;
    return touching({b.weights, point}, normal, distance);
}

Vec3 CylinderForm::support(const Vec3& direction) const {
    return radius * radialDirection(direction) + Vec3(0, direction.y() < 0 ? -halfHeight : halfHeight, 0);
}

SurfacePoint ConeForm::nearest(const Vec3& p) const {
    const Vec3 outward = radialDirection(p), tip(0, halfHeight, 0), rim = radius * outward - tip;
    const double slant = std::hypot(radius, 2 * halfHeight);
    const Vec3 sideNormal = (2 * halfHeight * outward + radius * Vec3::UnitY()) / slant;
    const double beyondSide = sideNormal.dot(p - tip), beyondBase = -halfHeight - p.y();
    if (beyondSide <= 0 && beyondBase <= 0)
        return beyondSide > beyondBase ? onPlane(p, sideNormal, beyondSide) : onPlane(p, -Vec3::UnitY(), beyondBase);

    const double t = closestOnSegment(p, tip, rim);
    if (beyondSide > 0 && t > 0 && t < 1) return onPlane(p, sideNormal, beyondSide);
    if (beyondBase > 0 && outward.dot(p) <= radius) return onPlane(p, -Vec3::UnitY(), beyondBase);
    const Vec3 corner = t > 0 ? rim : tip;
    return onBall(p, corner, 0, t > 0 ? sideNormal : Vec3(Vec3::UnitY()));
}

Vec3 ConeForm::support(const Vec3& direction) const {
    const double radial = std::hypot(direction.x(), direction.z());
    if (2 * halfHeight * direction.y() > radius * radial) return {0, halfHeight, 0};
    return radius * radialDirection(direction) - Vec3(0, halfHeight, 0);
}

// ------------------------------------------------------------------------------------------------------ half space

SurfacePoint HalfSpaceForm::nearest(const Vec3& p) const {
    return onPlane(p, normal, normal.dot(p) - offset);
}

TrianglePoint HalfSpaceForm::nearestOfTriangle(const Mat3& triangle) const {
    const Vec3 heights = (normal.transpose() * triangle).transpose().array() - offset;
    const double lowest = heights.minCoeff();
    const double tie = 1e-12 * (triangle.colwise() - triangle.col(0)).cwiseAbs().maxCoeff();
    Vec3 w = (heights.array() <= lowest + tie).cast<double>();  // a triangle that lies flat touches at its middle
    w /= w.sum();
    return touching({w, triangle * w}, normal, lowest);
}

// ------------------------------------------------------------------------------------------------------------ hull

namespace {

/// Four of the points that are far apart; the last two are the first where all lie on a line or in a plane.
std::array<Vec3, 4> farApart(const std::vector<Vec3>& points) {
    const auto best = [&](const auto& measure) {
        return *std::max_element(points.begin(), points.end(),
                                 [&](const Vec3& a, const Vec3& b) { return measure(a) < measure(b); });
    };
    const Vec3 a = best([&](const Vec3& p) { return (p - points[0]).squaredNorm(); });
    const Vec3 b = best([&](const Vec3& p) { return (p - a).squaredNorm(); });
    const Vec3 c = best([&](const Vec3& p) { return (p - a).cross(b - a).squaredNorm(); });
    const Vec3 d = best([&](const Vec3& p) { return std::abs((b - a).cross(c - a).dot(p - a)); });
    return {a, b, c, d};
}

}  // namespace

Vec3 farthest(const std::vector<Vec3>& points, const Vec3& direction) {
    const auto lower = [&](const Vec3& a, const Vec3& b) { return direction.dot(a) < direction.dot(b); };
    return *std::max_element(points.begin(), points.end(), lower);
}

std::optional<HullForm> HullForm::of(const std::vector<Vec3>& points) {
    if (points.size() < 4) return std::nullopt;
    HullForm hull;
    for (const Vec3& p : points) hull.m_size = std::max(hull.m_size, (p - points[0]).cwiseAbs().maxCoeff());
    const double tolerance = 1e-12 * hull.m_size;
    Polytope polytope;
    if (!polytope.start(farApart(points))) return std::nullopt;
    for (const Vec3& p : points) polytope.add(p, tolerance);

    const auto used = [&](int i) {
        return std::any_of(polytope.faces().begin(), polytope.faces().end(), [&](const Polytope::Face& face) {
            return std::find(face.corners.begin(), face.corners.end(), i) != face.corners.end();
        });
    };
    for (int i = 0; i < int(polytope.points().size()); ++i)
        if (used(i)) hull.m_corners.push_back(polytope.points()[i]);
    for (Polytope::Face face : polytope.faces()) {
        if (!std::isfinite(face.offset)) continue;
        for (int& corner : face.corners) {
            const auto at = std::find(hull.m_corners.begin(), hull.m_corners.end(), polytope.points()[corner]);
            corner = int(at - hull.m_corners.begin());
        }
        hull.m_faces.push_back(face);
    }
    for (const auto& face : hull.m_faces)
        for (const Vec3& p : points)
            if (face.normal.dot(p) > face.offset + 1e-9 * hull.m_size) return std::nullopt;
    return hull;
}

SurfacePoint HullForm::nearest(const Vec3& p) const {
    double highest = -kInfinity;
    SurfacePoint best{p, Vec3::UnitY(), kInfinity};
    const Polytope::Face* top = nullptr;
    for (const auto& face : m_faces) {
        const double height = face.normal.dot(p) - face.offset;
        if (height > highest) {
            highest = height;
            top = &face;
        }
        if (height <= 0 || height >= best.distance) continue;
        const SurfacePoint s = nearestFrom(p, face, height);
        if (s.distance < best.distance) best = s;
    }
    if (highest <= 0) return onPlane(p, top->normal, highest);
    return best;
}

SurfacePoint HullForm::nearestFrom(const Vec3& p, const Polytope::Face& face, double height) const {
    Mat3 triangle;
    for (int i = 0; i < 3; ++i) triangle.col(i) = m_corners[face.corners[i]];
    const Barycentric b = closestOnTriangle(p, triangle);
    const double distance = (p - b.point).norm();
    if (b.weights.minCoeff() > 0 || distance <= 1e-13 * m_size) return onPlane(p, face.normal, height);
    return {b.point, (p - b.point) / distance, distance};
}

Vec3 HullForm::support(const Vec3& direction) const {
    return farthest(m_corners, direction);
}

}  // namespace jacket::bullet
