// Shells fall asleep with what they lie on and carry, cost nothing then, and wake up when something happens to them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "support/BulletScene.h"
#include "support/FreeScenes.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::Scene;

TriangleMesh sheetAt(double side, int cells, double height) {
    TriangleMesh mesh = squareSheet(side, cells);
    mesh.positions.row(1).array() += height;
    return mesh;
}

/// Runs until a shell sleeps; the time that took [s], or -1 if it did not within `limit`.
double timeToSleep(Scene<>& scene, const ShellBody& shell, double limit) {
    for (double t = 0; t < limit; t += kStep) {
        scene.step(kStep);
        if (shell.isAsleep()) return t;
    }
    return -1.0;
}

/// A cloth of 0.6 m on a kinematic table, with two boxes on it; everything is asleep. (One on the other they topple:
/// the contacts of a cloth that is pressed between two bodies are not solved well enough for a stack.)
struct SleepingPile : Scene<> {
    btRigidBody& table;
    ShellBody& cloth;
    btRigidBody& left;
    btRigidBody& right;

    SleepingPile()
        : table(addBox(btVector3(1, btScalar(0.1), 1), 0, btVector3(0, btScalar(-0.1), 0))),
          cloth(shells->add(sheetAt(0.6, 8, 2e-4), trampolineCloth())),
          left(addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 0.5,
                      btVector3(btScalar(-0.15), btScalar(0.101), 0))),
          right(addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 0.5,
                       btVector3(btScalar(0.15), btScalar(0.101), 0))) {
        table.setCollisionFlags(table.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
        seconds = timeToSleep(*this, cloth, 6.0);
    }
    double seconds;
};

TEST(Sleeping, ASheetOnTheFloorFallsAsleep) {
    Scene scene;
    scene.addFloor();
    auto& sheet = scene.shells->add(sheetAt(0.6, 8, 0.02), trampolineCloth());
    const double seconds = timeToSleep(scene, sheet, 4.0);
    EXPECT_GT(seconds, double(gDeactivationTime) - kStep);
    scene.step(kStep);
    EXPECT_EQ(scene.shells->lastStep().awake, 0);
    EXPECT_EQ(sheet.shell().velocities().norm(), 0.0);
}

std::unique_ptr<btCollisionShape> thingToDrape(const std::string& name) {
    const btScalar half = btScalar(0.3);
    if (name == "box") return std::make_unique<btBoxShape>(btVector3(half, half, half));
    if (name == "sphere") return std::make_unique<btSphereShape>(half);
    if (name == "cylinder") return std::make_unique<btCylinderShape>(btVector3(half, half, half));
    return std::make_unique<btCapsuleShapeZ>(btScalar(0.2), half);
}

/// Cloth over what never moves: vertices along its edges leave it and come back to it by turns, which the few rounds of
/// contacts among walls do not end, and shake what hangs from them.
class Drape : public ::testing::TestWithParam<std::string> {};

TEST_P(Drape, FallsAsleep) {
    for (const ShellMaterial& material : {materials::cotton(), materials::denim()})
        for (const double aside : {0.0, 0.037}) {
            Scene scene;
            scene.addBody(thingToDrape(GetParam()), 0.0, btVector3(btScalar(aside), btScalar(-0.32), 0));
            const ShellBody& cloth = scene.shells->add(sheetAt(1.0, 10, 0.0), material);
            EXPECT_GT(timeToSleep(scene, cloth, 40.0), 1.0)
                << material.areaDensity() << " kg/m2, " << aside << " m aside";
            EXPECT_GT(cloth.shell().positions().row(1).minCoeff(), -1.0);  // it has not slid off
        }
}
INSTANTIATE_TEST_SUITE_P(Shapes, Drape, ::testing::Values("box", "sphere", "cylinder", "capsule"));

/// What only its user moves, and does not, is as good as what never moves.
TEST(Sleeping, AClothFallsAsleepOnAKinematicBodyAtRest) {
    for (const std::string name : {"box", "sphere", "capsule"})
        for (const double aside : {0.0, 0.011, 0.037}) {
            Scene scene;
            makeKinematic(scene.addBody(thingToDrape(name), 0.0, btVector3(btScalar(aside), btScalar(-0.32), 0)));
            const ShellBody& cloth = scene.shells->add(sheetAt(1.0, 10, 0.0), materials::cotton());
            EXPECT_GT(timeToSleep(scene, cloth, 20.0), 1.0) << name << ", " << aside << " m aside";
        }
}

