#pragma once
#include <vector>

#include "jacket/Types.h"

namespace jacket::demo {

/// Convex hull of points, as triangles facing outward. Throws std::invalid_argument when the points lie in a plane.
class ConvexHull {
  public:
    explicit ConvexHull(const Points& points);

    const Points& vertices() const { return m_vertices; }        ///< of the hull only [m]
    const Indices<3>& triangles() const { return m_triangles; }  ///< counter-clockwise seen from outside
    Vec3 centroid() const { return m_centroid; }                 ///< of the solid [m]
    double volume() const { return m_volume; }                   ///< [m^3]
    double signedDistance(const Vec3& point) const;              ///< exact, negative inside [m]

  private:
    void computeVolume();

    Points m_vertices;
    Indices<3> m_triangles;
    Points m_normals;           ///< of the triangles, outward, unit
    Eigen::VectorXd m_offsets;  ///< normal . x of the triangles' planes [m]
    Vec3 m_centroid;
    double m_volume = 0.0;
};

}  // namespace jacket::demo
