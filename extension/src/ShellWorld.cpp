#include "jacket/bullet/ShellWorld.h"

#include <BulletCollision/CollisionDispatch/btCollisionWorld.h>
#include <BulletCollision/CollisionDispatch/btGhostObject.h>
#include <BulletDynamics/Dynamics/btDynamicsWorld.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <LinearMath/btIDebugDraw.h>
#include <LinearMath/btTransformUtil.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <memory_resource>
#include <optional>
#include <stdexcept>
#include <unordered_map>

#include "ArticulatedBody.h"
#include "BodyTwist.h"
#include "CarriedVertices.h"
#include "Checks.h"
#include "ContactManifolds.h"
#include "Convert.h"
#include "CoupledLinks.h"
#include "FastBodies.h"
#include "Islands.h"
#include "ObjectId.h"
#include "ShellContacts.h"
#include "ShellProxy.h"
#include "Sleepers.h"
#include "SolvedIslands.h"
#include "Teleports.h"
#include "TurnToAct.h"
#include "WarmStart.h"
#include "jacket/Island.h"

namespace jacket::bullet {
namespace {

double seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A detector whose time is taken.
class TimedDetector : public ContactDetector {
  public:
    TimedDetector(ContactDetector& detector, double& sum) : m_detector(detector), m_sum(sum) {}
    void find(const ContactPose& pose, double vertexReach, double faceReach, std::vector<Contact>& contacts) override {
        const double start = seconds();
        m_detector.find(pose, vertexReach, faceReach, contacts);
        m_sum += seconds() - start;
    }
    void sweep(const ContactSweep& motion, std::vector<Contact>& contacts) override {
        const double start = seconds();
        m_detector.sweep(motion, contacts);
        m_sum += seconds() - start;
    }
    bool crosses(const ContactSweep& motion) override {
        const double start = seconds();
        const bool any = m_detector.crosses(motion);
        m_sum += seconds() - start;
        return any;
    }
    void advance(std::span<const Vec6> twists, double time) override { m_detector.advance(twists, time); }

  private:
    ContactDetector& m_detector;
    double& m_sum;
};

/// Speed of a collision object's centre of mass; of a ghost, which has none, by its last two poses [m/s].
double speedOf(const btCollisionObject& object, Obstacles& obstacles, double h) {
    if (const auto* body = btRigidBody::upcast(&object)) return double(body->getLinearVelocity().length());
    if (const auto* link = btMultiBodyLinkCollider::upcast(&object)) return twistOf(*link).head<3>().norm();
    if (!btGhostObject::upcast(&object)) return 0.0;
    const Vec3 way = fromBullet(object.getWorldTransform().getOrigin()) - obstacles.startOf(object, h).translation();
    return way.norm() / h;
}

/// Where Bullet takes a body with a twist in a step: it does not let it turn by more than a certain angle.
Frame ledByBullet(const Obstacle& obstacle, const Vec6& twist, double h) {
    btTransform end;
    btTransformUtil::integrateTransform(toBullet(obstacle.start), toBullet(Vec3(twist.head<3>())),
                                        toBullet(Vec3(twist.tail<3>())), btScalar(h), end);
    return fromBullet(end);
}

/// Puts a free body that has moved already where the solve of its motion, which followed, lets it be.
void moveAnew(btCollisionWorld& world, const Obstacle& obstacle, const Vec6& solved, double h) {
    btRigidBody* body = btRigidBody::upcast(obstacle.object);
    if (!body || obstacle.body.prescribed || solved == obstacle.body.freeTwist) return;
    const Vec6 twist = obstacle.body.startTwist + solved - obstacle.body.freeTwist;
    body->setCenterOfMassTransform(toBullet(moved(obstacle.start, twist, h)));
    world.updateSingleAabb(body);
}

/// The world's gravity, or `last` while that is not finite: no shell could follow it.
btVector3 usableGravity(const btDynamicsWorld& world, const btVector3& last) {
    const btVector3 gravity = world.getGravity();
    return fromBullet(gravity).allFinite() ? gravity : last;
}

/// Fastest that any point of any moving object goes, roughly: how far bounds must reach ahead [m/s].
double fastestObject(const btCollisionWorld& world, Obstacles& obstacles, double h) {
    double speed = 0.0;
    const auto& objects = world.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i) {
        const btCollisionObject& object = *objects[i];
        if (!standsStill(object) && object.isActive()) speed = std::max(speed, speedOf(object, obstacles, h));
    }
    return speed;
}

/// Of ghosts: character controllers, which are actions, move them when Bullet has looked for pairs.
void updateBoundsOfGhosts(btCollisionWorld& world) {
    const auto& objects = world.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i)
        if (btGhostObject::upcast(objects[i])) world.updateSingleAabb(objects[i]);
}

}  // namespace

