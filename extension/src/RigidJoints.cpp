#include "RigidJoints.h"

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "BodyTwist.h"
#include "Convert.h"

namespace jacket::bullet {
namespace {

/// What a joint fills in for Bullet's solver, which calls it with the same defaults.
class JointInfo {
  public:
    JointInfo(btTypedConstraint& joint, const btContactSolverInfo& solver, double h, std::pmr::memory_resource* memory)
        : m_rows(memory) {
        btTypedConstraint::btConstraintInfo1 size;
        joint.getInfo1(&size);
        if (size.m_numConstraintRows <= 0) return;  // or solved by itself, in the way of old
        m_rows.resize(static_cast<std::size_t>(size.m_numConstraintRows));
        Row& first = m_rows.front();
        first.cfm = solver.m_globalCfm;
        btTypedConstraint::btConstraintInfo2 info;
        info.fps = btScalar(1.0 / h);
        info.erp = solver.m_erp;
        info.m_J1linearAxis = first.linear[0].data();
        info.m_J1angularAxis = first.angular[0].data();
        info.m_J2linearAxis = first.linear[1].data();
        info.m_J2angularAxis = first.angular[1].data();
        info.rowskip = sizeof(Row) / sizeof(btScalar);
        info.m_constraintError = &first.error;
        info.cfm = &first.cfm;
        info.m_lowerLimit = &first.lower;
        info.m_upperLimit = &first.upper;
        info.m_numIterations = solver.m_numIterations;
        info.m_damping = solver.m_damping;
        joint.getInfo2(&info);
        m_damping = double(info.m_damping);
    }

    /// Joints step from a value to that of the next row by a number of scalars. Vectors have the room of a btVector3.
    struct Row {
        std::array<std::array<btScalar, 4>, 2> linear{}, angular{};
        btScalar error = 0, cfm = 0, lower = -SIMD_INFINITY, upper = SIMD_INFINITY;

        Vec6 along(int body) const {
            const auto &l = linear[body], &a = angular[body];
            return Eigen::Matrix<btScalar, 6, 1>(l[0], l[1], l[2], a[0], a[1], a[2]).template cast<double>();
        }
    };
    const std::pmr::vector<Row>& rows() const { return m_rows; }
    double damping() const { return m_damping; }

  private:
    std::pmr::vector<Row> m_rows;
    double m_damping = 1.0;
};

/// Of an impulse. What Bullet calls infinity is a number, and above it nothing is.
double limitOf(btScalar value) {
    return value < SIMD_INFINITY ? double(value) : std::numeric_limits<double>::infinity();
}

}  // namespace

double mobilityAlong(const btRigidBody& body, const Vec6& row) {
    if (body.isStaticOrKinematicObject()) return 0.0;
    const Vec3 turn = row.tail<3>();
    return double(body.getInvMass()) * row.head<3>().squaredNorm() +
           turn.dot(fromBullet(body.getInvInertiaTensorWorld()) * turn);
}

void readJoint(btTypedConstraint& joint, const btContactSolverInfo& solver, double h,
               std::pmr::vector<JointRow>& rows) {
    if (!joint.isEnabled()) return;
    const btScalar applied = joint.internalGetAppliedImpulse();  // users read it; some kinds of joints set it back here
    joint.buildJacobian();
    const JointInfo info(joint, solver, h, rows.get_allocator().resource());
    joint.internalSetAppliedImpulse(applied);
    const btRigidBody &first = joint.getRigidBodyA(), &second = joint.getRigidBodyB();
    for (const JointInfo::Row& row : info.rows()) {
        const Vec6 alongFirst = row.along(0), alongSecond = row.along(1);
        const double mobility = mobilityAlong(first, alongFirst) + mobilityAlong(second, alongSecond);
        const double velocity = alongFirst.dot(freeTwistOf(first, h)) + alongSecond.dot(freeTwistOf(second, h));
        const double kept = double(row.error) + (1.0 - info.damping()) * velocity;
        const ImpulseRange range{-limitOf(std::min(-row.lower, joint.getBreakingImpulseThreshold())),
                                 limitOf(std::min(row.upper, joint.getBreakingImpulseThreshold()))};
        const bool isIdle = range.least == 0.0 && range.most == 0.0;  // a motor without force
        if (isIdle || !(mobility > 0.0) || !std::isfinite(mobility) || !std::isfinite(kept)) continue;
        rows.push_back({&first, &second, alongFirst, alongSecond, kept, double(row.cfm) * mobility, range});
    }
}

}  // namespace jacket::bullet
