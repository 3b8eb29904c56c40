// What joints tell Bullet's solver, as shells' solve has it, against what that solver then does.
#include "RigidJoints.h"

#include <btBulletDynamicsCommon.h>
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <memory>
#include <memory_resource>

#include "BodyTwist.h"
#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

using Joint = std::unique_ptr<btTypedConstraint>;

btTransform frameAt(const btVector3& origin) {
    return btTransform(btQuaternion::getIdentity(), origin);
}

struct Kind {
    const char* name;
    Joint (*make)(btRigidBody& first, btRigidBody& second);
    int rows;
};
void PrintTo(const Kind& kind, std::ostream* to) {
    *to << kind.name;
}

Joint makeHinge(btRigidBody& first, btRigidBody& second, double low, double high) {
    auto hinge = std::make_unique<btHingeConstraint>(first, second, btVector3(0.3, 0, 0), btVector3(-0.3, 0.05, 0),
                                                     btVector3(0, 0, 1), btVector3(0, 0, 1));
    hinge->setLimit(btScalar(low), btScalar(high));
    return hinge;
}

Joint makeMotor(btRigidBody& first, btRigidBody& second, double impulse) {
    Joint hinge = makeHinge(first, second, 1, -1);
    static_cast<btHingeConstraint&>(*hinge).enableAngularMotor(true, btScalar(2), btScalar(impulse));
    return hinge;
}

Joint makeSprung(btRigidBody& first, btRigidBody& second) {
    auto joint = std::make_unique<btGeneric6DofSpring2Constraint>(first, second, frameAt(btVector3(0.3, 0, 0)),
                                                                  frameAt(btVector3(-0.3, 0.05, 0)));
    for (int axis = 1; axis < 6; ++axis) joint->setLimit(axis, 0, 0);
    joint->setLimit(0, 1, -1);
    joint->enableSpring(0, true);
    joint->setStiffness(0, 50);
    joint->setEquilibriumPoint(0, btScalar(0.1));
    return joint;
}

const Kind kKinds[] = {
    {"ball and socket",
     [](btRigidBody& a, btRigidBody& b) -> Joint {
         return std::make_unique<btPoint2PointConstraint>(a, b, btVector3(0.3, 0, 0), btVector3(-0.3, 0.05, 0));
     },
     3},
    {"hinge", [](btRigidBody& a, btRigidBody& b) { return makeHinge(a, b, 1, -1); }, 5},
    {"hinge at its limit", [](btRigidBody& a, btRigidBody& b) { return makeHinge(a, b, 0.1, 1); }, 6},
    {"strong motor", [](btRigidBody& a, btRigidBody& b) { return makeMotor(a, b, 100); }, 6},
    {"weak motor", [](btRigidBody& a, btRigidBody& b) { return makeMotor(a, b, 0.01); }, 6},
    {"spring", makeSprung, 6},
    {"fixed",
     [](btRigidBody& a, btRigidBody& b) -> Joint {
         return std::make_unique<btFixedConstraint>(a, b, frameAt(btVector3(0.3, 0, 0)),
                                                    frameAt(btVector3(-0.3, 0.05, 0)));
     },
     6},
    {"soft",
     [](btRigidBody& a, btRigidBody& b) -> Joint {
         auto joint = std::make_unique<btPoint2PointConstraint>(a, b, btVector3(0.3, 0, 0), btVector3(-0.3, 0.05, 0));
         joint->setParam(BT_CONSTRAINT_CFM, btScalar(0.5), -1);
         return joint;
     },
     3},
    {"about to break",
     [](btRigidBody& a, btRigidBody& b) -> Joint {
         auto joint = std::make_unique<btPoint2PointConstraint>(a, b, btVector3(0.3, 0, 0), btVector3(-0.3, 0.05, 0));
         joint->setBreakingImpulseThreshold(btScalar(0.1));
         return joint;
     },
     3},
};

