#pragma once
#include <Eigen/Cholesky>
#include <map>
#include <span>
#include <vector>

#include "jacket/Contact.h"

namespace jacket {

/// Whether a shell that meets a body there is under it.
inline bool isUnderBody(const Contact& contact, const Vec3& gravity) {
    constexpr double kBelow = 0.5;  // cosine of the angle between the contact's normal and gravity
    return contact.normal.dot(gravity) > kBelow * gravity.norm();
}

/// Masses and free twists of an island's dynamic bodies with those of their rigid contacts and joints that hold. A
/// shell may lift a body off what carries it: the contact then lets go, or the shell would have to move the ground with
/// it.
class BodySupports {
  public:
    /// All contacts and joints hold. `dynamicIndex`: of each body among the dynamic ones, -1: prescribed.
    void begin(std::span<const CoupledBody> bodies, std::span<const BodyCoupling> couplings,
               std::span<const RigidContact> contacts, const std::vector<int>& dynamicIndex);
    /// Lets go of what would have to give more than it can, as contacts that pull, and takes hold of contacts that
    /// close, at the solved twists; true if any changed.
    /// `kick`: what gravity does in the step [m/s]. `keepsSupports`: what does not give way itself goes on holding
    /// bodies, but for motors.
    bool update(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w, double kick, bool keepsSupports = false);
    /// Twists that impulses of shells lead to where contacts push only. The contacts are then as that leaves them.
    const Eigen::Matrix<double, 6, Eigen::Dynamic>& respond(const Eigen::Matrix<double, 6, Eigen::Dynamic>& impulses,
                                                            double kick);
    const std::vector<Mat6>& masses() const { return m_mass; }
    const Mat6& ownMass(int body) const { return m_ownMass[body]; }  ///< without what bears it
    /// Of the bodies alone, with joints and without rigid contacts [J].
    double kineticEnergy(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w) const;
    double lightest(int body) const;  ///< its own, along the axis where it is least [kg]
    const std::vector<Vec6>& freeTwists() const { return m_freeTwist; }
    const std::vector<BodyCoupling>& couplings() const { return m_couplings; }

  private:
    /// Whether a contact holds, and how often it came back in this step. One that does not gives a constant impulse: a
    /// bound of its range, which is none where it may only push.
    struct Hold {
        bool holds = true;
        int returns = 0;
        double given = 0.0;  ///< where it does not hold [N s]
        bool turn(const ImpulseRange& range, double impulse, double slack);
    };
    struct Support {
        int body;  ///< among the dynamic ones
        BodySupport contact;
        Hold hold{};
    };
    struct Pair {
        RigidContact contact;  ///< between dynamic ones
        Hold hold{};
    };

    void addSupport(const RigidContact& pair);
    void add(const Pair& pair, double sign);
    void push(const Pair& pair, double impulse);
    void findLoads(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w);
    void solveFreeTwists();
    void solveTwists(std::vector<Vec6>& momenta);

    std::vector<Support> m_supports;
    std::vector<Pair> m_pairs;
    std::vector<Mat6> m_mass;
    std::vector<Vec6> m_momentum, m_freeTwist;
    std::vector<BodyCoupling> m_couplings;  ///< those that were given, then one for each pair
    std::size_t m_givenCouplings = 0;
    std::vector<Mat6> m_ownMass;  ///< see ownMass
    std::vector<Vec6> m_rhs;      ///< momenta, and then twists
    Eigen::Matrix<double, 6, Eigen::Dynamic> m_response;
    std::vector<double> m_loads;  ///< see findLoads [N s]
    std::vector<int> m_place;     ///< of each body in the common mass matrix, -1: it stands alone
    struct CommonMass {
        Eigen::MatrixXd matrix;
        Eigen::VectorXd momentum;
        Eigen::LLT<Eigen::MatrixXd> factor;
    };
    std::map<int, CommonMass> m_common;  ///< by size: kept for its memory
};

}  // namespace jacket
