#include "Sleepers.h"

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include <algorithm>
#include <limits>

#include "CoupledLinks.h"
#include "ShellContacts.h"
#include "ShellProxy.h"

namespace jacket::bullet {
namespace {

constexpr double kAtRest = 0.01;     // of the mean edge: a vertex that moves no farther keeps its place
constexpr double kSlowShell = 0.03;  // of sqrt(g L), L: the shell's side: no faster on average is what only flickers
constexpr double kFall = 2e-4;       // of m g L: what loses less in waitForCalm() only creeps along with what it is on
constexpr double kMostWait = 0.9;    // of gDeactivationTime: as far as a body that touches an awake shell gets
constexpr double kSlow = 0.01;       // a body slower than this stands, and wakes no shell that it comes near [m/s]

bool samePose(const btTransform& a, const btTransform& b) {
    return (a.getOrigin() - b.getOrigin()).length2() < btScalar(1e-12) &&
           (a.getBasis()[0] - b.getBasis()[0]).length2() + (a.getBasis()[1] - b.getBasis()[1]).length2() <
               btScalar(1e-12);
}

/// For how long a shell loses no energy before it counts as calm [s]; some, however little Bullet waits.
double waitForCalm() {
    return std::max(double(gDeactivationTime), 1.5);
}

/// Whether it stands still until something wakes it.
bool sleeps(const btCollisionObject& object) {
    if (const auto* link = btMultiBodyLinkCollider::upcast(&object)) return isPrescribed(*link);
    return !mayBePushed(object) || !object.isActive();
}

/// Whether Bullet would let it sleep by now. Multibodies do not say; they must be the first.
bool mayFallAsleep(const btCollisionObject& object) {
    if (btMultiBodyLinkCollider::upcast(&object)) return sleeps(object);
    return sleeps(object) || object.getDeactivationTime() >= btScalar(kMostWait) * gDeactivationTime;
}

/// Whether what shells cannot push stays where it is from one pose to the next.
bool stays(const btCollisionObject& object, const Frame& from, const Frame& to) {
    constexpr double kMost = 1e-6;  // [m, rad]
    const bool isSame = (from.matrix() - to.matrix()).cwiseAbs().maxCoeff() < kMost;
    return standsStill(object) || (isLed(object) && isSame);
}

/// Whether a rigid contact or a joint of an island bears one of its bodies on another one.
bool liesOnAnother(const Island& island, int body, const Vec3& gravity) {
    return std::any_of(island.rigidContacts.begin(), island.rigidContacts.end(), [&](const RigidContact& pair) {
        return (pair.a == body && pair.bears(pair.rowB, gravity)) || (pair.b == body && pair.bears(pair.rowA, gravity));
    });
}

/// Whether it does not move, or is borne by rigid contacts and stands on them. (Of bodies that are borne by one another
/// the lowest one has another support.)
bool stands(const Island& island, int body, const Vec3& gravity, double h) {
    const Obstacle& obstacle = island.obstacles[body];
    const CoupledBody& coupled = obstacle.body;
    if (!mayBePushed(*obstacle.object))
        return stays(*obstacle.object, obstacle.start, moved(obstacle.start, coupled.freeTwist, h));
    return coupled.startTwist.head<3>().norm() < kSlow &&
           coupled.radius * coupled.startTwist.tail<3>().norm() < kSlow &&
           (!coupled.supports.empty() || liesOnAnother(island, body, gravity));
}

/// Left alone, Bullet would put it to sleep: it knows of no contact with the shell.
void keepAwake(btCollisionObject& object, bool isShellQuiet) {
    if (auto* link = btMultiBodyLinkCollider::upcast(&object)) {
        if (!isShellQuiet && !sleeps(object)) link->m_multiBody->wakeUp();  // sets its timer back
        return;
    }
    if (sleeps(object) || object.getActivationState() == DISABLE_DEACTIVATION) return;
    if (object.getActivationState() == WANTS_DEACTIVATION) object.setActivationState(ACTIVE_TAG);
    object.setDeactivationTime(std::min(object.getDeactivationTime(), btScalar(kMostWait) * gDeactivationTime));
}

void fallAsleep(btCollisionObject& object) {
    if (sleeps(object)) return;
    object.setActivationState(ISLAND_SLEEPING);
    if (btRigidBody* body = btRigidBody::upcast(&object)) {
        body->setLinearVelocity(btVector3(0, 0, 0));
        body->setAngularVelocity(btVector3(0, 0, 0));
    }
}

}  // namespace

Sleepers::Sleepers(btCollisionWorld& world, Obstacles& obstacles, std::span<const std::unique_ptr<ShellBody>> shells,
                   std::pmr::memory_resource& memory)
    : m_world(world), m_obstacles(obstacles), m_shells(shells), m_memory(memory) {}

bool Sleepers::contains(const ShellRest::Support& support) const {
    const auto& objects = m_world.getCollisionObjectArray();
    const int count = objects.size();
    const auto isHere = [&] {
        const btCollisionObject* object = objects[support.place];
        return object == support.object && object->getBroadphaseHandle()->getUid() == support.id;
    };
    if (support.place < count && isHere()) return true;
    for (support.place = 0; support.place < count; ++support.place)  // others have left
        if (isHere()) return true;
    return false;
}

void Sleepers::wakeUp(ShellBody& shell) {
    ShellRest& rest = *shell.m_rest;
    for (const auto& support : rest.supports)
        if (contains(support) && mayBePushed(*support.object)) support.object->activate();
    const double boundsSpeed = rest.boundsSpeed;
    rest = {};
    rest.boundsSpeed = boundsSpeed;
}

void Sleepers::wakeLed(const Vec3& gravity) {
    for (const auto& shell : m_shells) {
        if (!shell->m_rest->asleep || !isLed(*shell) || !isDisturbed(*shell, gravity)) continue;
        wakeUp(*shell);
        shell->forgetSolvedVelocity();
    }
}

/// Whether it lies on kinematic bodies and on nothing that it could push.
bool Sleepers::isLed(const ShellBody& shell) const {
    const auto& supports = shell.m_rest->supports;
    return std::all_of(supports.begin(), supports.end(), [&](const auto& support) { return contains(support); }) &&
           areLedByUser(
               supports, [](const auto& support) -> auto& { return *support.object; });
}

void Sleepers::wake(const Vec3& gravity, double h, bool disturbed) {
    for (const auto& shell : m_shells)
        if (shell->m_rest->asleep && (disturbed || isDisturbed(*shell, gravity))) wakeUp(*shell);
    wakeTouched(h);
}

/// By its user, by gravity, or by what it lies on.
bool Sleepers::isDisturbed(const ShellBody& shell, const Vec3& gravity) const {
    const ShellRest& rest = *shell.m_rest;
    if (rest.wakeAsked || rest.revision != shell.shell().revision() || rest.gravity != gravity) return true;
    return std::any_of(rest.supports.begin(), rest.supports.end(), [&](const auto& support) {
        return !contains(support) || !sleeps(*support.object) ||
               !samePose(support.object->getWorldTransform(), support.pose);
    });
}

/// By a body that comes.
void Sleepers::wakeTouched(double h) {
    btOverlappingPairCache& cache = *m_world.getBroadphase()->getOverlappingPairCache();
    const auto asleep = [&](const btCollisionObject* object) {
        const auto found = std::find_if(m_shells.begin(), m_shells.end(),
                                        [&](const auto& s) { return s->m_proxy.get() == object && s->isAsleep(); });
        return found == m_shells.end() ? nullptr : found->get();
    };
    for (int i = 0; i < cache.getNumOverlappingPairs(); ++i) {
        const btBroadphasePair& pair = cache.getOverlappingPairArrayPtr()[i];
        btCollisionObject* objects[] = {static_cast<btCollisionObject*>(pair.m_pProxy0->m_clientObject),
                                        static_cast<btCollisionObject*>(pair.m_pProxy1->m_clientObject)};
        for (const int k : {0, 1}) {
            if (objects[k]->getInternalType() != btCollisionObject::CO_USER_TYPE) continue;
            btCollisionObject& other = *objects[1 - k];
            if (standsStill(other) || !other.isActive() || !other.hasContactResponse()) continue;
            ShellBody* shell = asleep(objects[k]);
            if (shell && shell->m_proxy->mayTouch(other) && touches(*shell, other, h)) wakeUp(*shell);
        }
    }
}

bool Sleepers::touches(const ShellBody& shell, btCollisionObject& object, double h) {
    const std::vector<Obstacle> obstacle{m_obstacles.make(object, h, nullptr, true)};
    const double speed = obstacle[0].body.freeTwist.head<3>().norm() +
                         obstacle[0].body.freeTwist.tail<3>().norm() * std::min(obstacle[0].body.radius, 1e3);
    if (speed < kSlow) return false;
    const ShellBody* const shells[] = {&shell};
    constexpr std::pair<int, int> kPair[] = {{0, 0}};
    ShellContacts::Memory memory;
    ShellContacts contacts(shells, obstacle, kPair, memory);
    const Points* positions = &shell.shell().positions();
    std::vector<Contact> found;
    const double reach = 2.0 * h * speed + shell.contactThickness();
    contacts.find({{&positions, 1}, {&obstacle[0].body.freeTwist, 1}, h}, reach, reach, found);
    return !found.empty();
}

std::pmr::vector<btCollisionObject*> Sleepers::supportsOf(const ShellBody& shell) const {
    std::pmr::vector<btCollisionObject*> supports(&m_memory);
    for (const auto& contact : shell.contacts())
        if (std::find(supports.begin(), supports.end(), contact.object) == supports.end())
            supports.push_back(contact.object);
    for (const auto& anchor : shell.m_anchors) supports.push_back(anchor.body);
    std::sort(supports.begin(), supports.end());
    supports.erase(std::unique(supports.begin(), supports.end()), supports.end());
    return supports;
}

/// They and all that is in an island with them: of one that has a body awake, Bullet wakes the others.
std::pmr::vector<btCollisionObject*> Sleepers::companyOf(const std::pmr::vector<btCollisionObject*>& supports) const {
    std::pmr::vector<btCollisionObject*> company(supports, &m_memory);
    const auto& objects = m_world.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i) {
        const auto isWith = [tag = objects[i]->getIslandTag()](const auto* o) { return o->getIslandTag() == tag; };
        if (objects[i]->getIslandTag() >= 0 && std::any_of(supports.begin(), supports.end(), isWith))
            company.push_back(objects[i]);
    }
    return company;
}

