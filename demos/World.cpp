#include "World.h"

#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <limits>
#include <type_traits>

#include "Bodies.h"
#include "Clocks.h"
#include "CollisionPools.h"
#include "Convert.h"
#include "Loads.h"
#include "Meshes.h"
#include "jacket/bullet/ShellWorld.h"

namespace jacket::demo {

struct World::Impl {
    /// Multibodies need a world of their own kind, whose solver treats friction between bodies a little differently.
    std::unique_ptr<btDiscreteDynamicsWorld> makeWorld() {
        std::unique_ptr<btDiscreteDynamicsWorld> made;
        if (scene.multiBodies.empty()) {
            solver = std::make_unique<btSequentialImpulseConstraintSolver>();
            made = std::make_unique<btDiscreteDynamicsWorld>(&dispatcher, &broadphase, solver.get(), &configuration);
        } else {
            auto multiBodySolver = std::make_unique<btMultiBodyConstraintSolver>();
            made = std::make_unique<btMultiBodyDynamicsWorld>(&dispatcher, &broadphase, multiBodySolver.get(),
                                                              &configuration);
            solver = std::move(multiBodySolver);
        }
        made->setGravity(toBullet(scene.gravity));
        return made;
    }

    explicit Impl(const Scene& s) : scene(s) {
        configuration.setPlaneConvexMultipointIterations();  // else a box on a plane gets one corner a step
        for (std::size_t k = 0; k < scene.shells.size(); ++k) addShell(scene.shells[k], scene.seed + k);
        for (const ProbeDescription& probe : scene.probes)
            if (probe.where) probe.where->vertices(starts[probe.shell]);  // throws now rather than after the run
        if (scene.wind) shells.setWind(*scene.wind);
        if (scene.isStatic && (!scene.bodies.empty() || scene.wind))
            throw InputError(
                "mode: \"static\" settles shells under gravity, forces and pressure alone; the scene has " +
                std::string(scene.wind ? "wind" : "bodies"));
    }

    void addShell(const ShellDescription& description, std::uint64_t seed) {
        const TriangleMesh mesh = makeMesh(description.mesh, description.label + ".mesh");
        bullet::ShellOptions options;
        options.membrane = description.membrane;
        options.bending = description.bending;
        options.tolerance = description.tolerance;
        options.maxIterations = description.maxIterations;
        options.friction = description.friction;
        options.restitution = description.restitution;
        options.contactThickness = description.contactThickness;
        options.integrator = description.integrator;
        options.plasticity = description.plasticity;
        options.sleeping = description.sleeping;
        const Points start = startPositions(description, mesh);
        for (const Region& region : description.regions)
            options.regions.push_back({region.material, trianglesIn(region, mesh, start)});
        try {
            bullet::ShellBody& shell = shells.add(mesh, description.material, options);
            shell.setName(description.name);
            place(shell, description, start, seed);
            if (description.flattenRest) shell.shell().flattenRest();
            applyLoads(shell.shell(), description);
        } catch (const std::invalid_argument& error) {
            throw InputError(description.label + ": " + error.what());
        }
    }

    static std::vector<int> trianglesIn(const Region& region, const TriangleMesh& mesh, const Points& x) {
        std::vector<int> triangles;
        for (int t = 0; t < mesh.triangles.cols(); ++t) {
            const auto c = mesh.triangles.col(t);
            const Vec3 centre = (x.col(c[0]) + x.col(c[1]) + x.col(c[2])) / 3.0;
            if ((centre.array() >= region.box.min.array()).all() && (centre.array() <= region.box.max.array()).all())
                triangles.push_back(t);
        }
        if (triangles.empty()) throw InputError(region.label + ".box: no triangle has its centre in this box");
        return triangles;
    }

