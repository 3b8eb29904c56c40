#include "SoftWorld.h"

#include <BulletSoftBody/btDefaultSoftBodySolver.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include "Bodies.h"
#include "Clocks.h"
#include "CollisionPools.h"
#include "Convert.h"
#include "Meshes.h"
#include "SoftSheet.h"

namespace jacket::demo {

namespace {

SoftSheet sheetOf(const ShellDescription& shell) {
    SoftSheet sheet;
    const TriangleMesh rest = makeMesh(shell.mesh, shell.label + ".mesh");
    sheet.mesh = {startPositions(shell, rest), rest.triangles};
    sheet.links = gridLinks(sheet.mesh, std::get<GridOptions>(shell.mesh).cells[0] + 1);
    sheet.masses = lumpedMasses(sheet.mesh, shell.material.areaDensity());
    sheet.friction = shell.friction;
    sheet.iterations = SoftWorld::kIterations;
    for (const Selection& pin : shell.pins)
        for (const int vertex : pin.vertices(sheet.mesh.positions)) sheet.masses[vertex] = 0.0;
    return sheet;
}

}  // namespace

struct SoftWorld::Impl {
    explicit Impl(const Scene& s) : scene(s) {
        auto& info = world.getWorldInfo();
        info.m_gravity = world.getGravity();
        info.m_sparsesdf.Initialize();
        sheet = makeSoftBody(info, sheetOf(scene.shells[0]));
        world.addSoftBody(sheet.get());
    }
    ~Impl() { world.removeSoftBody(sheet.get()); }
    Impl(const Impl&) = delete;
    Impl& operator=(const Impl&) = delete;

    /// Bodies take the world's gravity when they are added.
    btSoftRigidDynamicsWorld& withGravity() {
        world.setGravity(toBullet(scene.gravity));
        return world;
    }

    Scene scene;
    btSoftBodyRigidBodyCollisionConfiguration configuration{smallPools()};
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDefaultSoftBodySolver softSolver;
    btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration, &softSolver};
    Bodies bodies{withGravity(), scene};
    std::unique_ptr<btSoftBody> sheet;
    double time = 0.0;
};

SoftWorld::SoftWorld(const Scene& scene) {
    check(scene);
    m_impl = std::make_unique<Impl>(scene);
}
SoftWorld::~SoftWorld() = default;

void SoftWorld::check(const Scene& scene) {
    const auto refuse = [&](const std::string& what) {
        throw InputError("scene \"" + scene.name + "\": " + what +
                         "; only a scene with one shell, of a grid, held by pins alone, can be compared with "
                         "btSoftBody (drape, trampoline)");
    };
    if (scene.shells.size() != 1) refuse("has " + std::to_string(scene.shells.size()) + " shells");
    const ShellDescription& shell = scene.shells[0];
    const auto* grid = std::get_if<GridOptions>(&shell.mesh);
    if (!grid || grid->diagonals == GridDiagonals::Equilateral)
        refuse("the mesh of shell \"" + shell.name + "\" is no grid of rectangles");
    if (scene.isStatic) refuse("its mode is \"static\"");
    if (scene.wind || shell.pressure != 0 || !shell.loads.empty()) refuse("has wind, pressure or forces");
    if (!shell.clamps.empty() || !shell.guides.empty()) refuse("has clamped or guided vertices");
    if (!scene.multiBodies.empty()) refuse("has multibodies");
    if (shell.perturbation != 0 || shell.initialShape || !shell.initialVelocity.isZero(0.0))
        refuse("its shell does not start at rest");
}

FrameReport SoftWorld::step() {
    FrameReport report;
    const double h = m_impl->scene.dt / m_impl->scene.substeps;
    for (int i = 0; i < m_impl->scene.substeps; ++i) {
        m_impl->bodies.prepareStep(m_impl->time, h);
        const double start = wallSeconds(), cpuStart = cpuSeconds();
        m_impl->world.stepSimulation(btScalar(h), 0);  // 0: exactly one step, of exactly h
        report.cpuSeconds += cpuSeconds() - cpuStart;
        report.seconds += wallSeconds() - start;
        m_impl->time += h;
    }
    return report;
}

Points SoftWorld::positions() const {
    const auto& nodes = m_impl->sheet->m_nodes;
    Points x(3, nodes.size());
    for (int i = 0; i < nodes.size(); ++i) x.col(i) = fromBullet(nodes[i].m_x);
    return x;
}

std::vector<BodyState> SoftWorld::bodies() const {
    return m_impl->bodies.states();
}

}  // namespace jacket::demo
