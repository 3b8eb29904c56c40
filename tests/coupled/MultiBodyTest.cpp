// What shells and links of multibodies do to each other. Figures to compare with follow from momentum, weight, energy
// and from rigid bodies, or are what Bullet computes itself.
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyJointMotor.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <set>
#include <tuple>

#include "ArticulatedBody.h"
#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

btVector3 vector(double x, double y, double z) {
    return {btScalar(x), btScalar(y), btScalar(z)};
}

/// A Bullet world with multibodies and shells, torn down in order.
struct MultiBodyScene {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btMultiBodyConstraintSolver solver;
    btMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
    std::vector<std::unique_ptr<btCollisionShape>> shapes;
    std::vector<std::unique_ptr<btCollisionObject>> objects;
    std::vector<std::unique_ptr<btMultiBody>> multiBodies;
    std::vector<std::unique_ptr<btMultiBodyJointMotor>> motors;
    std::unique_ptr<ShellWorld> shells = std::make_unique<ShellWorld>(world);

    explicit MultiBodyScene(double gravity = -9.81) { world.setGravity(vector(0, gravity, 0)); }
    ~MultiBodyScene() {
        shells.reset();
        for (const auto& motor : motors) world.removeMultiBodyConstraint(motor.get());
        while (!multiBodies.empty()) remove(*multiBodies.back());
        for (const auto& object : objects) world.removeCollisionObject(object.get());
    }

    btCollisionShape& addShape(std::unique_ptr<btCollisionShape> shape) {
        shapes.push_back(std::move(shape));
        return *shapes.back();
    }
    btCollisionShape& sphere(double radius) { return addShape(std::make_unique<btSphereShape>(btScalar(radius))); }

    /// Without damping and at the origin; joints are set up before the colliders are added.
    btMultiBody& addMultiBody(int links, double mass, const btVector3& inertia, bool fixedBase) {
        multiBodies.push_back(std::make_unique<btMultiBody>(links, btScalar(mass), inertia, fixedBase, true));
        btMultiBody& body = *multiBodies.back();
        body.setLinearDamping(0);
        body.setAngularDamping(0);
        return body;
    }
    /// The multibody's place in the world, once its joints are set up.
    void finish(btMultiBody& body, const btVector3& position = btVector3(0, 0, 0)) {
        body.setBasePos(position);
        body.finalizeMultiDof();
        world.addMultiBody(&body);
        updatePoses(body);
    }
    void updatePoses(btMultiBody& body) {
        btAlignedObjectArray<btQuaternion> rotations;
        btAlignedObjectArray<btVector3> origins;
        body.forwardKinematics(rotations, origins);
        body.updateCollisionObjectWorldTransforms(rotations, origins);
    }
    btMultiBodyLinkCollider& addCollider(btMultiBody& body, int link, btCollisionShape& shape) {
        auto collider = std::make_unique<btMultiBodyLinkCollider>(&body, link);
        btMultiBodyLinkCollider& added = *collider;
        added.setCollisionShape(&shape);
        (link < 0 ? body.setBaseCollider(&added) : void(body.getLink(link).m_collider = &added));
        updatePoses(body);
        world.addCollisionObject(&added, 1, -1);
        objects.push_back(std::move(collider));
        return added;
    }
    void addMotor(btMultiBody& body, int link, double velocity, double impulse) {
        motors.push_back(
            std::make_unique<btMultiBodyJointMotor>(&body, link, 0, btScalar(velocity), btScalar(impulse)));
        world.addMultiBodyConstraint(motors.back().get());
    }
    /// A free ball of one link.
    btMultiBody& addBall(double radius, double mass, const btVector3& position) {
        btCollisionShape& shape = sphere(radius);
        btVector3 inertia;
        shape.calculateLocalInertia(btScalar(mass), inertia);
        btMultiBody& ball = addMultiBody(0, mass, inertia, false);
        finish(ball, position);
        addCollider(ball, -1, shape);
        return ball;
    }
    /// A ball on a massless rod along x, hinged about z at a fixed point.
    btMultiBody& addPendulum(double radius, double mass, const btVector3& pivot, double length) {
        btCollisionShape& shape = sphere(radius);
        btVector3 inertia;
        shape.calculateLocalInertia(btScalar(mass), inertia);
        btMultiBody& pendulum = addMultiBody(1, 0, btVector3(0, 0, 0), true);
        pendulum.setupRevolute(0, btScalar(mass), inertia, -1, btQuaternion::getIdentity(), btVector3(0, 0, 1),
                               btVector3(0, 0, 0), vector(length, 0, 0));
        finish(pendulum, pivot);
        addCollider(pendulum, 0, shape);
        return pendulum;
    }
    void remove(btMultiBody& body) {
        const auto belongs = [&](const auto& object) {
            const auto* collider = btMultiBodyLinkCollider::upcast(object.get());
            return collider && collider->m_multiBody == &body;
        };
        for (const auto& object : objects)
            if (belongs(object)) world.removeCollisionObject(object.get());
        std::erase_if(objects, belongs);
        world.removeMultiBody(&body);
        std::erase_if(multiBodies, [&](const auto& b) { return b.get() == &body; });
    }
    void step(double h) { world.stepSimulation(btScalar(h), 0); }
    void run(double seconds, double h) {
        for (int i = 0; i < int(seconds / h + 0.5); ++i) step(h);
    }
};

