#pragma once
#include <array>
#include <optional>
#include <vector>

#include "ConvexContact.h"
#include "Polytope.h"

/// Exact signed distances [m] of simple solids, each centred in its own frame; round ones stand along y. Outside: the
/// nearest point. Inside: the nearest way out. Where several answers are equally near (a centre, an axis) one of them.
/// Input must be finite; the answer then is too, and its normal has unit length.
namespace jacket::bullet {

/// Nearest point of a triangle: weights >= 0 with sum 1, exactly 0 for corners that take no part. Slivers are fine.
struct Barycentric {
    Vec3 weights = Vec3::Zero();
    Vec3 point = Vec3::Zero();
};
Barycentric closestOnTriangle(const Vec3& p, const Mat3& triangle);

/// Parameters of the nearest points of two segments; the first end of parallel ones. Both may have length zero.
std::array<double, 2> closestOfSegments(const Vec3& a0, const Vec3& a1, const Vec3& b0, const Vec3& b1);

/// Unit normal of a triangle; for a sliver, some unit vector across its longest edge.
Vec3 triangleNormal(const Mat3& triangle);

/// Any unit vector at a right angle to the (not necessarily unit) vector v; any at all when v is zero.
Vec3 anyPerpendicular(const Vec3& v);

struct SphereForm {
    double radius;  // [m]
    SurfacePoint nearest(const Vec3& p) const;
    TrianglePoint nearestOfTriangle(const Mat3& triangle) const;
    /// Whether all of a triangle is farther than `reach` off, by its plane and one corner: true only if it is.
    bool isBeyond(const Mat3& triangle, double reach) const;
    Vec3 support(const Vec3& direction) const;
    Vec3 halfExtents() const { return Vec3::Constant(radius); }
};

struct BoxForm {
    Vec3 half;  // half the edge lengths [m]
    SurfacePoint nearest(const Vec3& p) const;
    Vec3 support(const Vec3& direction) const;
    Vec3 halfExtents() const { return half; }
};

struct CapsuleForm {
    double radius;      // [m]
    double halfHeight;  // half the distance of the two end spheres' centres [m]
    SurfacePoint nearest(const Vec3& p) const;
    TrianglePoint nearestOfTriangle(const Mat3& triangle) const;
    Vec3 support(const Vec3& direction) const;
    Vec3 halfExtents() const { return {radius, radius + halfHeight, radius}; }
};

struct CylinderForm {
    double radius;      // [m]
    double halfHeight;  // [m]
    SurfacePoint nearest(const Vec3& p) const;
    /// Where it is the round side that a triangle touches, by the triangle's nearest point to the axis; nothing where
    /// an end may be nearer, or the axis meets the triangle.
    std::optional<TrianglePoint> sideOfTriangle(const Mat3& triangle) const;
    Vec3 support(const Vec3& direction) const;
    Vec3 halfExtents() const { return {radius, halfHeight, radius}; }
};

/// Tip at y = +halfHeight, base at y = -halfHeight.
struct ConeForm {
    double radius;      // of the base [m]
    double halfHeight;  // [m]
    SurfacePoint nearest(const Vec3& p) const;
    Vec3 support(const Vec3& direction) const;
    Vec3 halfExtents() const { return {radius, halfHeight, radius}; }
};

/// All points with normal . x <= offset.
struct HalfSpaceForm {
    Vec3 normal;    // unit
    double offset;  // [m]
    SurfacePoint nearest(const Vec3& p) const;
    TrianglePoint nearestOfTriangle(const Mat3& triangle) const;
};

/// Convex hull of points, as a list of triangles.
class HullForm {
  public:
    /// Nothing when the points lie (nearly) in one plane, or their hull cannot be told in double precision.
    static std::optional<HullForm> of(const std::vector<Vec3>& points);

    SurfacePoint nearest(const Vec3& p) const;
    Vec3 support(const Vec3& direction) const;

  private:
    SurfacePoint nearestFrom(const Vec3& p, const Polytope::Face& face, double height) const;

    std::vector<Vec3> m_corners;
    std::vector<Polytope::Face> m_faces;
    double m_size = 0;  // largest distance of two corners along an axis [m]
};

/// The farthest of the points along a direction.
Vec3 farthest(const std::vector<Vec3>& points, const Vec3& direction);

}  // namespace jacket::bullet
