#include "StepParts.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <algorithm>
#include <utility>

namespace jacket {
namespace {

Mat3 turnOf(const Vec6& motion) {
    const Vec3 rotation = motion.tail<3>();
    return Eigen::AngleAxisd(rotation.norm(), rotation.normalized()).toRotationMatrix();
}

/// Where a point of a body is once that has moved.
Vec3 carriedAlong(const Vec3& point, const CoupledBody& body) {
    return body.position + body.motion.head<3>() + turnOf(body.motion) * (point - body.position);
}

/// At the end of a part of a step, from how it moves when that begins. In the whole step it is `given`.
Vec6 freeTwistOf(const CoupledBody& given, const Vec6& startTwist, double share) {
    if (given.supports.empty()) return startTwist + share * (given.freeTwist - given.startTwist);
    const Mat6 own = given.ownMass();
    const Vec6 ofSupports = given.supportMomentum();
    const Vec6 byForces = given.mass * given.freeTwist - ofSupports - own * given.startTwist;
    return given.mass.ldlt().solve(own * startTwist + share * byForces + ofSupports);
}

}  // namespace

bool StepParts::areAllowed(const IslandInput& whole) {
    const auto isPrescribed = [](const CoupledBody& body) { return body.prescribed; };
    return whole.contacts && !whole.inOnePiece &&
           (whole.couplings.empty() || std::all_of(whole.bodies.begin(), whole.bodies.end(), isPrescribed));
}

StepParts::StepParts(const IslandInput& whole, const StepReport& failed)
    : m_whole(whole),
      m_part(whole),
      m_bodies(whole.bodies.begin(), whole.bodies.end()),
      m_anchors(whole.anchors.begin(), whole.anchors.end()) {
    for (const Shell* shell : whole.shells) m_start.push_back({shell->m_x, shell->m_v, shell->m_pinTarget});
    for (const CoupledBody& body : m_bodies) m_supports.emplace_back(body.supports.begin(), body.supports.end());
    for (std::size_t b = 0; b < m_bodies.size(); ++b) m_bodies[b].supports = m_supports[b];
    m_rigidContacts.assign(whole.rigidContacts.begin(), whole.rigidContacts.end());
    m_part.bodies = m_bodies;
    m_part.anchors = m_anchors;
    m_part.rigidContacts = m_rigidContacts;
    for (CoupledBody& body : whole.bodies) body.impulse = body.motion = Vec6::Zero();
    for (Anchor& anchor : whole.anchors) anchor.impulse.setZero();
    shorten(failed);
}

/// The shells' positions are again those of the start, their velocities those of the end.
StepParts::~StepParts() {
    for (std::size_t k = 0; k < m_start.size(); ++k) {
        Shell& shell = *m_whole.shells[k];
        shell.m_pinTarget = m_start[k].pinTargets;
        shell.m_y.setZero();
        if (m_sum.finite)
            shell.m_y = shell.m_x - m_start[k].x - m_whole.h * shell.m_v;
        else
            shell.m_v = m_start[k].v;
        shell.m_x.swap(m_start[k].x);
        if (shell.m_lastH == 0.0) continue;  // not of BDF2
        shell.m_lastX = shell.m_x;
        shell.m_lastV = m_start[k].v;
        shell.m_lastH = m_sum.finite ? m_whole.h : 0.0;
    }
}

void StepParts::shorten(const StepReport& failed) {
    m_sum.addCosts(failed);
    m_length /= 2;
    begin();
}

/// What the whole step does to pins and free bodies, by the part. A body's inertia stays as it was at the start.
void StepParts::begin() {
    m_part.h = m_whole.h * m_length / kTicks;
    const double share = double(m_length) / (kTicks - m_ticks), part = m_part.h / m_whole.h;
    for (std::size_t b = 0; b < m_bodies.size(); ++b) {
        const CoupledBody& given = m_whole.bodies[b];
        if (given.prescribed) continue;
        m_bodies[b].freeTwist = freeTwistOf(given, m_bodies[b].startTwist, part);
        for (std::size_t i = 0; i < m_supports[b].size(); ++i)
            m_supports[b][i].range = given.supports[i].range.part(part);
    }
    for (std::size_t i = 0; i < m_rigidContacts.size(); ++i)
        m_rigidContacts[i].range = m_whole.rigidContacts[i].range.part(part);
    for (std::size_t k = 0; k < m_start.size(); ++k) {
        Shell& shell = *m_whole.shells[k];
        for (auto& [vertex, target] : shell.m_pinTarget)
            target = shell.m_x.col(vertex) + share * (m_start[k].pinTargets.at(vertex) - shell.m_x.col(vertex));
    }
}

void StepParts::add(const StepReport& solved) {
    m_sum.addCosts(solved);
    m_sum.residual = solved.residual;
    m_sum.deepestGap = solved.deepestGap;
    m_sum.converged = m_sum.converged && solved.converged;
    m_sum.settled = m_sum.settled && solved.settled;
    m_sum.finite = solved.finite;
    m_sum.limited = m_sum.limited || solved.limited;
    m_sum.passed = m_sum.passed || solved.passed;
    m_sum.mayPass = m_sum.mayPass || solved.mayPass;
    if (!solved.finite) {
        m_sum.contacts.clear();
        return;
    }
    for (const ContactImpulse& one : solved.contacts) addContact(one);
    for (Shell* shell : m_whole.shells) {
        shell->m_x += m_part.h * shell->m_v + shell->m_y;
        shell->m_y.setZero();
    }
    moveBodies();
    m_ticks += m_length;
    if (m_ticks < kTicks) begin();
}

void StepParts::moveBodies() {
    for (std::size_t i = 0; i < m_anchors.size(); ++i) {
        Anchor& anchor = m_anchors[i];
        anchor.point = carriedAlong(anchor.point, m_bodies[anchor.body]);
        m_whole.anchors[i].impulse += anchor.impulse;
    }
    std::vector<Vec6> twists;
    for (std::size_t b = 0; b < m_bodies.size(); ++b) {
        CoupledBody &body = m_bodies[b], &whole = m_whole.bodies[b];
        twists.push_back(body.twist);
        body.position += body.motion.head<3>();
        if (!body.prescribed) body.startTwist = body.twist;
        const Eigen::AngleAxisd turn(Mat3(turnOf(body.motion) * turnOf(whole.motion)));
        whole.motion.head<3>() += body.motion.head<3>();
        whole.motion.tail<3>() = turn.angle() * turn.axis();
        whole.twist = body.twist;
        whole.impulse += body.impulse;
    }
    m_whole.contacts->advance(twists, m_part.h);
}

/// Contacts of several parts are one: where it was last, with the sum of their impulses and the mean of their slips.
void StepParts::addContact(const ContactImpulse& one) {
    const auto key = std::tuple(one.contact.shell, one.contact.body, one.contact.feature);
    const auto [known, fresh] = m_contacts.try_emplace(key, m_sum.contacts.size());
    if (fresh) {
        m_sum.contacts.push_back(one);
        return;
    }
    ContactImpulse& sum = m_sum.contacts[known->second];
    const ContactImpulse before = std::exchange(sum, one);
    const double share = before.impulse.norm() / (before.impulse.norm() + one.impulse.norm());
    sum.impulse += before.impulse;
    sum.slip += share * (before.slip - one.slip);
}

}  // namespace jacket