void Sleepers::rest(const Vec3& gravity, double h) {
    if (gDisableDeactivation) return;
    std::pmr::vector<Candidate> candidates(&m_memory);
    for (const auto& shell : m_shells) {
        ShellRest& rest = *shell->m_rest;
        if (std::exchange(rest.wakeAsked, false)) rest.place.resize(3, 0), rest.level = 0.0;
        if (rest.asleep) continue;
        candidates.push_back(
            {shell.get(), supportsOf(*shell), keepsPlace(*shell, h), std::pmr::vector<btCollisionObject*>(&m_memory)});
        followEnergy(candidates.back(), gravity, h);
        for (btCollisionObject* object : candidates.back().supports) keepAwake(*object, candidates.back().ready);
    }
    for (Candidate& c : candidates)
        if (c.ready) c.company = companyOf(c.supports);
    dropRestless(candidates);
    for (const Candidate& c : candidates) {
        if (!c.ready) continue;
        ShellRest& rest = *c.shell->m_rest;
        c.shell->fallAsleep();
        rest.asleep = true;
        rest.revision = c.shell->shell().revision();
        for (btCollisionObject* object : c.company) jacket::bullet::fallAsleep(*object);
        for (btCollisionObject* object : c.supports)
            rest.supports.push_back({object, object->getBroadphaseHandle()->getUid(), object->getWorldTransform(),
                                     object->getWorldArrayIndex()});
    }
}