/// What the shells gave a body in a step, as one impulse.
struct Push {
    Vec3 impulse = Vec3::Zero();  ///< [N s]
    bool isNew = false;           ///< of this step
};

struct ShellWorld::Impl {
    explicit Impl(ShellWorld& shells) : turn(shells) {}
    std::pmr::unsynchronized_pool_resource memory;  ///< what a step gives back, the next one takes
    TurnToAct turn;
    ShellContacts::Memory contactMemory;
    Obstacles obstacles;
    std::map<const ShellBody*, IslandSolver> solvers;  ///< of each island, by its first shell
    CarriedVertices carried;
    FastBodies::Solved solved{&memory};
    SolvedIslands islands{&memory};
    AllTakenBack takenBack{&memory};  ///< of bodies that are to be solved with anew
    /// Of a body whose step was solved in parts, where Bullet's one twist takes it elsewhere than it was solved to go.
    struct Alteration {
        btRigidBody* body;
        int objectId;
        Frame led, end;
    };
    std::pmr::vector<Alteration> alterations{&memory};
    std::unordered_map<const btCollisionObject*, Push> pushes;
    ContactManifolds manifolds;
    ShellChecks checks;
    Wind wind;
    bool hasWind = false, windChanged = false;
    btVector3 gravity{0, 0, 0};        ///< of the last solve, finite
    std::unique_ptr<WorkerTeam> team;  ///< none: one thread
};

ShellWorld::ShellWorld(btDynamicsWorld& world) : m_world(world), m_impl(std::make_unique<Impl>(*this)) {
    if (m_world.getWorldType() == BT_SIMPLE_DYNAMICS_WORLD)
        throw std::invalid_argument("ShellWorld: a btSimpleDynamicsWorld runs no actions, so shells would never move");
    m_impl->obstacles.setGravityIsNoForce(m_world.getWorldType() == BT_DEFORMABLE_MULTIBODY_DYNAMICS_WORLD);
    m_world.addAction(this);
}

ShellWorld::~ShellWorld() {
    for (const auto& shell : m_shells) m_world.removeCollisionObject(shell->m_proxy.get());
    m_world.removeAction(this);
    m_world.removeAction(this);  // where it waits to be called again, see TurnToAct
}

ShellBody& ShellWorld::add(const TriangleMesh& mesh, const ShellMaterial& material, const ShellOptions& options) {
    std::unique_ptr<ShellBody> shell(new ShellBody(mesh, material, options));
    ShellBody& added = *shell;
    constexpr double kUsualStep = 1.0 / 60.0;
    updateBounds(added, fastestObject(m_world, m_impl->obstacles, kUsualStep), kUsualStep);
    m_shells.push_back(std::move(shell));
    m_world.addCollisionObject(added.m_proxy.get(), options.collisionGroup, options.collisionMask);
    m_report.shells = size();
    return added;
}

