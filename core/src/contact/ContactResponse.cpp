#include "contact/ContactResponse.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace jacket {
namespace {

constexpr double kNone = -std::numeric_limits<double>::infinity();
constexpr double kRowPenalty = 10.0;  // penalty of a soft row over the stiffness of its vertices: a round leaves < 1/10
constexpr double kAlteration = 0.2;   // share of a penetration that a step takes back, and share of an edge at most
constexpr double kMostOffset =
    0.15;  // of an edge: how far vertices are lifted off a curved body for their chords' sake
constexpr double kOffsetDecay = 0.998;  // a step: a lift that is no longer needed goes away
constexpr double kPull = 1e-3;          // of the largest impulse: a contact that pulls less may stay for the step
constexpr int kPatience = 10;           // steps before a contact that slid is tried as a sticking one again
constexpr int kFrictionRounds = 2;      // then the lagged friction of the last round stands
constexpr int kFreezeRound = 7;         // from here on normals stay: a triangle that tips to and fro would never settle
constexpr int kMostChanges = 10;        // a contact that flips more often than this stays as it is

double meanEdge(const Shell& shell) {
    double sum = 0.0;
    for (const auto& e : shell.mesh().edges())
        sum += (shell.restPositions().col(e.v0) - shell.restPositions().col(e.v1)).norm();
    return sum / static_cast<double>(std::max<std::size_t>(1, shell.mesh().edges().size()));
}

Mat3 tangential(const Vec3& n) {
    return Mat3::Identity() - n * n.transpose();
}

}  // namespace

ContactResponse::Key ContactResponse::keyOf(const Contact& c) const {
    return {m_input.shells[c.shell], m_input.bodies[c.body].key, c.feature};
}

void ContactResponse::place(Touch& touch, const Contact& contact) const {
    const CoupledBody& body = m_input.bodies[contact.body];
    Vec3 point = Vec3::Zero();
    for (int a = 0; a < 3; ++a)
        point += contact.weights[a] * m_input.shells[contact.shell]->positions().col(contact.vertices[a]);
    touch.contact = contact;
    touch.arm = point - body.position;
    touch.dynamicBody = m_dynamicIndex[contact.body];
    touch.carried = body.prescribed ? pointVelocity(body.freeTwist, touch.arm) : Vec3::Zero();
}

ContactResponse::Touch ContactResponse::makeTouch(const Contact& contact) const {
    Touch touch;
    place(touch, contact);
    return touch;  // frictionless at first: its normal impulse is not known yet
}

