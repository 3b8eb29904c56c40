// The tests of README.md, word for word (tests/boundaries.cmake compares them).
#include <gtest/gtest.h>  // or any other framework
#include <jacket/testing.h>

using namespace jacket::testing;

TEST(Trampoline, CatchesTheBall) {
    Scene scene;  // world, bodies and shells; gravity -9.81 m/s^2 along y
    const auto grid = jacket::makeGrid({.size = {2.0, 2.0}, .cells = {20, 20}});
    auto& sheet = scene.shells->add(grid, jacket::materials::cotton());
    for (const int corner : {0, 20, 420, 440}) sheet.pin(corner);
    auto& ball = scene.addSphere(/*radius*/ 0.25, /*mass*/ 2.0, btVector3(0.0, 0.5, 0.0));
    EXPECT_LT(energyGain(scene, /*seconds*/ 1.0, /*step*/ 1.0 / 120.0), 0.1);  // [J]: nothing explodes
    EXPECT_LT(penetration(sheet, ball), 1e-3);                                 // [m]: the ball has not come through
    EXPECT_GT(contactImpulse(sheet, ball).y(), 0.0);                           // [N s]: the sheet bears it
}

TEST(FreeSheet, TakesTheMomentumThatTheBallLoses) {
    Scene scene(/*gravity*/ 0.0);
    scene.shells->add(jacket::makeGrid({.size = {1.0, 1.0}, .cells = {12, 12}}), jacket::materials::rubber(2e-3));
    auto& ball = scene.addSphere(0.1, 0.5, btVector3(0.1, 0.2, 0.0));
    ball.setLinearVelocity(btVector3(0.0, -3.0, 0.5));
    const jacket::Vec3 before = totalMomentum(scene);
    scene.run(0.5, 1.0 / 120.0);
    EXPECT_GT(ball.getLinearVelocity().y(), -2.9);  // they have met
    EXPECT_LT((totalMomentum(scene) - before).norm(), 1e-5 * before.norm());
}
