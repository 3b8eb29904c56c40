#pragma once
#include <array>
#include <optional>
#include <vector>

#include "BoxTree.h"
#include "Convert.h"
#include "ConvexContact.h"

class btConcaveShape;

namespace jacket::bullet {

/// How the edge of a shell's triangle is asked about: two triangles share each, and one of them is enough. What two
/// triangles share is pushed across one of them, or across their fold; a border also into its triangle.
struct ShellEdge {
    enum Kind { kLeftOut, kShared, kBorder };
    Kind kind;
    Vec3 beyond;  ///< third corner of the triangle that shares the edge
    ShellEdge(Kind asked, const Vec3& third = Vec3::Zero()) : kind(asked), beyond(third) {}
};

/// The triangles of a concave shape that lie near a shell, in the shape's frame.
///
/// The surface is that of the triangles themselves, without Bullet's margin, and one-sided: a point behind it is pushed
/// out to the front. The front is where corners are counter-clockwise; of a heightfield, up. A shape of negative scale
/// is the mirror image. Corners at exactly the same place are one. Beyond an open border nothing is behind: the border
/// is an edge like any other. Triangles that are not finite or have no area are left out.
class TrianglePatch {
  public:
    /// Asks the shape for its triangles in the box, which must be finite.
    TrianglePatch(const btConcaveShape& shape, const Bounds& box);

    const Bounds& box() const { return m_box; }
    int triangleCount() const { return int(m_triangles.size()); }

    /// Appends what a point can touch: the nearest surface point if it is at most `reach` in front or `depth` behind,
    /// and the further ones in front, within reach, that do not lie behind the plane of the first: the other side of a
    /// valley. A point behind a valley's bottom gets every side of it.
    void touch(const Vec3& p, double reach, double depth, std::vector<SurfacePoint>& touched) const;

    /// The nearest surface point alone, if it is at most `reach` in front or `depth` behind.
    std::optional<SurfacePoint> touchNearest(const Vec3& p, double reach, double depth) const;

    /// Appends where a corner of the surface meets the inside of a triangle, and where ridges meet its edges: the
    /// deepest such place of the inside and of each edge, at most `reach` apart or `depth` deep. `edges`: from corner i
    /// to the next. The triangle's own corners are left to touch() of points.
    void touch(const Mat3& triangle, const std::array<ShellEdge, 3>& edges, double reach, double depth,
               std::vector<TrianglePoint>& touched) const;

  private:
    struct Edge {
        int a, b;                     // corners
        std::array<int, 2> faces;     // the second is -1 at a border
        std::array<int, 2> opposite;  // their third corners, twice the same at a border
        Vec3 normal;                  // mean of its faces', unit
    };
    /// A convex edge, or a border: something can hang on it.
    struct Ridge {
        Vec3 start, along, normal;
        std::array<Vec3, 2> inward;  // from its start to the third corners of its faces, unit
        std::array<int, 2> tips;     // the ends that no ridge before it has; -1
    };
    struct Corner {
        Vec3 point;
        Vec3 normal = Vec3::Zero();  // by the faces' angles, unit
        bool isBorder = false;
        std::vector<int> edges{}, faces{};
    };
    /// The point of the surface nearest to p, and whether p is behind it.
    struct Nearest {
        int face;
        Vec3 weights, point;
        double distance;
        Vec3 normal;  // unit, out of the surface, along the way to p
        bool isBehind;
    };
    void weld(const std::vector<Mat3>& triangles);
    void connect();
    void collectRidges();
    bool isRidge(const Edge& edge) const;
    Mat3 triangle(int face) const;
    Nearest classify(int face, const Vec3& p, const Vec3& weights, const Vec3& point) const;
    std::optional<Nearest> nearest(const Vec3& p, double radius) const;
    void pushOut(const Nearest& nearest, const Vec3& p, std::vector<SurfacePoint>& touched) const;
    bool isInside(const Vec3& p, double depth) const;
    struct FaceQuery {
        const Mat3& triangle;
        Vec3 normal;
        double reach, depth;
        bool isNear(double distance) const { return distance <= reach && distance >= -depth; }
    };
    static bool isIntoSheet(const Vec3& direction, const ShellEdge& edge, const FaceQuery& query, int side);
    std::optional<TrianglePoint> touchTip(int corner, const FaceQuery& query) const;
    std::optional<TrianglePoint> touchRidge(const Ridge& ridge, const FaceQuery& query, int side,
                                            const ShellEdge& edge) const;

    Bounds m_box;
    std::vector<Corner> m_corners;
    std::vector<std::array<int, 3>> m_triangles;
    std::vector<Vec3> m_normals;                // of the triangles
    std::vector<std::array<int, 3>> m_edgesOf;  // of the triangles: edge i is opposite to corner i
    std::vector<Edge> m_edges;
    std::vector<Ridge> m_ridges;
    BoxTree m_tree, m_ridgeTree;
};

}  // namespace jacket::bullet