/// What is at rest but for noise is damped, not what begins to move: when gravity turns, a cloth that hangs over a ball
/// slides about as far as one that is never damped. On average: by its folds one slides 9 cm and another 19.
TEST(Sleeping, AClothThatHasCalmedDownIsAsFreeAsBefore) {
    const auto wayAfterTurn = [](double calmFor, bool sleeping, double aside) {
        Scene scene;
        scene.addBody(thingToDrape("sphere"), 0.0, btVector3(btScalar(aside), btScalar(-0.32), 0));
        const ShellBody& cloth = scene.shells->add(sheetAt(1.0, 10, 0.0), materials::cotton(), {.sleeping = sleeping});
        scene.run(calmFor, kStep);
        const double start = cloth.shell().positions().row(0).mean();
        scene.world.setGravity(btVector3(btScalar(7.0), btScalar(-7.0), 0));
        scene.run(0.5, kStep);
        return cloth.shell().positions().row(0).mean() - start;
    };
    constexpr double kLeast = 0.05, kShare = 0.7;  // [m], of what one slides that is never damped
    double free = 0.0, calmed = 0.0;
    for (const double calmFor : {3.0, 5.0, 20.0})
        for (int start = 0; start < 3; ++start) {
            const double way = wayAfterTurn(calmFor, false, 1e-6 * start);
            const double calmedWay = wayAfterTurn(calmFor, true, 1e-6 * start);
            EXPECT_GT(way, kLeast) << "after " << calmFor << " s";
            EXPECT_GT(calmedWay, kShare * kLeast) << "after " << calmFor << " s";
            free += way;
            calmed += calmedWay;
        }
    EXPECT_GT(calmed, kShare * free) << "of " << free << " m";
}

/// Sheets that land on a corner fold somewhere, each another way; vertices that friction turns around by turns must not
/// keep any of them moving.
TEST(Sleeping, FoldedSheetsOnTheFloorFallAsleepWhicheverWayTheyFell) {
    Scene scene;
    scene.addFloor();
    for (int i = 0; i < 64; ++i) {
        TriangleMesh mesh = sheetAt(0.4, 4, 4e-4 + 1e-3 * (i / 8));
        mesh.positions.row(1) += mesh.positions.row(0) * (0.03 * (i % 8));
        mesh.positions.row(1).array() += 0.006 * (i % 8);
        mesh.positions.row(0).array() += 0.6 * (i % 8);
        mesh.positions.row(2).array() += 0.6 * (i / 8);
        scene.shells->add(mesh, trampolineCloth());
    }
    scene.run(6.0, kStep);
    for (int i = 0; i < 64; ++i) EXPECT_TRUE((*scene.shells)[i].isAsleep()) << "sheet " << i;
}

TEST(Sleeping, BoxesSleepWithTheClothUnderThem) {
    SleepingPile scene;
    ASSERT_GT(scene.seconds, 0.0);
    const Points asleep = scene.cloth.shell().positions();
    const btScalar height = scene.right.getWorldTransform().getOrigin().y();
    scene.run(2.0, kStep);
    EXPECT_TRUE(scene.cloth.isAsleep());
    EXPECT_EQ(scene.shells->lastStep().awake, 0);
    EXPECT_EQ(scene.shells->lastStep().solves, 0);
    EXPECT_EQ(scene.left.getActivationState(), ISLAND_SLEEPING);
    EXPECT_EQ(scene.right.getActivationState(), ISLAND_SLEEPING);
    EXPECT_EQ(asleep, scene.cloth.shell().positions());
    EXPECT_EQ(height, scene.right.getWorldTransform().getOrigin().y());
}

/// It flickers over a body that stands free as over one that never moves.
TEST(Sleeping, AClothSleepsWithTheCrateThatItHangsOver) {
    for (const double mass : {2.0, 20.0}) {
        Scene scene;
        scene.addFloor();
        const btScalar half = btScalar(0.15);
        auto& crate = scene.addBox(btVector3(half, half, half), mass, btVector3(0, half, 0));
        auto& cloth = scene.shells->add(sheetAt(1.2, 12, 0.31), materials::cotton());
        EXPECT_GT(timeToSleep(scene, cloth, 25.0), 0.0) << mass << " kg";
        EXPECT_FALSE(crate.isActive());
        crate.activate();
        crate.setLinearVelocity(btVector3(btScalar(0.5), 0, 0));
        scene.run(0.1, kStep);
        EXPECT_FALSE(cloth.isAsleep());
    }
}

