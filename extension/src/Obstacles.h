#pragma once
#include <BulletCollision/CollisionDispatch/btCollisionWorld.h>

#include <memory>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "Convert.h"
#include "ConvexPieces.h"
#include "jacket/Contact.h"

class btRigidBody;

namespace jacket::bullet {

class RigidContacts;

/// Along a rigid contact or a joint's limit that bore load in the last solve a body is this many times heavier than it
/// is by itself.
inline constexpr double kSupport = 1e4;

/// What goes faster than this, by its user's will or because it strays so far from what was solved in a step, may have
/// been teleported, see isTeleport [m/s].
inline constexpr double kTeleportSpeed = 50.0;

/// The pieces of a collision shape, and what shows that the shape has changed under us. Concave pieces are only named:
/// their triangles are read from the shape in every step.
struct ShapePieces {
    std::vector<std::unique_ptr<ConvexPiece>> pieces;
    std::vector<ConcavePiece> concave;
    std::size_t fingerprint = 0;
};

/// One collision object near a shell: its pieces, its pose at the start of the step and its part in the solve.
struct Obstacle {
    btCollisionObject* object;
    const ShapePieces* shape;
    Frame start;  ///< pose of the object at the start of the step; its origin is the centre of mass
    CoupledBody body;
};

/// Makes obstacles of Bullet's collision objects; keeps the pieces of every shape it has met.
class Obstacles {
  public:
    /// Static, kinematic and sleeping bodies become bodies of prescribed motion. `contacts`: what holds bodies, or
    /// null. `hasMoved`: every body starts where it stood h ago, with the velocity that it has: the motion that Bullet
    /// has already made, instead of the coming one. Links that are not prescribed get their mass from coupleLinks. What
    /// an obstacle's body rests on is kept here until the next step begins.
    Obstacle make(btCollisionObject& object, double h, const RigidContacts* contacts, bool hasMoved);
    /// Where an object begins a motion that it has made already, see make().
    Frame startOf(const btCollisionObject& object, double h);
    /// Shapes without any piece that shells can touch are reported here once, by Bullet's name of the shape.
    std::vector<std::string> takeWarnings() { return std::exchange(m_warnings, {}); }
    /// Before anything else in a step: what moves without Bullet's doing is known by its poses at two steps.
    void beginStep() {
        ++m_step;
        m_supportCount = 0;
        m_starts.clear();
    }
    /// Where the motion began that a free body has made by this step.
    void noteStart(const btCollisionObject& object, const Frame& start) { m_starts.emplace(&object, start); }
    /// False for bodies that no solve could take, see defectOf; warns once of each.
    bool isUsable(const btCollisionObject& object);
    /// Whether the world adds gravity to velocities itself instead of leaving it in the bodies' total force.
    void setGravityIsNoForce(bool value) { m_gravityIsNoForce = value; }

  private:
    std::vector<BodySupport>& freeSupports();
    Vec6 madeTwist(const btRigidBody& body, double h) const;
    const ShapePieces& piecesOf(const btCollisionShape& shape);
    std::unordered_map<const btCollisionShape*, ShapePieces> m_shapes;
    std::vector<std::string> m_warnings;
    std::vector<std::string> m_warnedNames;
    std::vector<const btCollisionObject*> m_warnedBodies;
    struct Pose {
        long step;
        btTransform now, before;
        Vec6 ofTeleport = Vec6::Zero();  ///< what Bullet took for the body's velocity when it was teleported last
    };
    Vec6 prescribedTwist(const btCollisionObject& object, double h);
    std::unordered_map<const btCollisionObject*, Pose> m_poses;  ///< of static and kinematic objects
    std::unordered_map<const btCollisionObject*, Frame> m_starts;
    std::vector<std::vector<BodySupport>> m_supports;  ///< of the step's bodies; those beyond m_supportCount: free
    std::size_t m_supportCount = 0;
    long m_step = 0;
    bool m_gravityIsNoForce = false;
};

/// Whether it is a rigid body or a link that shells and others may push.
inline bool mayBePushed(const btCollisionObject& object) {
    constexpr int kPushed = btCollisionObject::CO_RIGID_BODY | btCollisionObject::CO_FEATHERSTONE_LINK;
    return !object.isStaticOrKinematicObject() && (object.getInternalType() & kPushed) != 0;
}

/// Whether an object never moves. Kinematic bodies are usually static as well, as Bullet marks all of mass 0, and so is
/// the ghost of a character controller unless that is taken from it.
inline bool standsStill(const btCollisionObject& object) {
    const bool isGhost = object.getInternalType() == btCollisionObject::CO_GHOST_OBJECT;
    return object.isStaticObject() && !object.isKinematicObject() && !isGhost;
}

/// Whether its user alone knows how it moves, and no shell could push it. (Soft bodies have no shape that shells
/// touch.)
inline bool isLed(const btCollisionObject& object) {
    const bool isSoft = object.getInternalType() == btCollisionObject::CO_SOFT_BODY;
    return !mayBePushed(object) && !standsStill(object) && !isSoft;
}

/// Whether some of the objects are led and the others stand still. `objectOf`: the btCollisionObject of an entry.
template <class Entries, class ObjectOf>
bool areLedByUser(const Entries& entries, ObjectOf objectOf) {
    bool isAnyLed = false;
    for (const auto& entry : entries) {
        const btCollisionObject& object = objectOf(entry);
        if (mayBePushed(object)) return false;
        isAnyLed = isAnyLed || isLed(object);
    }
    return isAnyLed;
}

/// Pose after moving with a twist for a time: rotation by the exponential of the angular velocity.
Frame moved(const Frame& start, const Vec6& twist, double time);

}  // namespace jacket::bullet
