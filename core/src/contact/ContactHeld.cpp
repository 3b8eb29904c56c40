#include <algorithm>
#include <cmath>
#include <limits>

#include "contact/ContactResponse.h"

/// Contacts with vertices that something else holds: a pin, an anchor, or another body.
namespace jacket {

bool ContactResponse::isHeld(const Contact& contact) const {
    for (int a = 0; a < 3; ++a)
        if (contact.weights[a] > 0.0 && m_held[globalVertex(contact, a)]) return true;
    return false;
}

/// Squares of the weights of those of a contact's vertices that nothing holds, summed. Each moved by its weight over
/// this sum, they move the point by 1.
double ContactResponse::freeWeights(const Contact& contact) const {
    double sum = 0.0;
    for (int a = 0; a < 3; ++a)
        if (!m_held[globalVertex(contact, a)]) sum += contact.weights[a] * contact.weights[a];
    return sum;
}

/// Whether a free body stands inside what something holds, and so deep that it is to be closed: pushOut cannot take the
/// one out of the other.
bool ContactResponse::isAnyStuck() const {
    return std::any_of(m_found.begin(), m_found.end(), [&](const Contact& contact) {
        return m_dynamicIndex[contact.body] >= 0 && freeWeights(contact) <= kLeastFree &&
               missing(contact, touchOf(contact)) < -slopOf(contact);
    });
}

/// What is held, and the vertices around it: a free body near these may be on its way to an edge between two pins.
void ContactResponse::findBesideHeld() {
    m_besideHeld = m_held;
    if (!hasFreeBodies() || std::find(m_held.begin(), m_held.end(), 1) == m_held.end()) return;
    for (std::size_t k = 0; k < m_input.shells.size(); ++k)
        for (const HalfEdgeMesh::Edge& edge : m_input.shells[k]->mesh().edges()) {
            const int a = m_offsets[k] + edge.v0, b = m_offsets[k] + edge.v1;
            if (m_held[a]) m_besideHeld[b] = 1;
            if (m_held[b]) m_besideHeld[a] = 1;
        }
}

/// Whether some vertex may be held, by a pin or a wall, where a free body touches it: in a sheet that is pinned by its
/// edge only those near the edge are, and the others need no faces.
bool ContactResponse::mayBeBacked() const {
    if (!hasFreeBodies()) return false;
    const bool areAllHeld = std::find(m_held.begin(), m_held.end(), 0) == m_held.end();
    const bool isAnyWall = std::find(m_dynamicIndex.begin(), m_dynamicIndex.end(), -1) != m_dynamicIndex.end();
    return areAllHeld || isAnyWall || std::any_of(m_found.begin(), m_found.end(), [&](const Contact& contact) {
               return m_dynamicIndex[contact.body] >= 0 && m_besideHeld[globalVertex(contact, 0)] != 0;
           });
}

/// Vertices that cannot give way to a free body, as something else holds them: a pin, or a wall on the other side.
/// There the body touches a surface that stays as it is, and its faces count from the start: found only when they are
/// deep at the end, they would bear a body that rests by turns, and throw it.
void ContactResponse::findBacked() {
    std::pmr::multimap<int, const Contact*> near(&m_pool);
    for (const Contact& contact : m_found)
        if (contact.isVertex() && contact.gap < 10.0 * m_vertexSlop) near.emplace(globalVertex(contact, 0), &contact);
    for (const Contact& contact : m_found) {
        if (m_dynamicIndex[contact.body] < 0) continue;
        for (int a = 0; a < 3; ++a) {
            const int vertex = globalVertex(contact, a);
            const auto [first, last] = near.equal_range(vertex);
            const auto isWallFacing = [&](const auto& other) {
                return m_dynamicIndex[other.second->body] < 0 && isFacing(*other.second, contact);
            };
            if (m_held[vertex] || std::any_of(first, last, isWallFacing)) m_backed.emplace(vertex, contact.body);
        }
    }
}

/// Whether a free body touches a vertex from the other side of another one, or may come to in the step: what is between
/// them gives way to neither.
bool ContactResponse::isAnySqueezed() {
    std::pmr::multimap<int, const Contact*> ofFree(&m_pool);  // by vertex
    for (const Contact& contact : m_found)
        if (contact.isVertex() && m_dynamicIndex[contact.body] >= 0) ofFree.emplace(globalVertex(contact, 0), &contact);
    if (ofFree.empty()) return false;
    return std::any_of(m_found.begin(), m_found.end(), [&](const Contact& contact) {
        const auto [first, last] = ofFree.equal_range(globalVertex(contact, 0));
        return contact.isVertex() &&
               std::any_of(first, last, [&](const auto& other) { return isFacing(*other.second, contact); });
    });
}

bool ContactResponse::isBacked(const Contact& contact) const {
    if (m_backed.empty()) return false;
    for (int a = 0; a < 3; ++a) {
        if (contact.weights[a] == 0.0) continue;
        if (m_backed.count({globalVertex(contact, a), contact.body}) == 0) return false;
    }
    return true;
}

bool ContactResponse::hasSurfaces() const {
    return !m_backed.empty() || std::find(m_stiff.begin(), m_stiff.end(), 1) != m_stiff.end();
}

/// Whether a free body touches the sheet as a surface there, which does not give way to it: it is backed, or stiff and
/// held.
bool ContactResponse::isSurface(const Contact& contact) const {
    return (m_stiff[contact.shell] && m_dynamicIndex[contact.body] >= 0) || isBacked(contact);
}

/// Where a pin or another body holds vertices of a contact, bodies are what must give way, its own or the one that they
/// are tied to: how heavy these and the vertices that are free, by their share, are together along it. Vertices that
/// other contacts hold count where all are held. 0: it is not so [kg].
double ContactResponse::pinchedMass(const CoupledSystem& system, const Touch& touch) const {
    const Contact& c = touch.contact;
    const auto mobilityOf = [&](int body) {
        return m_dynamicIndex[body] < 0 ? 0.0 : 1.0 / m_input.bodies[body].lightest();
    };
    bool isAnyHeld = false, isAnyFree = false;
    int holder = c.body;  // to which vertices are tied
    double ofVertices = 0.0, tied = 0.0;
    for (int a = 0; a < 3; ++a) {
        const int vertex = globalVertex(c, a), filter = m_filterOf[vertex];
        const bool isTaken = filter >= 0 && m_touches[m_filters[filter].touches[0]].dynamicBody != touch.dynamicBody;
        const double weight = c.weights[a];
        if (weight == 0.0 || m_tied.count({vertex, c.body}) > 0) continue;
        isAnyHeld |= m_held[vertex] != 0;
        isAnyFree |= !m_held[vertex] && !isTaken;
        const auto tie = m_tied.lower_bound({vertex, 0});
        if (!m_held[vertex]) {
            const Mat3& stiffness = system.shells()[c.shell].matrix->diagonal()[c.vertices[a]];
            ofVertices += weight * weight / c.normal.dot(stiffness * c.normal);
        } else if (tie != m_tied.end() && tie->first == vertex) {
            holder = tie->second;
            tied += weight;
        }
    }
    const double ofBodies = mobilityOf(c.body) + tied * tied * mobilityOf(holder);
    if (ofBodies == 0.0 || (!isAnyHeld && isAnyFree)) return 0.0;
    if (!isAnyHeld) return m_input.bodies[c.body].lightest();
    return 1.0 / (isAnyFree ? ofBodies + ofVertices : ofBodies);
}

/// Soft rows by each of their vertices, where free bodies may press shells on something.
void ContactResponse::findRowsByVertex() {
    m_rowsByVertex.clear();
    if (!hasFreeBodies()) return;
    for (const Touch& touch : m_touches)
        for (int a = 0; a < 3 && touch.isRow; ++a)
            if (touch.contact.weights[a] > 0.0) m_rowsByVertex.emplace(globalVertex(touch.contact, a), &touch);
}

/// How heavy is what a soft row and another one from the other side press on each other through the shell, if either's
/// body gives way. Both are to bear it: by the stiffness of the shell alone, multipliers would take as many rounds as
/// it is heavier. 0: nothing does [kg].
double ContactResponse::pressedMass(const Touch& touch) const {
    double most = 0.0;
    for (int a = 0; a < 3 && !m_rowsByVertex.empty(); ++a) {
        if (touch.contact.weights[a] == 0.0) continue;
        const auto [first, last] = m_rowsByVertex.equal_range(globalVertex(touch.contact, a));
        for (auto known = first; known != last; ++known) {
            const Touch& other = *known->second;
            if (other.contact.body == touch.contact.body || !isFacing(other.contact, touch.contact)) continue;
            const double mass = massBetween(touch, other);
            if (mass > most && (mayYield(touch) || mayYield(other))) most = mass;
        }
    }
    return most;
}

/// Of the lighter of two bodies that face each other, infinite if neither is free. Two free ones bear each other by the
/// vertices between them, if a contact holds any: it is 0 then [kg].
double ContactResponse::massBetween(const Touch& touch, const Touch& other) const {
    const bool areFree = touch.dynamicBody >= 0 && other.dynamicBody >= 0;
    if (areFree && (hasTakenVertex(touch) || hasTakenVertex(other))) return 0.0;
    double mass = std::numeric_limits<double>::infinity();
    for (const Touch* one : {&touch, &other})
        if (one->dynamicBody >= 0) mass = std::min(mass, m_input.bodies[one->contact.body].lightest());
    return mass;
}

/// Whether a contact of its own holds a vertex of a soft row.
bool ContactResponse::hasTakenVertex(const Touch& row) const {
    for (int a = 0; a < 3; ++a)
        if (row.contact.weights[a] > 0.0 && m_filterOf[globalVertex(row.contact, a)] >= 0) return true;
    return false;
}

/// Whether a contact's body gives way to it: nothing that bears it, or joins it to others, holds it from behind.
bool ContactResponse::mayYield(const Touch& touch) const {
    constexpr double kMuchHeavier = 100.0;  // than the body alone
    if (touch.dynamicBody < 0) return false;
    const CoupledBody& body = m_input.bodies[touch.contact.body];
    Mat6 mass = body.mass;
    for (const BodySupport& support : body.supports) {
        const bool isAlong = support.row.dot(rowOf(touch, touch.contact.normal)) > 0.0;
        const double most = isAlong ? support.range.most : -support.range.least;
        if (!std::isinf(most)) mass -= support.weight * support.row * support.row.transpose();
    }
    return bodyInertia(mass, touch, touch.contact.normal) <=
           kMuchHeavier * bodyInertia(body.ownMass(), touch, touch.contact.normal);
}

/// Whether neither side of a contact gives way: something holds its vertices, and what bears the free body, or joins it
/// to others, holds that. How deep the one is in the other is then not to be taken back: made exact, the impulses that
/// this takes would grow without bound.
bool ContactResponse::isWedged(const Touch& touch) const {
    const bool isBorne = touch.dynamicBody >= 0 && !m_input.bodies[touch.contact.body].supports.empty();
    return isBorne && isHeld(touch.contact) && !mayYield(touch);
}

/// Whether a contact of a free body has a vertex that another one holds.
bool ContactResponse::isBetweenBodies(const Touch& touch) const {
    for (int a = 0; a < 3; ++a) {
        const int filter = m_filterOf[globalVertex(touch.contact, a)];
        if (touch.contact.weights[a] > 0.0 && filter >= 0 && m_touches[m_filters[filter].touches[0]].dynamicBody >= 0 &&
            m_touches[m_filters[filter].touches[0]].contact.body != touch.contact.body)
            return touch.dynamicBody >= 0;
    }
    return false;
}

}  // namespace jacket
