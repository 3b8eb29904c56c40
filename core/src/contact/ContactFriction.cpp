#include "contact/ContactResponse.h"

#include <algorithm>
#include <cmath>

namespace jacket {
namespace {

constexpr int kMostFlips = 3;             // a contact that sticks and slides by turns more often is damped instead
constexpr double kMostFriction = 1.2;     // of what Coulomb allows: more is solved again
constexpr double kFrictionChange = 0.02;  // of a contact's friction: less needs no other solve
constexpr double kMinor = 0.2;            // of the largest friction: what less does is compared with this

}  // namespace

/// Coulomb's law about the last solve's sliding velocity s, with t = s / |s| and T the tangent plane:
///     -limit s / |s|  ~  -limit t - limit / |s| (T - t t^T) s
/// Along t its size is exact whatever the speed; as a damping it would be too large in every step that speeds up.
void ContactResponse::addFriction(const Touch& touch, Mat3& damping, Vec3& load) const {
    const Slip& slip = touch.slip;
    if (!slip.known) return;
    const Mat3 plane = tangential(touch.contact.normal);
    if (touch.sticks) {  // a soft row
        damping += touch.kappa * plane;
        load += slip.held;
        return;
    }
    const Vec3 t = slip.direction;
    damping += slip.limit / std::max(slip.speed, slowest()) * (plane - t * t.transpose());
    load -= slip.limit * t;
}

/// `fresh`: of contacts only that have none yet.
ContactResponse::FrictionChange ContactResponse::updateFriction(const CoupledSystem& system, bool fresh) {
    if (!fresh && ++m_frictionRounds > (isQuick() ? m_mostFrictionRounds : kFrictionRounds)) return {};
    double most = 0.0, sum = 0.0, changed = 0.0, excess = 0.0;
    for (const Touch& touch : m_touches) {
        const double limit = touch.contact.friction * touch.normalImpulse;
        most = std::max(most, limit);
        sum += std::max(limit, 0.0);
    }
    bool isWorthIt = false;
    for (Touch& touch : m_touches) {
        const double limit = touch.contact.friction * touch.normalImpulse;
        if (!touch.active || limit <= 0.0 || (fresh && (touch.slip.known || touch.sticks))) continue;
        const double matters = kFrictionChange * std::max(limit, kMinor * most);
        const double force = (touch.impulse - touch.normalImpulse * touch.contact.normal).norm();
        const double change = touch.sticks ? updateSticking(touch, matters, vertexStiffness(system, touch))
                                           : updateSliding(touch, matters);
        changed += change;
        excess += std::max(0.0, force - limit);
        isWorthIt |= change > matters;
    }
    return isWorthIt ? FrictionChange{changed / sum, excess / sum} : FrictionChange{};
}

/// Where contacts have not settled before the last solve, none may hold a body by more friction than there is: a light
/// one would be thrown aside.
void ContactResponse::dropExcessFriction() {
    for (Touch& touch : m_touches) {
        const double force = (touch.impulse - touch.normalImpulse * touch.contact.normal).norm();
        const double limit = touch.contact.friction * std::max(touch.normalImpulse, 0.0);
        if (!touch.active || force <= kMostFriction * limit) continue;
        touch.sticks = false;
        touch.slip = {};
    }
}

/// A contact slides once more holds it than friction can. Returns the change of its impulse [N s]; `matters`: what is
/// worth another solve [N s]; `stiffness`: impulse over velocity of its vertices [kg].
double ContactResponse::updateSticking(Touch& touch, double matters, double stiffness) const {
    const double limit = touch.contact.friction * touch.normalImpulse;
    const Vec3 held = touch.impulse - touch.normalImpulse * touch.contact.normal;
    const double force = held.norm();
    if (force <= limit + 0.05 * matters) {
        touch.slip.held = held;
        return touch.isRow ? touch.kappa * touch.slide.norm() : 0.0;
    }
    touch.sticks = false;
    ++touch.flips;
    touch.slip.known = true;
    touch.slip.limit = limit;
    touch.slip.direction = -held / force;
    touch.slip.speed = (force - limit) / stiffness;  // what the excess would give these vertices alone
    return std::max(limit, force - limit);
}

/// A contact sticks once friction turns its sliding around.
double ContactResponse::updateSliding(Touch& touch, double matters) const {
    const Slip old = touch.slip;
    Slip& slip = touch.slip;
    slip.known = true;
    slip.limit = touch.contact.friction * touch.normalImpulse;
    slip.speed = touch.slide.norm();
    const bool turns = old.known && touch.slide.dot(old.direction) <= 0.0;
    if ((turns || slip.speed < slowest()) && touch.flips < kMostFlips) {
        touch.sticks = true;
        slip.held.setZero();
        ++touch.flips;
        return slip.limit;
    }
    const bool damped = turns || touch.flips >= kMostFlips || slip.speed == 0.0;
    slip.direction = damped ? Vec3::Zero() : Vec3(touch.slide / slip.speed);
    if (damped && std::isfinite(old.speed)) slip.speed = std::max(slip.speed, old.speed);
    const double force = (touch.impulse - touch.normalImpulse * touch.contact.normal).norm();
    if (force > kMostFriction * slip.limit + matters) return force;  // it slid much faster than was foreseen
    return (slip.limit * slip.direction - (old.known ? old.limit : 0.0) * old.direction).norm();
}

}  // namespace jacket