/// Linear momentum of the base and all links [N s].
Vec3 momentumOf(btMultiBody& body) {
    const ArticulatedBody articulated(body);
    Vec3 sum = Vec3::Zero();
    for (int link = -1; link < body.getNumLinks(); ++link)
        sum += double(link < 0 ? body.getBaseMass() : body.getLinkMass(link)) * articulated.twist(link).head<3>();
    return sum;
}

/// What all its contacts gave a shell in the last step [N s].
Vec3 impulseOf(const ShellBody& sheet) {
    Vec3 sum = Vec3::Zero();
    for (const auto& contact : sheet.contacts()) sum += contact.impulse;
    return sum;
}

/// A free or fixed base with a revolute, a prismatic, a spherical and a fixed joint, one after another and branching,
/// in some pose and motion.
btMultiBody& addTree(MultiBodyScene& scene, bool fixedBase) {
    btMultiBody& tree = scene.addMultiBody(5, 2.0, vector(0.1, 0.2, 0.15), fixedBase);
    const btQuaternion turn(vector(1, 2, 3).normalized(), btScalar(0.7));
    tree.setupRevolute(0, btScalar(0.7), vector(0.02, 0.03, 0.01), -1, turn, vector(0, 1, 2).normalized(),
                       vector(0.3, 0, 0.1), vector(0, -0.2, 0.1));
    tree.setupPrismatic(1, btScalar(0.4), vector(0.01, 0.02, 0.01), 0, turn, vector(2, 1, 0).normalized(),
                        vector(0.1, 0.2, 0), vector(0.1, 0, 0.2), true);
    tree.setupSpherical(2, btScalar(0.5), vector(0.02, 0.01, 0.03), 0, turn.inverse(), vector(-0.2, 0, 0.1),
                        vector(0, 0.3, 0));
    tree.setupFixed(3, btScalar(0.3), vector(0.01, 0.01, 0.02), 2, turn, vector(0, 0.1, 0), vector(0.1, 0.1, 0));
    tree.setupRevolute(4, btScalar(0.2), vector(0.01, 0.01, 0.01), 3, turn, btVector3(1, 0, 0), vector(0, 0, 0.2),
                       vector(0, 0.1, 0));
    scene.finish(tree, vector(0.2, 0.5, -0.1));
    tree.setWorldToBaseRot(turn);
    if (!fixedBase) {
        tree.setBaseVel(vector(0.3, -0.5, 0.7));
        tree.setBaseOmega(vector(1.0, 0.4, -0.6));
    }
    tree.setJointPos(0, btScalar(0.4));
    tree.setJointPos(1, btScalar(-0.1));
    tree.setJointPos(4, btScalar(0.8));
    const btScalar spin[] = {btScalar(0.5), btScalar(-0.3), btScalar(0.9)};
    tree.setJointVelMultiDof(2, spin);
    for (const int link : {0, 1, 4}) tree.setJointVel(link, btScalar(0.3 * link - 0.5));
    scene.updatePoses(tree);
    return tree;
}