/// What lies on another body has no support of its own. Stacked boxes creep by up to 1 mm/s in Bullet, and the cloth
/// with them. (Lighter boxes topple under the cloth.)
TEST(Sleeping, AClothSleepsWithThePileThatItHangsOver) {
    for (const int start : {9, 18, 72}) {
        Scene scene;
        scene.addFloor();
        std::vector<btRigidBody*> boxes;
        auto& cloth = free_scenes::pileUnderCloth("boxes", 2.0)
                          .make(scene, materials::cotton(), 16, Vec3(0.007 * start, 0, 0.005 * start), boxes);
        EXPECT_GT(timeToSleep(scene, cloth, 25.0), 0.0) << start;
        scene.run(1.0, kStep);
        EXPECT_TRUE(cloth.isAsleep());
        boxes.back()->activate();
        boxes.back()->setLinearVelocity(btVector3(btScalar(0.5), 0, 0));
        scene.run(0.1, kStep);
        EXPECT_FALSE(cloth.isAsleep());
    }
}

/// Bullet wakes all of an island of which one body is awake: the lower box, which the cloth does not touch.
TEST(Sleeping, AClothFallsAsleepOnceAllOfThePileUnderItMay) {
    Scene scene;
    scene.addFloor();
    const btScalar half = btScalar(0.1);
    // Wide: on one of its own size Bullet lets a box creep by a millimetre a second, with the cloth on it.
    auto& lower = scene.addBox(btVector3(2 * half, half, 2 * half), 8.0, btVector3(0, half, 0));
    auto& upper = scene.addBox(btVector3(half, half, half), 2.0, btVector3(0, 3 * half, 0));
    auto& cloth = scene.shells->add(sheetAt(0.15, 4, 0.4 + 5e-4), materials::cotton());
    for (double t = 0.0; t < 6.0; t += kStep) {
        lower.setDeactivationTime(0);
        scene.step(kStep);
        ASSERT_FALSE(cloth.isAsleep()) << t << " s";
    }
    ASSERT_GT(timeToSleep(scene, cloth, 6.0), 0.0);
    for (double t = 0.0; t < 1.0; t += kStep) {
        EXPECT_EQ(lower.getActivationState(), ISLAND_SLEEPING);
        EXPECT_EQ(upper.getActivationState(), ISLAND_SLEEPING);
        EXPECT_TRUE(cloth.isAsleep());
        scene.step(kStep);
    }
}

/// What happens to a sleeping pile, and that this wakes the cloth.
struct Alarm {
    const char* name;
    std::function<void(SleepingPile&)> ring;
};
void PrintTo(const Alarm& alarm, std::ostream* out) {
    *out << alarm.name;
}
class Waking : public ::testing::TestWithParam<Alarm> {};

TEST_P(Waking, WakesTheCloth) {
    SleepingPile scene;
    ASSERT_TRUE(scene.cloth.isAsleep());
    GetParam().ring(scene);
    bool woke = false;
    for (int i = 0; i < 30 && !woke; ++i) {
        scene.step(kStep);
        woke = !scene.cloth.isAsleep();
    }
    EXPECT_TRUE(woke);
    EXPECT_EQ(scene.shells->lastStep().awake, 1);
}

void throwBall(SleepingPile& scene) {
    auto& ball = scene.addSphere(0.05, 0.1, btVector3(btScalar(0.22), btScalar(0.5), btScalar(0.22)));
    ball.setLinearVelocity(btVector3(0, -3, 0));
}
void blow(SleepingPile& scene) {
    Wind wind;
    wind.velocity = Vec3(0, 0, 5);
    scene.shells->setWind(wind);
}
void moveTable(SleepingPile& scene) {
    btTransform pose = scene.table.getWorldTransform();
    pose.setOrigin(pose.getOrigin() + btVector3(0, btScalar(0.01), 0));
    scene.table.activate(true);
    scene.table.setWorldTransform(pose);
}
void setForce(SleepingPile& scene) {
    scene.cloth.shell().setForce(0, Vec3(0, 0.1, 0));
}

INSTANTIATE_TEST_SUITE_P(
    Alarms, Waking,
    ::testing::Values(Alarm{"ball", throwBall}, Alarm{"wind", blow}, Alarm{"table", moveTable},
                      Alarm{"force", setForce}, Alarm{"removed_support", [](SleepingPile& s) { s.remove(s.table); }},
                      Alarm{"removed_load", [](SleepingPile& s) { s.remove(s.left); }},
                      Alarm{"pin", [](SleepingPile& s) { s.cloth.pin(0); }},
                      Alarm{"activate", [](SleepingPile& s) { s.cloth.activate(); }},
                      Alarm{"gravity", [](SleepingPile& s) { s.world.setGravity(btVector3(0, -5, 0)); }},
                      Alarm{"load_woken",
                            [](SleepingPile& s) {
                                s.right.activate(true);
                                s.right.setLinearVelocity(btVector3(1, 0, 0));
                            }}),
    [](const auto& alarm) { return std::string(alarm.param.name); });