void ContactResponse::begin(const IslandInput& input, const Numbering& numbering, const Points& expected, Points& y) {
    m_input = input;
    m_expected = &expected;
    m_y = &y;
    m_offsets = numbering.offsets;
    m_dynamicIndex = numbering.dynamicIndex;
    m_stepOf = numbering.stepOf;
    m_touches.clear();
    m_index.clear();
    m_deepestGap = 0.0;
    m_frictionRounds = 0;
    m_held.assign(y.cols(), 0);
    m_filterOf.assign(y.cols(), -1);
    m_edge.clear();
    double shortest = 1e300, speed = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        for (int i = 0; i < shell.vertexCount(); ++i) m_held[m_offsets[k] + i] = shell.isPinned(i) || shell.isGuided(i);
        m_edge.push_back(meanEdge(shell));
        shortest = std::min(shortest, m_edge.back());
        speed = std::max(speed, shell.velocities().colwise().norm().maxCoeff());
    }
    for (const auto& anchor : input.anchors) m_held[m_offsets[anchor.shell] + anchor.vertex] = 1;
    if (!input.contacts) return;

    m_vertexSlop = std::min(5e-5, 1e-3 * shortest);
    m_faceSlop = std::min(2e-4, 1e-2 * shortest);
    for (const auto& body : input.bodies)
        speed = std::max(speed, body.freeTwist.head<3>().norm() + body.freeTwist.tail<3>().norm() * body.radius);
    const double reach = 2.0 * input.h * (speed + input.h * input.gravity.norm()) + 10.0 * m_vertexSlop;

    std::vector<const Points*> positions;
    for (const Shell* shell : input.shells) positions.push_back(&shell->positions());
    const std::vector<Vec6> still(input.bodies.size(), Vec6::Zero());
    m_found.clear();
    input.contacts->find({positions, still, 0.0}, reach, m_memory.empty() ? kNone : 10.0 * m_vertexSlop, m_found);
    for (const Contact& contact : m_found) {
        Touch touch = makeTouch(contact);
        const auto remembered = m_memory.find(keyOf(contact));
        if (!contact.isVertex() && remembered == m_memory.end())
            continue;  // found at the end of the step if it matters
        if (remembered != m_memory.end()) touch.offset = kOffsetDecay * remembered->second.offset;
        touch.contact.gap -= touch.offset;
        touch.target = -std::max(touch.contact.gap, 0.0) / input.h;
        touch.allowedGap = std::min(touch.contact.gap, 0.0);
        if (remembered != m_memory.end()) {
            touch.lambda = remembered->second.impulse * input.h / m_memoryStep;
            touch.sticks = remembered->second.sticks;
            touch.patience = std::max(0, remembered->second.patience - 1);
            touch.drag = remembered->second.drag;
            touch.active = touch.contact.gap < 10.0 * m_vertexSlop || timeOfTouch(touch) <= input.h;
        } else {
            touch.active = timeOfTouch(touch) <= input.h;
        }
        if (touch.contact.gap < 0.0) alter(touch, y);
        m_index[keyOf(contact)] = static_cast<int>(m_touches.size());
        m_touches.push_back(touch);
    }
    keepEarliest();
}

/// The first vertices to meet a free body will slow it down, and the others may never come to touch it: held all
/// together they would be dragged to its surface, and a light body thrown about. Those that do touch are found in later
/// rounds.
void ContactResponse::keepEarliest() {
    std::vector<double> earliest(m_input.bodies.size(), 2.0 * m_input.h);
    const auto isRemembered = [&](const Touch& t) { return m_memory.count(keyOf(t.contact)) > 0; };
    for (const Touch& touch : m_touches)
        if (touch.active && touch.dynamicBody >= 0)
            earliest[touch.contact.body] =
                std::min(earliest[touch.contact.body], isRemembered(touch) ? 0.0 : timeOfTouch(touch));
    for (Touch& touch : m_touches)
        if (touch.active && touch.dynamicBody >= 0 && !isRemembered(touch))
            touch.active = timeOfTouch(touch) <= earliest[touch.contact.body] + 0.02 * m_input.h;
}

/// When a contact closes if nothing else happens, from the start of the step; infinite if it does not [s].
double ContactResponse::timeOfTouch(const Touch& touch) const {
    const CoupledBody& body = m_input.bodies[touch.contact.body];
    Vec3 velocity = -pointVelocity(body.freeTwist, touch.arm);
    for (int a = 0; a < 3; ++a) velocity += touch.contact.weights[a] * m_expected->col(globalVertex(touch.contact, a));
    const double closing = -velocity.dot(touch.contact.normal);
    return closing > 0.0 ? std::max(touch.contact.gap, 0.0) / closing : std::numeric_limits<double>::infinity();
}

void ContactResponse::alter(Touch& touch, Points& y) const {
    const Contact& c = touch.contact;
    const double by = std::min(-kAlteration * c.gap, kAlteration * m_edge[c.shell]);
    for (int a = 0; a < 3; ++a)
        if (c.weights[a] > 0.0 && m_held[globalVertex(c, a)]) return;
    const double spread = c.weights.squaredNorm();
    for (int a = 0; a < (c.isVertex() ? 1 : 3); ++a) {
        auto column = y.col(globalVertex(c, a));
        const double missing =
            by * c.weights[a] / spread - column.dot(c.normal);  // contacts that share a vertex share y
        if (missing > 0.0) column += missing * c.normal;
    }
    touch.allowedGap = std::min(0.0, c.gap + by);
}

