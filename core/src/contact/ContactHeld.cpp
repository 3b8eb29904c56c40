#include <algorithm>

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

/// Whether some vertex may be held, by a pin or a wall, where a free body touches it: in a sheet that is pinned by its
/// edge only those near the edge are, and the others need no faces.
bool ContactResponse::mayBeBacked() const {
    if (!hasFreeBodies()) return false;
    const bool areAllHeld = std::find(m_held.begin(), m_held.end(), 0) == m_held.end();
    const bool isAnyWall = std::find(m_dynamicIndex.begin(), m_dynamicIndex.end(), -1) != m_dynamicIndex.end();
    return areAllHeld || isAnyWall || std::any_of(m_found.begin(), m_found.end(), [&](const Contact& contact) {
               return m_dynamicIndex[contact.body] >= 0 && m_held[globalVertex(contact, 0)] != 0;
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

/// Where something else holds all vertices of a contact, the body is what must give way: its mass counts, not theirs
/// [kg].
double ContactResponse::pinchedMass(const Touch& touch) const {
    if (touch.dynamicBody < 0) return 0.0;
    for (int a = 0; a < 3; ++a) {
        const int vertex = globalVertex(touch.contact, a);
        const int filter = m_filterOf[vertex];
        const bool isTaken = filter >= 0 && m_touches[m_filters[filter].touches[0]].dynamicBody != touch.dynamicBody;
        if (touch.contact.weights[a] > 0.0 && !m_held[vertex] && !isTaken) return 0.0;
    }
    return m_input.bodies[touch.contact.body].mass.diagonal().head<3>().minCoeff();
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
