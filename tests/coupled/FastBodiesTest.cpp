// Bodies that cross a sheet's thickness, or their own, many times over within one step.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "support/HardScenes.h"
#include "support/SmallBox.h"
#include "support/Target.h"
#include "support/UseScenes.h"
#include "support/UserBall.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::energy;
using jacket::testing::Scene;

/// A ball of 5 or 10 mm that comes with 400 m/s, 6.7 m a step. Mass [kg], whether it is launched between two steps,
/// which of three shots.
class Bullet : public ::testing::TestWithParam<std::tuple<double, bool, int>> {};

TEST_P(Bullet, NeverPassesSilentlyAndGainsNoEnergy) {
    struct Shot {
        double radius;
        btVector3 from;
    };
    const Shot shots[] = {{0.005, btVector3(btScalar(0.013), 1, btScalar(0.021))},
                          {0.0025, btVector3(btScalar(0.025), btScalar(2.139), btScalar(-0.215))},
                          {0.0025, btVector3(btScalar(0.005), btScalar(2.684), btScalar(0.035))}};
    const auto [mass, launched, which] = GetParam();
    Target scene;
    auto& ball = scene.addSphere(shots[which].radius, mass, shots[which].from);
    if (launched) scene.step(1.0 / 60);
    ball.setLinearVelocity(btVector3(0, -400, 0));
    const double start = energy(scene).total();
    double most = 0.0;
    for (int i = 0; i < 30; ++i) {
        scene.step(1.0 / 60);
        most = std::max(most, energy(scene).total() / start);
    }
    const bool through = !scene.isAbove(ball);
    EXPECT_TRUE(!through || scene.shells->lastStep().passedSteps > 0);
    EXPECT_LT(most, 1.03);
    EXPECT_TRUE(std::isfinite(double(ball.getLinearVelocity().length2())));
    EXPECT_TRUE(scene.sheet.shell().positions().allFinite());
}
INSTANTIATE_TEST_SUITE_P(Masses, Bullet,
                         ::testing::Combine(::testing::Values(1e-3, 1e-2, 1e-1, 1.0), ::testing::Bool(),
                                            ::testing::Range(0, 3)));

/// Counts the support points that it is asked for.
class AskedBall final : public UserBall {
  public:
    using UserBall::UserBall;
    btVector3 localGetSupportingVertexWithoutMargin(const btVector3& v) const override {
        ++m_asked;
        return UserBall::localGetSupportingVertexWithoutMargin(v);
    }
    int asked() const { return m_asked; }

  private:
    mutable int m_asked = 0;
};

/// A body's spin moves nothing of it nearer to a plane in front of it than its own surface is, and what is out of reach
/// of the surface need not be looked at.
TEST(Sweeps, LookAtLittleMoreWhereABallSpins) {
    constexpr int kStepsFarOff = 5;
    int asked[2], farOff[2];
    for (const bool spins : {false, true}) {
        Target scene;
        auto shape = std::make_unique<AskedBall>(btScalar(0.1));
        const AskedBall& ball = *shape;
        auto& body = scene.addBody(std::move(shape), 1.0, btVector3(btScalar(0.01), btScalar(0.4), btScalar(0.02)));
        body.setLinearVelocity(btVector3(0, -2, 0));
        if (spins) body.setAngularVelocity(btVector3(0, 0, 20));
        for (int i = 0; i < 20; ++i) {
            scene.step(1.0 / 60);
            if (i < kStepsFarOff) farOff[spins] = ball.asked();
        }
        asked[spins] = ball.asked();
        EXPECT_GT(body.getLinearVelocity().y(), -1) << "did not meet the sheet";
    }
    EXPECT_LT(farOff[1], kStepsFarOff * 400);  // the sheet has 800 triangles
    EXPECT_LT(asked[1], 8 * asked[0]);
}

/// Slower ones, whether they fly from the first step or are launched between two steps, where the last solve knew
/// nothing of their speed. Shape, launched, height [m]: how far off the first step ends.
class Missile : public ::testing::TestWithParam<std::tuple<const char*, bool, double>> {};

TEST_P(Missile, NeverPassesSilently) {
    const auto [shape, launched, height] = GetParam();
    Target scene;
    const auto cube = boxMesh(kHalf);
    auto& body =
        scene.addBody(missile(shape, *cube), 0.5, btVector3(btScalar(0.013), btScalar(height), btScalar(0.021)));
    if (launched) scene.run(0.05, 1.0 / 60);
    body.activate(true);
    body.setLinearVelocity(btVector3(0, -40, 0));
    double fastest = 0.0;
    for (int i = 0; i < 30; ++i) {
        scene.step(1.0 / 60);
        fastest = std::max(fastest, double(body.getLinearVelocity().length()));
    }
    EXPECT_TRUE(scene.isAbove(body) || scene.shells->lastStep().passedSteps > 0);
    EXPECT_LT(fastest, 40.1);
    EXPECT_TRUE(scene.sheet.shell().positions().allFinite());
}
INSTANTIATE_TEST_SUITE_P(Launches, Missile,
                         ::testing::Combine(::testing::Values("ball", "rod", "mesh"), ::testing::Bool(),
                                            ::testing::Values(0.2, 0.45, 1.0)));