std::vector<VertexConstraint> ContactResponse::holdConstraints() const {
    std::vector<VertexConstraint> constraints;
    for (std::size_t k = 0; k < m_input.shells.size(); ++k) {
        const Shell& shell = *m_input.shells[k];
        if (shell.pinCount() == 0) continue;
        for (int i = 0; i < shell.vertexCount(); ++i) {
            if (!shell.isPinned(i) && !shell.isGuided(i)) continue;
            VertexConstraint c{.vertex = m_offsets[k] + i};
            c.free = shell.freedom(i);
            if (shell.isPinned(i))
                c.carried = (shell.pinTarget(i) - shell.positions().col(i) - m_y->col(m_offsets[k] + i)) / m_stepOf[k];
            constraints.push_back(c);
        }
    }
    for (const auto& anchor : m_input.anchors) {
        const Shell& shell = *m_input.shells[anchor.shell];
        if (shell.isPinned(anchor.vertex)) continue;
        const CoupledBody& body = m_input.bodies[anchor.body];
        VertexConstraint c{.vertex = m_offsets[anchor.shell] + anchor.vertex, .body = m_dynamicIndex[anchor.body]};
        c.arm = anchor.point - body.position;
        c.z = (anchor.point - shell.positions().col(anchor.vertex)) / m_input.h;
        if (body.prescribed) c.carried = pointVelocity(body.freeTwist, c.arm);
        constraints.push_back(c);
    }
    return constraints;
}

void ContactResponse::writeTo(CoupledSystem& system) {
    for (const auto& filter : m_filters) m_filterOf[globalVertex(m_touches[filter.touches[0]].contact, 0)] = -1;
    m_filters.clear();
    std::vector<VertexConstraint> constraints = holdConstraints();
    std::vector<SoftRow> rows;
    for (std::size_t i = 0; i < m_touches.size(); ++i) {
        Touch& touch = m_touches[i];
        touch.isRow = touch.active && !joinFilter(static_cast<int>(i), constraints);
        if (touch.isRow) rows.push_back(makeRow(touch, system));
    }
    for (const auto& filter : m_filters) finishFilter(filter, constraints[filter.constraint]);
    system.setContacts(std::move(constraints), std::move(rows));
}

bool ContactResponse::joinFilter(int index, std::vector<VertexConstraint>& constraints) {
    const Touch& touch = m_touches[index];
    const int vertex = globalVertex(touch.contact, 0);
    if (!touch.contact.isVertex() || m_held[vertex]) return false;
    if (m_filterOf[vertex] < 0) {
        m_filterOf[vertex] = static_cast<int>(m_filters.size());
        m_filters.push_back({.constraint = static_cast<int>(constraints.size()), .count = 1, .touches = {index, 0, 0}});
        VertexConstraint c{.vertex = vertex, .body = touch.dynamicBody};
        c.arm = touch.arm;
        c.carried = touch.carried;
        constraints.push_back(c);
        return true;
    }
    VertexFilter& filter = m_filters[m_filterOf[vertex]];
    const bool bothPrescribed = touch.dynamicBody < 0 && m_touches[filter.touches[0]].dynamicBody < 0;
    if (!bothPrescribed || filter.count == 3) return false;
    for (int k = 0; k < filter.count; ++k)  // pinched: opposite walls cannot both be met exactly, a soft row gives way
        if (touch.contact.normal.dot(m_touches[filter.touches[k]].contact.normal) < -0.9) return false;
    filter.touches[filter.count++] = index;
    return true;
}

