#pragma once
#include <BulletDynamics/Dynamics/btDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <memory_resource>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "RigidImpacts.h"
#include "RigidJoints.h"
#include "jacket/Contact.h"

class btManifoldPoint;
class btPersistentManifold;

namespace jacket::bullet {

struct Obstacle;

/// The contacts that Bullet found among bodies and that bore load in its last solve. They hold in the shells' solve
/// too, or a shell would press a supported box through the floor, and feel only the lowest one of a pile. So do the
/// impacts of the coming step, or a body would be stopped, or thrown, into the shells that touch it; and joints.
class RigidContacts {
  public:
    /// `h`: of the step [s]. `hasMoved`: bodies have made their motion in it already, and nothing is foreseen.
    RigidContacts(btDynamicsWorld& world, double h, bool hasMoved, std::pmr::memory_resource& memory)
        : m_world(world),
          m_h(h),
          m_hasMoved(hasMoved),
          m_memory(memory),
          m_manifolds(&memory),
          m_near(&memory),
          m_seen(&memory),
          m_impacts(&memory),
          m_jointsOf(&memory),
          m_joints(&memory),
          m_joined(&memory),
          m_jointSolver(world.getSolverInfo()) {
        m_jointSolver.m_erp = btScalar(0);
    }
    /// To be called first. The free bodies of the piles that these belong to, up to a number that a solve can carry.
    /// Contacts and joints between any of all these are `between`'s, and not `addSupports`' any more.
    std::pmr::vector<btCollisionObject*> join(std::span<btCollisionObject* const> bodies);
    /// What holds a body in the coming step besides the joined bodies: stiff terms of its mass. A body among that which
    /// is not held itself is as heavy as it is. `supports`: what coupled.supports will show. Friction goes on as in
    /// Bullet's last solve.
    void addSupports(const btRigidBody& body, CoupledBody& coupled, std::vector<BodySupport>& supports) const;
    /// Contacts among the joined bodies; indices of obstacles.
    std::pmr::vector<RigidContact> between(std::span<const Obstacle> obstacles) const;

  private:
    void index();
    void indexNear();
    void indexJoints();
    void foresee(const btCollisionObject& body);
    void readJoints(const btCollisionObject& body);
    bool areJoined(const btCollisionObject& a, const btCollisionObject& b) const;
    struct LoadedPoint;
    void forEachLoaded(const btRigidBody& body, const auto& use) const;
    void addLoaded(const btRigidBody& body, const Vec3& centre, std::vector<BodySupport>& supports) const;
    void addImpacts(const btRigidBody& body, const Vec3& centre, std::vector<BodySupport>& supports) const;
    void addJoints(const btRigidBody& body, std::vector<BodySupport>& supports) const;
    void addFriction(const btRigidBody& body, CoupledBody& coupled) const;
    using ObstacleIndex = std::pmr::unordered_map<const btCollisionObject*, int>;
    void addLoadedBetween(std::span<const Obstacle> obstacles, int own, const ObstacleIndex& indexOf,
                          std::pmr::vector<RigidContact>& contacts) const;
    using Manifolds = std::pmr::vector<btPersistentManifold*>;
    std::span<btPersistentManifold* const> manifoldsOf(const btCollisionObject& object) const;

    Vec3 pointOn(const btRigidBody& body, const btVector3& found) const;
    double pushOf(const btPersistentManifold& manifold, const btManifoldPoint& point) const;

    btDynamicsWorld& m_world;
    double m_h;
    bool m_hasMoved;
    std::pmr::memory_resource& m_memory;
    std::pmr::unordered_map<const btCollisionObject*, Manifolds> m_manifolds;
    /// By Bullet's broadphase, of every free object: what may meet it.
    std::pmr::unordered_map<const btCollisionObject*, std::pmr::vector<btCollisionObject*>> m_near;
    std::pmr::unordered_set<const btCollisionObject*> m_seen;  ///< bodies whose impacts and joints are known
    std::pmr::vector<RigidImpact> m_impacts;
    std::pmr::unordered_map<const btCollisionObject*, std::pmr::vector<btTypedConstraint*>> m_jointsOf;
    std::pmr::vector<JointRow> m_joints;  ///< of the joined bodies
    std::pmr::unordered_set<const btCollisionObject*> m_joined;
    /// But joints' errors do not count: how fast Bullet's iterations make them good, far too slowly in chains, is seen
    /// when it has.
    btContactSolverInfo m_jointSolver;
};

}  // namespace jacket::bullet
