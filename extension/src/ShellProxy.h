#pragma once
#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/CollisionShapes/btConcaveShape.h>

#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// A shell's triangles as Bullet sees them: in world coordinates, with bounds of our own that cover the coming motion.
/// The type is FAST_CONCAVE_MESH_PROXYTYPE because Bullet 3.24 crashes on CUSTOM_CONCAVE_SHAPE_TYPE and
/// SOFTBODY_SHAPE_PROXYTYPE without a soft-body world.
class ShellShape final : public btConcaveShape {
  public:
    explicit ShellShape(const ShellBody& body);
    /// Of the vertices; the coming motion reaches `ahead` beyond them (unless given: as far as before) [m].
    void setBounds(const btVector3& lower, const btVector3& upper) { setBounds(lower, upper, m_ahead); }
    void setBounds(const btVector3& lower, const btVector3& upper, btScalar ahead);
    void getAabb(const btTransform&, btVector3& lower, btVector3& upper) const override;
    void processAllTriangles(btTriangleCallback* callback, const btVector3& lower,
                             const btVector3& upper) const override;
    void setLocalScaling(const btVector3&) override {}  // the mesh is what it is
    const btVector3& getLocalScaling() const override { return m_scaling; }
    void calculateLocalInertia(btScalar, btVector3& inertia) const override { inertia.setZero(); }
    const char* getName() const override { return "JacketShell"; }

  private:
    const ShellBody& m_body;
    btVector3 m_lower{0, 0, 0}, m_upper{0, 0, 0}, m_scaling{1, 1, 1};
    btScalar m_ahead = 0;
};

/// The collision object of a shell: in the broadphase, visible to ray and sweep tests, never given a contact by Bullet.
class ShellBody::Proxy final : public btCollisionObject {
  public:
    explicit Proxy(ShellBody& body);
    /// False for the dispatcher, which would otherwise build manifolds that nobody reads.
    bool checkCollideWithOverride(const btCollisionObject*) const override { return false; }
    /// Bullet stops to ask the above when the user empties the list of pairs to ignore.
    void keepHidden() { m_checkCollideWith = 1; }
    /// The user's own list of pairs to ignore (btCollisionObject::setIgnoreCollisionCheck), from either side.
    bool mayTouch(const btCollisionObject& other) const;
    ShellShape& shape() { return m_shape; }
    ShellBody& body() { return m_body; }

  private:
    ShellBody& m_body;
    ShellShape m_shape;
};

}  // namespace jacket::bullet