    /// Numbers of Bullet's precision lie farther apart the larger they are.
    static void requireEdgesSurviveRounding(const ShellDescription& description, const Shell& shell, const Points& x) {
        const Points& rest = shell.restPositions();
        double shortest = std::numeric_limits<double>::infinity();
        for (const auto& edge : shell.mesh().edges())
            shortest = std::min(shortest, (rest.col(edge.v0) - rest.col(edge.v1)).norm());
        const double farthest = x.cwiseAbs().maxCoeff();
        const double spacing = farthest * double(std::numeric_limits<btScalar>::epsilon());
        if (spacing <= 0.1 * shortest) return;
        throw InputError(description.label + ": starts too far from the origin: at " + shortNumber(farthest) +
                         " m positions of " + precision() + " precision are " + shortNumber(spacing) +
                         " m apart, and the shortest edge is " + shortNumber(shortest) + " m long");
    }

    void place(bullet::ShellBody& shell, const ShellDescription& description, Points x, std::uint64_t seed) {
        requireEdgesSurviveRounding(description, shell.shell(), x);
        std::vector<char> isPinned(x.cols(), 0);
        for (const Selection& pin : description.pins)
            for (const int vertex : pin.vertices(x)) isPinned[vertex] = 1;
        starts.push_back(x);
        std::vector<char> isHeld = isPinned;
        for (const Clamp& clamp : description.clamps)
            for (const int vertex : clamp.where.vertices(x)) isHeld[vertex] = 1;
        if (description.perturbation > 0) perturb(x, description.perturbation, isHeld, seed);
        std::vector<btVector3> positions;
        for (int i = 0; i < x.cols(); ++i) positions.push_back(toBullet(Vec3(x.col(i))));
        shell.setPositions(positions);
        shell.setVelocity(toBullet(description.initialVelocity));
        for (int i = 0; i < x.cols(); ++i)
            if (isPinned[i]) shell.pin(i);
        for (const Guide& guide : description.guides)
            for (const int vertex : guide.where.vertices(x)) shell.shell().guide(vertex, guide.direction);
        for (const Clamp& clamp : description.clamps) {
            try {
                shell.shell().clamp(clamp.where.vertices(x), clamp.direction);
            } catch (const std::invalid_argument& error) {
                throw InputError(clamp.where.label + ": " + error.what());
            }
        }
    }

    /// Everything to its equilibrium, without time.
    void settle(FrameReport& report, const std::function<bool()>& isCancelled) {
        const double start = wallSeconds();
        for (int k = 0; k < shells.size() && !isCancelled(); ++k) {
            const StaticReport done =
                shells[k].settle(world->getGravity(), {.increments = scene.loadIncrements, .maxIterations = 200});
            report.converged = report.converged && done.converged;
            report.solves += done.iterations;
            report.dents.emplace_back();
        }
        report.seconds = wallSeconds() - start;
    }

    void noteDents(FrameReport& report) {
        report.dents.resize(shells.size());
        for (int k = 0; k < shells.size(); ++k) {
            const Dent& dent = shells[k].shell().lastDent();
            Dent& most = report.dents[k];
            if (dent.triangle < 0) continue;
            const double sum = most.work + dent.work;
            if (most.triangle < 0 || dent.elements > most.elements) most = dent;
            most.work = sum;
        }
    }

    void applyLoads(Shell& shell, const ShellDescription& description) {
        for (const Load& load : description.loads) {
            const auto vertices = load.where.vertices(starts.back());
            const auto shares = evenShares(shell.mesh(), shell.restPositions(), vertices);
            for (std::size_t i = 0; i < vertices.size(); ++i)
                shell.setForce(vertices[i], shell.forces().col(vertices[i]) + shares[i] * load.total);
        }
        shell.setPressure(description.pressure);
    }