/// Of every link, against the rows that Bullet's own contacts and joints use.
TEST(ArticulatedBody, JacobianAndInertiaAreBullets) {
    for (const bool fixedBase : {false, true}) {
        MultiBodyScene scene;
        btMultiBody& tree = addTree(scene, fixedBase);
        const ArticulatedBody body(tree);
        btAlignedObjectArray<btScalar> scalars;
        btAlignedObjectArray<btVector3> vectors;
        btAlignedObjectArray<btMatrix3x3> matrices;
        tree.computeAccelerationsArticulatedBodyAlgorithmMultiDof(0, scalars, vectors, matrices, false, false, false);
        const Eigen::MatrixXd inverse = body.inertia().inverse();
        for (int link = fixedBase ? 0 : -1; link < tree.getNumLinks(); ++link) {
            const Eigen::MatrixXd jacobian = body.freeColumns(body.jacobian(link));
            for (int k = 0; k < 6; ++k) {
                const Vec3 unit = Vec3::Unit(k % 3);
                const btVector3 none(0, 0, 0), axis = toBullet(unit);
                std::vector<btScalar> row(body.size()), response(body.size());
                tree.fillConstraintJacobianMultiDof(link, toBullet(body.centre(link)), k < 3 ? none : axis,
                                                    k < 3 ? axis : none, row.data(), scalars, vectors, matrices);
                tree.calcAccelerationDeltasMultiDof(row.data(), response.data(), scalars, vectors);
                const Eigen::VectorXd expected = inverse * jacobian.row(k).transpose();
                for (int i = 0; i < int(body.freeVelocities().size()); ++i) {
                    const int column = body.freeVelocities()[i];
                    EXPECT_NEAR(jacobian(k, i), double(row[column]), bulletTolerance(1e-12, 1e-5));
                    EXPECT_NEAR(expected[i], double(response[column]), bulletTolerance(1e-11, 1e-4) * expected.norm());
                }
            }
        }
    }
}

/// A physical pendulum: angular acceleration m g l cos(angle) / (I + m l^2) from the horizontal.
TEST(ArticulatedBody, APendulumFallsAsItMust) {
    MultiBodyScene scene;
    btMultiBody& pendulum = scene.addPendulum(0.1, 2.0, btVector3(0, 0, 0), 0.5);
    scene.world.applyGravity();
    const double inertia = 0.4 * 2.0 * 0.01 + 2.0 * 0.25;
    for (const double angle : {0.0, 0.6}) {
        pendulum.setJointPos(0, btScalar(angle));
        pendulum.setJointVel(0, btScalar(3.0));
        const ArticulatedBody body(pendulum);
        EXPECT_NEAR(body.inertia()(0, 0), inertia, bulletTolerance(1e-12, 1e-6));
        EXPECT_NEAR(body.acceleration()[0], -2.0 * 9.81 * 0.5 * std::cos(angle) / inertia,
                    bulletTolerance(1e-10, 1e-4));
        EXPECT_EQ(double(pendulum.getJointVel(0)), 3.0);
    }
}

