#pragma once
#include "Convert.h"
#include "ConvexContact.h"

class btConvexShape;

namespace jacket::bullet {

/// Convex pieces of a shape: itself, or its children when it is a compound. Appends to `unsupported` the Bullet name of
/// every child that shells cannot touch. Sphere, box, capsule, cylinder, cone, static plane and convex hull are copied;
/// the pieces of any other convex shape ask that shape, which must outlive them.
///
/// The surfaces: box and cylinder with their margin inside, as Bullet sizes them; multi-sphere likewise; cone, hull and
/// every other shape without the collision margin that Bullet adds around them. A Minkowski sum is that of its parts'
/// surfaces. A shape of the user's own that has no volume without its margin (a rounded point or segment) gets it.
std::vector<std::unique_ptr<ConvexPiece>> makeConvexPieces(const btCollisionShape& shape,
                                                           std::vector<std::string>& unsupported);

/// Any convex shape through libccd, also those with a closed form: what the one finds, the other should.
std::unique_ptr<ConvexPiece> makeCcdPiece(const btConvexShape& shape, const Frame& frame);

}  // namespace jacket::bullet
