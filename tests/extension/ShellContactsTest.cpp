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

}  // namespace
}  // namespace jacket::bullet::testing