/// The same ball as the base of a multibody and as a rigid body, falls spinning onto a pinned sheet off its middle.
TEST(MultiBody, AFreeBaseIsARigidBody) {
    const auto run = [](bool asMultiBody) {
        MultiBodyScene scene;
        const btVector3 start = vector(0.1, 0.4, -0.05), spin = vector(3, -2, 4);
        std::unique_ptr<btRigidBody> rigid;
        btMultiBody* ball = nullptr;
        if (asMultiBody) {
            ball = &scene.addBall(0.2, 0.7, start);
            ball->setBaseOmega(spin);
        } else {
            btCollisionShape& shape = scene.sphere(0.2);
            btVector3 inertia;
            shape.calculateLocalInertia(btScalar(0.7), inertia);
            rigid = std::make_unique<btRigidBody>(btScalar(0.7), nullptr, &shape, inertia);
            rigid->translate(start);
            rigid->setAngularVelocity(spin);
            scene.world.addRigidBody(rigid.get());
        }
        auto& sheet = scene.shells->add(squareSheet(1.5, 10), trampolineCloth(), {.tolerance = 1e-10});
        pinBorder(sheet);
        std::vector<Vec3> places;
        for (int i = 0; i < 40; ++i) {
            scene.step(1.0 / 60);
            places.push_back(toVec3(asMultiBody ? ball->getBasePos() : rigid->getWorldTransform().getOrigin()));
        }
        if (rigid) scene.world.removeRigidBody(rigid.get());
        return places;
    };
    const auto expected = run(false), actual = run(true);
    EXPECT_LT(expected.back().y(), 0.2);  // it has reached the sheet
    for (std::size_t i = 0; i < expected.size(); ++i)
        ASSERT_LT((actual[i] - expected[i]).norm(), bulletTolerance(1e-6, 1e-3)) << "step " << i;
}

/// Reads something in every substep after Bullet's motion and before the shells' solve.
struct Before : btActionInterface {
    std::function<void()> read;
    void updateAction(btCollisionWorld*, btScalar) override { read(); }
    void debugDraw(btIDebugDraw*) override {}
};

/// No gravity, nothing pinned: a tumbling tree of links with balls at its ends flies into a sheet. Bullet's own motion
/// of joints keeps momentum to its step's order only, so that each exchange is looked at by itself.
TEST(MultiBody, LinearMomentumOfAFreeSystemIsKept) {
    MultiBodyScene scene(0.0);
    btMultiBody& tree = addTree(scene, false);
    tree.setBaseVel(btVector3(0, -2, 0));
    for (const int link : {-1, 1, 4}) scene.addCollider(tree, link, scene.sphere(0.12));
    scene.shells.reset();
    Before before;
    scene.world.addAction(&before);
    scene.shells = std::make_unique<ShellWorld>(scene.world);
    auto& sheet = scene.shells->add(squareSheet(2.0, 20), trampolineCloth());
    Vec3 start = Vec3::Zero();
    before.read = [&] { start = momentumOf(tree) + sheet.shell().linearMomentum(); };
    std::set<const btCollisionObject*> touched;
    for (int i = 0; i < 60; ++i) {
        scene.step(1.0 / 120);
        for (const auto& contact : sheet.contacts()) touched.insert(contact.object);
        const Vec3 change = momentumOf(tree) + sheet.shell().linearMomentum() - start;
        ASSERT_LT(change.norm(), bulletTolerance(1e-9, 1e-5) * start.norm()) << "step " << i;
    }
    EXPECT_GE(touched.size(), 2u);  // links
    EXPECT_GT(sheet.shell().linearMomentum().norm(), 0.1);
    scene.world.removeAction(&before);
}

/// A slider of mass m that can only move up and down rests on a pinned sheet.
TEST(MultiBody, AtRestTheContactsBearTheWeightOfASlider) {
    MultiBodyScene scene;
    btMultiBody& slider = scene.addMultiBody(1, 0, btVector3(0, 0, 0), true);
    slider.setupPrismatic(0, btScalar(1.5), vector(0.03, 0.03, 0.03), -1, btQuaternion::getIdentity(),
                          btVector3(0, 1, 0), btVector3(0, 0, 0), btVector3(0, 0, 0), true);
    scene.finish(slider, vector(0.2, 0.26, 0.1));  // off the middle: the sheet pushes it sideways too
    scene.addCollider(slider, 0, scene.sphere(0.25));
    ShellMaterial cloth = trampolineCloth();
    cloth.massDamping = 5.0;
    auto& sheet = scene.shells->add(squareSheet(2, 14), cloth, {.tolerance = 1e-5});
    pinBorder(sheet);
    scene.run(4.0, 1.0 / 60);
    EXPECT_NEAR(impulseOf(sheet).y() * 60, -1.5 * 9.81, 1e-2 * 1.5 * 9.81);
    const btTransform& pose = slider.getLinkCollider(0)->getWorldTransform();
    EXPECT_LT(double(pose.getOrigin().y()), 0.25);
    EXPECT_NEAR(double(pose.getOrigin().x()), 0.2, 1e-6);
    EXPECT_LT(penetration(sheet, toVec3(pose.getOrigin()), 0.25), 1e-3);
}

