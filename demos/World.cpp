#include "World.h"

#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <btBulletDynamicsCommon.h>

#include <chrono>
#include <cmath>
#include <numbers>
#include <type_traits>

#include "Convert.h"
#include "Loads.h"
#include "Meshes.h"
#include "MultiBody.h"
#include "jacket/bullet/ShellWorld.h"

namespace jacket::demo {

namespace {

/// Bullet's rounding of edges between bodies, kept small beside the shape: it would show as a gap.
btScalar smallMargin(double size) {
    return btScalar(0.002 * size);
}

/// What shapes are made of, which Bullet does not own.
struct ShapeParts {
    std::vector<std::unique_ptr<btCollisionShape>> shapes;
    std::vector<std::unique_ptr<btStridingMeshInterface>> meshes;
};

/// A shape as Bullet's, with its centre of mass at the origin.
struct CentredShape {
    std::unique_ptr<btCollisionShape> shape;
    btTransform centre = btTransform::getIdentity();  ///< in the shape's frame; its axes are the principal ones
};

struct MakeCollisionShape {
    ShapeParts& parts;
    using Pointer = std::unique_ptr<btCollisionShape>;
    Pointer operator()(const Sphere& s) const { return std::make_unique<btSphereShape>(btScalar(s.radius)); }
    Pointer operator()(const Box& s) const { return std::make_unique<btBoxShape>(toBullet(Vec3(0.5 * s.size))); }
    Pointer operator()(const Capsule& s) const {
        return std::make_unique<btCapsuleShape>(btScalar(s.radius), btScalar(s.height));
    }
    Pointer operator()(const Cylinder& s) const {
        return std::make_unique<btCylinderShape>(toBullet(Vec3(s.radius, 0.5 * s.height, s.radius)));
    }
    Pointer operator()(const Cone& s) const {
        auto shape = std::make_unique<btConeShape>(btScalar(s.radius), btScalar(s.height));
        shape->setMargin(smallMargin(std::min(s.radius, s.height)));
        return shape;
    }
    Pointer operator()(const Plane& s) const {
        return std::make_unique<btStaticPlaneShape>(toBullet(s.normal), btScalar(s.offset));
    }
    Pointer operator()(const Hull& s) const {
        auto shape = std::make_unique<btConvexHullShape>();
        const Points& vertices = s.geometry->vertices();
        for (int i = 0; i < vertices.cols(); ++i)
            shape->addPoint(toBullet(Vec3(vertices.col(i) - s.geometry->centroid())), false);
        shape->recalcLocalAabb();
        shape->setMargin(smallMargin(std::cbrt(s.geometry->volume())));
        return shape;
    }
    Pointer operator()(const Mesh& s) const {
        auto mesh = std::make_unique<btTriangleMesh>();
        const Points& x = s.geometry->vertices();
        for (const auto& t : s.geometry->triangles().colwise())
            mesh->addTriangle(toBullet(Vec3(x.col(t[0]))), toBullet(Vec3(x.col(t[1]))), toBullet(Vec3(x.col(t[2]))));
        auto shape = std::make_unique<btBvhTriangleMeshShape>(mesh.get(), true);
        parts.meshes.push_back(std::move(mesh));
        return shape;
    }
    Pointer operator()(const Compound& s) const;
};

/// Of bodies that may move [m^3]; parts of a compound that overlap count twice.
struct Volume {
    double operator()(const Sphere& s) const { return 4.0 / 3.0 * std::numbers::pi * std::pow(s.radius, 3); }
    double operator()(const Box& s) const { return s.size.prod(); }
    double operator()(const Capsule& s) const {
        return std::numbers::pi * s.radius * s.radius * (s.height + 4.0 / 3.0 * s.radius);
    }
    double operator()(const Cylinder& s) const { return std::numbers::pi * s.radius * s.radius * s.height; }
    double operator()(const Cone& s) const { return std::numbers::pi * s.radius * s.radius * s.height / 3.0; }
    double operator()(const Plane&) const { return 0.0; }
    double operator()(const Hull& s) const { return s.geometry->volume(); }
    double operator()(const Mesh&) const { return 0.0; }
    double operator()(const Compound& s) const {
        double sum = 0.0;
        for (const CompoundPart& part : s.parts) sum += std::visit(*this, part.shape);
        return sum;
    }
};

CentredShape centred(const Shape& shape, ShapeParts& parts) {
    CentredShape result{std::visit(MakeCollisionShape{parts}, shape)};
    if (const auto* hull = std::get_if<Hull>(&shape)) result.centre.setOrigin(toBullet(hull->geometry->centroid()));
    const auto* compound = std::get_if<Compound>(&shape);
    const double volume = compound ? Volume{}(*compound) : 0.0;
    if (!(volume > 0)) return result;  // of meshes: cannot move
    auto& children = static_cast<btCompoundShape&>(*result.shape);
    std::vector<btScalar> masses;
    for (const CompoundPart& part : compound->parts)
        masses.push_back(btScalar(std::visit(Volume{}, part.shape) / volume));
    btVector3 inertia;
    children.calculatePrincipalAxisTransform(masses.data(), result.centre, inertia);
    for (int i = 0; i < children.getNumChildShapes(); ++i)
        children.updateChildTransform(i, result.centre.inverse() * children.getChildTransform(i), false);
    children.recalculateLocalAabb();
    return result;
}

MakeCollisionShape::Pointer MakeCollisionShape::operator()(const Compound& s) const {
    auto compound = std::make_unique<btCompoundShape>();
    for (const CompoundPart& part : s.parts) {
        CentredShape child = centred(part.shape, parts);
        compound->addChildShape(toBullet(part.transform) * child.centre, child.shape.get());
        parts.shapes.push_back(std::move(child.shape));
    }
    return compound;
}

/// Principal moments of a shape whose centre of mass is its origin. Bullet's own of a compound are those of its box.
btVector3 inertiaOf(const btCollisionShape& shape, const Shape& description, double mass) {
    btVector3 inertia(0, 0, 0);
    const auto* compound = std::get_if<Compound>(&description);
    if (!compound) {
        shape.calculateLocalInertia(btScalar(mass), inertia);
        return inertia;
    }
    const auto& children = static_cast<const btCompoundShape&>(shape);
    Mat3 sum = Mat3::Zero();
    for (int i = 0; i < children.getNumChildShapes(); ++i) {
        const Shape& part = compound->parts[i].shape;
        const double share = mass * std::visit(Volume{}, part) / Volume{}(*compound);
        const Vec3 own = fromBullet(inertiaOf(*children.getChildShape(i), part, share));
        const Mat3 axes = fromBullet(children.getChildTransform(i).getBasis());
        const Mat3 arm = skew(fromBullet(children.getChildTransform(i).getOrigin()));
        sum += axes * own.asDiagonal() * axes.transpose() - share * arm * arm;
    }
    return toBullet(Vec3(sum.diagonal()));
}

void loadGeometry(Shape& shape, const std::string& label) {
    if (auto* hull = std::get_if<Hull>(&shape)) hull->geometry = loadHull(hull->file, label);
    if (auto* mesh = std::get_if<Mesh>(&shape)) mesh->geometry = loadSurface(mesh->file, label);
    if (auto* compound = std::get_if<Compound>(&shape))
        for (CompoundPart& part : compound->parts) loadGeometry(part.shape, label);
}

}  // namespace

struct World::Impl {
    /// A body leaves the world before it ends, also when a later part of the scene turns out to be wrong.
    struct RemoveBody {
        btDynamicsWorld* world;
        void operator()(btRigidBody* body) const {
            world->removeRigidBody(body);
            delete body;
        }
    };
    /// A body and what it needs to live.
    struct Body {
        const BodyDescription* description = nullptr;
        ShapeParts parts;
        std::unique_ptr<btCollisionShape> shape;
        std::unique_ptr<btRigidBody, RemoveBody> body{nullptr, RemoveBody{nullptr}};
        /// Centre of mass and principal axes in the shape's frame: Bullet's bodies are described from there.
        btTransform centre = btTransform::getIdentity();
        btVector3 inertia{0, 0, 0};
        const MultiBody* multiBody = nullptr;  ///< that it is part of, instead of `body`
        std::size_t part = 0;                  ///< of it
    };

