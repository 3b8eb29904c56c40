#pragma once

class btDynamicsWorld;

namespace jacket::bullet {

class ShellWorld;

/// Sees to it that shells are the last of a world's actions. Others, such as a character controller or a vehicle, would
/// else move bodies when shells have looked at them, and bodies and shells would not be drawn at the same instant.
class TurnToAct {
  public:
    /// Whether nothing but shells acts later in this step; else Bullet will call these shells once more.
    bool isLast(btDynamicsWorld& world, ShellWorld& shells);

  private:
    bool m_waits = false;
};

}  // namespace jacket::bullet