/// Kinetic and potential energy of a pendulum's ball that started at rest, over m g.
double heightOfEnergy(btMultiBody& pendulum, double mass, double radius, double h) {
    const ArticulatedBody body(pendulum);
    const Vec6 twist = body.twist(0);
    // The velocity holds the impulse against the coming step's gravity already, which can only be upward.
    const double fall = std::min(0.0, twist.y() + 9.81 * h), rise = std::max(0.0, twist.y() - 9.81 * h);
    const double across = twist.x() * twist.x() + twist.z() * twist.z();
    const double spin = 0.5 * 0.4 * mass * radius * radius * twist.tail<3>().squaredNorm() * (rise > 0 || fall < 0);
    return body.centre(0).y() + (0.5 * mass * (std::max(rise * rise, fall * fall) + across) + spin) / (mass * 9.81);
}

/// Mass of a pendulum's ball over the mass of a vertex, step: falls from the horizontal onto a pinned sheet.
class PendulumMassRatio : public ::testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(PendulumMassRatio, TheBallNeverRisesAboveWhereItFell) {
    const auto [ratio, h] = GetParam();
    MultiBodyScene scene;
    const int cells = 20;
    const double mass = ratio * 0.3 * 4.0 / (cells * cells);
    btMultiBody& pendulum = scene.addPendulum(0.2, mass, vector(-0.8, 0.5, 0), 0.8);
    auto& sheet = scene.shells->add(squareSheet(2, cells), trampolineCloth());
    pinBorder(sheet);
    double lowest = 1.0;
    for (double t = 0; t < 2.0; t += h) {
        scene.step(h);
        ASSERT_TRUE(scene.shells->lastStep().finite);
        const double height = double(pendulum.getLinkCollider(0)->getWorldTransform().getOrigin().y());
        lowest = std::min(lowest, height);
        ASSERT_LT(height, 0.5 + 9.81 * h * h) << "at " << t << " s";
        ASSERT_LT(heightOfEnergy(pendulum, mass, 0.2, h), 0.5 + 2 * 9.81 * h * h + 1e-3) << "at " << t << " s";
    }
    EXPECT_LT(lowest, 0.3);
    EXPECT_GT(lowest, -0.6);
}
INSTANTIATE_TEST_SUITE_P(Grid, PendulumMassRatio,
                         ::testing::Combine(::testing::Values(1e-3, 1.0, 1e2, 1e4),
                                            ::testing::Values(1.0 / 240, 1.0 / 60, 1.0 / 10)));

TEST(MultiBody, AnAnchoredVertexStaysAtItsLink) {
    MultiBodyScene scene;
    btMultiBody& pendulum = scene.addPendulum(0.1, 0.5, vector(0, 2, 0), 0.7);
    btMultiBodyLinkCollider& ball = *pendulum.getLinkCollider(0);
    TriangleMesh mesh = squareSheet(0.5, 6);
    mesh.positions.row(0).array() += 1.05;  // its corners at x = 0.8 are 0.1 from the ball's centre
    mesh.positions.row(1).array() += 2.0;
    auto& sheet = scene.shells->add(mesh, trampolineCloth());
    const Vec3 corner = sheet.shell().positions().col(0);
    const btVector3 local = ball.getWorldTransform().inverse() * toBullet(corner);
    sheet.anchor(0, ball);
    double lowest = 2.0;
    for (int i = 0; i < 120; ++i) {
        scene.step(1.0 / 120);
        lowest = std::min(lowest, double(ball.getWorldTransform().getOrigin().y()));
        const Vec3 tied = toVec3(ball.getWorldTransform() * local);
        ASSERT_LT((sheet.shell().positions().col(0) - tied).norm(), bulletTolerance(1e-9, 1e-5)) << "step " << i;
    }
    EXPECT_LT(lowest, 1.4);  // it has swung down
    EXPECT_THROW(sheet.anchor(49, ball), std::out_of_range);
    scene.remove(pendulum);  // lets go
    scene.run(0.5, 1.0 / 120);
    EXPECT_LT(sheet.shell().positions().row(1).maxCoeff(), 1.5);
}

