#pragma once
#include <BulletCollision/NarrowPhaseCollision/btManifoldPoint.h>

#include "jacket/Contact.h"
#include "jacket/HalfEdgeMesh.h"

class btCollisionObject;

namespace jacket::bullet {

/// The triangle of the shell that a contact belongs to; one of several for a point on an edge or a vertex.
int triangleOf(const HalfEdgeMesh& mesh, const Contact& contact);

/// A contact as Bullet shows it to its users, without impulses; the shell is body 0. `triangle`: of the shell.
btManifoldPoint toManifoldPoint(const Contact& contact, const btCollisionObject& body, int triangle);

/// Whether the user's gContactAddedCallback is to be asked about the material of contacts, as Bullet decides it.
bool isMaterialCustom(const btCollisionObject& shell, const btCollisionObject& body);

/// Takes friction and restitution from gContactAddedCallback, which must be there.
void customiseMaterial(Contact& contact, const HalfEdgeMesh& mesh, const btCollisionObject& shell,
                       const btCollisionObject& body);

}  // namespace jacket::bullet
