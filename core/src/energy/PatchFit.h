#pragma once
#include <vector>

#include "energy/MirroredMesh.h"

namespace jacket {

/// Rows uu, vv, uv: weights of the data on a patch's nodes that give the second derivatives at the centre of its
/// triangle of the quadratic fitted to them [1/m^2].
using SecondDerivatives = Eigen::Matrix<double, 3, Eigen::Dynamic>;

/// Weighted least squares of a full quadratic over the points `uv` around the origin.
struct QuadraticFit {
    SecondDerivatives derivatives;
    bool determined;  ///< false: the smallest second derivatives of all quadratics that fit as well
};
QuadraticFit fitQuadratic(const Eigen::Ref<const Eigen::Matrix<double, 2, Eigen::Dynamic>>& uv);

/// The nodes around one triangle and what they say about its curvature.
struct Patch {
    std::vector<int> nodes;             ///< of the MirroredMesh; the triangle's own three come first
    Vec3 centre, axisU, axisV, normal;  ///< the rest triangle's frame
    double area;                        ///< at rest [m^2]
    SecondDerivatives derivatives;      ///< a column per node
};

/// One patch for every triangle of the shell: all nodes that share a vertex with it, and at free edges a ring more
/// until the quadratic is well determined. A shell too small for that (a hinge of two triangles) gets the smallest
/// quadratic that fits it.
///
/// The fit is then balanced. Least squares alone leaves irregular meshes about 1 % too soft for ever: under constant
/// moments the inner vertices are not in balance, because area times weight, summed over the patches around a vertex,
/// is not zero as it is on a regular grid. The smallest change of the weights that makes it so, and keeps the second
/// derivatives of every quadratic, removes the cause (variationally consistent integration: Chen, Hillman and Rueter,
/// Int. J. Numer. Meth. Engng 95, 2013, for meshfree methods). Vertices within two rings of a free edge are left alone:
/// there the sum is the edge's own moment.
std::vector<Patch> makePatches(const HalfEdgeMesh& mesh, const MirroredMesh& mirrored, const Points& rest);

}  // namespace jacket
