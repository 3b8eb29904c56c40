#pragma once
#include <array>
#include <vector>

#include "jacket/Types.h"

namespace jacket::bullet {

/// A convex polytope of triangles that grows point by point: the incremental hull of a point set, and the inner
/// approximation of a convex solid that is known by its support function only. Keeps its memory when started again.
class Polytope {
  public:
    struct Face {
        std::array<int, 3> corners;  // counter-clockwise seen from outside
        Vec3 normal;                 // unit, outward; zero for a sliver
        double offset;               // normal . x of its plane [m]; infinite for a sliver
    };

    /// Starts from four points; false if they (nearly) lie in one plane.
    bool start(const std::array<Vec3, 4>& points);

    /// Adds a point that lies more than `tolerance` [m] outside of at least one face; false, and no change, if none.
    bool add(const Vec3& point, double tolerance);

    const std::vector<Vec3>& points() const { return m_points; }
    const std::vector<Face>& faces() const { return m_faces; }

  private:
    struct Edge {
        int from, to;
    };
    void addFace(int a, int b, int c);
    bool isHorizon(const Edge& edge) const;

    std::vector<Vec3> m_points;
    std::vector<Face> m_faces;
    std::vector<Edge> m_loose;  // edges of the faces that were just removed
};

}  // namespace jacket::bullet
