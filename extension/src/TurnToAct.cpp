#include "TurnToAct.h"

#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

#include <algorithm>
#include <mutex>
#include <utility>
#include <vector>

#include "jacket/bullet/ShellWorld.h"

namespace jacket::bullet {
namespace {

/// Bullet's list of actions, which it shows to worlds alone.
struct Actions : btDiscreteDynamicsWorld {
    using List = btAlignedObjectArray<btActionInterface*>;
    static List& of(btDiscreteDynamicsWorld& world) { return world.*(&Actions::m_actions); }
};

/// All shell worlds that there are, in any thread. Actions of users who build without RTTI could not be asked.
struct Registry {
    std::mutex mutex;
    std::vector<const btActionInterface*> shells;
    static Registry& instance() {
        static Registry registry;
        return registry;
    }
};

bool areShells(const btActionInterface* action) {
    Registry& registry = Registry::instance();
    const std::lock_guard lock(registry.mutex);
    return std::find(registry.shells.begin(), registry.shells.end(), action) != registry.shells.end();
}

/// The place of an action from another one on; the list's size: none.
int findFrom(const Actions::List& actions, int place, const btActionInterface* action) {
    while (place < actions.size() && actions[place] != action) ++place;
    return place;
}

/// Takes what is at a place out, and keeps the others in order.
void erase(Actions::List& actions, int place) {
    for (; place + 1 < actions.size(); ++place) actions[place] = actions[place + 1];
    actions.pop_back();
}

bool areOthersBehind(const Actions::List& actions, int place) {
    while (++place < actions.size())
        if (!areShells(actions[place])) return true;
    return false;
}

/// Those of shells that stand in the list once more, farther behind.
void closeFormerPlaces(Actions::List& actions) {
    for (int i = 0; i < actions.size();) {
        const bool isFormer = areShells(actions[i]) && findFrom(actions, i + 1, actions[i]) < actions.size();
        if (isFormer)
            erase(actions, i);
        else
            ++i;
    }
}

}  // namespace

TurnToAct::TurnToAct(ShellWorld& shells) : m_shells(shells) {
    Registry& registry = Registry::instance();
    const std::lock_guard lock(registry.mutex);
    registry.shells.push_back(&shells);
}

TurnToAct::~TurnToAct() {
    Registry& registry = Registry::instance();
    const std::lock_guard lock(registry.mutex);
    std::erase(registry.shells, &m_shells);
}

/// Bullet walks through the list by places, also through what is added meanwhile. So the last in it alone may take out
/// what stands before.
bool TurnToAct::isLast(btDynamicsWorld& world) {
    auto* const discrete = dynamic_cast<btDiscreteDynamicsWorld*>(&world);
    if (!discrete) return true;
    Actions::List& actions = Actions::of(*discrete);
    const int own = findFrom(actions, 0, &m_shells);
    if (own == actions.size()) return true;  // it was called by its user
    if (!std::exchange(m_waits, false) && areOthersBehind(actions, own)) {
        if (const int again = findFrom(actions, own + 1, &m_shells); again < actions.size()) erase(actions, again);
        actions.push_back(&m_shells);
        m_waits = true;
        return false;
    }
    if (actions[actions.size() - 1] == &m_shells) closeFormerPlaces(actions);
    return true;
}

}  // namespace jacket::bullet