/// At rest the cloth hangs from the slider by its anchors: the motor bears the weight of both.
TEST(MultiBody, AMotorBearsWhatHangsFromItsLink) {
    MultiBodyScene scene;
    btMultiBody& slider = scene.addMultiBody(1, 0, btVector3(0, 0, 0), true);
    slider.setupPrismatic(0, btScalar(0.05), vector(1e-4, 1e-4, 1e-4), -1, btQuaternion::getIdentity(),
                          btVector3(0, 1, 0), btVector3(0, 0, 0), btVector3(0, 0, 0), true);
    scene.finish(slider, vector(0, 1, 0));
    btMultiBodyLinkCollider& hook = scene.addCollider(slider, 0, scene.sphere(0.02));
    const double h = 1.0 / 240;
    scene.addMotor(slider, 0, 0.0, 100.0 * h);
    ShellMaterial heavy = trampolineCloth();
    heavy.areaDensityOverride = 3.0;
    heavy.massDamping = 5.0;
    TriangleMesh mesh = squareSheet(0.5, 5);
    mesh.positions.row(1).array() += 0.95;
    auto& sheet = scene.shells->add(mesh, heavy, {.tolerance = 1e-8});
    for (const int vertex : {14, 15, 20, 21}) sheet.anchor(vertex, hook);
    scene.run(4.0, h);
    EXPECT_NEAR(double(scene.motors.front()->getAppliedImpulse(0)), h * 9.81 * (0.05 + 0.75), h * 9.81 * 0.8 * 1e-2);
    EXPECT_NEAR(double(hook.getWorldTransform().getOrigin().y()), 1.0, 2e-3);
}

/// A finger of 50 g closes with 4 N on a sheet that stands against a wall.
TEST(MultiBody, AMotorPressesWithItsForce) {
    MultiBodyScene scene(0.0);
    const double h = 1.0 / 240;
    btCollisionShape& slab = scene.addShape(std::make_unique<btBoxShape>(vector(1, 0.05, 1)));
    auto wall = std::make_unique<btCollisionObject>();
    wall->setCollisionShape(&slab);
    wall->setWorldTransform(btTransform(btQuaternion::getIdentity(), vector(0, -0.05, 0)));
    scene.world.addCollisionObject(wall.get());
    scene.objects.push_back(std::move(wall));
    btMultiBody& finger = scene.addMultiBody(1, 0, btVector3(0, 0, 0), true);
    finger.setupPrismatic(0, btScalar(0.05), vector(1e-4, 1e-4, 1e-4), -1, btQuaternion::getIdentity(),
                          btVector3(0, 1, 0), btVector3(0, 0, 0), btVector3(0, 0, 0), true);
    scene.finish(finger, vector(0, 0.03, 0));
    auto& pad = scene.addShape(std::make_unique<btBoxShape>(vector(0.06, 0.01, 0.06)));
    btMultiBodyLinkCollider& collider = scene.addCollider(finger, 0, pad);
    scene.addMotor(finger, 0, -0.1, 4.0 * h);
    TriangleMesh mesh = squareSheet(0.3, 8);
    mesh.positions.row(1).array() += 2e-4;
    auto& sheet = scene.shells->add(mesh, trampolineCloth(), {.tolerance = 1e-6});
    scene.run(0.5, h);
    double onFinger = 0.0, onWall = 0.0;
    for (const auto& contact : sheet.contacts())
        (contact.contact.normal.y() < 0.0 ? onFinger : onWall) -= contact.impulse.y() / h;
    EXPECT_NEAR(onFinger, 4.0, 0.1);
    EXPECT_NEAR(onWall, -4.0, 0.1);
    EXPECT_NEAR(double(collider.getWorldTransform().getOrigin().y()), 0.01 + 2 * sheet.contactThickness(), 5e-4);
}

