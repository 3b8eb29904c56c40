#pragma once
#include <Eigen/Core>
#include <vector>

#include "Convert.h"
#include "jacket/Types.h"

class btMultiBody;

namespace jacket::bullet {

/// The joint-space dynamics of a btMultiBody at its present pose, in double precision. Generalised velocities come in
/// Bullet's order: angular and linear velocity of the base in the world's axes, then the joints'. A fixed or kinematic
/// base and kinematic links keep theirs whatever acts on them; the others are free.
class ArticulatedBody {
  public:
    using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

    explicit ArticulatedBody(btMultiBody& body);
    btMultiBody& body() const { return m_body; }
    int size() const { return static_cast<int>(m_velocity.size()); }
    const std::vector<int>& freeVelocities() const { return m_free; }
    /// Twist (velocity of the centre of mass, angular velocity) of a link, -1 being the base, per generalised velocity.
    const Jacobian& jacobian(int link) const { return m_jacobians[link + 1]; }
    const Vec3& centre(int link) const { return m_frames[link + 1].position; }
    Vec6 twist(int link) const { return jacobian(link) * m_velocity; }
    /// Generalised velocities as Bullet holds them.
    const Eigen::VectorXd& velocity() const { return m_velocity; }
    /// Kinetic energy's matrix over the free velocities, positive definite.
    Eigen::MatrixXd inertia() const;
    /// Columns of `matrix` that belong to free velocities.
    Eigen::MatrixXd freeColumns(const Eigen::MatrixXd& matrix) const { return matrix(Eigen::all, m_free); }
    /// Of the free velocities under the forces and joint torques as they stand, gravity included if Bullet has added
    /// it.
    Eigen::VectorXd acceleration() const;
    /// Change of all generalised velocities by an impulse and angular impulse about a link's centre of mass.
    Eigen::VectorXd response(int link, const Vec6& impulse) const;
    /// Adds to Bullet's generalised velocities.
    void addVelocity(const Eigen::VectorXd& change);

  private:
    struct LinkFrame {
        Mat3 rotation;  ///< link to world
        Vec3 position;  ///< centre of mass [m]
    };
    void placeLinks();
    void fillJacobians();
    Mat6 linkMass(int link) const;

    btMultiBody& m_body;
    Eigen::VectorXd m_velocity;
    std::vector<int> m_free;
    std::vector<LinkFrame> m_frames;    ///< the base first
    std::vector<Jacobian> m_jacobians;  ///< likewise
};

}  // namespace jacket::bullet