void ContactResponse::finishFilter(const VertexFilter& filter, VertexConstraint& constraint) const {
    const Touch& first = m_touches[filter.touches[0]];
    Mat3 held = Mat3::Zero();
    for (int k = 0; k < filter.count; ++k) {
        const Touch& touch = m_touches[filter.touches[k]];
        const Vec3& n = touch.contact.normal;
        const double target = touch.target + n.dot(touch.carried - first.carried);
        const Vec3 fresh = n - held * n;  // the part of this normal that earlier ones leave open
        const double length2 = fresh.squaredNorm();
        if (length2 < 1e-4) continue;
        constraint.z += fresh * ((target - n.dot(constraint.z)) / length2);
        held += fresh * fresh.transpose() / length2;
    }
    if (first.sticks) {
        constraint.free.setZero();
        return;
    }
    constraint.free = Mat3::Identity() - held;
    constraint.damping = first.drag * constraint.free;
}

double ContactResponse::vertexStiffness(const CoupledSystem& system, const Touch& touch) const {
    const auto& part = system.shells()[touch.contact.shell];
    const Vec3& n = touch.contact.normal;
    double sum = 0.0;
    for (int a = 0; a < 3; ++a)
        sum += touch.contact.weights[a] * n.dot(part.matrix->diagonal()[touch.contact.vertices[a]] * n);
    return sum;
}

SoftRow ContactResponse::makeRow(Touch& touch, const CoupledSystem& system) const {
    const Contact& c = touch.contact;
    touch.kappa = kRowPenalty * vertexStiffness(system, touch);
    SoftRow row;
    for (int a = 0; a < 3; ++a) row.vertices[a] = globalVertex(c, a);
    row.weights = c.weights;
    row.body = touch.dynamicBody;
    row.arm = touch.arm;
    row.carried = touch.carried;
    const double drag = touch.sticks ? touch.kappa : touch.drag;
    row.stiffness = touch.kappa * c.normal * c.normal.transpose() + drag * tangential(c.normal);
    row.load = (touch.kappa * touch.target + touch.lambda) * c.normal;
    return row;
}

Vec3 ContactResponse::relativeVelocity(const Touch& touch, const IslandVelocities& solved) const {
    Vec3 u = -touch.carried;
    for (int a = 0; a < 3; ++a) u += touch.contact.weights[a] * solved.v.col(globalVertex(touch.contact, a));
    if (touch.dynamicBody >= 0) u -= pointVelocity(solved.w.col(touch.dynamicBody), touch.arm);
    return u;
}

bool ContactResponse::update(const CoupledSystem& system, const IslandVelocities& solved, const Points& y, int round) {
    if (!m_input.contacts) return false;
    for (Touch& touch : m_touches) touch.lifted = 0.0;
    readImpulses(system, solved);
    const bool released = releasePulling(round);
    // Where everything ends is worth looking at only when no contact pulls: before, velocities can be anything.
    const bool entered = !released && checkEnd(solved, y, round);
    // Friction follows the normal impulses only when these have settled: lagged behind a passing one it runs away.
    const bool slid = !released && !entered && updateFriction(system, solved);
    return (released || entered || slid) && round + 1 < kMaxRounds;
}

void ContactResponse::readImpulses(const CoupledSystem& system, const IslandVelocities& solved) {
    for (Touch& touch : m_touches) {
        touch.impulse.setZero();
        touch.normalImpulse = 0.0;
        if (!touch.isRow) continue;
        const Vec3 u = relativeVelocity(touch, solved);
        const Vec3& n = touch.contact.normal;
        touch.normalImpulse = touch.lambda + touch.kappa * (touch.target - u.dot(n));
        const double drag = touch.sticks ? touch.kappa : touch.drag;
        touch.impulse = touch.normalImpulse * n - drag * (u - u.dot(n) * n);
    }
    for (const auto& filter : m_filters) {
        const Vec3 total = -solved.unfiltered.col(system.constraints()[filter.constraint].vertex);
        Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3> normals(3, filter.count);
        for (int k = 0; k < filter.count; ++k) normals.col(k) = m_touches[filter.touches[k]].contact.normal;
        const Eigen::MatrixXd gram = normals.transpose() * normals;
        const Eigen::VectorXd along = gram.fullPivLu().solve(normals.transpose() * total);
        for (int k = 0; k < filter.count; ++k) {
            Touch& touch = m_touches[filter.touches[k]];
            touch.normalImpulse = along[k];
            touch.impulse = along[k] * touch.contact.normal;
        }
        m_touches[filter.touches[0]].impulse += total - normals * along;  // friction
    }
}

