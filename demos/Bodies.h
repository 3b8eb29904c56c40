#pragma once
#include <memory>
#include <vector>

#include "World.h"

class btDiscreteDynamicsWorld;

namespace jacket::demo {

class MultiBody;

/// The rigid bodies and multibodies of a scene, in Bullet's world as long as they live.
class Bodies {
  public:
    /// Reads the geometry of the scene's shapes into it; throws InputError. World and scene must outlive it; a scene
    /// with multibodies needs a btMultiBodyDynamicsWorld.
    Bodies(btDiscreteDynamicsWorld& world, Scene& scene);
    ~Bodies();
    Bodies(const Bodies&) = delete;
    Bodies& operator=(const Bodies&) = delete;

    /// Moves kinematic bodies and sets motors for the step of length h that starts at `time` [s].
    void prepareStep(double time, double h);
    std::vector<BodyState> states() const;

  private:
    struct Body;
    void addBody(BodyDescription& description);
    void addMultiBody(const MultiBodyDescription& description);
    void moveKinematicBodies(double end);
    static BodyState state(const Body& body);

    btDiscreteDynamicsWorld& m_world;
    Scene& m_scene;
    std::vector<Body> m_bodies;
    std::vector<std::unique_ptr<MultiBody>> m_multiBodies;
};

}  // namespace jacket::demo
