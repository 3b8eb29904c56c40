#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "jacket/Types.h"

class btCollisionShape;

namespace jacket::bullet {

/// The nearest point of a body's surface to a point: distance < 0 inside; normal unit, out of the body.
struct SurfacePoint {
    Vec3 point;
    Vec3 normal;
    double distance;
};

/// How a triangle meets a convex body: `weights` are the barycentric coordinates of the triangle's touching point, and
/// `surface` the body's; distance < 0 when they overlap (by the least translation along the normal).
struct TrianglePoint {
    SurfacePoint surface;
    Vec3 weights;
};

/// One convex piece of a collision shape, in the frame of the body that owns the shape. Double precision. Thread-safe
/// unless it asks that shape.
class ConvexPiece {
  public:
    virtual ~ConvexPiece() = default;
    /// Nearest surface point if the point is inside or at most `reach` outside. `p` must be finite.
    virtual std::optional<SurfacePoint> touch(const Vec3& p, double reach) const = 0;
    /// The same for a triangle (columns are its corners).
    virtual std::optional<TrianglePoint> touch(const Eigen::Matrix3d& triangle, double reach) const = 0;
    /// Bounds in the body's frame; infinite for planes.
    virtual Vec3 lower() const = 0;
    virtual Vec3 upper() const = 0;
    /// Whether touch() asks a shape that may be the user's own: not to be done by another thread than the world's.
    virtual bool asksShape() const = 0;
};

/// A convex solid known by its support function only, in its own frame. Must be thread-safe.
class SupportMap {
  public:
    virtual ~SupportMap() = default;
    /// The farthest point of the solid along a unit direction [m].
    virtual Vec3 support(const Vec3& direction) const = 0;
    /// Rounding of support(), relative to the solid's size.
    virtual double accuracy() const { return 1e-15; }
};

/// Touches any convex solid by its support function. libccd (MPR) says whether the two overlap and gives a first
/// normal; its normals can be tens of degrees off, so overlaps are refined by an expanding polytope and separations by
/// closest points, both bounded, and every answer is checked: along its normal n, support(n) . n and the lowest corner
/// must be `distance` apart. Works in units of half the solid's smallest extent. The map must outlive this.
class CcdContact {
  public:
    explicit CcdContact(const SupportMap& map);
    std::optional<SurfacePoint> touch(const Vec3& p, double reach) const;
    std::optional<TrianglePoint> touch(const Mat3& triangle, double reach) const;
    Vec3 lower() const { return m_lower; }
    Vec3 upper() const { return m_upper; }

  private:
    const SupportMap& m_map;
    Vec3 m_lower, m_upper;  // bounds [m]
    Vec3 m_centre;          // an interior point [m]
    double m_scale;         // the unit of length inside [m]
    double m_tolerance;     // of distances inside [-]
};

}  // namespace jacket::bullet
