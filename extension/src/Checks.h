#pragma once
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "jacket/bullet/ShellBody.h"

class btCollisionObject;

namespace jacket::bullet {

struct Island;

/// What makes a body unusable for a solve, e.g. "position is not finite"; null: nothing.
const char* defectOf(const btCollisionObject& object);

/// Sizes that hardly are what the user wants, told once per shell and by its name, and gravity and steps that cannot be
/// used.
class ShellChecks {
  public:
    void look(const Island& island);
    void noteLetGo(const ShellBody& shell, int anchors);
    void lookAtGravity(const btVector3& gravity);
    /// Whether a step can be that long [s]; warns once where it never could.
    bool isLength(btScalar h);
    void forget(const ShellBody& shell) { m_known.erase(&shell); }
    std::vector<std::string> takeWarnings() { return std::exchange(m_warnings, {}); }

  private:
    struct Known {
        double size = 0.0;  ///< diagonal of the bounds at rest [m]
        bool warnedOfMargin = false;
    };
    Known& known(const ShellBody& shell);
    std::map<const ShellBody*, Known> m_known;
    bool m_warnedOfGravity = false, m_warnedOfLength = false;
    std::vector<std::string> m_warnings;
};

}  // namespace jacket::bullet
