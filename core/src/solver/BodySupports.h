#pragma once
#include <span>
#include <vector>

#include "jacket/Contact.h"

namespace jacket {

/// Masses and free twists of an island's dynamic bodies with those of their rigid contacts that hold. A shell may lift
/// a body off what carries it: the contact then lets go, or the shell would have to move the ground with it.
class BodySupports {
  public:
    /// All contacts hold. `dynamicBodies`: indices in `bodies`.
    void begin(std::span<const CoupledBody> bodies, const std::vector<int>& dynamicBodies);
    /// Lets go of contacts that pull and takes hold of those that close, at the solved twists; true if any changed.
    /// `kick`: what gravity does in the step [m/s].
    bool update(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w, double kick);
    const std::vector<Mat6>& masses() const { return m_mass; }
    const std::vector<Vec6>& freeTwists() const { return m_freeTwist; }

  private:
    struct Support {
        int body;  ///< among the dynamic ones
        BodySupport contact;
        bool holds = true;
        int returns = 0;
    };
    std::vector<Support> m_supports;
    std::vector<Mat6> m_mass;
    std::vector<Vec6> m_freeTwist;
};

}  // namespace jacket
