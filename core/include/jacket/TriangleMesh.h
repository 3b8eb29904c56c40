#pragma once
#include <string>
#include <vector>

#include "jacket/Types.h"

namespace jacket {

/// Input of a shell: rest positions and triangles, counter-clockwise seen from outside.
struct TriangleMesh {
    Points positions;      ///< 3 x n [m]
    Indices<3> triangles;  ///< 3 x m, columns of vertex indices 0..n-1
};

/// How the cells of a grid are cut. Right: all from the first corner to the opposite one. Alternating: like the union
/// jack. Equilateral: the vertices of every second row are shifted by half a cell and the rows end in half triangles,
/// so that the outline stays a rectangle; equilateral when cells are sqrt(3) / 2 as high as wide.
enum class GridDiagonals { Right, Alternating, Equilateral };
enum class GridPlane { XZ, XY, YZ };

/// A flat rectangle of cells, centred at the origin. Vertices row by row along the first axis: vertex (i, j) has index
/// j (cells[0] + 1) + i. (Equilateral: rows 1, 3, 5, ... have one vertex more.)
struct GridOptions {
    Vec2 size{1.0, 1.0};            ///< extents along the plane's first and second axis [m]
    Eigen::Vector2i cells{10, 10};  ///< cells along each axis
    GridDiagonals diagonals = GridDiagonals::Right;
    GridPlane plane = GridPlane::XZ;  ///< XZ: normals up (+y); XY: normals +z; YZ: normals +x
};
TriangleMesh makeGrid(const GridOptions& options);  ///< throws std::invalid_argument on non-positive sizes or cells

/// Open half sphere, rim down at y = 0 and pole up: vertex 0 is the pole, then `rings` evenly spaced rings down to the
/// rim, with edges of about the same length everywhere. 5 rings: 77 vertices (6, 12, 16, 20, 22), 130 triangles.
TriangleMesh makeHemisphere(double radius, int rings);

/// Open tube along y, centred at the origin, normals outwards; vertex (i, j) around and along has index j around + i.
TriangleMesh makeCylinder(double radius, double height, int around, int along);

/// What is wrong with a mesh, one entry per finding. `fatal` findings make it unusable as a shell.
struct MeshProblem {
    enum class Element { Mesh, Vertex, Edge, Triangle } element;
    int index;  ///< vertex or triangle index, 0-based; for edges the first vertex; -1 for the whole mesh
    bool fatal;
    std::string what;  ///< a sentence with the value and the rule, e.g. "triangle 7 (3 4 4): repeats vertex 4; the
                       ///< three must differ"
};
std::vector<MeshProblem> checkMesh(const TriangleMesh& mesh);

/// Throws std::invalid_argument with the first fatal problem (and how many more there are).
void requireUsable(const TriangleMesh& mesh);

/// Merges vertices closer than `tolerance` times the bounding box diagonal that lie on mesh borders (seams of texture
/// charts); `map`, when given, receives the new index of every old vertex.
TriangleMesh weldSeams(const TriangleMesh& mesh, double tolerance = 1e-6, std::vector<int>* map = nullptr);

double triangleArea(const Vec3& a, const Vec3& b, const Vec3& c);

}  // namespace jacket
