#pragma once
#include <optional>

#include "Obstacles.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// Shells that are tied to bodies which have been teleported since the last step. No solve could take them along: a
/// shell that nothing else holds is put where the body is, as it is; from others such bodies are untied. So is a shell
/// put where a kinematic body begins its motion, should that not be where it was.
class Teleports {
  public:
    Teleports(Obstacles& obstacles, double h) : m_obstacles(obstacles), m_h(h) {}
    struct Outcome {
        bool hasMoved = false;
        int letGo = 0;  ///< anchors that have ended
    };
    /// Before the shell makes the step's motion.
    Outcome follow(ShellBody& shell);
    /// When the step is over: from where bodies might be teleported.
    static void notePoses(ShellBody& shell);

  private:
    std::optional<Frame> leapOf(const ShellBody& shell);
    std::optional<Frame> leapOf(const ShellBody::Anchor& anchor);
    std::optional<Frame> offsetOf(const ShellBody& body);
    bool isLost(const ShellBody& shell, const ShellBody::Anchor& anchor);
    static void move(ShellBody& shell, const Frame& by);

    Obstacles& m_obstacles;
    double m_h;
};

}  // namespace jacket::bullet