/// It is where it was, and touches nothing any more.
TEST(Sleeping, AFloorThatIsAddedAgainWithAnotherMaskHoldsNoSheet) {
    Scene scene;
    auto& floor = scene.addFloor();
    auto& sheet = scene.shells->add(sheetAt(0.6, 8, 2e-4), trampolineCloth());
    ASSERT_GT(timeToSleep(scene, sheet, 4.0), 0.0);
    scene.world.removeRigidBody(&floor);
    scene.world.addRigidBody(&floor, btBroadphaseProxy::StaticFilter, 0);
    scene.run(0.5, kStep);
    EXPECT_FALSE(sheet.isAsleep());
    EXPECT_LT(sheet.positions()[0].y(), -0.1);
}

/// A user who sets everything anew in each frame, to what it is.
TEST(Sleeping, WhatIsSetToWhatItIsWakesNoShell) {
    Scene scene;
    scene.addFloor();
    auto& sheet = scene.shells->add(sheetAt(0.6, 8, 2e-4), trampolineCloth());
    const btVector3 corner = sheet.positions()[80];
    const Wind breeze{.velocity = {0, 0, 0.1}};
    int slept = 0;
    for (int i = 0; i < 300; ++i) {
        scene.shells->setWind(breeze);
        sheet.pin(0);
        sheet.movePin(80, corner);
        sheet.shell().setForce(5, Vec3(0, -1e-3, 0));
        sheet.shell().setPressure(0.01);
        scene.step(kStep);
        slept += sheet.isAsleep() ? 1 : 0;
    }
    EXPECT_GT(slept, 60);
    ASSERT_TRUE(sheet.isAsleep());
    scene.shells->setWind({.velocity = {0, 0, 0.2}});
    scene.step(kStep);
    EXPECT_FALSE(sheet.isAsleep());
}

TEST(Sleeping, AMovedPinWakesAHangingSheet) {
    Scene scene;
    ShellMaterial damped = trampolineCloth();
    damped.massDamping = 5.0;
    auto& sheet = scene.shells->add(squareSheet(0.6, 6), damped);
    pinBorder(sheet);
    ASSERT_GT(timeToSleep(scene, sheet, 10.0), 0.0);
    sheet.movePin(0, sheet.positions()[0] + btVector3(0, btScalar(0.01), 0));
    scene.run(2 * kStep, kStep);  // solved in the first, moved in the second
    EXPECT_FALSE(sheet.isAsleep());
    EXPECT_NEAR(sheet.positions()[0].y(), 0.01, bulletTolerance(1e-9, 1e-6));
}

/// From below, where it meets nothing but the sheet.
TEST(Sleeping, AKinematicBodyThatComesWakesIt) {
    Scene scene;
    auto& lifter = scene.addSphere(0.1, 0, btVector3(0, btScalar(-0.3), 0));
    makeKinematic(lifter);
    ShellMaterial damped = trampolineCloth();
    damped.massDamping = 5.0;
    auto& sheet = scene.shells->add(squareSheet(0.6, 6), damped);
    pinBorder(sheet);
    ASSERT_GT(timeToSleep(scene, sheet, 10.0), 0.0);
    const double before = sheet.shell().positions().row(1).maxCoeff();
    for (int i = 1; i <= 30; ++i) {
        btTransform pose = lifter.getWorldTransform();
        pose.setOrigin(btVector3(0, btScalar(-0.3 + 0.25 * i / 30), 0));
        lifter.activate(true);
        lifter.setWorldTransform(pose);
        scene.step(kStep);
    }
    EXPECT_FALSE(sheet.isAsleep());
    EXPECT_GT(sheet.shell().positions().row(1).maxCoeff(), before + 0.04);
}

TEST(Sleeping, SwitchedOffItNeverHappens) {
    Scene scene;
    scene.addFloor();
    auto& sheet = scene.shells->add(sheetAt(0.6, 8, 2e-4), trampolineCloth(), {.sleeping = false});
    auto& box =
        scene.addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 0.5, btVector3(0, btScalar(0.11), 0));
    EXPECT_LT(timeToSleep(scene, sheet, 3.0 * double(gDeactivationTime)), 0.0);
    EXPECT_EQ(scene.shells->lastStep().awake, 1);
    EXPECT_TRUE(box.isActive());  // it is kept awake with the sheet that carries it
}

}  // namespace
}  // namespace jacket::bullet::testing
