// Every world of Bullet that has actions moves a shell, a ball and a floor as btDiscreteDynamicsWorld does.
#include "coupled/Worlds.h"

#include <BulletDynamics/Dynamics/btSimpleDynamicsWorld.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::contactImpulse;
using jacket::testing::Scene;
using jacket::testing::stateOf;

/// A ball falls onto a sheet that is pinned at its border; a second one falls onto the floor, and a free sheet onto it,
/// off its middle: where all is symmetric, rounding decides which of two contacts comes first. It is lighter than the
/// sheet, whose contacts are then settled in every step: of a heavy one what matters little is left to the next, and
/// rounding decides of what. `aside`: from one of several places [m].
template <class World>
struct MixedScene : Scene<World> {
    btRigidBody& caught = this->addSphere(0.25, 1.0, btVector3(0, btScalar(0.9), 0));
    btRigidBody& other = this->addSphere(0.2, 0.1, btVector3(3, btScalar(0.25), 0));
    ShellBody& sheet =
        this->shells->add(raised(squareSheet(2, 10), {0, 0.6, 0}), trampolineCloth(), {.tolerance = 1e-10});
    ShellBody& loose;

    explicit MixedScene(double aside)
        : loose(this->shells->add(raised(squareSheet(0.6, 3), {3.013 + aside, 0.5, 0.007 + 0.6 * aside}),
                                  trampolineCloth(), {.tolerance = 1e-10})) {
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

/// What worlds are compared by: in double all of it, in float where things are: contacts are decided of by rounding in
/// most places, and velocities differ for a step.
template <class World>
std::vector<double> comparedOf(const MixedScene<World>& scene) {
    if (sizeof(btScalar) == 8) return stateOf(scene);
    std::vector<double> places;
    for (const ShellBody* shell : {&scene.sheet, &scene.loose})
        places.insert(places.end(), shell->shell().positions().data(),
                      shell->shell().positions().data() + shell->shell().positions().size());
    for (const btRigidBody* body : {&scene.caught, &scene.other})
        for (int axis = 0; axis < 3; ++axis) places.push_back(double(body->getWorldTransform().getOrigin()[axis]));
    return places;
}

/// In most of five places: in one of six or so, differences of 1e-9 between Bullet's solvers decide of a contact.
TYPED_TEST(Worlds, MoveAsTheDiscreteWorldDoes) {
    std::array<double, 5> farthest{};
    for (std::size_t place = 0; place < farthest.size(); ++place) {
        const double aside = 0.0021 * static_cast<double>(place);
        MixedScene<btDiscreteDynamicsWorld> reference(aside);
        MixedScene<TypeParam> scene(aside);
        bool caught = false, covered = false;
        for (int i = 0; i < 90; ++i) {
            reference.step(1.0 / 90);
            scene.step(1.0 / 90);
            caught = caught || !contactImpulse(scene.sheet, scene.caught).isZero(0.0);
            covered = covered || !contactImpulse(scene.loose, scene.other).isZero(0.0);
            const auto expected = comparedOf(reference), got = comparedOf(scene);
            ASSERT_EQ(expected.size(), got.size());
            for (std::size_t k = 0; k < got.size(); ++k)
                farthest[place] = std::max(farthest[place], std::abs(got[k] - expected[k]));
        }
        EXPECT_TRUE(caught);
        EXPECT_TRUE(covered);
    }
    std::sort(farthest.begin(), farthest.end());
    EXPECT_LT(farthest[2], bulletTolerance(1e-6, 2e-2));
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