void ShellWorld::remove(ShellBody& shell) {
    const auto found = std::find_if(m_shells.begin(), m_shells.end(), [&](const auto& s) { return s.get() == &shell; });
    if (found == m_shells.end()) throw std::invalid_argument("ShellWorld::remove: the shell is not in this world");
    Sleepers(m_world, m_impl->obstacles, m_shells, m_impl->memory).wakeUp(shell);  // and what lay on it
    const std::unique_ptr<ShellBody> removed = std::move(*found);
    m_shells.erase(found);
    m_impl->solvers.clear();  // they remember contacts by shell
    m_impl->carried.clear();
    m_impl->islands.forget(*removed);
    m_impl->checks.forget(*removed);
    m_report.shells = size();
    m_world.removeCollisionObject(removed->m_proxy.get());  // last: ends contacts, of which the user's callbacks hear
}

ShellBody* ShellWorld::find(const btCollisionObject& object) {
    const auto found =
        std::find_if(m_shells.begin(), m_shells.end(), [&](const auto& s) { return s->m_proxy.get() == &object; });
    return found == m_shells.end() ? nullptr : found->get();
}

void ShellWorld::setWind(const Wind& wind) {
    validate(wind);
    if (m_impl->hasWind && m_impl->wind == wind) return;
    m_impl->wind = wind;
    m_impl->hasWind = m_impl->windChanged = true;
}

void ShellWorld::clearWind() {
    m_impl->windChanged = m_impl->windChanged || m_impl->hasWind;
    m_impl->hasWind = false;
}

void ShellWorld::setThreads(int threads) {
    if (threads < 1)
        throw std::invalid_argument("ShellWorld::setThreads: threads must be >= 1, got " + std::to_string(threads));
    if (threads == this->threads()) return;
    m_impl->team = threads == 1 ? nullptr : std::make_unique<WorkerTeam>(threads);
}

int ShellWorld::threads() const {
    return m_impl->team ? m_impl->team->threads() : 1;
}

std::vector<std::string> ShellWorld::takeWarnings() {
    std::vector<std::string> warnings = m_impl->obstacles.takeWarnings();
    for (std::string& warning : m_impl->checks.takeWarnings()) warnings.push_back(std::move(warning));
    return warnings;
}

/// Bullet has just moved the bodies by the velocities that the last solve, and its own contacts, gave them. Here the
/// shells move along with the velocities of the same solve, so that shells and bodies are drawn at the same instant;
/// then the next solve looks at this configuration, and its impulses enter Bullet's next solve. Shells among kinematic
/// bodies have that solve when these have moved.
void ShellWorld::updateAction(btCollisionWorld* world, btScalar h) {
    if (!m_impl->turn.isLast(m_world)) return;
    if (!m_impl->checks.isLength(h)) {
        ++m_report.rejectedSteps;
        return;
    }
    if (h == btScalar(0)) return;
    alterBodies(*world, false);
    if (m_shells.empty()) return forgetPushes(*world);
    const double start = seconds();
    WorldReport report{.shells = size()};
    report.rejectedSteps = m_report.rejectedSteps;
    report.unconvergedSteps = m_report.unconvergedSteps;
    report.unsettledSteps = m_report.unsettledSteps;
    report.passedSteps = m_report.passedSteps;
    m_report = report;
    m_impl->obstacles.beginStep();
    releaseAnchors(*world);
    followTeleports(double(h));
    followGravity(double(h));
    takeBackSolves(*world, double(h));
    std::pmr::vector<ShellBody*> all(&m_impl->memory);
    for (const auto& shell : m_shells) all.push_back(shell.get());
    FastBodies fast(*world, m_impl->obstacles, all, m_impl->solved, double(h));  // as Bullet has moved them
    const Vec3 gravity = fromBullet(m_impl->gravity);
    Sleepers sleepers(*world, m_impl->obstacles, m_shells, m_impl->memory);
    sleepers.wakeLed(gravity);
    solveNewcomers(*world, double(h));
    moveShells(*world, double(h));
    fast.holdBack();
    m_impl->solved.clear();
    m_impl->islands.clear();
    sleepers.wake(gravity, double(h), std::exchange(m_impl->windChanged, false));
    std::erase_if(all, [](const ShellBody* shell) { return shell->isAsleep(); });
    m_report.awake = static_cast<int>(all.size());
    if (!all.empty())
        for (Island& island : IslandFinder(m_world, m_impl->obstacles, all, m_impl->memory).find(double(h), false)) {
            m_impl->checks.look(island);
            if (areLedByUser(
                    island.obstacles, [](const Obstacle& o) -> auto& { return *o.object; }))
                for (ShellBody* shell : island.shells) shell->forgetSolvedVelocity();
            else
                solveIsland(island, double(h), &m_impl->islands);
        }
    for (const ShellBody* shell : all) m_report.contacts += static_cast<int>(shell->contacts().size());
    countStep();
    forgetPushes(*world);
    sleepers.rest(gravity, double(h));
    updateAllBounds(double(h));
    for (const auto& shell : m_shells) Teleports::notePoses(*shell);
    m_impl->manifolds.update(*world, m_shells);
    m_report.secondsTotal = seconds() - start;
}

