#pragma once
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "jacket/bullet/ShellWorld.h"

/// What tests of shells among rigid bodies need: a world that is set up and torn down in order, and the quantities that
/// physics says something about. Belongs to no test framework: everything returns a value or throws std::runtime_error.
namespace jacket::testing {

inline Vec3 toVec3(const btVector3& v) {
    return {double(v.x()), double(v.y()), double(v.z())};
}

/// What a world is made of, in order of construction. Specialise it for worlds that are made of other parts; a Scene
/// needs the member `world`.
template <class World>
struct WorldParts {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    World world{&dispatcher, &broadphase, &solver, &configuration};

    /// Bullet's own choice is to find one corner of a box on a plane a step: small boxes sink into it at 1/60 s.
    WorldParts() { configuration.setPlaneConvexMultipointIterations(); }
};

/// A Bullet world with shells and bodies. Lengths in m, masses in kg (0: static), times in s.
template <class World = btDiscreteDynamicsWorld>
struct Scene : WorldParts<World> {
    using WorldParts<World>::world;
    std::vector<std::unique_ptr<btCollisionShape>> shapes;
    std::vector<std::unique_ptr<btRigidBody>> bodies;
    std::vector<std::unique_ptr<btTypedConstraint>> joints;
    std::unique_ptr<bullet::ShellWorld> shells = std::make_unique<bullet::ShellWorld>(world);

    /// `gravity`: along y [m/s^2].
    explicit Scene(double gravity = -9.81) { world.setGravity(btVector3(0, btScalar(gravity), 0)); }
    Scene(const Scene&) = delete;
    Scene& operator=(const Scene&) = delete;
    ~Scene() {
        shells.reset();
        for (const auto& joint : joints) world.removeConstraint(joint.get());
        for (const auto& body : bodies) world.removeRigidBody(body.get());
    }

