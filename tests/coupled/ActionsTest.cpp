// Other actions of a world: character controllers, which move ghost objects, vehicles, and springs.
#include <BulletCollision/CollisionDispatch/btGhostObject.h>
#include <BulletDynamics/Character/btKinematicCharacterController.h>
#include <BulletDynamics/Vehicle/btRaycastVehicle.h>
#include <btBulletDynamicsCommon.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <tuple>

#include "support/HardScenes.h"

namespace jacket::bullet::testing {
namespace {

/// A figure of 1.5 m that walks along z.
struct Character {
    static constexpr double kHalf = 0.75;  ///< of its height [m]
    btDynamicsWorld& world;
    btGhostPairCallback pairs;
    btCapsuleShape shape{btScalar(0.25), btScalar(1)};
    btPairCachingGhostObject ghost;
    btKinematicCharacterController controller{&ghost, &shape, btScalar(0.1), btVector3(0, 1, 0)};

    Character(btDynamicsWorld& in, double z) : world(in) {
        world.getPairCache()->setInternalGhostPairCallback(&pairs);
        ghost.setCollisionShape(&shape);
        ghost.setCollisionFlags(btCollisionObject::CF_CHARACTER_OBJECT);
        btTransform pose = btTransform::getIdentity();
        pose.setOrigin(btVector3(0, btScalar(kHalf + 0.01), btScalar(z)));
        ghost.setWorldTransform(pose);
        world.addCollisionObject(&ghost, btBroadphaseProxy::CharacterFilter);
        world.addAction(&controller);
    }
    ~Character() {
        world.removeAction(&controller);
        world.removeCollisionObject(&ghost);
        world.getPairCache()->setInternalGhostPairCallback(nullptr);
    }
    void walk(double way) { controller.setWalkDirection(btVector3(0, 0, btScalar(way))); }
    double z() const { return double(ghost.getWorldTransform().getOrigin().z()); }
};

/// Speed [m/s], steps a second.
class WalkingCharacter : public ::testing::TestWithParam<std::tuple<double, int>> {
  protected:
    const double speed = std::get<0>(GetParam()), h = 1.0 / std::get<1>(GetParam());
    BulletScene scene;
    btRigidBody& ground = scene.addBox(btVector3(20, 1, 20), 0.0, btVector3(0, -1, 0));

