#include "RigidImpacts.h"

#include <BulletCollision/BroadphaseCollision/btCollisionAlgorithm.h>
#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>
#include <BulletDynamics/Dynamics/btDynamicsWorld.h>

#include <algorithm>
#include <utility>

#include "BodyTwist.h"
#include "Convert.h"

namespace jacket::bullet {
namespace {

/// Bullet's answer to a touch: what is apart may close the gap, what is not is pushed out, and what comes fast enough
/// bounces.
double openingOf(const btContactSolverInfo& solver, double distance, double closing, double restitution, double h) {
    const double bounce = closing > double(solver.m_restitutionVelocityThreshold) ? restitution * closing : 0.0;
    return bounce + speedApart(solver, distance, h) - std::max(0.0, distance + double(solver.m_linearSlop)) / h;
}

/// Takes the points that a collision algorithm finds, instead of a manifold that outlives it.
class ImpactFinder : public btManifoldResult {
  public:
    ImpactFinder(const btCollisionObjectWrapper& first, const btCollisionObjectWrapper& second,
                 const btContactSolverInfo& solver, double h, double least, RigidImpact& impact)
        : btManifoldResult(&first, &second),
          m_solver(solver),
          m_h(h),
          m_least(least),
          m_restitution(double(calculateCombinedRestitution(impact.first, impact.second))),
          m_impact(impact) {}

    void addContactPoint(const btVector3& normalOnB, const btVector3& pointOnB, btScalar distance) override {
        if (distance > getPersistentManifold()->getContactBreakingThreshold()) return;
        const bool isSwapped = getBody0Internal() != m_impact.first;
        const Vec3 other = fromBullet(btVector3(pointOnB + distance * normalOnB)), own = fromBullet(pointOnB);
        const Vec3 normal = (isSwapped ? -1.0 : 1.0) * fromBullet(normalOnB);
        const Vec3 &onFirst = isSwapped ? own : other, &onSecond = isSwapped ? other : own;
        const double parting =
            normal.dot(pointVelocity(*m_impact.first, onFirst, 0.0) - pointVelocity(*m_impact.second, onSecond, 0.0));
        const double opening = openingOf(m_solver, double(distance), -parting, m_restitution, m_h);
        if (parting < opening - m_least) m_impact.points.push_back({onFirst, onSecond, normal, opening});
    }

  private:
    const btContactSolverInfo& m_solver;
    double m_h, m_least, m_restitution;
    RigidImpact& m_impact;
};

}  // namespace

double speedApart(const btContactSolverInfo& solver, double distance, double h) {
    const double depth = -(distance + double(solver.m_linearSlop));
    const bool isMoved = solver.m_splitImpulse != 0 && depth >= -double(solver.m_splitImpulsePenetrationThreshold);
    return isMoved ? 0.0 : std::max(0.0, depth) * double(solver.m_erp2) / h;
}

void foreseeImpact(btDynamicsWorld& world, const btCollisionObject& first, const btCollisionObject& second, double h,
                   double least, std::pmr::vector<RigidImpact>& impacts) {
    btDispatcher& dispatcher = *world.getDispatcher();
    if (!dispatcher.needsCollision(&first, &second) || !dispatcher.needsResponse(&first, &second)) return;
    const auto wrapped = [](const btCollisionObject& object) {
        return btCollisionObjectWrapper(nullptr, object.getCollisionShape(), &object, object.getWorldTransform(), -1,
                                        -1);
    };
    const btCollisionObjectWrapper firstWrapper = wrapped(first), secondWrapper = wrapped(second);
    btCollisionAlgorithm* algorithm =
        dispatcher.findAlgorithm(&firstWrapper, &secondWrapper, nullptr, BT_CONTACT_POINT_ALGORITHMS);
    if (!algorithm) return;
    RigidImpact impact{&first, &second, std::pmr::vector<RigidImpact::Point>(impacts.get_allocator())};
    ImpactFinder finder(firstWrapper, secondWrapper, world.getSolverInfo(), h, least, impact);
    algorithm->processCollision(&firstWrapper, &secondWrapper, world.getDispatchInfo(), &finder);
    algorithm->~btCollisionAlgorithm();
    dispatcher.freeCollisionAlgorithm(algorithm);
    if (!impact.points.empty()) impacts.push_back(std::move(impact));
}

}  // namespace jacket::bullet
