// What ShellDynamicsWorld adds: even motion of kinematic bodies, and shells drawn between fixed steps.
#include <gtest/gtest.h>
#include <jacket/bullet/ShellDynamicsWorld.h>

#include <cmath>

#include "coupled/Worlds.h"
#include "support/BulletScene.h"

namespace jacket::testing {
template <>
struct WorldParts<bullet::ShellDynamicsWorld<btMultiBodyDynamicsWorld>> {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btMultiBodyConstraintSolver solver;
    bullet::ShellDynamicsWorld<btMultiBodyDynamicsWorld> world{&dispatcher, &broadphase, &solver, &configuration};
};
}  // namespace jacket::testing

namespace jacket::bullet::testing {
namespace {

using jacket::testing::Scene;

using InterpolatingScene = Scene<ShellDynamicsWorld<>>;

/// A kinematic body that is led in frames of four substeps, at the end of each of which its pose is noted.
struct LedBody : InterpolatingScene {
    static constexpr int kSubsteps = 4;
    btRigidBody& body;
    std::vector<btTransform> poses;  ///< in the last frame

    explicit LedBody(std::unique_ptr<btCollisionShape> shape)
        : InterpolatingScene(0.0), body(addBody(std::move(shape), 0, btVector3(0, 0, 0))) {
        makeKinematic(body);
        world.setInternalTickCallback(&LedBody::note, this);
    }
    void lead(const btTransform& pose) {
        poses.clear();
        body.setWorldTransform(pose);
        world.stepSimulation(btScalar(kSubsteps / 240.0), 10, btScalar(1.0 / 240));
    }
    static void note(btDynamicsWorld* world, btScalar) {
        auto& self = *static_cast<LedBody*>(world->getWorldUserInfo());
        self.poses.push_back(self.body.getWorldTransform());
    }
};

TEST(ShellDynamicsWorld, AKinematicBodyGoesItsWayEvenlyOverTheSubsteps) {
    LedBody led(std::make_unique<btBoxShape>(btVector3(1, 1, 1)));
    for (int frame = 1; frame <= 2; ++frame) {
        const btQuaternion turn(btVector3(0, 1, 0), btScalar(frame));  // 1 rad a frame
        led.lead(btTransform(turn, btVector3(0, btScalar(0.4 * frame), 0)));
        ASSERT_EQ(led.poses.size(), 4u);
        for (int k = 1; k <= 4; ++k) {
            const btTransform& pose = led.poses[k - 1];
            EXPECT_NEAR(pose.getOrigin().y(), 0.4 * (frame - 1 + k / 4.0), bulletTolerance(1e-9, 1e-5));
            EXPECT_NEAR(
                btQuaternion(btVector3(0, 1, 0), btScalar(frame - 1 + k / 4.0)).angleShortestPath(pose.getRotation()),
                0.0, bulletTolerance(1e-6, 1e-3));
        }
        EXPECT_EQ(led.body.getWorldTransform().getOrigin().y(), btScalar(0.4 * frame));
    }
    EXPECT_NEAR(led.body.getLinearVelocity().y(), 0.4 * 60, bulletTolerance(1e-9, 1e-3));
}

/// Where it was put it is in every substep, and not for a while in between.
TEST(ShellDynamicsWorld, ATeleportedBodyIsThereAtOnce) {
    LedBody led(std::make_unique<btBoxShape>(btVector3(1, 1, 1)));
    led.lead(btTransform(btQuaternion(btVector3(0, 1, 0), 1), btVector3(0, 20, 0)));
    ASSERT_EQ(led.poses.size(), 4u);
    for (const btTransform& pose : led.poses) EXPECT_EQ(pose, led.body.getWorldTransform());
    EXPECT_EQ(led.body.getWorldTransform().getOrigin().y(), btScalar(20));
}

/// A ball that flies at 60 m/s is a teleported one in its first frame alone.
TEST(ShellDynamicsWorld, AFastBodyIsTakenOnEvenly) {
    LedBody led(std::make_unique<btSphereShape>(btScalar(0.1)));
    for (int frame = 1; frame <= 3; ++frame) {
        led.lead(btTransform(btQuaternion::getIdentity(), btVector3(0, btScalar(frame), 0)));
        ASSERT_EQ(led.poses.size(), 4u);
        for (int k = 1; k <= 4 && frame > 1; ++k)
            EXPECT_NEAR(led.poses[k - 1].getOrigin().y(), frame - 1 + k / 4.0, bulletTolerance(1e-9, 1e-5));
    }
}

/// Lifted by 3 cm a frame of 4 substeps, the sheet on a plate never is that far off it.
TEST(ShellDynamicsWorld, ASheetStaysOnAKinematicPlate) {
    InterpolatingScene scene;
    auto& plate = scene.addBox(btVector3(1, btScalar(0.1), 1), 0, btVector3(0, btScalar(-0.1), 0));
    makeKinematic(plate);
    TriangleMesh mesh = squareSheet(1, 4);
    mesh.positions.row(1).array() += 1e-3;
    auto& sheet = scene.world.shells().add(mesh, trampolineCloth());
    struct Gap {
        btRigidBody& plate;
        ShellBody& sheet;
        double deepest = 0.0;
        static void tick(btDynamicsWorld* world, btScalar) {
            auto& self = *static_cast<Gap*>(world->getWorldUserInfo());
            self.deepest = std::max(self.deepest, penetration(self.sheet, self.plate));
        }
    } gap{plate, sheet};
    for (int frame = 0; frame < 40; ++frame) {
        if (frame == 10) scene.world.setInternalTickCallback(&Gap::tick, &gap);  // at rest, then lifted
        btTransform pose = plate.getWorldTransform();
        if (frame > 10) pose.getOrigin() += btVector3(0, btScalar(0.03), 0);
        plate.setWorldTransform(pose);
        scene.world.stepSimulation(btScalar(4.0 / 240), 10, btScalar(1.0 / 240));
    }
    EXPECT_GT(sheet.positions()[12].y(), 0.8);
    EXPECT_LT(gap.deepest, 5e-5);
}

TEST(ShellDynamicsWorld, DrawsShellsBetweenFixedSteps) {
    InterpolatingScene scene;
    auto& sheet = scene.world.shells().add(squareSheet(1, 4), trampolineCloth());
    sheet.pin(0);
    const btScalar fixed = btScalar(1.0 / 64), frame = fixed / 8;  // exact in binary
    std::vector<btVector3> drawn(sheet.vertexCount()), before(sheet.vertexCount()), last;
    for (int i = 1; i <= 160; ++i) {
        const std::vector<btVector3> old(sheet.positions().begin(), sheet.positions().end());
        const bool stepped = scene.world.stepSimulation(frame, 4, fixed) > 0;
        ASSERT_EQ(stepped, i % 8 == 0);
        if (stepped) before = old;
        scene.world.renderPositions(sheet, drawn);
        for (int v = 0; v < sheet.vertexCount() && i >= 8; ++v) {
            const btVector3 expected = before[v].lerp(sheet.positions()[v], btScalar(i % 8) / 8);
            ASSERT_LT((drawn[v] - expected).length(), bulletTolerance(1e-12, 1e-6)) << "frame " << i;
            // No jump where a step begins: nothing is drawn to move faster than it moves.
            if (i > 8) {
                ASSERT_LT((drawn[v] - last[v]).length(), 1.01 * 9.81 * 2.5 / 8 / 64 + 1e-6) << "frame " << i;
            }
        }
        last = drawn;
    }
    EXPECT_LT(sheet.positions()[24].y(), -0.1);
}

TEST(ShellDynamicsWorld, DrawsAheadWithoutLatency) {
    InterpolatingScene scene;
    auto& sheet = scene.world.shells().add(squareSheet(1, 4), trampolineCloth());
    scene.world.setLatencyMotionStateInterpolation(false);
    scene.world.stepSimulation(btScalar(1.5 / 64), 4, btScalar(1.0 / 64));
    std::vector<btVector3> drawn(sheet.vertexCount());
    scene.world.renderPositions(sheet, drawn);
    const btVector3 expected = sheet.positions()[7] + btScalar(0.5 / 64) * sheet.velocity(7);
    EXPECT_LT((drawn[7] - expected).length(), bulletTolerance(1e-12, 1e-6));
    drawn.pop_back();
    EXPECT_THROW(scene.world.renderPositions(sheet, drawn), std::invalid_argument);
}

/// A shell that is made when another has left, often where that was in memory, stood nowhere a substep ago: one of as
/// many vertices, and one of more.
TEST(ShellDynamicsWorld, DrawsAShellThatHasJustComeWhereItStands) {
    for (const int cells : {2, 40}) {
        InterpolatingScene scene;
        auto& shells = scene.world.shells();
        auto& other = shells.add(squareSheet(1, 2), trampolineCloth());
        scene.world.stepSimulation(btScalar(1.25 / 64), 4, btScalar(1.0 / 64));
        shells.remove(other);
        TriangleMesh mesh = squareSheet(3, cells);
        mesh.positions.row(1).array() += 5.0;
        auto& sheet = shells.add(mesh, trampolineCloth());
        std::vector<btVector3> drawn(sheet.vertexCount());
        scene.world.renderPositions(sheet, drawn);
        for (int i = 0; i < sheet.vertexCount(); ++i) ASSERT_EQ(drawn[i], sheet.positions()[i]) << cells << " cells";
    }
}

/// The motion state of a body and the shell that fell beside it are drawn at one height.
TEST(ShellDynamicsWorld, DrawsShellsAndMotionStatesAtTheSameTime) {
    InterpolatingScene scene;
    auto& sheet = scene.world.shells().add(squareSheet(1, 4), trampolineCloth(), {.tolerance = 1e-8});
    btDefaultMotionState state(btTransform(btQuaternion::getIdentity(), btVector3(5, 0, 0)));
    auto& ball = scene.addSphere(0.1, 1.0, btVector3(5, 0, 0));
    ball.setMotionState(&state);
    std::vector<btVector3> drawn(sheet.vertexCount());
    for (int i = 0; i < 100; ++i) {
        scene.world.stepSimulation(btScalar(1.0 / 144), 4, btScalar(1.0 / 60));
        scene.world.renderPositions(sheet, drawn);
        if (i < 3) continue;  // before the first step Bullet extrapolates backwards
        ASSERT_NEAR(drawn[7].y(), state.m_graphicsWorldTrans.getOrigin().y(), bulletTolerance(1e-6, 1e-4)) << i;
    }
}

TEST(ShellDynamicsWorld, IsAnyWorld) {
    Scene<ShellDynamicsWorld<btMultiBodyDynamicsWorld>> scene;
    auto& sheet = scene.world.shells().add(squareSheet(1, 4), trampolineCloth());
    scene.addFloor(-0.1);
    scene.run(0.5, 1.0 / 60);
    EXPECT_NEAR(sheet.positions()[12].y(), -0.1, 1e-2);
}

TEST(ShellDynamicsWorld, AKinematicBodyMayLeaveBetweenSubsteps) {
    InterpolatingScene scene;
    auto& pusher = scene.addBox(btVector3(1, 1, 1), 0, btVector3(0, 0, 0));
    makeKinematic(pusher);
    scene.world.setInternalTickCallback(
        [](btDynamicsWorld* world, btScalar) {
            auto& self = *static_cast<InterpolatingScene*>(world->getWorldUserInfo());
            if (!self.bodies.empty()) self.remove(*self.bodies[0]);  // frees it
        },
        &scene);
    scene.world.stepSimulation(btScalar(4.0 / 240), 10, btScalar(1.0 / 240));
    EXPECT_EQ(scene.world.getNumCollisionObjects(), 0);
}

}  // namespace
}  // namespace jacket::bullet::testing