    /// Walks from one time to another, and jumps in between.
    void run(Character& character, const ShellBody& sheet, double from, double to, double jump = -1.0) {
        for (int i = 0; i < int(2.5 / h + 0.5); ++i) {
            const double t = i * h;
            character.walk(t >= from && t < to ? speed * h : 0.0);
            if (t >= jump && t - h < jump) character.controller.jump(btVector3(0, 5, 0));
            scene.step(h);
            ASSERT_LT(penetration(sheet, character.ghost), 6e-4) << "at " << t;
            ASSERT_LT(sheet.shell().velocities().colwise().norm().maxCoeff(), 3.0 * speed + 6.0) << "at " << t;
        }
        EXPECT_LE(scene.shells->lastStep().unsettledSteps, 2);
        EXPECT_EQ(scene.shells->lastStep().passedSteps, 0);
    }
};

TEST_P(WalkingCharacter, GoesThroughACurtain) {
    TriangleMesh mesh = squareSheet(1.2, 20);
    mesh.positions.row(1) = mesh.positions.row(2).array() + 1.3;
    mesh.positions.row(2).setZero();
    auto& curtain = scene.shells->add(mesh, materials::cotton(), {.friction = 0.5});
    for (int i = 0; i < curtain.vertexCount(); ++i)
        if (curtain.shell().positions()(1, i) > 1.89) curtain.pin(i);
    Character character(scene.world, -1.0);
    run(character, curtain, 0.2, 2.2);
    EXPECT_GT(character.z(), 0.5);
}

TEST_P(WalkingCharacter, JumpsUnderACloth) {
    auto& cloth = scene.shells->add(squareSheet(1.2, 20), materials::cotton(), {.friction = 0.5});
    place(cloth, {0.01, 1.55, 0.02});
    Character character(scene.world, 0.0);
    run(character, cloth, 1.0, 2.0, 1.5);
}
INSTANTIATE_TEST_SUITE_P(Speeds, WalkingCharacter,
                         ::testing::Combine(::testing::Values(1.5, 4.0), ::testing::Values(60, 240)));

/// Sleep and waking go by the ghost's poses.
TEST(Character, WakesTheClothThatSleepsOnIt) {
    BulletScene scene;
    scene.addBox(btVector3(20, 1, 20), 0.0, btVector3(0, -1, 0));
    Character character(scene.world, 0.0);
    auto& cloth = scene.shells->add(squareSheet(0.2, 8), materials::cotton(), {.friction = 0.5});
    place(cloth, {0, 1.52, 0});
    for (int i = 0; i < 60 * 20 && !cloth.isAsleep(); ++i) scene.step(kStep);
    ASSERT_TRUE(cloth.isAsleep());
    EXPECT_TRUE(character.ghost.isActive());
    character.walk(2.0 * kStep);
    for (int i = 0; i < 30; ++i) {
        scene.step(kStep);
        EXPECT_FALSE(cloth.isAsleep());
        EXPECT_LT(penetration(cloth, character.ghost), 5e-4);
    }
}

/// Under a box, as a vehicle's.
struct Springs : btActionInterface {
    btRigidBody& body;
    explicit Springs(btRigidBody& on) : body(on) {}
    void updateAction(btCollisionWorld*, btScalar h) override {
        const btScalar off = btScalar(0.5) - body.getWorldTransform().getOrigin().y();
        const btScalar push = btScalar(9.81) + btScalar(60) * off - btScalar(8) * body.getLinearVelocity().y();
        body.applyCentralImpulse(btVector3(0, push * h / body.getInvMass(), 0));
        body.applyTorqueImpulse(-body.getAngularVelocity() * h);
    }
    void debugDraw(btIDebugDraw*) override {}
};

TEST(Springs, HoldUpABoxUnderACloth) {
    BulletScene scene;
    auto& box =
        scene.addBox(btVector3(btScalar(0.2), btScalar(0.1), btScalar(0.2)), 10.0, btVector3(0, btScalar(0.5), 0));
    box.setActivationState(DISABLE_DEACTIVATION);
    Springs springs(box);
    scene.world.addAction(&springs);
    auto& cloth = scene.shells->add(squareSheet(1.2, 16), materials::cotton(), {.friction = 0.5});
    place(cloth, {0.01, 0.605, 0.02});
    for (int i = 0; i < 120; ++i) {
        scene.step(kStep);
        EXPECT_LT(penetration(cloth, box), 5e-4) << "step " << i;
    }
    EXPECT_NEAR(double(box.getWorldTransform().getOrigin().y()), 0.5, 0.01);
    EXPECT_EQ(scene.shells->lastStep().unsettledSteps, 0);
    scene.world.removeAction(&springs);
}

/// A chassis of 60 cm x 1 m on four springs with wheels.
struct Vehicle {
    btDynamicsWorld& world;
    btRaycastVehicle::btVehicleTuning tuning;
    btDefaultVehicleRaycaster rays{&world};
    btRaycastVehicle vehicle;

