#pragma once
#include <BulletDynamics/ConstraintSolver/btContactSolverInfo.h>
#include <BulletDynamics/ConstraintSolver/btTypedConstraint.h>

#include <memory_resource>
#include <vector>

#include "jacket/Contact.h"

namespace jacket::bullet {

/// One row of a joint between two bodies, as Bullet's coming solve will have it: it keeps a velocity of the two at
/// `velocity`.
struct JointRow {
    const btRigidBody *first, *second;
    Vec6 alongFirst, alongSecond;  ///< that velocity from the twists of the bodies
    double velocity;               ///< [m/s], or [rad/s] about an axis
    double ease;                   ///< how it gives way: velocity by impulse [1/kg, 1/(kg m^2)]; 0: not at all
    ImpulseRange range;
};

/// Appends the rows of a joint for a step of length h, of any of Bullet's types or of a user's own, by what it tells
/// Bullet's solver. `solver`: of its world. None if it is disabled.
void readJoint(btTypedConstraint& joint, const btContactSolverInfo& solver, double h, std::pmr::vector<JointRow>& rows);

/// Velocity of a body along a row by a unit impulse along it: 0 if nothing moves it [1/kg, 1/(kg m^2)].
double mobilityAlong(const btRigidBody& body, const Vec6& row);

}  // namespace jacket::bullet