    void step(FrameReport& report) {
        const double h = scene.dt / scene.substeps;
        bodies.prepareStep(time, h);
        const double start = wallSeconds(), cpuStart = cpuSeconds();
        world->stepSimulation(btScalar(h), 0);  // 0: exactly one step, of exactly h
        report.cpuSeconds += cpuSeconds() - cpuStart;
        report.seconds += wallSeconds() - start;
        time += h;
        const bullet::WorldReport& last = shells.lastStep();
        report.contacts = last.contacts;
        report.pcgIterations += last.pcgIterations;
        report.mostIterations = std::max(report.mostIterations, last.pcgIterations);
        report.solves += last.solves;
        report.converged = report.converged && last.converged;
        report.finite = report.finite && last.finite;
        report.where.narrowPhase += last.secondsContact;
        report.where.parts += last.times;
        report.where.solves += last.secondsSolve;
        report.where.shells += last.secondsTotal;
        noteDents(report);
    }

    Scene scene;
    btDefaultCollisionConfiguration configuration{smallPools()};
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    std::unique_ptr<btConstraintSolver> solver;
    std::unique_ptr<btDiscreteDynamicsWorld> world = makeWorld();
    Bodies bodies{*world, scene};
    bullet::ShellWorld shells{*world};
    std::vector<Points> starts;  ///< positions at time 0, unperturbed
    double time = 0.0;
};

World::World(const Scene& scene, int threads) : m_impl(std::make_unique<Impl>(scene)) {
    m_impl->shells.setThreads(threads);
}
World::~World() = default;

FrameReport World::step(const std::function<bool()>& isCancelled) {
    FrameReport report;
    if (scene().isStatic)
        m_impl->settle(report, isCancelled);
    else
        for (int i = 0; i < scene().substeps && !isCancelled(); ++i) m_impl->step(report);
    return report;
}

double World::time() const {
    return m_impl->time;
}
const Scene& World::scene() const {
    return m_impl->scene;
}
int World::threads() const {
    return m_impl->shells.threads();
}
int World::shellCount() const {
    return m_impl->shells.size();
}
const Shell& World::shell(int index) const {
    return m_impl->shells[index].shell();
}
const Points& World::initialPositions(int shell) const {
    return m_impl->starts[shell];
}
int World::contactCount(int shell) const {
    return static_cast<int>(m_impl->shells[shell].contacts().size());
}
int World::rejectedSteps() const {
    return m_impl->shells.lastStep().rejectedSteps;
}
int World::unconvergedSteps() const {
    return m_impl->shells.lastStep().unconvergedSteps;
}
int World::unsettledSteps() const {
    return m_impl->shells.lastStep().unsettledSteps;
}
int World::passedSteps() const {
    return m_impl->shells.lastStep().passedSteps;
}
bool World::isAsleep(int shell) const {
    return m_impl->shells[shell].isAsleep();
}
std::vector<std::string> World::takeWarnings() {
    return m_impl->shells.takeWarnings();
}

Points World::contactForces(int shell) const {
    Points forces = Points::Zero(3, this->shell(shell).vertexCount());
    const double h = scene().dt / scene().substeps;
    for (const ContactImpulse& hit : m_impl->shells[shell].contacts())
        for (int k = 0; k < 3; ++k) forces.col(hit.contact.vertices[k]) += hit.contact.weights[k] / h * hit.impulse;
    return forces;
}

std::vector<BodyState> World::bodies() const {
    return m_impl->bodies.states();
}

Points World::velocities(int index) const {
    const Shell& solved = shell(index);
    const Vec3 pendingMomentum = solved.linearMomentum() - fromBullet(m_impl->shells[index].linearMomentum());
    const Vec3 pending = pendingMomentum / solved.masses().sum();
    Points velocities = solved.velocities();
    for (int i = 0; i < solved.vertexCount(); ++i) velocities.col(i) -= solved.freedom(i) * pending;
    return velocities;
}

Vec3 World::linearMomentum() const {
    Vec3 momentum = Vec3::Zero();
    for (int k = 0; k < shellCount(); ++k) momentum += velocities(k) * shell(k).masses();
    for (const BodyState& body : bodies())
        if (body.description->mass > 0) momentum += body.description->mass * body.velocity;
    return momentum;
}

std::string World::precision() {
    return std::is_same_v<btScalar, double> ? "double" : "float";
}

std::string World::bulletVersion() {
    return std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100);
}

}  // namespace jacket::demo
