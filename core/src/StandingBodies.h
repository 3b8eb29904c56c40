#pragma once
#include <vector>

#include "jacket/Island.h"
#include "solver/BodySupports.h"

namespace jacket {

/// Free bodies that stand: something else than shells bears them, they hardly move, and all shells together are light
/// beside them. In one step shells cannot move them by anything that matters to the shells, to which they are walls, as
/// bodies are that sleep; what the shells have given them they take after the step. Solved for, they would be as exact
/// as what hangs on a thread asks for, and cost as much: every contact of a cloth that falls over a crate in its own
/// round.
class StandingBodies {
  public:
    /// Whether there are any in `given`, which must outlive the step.
    bool find(const IslandInput& given);
    /// The same with those as bodies of prescribed motion, which stand still.
    const IslandInput& input() const { return m_input; }
    /// Hands on what was solved for `input`.
    void store();

  private:
    void number(const IslandInput& given);
    bool stands(const IslandInput& given, int body) const;
    bool isOnShell(const IslandInput& given, int body);
    bool dropUnborne(int body, int below, const RigidContact& contact, const Vec6& row);

    const IslandInput* m_given = nullptr;
    IslandInput m_input;
    std::vector<CoupledBody> m_bodies;
    BodySupports m_supports;
    std::vector<int> m_dynamicIndex;   ///< of each body, -1: prescribed
    std::vector<char> m_isJoined;      ///< of each body: by joints
    std::vector<const void*> m_stood;  ///< keys of those that stood in the last step, and that no shell lifted
    std::vector<Contact> m_found;      ///< see isOnShell
    std::vector<const Points*> m_poses;
    std::vector<Vec6> m_still;
};

}  // namespace jacket
