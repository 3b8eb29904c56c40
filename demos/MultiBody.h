#pragma once
#include <memory>
#include <span>
#include <vector>

#include "Scene.h"

class btCollisionShape;
class btMultiBody;
class btMultiBodyDynamicsWorld;
class btMultiBodyJointLimitConstraint;
class btMultiBodyJointMotor;
class btMultiBodyLinkCollider;

namespace jacket::demo {

/// What Bullet is told of one of a multibody's bodies.
struct MultiBodyPart {
    const BodyDescription* description;
    btCollisionShape* shape;
    Vec3 centre;   ///< of mass, in the shape's frame [m]
    Vec3 inertia;  ///< about the frame's axes [kg m^2]
};

/// A multibody of a scene, in Bullet's world as long as it lives. All its frames start parallel to the world's.
class MultiBody {
  public:
    /// `parts`: the base, then the links, in the order of the description.
    MultiBody(btMultiBodyDynamicsWorld& world, const MultiBodyDescription& description,
              std::span<const MultiBodyPart> parts);
    ~MultiBody();
    MultiBody(const MultiBody&) = delete;
    MultiBody& operator=(const MultiBody&) = delete;

    /// Sets the motors for the step of length h that starts at `time` [s].
    void drive(double time, double h);
    /// Collision object of a part.
    const btMultiBodyLinkCollider& collider(std::size_t part) const { return *m_colliders[part]; }
    /// Velocity of the centre of mass, and angular velocity, of every part.
    struct Velocities {
        std::vector<Vec3> linear, angular;
    };
    Velocities velocities() const;

  private:
    void setUpJoint(int link, const LinkDescription& description, std::span<const MultiBodyPart> parts);
    void addCollider(int link, const MultiBodyPart& part);
    void addConstraints(const MultiBodyDescription& description);

    btMultiBodyDynamicsWorld& m_world;
    std::unique_ptr<btMultiBody> m_body;
    std::vector<std::unique_ptr<btMultiBodyLinkCollider>> m_colliders;
    struct Motor {
        std::unique_ptr<btMultiBodyJointMotor> constraint;
        std::vector<MotorPhase> phases;
    };
    std::vector<Motor> m_motors;
    std::vector<std::unique_ptr<btMultiBodyJointLimitConstraint>> m_limits;
};

}  // namespace jacket::demo
