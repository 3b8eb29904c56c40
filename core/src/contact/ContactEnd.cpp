#include "contact/ContactResponse.h"

#include <algorithm>
#include <limits>

namespace jacket {
namespace {

constexpr double kMostOffset =
    0.15;                            // of an edge: how far vertices are lifted off a curved body for their chords' sake
constexpr double kDeep = 0.1;        // of an edge: what is worth another solve where few are made
constexpr double kMostPush = 0.2;    // of an edge: how far pushOut goes
constexpr int kMostTurns = 8;        // of the walls of a valley, at pushing
constexpr double kSamePoint = 0.15;  // of an edge, or the body's radius: how far it may move in a round
constexpr double kSameWay = 0.7;     // cosine of the angle between normals that push a vertex much the same way
constexpr double kTheSame = 0.995;   // the same of one that says what another does
constexpr int kFreezeRound = 7;      // from here on normals stay: a triangle that tips to and fro would never settle

}  // namespace

void ContactResponse::moveToEnd(const IslandVelocities& solved, const Points& y) {
    m_end.resize(m_input.shells.size());
    for (std::size_t k = 0; k < m_input.shells.size(); ++k) {
        const auto n = m_input.shells[k]->vertexCount();
        m_end[k] = m_input.shells[k]->positions() + m_input.h * solved.v.middleCols(m_offsets[k], n) +
                   y.middleCols(m_offsets[k], n);
    }
    m_endTwists.resize(m_input.bodies.size());
    for (std::size_t b = 0; b < m_endTwists.size(); ++b)
        m_endTwists[b] = m_dynamicIndex[b] < 0 ? m_input.bodies[b].freeTwist : Vec6(solved.w.col(m_dynamicIndex[b]));
}

/// What is inside a body at the end of the solved motion, the deepest first, into m_found.
void ContactResponse::findAtEnd(const IslandVelocities& solved, const Points& y) {
    moveToEnd(solved, y);
    m_endPoses.clear();
    for (const Points& end : m_end) m_endPoses.push_back(&end);
    m_found.clear();
    const double faceSlop = hasSurfaces() ? std::min(m_vertexSlop, m_faceSlop) : m_faceSlop;
    m_input.contacts->find({m_endPoses, m_endTwists, m_input.h}, -m_vertexSlop, -faceSlop, m_found);
    dropHeldInside();
    std::sort(m_found.begin(), m_found.end(), [](const Contact& a, const Contact& b) { return a.gap < b.gap; });
    dropPassed();
}

double ContactResponse::gapAtEnd(const IslandVelocities& solved, const Points& y) {
    findAtEnd(solved, y);
    double least = 0.0;
    for (const Contact& contact : m_found) {
        const int touch = touchOf(contact);
        if (touch < 0 || !m_touches[touch].jammed) least = std::min(least, missing(contact, touch));
    }
    return least;
}

ContactSweep ContactResponse::wayToEnd(std::span<const char> bodies) {
    m_startPoses.clear();
    m_endPoses.clear();
    for (std::size_t k = 0; k < m_input.shells.size(); ++k) {
        m_startPoses.push_back(&m_input.shells[k]->positions());
        m_endPoses.push_back(&m_end[k]);
    }
    return {m_startPoses, m_endPoses, m_endTwists, bodies, m_input.h};
}

/// What fast bodies meet on the solved way, into m_found.
void ContactResponse::sweepToEnd() {
    m_found.clear();
    m_input.contacts->sweep(wayToEnd(m_fast), m_found);
    dropHeldInside();
}

/// Not only of fast bodies: between the corners of a triangle larger than they are others go through it little by
/// little, and where contacts have not settled anything may. (What is anchored in its middle has a triangle there, as
/// what is embedded in one that stays may have.)
bool ContactResponse::passes(const IslandVelocities& solved, const Points& y, bool isUnsure) {
    if (!m_input.contacts) return false;
    const double longest = *std::max_element(m_edge.begin(), m_edge.end());
    m_mayCross.clear();
    for (std::size_t b = 0; b < m_input.bodies.size(); ++b)
        m_mayCross.push_back(isUnsure || m_fast[b] || m_input.bodies[b].inner < longest);
    for (const Anchor& anchor : m_input.anchors) m_mayCross[anchor.body] = 0;
    for (const auto& [vertex, body] : m_embedded) m_mayCross[body] &= isLed(body);
    const bool mayAnyCross = std::find(m_mayCross.begin(), m_mayCross.end(), 1) != m_mayCross.end();
    if (!m_anyFast && !mayAnyCross) return false;
    if (!isQuick()) moveToEnd(solved, y);  // else pushOut is to know where what it pushes was found
    if (m_anyFast) sweepToEnd();
    return (m_anyFast && !m_found.empty()) || (mayAnyCross && m_input.contacts->crosses(wayToEnd(m_mayCross)));
}

bool ContactResponse::checkEnd(const IslandVelocities& solved, const Points& y, int round) {
    findAtEnd(solved, y);
    findThrown(solved);
    bool changed = closeFound(solved, round);
    if (m_anyFast) changed |= closeFirst(round);
    return changed && !isLast(round);
}

/// A contact that lets go too early may throw what it held right through a thin body, where nothing is found at the
/// end: its way is swept from then on.
void ContactResponse::findThrown(const IslandVelocities& solved) {
    for (const Touch& touch : m_touches) {
        const int body = touch.contact.body;
        if (touch.active || m_fast[body] || !touch.contact.isVertex()) continue;
        const Vec3 way = m_input.h * relativeVelocity(touch, solved);
        if (way.dot(touch.contact.normal) > -2.0 * m_input.bodies[body].inner) continue;
        m_fast[body] = 1;
        m_anyFast = true;
    }
}

bool ContactResponse::closeFound(const IslandVelocities& solved, int round) {
    m_deepestGap = 0.0;
    m_claimed.clear();
    m_raised.clear();
    for (const Contact& contact : m_found) {
        const double lacks = contact.isVertex() ? missing(contact, touchOf(contact)) : 0.0;
        if (lacks < -m_vertexSlop) m_raised.try_emplace(globalVertex(contact, 0), -lacks * contact.normal);
    }
    bool changed = false;
    for (const Contact& contact : m_found) changed |= closeAtEnd(contact, solved, round);
    return changed;
}

/// Holds what the solved motion passes first; of bodies that nothing stops, all that it passes with a
/// vertex that was not held before.
bool ContactResponse::closeFirst(int round) {
    sweepToEnd();
    if (m_found.empty()) return false;
    const auto first = std::min_element(m_found.begin(), m_found.end(),
                                        [](const Contact& a, const Contact& b) { return a.time < b.time; });
    bool changed = false;
    for (const Contact& contact : m_found) {
        const bool isNew = contact.isVertex() && m_index.find(keyOf(contact)) == m_index.end();
        if (&contact == &*first || (isNew && m_input.bodies[contact.body].prescribed))
            changed |= closePassed(contact, round);
    }
    return changed;
}

bool ContactResponse::closePassed(const Contact& contact, int round) {
    const auto [known, fresh] = m_index.try_emplace(keyOf(contact), static_cast<int>(m_touches.size()));
    if (fresh) add(makeTouch(contact));
    Touch& touch = m_touches[known->second];
    if (touch.active && round >= kFreezeRound) return false;
    place(touch, contact);
    touch.active = true;
    touch.target = -contact.gap / m_input.h;  // as close as they were when they touched
    if (touch.bounces) touch.target = std::max(touch.target, leavingSpeed(touch));
    return true;
}

/// From a free body's centre of mass to the contact, when the step is over: how the gap changes with the body's spin is
/// to be right there. A ball that rolls would else be held back by the face that it rolls onto.
Vec3 ContactResponse::armAtEnd(const Contact& contact) const {
    const Vec3 moved = m_input.h * m_endTwists[contact.body].head<3>();
    return contact.point - (m_input.bodies[contact.body].position + moved);
}

/// What a contact at the end of the step lacks to where it may be, < 0: it stands deeper [m]. `touch`: the one that it
/// belongs to, or -1.
double ContactResponse::missing(const Contact& contact, int touch) const {
    return touch < 0 ? contact.gap : contact.gap - m_touches[touch].offset - m_touches[touch].allowedGap;
}

bool ContactResponse::isAnyDeep() const {
    return std::any_of(m_found.begin(), m_found.end(), [&](const Contact& contact) {
        return missing(contact, touchOf(contact)) < -kDeep * m_edge[contact.shell];
    });
}

/// The touch that a contact belongs to, -1: none. A point that has moved on to a neighbouring face is still the same.
/// Where a body lies on a face with more than a point, as a box or a cylinder does on one larger than it, the solve
/// takes out one end of it and the next one finds the other: these are two. So are those of triangles that fold around
/// a free body's corner: one contact for all would push each of their ways in turn, and never settle.
int ContactResponse::touchOf(const Contact& contact) const {
    const auto known = m_index.find(keyOf(contact));
    if (contact.isVertex()) return known == m_index.end() ? -1 : known->second;
    const auto isNear = [&](const Touch& touch) {
        const Contact& other = touch.contact;
        return !other.isVertex() && other.shell == contact.shell && other.body == contact.body &&
               (m_dynamicIndex[contact.body] < 0 || other.normal.dot(contact.normal) > kSameWay) &&
               (other.point - contact.point).norm() <
                   kSamePoint * std::min(m_edge[contact.shell], m_input.bodies[contact.body].radius);
    };
    const auto stays = [&](const Touch& touch) { return touch.active && touch.isPlaced && !isNear(touch); };
    if (known != m_index.end() && !stays(m_touches[known->second])) return known->second;
    for (std::size_t i = 0; i < m_touches.size(); ++i)
        if (m_touches[i].isRow && isNear(m_touches[i])) return static_cast<int>(i);
    return -1;
}

/// The touch of a corner of a face's contact with the same body, -1: none.
int ContactResponse::touchAtVertex(const Contact& contact, int corner) const {
    Contact vertex = contact;
    vertex.feature = Feature::vertex(contact.vertices[corner]);
    const auto known = m_index.find(keyOf(vertex));
    return known == m_index.end() ? -1 : known->second;
}

/// Whether a face's contact is nearly at a vertex that is held off the body there, or is being taken out of it, the
/// same way. Beside a corner or an edge of the body, or beside a small ball, it is not: its triangle would go on into
/// the body, and the more so where something else holds the vertex.
bool ContactResponse::isSaidByVertex(const Contact& contact) const {
    int corner = 0;
    if (contact.weights.maxCoeff(&corner) < 1.0 - kNearEdge) return false;
    const int vertex = globalVertex(contact, corner);
    const auto isAlong = [&](const Vec3& n) { return n.dot(contact.normal) > kTheSame * n.norm(); };
    const int there = touchAtVertex(contact, corner);
    if (there >= 0 && m_touches[there].active && isAlong(m_touches[there].contact.normal)) return true;
    const auto raised = m_raised.find(vertex);
    return raised != m_raised.end() && isAlong(raised->second);
}

/// Whether a face's contact is to wait until its vertices, which this round takes out of the body, are out: where it
/// stood as deep along its normal before the step, which is then not the way that it came in. Where vertices over the
/// edges of a box go down by more than the sheet is thick, it would be pushed off the box's sides.
bool ContactResponse::isForVertices(const Contact& contact, const IslandVelocities& solved) const {
    const double before = contact.gap - m_input.h * relativeVelocity(makeTouch(contact), solved).dot(contact.normal);
    if (before > -slopOf(contact)) return false;
    for (int a = 0; a < 3; ++a)
        if (contact.weights[a] > 0.0 && m_raised.count(globalVertex(contact, a)) > 0) return true;
    return false;
}

bool ContactResponse::closeAtEnd(const Contact& contact, const IslandVelocities& solved, int round) {
    const int known = touchOf(contact);
    const bool fresh = known < 0;
    const bool held = !fresh && m_touches[known].active;
    const bool isVain = held && m_touches[known].isVain && m_touches[known].dynamicBody >= 0;
    if (isVain || (held && m_touches[known].jammed)) return false;
    const double lacks = missing(contact, known);
    if (lacks > -slopOf(contact)) return false;
    const bool isNewFace = !contact.isVertex() && !held;
    if (isNewFace && isSaidByVertex(contact)) return false;
    m_deepestGap = std::min(m_deepestGap, lacks);
    if (isNewFace && isForVertices(contact, solved)) return true;
    if (!fresh && !held && m_touches[known].changes >= kMostChanges) return false;
    if (isNewFace) {
        // Of features that share vertices the deepest comes first, for the others may be cured with it.
        if (!m_onlyStops && !isTakenOut(contact.body) && liftVertices(contact, -lacks, solved)) return true;
        for (int a = 0; a < 3; ++a)
            if (contact.weights[a] > 0.0 && m_claimed.count(globalVertex(contact, a))) return true;
        for (int a = 0; a < 3; ++a)
            if (contact.weights[a] > 0.0) m_claimed.insert(globalVertex(contact, a));
    }
    if (fresh) {
        m_index[keyOf(contact)] = static_cast<int>(m_touches.size());
        add(makeTouch(contact));
    }
    Touch& touch = fresh ? m_touches.back() : m_touches[known];
    if (!touch.active) {
        touch.active = true;
        ++touch.changes;
        if (contact.isVertex()) putDown(contact);
    }
    if (held && round >= kFreezeRound) {
        touch.target -= 0.7 * lacks / m_input.h;
        return true;
    }
    const bool turned = !fresh && !entersThere(contact, touch, solved);
    touch.startGap = std::numeric_limits<double>::quiet_NaN();
    const Vec3 firstNormal = touch.contact.normal;
    const double firstGap = touch.contact.gap;
    place(touch, contact);
    touch.isPlaced = true;
    touch.missed = 0.0;
    if (touch.dynamicBody >= 0) touch.arm = armAtEnd(contact);
    if (turned) {
        touch.contact.normal = firstNormal;
        touch.contact.gap = firstGap;
        touch.target = -std::max(firstGap, 0.0) / m_input.h;
    } else {
        aim(touch, lacks, solved);
    }
    if (touch.bounces) touch.target = std::max(touch.target, leavingSpeed(touch));
    return true;
}

/// Whether what stood inside the body at the start is taken out of it by and by. In the short time that is a part of a
/// step a face that leaves at once would throw the shell, or the body.
bool ContactResponse::leavesSlowly(const Contact& contact) const {
    if (isBacked(contact)) return true;
    if (contact.isVertex()) return false;
    const bool isInPart = m_partOfStep < 1.0 && !isLed(contact.body);
    return isInPart || isTakenOut(contact.body) || m_leaving.count(faceOf(contact)) > 0;
}

/// Sets what a contact where the end found it is to reach. `lacks`: see missing.
void ContactResponse::aim(Touch& touch, double lacks, const IslandVelocities& solved) const {
    const Contact& contact = touch.contact;
    const double speed = relativeVelocity(touch, solved).dot(contact.normal);
    const double before = lacks - m_input.h * speed;
    double take = isBetweenBodies(touch) ? kAlteration * lacks : lacks;
    if (m_onlyStops) take = lacks - std::min(0.0, before);
    if (leavesSlowly(contact)) {  // from where it really is: each end of a body that lies aslant has its own depth
        double start = before + touch.allowedGap;
        // No deeper than anything was: beside a round body that goes far, what is outside seems to come from inside.
        if (m_partOfStep < 1.0 || isTakenOut(contact.body)) start = std::max(start, m_gapAtStart[contact.body]);
        const double out = m_input.h * speedOutOf(-start, touch);
        take = lacks + touch.allowedGap - (start < 0.0 ? std::min(0.0, start + out) : 0.0);
    }
    touch.allowedGap += lacks - take;
    touch.target = speed - take / m_input.h;
}

/// What is lifted into a wall on the other side of the shell comes down again, and is not lifted any more.
void ContactResponse::putDown(const Contact& contact) {
    const int filter = m_filterOf[globalVertex(contact, 0)];
    for (int k = 0; filter >= 0 && k < m_filters[filter].count; ++k) {
        Touch& touch = m_touches[m_filters[filter].touches[k]];
        if (!isFacing(touch.contact, contact)) continue;
        touch.pressed = true;
        touch.target -= touch.offset / m_input.h;
        touch.offset = 0.0;
    }
}

/// Whether a contact has come into the body where it is nearest to the surface at the end. What has gone deep may be
/// nearer to another side: beyond the middle of the body, or beside its edge. It came in through the side that it
/// crossed last, being inside of the others by then.
bool ContactResponse::entersThere(const Contact& contact, const Touch& touch, const IslandVelocities& solved) const {
    const double along = contact.normal.dot(touch.contact.normal);
    if (along < 0.0) return false;
    if (along > kSameWay || !contact.isVertex()) return true;
    const Vec3 way = m_input.h * relativeVelocity(touch, solved);
    const auto timeOf = [](double gap, double change) { return gap > 0.0 && gap < -change ? gap / -change : 0.0; };
    const double here = way.dot(contact.normal), room = -m_input.h * touch.target;
    return timeOf(contact.gap - here, here) > timeOf(room, way.dot(touch.contact.normal));
}

/// Vertices that lie on a curved surface, or close above it, leave their chords inside it. They are lifted by as much,
/// once; a row for every chord would only fight them. False when the vertices do not touch the body there: a body
/// smaller than a triangle.
bool ContactResponse::liftVertices(const Contact& contact, double by, const IslandVelocities& solved) {
    if (!isQuick() && contact.weights.maxCoeff() > 1.0 - kNearEdge) return false;  // an edge or corner of the body
    const double most = kMostOffset * m_edge[contact.shell];
    double carried = 0.0;
    std::array<Touch*, 3> touches{};
    for (int a = 0; a < 3; ++a) {
        if (contact.weights[a] == 0.0) continue;
        if (const auto raised = m_raised.find(globalVertex(contact, a)); raised != m_raised.end())
            by -= contact.weights[a] * std::max(0.0, raised->second.dot(contact.normal));
    }
    if (by < m_vertexSlop) return true;
    for (int a = 0; a < 3; ++a) {
        if (contact.weights[a] == 0.0) continue;
        const int there = touchAtVertex(contact, a);
        if (there < 0) continue;
        Touch& touch = m_touches[there];
        if (touch.contact.normal.dot(contact.normal) < kSameWay || touch.pressed) continue;
        if (!touch.active && !isQuick()) continue;
        const double off = touch.active ? touch.offset : endGap(touch, solved);
        if (!(off + by <= most) || (!touch.active && touch.changes >= kMostChanges)) continue;
        touches[a] = &touch;
        carried += contact.weights[a];
    }
    if (carried < 0.6) return false;
    for (Touch* touch : touches) {
        if (!touch || touch->lifted >= by) continue;
        if (!touch->active) {
            touch->offset = std::max(0.0, endGap(*touch, solved));
            touch->target = (touch->offset - touch->startGap) / m_input.h;
            touch->active = true;
            ++touch->changes;
        }
        touch->offset += by - touch->lifted;
        touch->target += (by - touch->lifted) / m_input.h;
        touch->lifted = by;
    }
    return true;
}

/// How far off the body a contact of the start ends; not a number if it was not seen at the start [m].
double ContactResponse::endGap(const Touch& touch, const IslandVelocities& solved) const {
    return touch.startGap + m_input.h * relativeVelocity(touch, solved).dot(touch.contact.normal);
}

/// What few rounds have left inside a body is pushed out of it along the normal. A sheet gives way to that nearly for
/// nothing; a stiff one feels it in the next step. In a valley one wall pushes a vertex into the other, so that all
/// have their turn several times.
const std::pmr::map<int, Vec3>& ContactResponse::pushes(const Points& v) {
    m_pushed.clear();
    if (!m_input.contacts || !isQuick()) return m_pushed;
    findPushes(v);
    for (int turn = 0; turn < kMostTurns; ++turn) {
        bool isInside = false;
        for (Push& one : m_pushes) isInside |= push(one);
        if (!isInside) break;
    }
    return m_pushed;
}

void ContactResponse::pushOut(Points& v, std::vector<ContactImpulse>& impulses) {
    if (!m_input.contacts || !isQuick()) return;
    pushes(v);
    m_deepestGap = 0.0;
    for (const Push& one : m_pushes) {
        const Contact& contact = *one.contact;
        m_deepestGap = std::min(m_deepestGap, one.left);
        if (one.impulse == 0.0) continue;
        impulses.push_back({contact, one.impulse * contact.normal, false, Vec3::Zero()});
        if (contact.isVertex())
            m_memory[keyOf(contact)] = {one.impulse, 0.0, false, {}, contact.point, true, contact.vertices};
    }
    for (const auto& [vertex, by] : m_pushed) v.col(vertex) += by / m_input.h;
}

/// What ends inside a body, and the other walls near the same vertices. Velocities may have changed since the end of
/// the step was looked at.
void ContactResponse::findPushes(const Points& v) {
    m_pushes.clear();
    m_pushes.reserve(m_found.capacity() + m_touches.capacity());  // asks for memory only when they do
    std::pmr::set<int> found(&m_pool);
    std::pmr::multimap<int, const Contact*> near(&m_pool);  // of each vertex
    for (const Contact& contact : m_found) {
        const int touch = touchOf(contact);
        double lacks = missing(contact, touch);
        for (int a = 0; a < 3; ++a) lacks += contact.weights[a] * contact.normal.dot(sinceFound(contact, a, v));
        if (lacks > -slopOf(contact) || freeWeights(contact) < kLeastFree) continue;
        const double by = std::min(-lacks, kMostPush * m_edge[contact.shell]);
        m_pushes.push_back({&contact, by, lacks + by});
        if (touch >= 0) found.insert(touch);
        for (int a = 0; a < (contact.isVertex() ? 1 : 3); ++a) near.emplace(globalVertex(contact, a), &contact);
    }
    for (int i = 0; i < static_cast<int>(m_touches.size()); ++i) {
        const Contact& contact = m_touches[i].contact;
        const int vertex = globalVertex(contact, 0);
        if (!contact.isVertex() || found.count(i) > 0 || m_held[vertex]) continue;
        const double gap = gapBefore(m_touches[i]);
        const auto [first, last] = near.equal_range(vertex);
        const bool isValley = std::any_of(first, last, [&](const auto& other) {
            return other.second->normal.dot(contact.point - other.second->point) > 0.0;
        });
        if (gap < -m_vertexSlop && !isValley) continue;  // off the wall's end
        const double lacks = gap + contact.normal.dot(sinceFound(contact, 0, v));
        const double by = std::min(-lacks, kMostPush * m_edge[contact.shell]);
        if (first != last || lacks < -m_vertexSlop) m_pushes.push_back({&contact, by});
    }
}

/// How far a vertex ends from a wall that the start found, or that holds it, as m_found saw the end; infinite where
/// that is not known [m].
double ContactResponse::gapBefore(const Touch& touch) const {
    const Contact& contact = touch.contact;
    Vec3 carried = carriedOf(touch);
    if (touch.dynamicBody >= 0) carried += pointVelocity(m_endTwists[contact.body], touch.arm);
    const Vec3 move = m_end[contact.shell].col(contact.vertices[0]) -
                      m_input.shells[contact.shell]->positions().col(contact.vertices[0]) - m_input.h * carried;
    const double gap = touch.startGap + move.dot(contact.normal) - touch.offset - touch.allowedGap;
    if (!std::isnan(gap)) return gap;
    return touch.active ? 0.0 : std::numeric_limits<double>::infinity();
}

/// How a corner of a contact moves besides what m_found saw.
Vec3 ContactResponse::sinceFound(const Contact& contact, int corner, const Points& v) const {
    const int i = contact.vertices[corner], column = globalVertex(contact, corner);
    return m_input.shells[contact.shell]->positions().col(i) + m_input.h * v.col(column) + m_y->col(column) -
           m_end[contact.shell].col(i);
}

/// Moves a contact's point out along its normal by those of its vertices that nothing holds, besides what its vertices
/// have been moved by. Whether it had to.
bool ContactResponse::push(Push& one) {
    const Contact& contact = *one.contact;
    const Shell& shell = *m_input.shells[contact.shell];
    const double damped = 1.0 + m_input.h * shell.material().massDamping, free = freeWeights(contact);
    bool isInside = false;
    for (int a = 0; a < (contact.isVertex() ? 1 : 3); ++a) {
        if (contact.weights[a] == 0.0 || m_held[globalVertex(contact, a)]) continue;
        Vec3& before = m_pushed.try_emplace(globalVertex(contact, a), Vec3::Zero()).first->second;
        const double missing = one.by * contact.weights[a] / free - before.dot(contact.normal);
        if (missing <= 0.0) continue;
        isInside |= missing > m_vertexSlop;
        before += missing * contact.normal;
        one.impulse += shell.masses()[contact.vertices[a]] * damped * missing / m_input.h;
    }
    return isInside;
}

}  // namespace jacket