/// Whether no vertex has left its place for as long as Bullet waits; or what goes on moving though it starts from
/// standing still in every step, which comes no closer to rest.
bool Sleepers::keepsPlace(ShellBody& shell, double h) const {
    ShellRest& rest = *shell.m_rest;
    if (!shell.options().sleeping) return false;
    const Points& x = shell.shell().positions();
    const double room = kAtRest * shell.shell().meanEdge();
    if (rest.place.cols() != x.cols() || (x - rest.place).colwise().squaredNorm().maxCoeff() > room * room) {
        rest.place = x;
        rest.quiet = 0.0;
    }
    rest.quiet += h;
    return rest.quiet >= double(gDeactivationTime) || rest.damped >= 2.0 * waitForCalm();
}

/// Whether it has not moved in the last step, or, if shells can push it, for a while.
bool Sleepers::isQuiet(const btCollisionObject& object, double h) const {
    if (mayBePushed(object)) return btRigidBody::upcast(&object) && mayFallAsleep(object);
    return stays(object, m_obstacles.startOf(object, h), fromBullet(object.getWorldTransform()));
}

void Sleepers::followEnergy(const Candidate& candidate, const Vec3& gravity, double h) const {
    ShellRest& rest = *candidate.shell->m_rest;
    const Shell& shell = candidate.shell->shell();
    const bool isAsBefore = rest.gravity == gravity && rest.revision == shell.revision();
    rest.gravity = gravity;
    rest.revision = shell.revision();
    const double waited = std::exchange(rest.level, 0.0);
    if (!isAsBefore || !candidate.shell->options().sleeping || candidate.supports.empty() ||
        !std::all_of(candidate.supports.begin(), candidate.supports.end(),
                     [&](const btCollisionObject* object) { return isQuiet(*object, h); }))
        return;
    const double weightTimesSide = shell.masses().sum() * gravity.norm() * shell.side();
    const double kinetic = shell.kineticEnergy();
    if (!(kinetic < 0.5 * kSlowShell * kSlowShell * weightTimesSide)) return;
    const double energy =
        kinetic + shell.elasticEnergy(shell.positions()) - gravity.dot(shell.positions() * shell.masses());
    const bool hasFallen = waited == 0.0 || energy < rest.lowest - kFall * weightTimesSide;
    rest.lowest = hasFallen ? energy : rest.lowest - h / waitForCalm() * kFall * weightTimesSide;
    rest.level = (hasFallen ? 0.0 : waited) + h;
}

