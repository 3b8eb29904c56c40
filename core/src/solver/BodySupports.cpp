#include "solver/BodySupports.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace jacket {
namespace {

constexpr double kPull = 1e-2;   // of a body's weight, or of what is pressed onto its most loaded contact: a contact
                                 // that pulls less may stay for the step
constexpr int kMostReturns = 1;  // a contact that has let go twice stays away: it closes in the bodies' own step

/// Of what holds two bodies together [N s].
double impulseOf(const RigidContact& pair, const Eigen::Matrix<double, 6, Eigen::Dynamic>& w) {
    return pair.weight * (pair.velocity - pair.rowA.dot(w.col(pair.a)) - pair.rowB.dot(w.col(pair.b)));
}

}  // namespace

void BodySupports::begin(std::span<const CoupledBody> bodies, std::span<const BodyCoupling> couplings,
                         std::span<const RigidContact> contacts, const std::vector<int>& dynamicIndex) {
    m_supports.clear();
    m_pairs.clear();
    m_mass.clear();
    m_momentum.clear();
    m_freeTwist.clear();
    m_ownMass.clear();
    m_couplings.clear();
    for (std::size_t b = 0; b < bodies.size(); ++b) {
        if (dynamicIndex[b] < 0) continue;
        for (const BodySupport& contact : bodies[b].supports)
            m_supports.push_back({.body = dynamicIndex[b], .contact = contact});
        m_ownMass.push_back(bodies[b].ownMass());
        m_mass.push_back(bodies[b].mass);
        m_momentum.push_back(bodies[b].mass * bodies[b].freeTwist);
        m_freeTwist.push_back(bodies[b].freeTwist);
    }
    for (const BodyCoupling& c : couplings) {
        if (dynamicIndex[c.a] < 0 || dynamicIndex[c.b] < 0) continue;
        m_couplings.push_back({dynamicIndex[c.a], dynamicIndex[c.b], c.mass});
        m_momentum[dynamicIndex[c.a]] += c.mass * bodies[c.b].freeTwist;
        m_momentum[dynamicIndex[c.b]] += c.mass.transpose() * bodies[c.a].freeTwist;
    }
    m_givenCouplings = m_couplings.size();
    for (RigidContact contact : contacts) {
        contact.a = dynamicIndex[contact.a];
        contact.b = dynamicIndex[contact.b];
        if (contact.a < 0 || contact.b < 0) {
            addSupport(contact);
            continue;
        }
        m_pairs.push_back({contact});
        m_couplings.push_back({contact.a, contact.b});
        add(m_pairs.back(), 1.0);
    }
    if (!m_pairs.empty()) solveFreeTwists();
}

/// One body of the pair stands still: it bears the other.
void BodySupports::addSupport(const RigidContact& pair) {
    const int body = std::max(pair.a, pair.b);
    if (body < 0) return;
    const Vec6& row = pair.a < 0 ? pair.rowB : pair.rowA;
    m_supports.push_back({.body = body, .contact = {row, pair.velocity, pair.weight, pair.range}});
    m_mass[body] += pair.weight * row * row.transpose();
    m_momentum[body] += pair.weight * pair.velocity * row;
    m_freeTwist[body] = m_mass[body].ldlt().solve(m_momentum[body]);
}

/// The term of the pair that m_couplings has at the same place, or takes it away.
void BodySupports::add(const Pair& pair, double sign) {
    const auto& [a, b, rowA, rowB, weight, velocity, range] = pair.contact;
    m_momentum[a] += sign * weight * velocity * rowA;
    m_momentum[b] += sign * weight * velocity * rowB;
    m_mass[a] += sign * weight * rowA * rowA.transpose();
    m_mass[b] += sign * weight * rowB * rowB.transpose();
    m_couplings[m_givenCouplings + static_cast<std::size_t>(&pair - m_pairs.data())].mass +=
        sign * weight * rowA * rowB.transpose();
}

/// Gives both bodies an impulse along the pair's rows.
void BodySupports::push(const Pair& pair, double impulse) {
    m_momentum[pair.contact.a] += impulse * pair.contact.rowA;
    m_momentum[pair.contact.b] += impulse * pair.contact.rowB;
}

/// Of bodies that couplings join. Only where there are pairs; free twists that were given agree with the given
/// couplings.
void BodySupports::solveFreeTwists() {
    m_rhs = m_momentum;
    solveTwists(m_rhs);
    for (std::size_t b = 0; b < m_mass.size(); ++b)
        if (m_place[b] >= 0) m_freeTwist[b] = m_rhs[b];
}

