// Shells in and on stacks of bodies: what Bullet holds up stays where Bullet holds it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::Scene;

/// A box of 1 kg on the floor, at rest; then a shell on it. Shell's mass over the box's, step.
class LoadedBox : public ::testing::TestWithParam<std::tuple<double, double>> {
  protected:
    static constexpr double kHalf = 0.1;
    const double ratio = std::get<0>(GetParam()), h = std::get<1>(GetParam());
    Scene<> scene;
    btRigidBody* box = nullptr;
    ShellBody* shell = nullptr;
    double rest = 0.0;  ///< the box's height without a load

    void SetUp() override {
        scene.addFloor();
        box = &scene.addBox(btVector3(btScalar(0.3), btScalar(kHalf), btScalar(0.3)), 1.0,
                            btVector3(0, btScalar(kHalf), 0));
        box->setActivationState(DISABLE_DEACTIVATION);
        scene.run(0.5, h);
        rest = height();
        ShellMaterial material = trampolineCloth();
        material.areaDensityOverride = ratio / 0.16;
        TriangleMesh mesh = squareSheet(0.4, 6);
        mesh.positions.row(1).array() += 2 * kHalf + 0.005;
        shell = &scene.shells->add(mesh, material);
        for (int i = 0; i < int(1.0 / h); ++i) {
            scene.step(h);
            lowest = std::min(lowest, height() - rest);
            highest = std::max(highest, height() - rest);
        }
    }
    double height() const { return double(box->getWorldTransform().getOrigin().y()); }
    double lowest = 0.0, highest = 0.0;  ///< the box, above its rest [m]
};

TEST_P(LoadedBox, IsNeitherPressedIntoTheFloorNorThrown) {
    const auto gaps = shell->shell().positions().row(1).array() - height() - kHalf - shell->contactThickness();
    EXPECT_LT(highest, 1e-4);
    EXPECT_GT(gaps.minCoeff(), -1e-4);
    EXPECT_LT(gaps.maxCoeff(), 1e-4);
    scene.shells->remove(*shell);
    double hop = 0.0;
    for (int i = 0; i < int(0.5 / h); ++i) {
        scene.step(h);
        hop = std::max(hop, height() - rest);
    }
    EXPECT_LT(hop, 1e-4);
}

TEST_P(LoadedBox, StaysWhenTheShellIsPulledAway) {
    shell->setVelocity(btVector3(0, 3, 0));
    double hop = 0.0;
    for (int i = 0; i < int(0.25 / h); ++i) {
        scene.step(h);
        hop = std::max(hop, height() - rest);
    }
    EXPECT_GT(shell->shell().positions().row(1).minCoeff(), 2 * kHalf + 0.2);
}
INSTANTIATE_TEST_SUITE_P(Grid, LoadedBox,
                         ::testing::Combine(::testing::Values(1e-4, 1.0, 1e2, 1e4),
                                            ::testing::Values(1.0 / 60, 1.0 / 240)));

}  // namespace
}  // namespace jacket::bullet::testing
