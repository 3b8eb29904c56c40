#pragma once
#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>

#include <memory_resource>
#include <vector>

#include "jacket/Types.h"

class btDynamicsWorld;

namespace jacket::bullet {

/// Where Bullet's coming solve will push two objects apart.
struct RigidImpact {
    struct Point {
        Vec3 onFirst, onSecond;  ///< world [m]
        Vec3 normal;             ///< unit, out of the second one
        double opening;          ///< least velocity with which the two are to part there [m/s]
    };
    const btCollisionObject *first, *second;
    std::pmr::vector<Point> points;
};

/// With which Bullet's solve of a step pushes apart what overlaps by -distance [m], 0 where that is not so [m/s]: by a
/// share of the depth. (Deeper than a threshold it moves bodies out, without a velocity.)
double speedApart(const btContactSolverInfo& solver, double distance, double h);

/// Bullet's solve of the coming step, of length h, looks for contacts where objects stand now. Appends to `impacts`
/// what it will find between two of them, if anything: points that without it would come closer than that solve lets
/// them, by more than `least` [m/s].
void foreseeImpact(btDynamicsWorld& world, const btCollisionObject& first, const btCollisionObject& second, double h,
                   double least, std::pmr::vector<RigidImpact>& impacts);

}  // namespace jacket::bullet