/// In place: of bodies that couplings join by their common mass matrix, of the others by their own.
void BodySupports::solveTwists(std::vector<Vec6>& momenta) {
    std::vector<int>& place = m_place;
    place.assign(m_mass.size(), -1);
    int size = 0;
    const auto take = [&](int body) {
        if (place[body] >= 0) return;
        place[body] = size;
        size += 6;
    };
    for (const BodyCoupling& c : m_couplings) take(c.a), take(c.b);
    auto& [matrix, momentum, factor] = m_common[size];
    matrix.setZero(size, size);
    momentum.resize(size);
    for (std::size_t b = 0; b < m_mass.size(); ++b) {
        if (place[b] < 0) continue;
        matrix.block<6, 6>(place[b], place[b]) = m_mass[b];
        momentum.segment<6>(place[b]) = momenta[b];
    }
    for (const BodyCoupling& c : m_couplings) {
        matrix.block<6, 6>(place[c.a], place[c.b]) += c.mass;
        matrix.block<6, 6>(place[c.b], place[c.a]) += c.mass.transpose();
    }
    factor.compute(matrix);
    factor.solveInPlace(momentum);
    for (std::size_t b = 0; b < m_mass.size(); ++b)
        momenta[b] = place[b] >= 0 ? Vec6(momentum.segment<6>(place[b])) : Vec6(m_mass[b].ldlt().solve(momenta[b]));
}

double BodySupports::lightest(int body) const {
    return m_ownMass[body].diagonal().head<3>().minCoeff();
}

double BodySupports::kineticEnergy(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w) const {
    double sum = 0.0;
    for (std::size_t b = 0; b < m_ownMass.size(); ++b) {
        const auto twist = w.col(static_cast<Eigen::Index>(b));
        sum += 0.5 * twist.dot(m_ownMass[b] * twist);
    }
    for (std::size_t c = 0; c < m_givenCouplings; ++c)
        sum += w.col(m_couplings[c].a).dot(m_couplings[c].mass * w.col(m_couplings[c].b));
    return sum;
}

/// `impulse`: what it gives if it holds.
bool BodySupports::Hold::turn(const ImpulseRange& range, double impulse, double slack) {
    const bool pullsTooMuch = impulse < range.least - slack;
    if (holds) {
        if (!pullsTooMuch && impulse <= range.most + slack) return false;
        given = pullsTooMuch ? range.least : range.most;
    } else {
        const bool isBack = given == range.least ? impulse > given : impulse < given;
        if (!isBack || returns == kMostReturns) return false;
        ++returns;
    }
    holds = !holds;
    return true;
}

/// Of each body what it rests on, or rests on it, bears most [N s]. A solve is only as exact as its largest impulses
/// let it be: what it leaves of them is no pull.
void BodySupports::findLoads(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w) {
    std::vector<double>& most = m_loads;
    most.assign(m_mass.size(), 0.0);
    const auto loadOf = [](const ImpulseRange& range, double impulse) {
        return range.pulls() ? std::abs(impulse) : impulse;
    };
    for (const auto& [body, contact, hold] : m_supports)
        if (hold.holds) most[body] = std::max(most[body], loadOf(contact.range, contact.impulseOn(w.col(body))));
    for (const auto& [contact, hold] : m_pairs) {
        if (!hold.holds) continue;
        const double load = loadOf(contact.range, impulseOf(contact, w));
        most[contact.a] = std::max(most[contact.a], load);
        most[contact.b] = std::max(most[contact.b], load);
    }
}

bool BodySupports::update(const Eigen::Matrix<double, 6, Eigen::Dynamic>& w, double kick, bool keepsSupports) {
    bool changed = false;
    findLoads(w);
    const std::vector<double>& load = m_loads;
    for (Support& support : m_supports) {
        const auto& [row, velocity, weight, range] = support.contact;
        if (keepsSupports && !range.isBounded()) continue;
        const double impulse = support.contact.impulseOn(w.col(support.body));
        const double slack = kPull * std::max(lightest(support.body) * kick, load[support.body]);
        if (!support.hold.turn(range, impulse, slack)) continue;
        const double sign = support.hold.holds ? 1.0 : -1.0;
        m_mass[support.body] += sign * weight * row * row.transpose();
        m_momentum[support.body] += sign * (weight * velocity - support.hold.given) * row;
        m_freeTwist[support.body] = m_mass[support.body].ldlt().solve(m_momentum[support.body]);
        changed = true;
    }
    for (Pair& pair : m_pairs) {
        const int a = pair.contact.a, b = pair.contact.b;
        const double slack = kPull * std::max(std::min(lightest(a), lightest(b)) * kick, std::min(load[a], load[b]));
        if (!pair.hold.turn(pair.contact.range, impulseOf(pair.contact, w), slack)) continue;
        const double sign = pair.hold.holds ? 1.0 : -1.0;
        add(pair, sign);
        push(pair, -sign * pair.hold.given);
        changed = true;
    }
    if (changed && !m_pairs.empty()) solveFreeTwists();
    return changed;
}

const Eigen::Matrix<double, 6, Eigen::Dynamic>& BodySupports::respond(
    const Eigen::Matrix<double, 6, Eigen::Dynamic>& impulses, double kick) {
    constexpr int kMostRounds = 8;
    m_response.resize(6, impulses.cols());
    for (int round = 0; round < kMostRounds; ++round) {
        m_rhs = m_momentum;
        for (std::size_t b = 0; b < m_rhs.size(); ++b) m_rhs[b] += impulses.col(static_cast<Eigen::Index>(b));
        solveTwists(m_rhs);
        for (std::size_t b = 0; b < m_rhs.size(); ++b) m_response.col(static_cast<Eigen::Index>(b)) = m_rhs[b];
        if (!update(m_response, kick)) break;
    }
    return m_response;
}

}  // namespace jacket
