// Sheets that are held inside bodies, as flags in their poles and capes in figures: what is in there does not touch the
// body, and the rest does.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "support/EmbeddedScenes.h"

namespace jacket::bullet::testing {
namespace {

using namespace embedded_scenes;

class Embedded : public ::testing::TestWithParam<std::size_t> {};

TEST_P(Embedded, SheetCostsLittleAndIsNeitherThrownNorTorn) {
    const EmbeddedScene scene = all()[GetParam()];
    for (const auto& [material, mostSolves] : {std::pair{materials::cotton(), 12}, {materials::paper(), 36}})
        for (const int cells : {8, 14}) {
            const SheetRun run = scene.run(material, cells, kStep, 1.0);
            EXPECT_LT(run.solves, mostSolves * run.steps) << scene.name << cells;
            EXPECT_LT(run.most, 200) << scene.name << cells;
            EXPECT_LE(run.outcome.unsettled, 1) << scene.name << cells;
            EXPECT_LT(run.outcome.fastest, scene.fastest) << scene.name << cells;
            EXPECT_LT(run.stretch, 0.1) << scene.name << cells;
            EXPECT_LT(run.outcome.deepest, 5e-4) << scene.name << cells;
        }
}
INSTANTIATE_TEST_SUITE_P(Scenes, Embedded, ::testing::Range<std::size_t>(0, all().size()));

/// Blown against it from the other side it lies on the pole.
TEST(Embedded, FlagTouchesItsPoleOutside) {
    BulletScene scene;
    const auto held = flag("flag", false).make(scene, materials::cotton(), 14);
    scene.shells->setWind({.velocity = Vec3(-4, 0, 0.3)});
    bool hasTouched = false;
    for (int i = 0; i < 120; ++i) {
        scene.step(kStep);
        ASSERT_TRUE(scene.shells->lastStep().settled) << i;
        for (const ContactImpulse& contact : held.sheet.contacts()) {
            for (const int vertex : contact.contact.vertices) ASSERT_FALSE(held.sheet.shell().isPinned(vertex)) << i;
            hasTouched = true;
        }
        for (const int vertex : verticesWhere(held.sheet, [](const Vec3& x) { return x.x() > kHair; }))
            ASSERT_GT(EmbeddedScene::distance(held, vertex), -5e-4) << i;
    }
    EXPECT_TRUE(hasTouched);
}

/// What was inside comes out when nothing holds it there any more.
TEST(Embedded, SheetThatIsReleasedComesOut) {
    for (const ShellMaterial& material : {materials::cotton(), materials::paper(), materials::rubber()}) {
        BulletScene scene;
        const auto held = flag("flag", false).make(scene, material, 14);
        scene.run(0.5, kStep);
        for (int i = 0; i < held.sheet.vertexCount(); ++i) held.sheet.unpin(i);
        int solves = 0;
        for (int i = 0; i < 30; ++i) {
            scene.step(kStep);
            solves += scene.shells->lastStep().solves;
            ASSERT_LT(held.sheet.shell().velocities().colwise().norm().maxCoeff(), 8.0) << i;
        }
        EXPECT_LT(penetration(held.sheet, held.body), 1e-4);
        EXPECT_LT(solves, 30 * 10);
    }
}

/// One that a body has touched from outside does not slip in beside what is held inside.
TEST(Embedded, WhatTouchesFromOutsideStaysThere) {
    BulletScene scene;
    const auto held = curtain("curtain").make(scene, materials::cotton(), 14);
    scene.shells->setWind({.velocity = Vec3(0, 12, 1)});  // lifts it against the ceiling
    const std::vector<int> outside = EmbeddedScene::verticesOutside(held);
    double highest = 0.0;
    for (int i = 0; i < 180; ++i) {
        scene.step(kStep);
        for (const int vertex : outside) {
            ASSERT_GT(EmbeddedScene::distance(held, vertex), -5e-4) << i;
            highest = std::max(highest, double(held.sheet.positions()[vertex].y()));
        }
    }
    EXPECT_GT(highest, 1.39);  // the ceiling's underside is at 1.4
}

}  // namespace
}  // namespace jacket::bullet::testing
