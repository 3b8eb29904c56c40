#pragma once
#include <BulletSoftBody/btSoftBody.h>

#include <array>
#include <memory>
#include <vector>

#include "jacket/TriangleMesh.h"
#include "jacket/Types.h"

namespace jacket::demo {

/// A sheet as Bullet's own soft body, set up as its users do for cloth that should not stretch: links as stiff as they
/// go along the grid and, against bending and shear, between nodes two links apart. It knows no Young's modulus.
struct SoftSheet {
    TriangleMesh mesh;                      ///< where it starts [m]
    std::vector<std::array<int, 2>> links;  ///< pairs of vertices
    std::vector<double> masses;             ///< [kg]; 0: held in place
    double friction = 0.0;                  ///< multiplied with the body's
    double margin = 0.05;                   ///< distance kept from bodies [m]: a thinner one lets them through sooner
    int iterations = 10;                    ///< of positions, a step
};

/// The sides of a grid's cells among a mesh's edges, the vertices in rows of `columns`; no diagonals.
std::vector<std::array<int, 2>> gridLinks(const TriangleMesh& mesh, int columns);

/// The mass of each vertex: a third of each of its triangles' [kg].
std::vector<double> lumpedMasses(const TriangleMesh& mesh, double areaDensity);

/// Add it to a btSoftRigidDynamicsWorld, and take it out again before it ends.
std::unique_ptr<btSoftBody> makeSoftBody(btSoftBodyWorldInfo& info, const SoftSheet& sheet);

}  // namespace jacket::demo
