#pragma once
#include <BulletCollision/CollisionShapes/btConvexInternalShape.h>

namespace jacket::bullet::testing {

/// A ball as a user's own shape, of which nothing is known but its support points.
class UserBall : public btConvexInternalShape {
  public:
    explicit UserBall(btScalar radius) : m_radius(radius) { m_shapeType = CUSTOM_CONVEX_SHAPE_TYPE; }
    btVector3 localGetSupportingVertexWithoutMargin(const btVector3& v) const override {
        return v * (m_radius / v.length());
    }
    void batchedUnitVectorGetSupportingVertexWithoutMargin(const btVector3* in, btVector3* out, int n) const override {
        for (int i = 0; i < n; ++i) out[i] = localGetSupportingVertexWithoutMargin(in[i]);
    }
    void calculateLocalInertia(btScalar mass, btVector3& inertia) const override {
        inertia.setValue(1, 1, 1);
        inertia *= btScalar(0.4) * mass * m_radius * m_radius;
    }
    const char* getName() const override { return "UserBall"; }

  private:
    btScalar m_radius;
};

}  // namespace jacket::bullet::testing
