#include "solver/BodySupports.h"

#include <Eigen/Cholesky>

namespace jacket {

void BodySupports::begin(std::span<const CoupledBody> bodies, const std::vector<int>& dynamicBodies) {
    m_supports.clear();
    m_mass.clear();
    m_freeTwist.clear();
    for (const int b : dynamicBodies) {
        for (const BodySupport& contact : bodies[b].supports)
            m_supports.push_back({.body = static_cast<int>(m_mass.size()), .contact = contact});
        m_mass.push_back(bodies[b].mass);
        m_freeTwist.push_back(bodies[b].freeTwist);
    }
}

bool BodySupports::update(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w, double kick) {
    constexpr double kPull = 1e-2;   // of a body's weight: a contact that pulls less may stay for the step
    constexpr int kMostReturns = 1;  // a contact that has let go twice stays away: it closes in the bodies' own step
    bool changed = false;
    for (Support& support : m_supports) {
        const auto& [row, velocity, weight] = support.contact;
        const double opening = row.dot(w.col(support.body)) - velocity;
        const double least = m_mass[support.body].diagonal().head<3>().minCoeff() * kPull * kick / weight;
        const bool turns = support.holds ? opening > least : opening < 0.0;
        if (!turns || (!support.holds && support.returns == kMostReturns)) continue;
        const double sign = support.holds ? -1.0 : 1.0;
        Mat6& mass = m_mass[support.body];
        Vec6& freeTwist = m_freeTwist[support.body];
        const Vec6 momentum = mass * freeTwist + sign * weight * velocity * row;
        mass += sign * weight * row * row.transpose();
        freeTwist = mass.ldlt().solve(momentum);
        if (!support.holds) ++support.returns;
        support.holds = !support.holds;
        changed = true;
    }
    return changed;
}

}  // namespace jacket
