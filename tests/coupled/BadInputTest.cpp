// What nobody meant: defined results, and a word to the user.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::Scene;

constexpr btScalar kNaN = std::numeric_limits<btScalar>::quiet_NaN();
constexpr btScalar kInfinity = std::numeric_limits<btScalar>::infinity();

/// What is wrong with the body, and what the warning says of it.
struct Defect {
    const char* word;
    std::function<void(btRigidBody&)> apply;
};

class BadBody : public ::testing::TestWithParam<Defect> {};

/// Two balls lie in a sheet; one goes bad. The sheet ignores it, keeps the other and says so once.
TEST_P(BadBody, IsIgnoredAndNamedOnce) {
    Scene scene;
    auto& good = scene.addSphere(0.2, 1.0, btVector3(btScalar(-0.5), btScalar(0.21), 0));
    auto& bad = scene.addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 1.0,
                             btVector3(btScalar(0.5), btScalar(0.11), 0));
    auto& sheet = scene.shells->add(squareSheet(2, 10), trampolineCloth());
    pinBorder(sheet);
    sheet.anchor(60, bad);
    scene.run(0.2, 1.0 / 60);
    EXPECT_TRUE(scene.shells->takeWarnings().empty());
    GetParam().apply(bad);
    scene.run(0.5, 1.0 / 60);
    const WorldReport& report = scene.shells->lastStep();
    EXPECT_TRUE(report.finite);
    EXPECT_EQ(report.rejectedSteps, 0);
    EXPECT_TRUE(sheet.shell().positions().allFinite());
    EXPECT_LT(penetration(sheet, good), 5e-3);
    EXPECT_GT(good.getWorldTransform().getOrigin().y(), -0.3);
    const auto warnings = scene.shells->takeWarnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("body 1 (Box)"), std::string::npos) << warnings[0];
    EXPECT_NE(warnings[0].find(GetParam().word), std::string::npos) << warnings[0];
}
// Bullet carries some of these on to the position within the step.
constexpr const char* kNotFinite = "not finite";
INSTANTIATE_TEST_SUITE_P(
    Defects, BadBody,
    ::testing::Values(
        Defect{kNotFinite, [](btRigidBody& b) { b.getWorldTransform().getOrigin().setX(kNaN); }},
        Defect{kNotFinite, [](btRigidBody& b) { b.getWorldTransform().getBasis()[1].setZ(kInfinity); }},
        Defect{kNotFinite, [](btRigidBody& b) { b.setLinearVelocity(btVector3(0, kNaN, 0)); }},
        Defect{kNotFinite, [](btRigidBody& b) { b.setAngularVelocity(btVector3(kInfinity, 0, 0)); }},
        Defect{kNotFinite, [](btRigidBody& b) { b.setMassProps(kNaN, btVector3(1, 1, 1)); }},
        Defect{kNotFinite, [](btRigidBody& b) { b.setMassProps(kInfinity, btVector3(1, 1, 1)); }},
        Defect{"mass or inertia is negative", [](btRigidBody& b) { b.setMassProps(-1, btVector3(1, 1, 1)); }},
        Defect{"mass or inertia is negative", [](btRigidBody& b) { b.setMassProps(1, btVector3(1, -1, 1)); }}));

TEST(BadInput, ARepairedBodyTouchesAgain) {
    Scene scene;
    auto& ball = scene.addSphere(0.2, 1.0, btVector3(0, btScalar(0.21), 0));
    auto& sheet = scene.shells->add(squareSheet(2, 10), trampolineCloth());
    pinBorder(sheet);
    ball.setLinearVelocity(btVector3(0, kNaN, 0));
    scene.run(0.1, 1.0 / 60);
    const btTransform pose(btQuaternion::getIdentity(), btVector3(0, btScalar(0.5), 0));
    ball.setCenterOfMassTransform(pose);
    ball.setInterpolationWorldTransform(pose);
    ball.setLinearVelocity(btVector3(0, 0, 0));
    ball.setAngularVelocity(btVector3(0, 0, 0));
    ball.clearForces();
    ball.forceActivationState(ACTIVE_TAG);
    bool touched = false;
    for (int i = 0; i < 60; ++i) {
        scene.step(1.0 / 60);
        touched = touched || !jacket::testing::contactImpulse(sheet, ball).isZero(0.0);
    }
    EXPECT_TRUE(touched);
    EXPECT_LT(penetration(sheet, ball), 5e-3);
    EXPECT_EQ(scene.shells->takeWarnings().size(), 1u);
}

TEST(BadInput, NumbersOfThreadsMustBePositive) {
    Scene scene;
    EXPECT_THROW(scene.shells->setThreads(0), std::invalid_argument);
    EXPECT_EQ(scene.shells->threads(), 1);
    scene.shells->setThreads(2);
    EXPECT_EQ(scene.shells->threads(), 2);
    scene.shells->setThreads(1);
    EXPECT_EQ(scene.shells->threads(), 1);
}

