// Bullet's own questions to a world, and its filters, know shells.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using jacket::testing::Scene;

/// A sheet of 2 m at height 0, held, and up to date in the broadphase.
struct FlatSheet : Scene<> {
    ShellBody& sheet = shells->add(squareSheet(2, 8), trampolineCloth());
    FlatSheet() : Scene(0.0) { step(1.0 / 60); }
};

btTransform at(double x, double y, double z) {
    return btTransform(btQuaternion::getIdentity(), btVector3(btScalar(x), btScalar(y), btScalar(z)));
}

/// Whether a triangle of the sheet spans the point, seen from above.
bool spans(const ShellBody& sheet, int triangle, const btVector3& p) {
    if (triangle < 0 || triangle >= sheet.triangles().cols()) return false;
    const auto corners = sheet.triangles().col(triangle);
    for (int a = 0; a < 3; ++a) {
        const btVector3 from = sheet.positions()[corners[a]], to = sheet.positions()[corners[(a + 1) % 3]];
        if ((to - from).cross(p - from).y() < btScalar(-1e-6)) return false;  // counter-clockwise from above
    }
    return true;
}

TEST(Queries, ARayHitsWhereTheSheetIs) {
    FlatSheet scene;
    btCollisionWorld::ClosestRayResultCallback hit(btVector3(btScalar(0.3), 1, btScalar(0.45)),
                                                   btVector3(btScalar(0.3), -3, btScalar(0.45)));
    scene.world.rayTest(hit.m_rayFromWorld, hit.m_rayToWorld, hit);
    ASSERT_TRUE(hit.hasHit());
    EXPECT_NEAR(hit.m_closestHitFraction, 0.25, bulletTolerance(1e-9, 1e-6));
    EXPECT_NEAR(std::abs(hit.m_hitNormalWorld.y()), 1.0, 1e-6);
    EXPECT_EQ(scene.shells->find(*hit.m_collisionObject), &scene.sheet);
    auto& ball = scene.addSphere(0.1, 0, btVector3(5, 0, 0));
    EXPECT_EQ(scene.shells->find(ball), nullptr);
}

/// Which triangle that is, as for Bullet's own meshes.
TEST(Queries, ARayTellsTheTriangle) {
    struct Hit : btCollisionWorld::ClosestRayResultCallback {
        using ClosestRayResultCallback::ClosestRayResultCallback;
        btScalar addSingleResult(btCollisionWorld::LocalRayResult& result, bool isInWorld) override {
            if (result.m_localShapeInfo) triangle = result.m_localShapeInfo->m_triangleIndex;
            return ClosestRayResultCallback::addSingleResult(result, isInWorld);
        }
        int triangle = -1;
    };
    FlatSheet scene;
    const auto& triangles = scene.sheet.triangles();
    for (int t = 0; t < triangles.cols(); ++t) {
        Vec3 middle = Vec3::Zero();
        for (const int corner : triangles.col(t)) middle += scene.sheet.shell().positions().col(corner) / 3.0;
        const btVector3 at(btScalar(middle.x()), btScalar(middle.y()), btScalar(middle.z()));
        Hit hit(at + btVector3(0, 1, 0), at - btVector3(0, 1, 0));
        scene.world.rayTest(hit.m_rayFromWorld, hit.m_rayToWorld, hit);
        EXPECT_EQ(hit.triangle, t);
    }
}

/// Bullet sees the shell where setPositions put it, as it does bodies: after the bounds are updated.
TEST(Queries, SeeAMovedShell) {
    FlatSheet scene;
    std::vector<btVector3> x(scene.sheet.positions().begin(), scene.sheet.positions().end());
    for (btVector3& p : x) p += btVector3(10, 2, 0);
    scene.sheet.setPositions(x);
    scene.world.updateAabbs();
    btCollisionWorld::ClosestRayResultCallback hit(btVector3(btScalar(10.3), 3, btScalar(0.4)),
                                                   btVector3(btScalar(10.3), 1, btScalar(0.4)));
    scene.world.rayTest(hit.m_rayFromWorld, hit.m_rayToWorld, hit);
    EXPECT_NEAR(hit.m_closestHitFraction, 0.5, bulletTolerance(1e-9, 1e-5));
}