class RigidJoints : public ::testing::TestWithParam<Kind> {
  protected:
    static constexpr double kHalf = 0.1;
    BulletScene scene{0.0};
    btRigidBody& first = addCube(1.0, -0.3);
    btRigidBody& second = addCube(2.5, 0.32);  // the two frames are a little apart
    btTypedConstraint* joint = &scene.addJoint(GetParam().make(first, second));

    btRigidBody& addCube(double mass, double x) {
        const auto half = btScalar(kHalf);
        return scene.addBox(btVector3(half, half, half), mass, btVector3(btScalar(x), 0, 0));
    }
    void SetUp() override {
        scene.world.getSolverInfo().m_numIterations = 3000;
        first.setLinearVelocity(btVector3(0.5, 1, -0.7));
        first.setAngularVelocity(btVector3(1, -2, btScalar(1.5)));
        second.setLinearVelocity(btVector3(btScalar(-0.2), btScalar(0.3), 1));
    }

    std::pmr::vector<JointRow> read() {
        std::pmr::vector<JointRow> rows;
        readJoint(*joint, scene.world.getSolverInfo(), kStep, rows);
        return rows;
    }
    using Vec12 = Eigen::Matrix<double, 12, 1>;
    Vec12 twists() const { return (Vec12() << twistOf(first), twistOf(second)).finished(); }
    Vec12 masses() const {
        const auto of = [](const btRigidBody& cube) {
            const double mass = 1.0 / double(cube.getInvMass()), inertia = mass * 4 * kHalf * kHalf / 6;
            return (Vec6() << mass, mass, mass, inertia, inertia, inertia).finished();
        };
        return (Vec12() << of(first), of(second)).finished();
    }
};

/// Impulses along the rows explain all that changes. One that is within its range leads to the row's velocity, less
/// what it gives way; one at the end of it is on the right side of that.
TEST_P(RigidJoints, AreReadAsBulletSolvesThem) {
    const std::pmr::vector<JointRow> rows = read();
    ASSERT_EQ(std::ssize(rows), GetParam().rows);
    Eigen::Matrix<double, 12, Eigen::Dynamic> along(12, std::ssize(rows));
    for (std::size_t i = 0; i < rows.size(); ++i)
        along.col(static_cast<Eigen::Index>(i)) << rows[i].alongFirst, rows[i].alongSecond;
    const Vec12 before = twists();
    scene.step(kStep);
    const Vec12 after = twists(), change = masses().cwiseProduct(after - before);
    const Eigen::VectorXd impulses = along.colPivHouseholderQr().solve(change);
    const double error = bulletTolerance(1e-6, 2e-4);
    EXPECT_LT((along * impulses - change).norm(), error);
    EXPECT_GT(change.norm(), 0.01);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const auto& [least, most] = rows[i].range;
        const double impulse = impulses[static_cast<Eigen::Index>(i)];
        const double left =
            rows[i].velocity - rows[i].ease * impulse - along.col(static_cast<Eigen::Index>(i)).dot(after);
        EXPECT_GT(impulse, least - error) << i;
        EXPECT_LT(impulse, most + error) << i;
        if (impulse < most - error) {
            EXPECT_LT(left, 10 * error) << i;
        }
        if (impulse > least + error) {
            EXPECT_GT(left, -10 * error) << i;
        }
    }
}

TEST_P(RigidJoints, KeepWhatUsersReadOfThem) {
    scene.step(kStep);
    const btScalar applied = joint->getAppliedImpulse();
    read();
    EXPECT_EQ(joint->getAppliedImpulse(), applied);
}

TEST_P(RigidJoints, HoldNothingWhereTheyAreDisabled) {
    joint->setEnabled(false);
    EXPECT_TRUE(read().empty());
}

INSTANTIATE_TEST_SUITE_P(Kinds, RigidJoints, ::testing::ValuesIn(kKinds));

}  // namespace
}  // namespace jacket::bullet::testing
