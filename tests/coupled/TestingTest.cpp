// <jacket/testing.h> itself, against closed forms.
#include <gtest/gtest.h>

#include <cmath>

#include "Worlds.h"
#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::contactImpulse;
using jacket::testing::energy;
using jacket::testing::energyGain;
using jacket::testing::replayEqual;
using jacket::testing::Scene;
using jacket::testing::stateOf;
using jacket::testing::totalAngularMomentum;
using jacket::testing::totalMomentum;

/// A sheet of 0.3 kg and a ball of 2 kg, far apart.
struct FallingPair : Scene<> {
    explicit FallingPair(double gravity = -9.81) : Scene(gravity) {
        addSphere(0.25, 2.0, btVector3(5, 1, 0));
        shells->add(squareSheet(1, 4), trampolineCloth(), {.tolerance = 1e-9});
    }
};

TEST(Testing, MomentumOfAFallGrowsByWeightTimesTime) {
    FallingPair scene;
    for (int i = 1; i <= 30; ++i) {
        scene.step(1.0 / 60);
        const Vec3 expected(0, -9.81 * 2.3 * i / 60.0, 0);
        ASSERT_LT((totalMomentum(scene) - expected).norm(), bulletTolerance(1e-9, 1e-5)) << "step " << i;
        // About the origin: only the ball, 5 m away, has any.
        const Vec3 turning(0, 0, -5 * 9.81 * 2.0 * i / 60.0);
        ASSERT_LT((totalAngularMomentum(scene) - turning).norm(), bulletTolerance(1e-8, 1e-4)) << "step " << i;
    }
}

TEST(Testing, AngularMomentumOfASpinningBoxIsInertiaTimesSpin) {
    Scene scene(0.0);
    auto& box = scene.addBox(btVector3(btScalar(0.1), btScalar(0.2), btScalar(0.3)), 3.0, btVector3(0, 0, 0));
    btTransform pose = btTransform::getIdentity();
    pose.setRotation(btQuaternion(btVector3(0, 0, 1), btScalar(M_PI / 2)));  // its y axis now along -x
    box.setWorldTransform(pose);
    box.updateInertiaTensor();
    box.setAngularVelocity(btVector3(4, 0, 0));
    const double about = 3.0 / 12 * (0.2 * 0.2 + 0.6 * 0.6);  // m (a^2 + c^2) / 12
    EXPECT_LT((totalAngularMomentum(scene) - Vec3(4 * about, 0, 0)).norm(), bulletTolerance(1e-12, 1e-6));
    EXPECT_NEAR(energy(scene).kineticOfBodies, 0.5 * about * 16, bulletTolerance(1e-12, 1e-6));
}

TEST(Testing, EnergyOfAFallIsThatOfItsHeight) {
    FallingPair scene;
    const auto start = energy(scene);
    EXPECT_NEAR(start.potentialOfBodies, 2.0 * 9.81 * 1.0, bulletTolerance(1e-9, 1e-5));
    EXPECT_NEAR(start.total(), start.potentialOfBodies, 1e-9);  // the sheet lies at height 0, at rest
    const double h = 1.0 / 240;
    EXPECT_LT(energyGain(scene, 0.5, h), bulletTolerance(1e-6, 1e-4));
    const auto end = energy(scene);
    const double speed = 9.81 * 0.5, fall = 0.5 * 9.81 * 0.5 * (0.5 + h);  // Bullet's steps: v first, then x
    EXPECT_NEAR(end.kineticOfShells, 0.5 * 0.3 * speed * speed, bulletTolerance(1e-6, 1e-4));
    EXPECT_NEAR(end.kineticOfBodies, 0.5 * 2.0 * speed * speed, bulletTolerance(1e-9, 1e-3));
    EXPECT_NEAR(end.potentialOfShells, -0.3 * 9.81 * fall, bulletTolerance(1e-6, 1e-4));
    EXPECT_LT(end.membrane + end.bending, 1e-9);
}