    /// Multibodies need a world of their own kind, whose solver treats friction between bodies a little differently.
    std::unique_ptr<btDiscreteDynamicsWorld> makeWorld() {
        if (scene.multiBodies.empty()) {
            solver = std::make_unique<btSequentialImpulseConstraintSolver>();
            return std::make_unique<btDiscreteDynamicsWorld>(&dispatcher, &broadphase, solver.get(), &configuration);
        }
        auto multiBodySolver = std::make_unique<btMultiBodyConstraintSolver>();
        auto made =
            std::make_unique<btMultiBodyDynamicsWorld>(&dispatcher, &broadphase, multiBodySolver.get(), &configuration);
        solver = std::move(multiBodySolver);
        return made;
    }

    explicit Impl(const Scene& s) : scene(s) {
        world->setGravity(toBullet(scene.gravity));
        for (BodyDescription& body : scene.bodies) addBody(body);
        for (const MultiBodyDescription& multiBody : scene.multiBodies) addMultiBody(multiBody);
        for (std::size_t k = 0; k < scene.shells.size(); ++k) addShell(scene.shells[k], scene.seed + k);
        for (const ProbeDescription& probe : scene.probes)
            if (probe.where) probe.where->vertices(starts[probe.shell]);  // throws now rather than after the run
        if (scene.wind) shells.setWind(*scene.wind);
        if (scene.isStatic && (!scene.bodies.empty() || scene.wind))
            throw InputError(
                "mode: \"static\" settles shells under gravity, forces and pressure alone; the scene has " +
                std::string(scene.wind ? "wind" : "bodies"));
    }

