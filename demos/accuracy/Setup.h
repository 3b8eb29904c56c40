#pragma once
#include <ctime>
#include <optional>

#include "accuracy/Problem.h"
#include "jacket/Shell.h"
#include "jacket/Statics.h"

/// What the problems have in common: meshes, materials, how shells are held, what is measured.
namespace jacket::demo::accuracy {

/// Families of problems; each is one file.
void addStrips(std::vector<Problem>& problems);
void addPlates(std::vector<Problem>& problems);
void addFrequencies(std::vector<Problem>& problems);
void addBuckling(std::vector<Problem>& problems);
void addCurvedShells(std::vector<Problem>& problems);

inline const std::vector<MeshKind> kAllMeshes(std::begin(kMeshKinds), std::end(kMeshKinds));

/// Whether a model holds the tangent of a clamped edge by itself.
bool holdsTangents(const BendingModel& model);

/// A sheet with lower left corner at the origin. `clamped`: sides to be clamped; for models that hold no tangent a row
/// of cells is added beyond each of them, as their users must do.
TriangleMesh makeSheet(const Case& how, const Vec2& size, const Eigen::Vector2i& cells, const Margins& clamped = {});
/// A strip of `length` with about square cells, `how.cells` of them along it.
TriangleMesh makeStrip(const Case& how, double length, double width, const Margins& clamped = {});
/// The sheet laid on a curved surface: every vertex (u, v, 0) goes to surface(u, v).
TriangleMesh bent(TriangleMesh flat, const std::function<Vec3(double u, double v)>& surface);

/// The material of a plate with bending stiffness D [N m], thickness t [m] and mass per area [kg/m^2].
ShellMaterial plateMaterial(double bendingStiffness, double thickness, double poisson, double areaDensity = 1.0);

/// Clamps the chosen vertices: the edge and its tangent, or all of a row and the one beyond it.
void clampEdge(Shell& shell, const BendingModel& model, const std::vector<int>& vertices,
               std::optional<Vec3> direction = {});
/// Holds a sheet in its xy plane against rigid motions there, without stress.
void holdInPlane(Shell& shell);

/// A force spread evenly over an edge: each of its vertices gets its part of the edge's length along `axis`.
void spreadForce(Shell& shell, const std::vector<int>& edge, int axis, const Vec3& force);
Vec3 meanPosition(const Points& x, const std::vector<int>& vertices);
int nearestVertex(const Points& x, const Vec3& to);

/// Measures one solve: CPU time since it was made.
class Stopwatch {
  public:
    double seconds() const { return static_cast<double>(std::clock() - m_start) / CLOCKS_PER_SEC; }

  private:
    std::clock_t m_start = std::clock();
};

/// Error relative to the reference.
Measurement relative(double value, double reference, const Stopwatch& watch, const Shell& shell, bool converged);
/// The one with the larger error.
const Measurement& worse(const Measurement& a, const Measurement& b);

}  // namespace jacket::demo::accuracy
