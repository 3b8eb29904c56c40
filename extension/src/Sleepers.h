#pragma once
#include <LinearMath/btTransform.h>

#include <memory>
#include <memory_resource>
#include <span>
#include <vector>

#include "Islands.h"
#include "Obstacles.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// Points that may stay where they are.
struct RestingPlace {
    Points place;        ///< where they were when it began [m]
    double since = 0.0;  ///< for how long none has left its place [s]
    /// Takes a step; `room`: how far from its place none has left it [m].
    void follow(const Points& points, double room, double h);
    void forget() { place.resize(3, 0); }
};

/// What a shell needs to fall asleep and to know when to wake.
struct ShellRest {
    bool asleep = false;
    bool wakeAsked = false;       ///< by the user, since the last step
    RestingPlace vertices;        ///< as they are
    Points mean;                  ///< where they were on average of late [m]
    RestingPlace means;           ///< as those are
    double damped = 0.0;          ///< for how long it has been, see Sleepers::isCalm [s]
    unsigned revision = 0;        ///< of the shell in the last step that it was awake in
    Vec3 gravity = Vec3::Zero();  ///< the world's then [m/s^2]
    double boundsSpeed = 0.0;     ///< of other objects, that its bounds in the broadphase allow for [m/s]
    struct Support {
        btCollisionObject* object;
        int id;  ///< the broadphase's: one that was removed and added again has another
        btTransform pose;
        mutable int place;  ///< in the world's list, where it was last found
    };
    std::vector<Support> supports;  ///< what it touched or was tied to
};

/// Shells fall asleep and wake with what they touch. Bullet sees no contact between the two, so it is done here: a body
/// that touches a restless shell is kept awake, and a shell sleeps once it has kept its place for Bullet's
/// gDeactivationTime and all that it touches is as calm, together with that.
class Sleepers {
  public:
    Sleepers(btCollisionWorld& world, Obstacles& obstacles, std::span<const std::unique_ptr<ShellBody>> shells,
             std::pmr::memory_resource& memory);
    /// Wakes shells whose world has changed. `disturbed`: all of them, since the wind has.
    void wake(const Vec3& gravity, double h, bool disturbed);
    /// After the step: counts how long shells have kept their place, and lets them sleep together with their bodies.
    void rest(const Vec3& gravity, double h);
    /// Together with the bodies that it touched.
    void wakeUp(ShellBody& shell);
    /// Whether an island's shells hang about their places for good, moved only by what the solves of contacts with
    /// walls leave over: vertices that go on leaving a body and coming back to it.
    static bool isCalm(const Island& island);

  private:
    struct Candidate {
        ShellBody* shell;
        std::pmr::vector<btCollisionObject*> supports;
        bool ready;
    };
    bool keepsPlace(ShellBody& shell, const Vec3& gravity, double h) const;
    void dropRestless(std::span<Candidate> candidates) const;
    bool isDisturbed(const ShellBody& shell, const Vec3& gravity) const;
    void wakeTouched(double h);
    bool touches(const ShellBody& shell, btCollisionObject& object, double h);
    std::pmr::vector<btCollisionObject*> supportsOf(const ShellBody& shell) const;
    bool contains(const ShellRest::Support& support) const;
    btCollisionWorld& m_world;
    Obstacles& m_obstacles;
    std::span<const std::unique_ptr<ShellBody>> m_shells;
    std::pmr::memory_resource& m_memory;
};

}  // namespace jacket::bullet