bool ContactResponse::releasePulling(int round) {
    bool changed = false;
    double most = 0.0;
    for (const Touch& touch : m_touches) most = std::max(most, touch.normalImpulse);
    for (Touch& touch : m_touches) {
        if (!touch.active) continue;
        if (touch.normalImpulse < -kPull * most && touch.changes < kMostChanges) {
            touch.active = false;
            touch.lambda = 0.0;
            ++touch.changes;
            changed = true;
        } else if (touch.isRow) {
            touch.lambda = std::max(touch.normalImpulse, 0.0);
        }
    }
    return changed && round + 1 < kMaxRounds;
}

bool ContactResponse::updateFriction(const CoupledSystem& system, const IslandVelocities& solved) {
    if (++m_frictionRounds > kFrictionRounds) return false;
    const double still = 0.02 * m_input.h * std::max(m_input.gravity.norm(), 1e-3);  // slower than this may stick
    bool changed = false;
    for (Touch& touch : m_touches) {
        const double limit = touch.contact.friction * touch.normalImpulse;
        if (!touch.active || touch.contact.friction <= 0.0 || touch.normalImpulse <= 0.0) continue;
        const Vec3& n = touch.contact.normal;
        const Vec3 slide = relativeVelocity(touch, solved);
        const double slip = (slide - slide.dot(n) * n).norm();
        if (touch.sticks) {
            const double force = (touch.impulse - touch.normalImpulse * n).norm();
            if (force <= 1.001 * limit) continue;
            touch.sticks = false;  // its slip is not known yet: what the excess force would give this vertex alone
            touch.patience = kPatience;
            touch.drag = limit / std::max((force - limit) / vertexStiffness(system, touch), still);
            changed = true;
        } else if (slip < still && touch.patience == 0 && !touch.isRow) {
            touch.sticks = true;
            changed = true;
        } else {
            const double drag = limit / std::max(slip, 0.1 * still);
            if (std::abs(drag - touch.drag) * slip > 0.05 * limit) changed = true;
            touch.drag = drag;
        }
    }
    return changed;
}

bool ContactResponse::checkEnd(const IslandVelocities& solved, const Points& y, int round) {
    m_end.resize(m_input.shells.size());
    std::vector<const Points*> positions;
    for (std::size_t k = 0; k < m_input.shells.size(); ++k) {
        const auto n = m_input.shells[k]->vertexCount();
        m_end[k] = m_input.shells[k]->positions() + m_input.h * solved.v.middleCols(m_offsets[k], n) +
                   y.middleCols(m_offsets[k], n);
        positions.push_back(&m_end[k]);
    }
    std::vector<Vec6> twists(m_input.bodies.size());
    for (std::size_t b = 0; b < twists.size(); ++b)
        twists[b] = m_dynamicIndex[b] < 0 ? m_input.bodies[b].freeTwist : Vec6(solved.w.col(m_dynamicIndex[b]));

    m_found.clear();
    m_input.contacts->find({positions, twists, m_input.h}, -m_vertexSlop, -m_faceSlop, m_found);
    std::sort(m_found.begin(), m_found.end(), [](const Contact& a, const Contact& b) { return a.gap < b.gap; });
    m_deepestGap = 0.0;
    m_claimed.clear();
    bool changed = false;
    for (const Contact& contact : m_found) changed |= closeAtEnd(contact, solved, round);
    return changed && round + 1 < kMaxRounds;
}