    void addBody(BodyDescription& description) {
        Body entry;
        entry.description = &description;
        loadGeometry(description.shape, description.label);
        CentredShape centredShape = centred(description.shape, entry.parts);
        entry.shape = std::move(centredShape.shape);
        entry.centre = centredShape.centre;
        const auto mass = btScalar(description.mass);
        if (mass > 0) entry.inertia = inertiaOf(*entry.shape, description.shape, description.mass);
        if (description.isOfMultiBody) {
            bodies.push_back(std::move(entry));
            return;
        }
        btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, entry.shape.get(), entry.inertia);
        info.m_friction = btScalar(description.friction);
        info.m_startWorldTransform = toBullet(description.transform) * entry.centre;
        entry.body = decltype(entry.body)(new btRigidBody(info), RemoveBody{world.get()});
        if (!scene.maySleep() || !description.kinematic.empty())
            entry.body->setActivationState(
                DISABLE_DEACTIVATION);  // Bullet puts bodies to sleep that still swing slowly
        entry.body->setLinearVelocity(toBullet(description.velocity));
        entry.body->setAngularVelocity(toBullet(description.angularVelocity));
        if (!description.kinematic.empty())
            entry.body->setCollisionFlags(entry.body->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
        world->addRigidBody(entry.body.get());
        bodies.push_back(std::move(entry));
    }

    void addMultiBody(const MultiBodyDescription& description) {
        std::vector<int> indices{description.base};
        for (const LinkDescription& link : description.links) indices.push_back(link.body);
        std::vector<MultiBodyPart> parts;
        for (const int i : indices) {
            if (!(bodies[i].centre.getBasis() == btMatrix3x3::getIdentity()))
                throw InputError(bodies[i].description->label +
                                 ".compound: the principal axes of a multibody's part must be those of its frame");
            parts.push_back({bodies[i].description, bodies[i].shape.get(), fromBullet(bodies[i].centre.getOrigin()),
                             fromBullet(bodies[i].inertia)});
        }
        auto& multiBodyWorld = static_cast<btMultiBodyDynamicsWorld&>(*world);
        multiBodies.push_back(std::make_unique<MultiBody>(multiBodyWorld, description, parts));
        for (std::size_t k = 0; k < indices.size(); ++k) {
            bodies[indices[k]].multiBody = multiBodies.back().get();
            bodies[indices[k]].part = k;
        }
    }

