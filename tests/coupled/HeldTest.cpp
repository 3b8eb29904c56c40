// Bodies that meet what a pin or an anchor holds of a shell, while joints or masses hold them.
#include <gtest/gtest.h>

#include <string>

#include "support/UseScenes.h"

namespace jacket::bullet::testing {
namespace {

/// Of each of its materials and steps.
template <class Expect>
void expectOf(const UseScene& scene, Expect expect) {
    scene.runAll(1, [&](const UseScene::Run& run, const std::string& material, double h) {
        SCOPED_TRACE(material + " in steps of " + std::to_string(h) + " s");
        expect(run);
    });
}

/// Vertices that are tied to a heavy body stop it where they meet a pole. While they opposed the pole with no more than
/// their own weight, it came 1 to 96 mm into panels, and rubber was thrown at up to 195 m/s.
TEST(Held, APanelOnACarStopsItAtAPole) {
    const UseScene scene = use_scenes::carPanel("");
    expectOf(scene, [&](const UseScene::Run& run) {
        EXPECT_EQ(run.outcome.fault(scene.fastest), nullptr) << run.outcome.deepest << " m deep";
        EXPECT_LT(run.fastestBody, 11.0);
        EXPECT_LT(run.most, 400);  // solves
    });
}

/// Neither a pin nor a hinge gives way: what one may not take back of the other's depth would take impulses without
/// bound. The door was up to 1e5 m/s fast for a step, and the curtain 2000.
TEST(Held, ADoorOnAHingeComesToRestAtPins) {
    for (const double top : {1.9, 1.96}) {
        SCOPED_TRACE("door up to " + std::to_string(top));
        expectOf(use_scenes::doorAndCurtain("", top), [](const UseScene::Run& run) {
            EXPECT_LT(run.fastestBody, 40.0);
            EXPECT_LT(run.outcome.fastest, 25.0);
            EXPECT_LE(run.outcome.unsettled, 5);
        });
    }
}

/// What bears a body up was taken to leave a shell alone that its motor presses on a wall: few rounds were made, and
/// what they left over threw the block at 197 to 7000 m/s, in all but the cotton at 1/240 s. In those where it held,
/// the motor was made out to give ever more.
TEST(Held, ABlockOnAMotorPressesASheetOnAWall) {
    expectOf(use_scenes::press(""), [](const UseScene::Run& run) {
        EXPECT_LT(run.fastestBody, 120.0);
        EXPECT_LT(run.outcome.fastest, 30.0);
        EXPECT_LT(run.outcome.deepest, 0.08);
        EXPECT_LT(run.most, 1000);  // solves
    });
}

/// Vertices that are tied to light planks give way with them. Taken for immovable, they held the walker by penalties
/// alone, 1 to 10 mm inside of it.
TEST(Held, AWalkerOnARopeBridgeIsBorneByIt) {
    const UseScene scene = use_scenes::ropeBridge("");
    for (const double h : {1.0 / 60, 1.0 / 240}) {
        const UseScene::Run run = scene.run("leather", 1, h);
        EXPECT_EQ(run.outcome.fault(scene.fastest), nullptr) << run.outcome.deepest << " m deep at " << h;
    }
    EXPECT_LT(scene.run("denim", 1, 1.0 / 60).outcome.deepest, 5e-3);
}

}  // namespace
}  // namespace jacket::bullet::testing
