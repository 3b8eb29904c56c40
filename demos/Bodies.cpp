#include "Bodies.h"

#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <btBulletDynamicsCommon.h>

#include <cmath>
#include <numbers>

#include "Convert.h"
#include "Meshes.h"
#include "MultiBody.h"

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

/// A body leaves the world before it ends, also when a later part of the scene turns out to be wrong.
struct RemoveBody {
    btDynamicsWorld* world;
    void operator()(btRigidBody* body) const {
        world->removeRigidBody(body);
        delete body;
    }
};

}  // namespace

/// A body and what it needs to live.
struct Bodies::Body {
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

Bodies::Bodies(btDiscreteDynamicsWorld& world, Scene& scene) : m_world(world), m_scene(scene) {
    for (BodyDescription& body : scene.bodies) addBody(body);
    for (const MultiBodyDescription& multiBody : scene.multiBodies) addMultiBody(multiBody);
}

Bodies::~Bodies() = default;

void Bodies::prepareStep(double time, double h) {
    moveKinematicBodies(time + h);
    for (const auto& multiBody : m_multiBodies) multiBody->drive(time, h);
}

std::vector<BodyState> Bodies::states() const {
    std::vector<BodyState> states;
    for (const Body& body : m_bodies) states.push_back(state(body));
    return states;
}

void Bodies::addBody(BodyDescription& description) {
    Body entry;
    entry.description = &description;
    loadGeometry(description.shape, description.label);
    CentredShape centredShape = centred(description.shape, entry.parts);
    entry.shape = std::move(centredShape.shape);
    entry.centre = centredShape.centre;
    const auto mass = btScalar(description.mass);
    if (mass > 0) entry.inertia = inertiaOf(*entry.shape, description.shape, description.mass);
    if (description.isOfMultiBody) {
        m_bodies.push_back(std::move(entry));
        return;
    }
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, entry.shape.get(), entry.inertia);
    info.m_friction = btScalar(description.friction);
    info.m_restitution = btScalar(description.restitution);
    info.m_startWorldTransform = toBullet(description.transform) * entry.centre;
    entry.body = decltype(entry.body)(new btRigidBody(info), RemoveBody{&m_world});
    if (!m_scene.maySleep() || !description.kinematic.empty())
        entry.body->setActivationState(DISABLE_DEACTIVATION);  // Bullet puts bodies to sleep that still swing slowly
    entry.body->setLinearVelocity(toBullet(description.velocity));
    entry.body->setAngularVelocity(toBullet(description.angularVelocity));
    if (!description.kinematic.empty())
        entry.body->setCollisionFlags(entry.body->getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
    m_world.addRigidBody(entry.body.get());
    m_bodies.push_back(std::move(entry));
}

void Bodies::addMultiBody(const MultiBodyDescription& description) {
    std::vector<int> indices{description.base};
    for (const LinkDescription& link : description.links) indices.push_back(link.body);
    std::vector<MultiBodyPart> parts;
    for (const int i : indices) {
        if (!(m_bodies[i].centre.getBasis() == btMatrix3x3::getIdentity()))
            throw InputError(m_bodies[i].description->label +
                             ".compound: the principal axes of a multibody's part must be those of its frame");
        parts.push_back({m_bodies[i].description, m_bodies[i].shape.get(), fromBullet(m_bodies[i].centre.getOrigin()),
                         fromBullet(m_bodies[i].inertia)});
    }
    auto& multiBodyWorld = static_cast<btMultiBodyDynamicsWorld&>(m_world);
    m_multiBodies.push_back(std::make_unique<MultiBody>(multiBodyWorld, description, parts));
    for (std::size_t k = 0; k < indices.size(); ++k) {
        m_bodies[indices[k]].multiBody = m_multiBodies.back().get();
        m_bodies[indices[k]].part = k;
    }
}

/// Puts kinematic bodies where they are at the end of the coming step; Bullet takes their velocity from that.
void Bodies::moveKinematicBodies(double end) {
    for (Body& body : m_bodies) {
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

BodyState Bodies::state(const Body& body) {
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

}  // namespace jacket::demo