/// Gravity has changed since velocities were solved for: Bullet's bodies have just fallen with the new one.
void ShellWorld::followGravity(double h) {
    m_impl->checks.lookAtGravity(m_world.getGravity());
    const btVector3 before = std::exchange(m_impl->gravity, usableGravity(m_world, m_impl->gravity));
    if (before == m_impl->gravity) return;
    for (const auto& body : m_shells) {
        if (!body->m_hasVelocity || body->isAsleep()) continue;
        Shell& shell = body->m_shell;
        const Vec3 change = h * fromBullet(m_impl->gravity) - body->m_pendingGravity;
        Points v = shell.velocities();
        for (int i = 0; i < shell.vertexCount(); ++i) v.col(i) += shell.freedom(i) * change;
        shell.setVelocities(v);
    }
}

/// A removed body lets go, and so does every body of a vertex that the user has pinned or guided since.
void ShellWorld::releaseAnchors(btCollisionWorld& world) {
    for (const auto& shell : m_shells) {
        shell->endAnchorsOfHeld();
        std::erase_if(shell->m_anchors, [&](auto& anchor) {
            const int id = idOf(world, anchor.body);
            if (anchor.bodyId < 0) anchor.bodyId = id;
            return id < 0 || id != anchor.bodyId;
        });
    }
}

/// Shells go with bodies that have been teleported since the last step, or are let go of by them.
void ShellWorld::followTeleports(double h) {
    Teleports teleports(m_impl->obstacles, h);
    for (const auto& shell : m_shells) {
        const auto [hasMoved, letGo] = teleports.follow(*shell);
        if (hasMoved) m_impl->carried.forget(*shell);
        if (letGo > 0) m_impl->checks.noteLetGo(*shell, letGo);
    }
}

/// Shells that were added, or given a velocity, since the last step, or are led by their user, have no solved velocity
/// to move with: they get one for the motion that the bodies have already made. Bodies that they push in it have gone
/// too far, or not far enough.
void ShellWorld::solveNewcomers(btCollisionWorld& world, double h) {
    std::pmr::vector<ShellBody*> newcomers(&m_impl->memory);
    for (const auto& shell : m_shells)
        if (!shell->m_hasVelocity && !shell->isAsleep()) newcomers.push_back(shell.get());
    if (newcomers.empty()) return;
    m_impl->carried.moveToStart(world, m_impl->obstacles, fromBullet(m_impl->gravity), h);
    const double fastest = fastestObject(world, m_impl->obstacles, h);
    updateBoundsOfGhosts(world);
    for (ShellBody* shell : newcomers) {  // Bullet's pairs know nothing of how they move
        updateBounds(*shell, fastest, h);
        world.updateSingleAabb(shell->m_proxy.get());
    }
    world.computeOverlappingPairs();
    for (Island& island : IslandFinder(m_world, m_impl->obstacles, newcomers, m_impl->memory).find(h, true)) {
        solveIsland(island, h, nullptr);
        for (const Obstacle& obstacle : island.obstacles)
            if (const auto known = m_impl->solved.find(obstacle.object); known != m_impl->solved.end())
                moveAnew(world, obstacle, known->second, h);
    }
    alterBodies(world, true);
    while (!m_impl->takenBack.empty()) {  // of bodies that no shell comes near now
        auto* object = const_cast<btCollisionObject*>(m_impl->takenBack.begin()->first);
        react(*object, Vec6::Zero());
    }
}

