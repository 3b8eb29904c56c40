#pragma once
#include <memory_resource>
#include <span>
#include <unordered_map>
#include <vector>

#include "Islands.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// Of what falls from rest in a step: bodies at rest stray from what was solved by up to this share of its way.
inline constexpr double kStrayAtRest = 0.2;

/// Of a body whose solve was taken back.
struct TakenBack {
    Frame start;   ///< where its motion began
    Vec6 impulse;  ///< which it had from the solve, and its moment about the centre of mass [N s, N m s]
};
using AllTakenBack = std::pmr::unordered_map<const btCollisionObject*, TakenBack>;

/// The last solves of islands with free bodies, for as long as they may turn out to be void: a body may then have moved
/// as no solve could know, since its user gave it a velocity, another action came in between, or it met something that
/// was not foreseen. The shells would find themselves inside it, and be thrown. They go back to where they were before,
/// to be solved again for the motion that the body has made.
class SolvedIslands {
  public:
    explicit SolvedIslands(std::pmr::memory_resource* memory) : m_memory(*memory), m_islands(memory) {}
    /// Before an island is solved: keeps its shells' velocities.
    void begin(const Island& island);
    /// After that: how each free body was solved to move, and what it was given.
    void end(const Island& island, std::span<const CoupledBody> coupled, double h);
    /// Shells of solves that are void have no solved velocity any more. Returns what these had given their bodies,
    /// which still have it.
    AllTakenBack takeBack(const btCollisionWorld& world, const Vec3& gravity, double h) const;
    void forget(const ShellBody& shell);
    void clear() { m_islands.clear(); }

  private:
    struct Body {
        btCollisionObject* object;
        int id;  ///< the broadphase's
        double radius;
        Vec6 twist;
        TakenBack solve;
    };
    struct Solved {
        explicit Solved(std::pmr::memory_resource* memory) : shells(memory), bodies(memory) {}
        std::pmr::vector<ShellBody*> shells;
        std::pmr::vector<Body> bodies;  ///< that are free
    };
    bool isVoid(const btCollisionWorld& world, const Solved& island, const Vec3& gravity, double h) const;
    std::pmr::memory_resource& m_memory;
    std::pmr::vector<Solved> m_islands;
};

}  // namespace jacket::bullet
