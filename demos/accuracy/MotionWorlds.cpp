#include <BulletSoftBody/btDefaultSoftBodySolver.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "Motion.h"
#include "MotionMesh.h"
#include "SoftSheet.h"
#include "TrampolineReference.h"
#include "jacket/bullet/ShellWorld.h"

/// Problems with bodies: shells, or btSoftBody, in Bullet's world.
namespace jacket::demo::accuracy {

namespace {

// The scene trampoline of demos/scenes, with the ball laid onto the sheet and slowed, so that it comes to rest; without
// friction, which would let it rest at more than one height.
constexpr double kSize = 2.0, kRadius = 0.25, kBallMass = 2.0, kGravity = 9.81;
constexpr double kStretchStiffness = 1e4, kBendingStiffness = 1e-4, kAreaDensity = 0.3, kThickness = 1e-3;
constexpr double kSeconds = 3.0;
constexpr double kBallDamping = 0.99;  // of its speed, lost in a second

ShellMaterial sheetMaterial() {
    ShellMaterial material{.poisson = 0.3, .thickness = kThickness};
    material.stretchStiffnessOverride = kStretchStiffness;
    material.bendingStiffnessOverride = kBendingStiffness;
    material.areaDensityOverride = kAreaDensity;
    return material;
}

/// A world that knows soft bodies too: the same for both solvers.
struct Stage {
    Stage() { world.setGravity({0, btScalar(-kGravity), 0}); }
    ~Stage() {
        if (ball) world.removeRigidBody(ball.get());
    }
    Stage(const Stage&) = delete;
    Stage& operator=(const Stage&) = delete;

    btRigidBody& addBall(double mass, double radius, const btVector3& position) {
        shape = std::make_unique<btSphereShape>(btScalar(radius));
        btVector3 inertia;
        shape->calculateLocalInertia(btScalar(mass), inertia);
        ball = std::make_unique<btRigidBody>(btScalar(mass), nullptr, shape.get(), inertia);
        ball->setWorldTransform(btTransform(btQuaternion::getIdentity(), position));
        ball->setActivationState(DISABLE_DEACTIVATION);
        world.addRigidBody(ball.get());
        return *ball;
    }

    btSoftBodyRigidBodyCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDefaultSoftBodySolver softSolver;
    btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration, &softSolver};
    std::unique_ptr<btCollisionShape> shape;
    std::unique_ptr<btRigidBody> ball;
};

/// Lets the ball come to rest; its mean height over the last third of a second. After every step, `after` is called.
template <class After>
double restingHeight(Stage& stage, double dt, double simulated, MotionResult& result, const After& after) {
    const int steps = static_cast<int>(std::lround(simulated / dt));
    const int last = std::max(1, static_cast<int>(std::lround(1.0 / (3 * dt))));
    double sum = 0.0;
    for (int step = 0; step < steps; ++step) {
        const double start = cpuSeconds();
        stage.world.stepSimulation(btScalar(dt), 0);  // 0: exactly one step
        result.seconds += (cpuSeconds() - start) / simulated;
        after();
        if (step >= steps - last) sum += double(stage.ball->getWorldTransform().getOrigin().y());
    }
    return sum / last;
}

double heightOnShell(const MotionCase& motion, double simulated, MotionResult& result) {
    Stage stage;
    bullet::ShellWorld shells(stage.world);
    const TriangleMesh mesh = makeSheet(motion.mesh, {kSize, kSize}, {motion.cells, motion.cells});
    bullet::ShellBody& sheet = shells.add(
        mesh, sheetMaterial(),
        {.bending = motion.bending, .integrator = motion.integrator, .tolerance = motion.tolerance, .friction = 0});
    for (int i = 0; i < mesh.positions.cols(); ++i)
        if (mesh.positions.col(i).cwiseAbs().maxCoeff() > 0.5 * kSize * (1 - 1e-9)) sheet.pin(i);
    stage.addBall(kBallMass, kRadius, {0, btScalar(kRadius + kThickness), 0});
    stage.ball->setDamping(btScalar(kBallDamping), 0);
    result.vertices = static_cast<int>(mesh.positions.cols());
    return restingHeight(stage, motion.dt, simulated, result, [&] {
        result.converged = result.converged && shells.lastStep().converged && shells.lastStep().finite;
    });
}

/// btSoftBody on the same grid: see SoftSheet.
double heightOnSoftBody(const MotionCase& motion, double simulated, MotionResult& result) {
    Stage stage;
    auto& info = stage.world.getWorldInfo();
    info.m_gravity = stage.world.getGravity();
    info.m_sparsesdf.Initialize();
    SoftSheet sheet;
    sheet.mesh = makeSheet(MeshKind::OneDiagonal, {kSize, kSize}, {motion.cells, motion.cells});
    sheet.links = gridLinks(sheet.mesh, motion.cells + 1);
    sheet.masses = lumpedMasses(sheet.mesh, kAreaDensity);
    for (int i = 0; i < sheet.mesh.positions.cols(); ++i)
        if (sheet.mesh.positions.col(i).cwiseAbs().maxCoeff() > 0.5 * kSize * (1 - 1e-9)) sheet.masses[i] = 0.0;
    const std::unique_ptr<btSoftBody> body = makeSoftBody(info, sheet);
    stage.world.addSoftBody(body.get());
    stage.addBall(kBallMass, kRadius, {0, btScalar(kRadius + kThickness), 0});
    stage.ball->setDamping(btScalar(kBallDamping), 0);
    result.vertices = body->m_nodes.size();
    const double height = restingHeight(stage, motion.dt, simulated, result, [] {});
    stage.world.removeSoftBody(body.get());
    return height;
}

MotionResult runTrampoline(const MotionCase& motion) {
    MotionResult result;
    const double height = trampolineHeight(motion, kSeconds, result);
    const double error = std::abs(height - kTrampolineHeight) / kTrampolineSag;
    result.error = std::isfinite(error) ? error : std::numeric_limits<double>::infinity();
    return result;
}

/// Contacts make every integrator take steps of backward Euler, so that it is mesh, step and tolerance that count here.
std::vector<MotionCase> trampolineSweep(bool quick) {
    std::vector<MotionCase> cases;
    const std::vector<double> dts = quick ? std::vector{1.0 / 60} : std::vector{1.0 / 30, 1.0 / 60, 1.0 / 120};
    const std::vector<int> cells = quick ? std::vector{10, 20} : std::vector{10, 20, 30, 40};
    for (const double dt : dts)
        for (const int n : cells) {
            cases.push_back({.dt = dt, .cells = n});
            cases.push_back({.dt = dt, .mesh = MeshKind::Alternating, .cells = n});
        }
    for (const double dt : {1.0 / 60, 1.0 / 120, 1.0 / 240})
        for (const int n : cells) cases.push_back({.dt = dt, .cells = n, .isSoftBody = true});
    const double dt = 1.0 / 60;
    const int n = 20;
    cases.push_back({.bending = DihedralBending{}, .dt = dt, .cells = n});
    cases.push_back({.bending = QuadraticBending{}, .dt = dt, .cells = n});
    cases.push_back({.bending = CubicShellBending{}, .dt = dt, .cells = n});
    cases.push_back({.integrator = Integrator::Newton, .dt = dt, .cells = n});
    cases.push_back({.integrator = Integrator::Bdf2, .dt = dt, .cells = n});
    cases.push_back({.dt = dt, .mesh = MeshKind::Delaunay, .cells = n});
    for (const double tolerance : {1e-2, 1e-4}) cases.push_back({.dt = dt, .tolerance = tolerance, .cells = n});
    return cases;
}

}  // namespace

double trampolineHeight(const MotionCase& motion, double simulated, MotionResult& result) {
    return motion.isSoftBody ? heightOnSoftBody(motion, simulated, result) : heightOnShell(motion, simulated, result);
}

MotionProblem trampoline() {
    return {.name = "trampoline",
            .quantity =
                "height of a 2 kg ball at rest on a 2 x 2 m sheet held at its edges: distance from that of the "
                "finest mesh / sag",
            .source = kTrampolineSource,
            .simulated = kSeconds,
            .sweep = trampolineSweep,
            .sweepText =
                "step x cells x two regular meshes with backward Euler and patch bending, and btSoftBody on "
                "as many cells; the other models, integrators, tolerances and the irregular mesh at 20 cells "
                "and 1/60 s",
            .run = runTrampoline};
}

