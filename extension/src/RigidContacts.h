#pragma once
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "jacket/Contact.h"

class btDispatcher;
class btPersistentManifold;

namespace jacket::bullet {

struct Obstacle;

/// Linear and angular velocity of a body, now and after the coming step if nothing touches it: forces as they stand,
/// gravity included.
Vec6 twistOf(const btRigidBody& body);
Vec6 freeTwistOf(const btRigidBody& body, double h);

/// The contacts that Bullet found among bodies and that bore load in its last solve. They hold in the shells' solve
/// too, or a shell would press a supported box through the floor, and feel only the lowest one of a pile.
class RigidContacts {
  public:
    explicit RigidContacts(btDispatcher& dispatcher) : m_dispatcher(dispatcher) {}
    /// To be called first. The free bodies of the piles that these belong to, up to a number that a solve can carry.
    /// Contacts between any of all these are `between`'s, and not `addSupports`' any more.
    std::vector<btCollisionObject*> join(const std::vector<btCollisionObject*>& bodies);
    /// What holds a body in the coming step of length h besides the joined bodies: stiff terms of its mass. A free body
    /// among that is as heavy as it is.
    void addSupports(const btRigidBody& body, double h, CoupledBody& coupled) const;
    /// Contacts among the joined bodies; indices of obstacles.
    std::vector<RigidContact> between(const std::vector<Obstacle>& obstacles) const;

  private:
    void index();
    const std::vector<btPersistentManifold*>& manifoldsOf(const btCollisionObject& object) const;

    btDispatcher& m_dispatcher;
    std::unordered_map<const btCollisionObject*, std::vector<btPersistentManifold*>> m_manifolds;
    std::unordered_set<const btCollisionObject*> m_joined;
};

}  // namespace jacket::bullet