TEST(BadInput, MassesOfMaterialsMustBePositiveAndFinite) {
    Scene scene;
    for (const double density : {-1.0, 0.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
        ShellMaterial cloth = trampolineCloth();
        cloth.density = density;
        EXPECT_THROW(scene.shells->add(squareSheet(1, 4), cloth), std::invalid_argument) << density;
        cloth = trampolineCloth();
        cloth.areaDensityOverride = density;
        EXPECT_THROW(scene.shells->add(squareSheet(1, 4), cloth), std::invalid_argument) << density;
    }
    EXPECT_EQ(scene.world.getNumCollisionObjects(), 0);
}

/// That a sheet with these options is refused, by the option's name.
void expectRefused(const ShellOptions& options, const std::string& name) {
    Scene scene;
    try {
        scene.shells->add(squareSheet(1, 4), trampolineCloth(), options);
        ADD_FAILURE() << name << " was accepted";
    } catch (const std::invalid_argument& error) {
        EXPECT_NE(std::string(error.what()).find(name + " "), std::string::npos) << error.what();
    }
    EXPECT_EQ(scene.shells->size(), 0);
}

TEST(BadInput, NumbersOfOptionsMustBeUsable) {
    for (const double value : {std::nan(""), double(kInfinity), -double(kInfinity)}) {
        expectRefused({.contactThickness = value}, "ShellOptions.contactThickness");
        expectRefused({.friction = value}, "ShellOptions.friction");
        expectRefused({.restitution = value}, "ShellOptions.restitution");
        expectRefused({.tolerance = value}, "ShellSettings.tolerance");
    }
    expectRefused({.friction = -0.1}, "ShellOptions.friction");
    expectRefused({.restitution = 1.1}, "ShellOptions.restitution");
    expectRefused({.tolerance = 0.0}, "ShellSettings.tolerance");
    expectRefused({.maxIterations = 0}, "ShellSettings.maxIterations");
}

TEST(BadInput, NumbersOfWindMustBeUsable) {
    Scene scene;
    for (const double value : {std::nan(""), double(kInfinity), -1.0}) {
        EXPECT_THROW(scene.shells->setWind({.airDensity = value}), std::invalid_argument) << value;
        EXPECT_THROW(scene.shells->setWind({.normalDrag = value}), std::invalid_argument) << value;
        EXPECT_THROW(scene.shells->setWind({.tangentialDrag = value}), std::invalid_argument) << value;
    }
    EXPECT_THROW(scene.shells->setWind({.velocity = {0, std::nan(""), 0}}), std::invalid_argument);
    EXPECT_THROW(scene.shells->setWind({.velocity = {0, 0, double(kInfinity)}}), std::invalid_argument);
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.run(0.1, kStep);  // nothing of it has stayed
    const Vec3 fallen = sheet.shell().positions().col(0) - squareSheet(1, 4).positions.col(0);
    EXPECT_NEAR(fallen.x(), 0.0, 1e-12);
    EXPECT_LT(fallen.y(), 0.0);
}

/// The shell falls on as it did; what Bullet does to bodies is not looked at.
TEST(BadInput, GravityThatIsNotFiniteIsIgnoredAndNamedOnce) {
    Scene scene, usual;
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    auto& expected = usual.shells->add(squareSheet(1, 4), trampolineCloth());
    usual.run(0.5, kStep);
    scene.run(0.2, kStep);
    for (const btScalar bad : {kNaN, kInfinity}) {
        scene.world.setGravity(btVector3(0, bad, 0));
        ASSERT_NO_THROW(scene.run(0.1, kStep));
    }
    scene.world.setGravity(usual.world.getGravity());
    scene.run(0.1, kStep);
    EXPECT_EQ(sheet.shell().positions(), expected.shell().positions());
    EXPECT_EQ(scene.shells->lastStep().rejectedSteps, 0);
    const auto warnings = scene.shells->takeWarnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("gravity"), std::string::npos) << warnings[0];
}

TEST(BadInput, StepsWithoutAFinitePositiveLengthMoveNoShell) {
    Scene scene;
    scene.addFloor(-0.05);
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.run(0.05, kStep);
    const Points before = sheet.shell().positions();
    for (const btScalar h : {kInfinity, kNaN, btScalar(0), btScalar(-0.1)}) {
        ASSERT_NO_THROW(scene.shells->updateAction(&scene.world, h)) << h;
        EXPECT_EQ(sheet.shell().positions(), before) << h;
    }
    EXPECT_EQ(scene.shells->lastStep().rejectedSteps, 3);  // all but that of length 0
    const auto warnings = scene.shells->takeWarnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("steps of inf s"), std::string::npos) << warnings[0];
    ASSERT_NO_THROW(scene.world.stepSimulation(kInfinity, 0, kInfinity));
    scene.run(0.5, kStep);
    EXPECT_TRUE(sheet.shell().positions().allFinite());
    EXPECT_NEAR(sheet.positions()[0].y(), -0.05, 2e-3);  // on the floor
}

TEST(BadInput, WarnsOnceOfAContactThicknessLargerThanEdges) {
    Scene scene;
    auto& sheet = scene.shells->add(squareSheet(1, 10), trampolineCloth(), {.contactThickness = 0.2});
    sheet.setName("hood");
    auto& fine = scene.shells->add(squareSheet(1, 10), trampolineCloth(), {.contactThickness = 0.05});
    fine.setName("fine");
    scene.run(0.1, 1.0 / 60);
    const auto warnings = scene.shells->takeWarnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("\"hood\": contact thickness 200 mm"), std::string::npos) << warnings[0];
    scene.run(0.1, 1.0 / 60);
    EXPECT_TRUE(scene.shells->takeWarnings().empty());
}

TEST(BadInput, WarnsOnceOfAMarginLargerThanTheShell) {
    Scene scene;
    scene.addBox(btVector3(1, 1, 1), 0, btVector3(0, btScalar(-1.01), 0)).getCollisionShape()->setMargin(btScalar(0.1));
    scene.addSphere(1.0, 0, btVector3(0, btScalar(-1.1), 0));  // a sphere is all margin: no mistake
    scene.shells->add(squareSheet(0.02, 4), trampolineCloth()).setName("coin");
    scene.run(0.2, 1.0 / 60);
    const auto warnings = scene.shells->takeWarnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("\"coin\" of 28.3 mm"), std::string::npos) << warnings[0];
    EXPECT_NE(warnings[0].find("100 mm of a Box"), std::string::npos) << warnings[0];
}

}  // namespace
}  // namespace jacket::bullet::testing