/// A palm on a fixed rail carries two fingers, which close from above and below on the edge of a sheet on a table.
class Gripper {
  public:
    static constexpr double kStep = 1.0 / 240;
    enum Link { kPalm, kLower, kUpper };

    Gripper() {
        addTable();
        addHand();
        ShellMaterial felt{.thickness = 1e-3, .massDamping = 1.0};
        felt.stretchStiffnessOverride = 5e3;
        felt.bendingStiffnessOverride = 2e-3;
        felt.areaDensityOverride = 0.3;
        TriangleMesh mesh = makeGrid({.size = {0.2, 0.15}, .cells = {16, 12}});
        mesh.positions.row(0).array() -= 0.03;  // 7 cm beyond the table's edge at x = 0
        mesh.positions.row(1).array() += 1e-3;
        sheet = &scene.shells->add(mesh, felt, {.tolerance = 1e-5, .friction = 0.9});
    }

    void addTable() {
        auto& box = scene.addShape(std::make_unique<btBoxShape>(vector(0.2, 0.1, 0.25)));
        auto table = std::make_unique<btCollisionObject>();
        table->setCollisionShape(&box);
        table->setWorldTransform(btTransform(btQuaternion::getIdentity(), vector(-0.2, -0.1, 0)));
        scene.world.addCollisionObject(table.get());
        scene.objects.push_back(std::move(table));
    }

    void addHand() {
        hand = &scene.addMultiBody(3, 0, btVector3(0, 0, 0), true);
        const btQuaternion straight = btQuaternion::getIdentity();
        const btVector3 up(0, 1, 0), none(0, 0, 0), inertia = vector(1e-4, 1e-4, 1e-4);
        hand->setupPrismatic(kPalm, btScalar(0.5), inertia, -1, straight, up, vector(0.16, 0, 0), none, true);
        hand->setupPrismatic(kLower, btScalar(0.1), inertia, kPalm, straight, up, vector(-0.12, -0.034, 0), none, true);
        hand->setupPrismatic(kUpper, btScalar(0.1), inertia, kPalm, straight, up, vector(-0.12, 0.034, 0), none, true);
        scene.finish(*hand);
        auto& finger = scene.addShape(std::make_unique<btBoxShape>(vector(0.03, 0.006, 0.06)));
        // Bullet drives no joint of a link without a collider.
        scene.addCollider(*hand, kPalm, scene.addShape(std::make_unique<btBoxShape>(vector(0.01, 0.05, 0.03))));
        for (const int link : {kLower, kUpper}) scene.addCollider(*hand, link, finger).setFriction(1);
        scene.addMotor(*hand, kPalm, 0.0, 14 * kStep);  // lifts the hand gently
        scene.addMotor(*hand, kLower, 0.1, 60 * kStep);
        scene.addMotor(*hand, kUpper, -0.1, 12 * kStep);
    }

    void drive(double palm, double lower, double seconds) {
        scene.motors[kPalm]->setVelocityTarget(btScalar(palm));
        scene.motors[kLower]->setVelocityTarget(btScalar(lower));
        for (int i = 0; i < int(seconds / kStep + 0.5); ++i) {
            scene.step(kStep);
            const auto& step = scene.shells->lastStep();
            mostIterations = std::max(mostIterations, double(step.pcgIterations) / std::max(step.solves, 1));
        }
    }

    /// Where a vertex is as seen from the lower finger.
    Vec3 seenFromFinger(int vertex) const {
        const btTransform& pose = hand->getLinkCollider(kLower)->getWorldTransform();
        return sheet->shell().positions().col(vertex) - toVec3(pose.getOrigin());
    }

    MultiBodyScene scene;
    btMultiBody* hand = nullptr;
    ShellBody* sheet = nullptr;
    double mostIterations = 0.0;  ///< of a solve, mean of a step
};