/// A shell put onto a body touches it in the very next step.
TEST(Queries, AMovedShellTouchesAtOnce) {
    Scene scene;
    auto& sheet = scene.shells->add(squareSheet(1, 4), trampolineCloth());
    scene.addBox(btVector3(1, 1, 1), 0, btVector3(10, 0, 0));
    scene.step(1.0 / 60);
    std::vector<btVector3> x(sheet.positions().begin(), sheet.positions().end());
    for (btVector3& p : x) p += btVector3(10, btScalar(1.001), 0);
    sheet.setPositions(x);
    scene.step(1.0 / 60);
    EXPECT_FALSE(sheet.contacts().empty());
}

TEST(Queries, ASweptSphereStopsAtTheSheet) {
    FlatSheet scene;
    const btSphereShape sphere(btScalar(0.2));
    struct Hit : btCollisionWorld::ClosestConvexResultCallback {
        using ClosestConvexResultCallback::ClosestConvexResultCallback;
        int triangle = -1;
        btScalar addSingleResult(btCollisionWorld::LocalConvexResult& result, bool world) override {
            if (result.m_localShapeInfo) triangle = result.m_localShapeInfo->m_triangleIndex;
            return ClosestConvexResultCallback::addSingleResult(result, world);
        }
    } hit(btVector3(0, 0, 0), btVector3(0, 0, 0));
    scene.world.convexSweepTest(&sphere, at(0.3, 1, 0.45), at(0.3, -1, 0.45), hit);
    ASSERT_TRUE(hit.hasHit());
    EXPECT_NEAR(hit.m_closestHitFraction, 0.4, 1e-3);  // its centre at 0.2 m, to Bullet's accuracy
    EXPECT_NEAR(hit.m_hitPointWorld.y(), 0.0, 2e-3);
    EXPECT_NEAR(std::abs(hit.m_hitNormalWorld.y()), 1.0, 1e-3);
    EXPECT_TRUE(spans(scene.sheet, hit.triangle, btVector3(btScalar(0.3), 0, btScalar(0.45)))) << hit.triangle;
    EXPECT_EQ(scene.shells->find(*hit.m_hitCollisionObject), &scene.sheet);
}

/// Deepest contact that is reported, and between whom.
struct Deepest : btCollisionWorld::ContactResultCallback {
    btScalar distance = 1;
    const btCollisionObject *first = nullptr, *second = nullptr;
    int triangle = -1;
    btScalar addSingleResult(btManifoldPoint& point, const btCollisionObjectWrapper* a, int, int indexOfA,
                             const btCollisionObjectWrapper* b, int, int indexOfB) override {
        if (point.getDistance() < distance) {
            distance = point.getDistance();
            first = a->getCollisionObject(), second = b->getCollisionObject();
            triangle = std::max(indexOfA, indexOfB);
        }
        return 0;
    }
};

TEST(Queries, ContactTestsFindTheOverlapFromBothSides) {
    FlatSheet scene;
    auto& ball = scene.addSphere(0.2, 0, btVector3(btScalar(0.3), btScalar(0.15), btScalar(0.45)));
    btCollisionObject& shell = scene.sheet.collisionObject();
    const std::function<void(Deepest&)> ways[] = {
        [&](Deepest& d) { scene.world.contactTest(&ball, d); },
        [&](Deepest& d) { scene.world.contactTest(&shell, d); },
        [&](Deepest& d) { scene.world.contactPairTest(&ball, &shell, d); },
        [&](Deepest& d) { scene.world.contactPairTest(&shell, &ball, d); },
    };
    for (const auto& ask : ways) {
        Deepest deepest;
        ask(deepest);
        EXPECT_NEAR(deepest.distance, -0.05, 1e-4);
        EXPECT_TRUE((deepest.first == &ball && deepest.second == &shell) ||
                    (deepest.first == &shell && deepest.second == &ball));
        EXPECT_TRUE(spans(scene.sheet, deepest.triangle, ball.getWorldTransform().getOrigin())) << deepest.triangle;
    }
    ball.setWorldTransform(at(0.3, 0.25, 0.45));
    Deepest none;
    scene.world.contactPairTest(&ball, &shell, none);
    EXPECT_EQ(none.first, nullptr);
    none.m_closestDistanceThreshold = btScalar(0.1);  // nearer than that counts
    scene.world.contactPairTest(&ball, &shell, none);
    EXPECT_NEAR(none.distance, 0.05, 1e-4);
}