/// Of shells that were solved for a motion which a body of theirs has not made. For that which it has made they are
/// newcomers.
void ShellWorld::takeBackSolves(const btCollisionWorld& world, double h) {
    m_impl->takenBack = m_impl->islands.takeBack(world, fromBullet(m_impl->gravity), h);
    for (const auto& [object, solve] : m_impl->takenBack) {
        m_impl->obstacles.noteStart(*object, solve.start);
        m_impl->solved[object] = twistBetween(solve.start, fromBullet(object->getWorldTransform()), h);
    }
}

/// Bodies that Bullet's one twist a step took elsewhere than they were solved to go. `isSolvedAnew`: Bullet had moved
/// them before.
void ShellWorld::alterBodies(btCollisionWorld& world, bool isSolvedAnew) {
    for (const auto& [body, objectId, led, end] : m_impl->alterations) {
        if (idOf(world, body) != objectId || body->isStaticOrKinematicObject()) continue;
        const Frame strayed = led.inverse(Eigen::Isometry) * fromBullet(body->getWorldTransform());
        body->setCenterOfMassTransform(toBullet(isSolvedAnew ? end : end * strayed));
        world.updateSingleAabb(body);
    }
    m_impl->alterations.clear();
}

void ShellWorld::moveShells(btCollisionWorld& world, double h) {
    for (const auto& shell : m_shells)
        if (shell->m_hasVelocity && !shell->isAsleep()) shell->m_shell.advance(h);
    m_impl->carried.move(world, fromBullet(m_impl->gravity), h);
    for (const auto& shell : m_shells)
        if (!shell->isAsleep()) shell->publish();
}

/// `islands`: to note it in, if there are any.
void ShellWorld::solveIsland(Island& island, double h, SolvedIslands* islands) {
    if (islands) islands->begin(island);
    std::pmr::vector<const ShellBody*> bodies(island.shells.begin(), island.shells.end(), &m_impl->memory);
    std::pmr::vector<Shell*> shells(&m_impl->memory);
    for (ShellBody* shell : island.shells) shells.push_back(&shell->m_shell);
    std::pmr::vector<CoupledBody> coupled(&m_impl->memory);
    coupled.reserve(island.obstacles.size());
    for (const Obstacle& obstacle : island.obstacles) {
        coupled.push_back(obstacle.body);
        if (const auto given = m_impl->takenBack.find(obstacle.object); given != m_impl->takenBack.end())
            coupled.back().freeTwist -= obstacle.body.mass.ldlt().solve(given->second.impulse);
    }
    ShellContacts contacts(bodies, island.obstacles, island.pairs, m_impl->contactMemory, m_impl->team.get());
    TimedDetector timed(contacts, m_report.secondsContact);
    IslandInput input;
    input.h = h;
    input.gravity = fromBullet(m_impl->gravity);
    input.wind = m_impl->hasWind ? &m_impl->wind : nullptr;
    input.shells = shells;
    input.bodies = coupled;
    input.couplings = island.couplings;
    input.rigidContacts = island.rigidContacts;
    input.anchors = island.anchors;
    input.contacts = island.pairs.empty() ? nullptr : &timed;
    input.isCalm = !m_impl->hasWind && Sleepers::isCalm(island, input.gravity, h);
    for (ShellBody* shell : island.shells) shell->m_rest->damped = input.isCalm ? shell->m_rest->damped + h : 0.0;
    input.inOnePiece = std::any_of(island.obstacles.begin(), island.obstacles.end(), [](const Obstacle& obstacle) {
        return !obstacle.body.prescribed && !btRigidBody::upcast(obstacle.object);
    });
    input.restingSpeed = double(m_world.getSolverInfo().m_restitutionVelocityThreshold);
    input.clock = &seconds;
    input.team = m_impl->team.get();
    const double start = seconds();
    const StepReport& report = m_impl->solvers[island.shells.front()].solve(input);
    m_report.secondsSolve += seconds() - start;
    m_report.times += report.times;
    accept(island, report, coupled, h);
    if (islands && report.finite && !report.passed && !report.mayPass) islands->end(island, coupled, h);
}

