#include "FastBodies.h"

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <algorithm>

#include "ShellContacts.h"
#include "ShellProxy.h"

namespace jacket::bullet {
namespace {

constexpr double kBefore = 1e-6;  // of the step: how much earlier than the touch a body is put

bool mayCollide(const btCollisionObject& proxy, const btCollisionObject& object) {
    const btBroadphaseProxy *a = proxy.getBroadphaseHandle(), *b = object.getBroadphaseHandle();
    return a && b && (a->m_collisionFilterGroup & b->m_collisionFilterMask) != 0 &&
           (b->m_collisionFilterGroup & a->m_collisionFilterMask) != 0;
}

/// Whether it can have gone farther in the last step than its bounds are thick.
bool mayBeFast(const btRigidBody& body, double h) {
    btVector3 lower, upper;
    body.getAabb(lower, upper);
    const btVector3 extents = upper - lower;
    const double thinnest = 0.5 * double(std::min({extents.x(), extents.y(), extents.z()}));
    return double(body.getLinearVelocity().length()) * h > std::min(thinnest, 1.0);
}

}  // namespace

FastBodies::FastBodies(btCollisionWorld& world, Obstacles& obstacles, std::span<ShellBody* const> shells,
                       const Solved& solved, double h)
    : m_world(world), m_shells(shells), m_h(h) {
    const auto& objects = world.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i) {
        const btRigidBody* body = btRigidBody::upcast(objects[i]);
        if (!body || body->isStaticOrKinematicObject() || !body->isActive() || !body->hasContactResponse()) continue;
        if (!mayBeFast(*body, h)) continue;
        Obstacle obstacle = obstacles.make(*objects[i], h, nullptr, true);
        const auto known = solved.find(objects[i]);
        const Vec6 unsolved = obstacle.body.freeTwist - (known == solved.end() ? Vec6(Vec6::Zero()) : known->second);
        if (!(unsolved.head<3>().norm() * h > obstacle.body.inner)) continue;
        for (std::size_t k = 0; k < shells.size(); ++k)
            if (mayCollide(*shells[k]->m_proxy, *body) && shells[k]->m_proxy->mayTouch(*body))
                m_pairs.emplace_back(static_cast<int>(k), static_cast<int>(m_obstacles.size()));
        m_obstacles.push_back(std::move(obstacle));
    }
    if (m_pairs.empty()) return;
    for (const ShellBody* shell : shells) m_start.push_back(shell->shell().positions());
}

bool FastBodies::holdBack() {
    if (m_pairs.empty()) return false;
    const std::vector<const ShellBody*> shells(m_shells.begin(), m_shells.end());
    ShellContacts::Memory memory;
    ShellContacts sweeper(shells, m_obstacles, m_pairs, memory);
    std::vector<const Points*> start, end;
    for (std::size_t k = 0; k < m_shells.size(); ++k) {
        start.push_back(&m_start[k]);
        end.push_back(&m_shells[k]->shell().positions());
    }
    std::vector<Vec6> twists;
    for (const Obstacle& obstacle : m_obstacles) twists.push_back(obstacle.body.freeTwist);
    const std::vector<char> all(m_obstacles.size(), 1);
    std::vector<Contact> contacts;
    sweeper.sweep({start, end, twists, all, m_h}, contacts);
    std::vector<double> first(m_obstacles.size(), m_h);
    for (const Contact& c : contacts) first[c.body] = std::min(first[c.body], c.time);
    bool any = false;
    for (std::size_t b = 0; b < m_obstacles.size(); ++b) {
        if (first[b] >= m_h) continue;
        const Obstacle& obstacle = m_obstacles[b];
        const Frame touching = moved(obstacle.start, twists[b], std::max(0.0, first[b] - kBefore * m_h));
        btRigidBody::upcast(obstacle.object)->setCenterOfMassTransform(toBullet(touching));
        m_world.updateSingleAabb(obstacle.object);
        any = true;
    }
    if (any) m_world.computeOverlappingPairs();
    return any;
}

}  // namespace jacket::bullet