/// At speeds at which a step ends beyond the middle of the body the nearest surface may be another than the one that
/// was passed.
class SlowMissile : public ::testing::TestWithParam<std::tuple<const char*, double>> {};

TEST_P(SlowMissile, IsStopped) {
    const auto [shape, speed] = GetParam();
    const auto cube = boxMesh(kHalf);
    int stopped = 0;
    for (const double height : {0.13, 0.15, 0.17, 0.19, 0.21, 0.23}) {
        Target scene;
        auto& body =
            scene.addBody(missile(shape, *cube), 0.5, btVector3(btScalar(0.013), btScalar(height), btScalar(0.021)));
        body.setLinearVelocity(btVector3(0, btScalar(-speed), 0));
        const double start = energy(scene).total();
        for (int i = 0; i < 25; ++i) {
            scene.step(1.0 / 60);
            EXPECT_LT(energy(scene).total(), 1.2 * start) << "from " << height;  // wanted: 1.01
        }
        const bool isAbove = scene.isAbove(body);
        EXPECT_TRUE(isAbove || scene.shells->lastStep().passedSteps > 0) << "from " << height;
        stopped += isAbove;
    }
    EXPECT_EQ(stopped, 6);
}
INSTANTIATE_TEST_SUITE_P(Speeds, SlowMissile,
                         ::testing::Combine(::testing::Values("box", "mesh"), ::testing::Values(0.7, 1.5, 2.0, 4.0)));

/// A sheet that flies against a board of 2 cm.
class Board : public ::testing::TestWithParam<std::tuple<const char*, double>> {};

TEST_P(Board, IsNotPassedByASheet) {
    const auto [shape, speed] = GetParam();
    const btVector3 half(btScalar(1.5), btScalar(0.01), btScalar(1.5));
    const auto surface = boxMesh(half);
    for (const double height : {0.1, 0.2, 0.45, 1.0}) {
        Scene<> scene(0.0);
        std::unique_ptr<btCollisionShape> solid = std::make_unique<btBoxShape>(half);
        if (std::string(shape) == "mesh") solid = std::make_unique<btBvhTriangleMeshShape>(surface.get(), true);
        scene.addBody(std::move(solid), 0, btVector3(0, 0, 0));
        auto& sheet = scene.shells->add(squareSheet(1, 12), trampolineCloth());
        place(sheet, {0.01, height, 0.02});
        sheet.setVelocity(btVector3(0, btScalar(-speed), 0));
        const double start = energy(scene).total();
        for (int i = 0; i < 70 && i < 1 + 60 * 2 * height / speed + 10; ++i) {
            scene.step(1.0 / 60);
            EXPECT_GT(sheet.shell().positions().row(1).minCoeff(), 0.0099) << "from " << height << ", step " << i;
        }
        EXPECT_LT(energy(scene).total(), 1.01 * start);
        // Wanted: 0. Over float Bullet the contacts of one step may not settle, which says that it may have.
        EXPECT_LE(scene.shells->lastStep().passedSteps, bulletTolerance(0, 1));
    }
}
INSTANTIATE_TEST_SUITE_P(Speeds, Board,
                         ::testing::Combine(::testing::Values("box", "mesh"),
                                            ::testing::Values(2.0, 5.0, 20.0, 100.0, 400.0)));

/// Where a vertex comes down on ground that is not flat is not where it was nearest to at the start.
class FlungAtAHill : public ::testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(FlungAtAHill, ASheetIsHeld) {
    const auto [speed, h] = GetParam();
    for (const double aside : {0.0, 0.013}) {
        HillScene scene(aside);
        const HillScene::Impact impact = scene.fling(speed, h);
        EXPECT_LT(impact.deepest, 0.01) << aside << " m aside";
        EXPECT_LT(impact.mostEnergy, 2.5) << aside << " m aside";  // wanted: 1.01
    }
}
INSTANTIATE_TEST_SUITE_P(Speeds, FlungAtAHill,
                         ::testing::Combine(::testing::Values(5.0, 10.0, 20.0), ::testing::Values(kStep, kStep / 2)));

/// Past the board's edges the sheet goes several times its thickness in a step, and the edges would cut through it.
class SmallBoard : public ::testing::TestWithParam<double> {};

TEST_P(SmallBoard, HoldsASheetThatHangsOverIt) {
    for (const double thick : {0.01, 0.025})
        for (const double height : {0.15, 0.37}) {
            Shelf scene(thick, {0.03, height, -0.02}, GetParam());
            scene.run(height / GetParam() + 0.5, kStep);
            EXPECT_TRUE(scene.isHeld()) << thick << " m thick, from " << height << " m";
        }
}
INSTANTIATE_TEST_SUITE_P(Speeds, SmallBoard, ::testing::Values(4.6, 7.0, 10.0));