void ShellWorld::accept(Island& island, const StepReport& report, std::span<const CoupledBody> coupled, double h) {
    m_report.pcgIterations += report.pcgIterations;
    m_report.solves += report.solves;
    m_report.passed = m_report.passed || report.passed || report.mayPass;
    m_report.limited = m_report.limited || report.limited;
    m_report.converged = m_report.converged && report.converged;
    m_report.settled = m_report.settled && report.settled;
    m_report.finite = m_report.finite && report.finite;
    for (ShellBody* shell : island.shells) {
        shell->forgetImpulses();
        shell->m_hasVelocity = report.finite;  // a rejected step: stands still, and is solved afresh
        shell->m_pendingGravity = h * fromBullet(m_impl->gravity);
    }
    if (!report.finite) return;
    const auto endOf = [&](int b) { return moved(island.obstacles[b].start, coupled[b].motion, 1.0); };
    for (const ContactImpulse& impulse : report.contacts) {
        ShellBody& shell = *island.shells[impulse.contact.shell];
        shell.note(shell.describe(impulse, *island.obstacles[impulse.contact.body].object));
        const auto& [contact, given, sticks, slip] = impulse;
        if (const Obstacle& obstacle = island.obstacles[contact.body];
            contact.isVertex() && !standsStill(*obstacle.object))
            m_impl->carried.addTouching(shell, contact.vertices[0], obstacle, endOf(contact.body), contact.normal);
    }
    for (const Anchor& anchor : island.anchors) {
        ShellBody& shell = *island.shells[anchor.shell];
        shell.note(anchor);
        m_impl->carried.addTied(shell, anchor.vertex, island.obstacles[anchor.body], endOf(anchor.body), anchor.point);
    }
    for (std::size_t b = 0; b < coupled.size(); ++b) {
        react(*island.obstacles[b].object, coupled[b].impulse);
        btCollisionObject* object = island.obstacles[b].object;
        const bool isAltered = !coupled[b].prescribed && coupled[b].motion != h * coupled[b].twist;
        if (!report.passed || isAltered) m_impl->solved[object] = coupled[b].twist;  // a bent way is not swept again
        if (isAltered)
            m_impl->alterations.push_back({btRigidBody::upcast(object), idOf(m_world, object),
                                           ledByBullet(island.obstacles[b], coupled[b].twist, h), endOf(int(b))});
    }
}

void ShellWorld::countStep() {
    m_report.passedSteps += m_report.passed ? 1 : 0;
    m_report.unconvergedSteps += m_report.converged ? 0 : 1;
    m_report.unsettledSteps += m_report.settled ? 0 : 1;
    m_report.rejectedSteps += m_report.finite ? 0 : 1;
}