/// From the first step on: velocities hold the coming gravity already, the ledger does not.
TEST(Testing, LedgersAreOfOneInstant) {
    FallingPair scene;
    const ShellBody& sheet = (*scene.shells)[0];
    for (int i = 1; i <= 5; ++i) {
        scene.step(1.0 / 60);
        const ShellLedger ledger = sheet.ledger();
        EXPECT_NEAR(ledger.momentum.y(), -0.3 * 9.81 * i / 60.0, bulletTolerance(1e-9, 1e-6));  // g and h are floats
        EXPECT_NEAR(ledger.energy.kinetic, 0.5 * ledger.momentum.squaredNorm() / 0.3, 1e-9);
    }
    (*scene.shells)[0].setVelocity(btVector3(0, 2, 0));
    EXPECT_NEAR(sheet.ledger().momentum.y(), 0.3 * 2, 1e-9);
    EXPECT_NEAR(sheet.ledger().energy.kinetic, 0.5 * 0.3 * 4, 1e-9);
}

TEST(Testing, EnergyGainSeesAKick) {
    FallingPair scene(0.0);
    scene.bodies[0]->setLinearVelocity(btVector3(1, 0, 0));
    struct Kick : btActionInterface {
        btRigidBody& body;
        explicit Kick(btRigidBody& b) : body(b) {}
        void updateAction(btCollisionWorld*, btScalar) override { body.setLinearVelocity(btVector3(3, 0, 0)); }
        void debugDraw(btIDebugDraw*) override {}
    } kick(*scene.bodies[0]);
    scene.world.addAction(&kick);
    EXPECT_NEAR(energyGain(scene, 0.1, 1.0 / 60), 0.5 * 2.0 * (9 - 1), bulletTolerance(1e-9, 1e-4));
    scene.world.removeAction(&kick);
}

/// A base and a link on a hinge about z, 1 kg and 0.5 kg, whose centre is 0.4 m from the hinge, that from the base's.
struct TwoLinks : Scene<btMultiBodyDynamicsWorld> {
    btMultiBody body{1, 1, btVector3(btScalar(0.01), btScalar(0.02), btScalar(0.03)), false, false};

    explicit TwoLinks(double gravity = 0.0) : Scene(gravity) {
        body.setupRevolute(0, btScalar(0.5), btVector3(btScalar(0.004), btScalar(0.005), btScalar(0.006)), -1,
                           btQuaternion::getIdentity(), btVector3(0, 0, 1), btVector3(btScalar(0.4), 0, 0),
                           btVector3(btScalar(0.4), 0, 0));
        body.setLinearDamping(0);
        body.setAngularDamping(0);
        body.setBasePos(btVector3(0, 3, 0));
        body.finalizeMultiDof();
        world.addMultiBody(&body);
    }
    ~TwoLinks() { world.removeMultiBody(&body); }
};

TEST(Testing, LinksOfMultibodiesCount) {
    TwoLinks scene(-9.81);
    scene.body.setBaseVel(btVector3(1, 0, 2));
    scene.body.setBaseOmega(btVector3(0, 0, 3));
    scene.body.setJointVel(0, 2);
    const Vec3 base(1, 0, 2), link = base + Vec3(0, 0.4 * 3 + 0.4 * 5, 0);  // its own spin: 3 + 2
    const Vec3 momentum = base + 0.5 * link;
    EXPECT_LT((totalMomentum(scene) - momentum).norm(), bulletTolerance(1e-12, 1e-5));
    const Vec3 turning =
        Vec3(0, 3, 0).cross(base) + Vec3(0.8, 3, 0).cross(0.5 * link) + Vec3(0, 0, 0.03 * 3 + 0.006 * 5);
    EXPECT_LT((totalAngularMomentum(scene) - turning).norm(), bulletTolerance(1e-12, 1e-5));
    const double kinetic = 0.5 * base.squaredNorm() + 0.25 * link.squaredNorm() + 0.5 * (0.03 * 9 + 0.006 * 25);
    EXPECT_NEAR(energy(scene).kineticOfBodies, kinetic, bulletTolerance(1e-12, 1e-5));
    EXPECT_NEAR(energy(scene).potentialOfBodies, 1.5 * 9.81 * 3, bulletTolerance(1e-9, 1e-4));
}

