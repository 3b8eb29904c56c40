#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "Obstacles.h"
#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

TEST(ShellWorld, RegistersAndLeaves) {
    BulletScene scene;
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    EXPECT_EQ(scene.world.getNumCollisionObjects(), 1);
    scene.step(1.0 / 60);
    EXPECT_LT(sheet.positions()[0].y(), 0);
    scene.shells.reset();
    EXPECT_EQ(scene.world.getNumCollisionObjects(), 0);
    scene.step(1.0 / 60);  // the world goes on without it
}

TEST(ShellWorld, RemovesAShell) {
    BulletScene scene;
    auto& first = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    auto& second = scene.shells->add(squareSheet(1, 5), trampolineCloth());
    scene.step(1.0 / 60);
    scene.shells->remove(first);
    EXPECT_EQ(scene.shells->size(), 1);
    scene.step(1.0 / 60);
    EXPECT_LT(second.positions()[0].y(), 0);
    EXPECT_THROW(scene.shells->remove(first), std::invalid_argument);
}

TEST(ShellWorld, RefusesBadInputWithoutChangingTheWorld) {
    BulletScene scene;
    ShellMaterial bad = trampolineCloth();
    bad.thickness = -0.001;
    EXPECT_THROW(scene.shells->add(squareSheet(1, 4), bad), std::invalid_argument);
    TriangleMesh broken = squareSheet(1, 4);
    broken.positions(1, 3) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(scene.shells->add(broken, trampolineCloth()), std::invalid_argument);
    EXPECT_THROW(scene.shells->add(squareSheet(1, 4), trampolineCloth(), {.friction = -1}), std::invalid_argument);
    EXPECT_THROW(scene.shells->add(squareSheet(1, 4), trampolineCloth(), {.tolerance = 0}), std::invalid_argument);
    EXPECT_EQ(scene.shells->size(), 0);
    EXPECT_EQ(scene.world.getNumCollisionObjects(), 0);
}

/// A shell and a body that fall side by side stay side by side: they are drawn at the same instant.
TEST(ShellWorld, FallsInStepWithBulletsBodies) {
    BulletScene scene;
    auto& ball = scene.addSphere(0.1, 1.0, btVector3(5, 0, 0));
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth(), {.tolerance = 1e-7});
    for (int i = 0; i < 60; ++i) {
        scene.step(1.0 / 60);
        for (const btVector3& x : sheet.positions())
            ASSERT_NEAR(x.y(), ball.getWorldTransform().getOrigin().y(), bulletTolerance(1e-6, 2e-5)) << "step " << i;
    }
}

/// All vertices are found inside the floor after the first solve: each is taken out once, not once more for the edges.
TEST(ShellWorld, ASheetThatFallsOnTheFloorInItsFirstStepLiesFlat) {
    BulletScene scene;
    scene.addBox(btVector3(10, 1, 10), 0, btVector3(0, -1, 0));
    TriangleMesh mesh = squareSheet(0.4, 4);
    mesh.positions.row(1).array() += 4e-4;
    auto& sheet = scene.shells->add(mesh, trampolineCloth());
    for (int i = 0; i < 10; ++i) {
        scene.step(1.0 / 60);
        const auto heights = sheet.shell().positions().row(1).array();
        ASSERT_LT(heights.maxCoeff(), sheet.contactThickness() + 1e-6) << "step " << i;
        ASSERT_GT(heights.minCoeff(), sheet.contactThickness() - 1e-6) << "step " << i;
    }
}

TEST(ShellWorld, SubstepsOfBulletAreTheShellsSubsteps) {
    BulletScene one, two;
    auto& a = one.shells->add(squareSheet(1, 4), trampolineCloth());
    auto& b = two.shells->add(squareSheet(1, 4), trampolineCloth());
    for (int i = 0; i < 10; ++i) {
        one.world.stepSimulation(btScalar(4.0 / 240), 4, btScalar(1.0 / 240));
        for (int k = 0; k < 4; ++k) two.step(btScalar(1.0 / 240));
    }
    EXPECT_NEAR(a.positions()[7].y(), b.positions()[7].y(), 1e-6);
}

TEST(ShellWorld, TriggersAndMaskedBodiesPassThrough) {
    BulletScene scene;
    auto& trigger = scene.addSphere(0.2, 1.0, btVector3(0, 0.5, 0));
    trigger.setCollisionFlags(trigger.getCollisionFlags() | btCollisionObject::CF_NO_CONTACT_RESPONSE);
    auto& sheet = scene.shells->add(squareSheet(2, 10), trampolineCloth());
    pinBorder(sheet);
    scene.run(1.0, 1.0 / 60);
    EXPECT_LT(trigger.getWorldTransform().getOrigin().y(), -2.0);
}

