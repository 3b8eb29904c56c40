// Other actions of a world, as the springs of a vehicle.
#include <btBulletDynamicsCommon.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "support/HardScenes.h"

namespace jacket::bullet::testing {
namespace {

/// Under a box, as a vehicle's.
struct Springs : btActionInterface {
    btRigidBody& body;
    explicit Springs(btRigidBody& on) : body(on) {}
    void updateAction(btCollisionWorld*, btScalar h) override {
        const btScalar off = btScalar(0.5) - body.getWorldTransform().getOrigin().y();
        const btScalar push = btScalar(9.81) + btScalar(60) * off - btScalar(8) * body.getLinearVelocity().y();
        body.applyCentralImpulse(btVector3(0, push * h / body.getInvMass(), 0));
        body.applyTorqueImpulse(-body.getAngularVelocity() * h);
    }
    void debugDraw(btIDebugDraw*) override {}
};

TEST(Springs, HoldUpABoxUnderACloth) {
    BulletScene scene;
    auto& box =
        scene.addBox(btVector3(btScalar(0.2), btScalar(0.1), btScalar(0.2)), 10.0, btVector3(0, btScalar(0.5), 0));
    box.setActivationState(DISABLE_DEACTIVATION);
    Springs springs(box);
    scene.world.addAction(&springs);
    auto& cloth = scene.shells->add(squareSheet(1.2, 16), materials::cotton(), {.friction = 0.5});
    place(cloth, {0.01, 0.605, 0.02});
    for (int i = 0; i < 120; ++i) {
        scene.step(kStep);
        EXPECT_LT(penetration(cloth, box), 5e-4) << "step " << i;
    }
    EXPECT_NEAR(double(box.getWorldTransform().getOrigin().y()), 0.5, 0.01);
    EXPECT_EQ(scene.shells->lastStep().unsettledSteps, 0);
    scene.world.removeAction(&springs);
}

/// Counts its calls, and looks where the shells are.
struct Witness : btActionInterface {
    const ShellWorld& shells;
    int calls = 0;
    double seen = -1.0;  ///< height of a sheet [m]
    explicit Witness(const ShellWorld& of) : shells(of) {}
    void updateAction(btCollisionWorld*, btScalar) override {
        ++calls;
        seen = double(shells[0].positions()[0].y());
    }
    void debugDraw(btIDebugDraw*) override {}
};

/// Whether other actions come before or after it, or in between steps; each is called once a step, in its order.
TEST(ShellsAct, AfterAllOtherActions) {
    BulletScene scene;
    ShellWorld others(scene.world);
    auto& sheet = scene.shells->add(squareSheet(0.2, 2), materials::cotton());
    others.add(squareSheet(0.2, 2), materials::cotton());
    Witness first(*scene.shells), second(others), third(*scene.shells);
    scene.world.addAction(&first);
    scene.world.addAction(&second);
    for (int i = 0; i < 10; ++i) {
        const double before = double(sheet.positions()[0].y());
        if (i == 5) scene.world.addAction(&third);
        scene.step(kStep);
        EXPECT_EQ(first.seen, before) << i;
        EXPECT_EQ(second.seen, before) << i;  // the other sheet falls as fast
        EXPECT_EQ(first.calls, i + 1);
        EXPECT_EQ(second.calls, i + 1);
        EXPECT_EQ(third.calls, std::max(i - 4, 0));
        const double fallen = 0.5 * 9.81 * kStep * kStep * (i + 1) * (i + 2);
        EXPECT_NEAR(double(sheet.positions()[0].y()), -fallen, 1e-3 * fallen) << i;
        EXPECT_EQ(sheet.positions()[0].y(), others[0].positions()[0].y()) << i;
    }
    for (Witness* witness : {&first, &second, &third}) scene.world.removeAction(witness);
}

}  // namespace
}  // namespace jacket::bullet::testing