TEST(MultiBody, TwoFingersLiftASheetAndHoldIt) {
    Gripper gripper;
    gripper.drive(0.0, 0.1, 0.27);
    gripper.drive(0.0, 0.0, 0.13);
    const ShellBody& sheet = *gripper.sheet;
    std::vector<int> gripped;
    std::vector<Vec3> start;
    for (int i = 0; i < sheet.vertexCount(); ++i) {
        const Vec3 x = sheet.shell().positions().col(i);
        if (x.x() < 0.02 || x.x() > 0.06 || std::abs(x.z()) > 0.05) continue;
        gripped.push_back(i);
        start.push_back(gripper.seenFromFinger(i));
    }
    ASSERT_GT(gripped.size(), 10u);
    gripper.drive(0.4, 0.0, 0.45);
    gripper.drive(0.0, 0.0, 0.4);
    double slip = 0.0;
    for (std::size_t k = 0; k < gripped.size(); ++k)
        slip = std::max(slip, (gripper.seenFromFinger(gripped[k]) - start[k]).norm());
    RecordProperty("slip_mm", std::to_string(1e3 * slip));
    EXPECT_LT(slip, 10e-3);  // wanted: 2 mm. Measured: 0.2 to 0.9 mm mostly, but up to 8 mm in one run of ten from
                             // places 1 pm to 0.1 mm apart: what a pinched sheet does depends on rounding
    EXPECT_GT(sheet.shell().positions().row(1).minCoeff(), 0.0);  // off the table
    double grip = 0.0;
    for (const auto& contact : sheet.contacts())
        if (contact.contact.normal.y() < -0.9) grip -= contact.impulse.y() / Gripper::kStep;
    EXPECT_NEAR(grip, 12.0 + 0.1 * 9.81, 0.5);  // the motor's force and the finger's weight
    EXPECT_LT(gripper.mostIterations, 80);      // twice as many where a preconditioner outlives the contacts it knows
}

TEST(MultiBody, ALinkMayBeRemovedWhileItTouches) {
    MultiBodyScene scene;
    btMultiBody& pendulum = scene.addPendulum(0.2, 0.5, vector(-0.4, 0.3, 0), 0.4);
    btMultiBody& ball = scene.addBall(0.15, 0.3, vector(0.5, 0.25, 0));
    auto& sheet = scene.shells->add(squareSheet(2, 12), trampolineCloth());
    pinBorder(sheet);
    scene.run(0.7, 1.0 / 60);
    EXPECT_FALSE(sheet.contacts().empty());
    scene.remove(pendulum);
    scene.run(0.1, 1.0 / 60);
    scene.remove(ball);
    scene.run(0.2, 1.0 / 60);
    EXPECT_TRUE(sheet.contacts().empty());
    EXPECT_TRUE(scene.shells->lastStep().finite);
}

/// A sleeping multibody stands still under a light sheet, and wakes when a heavy one falls on it.
TEST(MultiBody, ASleepingBodyWakesOnlyFromARealKick) {
    const auto run = [](double areaDensity, double speed) {
        MultiBodyScene scene;
        btMultiBody& hinge = scene.addPendulum(0.2, 50.0, btVector3(0, 1, 0), 0.5);
        hinge.setJointPos(0, btScalar(-M_PI / 2));
        hinge.setSleepTimeout(btScalar(0.1));
        scene.updatePoses(hinge);
        scene.run(1.0, 1.0 / 60);
        EXPECT_EQ(hinge.getLinkCollider(0)->getActivationState(), ISLAND_SLEEPING);
        ShellMaterial cloth = trampolineCloth();
        cloth.areaDensityOverride = areaDensity;
        TriangleMesh mesh = squareSheet(0.6, 8);
        mesh.positions.row(0).array() += 0.12;
        mesh.positions.row(1).array() += 0.75;
        auto& sheet = scene.shells->add(mesh, cloth);
        sheet.setVelocity(vector(0, -speed, 0));
        bool touched = false, moved = false;
        for (int i = 0; i < 20; ++i) {
            scene.step(1.0 / 60);
            touched = touched || !sheet.contacts().empty();
            moved = moved || (hinge.isAwake() && hinge.getJointVel(0) != btScalar(0));
        }
        EXPECT_TRUE(touched);
        return moved;
    };
    EXPECT_FALSE(run(0.02, 0.0));
    EXPECT_TRUE(run(20.0, 4.0));
}

}  // namespace
}  // namespace jacket::bullet::testing
