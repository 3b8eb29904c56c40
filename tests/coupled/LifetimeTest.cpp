// Bodies and shells change, come and go while they touch.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <new>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::contactImpulse;
using jacket::testing::Scene;
using jacket::testing::stateOf;

TriangleMesh sheetAt(double side, int cells, double height) {
    TriangleMesh mesh = squareSheet(side, cells);
    mesh.positions.row(1).array() += height;
    return mesh;
}

/// How the body is that a corner of a sheet is tied to.
class AnchorTo : public ::testing::TestWithParam<const char*> {};

TEST_P(AnchorTo, HoldsTheVertex) {
    const std::string kind = GetParam();
    Scene scene;
    scene.addFloor(-1.0);
    const double mass = kind == "dynamic" || kind == "sleeping" ? 50.0 : 0.0;
    auto& body = scene.addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), mass,
                              btVector3(btScalar(-1), btScalar(-0.9), btScalar(-1)));
    if (kind == "kinematic") makeKinematic(body);
    if (kind == "sleeping") body.setActivationState(ISLAND_SLEEPING);
    auto& sheet = scene.shells->add(squareSheet(1, 6), trampolineCloth(), {.collisionMask = 0});
    sheet.anchor(0, body);
    const btVector3 local = body.getWorldTransform().inverse() * sheet.positions()[0];
    for (int i = 0; i < 60; ++i) {
        if (kind == "kinematic") {
            const btQuaternion turn(btVector3(0, 1, 0), btScalar(0.02 * (i + 1)));
            body.setWorldTransform(btTransform(turn, body.getWorldTransform().getOrigin()));
        }
        scene.step(kStep);
        const btVector3 expected = body.getWorldTransform() * local;
        ASSERT_LT((sheet.positions()[0] - expected).length(), bulletTolerance(1e-9, 1e-5)) << "step " << i;
    }
    EXPECT_LT(sheet.positions()[24].y(), -0.3);  // the rest hangs
    if (kind == "sleeping") {
        EXPECT_EQ(body.getActivationState(), ISLAND_SLEEPING);
    }
}
INSTANTIATE_TEST_SUITE_P(Kinds, AnchorTo, ::testing::Values("static", "kinematic", "sleeping", "dynamic"));

/// Storage in which bodies are made one after the other at one address, as an allocator does.
struct Slot {
    alignas(btRigidBody) unsigned char bytes[sizeof(btRigidBody)];
    btSphereShape shape{btScalar(0.25)};
    btRigidBody* make(btDynamicsWorld& world, double mass, const btVector3& position) {
        auto* body = new (bytes) btRigidBody(btScalar(mass), nullptr, &shape, btVector3(1, 1, 1));
        body->translate(position);
        world.addRigidBody(body);
        return body;
    }
    static void destroy(btDynamicsWorld& world, btRigidBody* body) {
        world.removeRigidBody(body);
        body->~btRigidBody();
    }
};

/// A ball that touches, and one that holds an anchor, are deleted; others appear, at the same addresses or not.
std::vector<double> runWithReplacedBodies(bool sameAddress) {
    Slot slots[4];
    Scene scene;
    btRigidBody* touching = slots[0].make(scene.world, 1.0, btVector3(0, btScalar(0.26), 0));
    btRigidBody* holding = slots[1].make(scene.world, 0.0, btVector3(btScalar(0.9), btScalar(0.6), btScalar(0.9)));
    auto& sheet = scene.shells->add(squareSheet(2, 10), trampolineCloth());
    for (const int corner : {0, 10, 110}) sheet.pin(corner);
    sheet.anchor(120, *holding);
    scene.run(0.5, kStep);
    EXPECT_FALSE(contactImpulse(sheet, *touching).isZero(0.0));
    Slot::destroy(scene.world, touching);
    Slot::destroy(scene.world, holding);
    touching = slots[sameAddress ? 0 : 2].make(scene.world, 1.0, btVector3(0, btScalar(0.7), 0));
    holding = slots[sameAddress ? 1 : 3].make(scene.world, 0.0, btVector3(btScalar(0.9), btScalar(0.9), btScalar(0.9)));
    const double before = sheet.positions()[120].y();
    scene.run(0.25, kStep);
    EXPECT_LT(sheet.positions()[120].y(), before - 0.05);  // let go: nobody tied it to the new body
    const std::vector<double> state = stateOf(scene);
    Slot::destroy(scene.world, touching);
    Slot::destroy(scene.world, holding);
    return state;
}

TEST(Lifetime, ABodyAtTheAddressOfADeletedOneIsAnother) {
    const auto expected = runWithReplacedBodies(false), got = runWithReplacedBodies(true);
    ASSERT_EQ(expected.size(), got.size());
    for (std::size_t i = 0; i < got.size(); ++i) ASSERT_EQ(got[i], expected[i]) << i;
}

