// What shells and bodies that are near each other have in common. Figures to compare with follow from the geometry.
#include "ShellContacts.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

/// A sheet of 1 m in the plane y = 0 and one body near it.
struct Pair {
    BulletScene scene{0.0};
    ShellBody& sheet;
    Obstacles obstacles;
    std::vector<Obstacle> obstacle;
    const ShellBody* const shells[1];
    const std::pair<int, int> pairs[1]{{0, 0}};
    ShellContacts::Memory memory;
    ShellContacts contacts;

    Pair(int cells, std::unique_ptr<btCollisionShape> shape, const Vec3& at)
        : sheet(scene.shells->add(squareSheet(1.0, cells), trampolineCloth())),
          obstacle(made(
              scene.addBody(std::move(shape), 1.0, btVector3(btScalar(at.x()), btScalar(at.y()), btScalar(at.z()))))),
          shells{&sheet},
          contacts(shells, obstacle, pairs, memory) {}
    std::vector<Obstacle> made(btRigidBody& body) {
        std::vector<Obstacle> list;
        list.push_back(obstacles.make(body, kStep, nullptr, false));
        return list;
    }
    /// Whether the body crosses the sheet on its way by `move` while the sheet stands, or goes along.
    bool crosses(const Vec3& move, const Vec3& moveOfSheet = Vec3::Zero()) {
        const Points start = sheet.shell().positions(), end = start.colwise() + moveOfSheet;
        const Points *starts[] = {&start}, *ends[] = {&end};
        Vec6 twist = Vec6::Zero();
        twist.head<3>() = move / kStep;
        const char all[] = {1};
        return contacts.crosses({starts, ends, {&twist, 1}, all, kStep});
    }
};

TEST(ShellContacts, FindEachVertexAsFarAsItMayCome) {
    constexpr double kAbove = 0.1, kRadius = 0.3;
    Pair pair(20, std::make_unique<btSphereShape>(btScalar(kRadius)), {0, kRadius + kAbove, 0});
    const Points& x = pair.sheet.shell().positions();
    const Points* const positions[] = {&x};
    const Vec6 still = Vec6::Zero();
    std::vector<double> reach(x.cols());
    std::size_t expected = 0;
    for (int i = 0; i < x.cols(); ++i) {
        reach[i] = x(0, i) < 0.0 ? 0.15 : 0.11;
        const double gap = (x.col(i) - Vec3(0, kRadius + kAbove, 0)).norm() - kRadius - pair.sheet.contactThickness();
        expected += gap < reach[i] ? 1 : 0;
    }
    const double* const reaches[] = {reach.data()};
    std::vector<Contact> all, own;
    pair.contacts.find({positions, {&still, 1}, 0.0}, 0.15, -1e300, all);
    pair.contacts.find({positions, {&still, 1}, 0.0, reaches}, 0.15, -1e300, own);
    EXPECT_EQ(own.size(), expected);
    EXPECT_LT(own.size(), all.size());
    for (const Contact& contact : own) EXPECT_LE(contact.gap, reach[contact.vertices[0]]);
}

/// Wherever the way leads, in triangles and where they meet, and as well when it is the sheet that moves.
TEST(ShellContacts, SeeABodyThatGoesThrough) {
    for (const auto& [x, z] :
         {std::pair{0.11, 0.07}, {0.125, 0.125}, {0.0, 0.1}, {0.25, 0.25}, {-0.31, 0.2}, {0.07, 0.0}})
        for (const Vec3& aside : {Vec3(0, 0, 0), Vec3(0.3, 0, -0.2)}) {
            Pair pair(4, std::make_unique<btSphereShape>(btScalar(0.005)), {x, 0.01, z});
            EXPECT_TRUE(pair.crosses(Vec3(0, -0.02, 0), aside)) << x << " " << z;
            EXPECT_TRUE(pair.crosses(aside, Vec3(0, 0.02, 0))) << x << " " << z;
            EXPECT_FALSE(pair.crosses(Vec3(0, -0.009, 0), aside)) << x << " " << z;
            EXPECT_FALSE(pair.crosses(Vec3(0, -0.02, 0), Vec3(0, -0.015, 0))) << x << " " << z;
        }
    Pair beside(4, std::make_unique<btSphereShape>(btScalar(0.005)), {0.503, 0.01, 0.1});
    EXPECT_FALSE(beside.crosses(Vec3(0, -0.02, 0)));
}

/// Two balls with their common centre of mass between them: there a sheet may pass.
TEST(ShellContacts, LetASheetPassBetweenThePartsOfABody) {
    static btSphereShape ball(btScalar(0.005));
    for (const bool isMassive : {false, true}) {
        auto shape = std::make_unique<btCompoundShape>();
        for (const double side : {-0.05, 0.0, 0.05}) {
            if (side == 0.0 && !isMassive) continue;
            shape->addChildShape(btTransform(btQuaternion::getIdentity(), btVector3(btScalar(side), 0, 0)), &ball);
        }
        Pair pair(4, std::move(shape), {0.11, 0.01, 0.07});
        EXPECT_EQ(pair.crosses(Vec3(0, -0.02, 0)), isMassive);
    }
}

}  // namespace
}  // namespace jacket::bullet::testing
