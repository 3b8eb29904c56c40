#include "ContactManifolds.h"

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>
#include <BulletCollision/CollisionDispatch/btCollisionWorld.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <algorithm>
#include <array>
#include <utility>

#include "Convert.h"
#include "ManifoldPoint.h"
#include "ShellProxy.h"

namespace jacket::bullet {

/// A contact point and the piece of the shell it belongs to.
struct FeaturePoint {
    int feature;
    btManifoldPoint point;
};

namespace {

FeaturePoint toFeaturePoint(const BodyContact& impulse) {
    const Contact& contact = impulse.contact;
    btManifoldPoint point = toManifoldPoint(contact, *impulse.object, impulse.triangle);
    const double along = impulse.impulse.dot(contact.normal);
    const Vec3 across = impulse.impulse - along * contact.normal;
    point.m_appliedImpulse = btScalar(along);
    point.m_appliedImpulseLateral1 = btScalar(across.norm());
    point.m_lateralFrictionDir1 = toBullet(Vec3(across.stableNormalized()));
    return {contact.feature, point};
}

}  // namespace

/// The collision algorithm of a broadphase pair. It computes nothing: it sits in the pair because that is how Bullet
/// says, for every broadphase, that shell or body have left the world or drifted apart. Small, as it must fit into the
/// dispatcher's pool, whose size is the user's choice.
class ContactManifolds::Pair final : public btCollisionAlgorithm {
  public:
    struct State {
        const ShellBody& shell;
        btPersistentManifold& manifold;
        int touchedAt = 0;  ///< the last update in which they touched
        std::array<int, MANIFOLD_CACHE_SIZE> features{};
    };
    Pair(const btCollisionAlgorithmConstructionInfo& info, ContactManifolds& owner, const ShellBody& shell,
         btPersistentManifold& manifold)
        : btCollisionAlgorithm(info), m_owner(owner), m_state(std::make_unique<State>(shell, manifold)) {
        m_owner.m_alive.insert(this);
        manifold.setContactProcessingThreshold(btScalar(-BT_LARGE_FLOAT));  // solvers convert no point of it
    }
    ~Pair() override {
        std::erase(m_owner.m_pairs, this);
        m_owner.m_alive.erase(this);
        m_dispatcher->releaseManifold(&m_state->manifold);
    }
    void processCollision(const btCollisionObjectWrapper*, const btCollisionObjectWrapper*, const btDispatcherInfo&,
                          btManifoldResult*) override {}
    btScalar calculateTimeOfImpact(btCollisionObject*, btCollisionObject*, const btDispatcherInfo&,
                                   btManifoldResult*) override {
        return btScalar(1);
    }
    void getAllContactManifolds(btManifoldArray& manifolds) override { manifolds.push_back(&m_state->manifold); }

    btPersistentManifold& manifold() const { return m_state->manifold; }
    State& state() const { return *m_state; }
    void setPoints(std::span<const FeaturePoint> points);

