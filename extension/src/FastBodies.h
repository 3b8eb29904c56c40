#pragma once
#include <memory_resource>
#include <span>
#include <unordered_map>
#include <vector>

#include "Obstacles.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// Bodies that Bullet has just moved farther than they are thick. Their motion was not known when the shells were last
/// solved if the user, or another body, set them going since. As Bullet's own continuous collision does, they are put
/// back to where they first touched a shell; the coming solve then finds them there, with all their velocity.
class FastBodies {
  public:
    /// Twists that bodies were solved with, and that took them through no shell.
    using Solved = std::pmr::unordered_map<const btCollisionObject*, Vec6>;
    /// Before the shells move. `shells` must outlive this. Bodies that move as they were solved are left alone.
    FastBodies(btCollisionWorld& world, Obstacles& obstacles, std::span<ShellBody* const> shells, const Solved& solved,
               double h);
    /// After they have. True when a body was put back, and Bullet's pairs have been updated.
    bool holdBack();

  private:
    btCollisionWorld& m_world;
    std::span<ShellBody* const> m_shells;
    double m_h;
    std::vector<Obstacle> m_obstacles;
    std::vector<std::pair<int, int>> m_pairs;  ///< (shell, obstacle) that may touch
    std::vector<Points> m_start;               ///< of each shell [m]
};

}  // namespace jacket::bullet
