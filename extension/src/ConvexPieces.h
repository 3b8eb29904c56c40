#pragma once
#include "Convert.h"
#include "ConvexContact.h"

class btConcaveShape;
class btConvexShape;

namespace jacket::bullet {

/// The same point of a surface that stands at a pose.
inline SurfacePoint placed(const Frame& pose, const SurfacePoint& surface) {
    return {pose * surface.point, pose.linear() * surface.normal, surface.distance};
}

/// Convex pieces of a shape: itself, or its children when it is a compound. Leaves out what is concave: see
/// concavePieces(). Appends to `unsupported` the Bullet name of every child that is neither. Sphere, box, capsule,
/// cylinder, cone, static plane and convex hull are copied; the pieces of any other convex shape ask that shape, which
/// must outlive them.
///
/// The surfaces: boxes and cylinder with their margin inside, as Bullet sizes them; multi-sphere likewise; cone, hull
/// and every other shape without the collision margin that Bullet adds around them. A Minkowski sum is that of its
/// parts' surfaces. A shape of the user's own that has no volume without its margin (a rounded point or segment) gets
/// it.
std::vector<std::unique_ptr<ConvexPiece>> makeConvexPieces(const btCollisionShape& shape,
                                                           std::vector<std::string>& unsupported);

/// A shape of triangles, and where it is in the frame of the body. The shape must outlive this.
struct ConcavePiece {
    const btConcaveShape* shape;
    Frame frame;
    /// Mean length of its triangles' edges; infinite for shapes of the user's, which may have no end [m].
    double grain;
};

/// The triangle meshes, scaled or of several materials, the heightfields, the GImpact meshes and the user's own concave
/// shapes in a shape and its children. Their surface is that of their triangles, without a margin: see TrianglePatch.
std::vector<ConcavePiece> concavePieces(const btCollisionShape& shape);

/// Changes when the pieces of a shape do: by kind, size and place, at any depth of compounds.
std::size_t fingerprintOf(const btCollisionShape& shape);

/// Any convex shape through libccd, also those with a closed form: what the one finds, the other should.
std::unique_ptr<ConvexPiece> makeCcdPiece(const btConvexShape& shape, const Frame& frame);

}  // namespace jacket::bullet
