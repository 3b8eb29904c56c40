#include <algorithm>

#include "contact/ContactResponse.h"

namespace jacket {
namespace {

constexpr double kBounceError = 0.005;  // of its speed: how much slower a soft row may leave

}  // namespace

/// Newton's law of impact: the relative normal speed that a contact has to end the step with if it is hit in it, 0 if
/// it does not bounce. What is held leaves as it is told [m/s].
double ContactResponse::leavingSpeed(const Touch& touch) const {
    const Contact& c = touch.contact;
    if (!(c.restitution > 0.0) || (touch.dynamicBody < 0 && isHeld(c))) return 0.0;
    Vec3 u = -carriedOf(touch);
    if (touch.dynamicBody >= 0) u -= pointVelocity(m_input.bodies[c.body].startTwist, touch.arm);
    for (int a = 0; a < 3; ++a) u += c.weights[a] * m_input.shells[c.shell]->velocities().col(c.vertices[a]);
    const double closing = -u.dot(c.normal);
    return closing > m_input.restingSpeed ? c.restitution * closing : 0.0;
}

bool ContactResponse::isAnyBouncy() const {
    return std::any_of(m_touches.begin(), m_touches.end(), [&](const Touch& t) { return leavingSpeed(t) > 0.0; });
}

/// Contacts that press once they are closed without restitution are those that are hit: they leave with their share of
/// the speed that they came with. This comes in the step that would close them, from where they are then: a step later
/// that speed would be gone. Whether some do so from now on, or are still too slow.
bool ContactResponse::bounce(const IslandVelocities& solved) {
    bool changed = false;
    for (Touch& touch : m_touches) {
        if (!touch.active || !(touch.contact.restitution > 0.0)) continue;
        const double speed = leavingSpeed(touch);
        if (touch.bounces) {
            const double missing = speed - relativeVelocity(touch, solved).dot(touch.contact.normal);
            changed |= touch.isRow && !touch.isPinched && missing > kBounceError * speed;
        } else if (touch.normalImpulse > 0.0 && speed > touch.target && speed > 0.0 && !touch.jammed) {
            touch.bounces = true;
            touch.target = speed;
            touch.missed = 0.0;
            changed = true;
        }
    }
    return changed;
}

}  // namespace jacket