TEST(ShellWorld, ABodyMayBeRemovedWhileItTouches) {
    BulletScene scene;
    auto& ball = scene.addSphere(0.25, 2.0, btVector3(0, 0.3, 0));
    auto& sheet = scene.shells->add(squareSheet(2, 10), trampolineCloth());
    pinBorder(sheet);
    auto& tied = scene.addSphere(0.1, 0.2, btVector3(btScalar(0.7), btScalar(-0.3), 0));
    sheet.anchor(38, tied);
    for (int i = 0; i < 60 && sheet.contacts().empty(); ++i) scene.step(1.0 / 60);
    ASSERT_GT(sheet.contacts().size(), 0u);
    scene.remove(ball);
    scene.remove(tied);
    scene.run(0.5, 1.0 / 60);
    EXPECT_TRUE(scene.shells->lastStep().finite);
    EXPECT_EQ(sheet.contacts().size(), 0u);
}

TEST(ShellWorld, AnAnchorHoldsItsDistance) {
    BulletScene scene;
    auto& box = scene.addBody(std::make_unique<btBoxShape>(btVector3(0.1f, 0.1f, 0.1f)), 5.0, btVector3(0, 3, 0));
    box.setAngularVelocity(btVector3(0, 1, 0));
    auto& sheet = scene.shells->add(squareSheet(1, 6), trampolineCloth());
    std::vector<btVector3> x(sheet.positions().begin(), sheet.positions().end());
    for (btVector3& p : x) p += btVector3(0, 2, 0);
    sheet.setPositions(x);
    const btVector3 local = box.getWorldTransform().inverse() * x[24];
    sheet.anchor(24, box);
    for (int i = 0; i < 30; ++i) {
        scene.step(1.0 / 60);
        const btVector3 expected = box.getWorldTransform() * local;
        ASSERT_LT((sheet.positions()[24] - expected).length(), bulletTolerance(1e-9, 1e-5)) << "step " << i;
    }
}

TEST(ShellWorld, RayTestsFindTheTriangle) {
    BulletScene scene;
    auto& sheet = scene.shells->add(squareSheet(2, 4), trampolineCloth());
    pinBorder(sheet);
    scene.step(1e-4);
    struct Callback : btCollisionWorld::ClosestRayResultCallback {
        using ClosestRayResultCallback::ClosestRayResultCallback;
        int triangle = -1;
        btScalar addSingleResult(btCollisionWorld::LocalRayResult& result, bool world) override {
            if (result.m_localShapeInfo) triangle = result.m_localShapeInfo->m_triangleIndex;
            return ClosestRayResultCallback::addSingleResult(result, world);
        }
    } callback(btVector3(0.6f, 1, 0.7f), btVector3(0.6f, -1, 0.7f));
    scene.world.rayTest(callback.m_rayFromWorld, callback.m_rayToWorld, callback);
    ASSERT_TRUE(callback.hasHit());
    ASSERT_GE(callback.triangle, 0);
    const auto corners = sheet.triangles().col(callback.triangle);
    btVector3 lower = sheet.positions()[corners[0]], upper = lower;
    for (int a = 1; a < 3; ++a) {
        lower.setMin(sheet.positions()[corners[a]]);
        upper.setMax(sheet.positions()[corners[a]]);
    }
    EXPECT_LE(lower.x(), 0.6f);
    EXPECT_GE(upper.x(), 0.6f);
    EXPECT_LE(lower.z(), 0.7f);
    EXPECT_GE(upper.z(), 0.7f);
}

TEST(ShellWorld, DrawsEdgesPinsAndContacts) {
    struct Lines : btIDebugDraw {
        int lines = 0, mode = DBG_DrawWireframe;
        void drawLine(const btVector3&, const btVector3&, const btVector3&) override { ++lines; }
        void drawContactPoint(const btVector3&, const btVector3&, btScalar, int, const btVector3&) override {}
        void reportErrorWarning(const char*) override {}
        void draw3dText(const btVector3&, const char*) override {}
        void setDebugMode(int m) override { mode = m; }
        int getDebugMode() const override { return mode; }
    } drawer;
    BulletScene scene;
    scene.addBody(std::make_unique<btStaticPlaneShape>(btVector3(0, 1, 0), btScalar(0)), 0, btVector3(0, 0, 0));
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.step(1.0 / 60);
    scene.shells->debugDraw(&drawer);
    const int edges = static_cast<int>(sheet.shell().mesh().edges().size());
    ASSERT_GT(sheet.contacts().size(), 0u);
    EXPECT_EQ(drawer.lines, edges + static_cast<int>(sheet.contacts().size()));
    sheet.pin(0);
    const int before = drawer.lines;
    scene.shells->debugDraw(&drawer);
    EXPECT_GT(drawer.lines - before, before);  // and a small sphere
    scene.world.setDebugDrawer(&drawer);
    scene.world.debugDrawWorld();  // Bullet's own drawing reaches the shell too
    scene.shells->debugDraw(nullptr);
}

