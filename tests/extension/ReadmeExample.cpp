// The example of README.md, word for word (tests/boundaries.cmake compares them).
#include <btBulletDynamicsCommon.h>
#include <jacket/bullet/ShellWorld.h>

#include <cstdio>

int main() {
    btDefaultCollisionConfiguration configuration;  // a Bullet world as ever
    btCollisionDispatcher dispatcher(&configuration);
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btSphereShape sphere(0.25);
    btRigidBody ball(2.0, nullptr, &sphere, btVector3(0.05, 0.05, 0.05));
    ball.translate(btVector3(0.0, 1.0, 0.0));
    btDiscreteDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
    world.setGravity(btVector3(0.0, -9.81, 0.0));
    world.addRigidBody(&ball);

    jacket::bullet::ShellWorld shells(world);  // what Jacket adds to it
    const auto grid = jacket::makeGrid({.size = {2.0, 2.0}, .cells = {20, 20}});
    auto& sheet = shells.add(grid, jacket::materials::cotton());
    for (const int corner : {0, 20, 420, 440}) sheet.pin(corner);

    for (int frame = 0; frame < 180; ++frame) world.stepSimulation(1.0 / 60.0, 4, 1.0 / 240.0);
    const btScalar middle = sheet.positions()[220].y(), height = ball.getWorldTransform().getOrigin().y();
    std::printf("after 3 s the middle of the sheet is at %.3f m, the ball at %.3f m\n", middle, height);
    return height > middle ? 0 : 1;  // the sheet has caught it
}
