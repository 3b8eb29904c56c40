#include "Islands.h"

#include <BulletDynamics/Dynamics/btDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <algorithm>
#include <numeric>

#include "CoupledLinks.h"
#include "RigidContacts.h"
#include "ShellProxy.h"

namespace jacket::bullet {

IslandFinder::IslandFinder(btDynamicsWorld& world, Obstacles& obstacles, std::span<ShellBody* const> shells,
                           std::pmr::memory_resource& memory)
    : m_world(world), m_obstacles(obstacles), m_shells(shells), m_memory(memory), m_neighbours(&memory) {
    collectPairs();
    collectAnchors();
    sort();
}

void IslandFinder::sort() {
    std::sort(m_neighbours.begin(), m_neighbours.end(), [](const Neighbour& a, const Neighbour& b) {
        return a.object->getWorldArrayIndex() < b.object->getWorldArrayIndex();
    });
}

IslandFinder::Neighbour& IslandFinder::neighbour(btCollisionObject& object) {
    for (Neighbour& known : m_neighbours)
        if (known.object == &object) return known;
    return m_neighbours.emplace_back(makeNeighbour(object));
}

void IslandFinder::collectPairs() {
    btOverlappingPairCache& cache = *m_world.getBroadphase()->getOverlappingPairCache();
    for (int i = 0; i < cache.getNumOverlappingPairs(); ++i) {
        const btBroadphasePair& pair = cache.getOverlappingPairArrayPtr()[i];
        auto* first = static_cast<btCollisionObject*>(pair.m_pProxy0->m_clientObject);
        auto* second = static_cast<btCollisionObject*>(pair.m_pProxy1->m_clientObject);
        notePair(first, second);
        notePair(second, first);
    }
}

void IslandFinder::notePair(const btCollisionObject* proxy, btCollisionObject* object) {
    if (proxy->getInternalType() != btCollisionObject::CO_USER_TYPE) return;
    if (!object->hasContactResponse()) return;  // a trigger, or another shell
    for (std::size_t k = 0; k < m_shells.size(); ++k)
        if (m_shells[k]->m_proxy.get() == proxy && m_shells[k]->m_proxy->mayTouch(*object) &&
            m_obstacles.isUsable(*object))
            neighbour(*object).near.push_back(static_cast<int>(k));
}

void IslandFinder::collectAnchors() {
    for (std::size_t k = 0; k < m_shells.size(); ++k)
        for (const auto& anchor : m_shells[k]->m_anchors)
            if (m_obstacles.isUsable(*anchor.body)) neighbour(*anchor.body).anchored.push_back(static_cast<int>(k));
}

/// For every shell, and then for every obstacle, the first shell of its island: shells are joined by the dynamic bodies
/// that both have near, and by pairs of bodies that are. Obstacles of prescribed motion belong to none.
std::pmr::vector<int> IslandFinder::leaders(std::span<const Obstacle> obstacles,
                                            std::span<const std::pair<int, int>> joined) const {
    const int shellCount = static_cast<int>(m_shells.size());
    std::pmr::vector<int> leader(m_shells.size() + obstacles.size(), &m_memory);
    std::iota(leader.begin(), leader.end(), 0);
    const auto find = [&](int k) {
        while (leader[k] != k) k = leader[k];
        return k;
    };
    const auto join = [&](int k, int with) {
        const int a = find(k), c = find(with);
        leader[std::max(a, c)] = std::min(a, c);
    };
    for (std::size_t b = 0; b < obstacles.size(); ++b) {
        if (obstacles[b].body.prescribed) continue;
        for (const int k : m_neighbours[b].near) join(k, shellCount + static_cast<int>(b));
        for (const int k : m_neighbours[b].anchored) join(k, shellCount + static_cast<int>(b));
    }
    for (const auto& [a, b] : joined) join(shellCount + a, shellCount + b);
    for (std::size_t k = 0; k < leader.size(); ++k) leader[k] = find(static_cast<int>(k));
    return leader;
}

std::pmr::vector<Island> IslandFinder::find(double h, bool hasMoved) {
    RigidContacts contacts(m_world, h, hasMoved, m_memory);
    std::pmr::vector<btCollisionObject*> objects(&m_memory);
    for (const Neighbour& n : m_neighbours) objects.push_back(n.object);
    for (btCollisionObject* object : contacts.join(objects)) m_neighbours.push_back(makeNeighbour(*object));
    sort();
    std::pmr::vector<Obstacle> obstacles(&m_memory);
    obstacles.reserve(m_neighbours.size());
    for (const Neighbour& n : m_neighbours) obstacles.push_back(m_obstacles.make(*n.object, h, &contacts, hasMoved));
    const std::vector<BodyCoupling> couplings = coupleLinks(obstacles, m_world, hasMoved ? 0.0 : h);
    const std::pmr::vector<RigidContact> rigidContacts = contacts.between(obstacles);
    std::pmr::vector<std::pair<int, int>> joined(&m_memory);
    for (const auto& c : couplings) joined.emplace_back(c.a, c.b);
    for (const auto& c : rigidContacts) joined.emplace_back(c.a, c.b);
    const std::pmr::vector<int> leader = leaders(obstacles, joined);

    std::pmr::vector<Island> islands(&m_memory);
    std::pmr::vector<int> islandOf(m_shells.size(), &m_memory), indexInIsland(m_shells.size(), &m_memory);
    for (std::size_t k = 0; k < m_shells.size(); ++k) {
        if (leader[k] == static_cast<int>(k)) {
            islandOf[k] = static_cast<int>(islands.size());
            islands.emplace_back(&m_memory);
        }
        islandOf[k] = islandOf[leader[k]];
        indexInIsland[k] = static_cast<int>(islands[islandOf[k]].shells.size());
        islands[islandOf[k]].shells.push_back(m_shells[k]);
    }
    const std::pmr::vector<int> nowhere(obstacles.size(), -1, &m_memory);
    std::pmr::vector<std::pmr::vector<int>> bodyIn(islands.size(), nowhere, &m_memory);  // indices, by island
    for (std::size_t b = 0; b < obstacles.size(); ++b) {
        for (std::size_t i = 0; i < islands.size(); ++i) {
            Neighbour here = makeNeighbour(*m_neighbours[b].object);
            const auto inIsland = [&](int k) { return islandOf[k] == static_cast<int>(i); };
            std::copy_if(m_neighbours[b].near.begin(), m_neighbours[b].near.end(), std::back_inserter(here.near),
                         inIsland);
            std::copy_if(m_neighbours[b].anchored.begin(), m_neighbours[b].anchored.end(),
                         std::back_inserter(here.anchored), inIsland);
            const int own = leader[m_shells.size() + b];
            const bool isPiled = own < static_cast<int>(m_shells.size()) && islandOf[own] == static_cast<int>(i);
            if (here.near.empty() && here.anchored.empty() && !isPiled) continue;
            bodyIn[i][b] = static_cast<int>(islands[i].obstacles.size());
            addObstacle(islands[i], obstacles[b], here, indexInIsland);
        }
    }
    for (std::size_t i = 0; i < islands.size(); ++i) {
        for (const auto& c : couplings)
            if (bodyIn[i][c.a] >= 0) islands[i].couplings.push_back({bodyIn[i][c.a], bodyIn[i][c.b], c.mass});
        for (const auto& c : rigidContacts)
            if (bodyIn[i][c.a] >= 0)
                islands[i].rigidContacts.push_back(
                    {bodyIn[i][c.a], bodyIn[i][c.b], c.rowA, c.rowB, c.weight, c.velocity, c.range});
    }
    return islands;
}

void IslandFinder::addObstacle(Island& island, const Obstacle& obstacle, Neighbour& neighbour,
                               std::span<const int> indexInIsland) const {
    const int body = static_cast<int>(island.obstacles.size());
    island.obstacles.push_back(obstacle);
    for (const int k : neighbour.near) island.pairs.emplace_back(indexInIsland[k], body);
    std::pmr::vector<int>& anchored = neighbour.anchored;
    anchored.erase(std::unique(anchored.begin(), anchored.end()), anchored.end());
    for (const int k : anchored)
        for (const auto& anchor : m_shells[k]->m_anchors)
            if (anchor.body == obstacle.object)
                island.anchors.push_back(
                    {indexInIsland[k], anchor.vertex, body, obstacle.start * fromBullet(anchor.local)});
}

}  // namespace jacket::bullet