  private:
    ContactManifolds& m_owner;
    std::unique_ptr<State> m_state;
};

/// Points that are still there keep their age and the user's data; their order is that of `points`.
void ContactManifolds::Pair::setPoints(std::span<const FeaturePoint> points) {
    btPersistentManifold& manifold = m_state->manifold;
    std::array<btManifoldPoint, MANIFOLD_CACHE_SIZE> old;
    const auto oldFeatures = m_state->features;
    const int oldCount = manifold.getNumContacts();
    for (int i = 0; i < oldCount; ++i) old[i] = manifold.getContactPoint(i);

    manifold.setNumContacts(static_cast<int>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) {
        btManifoldPoint& point = manifold.getContactPoint(static_cast<int>(i));
        point = points[i].point;
        m_state->features[i] = points[i].feature;
        for (int k = 0; k < oldCount; ++k) {
            if (oldFeatures[k] != points[i].feature) continue;
            point.m_lifeTime = old[k].m_lifeTime + 1;
            point.m_userPersistentData = std::exchange(old[k].m_userPersistentData, nullptr);
        }
    }
    for (int k = 0; k < oldCount; ++k) manifold.clearUserCache(old[k]);  // calls gContactDestroyedCallback
}

/// A pair that touches, with its strongest contacts.
struct ContactManifolds::Touch {
    Pair* pair;
    std::size_t count = 0;
    std::array<FeaturePoint, MANIFOLD_CACHE_SIZE> points{};  ///< the strongest first, of equal ones the first
    void add(const FeaturePoint& added);
};

void ContactManifolds::Touch::add(const FeaturePoint& added) {
    const auto isStronger = [](const FeaturePoint& a, const FeaturePoint& b) {
        return a.point.m_appliedImpulse > b.point.m_appliedImpulse;
    };
    const auto place = std::upper_bound(points.begin(), points.begin() + count, added, isStronger);
    if (place == points.end()) return;
    count = std::min(count + 1, points.size());
    std::copy_backward(place, points.begin() + count - 1, points.begin() + count);
    *place = added;
}

ContactManifolds::ContactManifolds() = default;
ContactManifolds::~ContactManifolds() = default;

void ContactManifolds::collect(btCollisionWorld& world, std::span<const std::unique_ptr<ShellBody>> shells) {
    m_touches.clear();
    for (const auto& shell : shells) {
        if (shell->isAsleep()) continue;
        const auto first = static_cast<std::ptrdiff_t>(m_touches.size());  // of this shell
        for (std::size_t i = 0; i < shell->contacts().size(); ++i) {
            const btCollisionObject& body = *shell->contacts()[i].object;
            Pair* pair = pairOf(world, *shell, body);
            if (!pair) continue;
            pair->state().touchedAt = m_updates;
            auto touch = std::find_if(m_touches.begin() + first, m_touches.end(),
                                      [&](const Touch& t) { return t.pair == pair; });
            if (touch == m_touches.end()) touch = m_touches.insert(touch, Touch{pair});
            touch->add(toFeaturePoint(shell->contacts()[i]));
        }
    }
}

/// None when the broadphase has no such pair or the pool of manifolds is empty.
ContactManifolds::Pair* ContactManifolds::pairOf(btCollisionWorld& world, ShellBody& shell,
                                                 const btCollisionObject& body) {
    btDispatcher& dispatcher = *world.getDispatcher();
    const btCollisionObject& proxy = shell.collisionObject();
    btBroadphasePair* found =
        world.getPairCache()->findPair(const_cast<btBroadphaseProxy*>(proxy.getBroadphaseHandle()),
                                       const_cast<btBroadphaseProxy*>(body.getBroadphaseHandle()));
    if (!found) return nullptr;
    if (m_alive.count(found->m_algorithm) > 0) return static_cast<Pair*>(found->m_algorithm);
    world.getPairCache()->cleanOverlappingPair(*found, &dispatcher);  // Bullet's own, made before the pair was hidden
    btPersistentManifold* manifold = dispatcher.getNewManifold(&proxy, &body);
    if (!manifold) return nullptr;
    const btCollisionAlgorithmConstructionInfo info(&dispatcher, 0);
    Pair* pair = new (dispatcher.allocateCollisionAlgorithm(sizeof(Pair))) Pair(info, *this, shell, *manifold);
    found->m_algorithm = pair;
    m_pairs.push_back(pair);
    return pair;
}

bool ContactManifolds::isAlive(const Pair* pair) const {
    return m_alive.count(pair) > 0;
}

void ContactManifolds::update(btCollisionWorld& world, std::span<const std::unique_ptr<ShellBody>> shells) {
    ++m_updates;
    collect(world, shells);
    m_ended.clear();  // shells that sleep touch what they touched
    std::copy_if(m_pairs.begin(), m_pairs.end(), std::back_inserter(m_ended), [&](const Pair* pair) {
        return pair->state().touchedAt != m_updates && pair->manifold().getNumContacts() > 0 &&
               !pair->state().shell.isAsleep();
    });
    // From here on every callback may remove shells and bodies, and with them pairs: ask before using one.
    for (Pair* pair : m_ended) {
        if (!isAlive(pair)) continue;
        btPersistentManifold* manifold = &pair->manifold();
        pair->setPoints({});  // first, or a callback that removes the body would end the contact once more
        if (gContactEndedCallback && isAlive(pair)) gContactEndedCallback(manifold);
    }
    for (const Touch& touch : m_touches) {
        if (!isAlive(touch.pair)) continue;
        btPersistentManifold* manifold = &touch.pair->manifold();
        const bool starts = manifold->getNumContacts() == 0;
        touch.pair->setPoints({touch.points.data(), touch.count});
        if (starts && gContactStartedCallback && isAlive(touch.pair)) gContactStartedCallback(manifold);
    }
    for (const Touch& touch : m_touches) {
        for (int i = 0; isAlive(touch.pair) && i < touch.pair->manifold().getNumContacts(); ++i) {
            if (!gContactProcessedCallback) return;
            btPersistentManifold& manifold = touch.pair->manifold();
            gContactProcessedCallback(manifold.getContactPoint(i), const_cast<btCollisionObject*>(manifold.getBody0()),
                                      const_cast<btCollisionObject*>(manifold.getBody1()));
        }
    }
}

}  // namespace jacket::bullet
