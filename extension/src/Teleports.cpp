#include "Teleports.h"

#include <algorithm>

#include "jacket/bullet/ShellWorld.h"

namespace jacket::bullet {
namespace {

bool isPinnedOrGuided(const Shell& shell) {
    if (shell.pinCount() > 0) return true;
    for (int i = 0; i < shell.vertexCount(); ++i)
        if (shell.isGuided(i)) return true;
    return false;
}

/// Whether a shell can be so far from the origin without rounding deforming it.
bool isInReach(const Shell& shell, const Frame& leap) {
    constexpr double kEdges = 1e9;
    return leap.translation().norm() < kEdges * shell.meanEdge();
}

}  // namespace

Teleports::Outcome Teleports::follow(ShellBody& shell) {
    Outcome outcome;
    std::optional<Frame> leap = leapOf(shell);
    if (!leap) leap = offsetOf(shell);
    if (leap && isInReach(shell.shell(), *leap)) {
        move(shell, *leap);
        outcome.hasMoved = true;
    }
    const auto letGo = std::erase_if(shell.m_anchors, [&](const auto& anchor) { return isLost(shell, anchor); });
    outcome.letGo = static_cast<int>(letGo);
    if (letGo > 0) shell.activate();
    return outcome;
}

void Teleports::notePoses(ShellBody& shell) {
    for (auto& anchor : shell.m_anchors) anchor.pose = anchor.body->getWorldTransform();
}

/// Of the first body that is where it is no longer, if such bodies alone hold the shell.
std::optional<Frame> Teleports::leapOf(const ShellBody& shell) {
    const auto& anchors = shell.m_anchors;
    const auto lost =
        std::find_if(anchors.begin(), anchors.end(), [&](const auto& anchor) { return isLost(shell, anchor); });
    if (lost == anchors.end() || isPinnedOrGuided(shell.shell())) return std::nullopt;
    const bool isHeld = std::any_of(anchors.begin(), anchors.end(), [&](const auto& anchor) {
        return anchor.body != lost->body && !isLost(shell, anchor);
    });
    return isHeld ? std::nullopt : leapOf(*lost);
}

/// From where the last step left the kinematic body that holds it to where that begins its motion: Bullet takes it to
/// the end of all substeps in the first, with the velocity that takes it there in all. A shell that nothing else holds
/// and that is yet to be solved for this motion goes along; what is tied alone would tear at it.
std::optional<Frame> Teleports::offsetOf(const ShellBody& body) {
    constexpr double kShare = 0.1;  // of a substep's motion: more than rounding
    const auto& anchors = body.m_anchors;
    if (anchors.empty() || body.m_hasVelocity || body.isAsleep() || isPinnedOrGuided(body.shell())) return std::nullopt;
    const ShellBody::Anchor& first = anchors.front();
    const auto isOfFirst = [&](const auto& anchor) { return anchor.body == first.body; };
    if (!isLed(*first.body) || !std::all_of(anchors.begin(), anchors.end(), isOfFirst)) return std::nullopt;
    const Frame start = m_obstacles.startOf(*first.body, m_h);
    const Vec3 now = fromBullet(first.body->getWorldTransform().getOrigin());
    const Vec3 place = start * fromBullet(first.local);
    const double motion = (now - start.translation()).norm();
    const double gap = (place - body.shell().positions().col(first.vertex)).norm();
    if (motion == 0.0 || !(gap > kShare * motion)) return std::nullopt;
    return start * fromBullet(first.pose).inverse(Eigen::Isometry);
}

/// How its body was taken from where the last step left it to where it begins its motion, if that was a teleport. Free
/// bodies may have been stopped on their way, or led round something: they stray by no more than they were to move.
std::optional<Frame> Teleports::leapOf(const ShellBody::Anchor& anchor) {
    const btCollisionObject& body = *anchor.body;
    const Frame before = fromBullet(anchor.pose), start = m_obstacles.startOf(body, m_h);
    const double way = (start.translation() - before.translation()).norm();
    const double motion = (fromBullet(body.getWorldTransform().getOrigin()) - start.translation()).norm();
    const bool isSent = !mayBePushed(body) ? motion == 0.0 : way > motion;
    if (!isSent || !isTeleport(body, way, m_h)) return std::nullopt;
    return start * before.inverse(Eigen::Isometry);
}

/// Whether its body was teleported, and the vertex is farther from it than it could be taken along. (The user may have
/// put the shell there.)
bool Teleports::isLost(const ShellBody& shell, const ShellBody::Anchor& anchor) {
    if (!leapOf(anchor)) return false;
    const Vec3 place = m_obstacles.startOf(*anchor.body, m_h) * fromBullet(anchor.local);
    return (place - shell.shell().positions().col(anchor.vertex)).norm() >= kTeleportSpeed * m_h;
}

void Teleports::move(ShellBody& body, const Frame& by) {
    Shell& shell = body.m_shell;
    shell.setPositions((by.linear() * shell.positions()).colwise() + by.translation());
    shell.setVelocities(by.linear() * shell.velocities());
    body.forgetSolvedVelocity();
    body.activate();
}

}  // namespace jacket::bullet
