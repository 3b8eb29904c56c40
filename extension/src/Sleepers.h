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

/// What a shell needs to fall asleep and to know when to wake.
struct ShellRest {
    bool asleep = false;
    bool wakeAsked = false;       ///< by the user, since the last step
    double quiet = 0.0;           ///< for how long no vertex has left its place [s]
    Points place;                 ///< where the vertices were when it began [m]
    double lowest = 0.0;          ///< energy since it has been slow, of its height too, but for what creeping takes [J]
    double level = 0.0;           ///< for how long it has not been less than that [s]
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
    /// Before shells move: wakes those whose kinematic support has moved, so that they go along with it.
    void wakeLed(const Vec3& gravity);
    /// Wakes shells whose world has changed. `disturbed`: all of them, since the wind has.
    void wake(const Vec3& gravity, double h, bool disturbed);
    /// After the step: counts how long shells have kept their place, and lets them sleep together with their bodies.
    void rest(const Vec3& gravity, double h);
    /// Together with the bodies that it touched.
    void wakeUp(ShellBody& shell);
    /// Whether an island's shells are slow, have bodies around them that do not move, or stand, and lose no energy:
    /// what moves them still is what the solves of contacts leave over, as vertices go on leaving a body and coming
    /// back to it. What truly falls, slides or swings loses some.
    static bool isCalm(const Island& island, const Vec3& gravity, double h);

  private:
    struct Candidate {
        ShellBody* shell;
        std::pmr::vector<btCollisionObject*> supports;
        bool ready;
        std::pmr::vector<btCollisionObject*> company;  ///< what sleeps with it, if it is ready
    };
    bool isQuiet(const btCollisionObject& object, double h) const;
    bool keepsPlace(ShellBody& shell, double h) const;
    void followEnergy(const Candidate& candidate, const Vec3& gravity, double h) const;
    void dropRestless(std::span<Candidate> candidates) const;
    bool isDisturbed(const ShellBody& shell, const Vec3& gravity) const;
    bool isLed(const ShellBody& shell) const;
    void wakeTouched(double h);
    bool touches(const ShellBody& shell, btCollisionObject& object, double h);
    std::pmr::vector<btCollisionObject*> supportsOf(const ShellBody& shell) const;
    std::pmr::vector<btCollisionObject*> companyOf(const std::pmr::vector<btCollisionObject*>& supports) const;
    bool contains(const ShellRest::Support& support) const;
    btCollisionWorld& m_world;
    Obstacles& m_obstacles;
    std::span<const std::unique_ptr<ShellBody>> m_shells;
    std::pmr::memory_resource& m_memory;
};

}  // namespace jacket::bullet
