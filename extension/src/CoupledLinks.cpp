#include "CoupledLinks.h"

#include <BulletDynamics/Featherstone/btMultiBodyConstraint.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "ArticulatedBody.h"

namespace jacket::bullet {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// In a direction that its joints forbid, a link takes part with this many times its mass.
constexpr double kForbidden = 1e8;
// A motor that holds its joint is taken to give all its force when the joint is pushed this fast [m/s, rad/s].
constexpr double kHeldSpeed = 1e-2;

bool isAsleep(btMultiBody& body) {
    const auto sleeps = [](const btMultiBodyLinkCollider* collider) {
        return collider && collider->getActivationState() == ISLAND_SLEEPING;
    };
    bool result = sleeps(body.getBaseCollider());
    for (int i = 0; i < body.getNumLinks(); ++i) result = result || sleeps(body.getLink(i).m_collider);
    return result;
}

/// What one multibody does in the coming step besides what shells do to it: changes d of its free velocities with
/// inertia d = impulse.
struct FreeMotion {
    const ArticulatedBody& body;
    MatrixXd inertia;
    VectorXd impulse;

    VectorXd change() const { return inertia.ldlt().solve(impulse); }
    /// Something stiff that stops the velocity along a row of generalised velocities.
    void addStop(const VectorXd& row, double weight) {
        const VectorXd along = body.freeColumns(row.transpose()).transpose();
        inertia += weight * along * along.transpose();
        impulse -= weight * row.dot(body.velocity()) * along;
    }
    double massAlong(const VectorXd& row) const {
        const VectorXd along = body.freeColumns(row.transpose()).transpose();
        const double mobility = along.dot(inertia.ldlt().solve(along));
        return mobility > 0.0 ? 1.0 / mobility : 0.0;
    }
};

/// Bullet will have its motors push on after this solve, and knows their force only then. A motor at the end of its
/// force goes on with it. One that has some to spare keeps its joint at the velocity that it has, with what is left.
void addMotor(btMultiBodyConstraint& motor, FreeMotion& motion) {
    const VectorXd row =
        Eigen::Map<Eigen::Matrix<btScalar, Eigen::Dynamic, 1>>(motor.jacobianA(0), motion.body.size()).cast<double>();
    const double impulse = double(motor.getAppliedImpulse(0));
    const double spare = std::max(0.0, double(motor.getMaxAppliedImpulse()) - std::abs(impulse));
    const double speed = std::max(std::abs(row.dot(motion.body.velocity())), kHeldSpeed);
    const VectorXd along = motion.body.freeColumns(row.transpose()).transpose();
    const double damping = std::min(spare / speed, kSupport * motion.massAlong(row));
    motion.impulse += impulse * along;
    motion.inertia += damping * along * along.transpose();
}

/// A joint that its limit has stopped stays so.
void addLimit(btMultiBodyConstraint& limit, FreeMotion& motion) {
    for (int k = 0; k < 2; ++k) {
        if (!(limit.getAppliedImpulse(k) > btScalar(0)) || limit.getPosition(k) > btScalar(0)) continue;
        VectorXd row = VectorXd::Zero(motion.body.size());
        row[6 + motion.body.body().getLink(limit.getLinkA()).m_dofOffset] = 1.0;
        motion.addStop(row, kSupport * motion.massAlong(row));
    }
}

void addJointConstraints(btMultiBodyDynamicsWorld& world, FreeMotion& motion) {
    for (int i = 0; i < world.getNumMultiBodyConstraints(); ++i) {
        btMultiBodyConstraint& constraint = *world.getMultiBodyConstraint(i);
        if (constraint.getMultiBodyA() != &motion.body.body()) continue;
        const int type = constraint.getConstraintType();
        if (type != MULTIBODY_CONSTRAINT_1DOF_JOINT_MOTOR && type != MULTIBODY_CONSTRAINT_LIMIT) continue;
        constraint.finalizeMultiDof();  // its memory may be missing until Bullet has first solved it
        if (type == MULTIBODY_CONSTRAINT_LIMIT)
            addLimit(constraint, motion);
        else
            addMotor(constraint, motion);
    }
}

/// Per generalised velocity, the velocity along n of a collision object's point; zero if it is no link of the body.
VectorXd pointRow(const ArticulatedBody& body, const btCollisionObject* object, const Vec3& at, const Vec3& n) {
    const auto* link = btMultiBodyLinkCollider::upcast(object);
    if (!link || link->m_multiBody != &body.body()) return VectorXd::Zero(body.size());
    const Vec6 along = (Vec6() << n, (at - body.centre(link->m_link)).cross(n)).finished();
    return body.jacobian(link->m_link).transpose() * along;
}

/// Rigid contacts that carried impulse in the last solve, as for rigid bodies.
void addContacts(btDispatcher& dispatcher, FreeMotion& motion) {
    for (int m = 0; m < dispatcher.getNumManifolds(); ++m) {
        const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(m);
        if (!manifold.getBody0()->hasContactResponse() || !manifold.getBody1()->hasContactResponse()) continue;
        for (int k = 0; k < manifold.getNumContacts(); ++k) {
            const btManifoldPoint& point = manifold.getContactPoint(k);
            if (!(point.m_appliedImpulse > btScalar(0))) continue;
            const Vec3 n = fromBullet(point.m_normalWorldOnB);
            const VectorXd row =
                pointRow(motion.body, manifold.getBody0(), fromBullet(point.getPositionWorldOnA()), n) -
                pointRow(motion.body, manifold.getBody1(), fromBullet(point.getPositionWorldOnB()), n);
            if (!row.isZero(0.0)) motion.addStop(row, kSupport * motion.massAlong(row));
        }
    }
}

/// Inverse of the links' common mass, J I^-1 J^T, made positive definite: what joints forbid becomes very heavy.
MatrixXd jointMass(const MatrixXd& jacobian, const MatrixXd& inertia, std::span<const double> radii) {
    MatrixXd mobility = jacobian * inertia.ldlt().solve(jacobian.transpose());
    VectorXd scale(mobility.rows());  // of each unknown: its part becomes of order 1
    for (std::size_t k = 0; k < radii.size(); ++k) {
        const auto own = mobility.diagonal().segment<6>(static_cast<Eigen::Index>(6 * k));
        const double r = std::max(radii[k], 1e-6);
        const double most = std::max(own.head<3>().maxCoeff(), r * r * own.tail<3>().maxCoeff());
        scale.segment<3>(static_cast<Eigen::Index>(6 * k)).setConstant(1.0 / std::sqrt(most));
        scale.segment<3>(static_cast<Eigen::Index>(6 * k + 3)).setConstant(r / std::sqrt(most));
    }
    mobility = scale.asDiagonal() * mobility * scale.asDiagonal();
    mobility.diagonal().array() += 1.0 / kForbidden;
    const MatrixXd inverse = mobility.ldlt().solve(MatrixXd::Identity(mobility.rows(), mobility.cols()));
    return scale.asDiagonal() * (0.5 * (inverse + inverse.transpose())) * scale.asDiagonal();
}

/// All obstacles that are free links of one multibody.
void coupleGroup(btMultiBody& multiBody, const std::vector<int>& group, std::span<Obstacle> obstacles,
                 btCollisionWorld& world, double h, std::vector<BodyCoupling>& couplings) {
    const ArticulatedBody body(multiBody);
    FreeMotion motion{body, body.inertia(), {}};
    motion.impulse = h * motion.inertia * body.acceleration();
    if (auto* dynamics = dynamic_cast<btMultiBodyDynamicsWorld*>(&world)) addJointConstraints(*dynamics, motion);
    addContacts(*world.getDispatcher(), motion);
    const VectorXd change = motion.change();

    MatrixXd jacobian(static_cast<Eigen::Index>(6 * group.size()), motion.inertia.cols());
    std::vector<double> radii;
    for (std::size_t k = 0; k < group.size(); ++k) {
        CoupledBody& coupled = obstacles[group[k]].body;
        const int link = static_cast<btMultiBodyLinkCollider*>(obstacles[group[k]].object)->m_link;
        const MatrixXd part = body.freeColumns(body.jacobian(link));
        jacobian.middleRows<6>(static_cast<Eigen::Index>(6 * k)) = part;
        coupled.freeTwist = body.twist(link) + part * change;
        radii.push_back(coupled.radius);
    }
    const MatrixXd mass = jointMass(jacobian, motion.inertia, radii);
    const auto block = [&](std::size_t a, std::size_t b) {
        return mass.block<6, 6>(static_cast<Eigen::Index>(6 * a), static_cast<Eigen::Index>(6 * b));
    };
    for (std::size_t a = 0; a < group.size(); ++a) {
        obstacles[group[a]].body.mass = block(a, a);
        for (std::size_t b = a + 1; b < group.size(); ++b) couplings.push_back({group[a], group[b], block(a, b)});
    }
}

}  // namespace