TEST(ShellWorld, ZeroStepIsNoStep) {
    BulletScene scene;
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.shells->updateAction(&scene.world, 0);
    scene.shells->updateAction(&scene.world, -1);
    EXPECT_EQ(sheet.positions()[3].y(), 0);
}

/// Three sheets, each an island of its own and a newcomer in the first step, with an iteration where they want more.
TEST(ShellWorld, AStepCountsOnceHoweverManyShellsFailInIt) {
    BulletScene scene;
    for (int k = 0; k < 3; ++k) {
        TriangleMesh mesh = squareSheet(1, 10);
        mesh.positions.row(0).array() += 5.0 * k;
        auto& sheet = scene.shells->add(mesh, trampolineCloth(), {.maxIterations = 1});
        sheet.pin(0);
        sheet.pin(10);
    }
    int unconverged = 0;
    for (int i = 0; i < 30; ++i) {
        scene.step(1.0 / 60);
        unconverged += scene.shells->lastStep().converged ? 0 : 1;
        ASSERT_EQ(scene.shells->lastStep().unconvergedSteps, unconverged) << "step " << i;
    }
    EXPECT_GT(unconverged, 0);
}

/// What is solved again in the first step touches once.
TEST(ShellWorld, ContactsOfAReportAreThoseOfTheShells) {
    BulletScene scene;
    scene.addFloor();
    TriangleMesh mesh = squareSheet(1, 4);
    mesh.positions.row(1).array() += 1e-4;
    auto& sheet = scene.shells->add(mesh, trampolineCloth());
    for (int i = 0; i < 5; ++i) {
        scene.step(1.0 / 60);
        EXPECT_EQ(scene.shells->lastStep().contacts, int(sheet.contacts().size())) << "step " << i;
    }
    EXPECT_FALSE(sheet.contacts().empty());
}

TEST(ShellWorld, WarnsOnceOfAShapeItCannotTouch) {
    BulletScene scene;
    // Neither convex nor a list of triangles.
    struct Blob final : btCollisionShape {
        Blob() { m_shapeType = HFFLUID_SHAPE_PROXYTYPE; }
        void getAabb(const btTransform& t, btVector3& lower, btVector3& upper) const override {
            lower = t.getOrigin() - btVector3(5, 5, 5);
            upper = t.getOrigin() + btVector3(5, 5, 5);
        }
        void setLocalScaling(const btVector3&) override {}
        const btVector3& getLocalScaling() const override { return m_scaling; }
        void calculateLocalInertia(btScalar, btVector3& inertia) const override { inertia.setZero(); }
        const char* getName() const override { return "Blob"; }
        void setMargin(btScalar) override {}
        btScalar getMargin() const override { return 0; }
        btVector3 m_scaling{1, 1, 1};
    };
    scene.addBody(std::make_unique<Blob>(), 0, btVector3(0, 0, 0));
    scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.run(0.6, 1.0 / 60);
    const auto warnings = scene.shells->takeWarnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings[0].find("not supported yet"), std::string::npos) << warnings[0];
    EXPECT_TRUE(scene.shells->takeWarnings().empty());
}

/// By who moves them.
TEST(Obstacles, AreToldApart) {
    struct Object : btCollisionObject {
        Object(int type, int flags) {
            m_internalType = type;
            setCollisionFlags(flags);
        }
    };
    constexpr int kPlain = btCollisionObject::CO_COLLISION_OBJECT, kBody = btCollisionObject::CO_RIGID_BODY,
                  kGhost = btCollisionObject::CO_GHOST_OBJECT, kSoft = btCollisionObject::CO_SOFT_BODY,
                  kLink = btCollisionObject::CO_FEATHERSTONE_LINK;
    constexpr int kStatic = btCollisionObject::CF_STATIC_OBJECT, kKinematic = btCollisionObject::CF_KINEMATIC_OBJECT,
                  kCharacter = btCollisionObject::CF_CHARACTER_OBJECT;
    const struct {
        int type, flags;
        bool mayBePushed, standsStill, isLed;
    } kinds[] = {{kBody, 0, true, false, false},
                 {kLink, 0, true, false, false},
                 {kBody, kStatic, false, true, false},
                 {kPlain, kStatic, false, true, false},
                 {kBody, kStatic | kKinematic, false, false, true},
                 {kBody, kKinematic, false, false, true},
                 {kPlain, 0, false, false, true},
                 {kGhost, kCharacter, false, false, true},
                 {kGhost, kStatic, false, false, true},
                 {kSoft, 0, false, false, false}};
    for (const auto& kind : kinds) {
        const Object object(kind.type, kind.flags);
        EXPECT_EQ(mayBePushed(object), kind.mayBePushed) << kind.type << ", " << kind.flags;
        EXPECT_EQ(standsStill(object), kind.standsStill) << kind.type << ", " << kind.flags;
        EXPECT_EQ(isLed(object), kind.isLed) << kind.type << ", " << kind.flags;
    }
}

}  // namespace
}  // namespace jacket::bullet::testing