bool ContactResponse::closeAtEnd(const Contact& contact, const IslandVelocities& solved, int round) {
    const auto known = m_index.find(keyOf(contact));
    const bool fresh = known == m_index.end();
    const bool held = !fresh && m_touches[known->second].active;
    const double slop = contact.isVertex() ? m_vertexSlop : m_faceSlop;
    const double missing =
        fresh ? contact.gap : contact.gap - m_touches[known->second].offset - m_touches[known->second].allowedGap;
    if (missing > -slop) return false;
    if (!contact.isVertex() && !held) {
        // Nearly at a vertex or an edge, that feature says the same; and of features that share vertices the deepest
        // comes first, for the others may be cured with it.
        for (int a = 0; a < 3; ++a)
            if (contact.weights[a] > 0.0 && contact.weights[a] < 0.1) return false;
        m_deepestGap = std::min(m_deepestGap, missing);
        if (liftVertices(contact, -missing)) return true;
        for (int a = 0; a < 3; ++a)
            if (contact.weights[a] > 0.0 && m_claimed.count(globalVertex(contact, a))) return true;
        for (int a = 0; a < 3; ++a)
            if (contact.weights[a] > 0.0) m_claimed.insert(globalVertex(contact, a));
    }
    m_deepestGap = std::min(m_deepestGap, missing);
    if (fresh) {
        m_index[keyOf(contact)] = static_cast<int>(m_touches.size());
        m_touches.push_back(makeTouch(contact));
    }
    Touch& touch = fresh ? m_touches.back() : m_touches[known->second];
    if (!touch.active) {
        if (touch.changes >= kMostChanges) return false;
        touch.active = true;
        ++touch.changes;
    }
    if (held && round >= kFreezeRound) {
        touch.target -= 0.7 * missing / m_input.h;
        return true;
    }
    const bool turned =
        !fresh && contact.normal.dot(touch.contact.normal) < 0.0;  // it has passed the middle of the body
    const Vec3 firstNormal = touch.contact.normal;
    const double firstGap = touch.contact.gap;
    place(touch, contact);
    if (turned) {
        touch.contact.normal = firstNormal;
        touch.contact.gap = firstGap;
        touch.target = -std::max(firstGap, 0.0) / m_input.h;
    } else {
        touch.target = relativeVelocity(touch, solved).dot(contact.normal) - missing / m_input.h;
    }
    return true;
}

/// Vertices that lie on a curved surface leave their chords inside it. They are lifted by as much, once; a row for
/// every chord would only fight them. False when the vertices do not touch the body there: a body smaller than a
/// triangle.
bool ContactResponse::liftVertices(const Contact& contact, double by) {
    double carried = 0.0;
    std::array<Touch*, 3> touches{};
    for (int a = 0; a < 3; ++a) {
        if (contact.weights[a] == 0.0) continue;
        Contact vertex = contact;
        vertex.feature = Feature::vertex(contact.vertices[a]);
        const auto known = m_index.find(keyOf(vertex));
        if (known == m_index.end()) continue;
        Touch& touch = m_touches[known->second];
        if (!touch.active || touch.contact.normal.dot(contact.normal) < 0.7) continue;
        if (touch.offset + by > kMostOffset * m_edge[contact.shell]) continue;
        touches[a] = &touch;
        carried += contact.weights[a];
    }
    if (carried < 0.6) return false;
    for (Touch* touch : touches) {
        if (!touch || touch->lifted >= by) continue;
        touch->offset += by - touch->lifted;
        touch->target += (by - touch->lifted) / m_input.h;
        touch->lifted = by;
    }
    return true;
}

void ContactResponse::finish(std::vector<ContactImpulse>& impulses) {
    m_memory.clear();
    m_memoryStep = m_input.h;
    for (const Touch& touch : m_touches) {
        if (touch.impulse.isZero(0.0)) continue;  // took no part in the last solve
        impulses.push_back({touch.contact, touch.impulse, touch.sticks});
        if (touch.active && touch.normalImpulse > 0.0)
            m_memory[keyOf(touch.contact)] = {touch.normalImpulse, touch.drag, touch.offset, touch.sticks,
                                              touch.patience};
    }
}

}  // namespace jacket
