#include "contact/ContactResponse.h"

#include <algorithm>

namespace jacket {

/// Vertices that stand deep in a body and are held there, and what hangs on them inside it: a flag is pinned at the
/// axis of its pole, a cape inside the figure that wears it. The faces around them go through its surface whatever they
/// do, and no contact can lead them out.
void ContactResponse::findEmbedded() {
    m_embedded.clear();
    std::pmr::vector<const Contact*> open(&m_pool);
    for (const Contact& contact : m_found)
        if (contact.isVertex() && m_held[globalVertex(contact, 0)] && isHeldDeep(contact)) open.push_back(&contact);
    if (open.empty()) return;
    std::pmr::set<std::pair<int, int>> pairs(&m_pool);  // (shell, body)
    for (const Contact* contact : open) pairs.insert({contact->shell, contact->body});
    std::pmr::map<std::pair<int, int>, const Contact*> inside(&m_pool);
    for (const Contact& contact : m_found) {
        if (!contact.isVertex() || pairs.count({contact.shell, contact.body}) == 0 || !mayHangInside(contact)) continue;
        inside.emplace(std::pair(globalVertex(contact, 0), contact.body), &contact);
        const bool isCutOff = wasEmbedded(contact, contact.vertices[0]);  // from the others, perhaps
        if (isCutOff) open.push_back(&contact);
    }
    while (!open.empty()) {
        const Contact& contact = *open.back();
        open.pop_back();
        if (!m_embedded.insert({globalVertex(contact, 0), contact.body}).second) continue;
        const HalfEdgeMesh& mesh = m_input.shells[contact.shell]->mesh();
        for (const int triangle : mesh.trianglesAround(contact.vertices[0]))
            for (const int neighbour : mesh.triangles().col(triangle)) {
                const auto found = inside.find({m_offsets[contact.shell] + neighbour, contact.body});
                if (found != inside.end()) open.push_back(found->second);
            }
    }
}

/// Whether a vertex stands deep in a body that is what it is tied to, or does not give way to what it is pinned to.
bool ContactResponse::isHeldDeep(const Contact& contact) const {
    const Shell& shell = *m_input.shells[contact.shell];
    const int vertex = contact.vertices[0];
    const double depth = contact.normal.dot(contact.point - shell.positions().col(vertex));  // in the body itself
    return depth > kDeepAtStart * m_vertexSlop &&
           ((shell.isPinned(vertex) && m_input.bodies[contact.body].prescribed) ||
            m_tied.count({globalVertex(contact, 0), contact.body}) > 0);
}

/// Whether a vertex may have come inside with those that are held there: what has touched the body from outside since
/// then is not to slip in beside them.
bool ContactResponse::mayHangInside(const Contact& contact) const {
    if (contact.gap > -m_vertexSlop) return false;
    if (contact.gap < -kDeepAtStart * m_vertexSlop || wasEmbedded(contact, contact.vertices[0])) return true;
    const auto [shell, body, vertex] = keyOf(contact.shell, contact.body, contact.vertices[0]);
    const auto first = m_embeddedBefore.lower_bound({shell, body, 0});
    return first == m_embeddedBefore.end() || std::get<0>(*first) != shell || std::get<1>(*first) != body;
}

bool ContactResponse::wasAnyEmbedded() const {
    return !m_embeddedBefore.empty() || !m_leavingBefore.empty();
}

/// Whether that vertex of the contact's shell was, in its body.
bool ContactResponse::wasEmbedded(const Contact& contact, int vertex) const {
    return m_embeddedBefore.count(keyOf(contact.shell, contact.body, vertex)) > 0;
}

/// Faces around vertices that were embedded and have come out: they still have a chord in the body, and would throw the
/// shell if they had to leave at once.
void ContactResponse::findLeaving() {
    m_leaving.clear();
    if (!wasAnyEmbedded()) return;
    for (const Contact& contact : m_found) {
        if (contact.isVertex() || contact.gap > -m_vertexSlop) continue;
        const auto& v = contact.vertices;
        if (std::any_of(v.begin(), v.end(), [&](int vertex) { return wasEmbedded(contact, vertex); }) ||
            m_leavingBefore.count(faceOf(contact)) > 0)
            m_leaving.insert(faceOf(contact));
    }
}

/// What the next step is to know of them.
void ContactResponse::rememberEmbedded() {
    m_leavingBefore = m_leaving;
    m_embeddedBefore.clear();
    for (const auto& [vertex, body] : m_embedded) {
        const auto next = std::upper_bound(m_offsets.begin(), m_offsets.end(), vertex);
        const int shell = static_cast<int>(next - m_offsets.begin()) - 1;
        m_embeddedBefore.insert(keyOf(shell, body, vertex - m_offsets[shell]));
    }
}

/// Whether a contact is nearly at a vertex that is anchored to that body, which moves as the body does; or of a
/// triangle with an embedded one, which can be as deep anywhere.
bool ContactResponse::isHeldInside(const Contact& contact) const {
    double tied = 0.0;
    for (int a = 0; a < 3; ++a) {
        const std::pair at{globalVertex(contact, a), contact.body};
        if (m_embedded.count(at) > 0) return true;
        if (m_tied.count(at) > 0) tied += contact.weights[a];
    }
    return tied > 1.0 - kNearEdge;
}

/// Takes out of what was found what no contact can lead out of the body.
void ContactResponse::dropHeldInside() {
    if (m_tied.empty() && m_embedded.empty()) return;
    std::erase_if(m_found, [&](const Contact& contact) { return isHeldInside(contact); });
}

}  // namespace jacket