    btRigidBody& addBody(std::unique_ptr<btCollisionShape> shape, double mass, const btVector3& position) {
        btVector3 inertia(0, 0, 0);
        if (mass > 0) shape->calculateLocalInertia(btScalar(mass), inertia);
        bodies.push_back(std::make_unique<btRigidBody>(btScalar(mass), nullptr, shape.get(), inertia));
        shapes.push_back(std::move(shape));
        btTransform pose = btTransform::getIdentity();
        pose.setOrigin(position);
        bodies.back()->setWorldTransform(pose);
        bodies.back()->setInterpolationWorldTransform(pose);
        world.addRigidBody(bodies.back().get());
        return *bodies.back();
    }
    btRigidBody& addSphere(double radius, double mass, const btVector3& position) {
        return addBody(std::make_unique<btSphereShape>(btScalar(radius)), mass, position);
    }
    btRigidBody& addBox(const btVector3& halfExtents, double mass, const btVector3& position) {
        return addBody(std::make_unique<btBoxShape>(halfExtents), mass, position);
    }
    /// All points below y = height.
    btRigidBody& addFloor(double height = 0.0) {
        return addBody(std::make_unique<btStaticPlaneShape>(btVector3(0, 1, 0), btScalar(height)), 0.0,
                       btVector3(0, 0, 0));
    }
    /// Bodies that a joint holds together do not touch each other.
    template <class Joint>
    Joint& addJoint(std::unique_ptr<Joint> joint) {
        Joint& added = *joint;
        joints.push_back(std::move(joint));
        world.addConstraint(&added, true);
        return added;
    }
    /// With its joints.
    void remove(btRigidBody& body) {
        const auto holdsIt = [&](const auto& joint) {
            if (&joint->getRigidBodyA() != &body && &joint->getRigidBodyB() != &body) return false;
            world.removeConstraint(joint.get());
            return true;
        };
        std::erase_if(joints, holdsIt);
        world.removeRigidBody(&body);
        std::erase_if(bodies, [&](const auto& b) { return b.get() == &body; });
    }
    /// One step of exactly h.
    void step(double h) { world.stepSimulation(btScalar(h), 0, btScalar(h)); }
    void run(double seconds, double h) {
        for (int i = 0; i < int(seconds / h + 0.5); ++i) step(h);
    }
};

namespace detail {

template <class Visit>
void forEachDynamicBody(const btCollisionWorld& world, Visit visit) {
    const auto& objects = world.getCollisionObjectArray();
    for (int i = 0; i < objects.size(); ++i) {
        const btRigidBody* body = btRigidBody::upcast(objects[i]);
        if (body && !body->isStaticOrKinematicObject() && body->getInvMass() > btScalar(0)) visit(*body);
    }
}

inline Mat3 toMat3(const btMatrix3x3& m) {
    Mat3 result;
    for (int row = 0; row < 3; ++row) result.row(row) = toVec3(m[row]).transpose();
    return result;
}

/// About the centre of mass [kg m^2]. An axis that Bullet does not let turn (inverse inertia 0) carries none.
inline Mat3 inertia(const btRigidBody& body) {
    Vec3 diagonal = toVec3(body.getInvInertiaDiagLocal());
    for (double& value : diagonal) value = value > 0.0 ? 1.0 / value : 0.0;
    const Mat3 turn = toMat3(body.getWorldTransform().getBasis());
    return turn * diagonal.asDiagonal() * turn.transpose();
}

/// A dynamic rigid body, or a link (or the base) of a multibody that can move.
struct MovingPart {
    double mass = 0.0;  ///< [kg]
    Vec3 centre;        ///< of mass [m]
    Vec3 velocity;      ///< of the centre of mass [m/s]
    Vec3 spin;          ///< [rad/s]
    Mat3 inertia;       ///< about the centre of mass, in the world's axes [kg m^2]
    Vec3 gravity;       ///< [m/s^2]
    double kinetic() const { return 0.5 * mass * velocity.squaredNorm() + 0.5 * spin.dot(inertia * spin); }
};

inline MovingPart movingPart(const btRigidBody& body) {
    return {.mass = 1.0 / double(body.getInvMass()),
            .centre = toVec3(body.getWorldTransform().getOrigin()),
            .velocity = toVec3(body.getLinearVelocity()),
            .spin = toVec3(body.getAngularVelocity()),
            .inertia = inertia(body),
            .gravity = toVec3(body.getGravity())};
}

/// Of link `link`, -1 being the base; velocity and spin in the link's axes.
inline MovingPart movingPart(const btMultiBody& body, int link, const btVector3& velocity, const btVector3& spin,
                             const Vec3& gravity) {
    const Mat3 turn = toMat3(body.localFrameToWorld(link, btMatrix3x3::getIdentity()));
    const Vec3 diagonal = toVec3(link < 0 ? body.getBaseInertia() : body.getLinkInertia(link));
    return {.mass = double(link < 0 ? body.getBaseMass() : body.getLinkMass(link)),
            .centre = toVec3(body.localPosToWorld(link, btVector3(0, 0, 0))),
            .velocity = turn * toVec3(velocity),
            .spin = turn * toVec3(spin),
            .inertia = turn * diagonal.asDiagonal() * turn.transpose(),
            .gravity = gravity};
}

/// Calls visit(multibody, the world's gravity [m/s^2]); worlds of other kinds have no multibodies.
template <class Visit>
void forEachMultiBody(const btCollisionWorld& world, Visit visit) {
    const auto* dynamics = dynamic_cast<const btMultiBodyDynamicsWorld*>(&world);
    for (int i = 0; dynamics && i < dynamics->getNumMultibodies(); ++i)
        visit(*dynamics->getMultiBody(i), toVec3(dynamics->getGravity()));
}

/// Calls visit(MovingPart) for everything but shells that momentum and energy are of.
template <class Visit>
void forEachMovingPart(const btCollisionWorld& world, Visit visit) {
    forEachDynamicBody(world, [&](const btRigidBody& body) { visit(movingPart(body)); });
    forEachMultiBody(world, [&](const btMultiBody& body, const Vec3& gravity) {
        std::vector<btVector3> spins(body.getNumLinks() + 1), velocities(body.getNumLinks() + 1);
        body.compTreeLinkVelocities(spins.data(), velocities.data());
        for (int link = -1; link < body.getNumLinks(); ++link)
            if (link < 0 ? !body.isBaseStaticOrKinematic() : !body.isLinkAndAllAncestorsKinematic(link))
                visit(movingPart(body, link, velocities[link + 1], spins[link + 1], gravity));
    });
}

/// Gravity of the coming substep that a shell's velocities hold already and Bullet's bodies do not [m/s].
inline Vec3 pendingGravity(const bullet::ShellBody& shell) {
    return (shell.shell().linearMomentum() - toVec3(shell.linearMomentum())) / shell.shell().masses().sum();
}

/// Signed distance to the surface as it is drawn, margins included where Bullet sizes shapes with them [m]; `p` in the
/// shape's frame.
inline double signedDistance(const btCollisionShape& shape, const Vec3& p) {
    const auto toBox = [](const auto& beyond) {  // beyond: by how much per axis
        return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
    };
    switch (shape.getShapeType()) {
        case SPHERE_SHAPE_PROXYTYPE:
            return p.norm() - double(static_cast<const btSphereShape&>(shape).getRadius());
        case BOX_SHAPE_PROXYTYPE:
            return toBox(Vec3(p.cwiseAbs() - toVec3(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin())));
        case STATIC_PLANE_PROXYTYPE: {
            const auto& plane = static_cast<const btStaticPlaneShape&>(shape);
            const Vec3 normal = toVec3(plane.getPlaneNormal());
            return (normal.dot(p) - double(plane.getPlaneConstant())) / normal.norm();
        }
        case CAPSULE_SHAPE_PROXYTYPE: {
            const auto& capsule = static_cast<const btCapsuleShape&>(shape);
            const int up = capsule.getUpAxis();
            const double half = double(capsule.getHalfHeight());
            return (p - std::clamp(p[up], -half, half) * Vec3::Unit(up)).norm() - double(capsule.getRadius());
        }
        case CYLINDER_SHAPE_PROXYTYPE: {
            const auto& cylinder = static_cast<const btCylinderShape&>(shape);
            const int up = cylinder.getUpAxis();
            const double half = double(cylinder.getHalfExtentsWithMargin()[up]);
            const double across = (p - p[up] * Vec3::Unit(up)).norm();
            return toBox(Eigen::Vector2d(across - double(cylinder.getRadius()), std::abs(p[up]) - half));
        }
        default:
            throw std::runtime_error(std::string("jacket::testing::penetration: has no exact surface of a ") +
                                     shape.getName());
    }
}

}  // namespace detail

/// Linear momentum of all shells, dynamic bodies and links of multibodies, at one instant: before the gravity of the
/// coming substep [N s].
inline Vec3 totalMomentum(const btCollisionWorld& world, const bullet::ShellWorld& shells) {
    Vec3 sum = Vec3::Zero();
    for (int i = 0; i < shells.size(); ++i) sum += toVec3(shells[i].linearMomentum());
    detail::forEachMovingPart(world, [&](const detail::MovingPart& part) { sum += part.mass * part.velocity; });
    return sum;
}

/// Angular momentum of the same about the origin [N m s].
inline Vec3 totalAngularMomentum(const btCollisionWorld& world, const bullet::ShellWorld& shells) {
    Vec3 sum = Vec3::Zero();
    for (int i = 0; i < shells.size(); ++i) {
        const Shell& shell = shells[i].shell();
        const Vec3 firstMoment = shell.positions() * shell.masses();
        sum += shell.angularMomentum(Vec3::Zero()) - firstMoment.cross(detail::pendingGravity(shells[i]));
    }
    detail::forEachMovingPart(world, [&](const detail::MovingPart& part) {
        sum += part.centre.cross(part.mass * part.velocity) + part.inertia * part.spin;
    });
    return sum;
}

/// Energy of all shells, dynamic bodies and links of multibodies (which count as bodies) [J], at the instant of
/// totalMomentum: whatever rests has the kinetic energy m (g h)^2 / 2 of the impulse that is to meet the coming
/// gravity (but for shells that touch kinematic bodies and nothing that they could push: these wait for the motion).
/// Heights are measured from the origin.
struct Energy {
    double kineticOfBodies = 0.0, kineticOfShells = 0.0;
    double potentialOfBodies = 0.0, potentialOfShells = 0.0;
    double membrane = 0.0, bending = 0.0;
    double plasticWork = 0.0;  ///< turned into heat so far; not part of the total
    double total() const {
        return kineticOfBodies + kineticOfShells + potentialOfBodies + potentialOfShells + membrane + bending;
    }
};

inline Energy energy(const btDynamicsWorld& world, const bullet::ShellWorld& shells) {
    Energy sum;
    for (int i = 0; i < shells.size(); ++i) {
        const Shell& shell = shells[i].shell();
        sum.potentialOfShells -= toVec3(world.getGravity()).dot(shell.positions() * shell.masses());
        const ShellEnergy stored = shells[i].ledger().energy;
        sum.kineticOfShells += stored.kinetic;
        sum.membrane += stored.membrane;
        sum.bending += stored.bending;
        sum.plasticWork += stored.plasticWork;
    }
    detail::forEachMovingPart(world, [&](const detail::MovingPart& part) {
        sum.kineticOfBodies += part.kinetic();
        sum.potentialOfBodies -= part.mass * part.gravity.dot(part.centre);
    });
    return sum;
}

template <class World>
Vec3 totalMomentum(const Scene<World>& scene) {
    return totalMomentum(scene.world, *scene.shells);
}
template <class World>
Vec3 totalAngularMomentum(const Scene<World>& scene) {
    return totalAngularMomentum(scene.world, *scene.shells);
}
template <class World>
Energy energy(const Scene<World>& scene) {
    return energy(scene.world, *scene.shells);
}

/// Runs the scene; the most by which its total energy exceeded that at the start, at the end of any step [J].
template <class World>
double energyGain(Scene<World>& scene, double seconds, double h) {
    const double start = energy(scene).total();
    double gain = 0.0;
    for (int i = 0; i < int(seconds / h + 0.5); ++i) {
        scene.step(h);
        gain = std::max(gain, energy(scene).total() - start);
    }
    return gain;
}

/// Deepest that a vertex, edge midpoint or triangle's centroid of the shell stands inside the body's true surface [m],
/// 0 if none does. For spheres, boxes, planes, capsules, cylinders, and compounds of them; throws std::runtime_error
/// for other shapes.
inline double penetration(const bullet::ShellBody& shell, const btCollisionShape& shape, const btTransform& pose) {
    if (shape.isCompound()) {
        const auto& compound = static_cast<const btCompoundShape&>(shape);
        double deepest = 0.0;
        for (int i = 0; i < compound.getNumChildShapes(); ++i)
            deepest =
                std::max(deepest, penetration(shell, *compound.getChildShape(i), pose * compound.getChildTransform(i)));
        return deepest;
    }
    const Mat3 turn = detail::toMat3(pose.getBasis());
    const Vec3 origin = toVec3(pose.getOrigin());
    const Points& x = shell.shell().positions();
    double deepest = 0.0;
    const auto look = [&](const Vec3& p) {
        deepest = std::max(deepest, -detail::signedDistance(shape, turn.transpose() * (p - origin)));
    };
    for (int i = 0; i < x.cols(); ++i) look(x.col(i));
    for (const auto& e : shell.shell().mesh().edges()) look(0.5 * (x.col(e.v0) + x.col(e.v1)));
    for (int t = 0; t < shell.triangles().cols(); ++t) {
        const auto c = shell.triangles().col(t);
        look((x.col(c[0]) + x.col(c[1]) + x.col(c[2])) / 3.0);
    }
    return deepest;
}
inline double penetration(const bullet::ShellBody& shell, const btCollisionObject& body) {
    return penetration(shell, *body.getCollisionShape(), body.getWorldTransform());
}

/// What the shell's contacts gave to a body in the last substep [N s].
inline Vec3 contactImpulse(const bullet::ShellBody& shell, const btCollisionObject& body) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 0; i < shell.contacts().size(); ++i)
        if (shell.contacts()[i].object == &body) sum -= shell.contacts()[i].impulse;
    return sum;
}
/// The same, to all bodies.
inline Vec3 contactImpulse(const bullet::ShellBody& shell) {
    Vec3 sum = Vec3::Zero();
    for (const ContactImpulse& contact : shell.contacts()) sum -= contact.impulse;
    return sum;
}

