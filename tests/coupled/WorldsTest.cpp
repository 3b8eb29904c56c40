// Every world of Bullet that has actions moves a shell, a ball and a floor as btDiscreteDynamicsWorld does.
#include "coupled/Worlds.h"

#include <BulletDynamics/Dynamics/btSimpleDynamicsWorld.h>
#include <gtest/gtest.h>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::contactImpulse;
using jacket::testing::Scene;
using jacket::testing::stateOf;

/// A ball falls onto a sheet that is pinned at its border; a second one falls onto the floor, and a free sheet onto it,
/// off its middle: where all is symmetric, rounding decides which of two contacts comes first.
template <class World>
struct MixedScene : Scene<World> {
    btRigidBody& caught = this->addSphere(0.25, 1.0, btVector3(0, btScalar(0.9), 0));
    btRigidBody& other = this->addSphere(0.2, 1.0, btVector3(3, btScalar(0.25), 0));
    ShellBody& sheet =
        this->shells->add(raised(squareSheet(2, 10), {0, 0.6, 0}), trampolineCloth(), {.tolerance = 1e-8});
    ShellBody& loose =
        this->shells->add(raised(squareSheet(0.6, 6), {3.013, 0.5, 0.007}), trampolineCloth(), {.tolerance = 1e-8});

    MixedScene() {
        this->addFloor();
        pinBorder(sheet);
    }
    static TriangleMesh raised(TriangleMesh mesh, const Vec3& by) {
        mesh.positions.colwise() += by;
        return mesh;
    }
};

template <class World>
class Worlds : public ::testing::Test {};
using OtherWorlds = ::testing::Types<btDiscreteDynamicsWorldMt, btMultiBodyDynamicsWorld, btSoftRigidDynamicsWorld,
                                     btDeformableMultiBodyDynamicsWorld>;
TYPED_TEST_SUITE(Worlds, OtherWorlds);

TYPED_TEST(Worlds, MoveAsTheDiscreteWorldDoes) {
    MixedScene<btDiscreteDynamicsWorld> reference;
    MixedScene<TypeParam> scene;
    bool caught = false, covered = false;
    double farthest = 0.0;
    for (int i = 0; i < 90; ++i) {
        reference.step(1.0 / 90);
        scene.step(1.0 / 90);
        caught = caught || !contactImpulse(scene.sheet, scene.caught).isZero(0.0);
        covered = covered || !contactImpulse(scene.loose, scene.other).isZero(0.0);
        const auto expected = stateOf(reference), got = stateOf(scene);
        ASSERT_EQ(expected.size(), got.size());
        for (std::size_t k = 0; k < got.size(); ++k) farthest = std::max(farthest, std::abs(got[k] - expected[k]));
    }
    EXPECT_TRUE(caught);
    EXPECT_TRUE(covered);
    EXPECT_LT(farthest, bulletTolerance(1e-6, 5e-2));  // velocities after a bounce, in m/s and rad/s, included
}

TYPED_TEST(Worlds, AShellComesAndGoes) {
    Scene<TypeParam> scene;
    scene.addFloor();
    auto& first = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.step(1.0 / 60);
    scene.shells->remove(first);
    auto& second = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.step(1.0 / 60);
    EXPECT_GT(second.contacts().size(), 0u);
    scene.shells.reset();
    EXPECT_EQ(scene.world.getNumCollisionObjects(), 1);
    scene.step(1.0 / 60);
}

struct Lines : btIDebugDraw {
    int lines = 0;
    void drawLine(const btVector3&, const btVector3&, const btVector3&) override { ++lines; }
    void drawContactPoint(const btVector3&, const btVector3&, btScalar, int, const btVector3&) override {}
    void reportErrorWarning(const char*) override {}
    void draw3dText(const btVector3&, const char*) override {}
    void setDebugMode(int) override {}
    int getDebugMode() const override { return DBG_DrawWireframe; }
};

TYPED_TEST(Worlds, DrawShells) {
    Lines drawer;
    Scene<TypeParam> scene;
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.world.setDebugDrawer(&drawer);
    scene.world.debugDrawWorld();
    EXPECT_GE(drawer.lines,
              static_cast<int>(sheet.shell().mesh().edges().size()) + 3 * sheet.shell().mesh().triangleCount());
}

/// btSimpleDynamicsWorld drops actions: shells would stand still there without a word.
TEST(SimpleWorld, IsRefused) {
    jacket::testing::WorldParts<btSimpleDynamicsWorld> parts;
    EXPECT_THROW(ShellWorld shells(parts.world), std::invalid_argument);
}

}  // namespace
}  // namespace jacket::bullet::testing
