#include "contact/ContactResponse.h"

#include <Eigen/Cholesky>
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
    // The normal may have turned since: with a part of t along it this would not be positive semidefinite.
    const Vec3 t = (plane * slip.direction).normalized();
    damping += slip.limit / std::max(slip.speed, isQuick() ? m_creep : slowest()) * (plane - t * t.transpose());
    load -= slip.limit * t;
}

/// Whether some contact's change is worth another solve.
bool ContactResponse::updateFriction(const CoupledSystem& system) {
    if (++m_frictionRounds > kFrictionRounds) return loosenExcess(system);
    double most = 0.0;
    for (const Touch& touch : m_touches) most = std::max(most, frictionLimit(touch));
    bool isWorthIt = false;
    for (Touch& touch : m_touches) {
        const double limit = frictionLimit(touch);
        if (!touch.active || touch.jammed || limit <= 0.0) continue;
        const double matters = kFrictionChange * std::max(limit, kMinor * most);
        const double change = touch.sticks ? updateSticking(touch, matters, vertexStiffness(system, touch))
                                           : updateSliding(touch, matters, vertexStiffness(system, touch));
        isWorthIt |= change > matters;
    }
    return isWorthIt;
}

/// The same where few rounds are made: whether most of the friction is new, or too much is more than Coulomb allows.
/// Else it follows the last solve's impulses into the next step. `rough`: that solve cannot tell how contacts slide,
/// and only those are looked at that have no friction yet.
bool ContactResponse::updateFrictionQuickly(bool rough) {
    constexpr double kMuch = 0.5, kMuchTooMuch = 0.25;  // of all friction
    if (!rough && ++m_frictionRounds > m_mostFrictionRounds) return false;
    double sum = 0.0, fresh = 0.0, excess = 0.0;
    for (Touch& touch : m_touches) {
        const double limit = frictionLimit(touch);
        if (!touch.active || touch.jammed || limit <= 0.0) continue;
        sum += limit;
        if (!touch.slip.known) fresh += limit;
        excess += std::max(0.0, heldBy(touch).norm() - limit);
        if (!rough || !touch.slip.known) updateCreeping(touch);
    }
    return fresh > kMuch * sum || excess > kMuchTooMuch * sum;
}

/// Where friction is not looked for any more in a step, but what sticks holds by far more than Coulomb allows, as in a
/// sheet that is pulled at and comes loose ring by ring: all of it that holds too much slides from now on. Whether
/// there was any.
bool ContactResponse::loosenExcess(const CoupledSystem& system) {
    constexpr double kFarTooMuch = 10.0;  // of all friction
    double sum = 0.0, excess = 0.0;
    for (const Touch& touch : m_touches) {
        if (!touch.active || touch.jammed) continue;
        const double limit = frictionLimit(touch);
        sum += limit;
        if (touch.sticks) excess += std::max(0.0, heldBy(touch).norm() - limit);
    }
    if (excess <= kFarTooMuch * sum) return false;
    for (Touch& touch : m_touches) {
        const Vec3 held = heldBy(touch);
        const double most = kMostFriction * frictionLimit(touch);
        if (touch.active && !touch.jammed && touch.sticks && held.norm() > most)
            slideFrom(touch, held, vertexStiffness(system, touch));
    }
    return true;
}

/// Friction that held by that impulse, which is more than its limit, gives its limit the same way. `stiffness`: impulse
/// over velocity of its vertices [kg].
void ContactResponse::slideFrom(Touch& touch, const Vec3& held, double stiffness) {
    const double limit = frictionLimit(touch), force = held.norm();
    touch.sticks = false;
    touch.slip.known = true;
    touch.slip.limit = limit;
    touch.slip.direction = -held / force;
    touch.slip.speed = (force - limit) / stiffness;  // what the excess would give these vertices alone
}

