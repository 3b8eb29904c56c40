// A user who builds without RTTI: no action of theirs may be asked for its type.
#include <btBulletDynamicsCommon.h>
#include <jacket/bullet/ShellWorld.h>

#include <cstdio>

namespace {

struct Counter : btActionInterface {
    int calls = 0;
    void updateAction(btCollisionWorld*, btScalar) override { ++calls; }
    void debugDraw(btIDebugDraw*) override {}
};

}  // namespace

int main() {
    constexpr int kSteps = 5;
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    jacket::bullet::ShellWorld shells(world);
    const auto& sheet = shells.add(jacket::makeGrid({.size = {1, 1}, .cells = {4, 4}}), jacket::materials::cotton());
    Counter counter;
    world.addAction(&counter);
    for (int i = 0; i < kSteps; ++i) world.stepSimulation(btScalar(1) / 60, 0, btScalar(1) / 60);
    world.removeAction(&counter);
    const bool hasFallen = sheet.positions()[0].y() < btScalar(0);
    if (counter.calls == kSteps && hasFallen) return 0;
    std::printf("called %d times in %d steps, the sheet has %sfallen\n", counter.calls, kSteps,
                hasFallen ? "" : "not ");
    return 1;
}
