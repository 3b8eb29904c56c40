#pragma once
#include <memory>
#include <span>
#include <unordered_set>
#include <vector>

#include "jacket/bullet/ShellBody.h"

class btCollisionAlgorithm;
class btCollisionWorld;

namespace jacket::bullet {

/// Shows contacts of shells to Bullet's users: a btPersistentManifold (shell, body) in the dispatcher for every pair
/// that touches or has touched, and the standard callbacks gContactStarted-, -Processed- and -EndedCallback. Bullet's
/// solvers never respond to these manifolds. Those of sleeping shells stay as they are, and are not processed.
class ContactManifolds {
  public:
    ContactManifolds();
    ~ContactManifolds();
    ContactManifolds(const ContactManifolds&) = delete;
    ContactManifolds& operator=(const ContactManifolds&) = delete;

    /// Brings the manifolds up to date with ShellBody::contacts(), then calls the callbacks, which may remove any shell
    /// or body. Call it when no pointer to either is in use.
    void update(btCollisionWorld& world, std::span<const std::unique_ptr<ShellBody>> shells);

  private:
    class Pair;
    struct Touch;
    void collect(btCollisionWorld& world, std::span<const std::unique_ptr<ShellBody>> shells);
    Pair* pairOf(btCollisionWorld& world, ShellBody& shell, const btCollisionObject& body);
    bool isAlive(const Pair* pair) const;
    std::vector<Pair*> m_pairs;  ///< owned by Bullet's pair cache, which destroys them when shell or body leaves
    std::unordered_set<const btCollisionAlgorithm*> m_alive;  ///< the same
    std::vector<Touch> m_touches;  ///< of the present update; a member to keep its memory, as the next
    std::vector<Pair*> m_ended;
    int m_updates = 0;
};

}  // namespace jacket::bullet