/// Where the board's corners and edges end beside a vertex that hangs past them, its triangles would cut across. At
/// rest the contacts of a step follow from those of the last one. How it folds, and with it the solves, rounding
/// decides: they are counted over starts a micrometre apart.
TEST(SmallBoardAtRest, IsNotCutInto) {
    constexpr int kStarts = 3;
    for (const int cells : {20, 30}) {
        int solves = 0;
        for (int start = 0; start < kStarts; ++start) {
            Shelf scene(0.015, {0.03 + 1e-6 * start, 0.7, -0.02}, 0.0, cells);
            scene.run(2.0, kStep);
            for (int i = 0; i < 60; ++i) {
                scene.step(kStep);
                EXPECT_LT(penetration(scene.sheet, scene.board), 1e-4)
                    << cells << " cells, start " << start << ", step " << i;
                solves += scene.shells->lastStep().solves;
            }
        }
        EXPECT_LT(solves, 150 * kStarts) << cells << " cells";
    }
}

/// A ball of 1 cm that its user moves through a sheet that cannot give way, so slowly that it is nowhere near fast:
/// inside of triangles, across their edges and at their corners.
TEST(SmallBodies, ThatGoThroughASheetAreReported) {
    constexpr double kSide = 1.0, kSpeed = 0.1;  // [m], [m/s]: 1.7 mm a step
    constexpr int kCells = 4;
    for (const auto& [x, z] : {std::pair{0.11, 0.07},
                               {0.1, 0.1},
                               {0.125, 0.125},
                               {0.25, 0.1},
                               {0.0, 0.0},
                               {0.07, 0.0},
                               {-0.2, 0.31},
                               {-0.31, -0.25}}) {
        Scene<> scene(0.0);
        auto& sheet = scene.shells->add(squareSheet(kSide, kCells), trampolineCloth());
        for (int i = 0; i < sheet.vertexCount(); ++i) sheet.pin(i);
        auto& ball = scene.addSphere(0.005, 0.0, btVector3(btScalar(x), btScalar(0.05), btScalar(z)));
        makeKinematic(ball);
        for (double y = 0.05; y > -0.05; y -= kSpeed * kStep) {
            btTransform pose = ball.getWorldTransform();
            pose.setOrigin(btVector3(btScalar(x), btScalar(y), btScalar(z)));
            ball.setWorldTransform(pose);
            scene.step(kStep);
            const bool isThrough = y < 0.0;
            EXPECT_EQ(scene.shells->lastStep().passedSteps > 0, isThrough) << x << " " << z << ", at " << y;
        }
        EXPECT_LE(scene.shells->lastStep().passedSteps, 2) << x << " " << z;
    }
}

/// Some of those that once got through triangles larger than they are little by little, and no step said so.
TEST(SmallBodies, AreNotLostSilently) {
    const ShellMaterial kinds[] = {materials::cotton(), materials::paper(), materials::rubber(),
                                   materials::steel(5e-4)};
    int below = 0;
    for (const unsigned seed : {26, 112, 156, 179, 320, 362, 410, 452, 513, 569, 716, 729, 730, 752, 824, 848, 883}) {
        const SmallBox box(seed, kinds[seed % 4]);
        EXPECT_TRUE(!box.isBelow || box.isSaid) << "box " << seed;
        below += box.isBelow ? 1 : 0;
    }
    EXPECT_LE(below, 8);  // before: 17
}

/// A ball against a free sheet: in a step that is taken in parts, too, each gets what the other gives.
TEST(FastBodies, KeepMomentum) {
    BulletScene scene(0.0);
    auto& sheet = scene.shells->add(squareSheet(1, 20), trampolineCloth());
    auto& ball = scene.addSphere(0.05, 0.2, btVector3(btScalar(0.013), btScalar(2.4), btScalar(0.021)));
    ball.setLinearVelocity(btVector3(0, -60, 0));
    const Vec3 start = jacket::testing::totalMomentum(scene);
    double most = 0.0;
    int solves = 0;
    for (int i = 0; i < 20; ++i) {
        const Vec3 before = toVec3(ball.getLinearVelocity());
        scene.step(kStep);
        Vec3 given = Vec3::Zero();
        for (const BodyContact& contact : sheet.contacts()) given -= contact.impulse;
        most = std::max(most, (given - 0.2 * (toVec3(ball.getLinearVelocity()) - before)).norm());
        solves = std::max(solves, scene.shells->lastStep().solves);
    }
    EXPECT_GT(solves, 12);  // more than an attempt at the whole step has
    EXPECT_LT(most, bulletTolerance(1e-9, 1e-5));
    EXPECT_LT((jacket::testing::totalMomentum(scene) - start).norm(), bulletTolerance(1e-9, 1e-4));
}

/// A stiff balloon that a plate presses snaps. A contact that let go too early threw a vertex to the other side of the
/// plate, where nothing found it: it ended in the plate's middle, from all of 12 places.
TEST(FastBodies, AreFoundWhereAContactThatLetGoHasThrownWhatItHeld) {
    const UseScene scene = use_scenes::pressedBalloon("");
    const UseScene::Run run = scene.run("pet", 1, kStep);
    EXPECT_EQ(run.outcome.fault(scene.fastest), nullptr) << run.outcome.deepest << " m deep";
}

}  // namespace
}  // namespace jacket::bullet::testing