/// Coulomb's law with a ramp below the speed of creep: the gradient of a convex function of the sliding velocity.
/// Newton's method on it: sliding friction until that turns the sliding around, then a damping. If this holds by less
/// than the limit and the limit would stop the vertex, it sticks: else vertices that go too far by turns would drive
/// each other on for ever.
void ContactResponse::updateCreeping(Touch& touch) const {
    Slip& slip = touch.slip;
    const double speed = touch.slide.norm(), limit = frictionLimit(touch);
    const bool turns = slip.known && touch.slide.dot(slip.direction) < 0.0;
    if (turns) ++touch.flips;
    const bool wasDamped = slip.known && slip.direction.isZero(0.0);
    const double more = wasDamped ? limit * std::max(0.0, 1.0 - speed / slip.speed) : 0.0;
    const bool sticks = speed * m_input.shells[touch.contact.shell]->masses()[touch.contact.vertices[0]] < more;
    const bool slides = speed > m_creep && !turns && !sticks && touch.flips < kMostFlips;
    slip.known = true;
    slip.limit = limit;
    slip.speed = sticks ? m_creep : std::max(speed, m_creep);
    slip.direction = slides ? Vec3(touch.slide / speed) : Vec3::Zero();
}

/// Damping that was made for slower sliding holds by more than Coulomb's limit, and normal impulses follow it.
void ContactResponse::relaxDamping() {
    for (Touch& touch : m_touches)
        if (touch.active && !touch.sticks && touch.slip.known)
            touch.slip.speed = std::max(touch.slip.speed, touch.slide.norm());
}

/// As if no solve had told its normal impulse yet.
void ContactResponse::dropFriction(Touch& touch) {
    touch.sticks = false;
    touch.slip = {};
}

/// Where contacts have not settled before the last solve, none may hold a body by more friction than there is: a light
/// one would be thrown aside.
void ContactResponse::dropExcessFriction() {
    for (Touch& touch : m_touches) {
        const double force = heldBy(touch).norm(), limit = frictionLimit(touch);
        if (!touch.active || force <= kMostFriction * limit) continue;
        dropFriction(touch);
    }
}

/// A contact slides once more holds it than friction can. Returns the change of its impulse [N s]; `matters`: what is
/// worth another solve [N s]; `stiffness`: impulse over velocity of its vertices [kg].
double ContactResponse::updateSticking(Touch& touch, double matters, double stiffness) const {
    const double limit = frictionLimit(touch);
    const Vec3 held = heldBy(touch);
    const double force = held.norm();
    if (force <= limit + 0.05 * matters) {
        touch.slip.held = held;
        return touch.isRow ? touch.kappa * touch.slide.norm() : 0.0;
    }
    slideFrom(touch, held, stiffness);
    ++touch.flips;
    return std::max(limit, force - limit);
}

/// What a free body of that mass opposes to an impulse at a contact, along unit t [kg].
double ContactResponse::bodyInertia(const Mat6& mass, const Touch& touch, const Vec3& t) {
    const Vec6 along = rowOf(touch, t);
    return 1.0 / along.dot(mass.ldlt().solve(along));
}

/// Whether sliding friction would turn the sliding of a free body around, rather than slow it down: at once if the body
/// is light, to a speed that has nothing to do with the scene's.
bool ContactResponse::wouldTurn(const Touch& touch, double limit, double stiffness) const {
    const double speed = touch.slide.norm();
    if (touch.dynamicBody < 0 || speed == 0.0) return false;
    const double body = bodyInertia(m_input.bodies[touch.contact.body].mass, touch, touch.slide / speed);
    return limit * (1.0 / body + 1.0 / stiffness) > speed;
}

/// A contact sticks once friction turns its sliding around, or would. `stiffness`: impulse over velocity of its
/// vertices [kg].
double ContactResponse::updateSliding(Touch& touch, double matters, double stiffness) const {
    const Slip old = touch.slip;
    Slip& slip = touch.slip;
    slip.known = true;
    slip.limit = frictionLimit(touch);
    slip.speed = touch.slide.norm();
    const bool turns = old.known && touch.slide.dot(old.direction) <= 0.0;
    const bool turnsNext = !old.known && wouldTurn(touch, slip.limit, stiffness);
    if ((turns || turnsNext || slip.speed < slowest()) && touch.flips < kMostFlips) {
        touch.sticks = true;
        slip.held.setZero();
        ++touch.flips;
        return slip.limit;
    }
    const bool damped = turns || touch.flips >= kMostFlips || slip.speed == 0.0;
    slip.direction = damped ? Vec3::Zero() : Vec3(touch.slide / slip.speed);
    if (damped && std::isfinite(old.speed)) slip.speed = std::max(slip.speed, old.speed);
    const double force = heldBy(touch).norm();
    if (force > kMostFriction * slip.limit + matters) return force;  // it slid much faster than was foreseen
    return (slip.limit * slip.direction - (old.known ? old.limit : 0.0) * old.direction).norm();
}

}  // namespace jacket