TEST(Testing, BasesThatCannotMoveDoNotCount) {
    Scene<btMultiBodyDynamicsWorld> scene;
    btMultiBody fixed(0, 1, btVector3(1, 1, 1), true, false);
    fixed.setBasePos(btVector3(0, 3, 0));
    fixed.finalizeMultiDof();
    scene.world.addMultiBody(&fixed);
    EXPECT_EQ(energy(scene).total(), 0.0);
    scene.world.removeMultiBody(&fixed);
}

/// In free flight, turned any way, while the link turns against its base.
TEST(Testing, MultibodiesKeepMomentumAndEnergyOfFlight) {
    TwoLinks scene;
    scene.body.setWorldToBaseRot(btQuaternion(btVector3(1, 2, 3).normalized(), btScalar(0.7)));
    scene.body.setBaseVel(btVector3(1, 0, 2));
    scene.body.setBaseOmega(btVector3(btScalar(0.5), btScalar(-0.3), 1));
    scene.body.setJointVel(0, 2);
    const Vec3 linear = totalMomentum(scene), angular = totalAngularMomentum(scene);
    const double start = energy(scene).total();
    scene.run(0.5, 1e-4);
    EXPECT_LT((totalMomentum(scene) - linear).norm(), 1e-2);  // Bullet's integration is of first order
    EXPECT_LT((totalAngularMomentum(scene) - angular).norm(), 1e-2);
    EXPECT_NEAR(energy(scene).total(), start, 1e-2);
}

TEST(Testing, EnergyGainSeesMultibodiesFly) {
    TwoLinks scene(-9.81);
    EXPECT_LT(energyGain(scene, 0.5, 1.0 / 240), bulletTolerance(1e-6, 1e-3));
    EXPECT_GT(energy(scene).kineticOfBodies, 0.99 * 0.5 * 1.5 * std::pow(9.81 * 0.5, 2));
}

TEST(Testing, ReplaysCompareMultibodies) {
    double start = 1.0;
    const auto run = [&](bool isSame) {
        TwoLinks scene;
        scene.body.setJointVel(0, btScalar(start));
        if (!isSame) start = std::nextafter(btScalar(start), btScalar(2));
        scene.run(0.1, 1.0 / 60);
        return stateOf(scene);
    };
    EXPECT_TRUE(replayEqual([&] { return run(true); }));
    EXPECT_FALSE(replayEqual([&] { return run(false); }));
}

/// A stretched sheet stores what the plane-stress plate does.
TEST(Testing, EnergyOfAStretchedSheetIsThatOfThePlate) {
    Scene scene(0.0);
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    std::vector<btVector3> x(sheet.positions().begin(), sheet.positions().end());
    for (btVector3& p : x) p.setX(p.x() * btScalar(1.001));
    sheet.setPositions(x);
    const double strain = 0.5 * (1.001 * 1.001 - 1);  // Green's
    EXPECT_NEAR(energy(scene).membrane, 0.5 * 1e4 / (1 - 0.3 * 0.3) * strain * strain, bulletTolerance(1e-9, 1e-5));
}

/// Bodies that a point of the sheet enters by 0.1 m. Turned about x, so that their axes are nobody's.
class Penetration : public ::testing::TestWithParam<const char*> {};

std::unique_ptr<btCollisionShape> solid(const std::string& name) {
    const btScalar r(0.3), half(0.3);
    if (name == "sphere") return std::make_unique<btSphereShape>(r);
    if (name == "box") return std::make_unique<btBoxShape>(btVector3(5, half, 5));
    if (name == "capsule") return std::make_unique<btCapsuleShapeZ>(r, 20);
    if (name == "cylinder") return std::make_unique<btCylinderShape>(btVector3(5, half, 5));
    if (name == "plane") return std::make_unique<btStaticPlaneShape>(btVector3(0, 1, 0), half);
    auto compound = std::make_unique<btCompoundShape>();
    return compound;
}