TEST(Queries, AnswerByTheirOwnFilter) {
    FlatSheet scene;
    btCollisionWorld::ClosestRayResultCallback hit(btVector3(0, 1, 0), btVector3(0, -1, 0));
    hit.m_collisionFilterMask = btBroadphaseProxy::StaticFilter;
    scene.world.rayTest(hit.m_rayFromWorld, hit.m_rayToWorld, hit);
    EXPECT_FALSE(hit.hasHit());
}

/// A body that decides for itself.
struct Picky : btRigidBody {
    using btRigidBody::btRigidBody;
    const btCollisionObject* refused = nullptr;
    bool checkCollideWithOverride(const btCollisionObject* other) const override {
        return btRigidBody::checkCollideWithOverride(other) && other != refused;
    }
    void refuse(const btCollisionObject& other) {
        refused = &other;
        m_checkCollideWith = 1;
    }
};

/// Who is not to touch whom; every ball starts in the same place, and falls through or not.
struct Filter {
    const char* name;
    bool touches;
    int shellGroup, shellMask, ballGroup, ballMask;
    std::function<void(ShellBody&, Picky&)> apply;
};

class Filters : public ::testing::TestWithParam<Filter> {};

TEST_P(Filters, Decide) {
    const Filter& filter = GetParam();
    btSphereShape sphere(btScalar(0.2));
    Picky ball(btScalar(0.5), nullptr, &sphere, btVector3(btScalar(0.01), btScalar(0.01), btScalar(0.01)));
    ball.translate(btVector3(0, btScalar(0.3), 0));
    Scene scene;
    auto& sheet = scene.shells->add(squareSheet(2, 10), trampolineCloth(),
                                    {.collisionGroup = filter.shellGroup, .collisionMask = filter.shellMask});
    pinBorder(sheet);
    scene.world.addRigidBody(&ball, filter.ballGroup, filter.ballMask);
    filter.apply(sheet, ball);
    scene.run(0.7, 1.0 / 60);
    if (filter.touches) {
        EXPECT_GT(ball.getWorldTransform().getOrigin().y(), -0.2);
    } else {
        const double fall = 0.5 * 9.81 * 0.7 * 0.7;
        EXPECT_LT(ball.getWorldTransform().getOrigin().y(), 0.3 - fall);
        EXPECT_TRUE(sheet.contacts().empty());
    }
    EXPECT_LE(scene.dispatcher.getNumManifolds(), filter.touches ? 1 : 0);  // Bullet itself builds none
    scene.world.removeRigidBody(&ball);
}

const auto kNothing = [](ShellBody&, Picky&) {};
INSTANTIATE_TEST_SUITE_P(
    Cases, Filters,
    ::testing::Values(
        Filter{"Default", true, 1, -1, 1, -1, kNothing}, Filter{"MaskOfShell", false, 1, 2, 1, -1, kNothing},
        Filter{"MaskOfBall", false, 1, -1, 1, 2, kNothing}, Filter{"MatchingGroups", true, 4, 8, 8, 4, kNothing},
        Filter{"IgnoredByBall", false, 1, -1, 1, -1,
               [](ShellBody& s, Picky& b) { b.setIgnoreCollisionCheck(&s.collisionObject(), true); }},
        Filter{"IgnoredByShell", false, 1, -1, 1, -1,
               [](ShellBody& s, Picky& b) { s.collisionObject().setIgnoreCollisionCheck(&b, true); }},
        Filter{"IgnoredNoMore", true, 1, -1, 1, -1,
               [](ShellBody& s, Picky& b) {
                   for (const bool ignore : {true, false}) s.collisionObject().setIgnoreCollisionCheck(&b, ignore);
               }},
        Filter{"RefusedByOverride", false, 1, -1, 1, -1, [](ShellBody& s, Picky& b) { b.refuse(s.collisionObject()); }},
        Filter{"OverrideOfAnother", true, 1, -1, 1, -1, [](ShellBody&, Picky& b) { b.refuse(b); }}),
    [](const auto& testCase) { return testCase.param.name; });

}  // namespace
}  // namespace jacket::bullet::testing
