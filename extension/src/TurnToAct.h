#pragma once

class btDynamicsWorld;

namespace jacket::bullet {

class ShellWorld;

/// Sees to it that shells are the last of a world's actions. Others, such as a character controller or a vehicle, would
/// else move bodies when shells have looked at them, and bodies and shells would not be drawn at the same instant.
class TurnToAct {
  public:
    explicit TurnToAct(ShellWorld& shells);
    ~TurnToAct();
    TurnToAct(const TurnToAct&) = delete;
    TurnToAct& operator=(const TurnToAct&) = delete;

    /// Whether nothing but shells acts later in this step; else Bullet will call these shells once more.
    bool isLast(btDynamicsWorld& world);

  private:
    ShellWorld& m_shells;
    bool m_waits = false;
};

}  // namespace jacket::bullet