TEST_P(Penetration, IsTheDepthBelowTheSurface) {
    Scene scene(0.0);
    const std::string name = GetParam();
    const bool lying = name == "capsule";  // along z
    auto& body = scene.addBody(solid(name), 0.0, btVector3(0, 0, 0));
    const btQuaternion turn(btVector3(1, 0, 0), btScalar(lying ? 0.0 : 0.3));
    body.setWorldTransform(btTransform(turn, btVector3(1, 2, 3)));
    auto& sheet = scene.shells->add(squareSheet(1, 2), trampolineCloth());
    const auto placeAt = [&](double height) {  // the middle vertex above the body's centre
        std::vector<btVector3> x;
        const Points flat = squareSheet(1, 2).positions;
        for (const auto& p : flat.colwise())
            x.push_back(body.getWorldTransform() * btVector3(btScalar(p.x()),
                                                             btScalar(height + std::abs(p.x()) + std::abs(p.z())),
                                                             btScalar(p.z())));
        sheet.setPositions(x);
    };
    placeAt(0.2);
    EXPECT_NEAR(penetration(sheet, body), 0.1, bulletTolerance(1e-12, 1e-6));
    placeAt(0.31);
    EXPECT_EQ(penetration(sheet, body), 0.0);
}
INSTANTIATE_TEST_SUITE_P(Shapes, Penetration, ::testing::Values("sphere", "box", "capsule", "cylinder", "plane"));

TEST(Testing, PenetrationOfACompoundIsOfItsDeepestChild) {
    Scene scene(0.0);
    auto compound = std::make_unique<btCompoundShape>();
    for (const char* name : {"sphere", "box"}) {
        scene.shapes.push_back(solid(name));
        compound->addChildShape(btTransform(btQuaternion::getIdentity(), btVector3(0, name[0] == 's' ? -2 : 0, 0)),
                                scene.shapes.back().get());
    }
    auto& body = scene.addBody(std::move(compound), 0.0, btVector3(0, 0, 0));
    auto& sheet = scene.shells->add(squareSheet(1, 2), trampolineCloth());  // in the middle of the box
    EXPECT_NEAR(penetration(sheet, body), 0.3, bulletTolerance(1e-12, 1e-6));
}

TEST(Testing, PenetrationRefusesSurfacesItDoesNotKnow) {
    Scene scene(0.0);
    auto& cone = scene.addBody(std::make_unique<btConeShape>(btScalar(0.3), btScalar(0.5)), 1.0, btVector3(0, 0, 0));
    auto& sheet = scene.shells->add(squareSheet(1, 2), trampolineCloth());
    EXPECT_THROW(penetration(sheet, cone), std::runtime_error);
}

TEST(Testing, ContactImpulsesAreTheWeightsOfTwoBalls) {
    Scene scene;
    ShellMaterial cloth = trampolineCloth();
    cloth.massDamping = 20.0;
    auto& sheet = scene.shells->add(squareSheet(2, 16), cloth, {.tolerance = 1e-6});
    pinBorder(sheet);
    auto& light = scene.addSphere(0.2, 0.5, btVector3(btScalar(-0.5), btScalar(0.21), 0));
    auto& heavy = scene.addSphere(0.2, 1.0, btVector3(btScalar(0.5), btScalar(0.21), 0));
    for (btRigidBody* ball : {&light, &heavy}) ball->setLinearFactor(btVector3(0, 1, 0));
    scene.run(3.0, 1.0 / 60);
    EXPECT_NEAR(contactImpulse(sheet, light).y() * 60, 0.5 * 9.81, 0.02 * 0.5 * 9.81);
    EXPECT_NEAR(contactImpulse(sheet, heavy).y() * 60, 1.0 * 9.81, 0.02 * 1.0 * 9.81);
    const Vec3 sum = contactImpulse(sheet, light) + contactImpulse(sheet, heavy);
    EXPECT_LT((contactImpulse(sheet) - sum).norm(), 1e-12);
}

TEST(Testing, ReplaysAreComparedBitByBit) {
    EXPECT_TRUE(replayEqual([] {
        FallingPair scene;
        scene.run(0.1, 1.0 / 60);
        return stateOf(scene);
    }));
    double start = 1.0;
    EXPECT_FALSE(replayEqual([&] {
        FallingPair scene;
        scene.bodies[0]->setLinearVelocity(btVector3(btScalar(start), 0, 0));
        start = std::nextafter(btScalar(start), btScalar(2));  // the next run differs in the last bit
        return stateOf(scene);
    }));
}

}  // namespace
}  // namespace jacket::bullet::testing
