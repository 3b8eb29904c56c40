#pragma once
#include <memory_resource>
#include <span>
#include <utility>
#include <vector>

#include "Obstacles.h"
#include "jacket/bullet/ShellBody.h"

class btDynamicsWorld;

namespace jacket::bullet {

/// Shells that share dynamic bodies or multibodies, with the obstacles near them: one solve.
struct Island {
    explicit Island(std::pmr::memory_resource* memory)
        : shells(memory), obstacles(memory), pairs(memory), anchors(memory), couplings(memory), rigidContacts(memory) {}
    std::pmr::vector<ShellBody*> shells;
    std::pmr::vector<Obstacle> obstacles;
    std::pmr::vector<std::pair<int, int>> pairs;  ///< (shell, obstacle) that Bullet's broadphase finds near each other
    std::pmr::vector<Anchor> anchors;
    std::pmr::vector<BodyCoupling> couplings;      ///< between obstacles
    std::pmr::vector<RigidContact> rigidContacts;  ///< between obstacles
};

/// Sorts shells into islands. Everything is ordered by the objects' place in the world, so that a run can be repeated.
class IslandFinder {
  public:
    /// `memory`: for all of it, the islands too.
    IslandFinder(btDynamicsWorld& world, Obstacles& obstacles, std::span<ShellBody* const> shells,
                 std::pmr::memory_resource& memory);
    /// `hasMoved`: bodies have made their motion already, see Obstacles::make.
    std::pmr::vector<Island> find(double h, bool hasMoved);

  private:
    /// A collision object, the shells whose bounds overlap its own, and those anchored to it.
    struct Neighbour {
        btCollisionObject* object;
        std::pmr::vector<int> near, anchored;
    };
    Neighbour& neighbour(btCollisionObject& object);
    void collectPairs();
    void notePair(const btCollisionObject* proxy, btCollisionObject* object);
    void collectAnchors();
    void sort();
    Neighbour makeNeighbour(btCollisionObject& object) const {
        return {&object, std::pmr::vector<int>(&m_memory), std::pmr::vector<int>(&m_memory)};
    }
    std::pmr::vector<int> leaders(std::span<const Obstacle> obstacles,
                                  std::span<const std::pair<int, int>> joined) const;
    void addObstacle(Island& island, const Obstacle& obstacle, Neighbour& neighbour,
                     std::span<const int> indexInIsland) const;

    btDynamicsWorld& m_world;
    Obstacles& m_obstacles;
    std::span<ShellBody* const> m_shells;
    std::pmr::memory_resource& m_memory;
    std::pmr::vector<Neighbour> m_neighbours;
};

}  // namespace jacket::bullet
