#include "ArticulatedBody.h"

#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyJointFeedback.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace jacket::bullet {
namespace {

Mat3 rotationOf(const btQuaternion& q) {
    return Eigen::Quaterniond(double(q.w()), double(q.x()), double(q.y()), double(q.z()))
        .normalized()
        .toRotationMatrix();
}

/// Bullet's forward dynamics writes joint feedback, which is the user's to read after the step.
class KeepJointFeedback {
  public:
    explicit KeepJointFeedback(btMultiBody& body) : m_body(body) {
        for (int i = 0; i < body.getNumLinks(); ++i)
            if (const auto* feedback = body.getLink(i).m_jointFeedback) m_kept.push_back(*feedback);
    }
    ~KeepJointFeedback() {
        auto kept = m_kept.begin();
        for (int i = 0; i < m_body.getNumLinks(); ++i)
            if (auto* feedback = m_body.getLink(i).m_jointFeedback) *feedback = *kept++;
    }
    KeepJointFeedback(const KeepJointFeedback&) = delete;
    KeepJointFeedback& operator=(const KeepJointFeedback&) = delete;

  private:
    btMultiBody& m_body;
    std::vector<btMultiBodyJointFeedback> m_kept;
};

}  // namespace

ArticulatedBody::ArticulatedBody(btMultiBody& body) : m_body(body), m_velocity(6 + body.getNumDofs()) {
    for (int i = 0; i < size(); ++i) m_velocity[i] = double(body.getVelocityVector()[i]);
    if (!body.isBaseStaticOrKinematic())
        for (int i = 0; i < 6; ++i) m_free.push_back(i);
    for (int link = 0; link < body.getNumLinks(); ++link)
        for (int dof = 0; dof < body.getLink(link).m_dofCount; ++dof)
            if (!body.isLinkAndAllAncestorsKinematic(link)) m_free.push_back(6 + body.getLink(link).m_dofOffset + dof);
    placeLinks();
    fillJacobians();
}

void ArticulatedBody::placeLinks() {
    m_frames.push_back({rotationOf(m_body.getWorldToBaseRot()).transpose(), fromBullet(m_body.getBasePos())});
    for (int link = 0; link < m_body.getNumLinks(); ++link) {
        const LinkFrame& parent = m_frames[m_body.getParent(link) + 1];
        LinkFrame frame{parent.rotation * rotationOf(m_body.getParentToLocalRot(link)).transpose(), {}};
        frame.position = parent.position + frame.rotation * fromBullet(m_body.getRVector(link));
        m_frames.push_back(frame);
    }
}

void ArticulatedBody::fillJacobians() {
    Jacobian base = Jacobian::Zero(6, size());
    base.block<3, 3>(0, 3) = Mat3::Identity();
    base.block<3, 3>(3, 0) = Mat3::Identity();
    m_jacobians.push_back(base);
    for (int link = 0; link < m_body.getNumLinks(); ++link) {
        const int parent = m_body.getParent(link);
        Jacobian jacobian = m_jacobians[parent + 1];
        jacobian.topRows<3>() -= skew(centre(link) - centre(parent)) * jacobian.bottomRows<3>();
        const btMultibodyLink& joint = m_body.getLink(link);
        const Mat3& rotation = m_frames[link + 1].rotation;
        for (int dof = 0; dof < joint.m_dofCount; ++dof) {
            jacobian.col(6 + joint.m_dofOffset + dof).head<3>() = rotation * fromBullet(joint.getAxisBottom(dof));
            jacobian.col(6 + joint.m_dofOffset + dof).tail<3>() = rotation * fromBullet(joint.getAxisTop(dof));
        }
        m_jacobians.push_back(jacobian);
    }
}

Mat6 ArticulatedBody::linkMass(int link) const {
    const Vec3 inertia = fromBullet(link < 0 ? m_body.getBaseInertia() : m_body.getLinkInertia(link));
    const Mat3& rotation = m_frames[link + 1].rotation;
    Mat6 mass = double(link < 0 ? m_body.getBaseMass() : m_body.getLinkMass(link)) * Mat6::Identity();
    mass.bottomRightCorner<3, 3>() = rotation * inertia.asDiagonal() * rotation.transpose();
    return mass;
}

Eigen::MatrixXd ArticulatedBody::inertia() const {
    const auto count = static_cast<Eigen::Index>(m_free.size());
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(count, count);
    for (int link = -1; link < m_body.getNumLinks(); ++link) {
        const Eigen::MatrixXd jacobian = freeColumns(m_jacobians[link + 1]);
        result += jacobian.transpose() * linkMass(link) * jacobian;
    }
    return result;
}

Eigen::VectorXd ArticulatedBody::acceleration() const {
    const KeepJointFeedback keep(m_body);
    btAlignedObjectArray<btScalar> scalars;
    btAlignedObjectArray<btVector3> vectors;
    btAlignedObjectArray<btMatrix3x3> matrices;
    // A step of length 0 changes no velocity and leaves the accelerations behind the first scratch scalars.
    m_body.computeAccelerationsArticulatedBodyAlgorithmMultiDof(0, scalars, vectors, matrices, false, false, false);
    Eigen::VectorXd result(m_free.size());
    for (std::size_t i = 0; i < m_free.size(); ++i) result[i] = double(scalars[m_body.getNumDofs() + m_free[i]]);
    return result;
}

Eigen::VectorXd ArticulatedBody::response(int link, const Vec6& impulse) const {
    Eigen::VectorXd result = Eigen::VectorXd::Zero(size());
    if (m_free.empty()) return result;
    const Eigen::VectorXd change = inertia().ldlt().solve(freeColumns(jacobian(link)).transpose() * impulse);
    result(m_free) = change;
    return result;
}

void ArticulatedBody::addVelocity(const Eigen::VectorXd& change) {
    std::vector<btScalar> delta(size());
    for (int i = 0; i < size(); ++i) delta[i] = btScalar(change[i]);
    m_body.applyDeltaVeeMultiDof(delta.data(), btScalar(1));
}

}  // namespace jacket::bullet
