#pragma once
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorldMt.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <jacket/testing.h>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // GCC 12 of btReducedVector's copies
#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#pragma GCC diagnostic pop

/// What Bullet's other worlds are made of.
namespace jacket::testing {

template <>
struct WorldParts<btDiscreteDynamicsWorldMt> {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btConstraintSolverPoolMt solvers{1};
    btDiscreteDynamicsWorldMt world{&dispatcher, &broadphase, &solvers, nullptr, &configuration};
};

template <>
struct WorldParts<btMultiBodyDynamicsWorld> {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btMultiBodyConstraintSolver solver;
    btMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
};

template <>
struct WorldParts<btSoftRigidDynamicsWorld> {
    btSoftBodyRigidBodyCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
};

template <>
struct WorldParts<btDeformableMultiBodyDynamicsWorld> {
    btSoftBodyRigidBodyCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btDeformableBodySolver bodySolver;
    btDeformableMultiBodyConstraintSolver solver;
    btDeformableMultiBodyDynamicsWorld world{&dispatcher, &broadphase, solverOf(bodySolver, solver), &configuration,
                                             &bodySolver};

  private:
    static btDeformableMultiBodyConstraintSolver* solverOf(btDeformableBodySolver& bodies,
                                                           btDeformableMultiBodyConstraintSolver& solver) {
        solver.setDeformableSolver(&bodies);
        return &solver;
    }
};

}  // namespace jacket::testing