TEST(Lifetime, AnAnchorOutlivesNeitherItsBodyNorAStepThatNeverCame) {
    Scene scene;
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    auto& post = scene.addSphere(0.1, 0, btVector3(0, 5, 0));
    sheet.anchor(0, post);
    scene.remove(post);  // before any step, and frees its memory
    scene.step(kStep);
    EXPECT_LT(sheet.positions()[0].y(), 0.0);
}

/// Something is done to a ball in a trampoline, or to the sheet, after every substep.
struct Tick {
    std::function<void()> act;
    static void call(btDynamicsWorld* world, btScalar) { static_cast<Tick*>(world->getWorldUserInfo())->act(); }
};

TEST(Lifetime, BodiesAndShellsMayGoAfterAnySubstep) {
    for (int when = 0; when < 24; when += 3) {
        Scene scene;
        auto* ball = &scene.addSphere(0.25, 2.0, btVector3(0, btScalar(0.27), 0));
        auto* sheet = &scene.shells->add(squareSheet(1, 6), trampolineCloth());
        pinBorder(*sheet);
        auto& other = scene.shells->add(sheetAt(1, 6, -0.3), trampolineCloth());
        pinBorder(other);
        int count = 0;
        Tick tick{[&] {
            if (count++ == when) scene.remove(*ball);
            if (count == when + 4) scene.shells->remove(*sheet);
        }};
        scene.world.setInternalTickCallback(&Tick::call, &tick);
        scene.world.stepSimulation(btScalar(30.0 / 240), 40, btScalar(1.0 / 240));
        EXPECT_EQ(scene.shells->size(), 1);
        EXPECT_EQ(scene.world.getNumCollisionObjects(), 1);
        EXPECT_TRUE(scene.shells->lastStep().finite);
        EXPECT_TRUE(other.contacts().empty());
    }
}

TEST(Lifetime, SeveralShellWorldsStandSideBySide) {
    Scene scene;
    ShellWorld second(scene.world), third(scene.world);
    std::vector<ShellBody*> sheets;
    double height = 0.0;
    for (ShellWorld* shells : {scene.shells.get(), &second, &third}) {
        auto& sheet = shells->add(sheetAt(2, 10, height), trampolineCloth());
        pinBorder(sheet);
        sheets.push_back(&sheet);
        height += 0.02;
    }
    auto& ball = scene.addSphere(0.25, 2.0, btVector3(0, btScalar(0.5), 0));
    scene.run(1.0, kStep);
    EXPECT_GT(ball.getWorldTransform().getOrigin().y(), -0.2);
    EXPECT_FALSE(contactImpulse(*sheets[2], ball).isZero(0.0));
    EXPECT_FALSE(contactImpulse(*sheets[0], ball).isZero(0.0));
    for (ShellBody* sheet : sheets) EXPECT_LT(penetration(*sheet, ball), 5e-3);
    EXPECT_EQ(scene.world.getNumCollisionObjects(), 4);
}

TEST(Lifetime, ABodyMayChangeItsShapeUnderASheet) {
    Scene scene;
    auto& body = scene.addBox(btVector3(1, btScalar(0.5), 1), 0, btVector3(0, 0, 0));
    ShellMaterial cloth = trampolineCloth();
    cloth.massDamping = 5.0;
    auto& sheet = scene.shells->add(sheetAt(1, 8, 0.51), cloth);
    scene.run(0.3, kStep);
    const auto lowest = [&] { return sheet.shell().positions().row(1).minCoeff(); };
    EXPECT_NEAR(lowest(), 0.5, 1e-3);

    scene.shapes[0]->setLocalScaling(btVector3(1, btScalar(0.8), 1));  // falls to 0.4
    scene.run(0.5, kStep);
    EXPECT_NEAR(lowest(), 0.4, 1e-3);
    scene.shapes[0]->setLocalScaling(btVector3(1, btScalar(0.82), 1));  // grows into it
    scene.run(0.5, kStep);
    EXPECT_NEAR(lowest(), 0.41, 1e-3);

    btSphereShape sphere(btScalar(0.45));
    body.setCollisionShape(&sphere);
    scene.run(0.5, kStep);
    EXPECT_LT(lowest(), 0.3);                                             // hangs over it
    EXPECT_NEAR(sheet.shell().positions().row(1).maxCoeff(), 0.45, 0.1);  // a fold stands on top
    EXPECT_LT(penetration(sheet, body), 2e-3);
    body.setCollisionShape(scene.shapes[0].get());
}

