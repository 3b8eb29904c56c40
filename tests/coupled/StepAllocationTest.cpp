#include <gtest/gtest.h>

#include <functional>

#include "support/AllocationCount.h"
#include "support/BulletScene.h"
#include "support/EmbeddedScenes.h"

namespace jacket::bullet::testing {
namespace {

ShellBody& addAwakeSheet(BulletScene& scene, double side, int cells, const ShellMaterial& material) {
    return scene.shells->add(squareSheet(side, cells), material, {.friction = 0.3, .sleeping = false});
}

void addAwakeBody(BulletScene& scene, std::unique_ptr<btCollisionShape> shape, double mass, const btVector3& at) {
    scene.addBody(std::move(shape), mass, at).setActivationState(DISABLE_DEACTIVATION);
}

std::unique_ptr<btCollisionShape> box(double half) {
    return std::make_unique<btBoxShape>(btVector3(btScalar(half), btScalar(half), btScalar(half)));
}

std::unique_ptr<btCollisionShape> ball(double radius) {
    return std::make_unique<btSphereShape>(btScalar(radius));
}

void drape(BulletScene& scene) {
    ShellBody& sheet = addAwakeSheet(scene, 2.0, 50, trampolineCloth());  // large enough for a coarse space
    for (int i = 0; i <= 50; ++i) sheet.pin(i);
    addAwakeBody(scene, ball(0.5), 0, btVector3(0, btScalar(-1), btScalar(-0.6)));
}

void ballOnTrampoline(BulletScene& scene) {
    pinBorder(addAwakeSheet(scene, 2.0, 20, trampolineCloth()));
    addAwakeBody(scene, ball(0.25), 2, btVector3(btScalar(0.05), btScalar(0.4), 0));
}

void stackOnTrampoline(BulletScene& scene) {
    pinBorder(addAwakeSheet(scene, 2.0, 20, trampolineCloth()));
    addAwakeBody(scene, box(0.1), 1, btVector3(0, btScalar(0.12), 0));
    addAwakeBody(scene, box(0.1), 1, btVector3(0, btScalar(0.33), 0));
}

void sheetOnBoxOnFloor(BulletScene& scene, const ShellMaterial& material) {
    addAwakeSheet(scene, 0.6, 20, material);
    addAwakeBody(scene, std::make_unique<btBoxShape>(btVector3(3, btScalar(0.1), 3)), 0,
                 btVector3(0, btScalar(-0.32), 0));
    addAwakeBody(scene, box(0.1), 1, btVector3(0, btScalar(-0.12), 0));
}

void curtainInACeiling(BulletScene& scene) {
    embedded_scenes::curtain("").make(scene, materials::cotton(), 14);
}

struct Case {
    const char* name;
    std::function<void(BulletScene&)> build;
    int mostAsking = 0;  ///< steps that may ask for memory
};

class Step : public ::testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(
    Of, Step,
    ::testing::Values(Case{"ClothOverABall", drape}, Case{"ABallOnATrampoline", ballOnTrampoline},
                      Case{"AStackOnATrampoline", stackOnTrampoline, 30}, Case{"ACurtainInACeiling", curtainInACeiling},
                      Case{"ClothOnABoxOnTheFloor", [](auto& s) { sheetOnBoxOnFloor(s, trampolineCloth()); }},
                      Case{"APlateOnABoxOnTheFloor", [](auto& s) { sheetOnBoxOnFloor(s, materials::steel(2e-3)); }}),
    [](const auto& parameter) { return std::string(parameter.param.name); });

/// Bullet's part included. More contacts than ever before take memory, as in the stack, which falls over.
TEST_P(Step, AsksForNoMemory) {
    BulletScene scene;
    GetParam().build(scene);
    for (int i = 0; i < 60; ++i) scene.step(1.0 / 60);
    int asking = 0;
    for (int i = 0; i < 180; ++i) {
        const long before = allocations;
        scene.step(1.0 / 60);
        asking += allocations > before;
    }
    EXPECT_LE(asking, GetParam().mostAsking);
    EXPECT_GT(scene.shells->lastStep().contacts, 0);
}

}  // namespace
}  // namespace jacket::bullet::testing
