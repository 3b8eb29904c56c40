#pragma once
#include <array>
#include <vector>

#include "jacket/Types.h"

namespace jacket::demo {

/// Triangles that bound a solid, or only cover it, as ground does. Throws std::invalid_argument when there are none, or
/// one has no area.
class SurfaceMesh {
  public:
    SurfaceMesh(const Points& vertices, const Indices<3>& triangles);

    const Points& vertices() const { return m_vertices; }        ///< [m]
    const Indices<3>& triangles() const { return m_triangles; }  ///< counter-clockwise seen from outside
    /// Exact distance; negative behind the nearest triangle [m]. Beyond an open border nothing is behind.
    double signedDistance(const Vec3& point) const;

  private:
    struct Face {
        std::array<Vec3, 3> corners;
        Vec3 normal;
        std::array<bool, 3> isBorder;  // of the edges from each corner to the next
        Vec3 centre;                   // of a ball that holds the triangle
        double radius;
    };
    Points m_vertices;
    Indices<3> m_triangles;
    std::vector<Face> m_faces;
};

}  // namespace jacket::demo