TEST(Lifetime, ABodyMayBecomeStaticKinematicAndDynamicWhileItTouches) {
    Scene scene;
    auto& ball = scene.addSphere(0.25, 2.0, btVector3(0, btScalar(0.26), 0));
    ball.setActivationState(DISABLE_DEACTIVATION);
    auto& sheet = scene.shells->add(squareSheet(2, 16), trampolineCloth());
    pinBorder(sheet);
    const auto height = [&] { return double(ball.getWorldTransform().getOrigin().y()); };
    scene.run(0.3, kStep);
    ASSERT_FALSE(contactImpulse(sheet, ball).isZero(0.0));

    ball.setMassProps(0, btVector3(0, 0, 0));  // sets CF_STATIC_OBJECT
    ball.setLinearVelocity(btVector3(0, 0, 0));
    ball.setAngularVelocity(btVector3(0, 0, 0));
    const double still = height();
    scene.run(0.3, kStep);
    EXPECT_EQ(height(), still);
    EXPECT_LT(penetration(sheet, ball), 2e-3);

    ball.setCollisionFlags(btCollisionObject::CF_KINEMATIC_OBJECT);
    for (int i = 1; i <= 20; ++i) {  // pushed down by 2 cm
        ball.setWorldTransform(btTransform(btQuaternion::getIdentity(), btVector3(0, btScalar(still - 1e-3 * i), 0)));
        scene.step(kStep);
    }
    EXPECT_LT(penetration(sheet, ball), 2e-3);
    EXPECT_GT(contactImpulse(sheet, ball).y(), 0.0);

    ball.setCollisionFlags(0);
    ball.setMassProps(2, btVector3(btScalar(0.05), btScalar(0.05), btScalar(0.05)));
    ball.updateInertiaTensor();
    ball.setGravity(scene.world.getGravity());
    scene.run(0.3, kStep);
    EXPECT_GT(height(), still - 0.02);  // the sheet throws it back
    EXPECT_LT(penetration(sheet, ball), 2e-3);
    EXPECT_EQ(scene.shells->lastStep().rejectedSteps, 0);
}

/// The shell falls as the ball does, also over the step at which gravity changes.
TEST(Lifetime, GravityMayChange) {
    Scene scene;
    auto& ball = scene.addSphere(0.1, 1.0, btVector3(5, 0, 0));
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth(), {.tolerance = 1e-8});
    for (int i = 0; i < 60; ++i) {
        if (i == 20) scene.world.setGravity(btVector3(3, 12, 0));
        if (i == 40) scene.world.setGravity(btVector3(0, 0, 0));
        scene.step(kStep);
        const btVector3 moved = ball.getWorldTransform().getOrigin() - btVector3(5, 0, 0);
        ASSERT_LT((sheet.positions()[12] - moved).length(), bulletTolerance(1e-6, 1e-4)) << "step " << i;
    }
    EXPECT_NEAR(sheet.velocity(12).y(), (12 - 9.81) / 3, bulletTolerance(1e-5, 1e-4));
    EXPECT_NEAR(sheet.velocity(12).x(), 1.0, bulletTolerance(1e-5, 1e-4));
}

TEST(Lifetime, StepsOfNoOrNegativeOrNoLengthLeaveShellsAlone) {
    Scene scene;
    auto& ball = scene.addSphere(0.25, 2.0, btVector3(0, btScalar(0.26), 0));
    auto& sheet = scene.shells->add(squareSheet(2, 8), trampolineCloth());
    pinBorder(sheet);
    scene.run(0.3, kStep);
    const Points before = sheet.shell().positions();
    scene.step(0.0);
    scene.step(-kStep);  // Bullet moves its bodies backwards
    scene.shells->updateAction(&scene.world, std::numeric_limits<btScalar>::quiet_NaN());
    EXPECT_EQ(sheet.shell().positions(), before);
    scene.run(0.3, kStep);
    EXPECT_TRUE(scene.shells->lastStep().finite);
    EXPECT_LT(penetration(sheet, ball), 5e-3);
    EXPECT_GT(ball.getWorldTransform().getOrigin().y(), -0.3);
}

/// Bodies that Bullet does not turn: no inertia, or no angular factor.
class Unturned : public ::testing::TestWithParam<bool> {};

TEST_P(Unturned, StillLandsAndKeepsMomentum) {
    Scene scene(0.0);
    auto& box = scene.addBox(btVector3(btScalar(0.2), btScalar(0.2), btScalar(0.2)), 1.0,
                             btVector3(btScalar(0.15), btScalar(0.3), btScalar(0.1)));
    if (GetParam()) {
        box.setAngularFactor(0);
    } else {
        box.setMassProps(1, btVector3(0, 0, 0));
        box.updateInertiaTensor();
    }
    box.setLinearVelocity(btVector3(0, -2, 0));
    auto& sheet = scene.shells->add(squareSheet(1, 10), trampolineCloth());
    bool touched = false;
    for (int i = 0; i < 40; ++i) {
        scene.step(kStep);
        touched = touched || !sheet.contacts().empty();
        const Vec3 momentum = jacket::testing::totalMomentum(scene);
        ASSERT_LT((momentum - Vec3(0, -2, 0)).norm(), bulletTolerance(1e-9, 2e-6)) << "step " << i;
    }
    EXPECT_TRUE(touched);
    EXPECT_GT(box.getLinearVelocity().y(), -1.9);
    EXPECT_EQ(box.getAngularVelocity().length(), 0);
    EXPECT_LT(penetration(sheet, box), 1e-2);
}
INSTANTIATE_TEST_SUITE_P(How, Unturned, ::testing::Bool());

}  // namespace
}  // namespace jacket::bullet::testing