    void addShell(const ShellDescription& description, std::uint64_t seed) {
        const TriangleMesh mesh = makeMesh(description.mesh, description.label + ".mesh");
        bullet::ShellOptions options;
        options.membrane = description.membrane;
        options.bending = description.bending;
        options.tolerance = description.tolerance;
        options.maxIterations = description.maxIterations;
        options.friction = description.friction;
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

    void place(bullet::ShellBody& shell, const ShellDescription& description, Points x, std::uint64_t seed) {
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
    void settle(FrameReport& report) {
        using Clock = std::chrono::steady_clock;
        const auto start = Clock::now();
        for (int k = 0; k < shells.size(); ++k) {
            const StaticReport done =
                shells[k].settle(world->getGravity(), {.increments = scene.loadIncrements, .maxIterations = 200});
            report.converged = report.converged && done.converged;
            report.solves += done.iterations;
            report.dents.emplace_back();
        }
        report.seconds = std::chrono::duration<double>(Clock::now() - start).count();
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

    /// Puts kinematic bodies where they are at the end of the coming step; Bullet takes their velocity from that.
    void moveKinematicBodies(double end) {
        for (Body& body : bodies) {
            if (body.description->kinematic.empty()) continue;
            const Transform& start = body.description->transform;
            Vec3 origin = start.position;
            double begun = 0.0;
            for (const auto& [velocity, until] : body.description->kinematic) {
                origin += std::max(0.0, std::min(end, until) - begun) * velocity;
                begun = until;
            }
            const Transform pose{origin, start.rotationDeg};
            body.body->setWorldTransform(toBullet(pose) * body.centre);
        }
    }

    void step(FrameReport& report) {
        const double h = scene.dt / scene.substeps;
        moveKinematicBodies(time + h);
        for (const auto& multiBody : multiBodies) multiBody->drive(time, h);
        using Clock = std::chrono::steady_clock;
        const auto start = Clock::now();
        world->stepSimulation(btScalar(h), 0);  // 0: exactly one step, of exactly h
        report.seconds += std::chrono::duration<double>(Clock::now() - start).count();
        time += h;
        const bullet::WorldReport& last = shells.lastStep();
        report.contacts = last.contacts;
        report.pcgIterations += last.pcgIterations;
        report.mostIterations = std::max(report.mostIterations, last.pcgIterations);
        report.solves += last.solves;
        report.converged = report.converged && last.converged;
        report.finite = report.finite && last.finite;
        noteDents(report);
    }

    BodyState state(const Body& body) const {
        const btCollisionObject* object = body.body.get();
        if (body.multiBody) object = &body.multiBody->collider(body.part);
        const btTransform& centre = object->getWorldTransform();
        const btTransform pose = centre * body.centre.inverse();
        const Mat3 axes = fromBullet(body.centre.getBasis());
        BodyState state;
        state.description = body.description;
        state.isDynamic = body.description->mass > 0;
        state.rotation = fromBullet(pose.getBasis());
        state.centre = fromBullet(centre.getOrigin());
        state.position = fromBullet(pose.getOrigin());
        state.inertia = axes * fromBullet(body.inertia).asDiagonal() * axes.transpose();
        if (body.multiBody) {
            const MultiBody::Velocities velocities = body.multiBody->velocities();
            state.velocity = velocities.linear[body.part];
            state.angularVelocity = velocities.angular[body.part];
        } else {
            state.velocity = fromBullet(body.body->getLinearVelocity());
            state.angularVelocity = fromBullet(body.body->getAngularVelocity());
        }
        return state;
    }

    Scene scene;
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    std::unique_ptr<btConstraintSolver> solver;
    std::unique_ptr<btDiscreteDynamicsWorld> world = makeWorld();
    std::vector<Body> bodies;
    std::vector<std::unique_ptr<MultiBody>> multiBodies;
    bullet::ShellWorld shells{*world};
    std::vector<Points> starts;  ///< positions at time 0, unperturbed
    double time = 0.0;
};

World::World(const Scene& scene) : m_impl(std::make_unique<Impl>(scene)) {}
World::~World() = default;

FrameReport World::step() {
    FrameReport report;
    if (scene().isStatic)
        m_impl->settle(report);
    else
        for (int i = 0; i < scene().substeps; ++i) m_impl->step(report);
    return report;
}

double World::time() const {
    return m_impl->time;
}
const Scene& World::scene() const {
    return m_impl->scene;
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
    std::vector<BodyState> states;
    for (const auto& body : m_impl->bodies) states.push_back(m_impl->state(body));
    return states;
}

Vec3 World::linearMomentum() const {
    Vec3 momentum = Vec3::Zero();
    for (int k = 0; k < shellCount(); ++k) momentum += fromBullet(m_impl->shells[k].linearMomentum());
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
