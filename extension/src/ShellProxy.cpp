#include "ShellProxy.h"

#include <LinearMath/btAabbUtil2.h>

namespace jacket::bullet {

ShellShape::ShellShape(const ShellBody& body) : m_body(body) {
    m_shapeType = FAST_CONCAVE_MESH_PROXYTYPE;
}

void ShellShape::setBounds(const btVector3& lower, const btVector3& upper, btScalar ahead) {
    m_ahead = ahead;
    m_lower = lower - btVector3(ahead, ahead, ahead);
    m_upper = upper + btVector3(ahead, ahead, ahead);
}

void ShellShape::getAabb(const btTransform&, btVector3& lower, btVector3& upper) const {
    lower = m_lower;
    upper = m_upper;
}

void ShellShape::processAllTriangles(btTriangleCallback* callback, const btVector3& lower,
                                     const btVector3& upper) const {
    const auto positions = m_body.positions();
    const auto& triangles = m_body.triangles();
    for (int t = 0; t < triangles.cols(); ++t) {
        btVector3 corners[3] = {positions[triangles(0, t)], positions[triangles(1, t)], positions[triangles(2, t)]};
        btVector3 low = corners[0], high = corners[0];
        for (int a = 1; a < 3; ++a) low.setMin(corners[a]), high.setMax(corners[a]);
        if (TestAabbAgainstAabb2(low, high, lower, upper)) callback->processTriangle(corners, 0, t);
    }
}

ShellBody::Proxy::Proxy(ShellBody& body) : m_body(body), m_shape(body) {
    m_internalType = CO_USER_TYPE;
    keepHidden();
    setCollisionShape(&m_shape);
    setCollisionFlags(CF_NO_CONTACT_RESPONSE);
    setActivationState(DISABLE_DEACTIVATION);
    setWorldTransform(btTransform::getIdentity());
}

bool ShellBody::Proxy::mayTouch(const btCollisionObject& other) const {
    return btCollisionObject::checkCollideWithOverride(&other) && other.checkCollideWith(this);
}

}  // namespace jacket::bullet