    Vehicle(btDynamicsWorld& in, btRigidBody& chassis) : world(in), vehicle(tuning, &chassis, &rays) {
        chassis.setActivationState(DISABLE_DEACTIVATION);
        vehicle.setCoordinateSystem(0, 1, 2);
        for (const double z : {-0.4, 0.4})
            for (const double x : {-0.25, 0.25}) {
                btWheelInfo& wheel =
                    vehicle.addWheel(btVector3(btScalar(x), 0, btScalar(z)), btVector3(0, -1, 0), btVector3(-1, 0, 0),
                                     btScalar(0.25), btScalar(0.15), tuning, z > 0.0);
                wheel.m_suspensionStiffness = 40;
                wheel.m_wheelsDampingRelaxation = 3;
                wheel.m_wheelsDampingCompression = 4;
                wheel.m_frictionSlip = 2;
                wheel.m_rollInfluence = btScalar(0.1);
            }
        world.addAction(&vehicle);
    }
    ~Vehicle() { world.removeAction(&vehicle); }
    void drive(double force, double steering) {
        for (const int rear : {0, 1}) vehicle.applyEngineForce(btScalar(force), rear);
        for (const int front : {2, 3}) vehicle.setSteeringValue(btScalar(steering), front);
    }
};

/// Steering [rad]. The cloth flies over the floor at up to 12 m/s, and sees it from afar.
class DrivenVehicle : public ::testing::TestWithParam<double> {};

TEST_P(DrivenVehicle, KeepsTheClothOnItOut) {
    BulletScene scene;
    scene.addFloor();
    auto& chassis = scene.addBox(btVector3(btScalar(0.3), btScalar(0.15), btScalar(0.5)), 100.0, btVector3(0, 0.5, 0));
    Vehicle vehicle(scene.world, chassis);
    auto& cloth = scene.shells->add(squareSheet(1.2, 16), materials::cotton(), {.friction = 0.5});
    place(cloth, {0.01, 0.75, 0.02});
    for (int i = 0; i < 240; ++i) {
        if (i > 60) vehicle.drive(200.0, GetParam());
        scene.step(kStep);
        EXPECT_LT(penetration(cloth, chassis), 5e-4) << "step " << i;
    }
    EXPECT_LE(scene.shells->lastStep().unsettledSteps, 4);
    EXPECT_GT(chassis.getLinearVelocity().length(), 5.0);
}
INSTANTIATE_TEST_SUITE_P(Steering, DrivenVehicle, ::testing::Values(0.0, 0.3));

/// Counts its calls, and looks where the shells are.
struct Witness : btActionInterface {
    const ShellWorld& shells;
    int calls = 0;
    double seen = -1.0;  ///< height of a sheet [m]
    explicit Witness(const ShellWorld& of) : shells(of) {}
    void updateAction(btCollisionWorld*, btScalar) override {
        ++calls;
        seen = double(shells[0].positions()[0].y());
    }
    void debugDraw(btIDebugDraw*) override {}
};

/// Whether other actions come before or after it, or in between steps; each is called once a step, in its order.
TEST(ShellsAct, AfterAllOtherActions) {
    BulletScene scene;
    ShellWorld others(scene.world);
    auto& sheet = scene.shells->add(squareSheet(0.2, 2), materials::cotton());
    others.add(squareSheet(0.2, 2), materials::cotton());
    Witness first(*scene.shells), second(others), third(*scene.shells);
    scene.world.addAction(&first);
    scene.world.addAction(&second);
    for (int i = 0; i < 10; ++i) {
        const double before = double(sheet.positions()[0].y());
        if (i == 5) scene.world.addAction(&third);
        scene.step(kStep);
        EXPECT_EQ(first.seen, before) << i;
        EXPECT_EQ(second.seen, before) << i;  // the other sheet falls as fast
        EXPECT_EQ(first.calls, i + 1);
        EXPECT_EQ(second.calls, i + 1);
        EXPECT_EQ(third.calls, std::max(i - 4, 0));
        const double fallen = 0.5 * 9.81 * kStep * kStep * (i + 1) * (i + 2);
        EXPECT_NEAR(double(sheet.positions()[0].y()), -fallen, 1e-3 * fallen) << i;
        EXPECT_EQ(sheet.positions()[0].y(), others[0].positions()[0].y()) << i;
    }
    for (Witness* witness : {&first, &second, &third}) scene.world.removeAction(witness);
}

}  // namespace
}  // namespace jacket::bullet::testing