/// `given`: impulse and moment of a solve [N s, N m s], instead of those that were taken back.
void ShellWorld::react(btCollisionObject& object, const Vec6& given) {
    const auto before = m_impl->takenBack.extract(&object);
    if (object.isStaticOrKinematicObject() || (given.isZero(0.0) && !before)) return;
    const double still = 0.02 * double(m_impl->gravity.length()) / 60.0;
    if (auto* link = btMultiBodyLinkCollider::upcast(&object)) {
        pushLink(*link, given, still);
        return;
    }
    btRigidBody* body = btRigidBody::upcast(&object);
    if (!body) return;
    const Vec3 impulse = given.head<3>();
    Push& last = m_impl->pushes[&object];
    if (!body->isActive()) {  // a feather does not wake a sleeping crate, nor does what it fell asleep under
        const double kick = double(body->getInvMass()) * (impulse - last.impulse).norm();
        if (kick > still) body->activate();
    }
    foretellLoad(*m_world.getDispatcher(), object, impulse - last.impulse);
    last = {impulse, true};
    if (!body->isActive()) return;
    const Vec6 change = before ? Vec6(given - before.mapped().impulse) : given;
    body->applyCentralImpulse(toBullet(Vec3(change.head<3>())));
    body->applyTorqueImpulse(toBullet(Vec3(change.tail<3>())));
}

/// Bodies that no shell pushes any more.
void ShellWorld::forgetPushes(const btCollisionWorld& world) {
    for (auto it = m_impl->pushes.begin(); it != m_impl->pushes.end();) {
        auto& [object, push] = *it;
        const bool isHere = idOf(world, object) >= 0;
        if (isHere && (std::exchange(push.isNew, false) || !object->isActive())) {
            ++it;
            continue;
        }
        if (isHere) foretellLoad(*m_world.getDispatcher(), *object, -push.impulse);
        it = m_impl->pushes.erase(it);
    }
}

/// Bounds of sleeping shells stay, unless something has become faster than they allow for.
void ShellWorld::updateAllBounds(double h) {
    const double fastest = fastestObject(m_world, m_impl->obstacles, h);
    for (const auto& shell : m_shells)
        if (!shell->isAsleep() || fastest > shell->m_rest->boundsSpeed) updateBounds(*shell, fastest, h);
}

void ShellWorld::updateBounds(ShellBody& shell, double fastest, double h) {
    const Points& x = shell.m_shell.positions();
    const Points& v = shell.m_shell.velocities();
    const Vec3 lower = x.rowwise().minCoeff(), upper = x.rowwise().maxCoeff();
    const double gravity = double(usableGravity(m_world, m_impl->gravity).length());
    const double ahead =
        2.0 * h * (fastest + v.colwise().norm().maxCoeff()) + 4.0 * h * h * gravity + shell.contactThickness() + 1e-3;
    shell.m_proxy->keepHidden();
    shell.m_proxy->shape().setBounds(toBullet(lower), toBullet(upper), btScalar(ahead));
    shell.m_rest->boundsSpeed = fastest;
}

void ShellWorld::debugDraw(btIDebugDraw* drawer) {
    if (!drawer) return;
    const btVector3 awake(0.2, 0.4, 0.8), asleep(0.5, 0.5, 0.5), pin(0.9, 0.6, 0.1), contact(0.9, 0.1, 0.1);
    for (const auto& shell : m_shells) {
        const auto x = shell->positions();
        const btVector3& wire = shell->isAsleep() ? asleep : awake;
        for (const auto& e : shell->shell().mesh().edges()) drawer->drawLine(x[e.v0], x[e.v1], wire);
        for (int i = 0; i < shell->vertexCount(); ++i)
            if (shell->shell().isPinned(i)) drawer->drawSphere(x[i], btScalar(0.01), pin);
        for (const ContactImpulse& c : shell->contacts()) {
            const btVector3 at = toBullet(c.contact.point);
            drawer->drawLine(at, at + btScalar(0.1) * toBullet(c.contact.normal), contact);
        }
    }
}

}  // namespace jacket::bullet
