#include "StandingBodies.h"

#include <algorithm>

namespace jacket {
namespace {

constexpr double kHeavy = 4.0;    // over all shells' mass
constexpr double kStill = 0.01;   // of what gravity does in a step: what moves slower goes by less than contacts' slop
constexpr double kLifted = 0.01;  // of its weight

}  // namespace

bool StandingBodies::find(const IslandInput& given) {
    const double least = kHeavy * given.shellMass();
    const auto isHeavy = [&](const CoupledBody& body) { return !body.prescribed && body.lightest() > least; };
    if (!given.contacts || std::none_of(given.bodies.begin(), given.bodies.end(), isHeavy)) {
        m_stood.clear();
        return false;
    }
    number(given);
    m_supports.begin(given.bodies, given.couplings, given.rigidContacts, m_dynamicIndex);
    m_bodies.assign(given.bodies.begin(), given.bodies.end());
    m_given = &given;
    for (std::size_t b = 0; b < m_bodies.size(); ++b) {
        const int body = static_cast<int>(b);
        if (isHeavy(m_bodies[b]) && !m_isJoined[b] && stands(given, body) && !isOnShell(given, body))
            m_bodies[b].prescribed = true;
    }
    const auto drops = [&](const RigidContact& c) {
        return dropUnborne(c.a, c.b, c, c.rowA) || dropUnborne(c.b, c.a, c, c.rowB);
    };
    while (std::any_of(given.rigidContacts.begin(), given.rigidContacts.end(), drops)) continue;
    bool isAny = false;
    for (std::size_t b = 0; b < m_bodies.size(); ++b) {
        if (!m_bodies[b].prescribed || given.bodies[b].prescribed) continue;
        m_bodies[b].freeTwist.setZero();
        isAny = true;
    }
    m_input = given;
    m_input.bodies = m_bodies;
    if (!isAny) m_stood.clear();
    return isAny;
}

void StandingBodies::number(const IslandInput& given) {
    m_dynamicIndex.assign(given.bodies.size(), -1);
    m_isJoined.assign(given.bodies.size(), 0);
    int count = 0;
    for (std::size_t b = 0; b < given.bodies.size(); ++b)
        if (!given.bodies[b].prescribed) m_dynamicIndex[b] = count++;
    for (const BodyCoupling& c : given.couplings) m_isJoined[c.a] = m_isJoined[c.b] = 1;
}

/// Whether it does not move although gravity acts.
bool StandingBodies::stands(const IslandInput& given, int body) const {
    const Vec6& twist = m_supports.freeTwists()[m_dynamicIndex[body]];
    const double most = kStill * given.h * given.gravity.norm();
    return twist.head<3>().norm() < most && given.bodies[body].radius * twist.tail<3>().norm() < most;
}

/// Whether a shell lies between a body and what seems to bear it: to a rigid solver a sheet is nothing. None gets there
/// while the body stands.
bool StandingBodies::isOnShell(const IslandInput& given, int body) {
    if (std::find(m_stood.begin(), m_stood.end(), given.bodies[body].key) != m_stood.end()) return false;
    m_poses.clear();
    for (const Shell* shell : given.shells) m_poses.push_back(&shell->positions());
    m_still.assign(given.bodies.size(), Vec6::Zero());
    m_found.clear();
    const double reach = given.h * given.h * given.gravity.norm();
    given.contacts->find({m_poses, m_still, 0.0}, reach, reach, m_found);
    return std::any_of(m_found.begin(), m_found.end(), [&](const Contact& contact) {
        return contact.body == body && isUnderBody(contact, given.gravity);
    });
}

/// What lies on a body that does not stand, or is joined to it, does not either. `row`: the body's. True if that is so.
bool StandingBodies::dropUnborne(int body, int below, const RigidContact& contact, const Vec6& row) {
    if (m_given->bodies[body].prescribed || !m_bodies[body].prescribed || m_bodies[below].prescribed) return false;
    if (!contact.range.pulls() && contact.bears(row, m_given->gravity)) return false;
    m_bodies[body].prescribed = false;
    return true;
}

void StandingBodies::store() {
    m_stood.clear();
    const Vec3 kick = m_input.h * m_input.gravity;
    for (std::size_t b = 0; b < m_bodies.size(); ++b) {
        CoupledBody& given = m_given->bodies[b];
        given.twist = m_bodies[b].twist;
        given.impulse = m_bodies[b].impulse;
        given.motion = m_bodies[b].motion;
        const double lift = -given.impulse.head<3>().dot(kick);
        if (m_bodies[b].prescribed && !given.prescribed && lift < kLifted * given.lightest() * kick.squaredNorm())
            m_stood.push_back(given.key);
    }
}

}  // namespace jacket
