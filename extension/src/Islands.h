#pragma once
#include <span>
#include <utility>
#include <vector>

#include "Obstacles.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// Shells that share dynamic bodies or multibodies, with the obstacles near them: one solve.
struct Island {
    std::vector<ShellBody*> shells;
    std::vector<Obstacle> obstacles;
    std::vector<std::pair<int, int>> pairs;  ///< (shell, obstacle) that Bullet's broadphase finds near each other
    std::vector<Anchor> anchors;
    std::vector<BodyCoupling> couplings;      ///< between obstacles
    std::vector<RigidContact> rigidContacts;  ///< between obstacles
};

/// Sorts shells into islands. Everything is ordered by the objects' place in the world, so that a run can be repeated.
class IslandFinder {
  public:
    IslandFinder(btCollisionWorld& world, Obstacles& obstacles, std::span<ShellBody* const> shells);
    /// `hasMoved`: bodies have made their motion already, see Obstacles::make.
    std::vector<Island> find(double h, bool hasMoved);

  private:
    /// A collision object, the shells whose bounds overlap its own, and those anchored to it.
    struct Neighbour {
        btCollisionObject* object;
        std::vector<int> near, anchored;
    };
    Neighbour& neighbour(btCollisionObject& object);
    void collectPairs();
    void notePair(const btCollisionObject* proxy, btCollisionObject* object);
    void collectAnchors();
    void sort();
    std::vector<int> leaders(const std::vector<Obstacle>& obstacles,
                             const std::vector<std::pair<int, int>>& joined) const;
    void addObstacle(Island& island, const Obstacle& obstacle, const Neighbour& neighbour,
                     const std::vector<int>& indexInIsland) const;

    btCollisionWorld& m_world;
    Obstacles& m_obstacles;
    std::span<ShellBody* const> m_shells;
    std::vector<Neighbour> m_neighbours;
};

}  // namespace jacket::bullet
