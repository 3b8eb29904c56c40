#include "ManifoldPoint.h"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>

#include <algorithm>
#include <cmath>

#include "Convert.h"

namespace jacket::bullet {
namespace {

/// What the user made of a coefficient; what he left alone keeps its digits.
double customised(double before, btScalar after) {
    return after == btScalar(before) || !std::isfinite(double(after)) ? before : std::max(double(after), 0.0);
}

}  // namespace

int triangleOf(const HalfEdgeMesh& mesh, const Contact& contact) {
    const auto& vertices = contact.vertices;
    if (contact.isVertex()) return mesh.trianglesAround(vertices[0]).front();
    for (const int t : mesh.trianglesAround(vertices[0]))
        if (Eigen::Map<const Eigen::Vector3i>(vertices.data()) == mesh.triangles().col(t)) return t;
    return -1;
}

btManifoldPoint toManifoldPoint(const Contact& contact, const btCollisionObject& body, int triangle) {
    const btVector3 onBody = toBullet(contact.point),
                    onShell = toBullet(Vec3(contact.point + contact.gap * contact.normal));
    btManifoldPoint point(onShell, body.getWorldTransform().inverse() * onBody, toBullet(contact.normal),
                          btScalar(contact.gap));
    point.m_positionWorldOnA = onShell;
    point.m_positionWorldOnB = onBody;
    point.m_partId0 = 0;
    point.m_index0 = triangle;
    point.m_partId1 = point.m_index1 = -1;
    point.m_combinedFriction = btScalar(contact.friction);
    point.m_combinedRestitution = btScalar(contact.restitution);
    return point;
}

bool isMaterialCustom(const btCollisionObject& shell, const btCollisionObject& body) {
    const int flags = shell.getCollisionFlags() | body.getCollisionFlags();
    return gContactAddedCallback && (flags & btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK) != 0;
}

void customiseMaterial(Contact& contact, const HalfEdgeMesh& mesh, const btCollisionObject& shell,
                       const btCollisionObject& body) {
    btManifoldPoint point = toManifoldPoint(contact, body, triangleOf(mesh, contact));
    const btCollisionObjectWrapper first(nullptr, shell.getCollisionShape(), &shell, shell.getWorldTransform(), -1, -1),
        second(nullptr, body.getCollisionShape(), &body, body.getWorldTransform(), -1, -1);
    gContactAddedCallback(point, &first, point.m_partId0, point.m_index0, &second, point.m_partId1, point.m_index1);
    contact.friction = customised(contact.friction, point.m_combinedFriction);
    contact.restitution = std::min(customised(contact.restitution, point.m_combinedRestitution), 1.0);
    // No manifold will have this point: what the user hung on it he gets back.
    if (point.m_userPersistentData && gContactDestroyedCallback) gContactDestroyedCallback(point.m_userPersistentData);
}

}  // namespace jacket::bullet