/// Positions and velocities of all shells, poses and velocities of all bodies, bases and joints: everything that a
/// replay must repeat.
template <class World>
std::vector<double> stateOf(const Scene<World>& scene) {
    std::vector<double> state;
    const auto append = [&](const Vec3& v) { state.insert(state.end(), v.begin(), v.end()); };
    for (int i = 0; i < scene.shells->size(); ++i) {
        const Shell& shell = (*scene.shells)[i].shell();
        state.insert(state.end(), shell.positions().data(), shell.positions().data() + shell.positions().size());
        state.insert(state.end(), shell.velocities().data(), shell.velocities().data() + shell.velocities().size());
    }
    detail::forEachDynamicBody(scene.world, [&](const btRigidBody& body) {
        append(toVec3(body.getWorldTransform().getOrigin()));
        for (int row = 0; row < 3; ++row) append(toVec3(body.getWorldTransform().getBasis()[row]));
        append(toVec3(body.getLinearVelocity()));
        append(toVec3(body.getAngularVelocity()));
    });
    detail::forEachMultiBody(scene.world, [&](const btMultiBody& body, const Vec3&) {
        const btQuaternion& turn = body.getWorldToBaseRot();
        append(toVec3(body.getBasePos()));
        for (const btScalar part : {turn.x(), turn.y(), turn.z(), turn.w()}) state.push_back(double(part));
        for (int link = 0; link < body.getNumLinks(); ++link)
            for (int k = 0; k < body.getLink(link).m_posVarCount; ++k)
                state.push_back(double(body.getJointPosMultiDof(link)[k]));
        for (int k = 0; k < 6 + body.getNumDofs(); ++k) state.push_back(double(body.getVelocityVector()[k]));
    });
    return state;
}

/// Whether two runs end in the same bits. `makeAndRun`: makes a scene, runs it, returns its stateOf() (or any other
/// std::vector<double>).
template <class MakeAndRun>
bool replayEqual(MakeAndRun makeAndRun) {
    const std::vector<double> first = makeAndRun(), second = makeAndRun();
    return std::equal(first.begin(), first.end(), second.begin(), second.end(), [](double a, double b) {
        return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
    });
}

}  // namespace jacket::testing