bool Sleepers::isCalm(const Island& island, const Vec3& gravity, double h) {
    const double wait = waitForCalm();
    const auto isLevel = [&](const ShellBody* shell) {
        return shell->options().sleeping && shell->m_rest->level >= wait;
    };
    if (gDisableDeactivation || island.pairs.empty() ||
        !std::all_of(island.shells.begin(), island.shells.end(), isLevel))
        return false;
    for (int b = 0; b < std::ssize(island.obstacles); ++b)
        if (!stands(island, b, gravity, h)) return false;
    return true;
}

/// A shell stays awake with any body that it touches or that is in an island with one, and that with any shell that it
/// touches.
void Sleepers::dropRestless(std::span<Candidate> candidates) const {
    for (bool changed = true; changed;) {
        changed = false;
        std::pmr::vector<btCollisionObject*> awake(&m_memory);
        for (const Candidate& c : candidates)
            if (!c.ready) awake.insert(awake.end(), c.supports.begin(), c.supports.end());
        for (Candidate& c : candidates) {
            const bool restless = std::any_of(c.company.begin(), c.company.end(), [&](const btCollisionObject* o) {
                return !mayFallAsleep(*o) || (!sleeps(*o) && std::find(awake.begin(), awake.end(), o) != awake.end());
            });
            if (!c.ready || !restless) continue;
            c.ready = false;
            changed = true;
        }
    }
}

}  // namespace jacket::bullet