std::string computeReferences(const std::function<bool(int done, int all)>& progress) {
    const std::string strip = computeStripReference();
    if (!progress(1, 2)) return {};
    MotionResult ignored;
    const double height = trampolineHeight(
        {.dt = 1.0 / 240, .tolerance = 1e-4, .mesh = MeshKind::Alternating, .cells = 60}, kSeconds, ignored);
    char line[80];
    std::snprintf(line, sizeof line, "inline constexpr double kTrampolineHeight = %.6f;\n", height);
    progress(2, 2);
    return strip + line;
}

// --- momentum ---------------------------------------------------------------------------------------------------

namespace {

struct Motions {
    Vec3 linear, angular;
    double scale;   // sum of mass times speed
    double energy;  // kinetic and elastic
};

Vec3 fromBullet(const btVector3& v) {
    return {v.x(), v.y(), v.z()};
}

Motions motionsOf(const Shell& shell, const btRigidBody* ball) {
    const ShellEnergy energy = shell.energy();
    Motions m{shell.linearMomentum(), shell.angularMomentum(Vec3::Zero()), 0.0,
              energy.kinetic + energy.membrane + energy.bending};
    for (int i = 0; i < shell.vertexCount(); ++i) m.scale += shell.masses()[i] * shell.velocities().col(i).norm();
    if (!ball) return m;
    const double mass = 1.0 / double(ball->getInvMass()), inertia = 1.0 / double(ball->getInvInertiaDiagLocal().x());
    const Vec3 x = fromBullet(ball->getWorldTransform().getOrigin()), v = fromBullet(ball->getLinearVelocity());
    const Vec3 spin = fromBullet(ball->getAngularVelocity());
    m.linear += mass * v;
    m.angular += mass * x.cross(v) + inertia * spin;
    m.scale += mass * v.norm();
    m.energy += 0.5 * mass * v.squaredNorm() + 0.5 * inertia * spin.squaredNorm();
    return m;
}

/// The sheet of the scene free_sheet_ball, turning once a second about a slanted axis.
bullet::ShellBody& addSpinningSheet(bullet::ShellWorld& shells, Integrator integrator) {
    ShellMaterial material{.poisson = 0.3, .thickness = 2e-3};
    material.stretchStiffnessOverride = 5e3;
    material.bendingStiffnessOverride = 1e-3;
    material.areaDensityOverride = 0.3;
    const TriangleMesh mesh = makeSheet(MeshKind::Alternating, {1, 1}, {16, 16});
    bullet::ShellBody& sheet = shells.add(mesh, material, {.integrator = integrator, .friction = 0.8});
    const Vec3 spin(1.0, 6.0, 0.5);
    Points v = mesh.positions;
    for (int i = 0; i < v.cols(); ++i) v.col(i) = spin.cross(Vec3(mesh.positions.col(i)));
    sheet.shell().setVelocities(v);
    return sheet;
}

}  // namespace

MomentumDrift momentumDrift(Integrator integrator, bool withBall, double dt) {
    constexpr double kSimulated = 1.0;
    Stage stage;
    stage.world.setGravity({0, 0, 0});
    bullet::ShellWorld shells(stage.world);
    const Shell& shell = addSpinningSheet(shells, integrator).shell();
    if (withBall) {
        btRigidBody& ball = stage.addBall(0.5, 0.15, {btScalar(0.05), btScalar(0.4), 0});
        ball.setLinearVelocity({btScalar(0.2), -2, btScalar(0.1)});
        ball.setAngularVelocity({0, 3, 12});
        ball.setFriction(1);
    }
    const Motions start = motionsOf(shell, stage.ball.get());
    MomentumDrift drift;
    for (int step = 0, steps = static_cast<int>(std::lround(kSimulated / dt)); step < steps; ++step) {
        stage.world.stepSimulation(btScalar(dt), 0);
        const Motions now = motionsOf(shell, stage.ball.get());
        drift.linear = std::max(drift.linear, (now.linear - start.linear).norm() / (start.scale * kSimulated));
        drift.angular =
            std::max(drift.angular, (now.angular - start.angular).norm() / (start.angular.norm() * kSimulated));
        drift.energy = (now.energy - start.energy) / (start.energy * kSimulated);
    }
    return drift;
}

}  // namespace jacket::demo::accuracy