Vec6 twistOf(const btMultiBodyLinkCollider& collider) {
    if (isAsleep(*collider.m_multiBody)) return Vec6::Zero();
    return ArticulatedBody(*collider.m_multiBody).twist(collider.m_link);
}

bool isPrescribed(const btMultiBodyLinkCollider& collider) {
    if (collider.isStaticOrKinematicObject() || isAsleep(*collider.m_multiBody)) return true;
    const ArticulatedBody body(*collider.m_multiBody);
    return body.freeColumns(body.jacobian(collider.m_link)).isZero(0.0);
}

void pushLink(btMultiBodyLinkCollider& collider, const Vec6& impulse, double still) {
    btMultiBody& multiBody = *collider.m_multiBody;
    ArticulatedBody body(multiBody);
    const VectorXd change = body.response(collider.m_link, impulse);
    if (isAsleep(multiBody)) {
        if (!((body.jacobian(collider.m_link) * change).head<3>().norm() > still)) return;
        multiBody.wakeUp();
        collider.activate();
    }
    body.addVelocity(change);
}

std::vector<BodyCoupling> coupleLinks(std::span<Obstacle> obstacles, btCollisionWorld& world, double h) {
    std::vector<BodyCoupling> couplings;
    std::vector<std::pair<btMultiBody*, std::vector<int>>> groups;
    for (std::size_t i = 0; i < obstacles.size(); ++i) {
        const auto* link = btMultiBodyLinkCollider::upcast(obstacles[i].object);
        if (!link || obstacles[i].body.prescribed) continue;
        auto group = std::find_if(groups.begin(), groups.end(),
                                  [&](const auto& known) { return known.first == link->m_multiBody; });
        if (group == groups.end()) group = groups.insert(group, {link->m_multiBody, {}});
        group->second.push_back(static_cast<int>(i));
    }
    for (const auto& [body, group] : groups) coupleGroup(*body, group, obstacles, world, h, couplings);
    return couplings;
}

}  // namespace jacket::bullet
