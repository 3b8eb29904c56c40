#include "Checks.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <cmath>
#include <iomanip>
#include <sstream>
#include <utility>

#include "Islands.h"

namespace jacket::bullet {
namespace {

bool isFinite(const btVector3& v) {
    return std::isfinite(v.x()) && std::isfinite(v.y()) && std::isfinite(v.z());
}

bool isFinite(const btMatrix3x3& m) {
    return isFinite(m[0]) && isFinite(m[1]) && isFinite(m[2]);
}

std::string millimetres(double length) {
    std::ostringstream text;
    text << std::setprecision(3) << 1e3 * length << " mm";
    return text.str();
}

std::string nameOf(const ShellBody& shell) {
    return shell.name().empty() ? "a shell without a name" : "shell \"" + shell.name() + "\"";
}

/// Spheres, capsules and the like are all margin.
bool hasCorners(const btCollisionShape& shape) {
    const int type = shape.getShapeType();
    return shape.isPolyhedral() || type == CYLINDER_SHAPE_PROXYTYPE || type == CONE_SHAPE_PROXYTYPE;
}

}  // namespace

const char* defectOf(const btCollisionObject& object) {
    const btTransform& pose = object.getWorldTransform();
    if (!isFinite(pose.getOrigin()) || !isFinite(pose.getBasis())) return "position is not finite";
    const btRigidBody* body = btRigidBody::upcast(&object);
    if (!body) return nullptr;
    if (!isFinite(body->getLinearVelocity()) || !isFinite(body->getAngularVelocity())) return "velocity is not finite";
    if (!isFinite(body->getTotalForce()) || !isFinite(body->getTotalTorque())) return "force is not finite";
    if (!isFinite(body->getGravity())) return "gravity is not finite";
    const btVector3& inertia = body->getInvInertiaDiagLocal();
    if (!std::isfinite(body->getInvMass()) || body->getInvMass() < btScalar(0) || !isFinite(inertia) ||
        !isFinite(body->getInvInertiaTensorWorld()) || inertia[inertia.minAxis()] < btScalar(0))
        return "mass or inertia is negative or not finite";
    return nullptr;
}

ShellChecks::Known& ShellChecks::known(const ShellBody& shell) {
    const auto [entry, fresh] = m_known.try_emplace(&shell);
    if (!fresh) return entry->second;
    const Points& rest = shell.shell().restPositions();
    entry->second.size = (rest.rowwise().maxCoeff() - rest.rowwise().minCoeff()).norm();
    if (const double edge = shell.shell().meanEdge(); shell.contactThickness() > edge)
        m_warnings.push_back(nameOf(shell) + ": contact thickness " + millimetres(shell.contactThickness()) +
                             " is larger than the edges (" + millimetres(edge) + " on average)");
    return entry->second;
}

void ShellChecks::lookAtGravity(const btVector3& gravity) {
    if (isFinite(gravity) || m_warnedOfGravity) return;
    m_warnedOfGravity = true;
    m_warnings.emplace_back("shells keep the last finite gravity while the world's is not finite");
}

bool ShellChecks::isLength(btScalar h) {
    if (std::isfinite(h) && h >= btScalar(0)) return true;
    if (!std::exchange(m_warnedOfLength, true))
        m_warnings.push_back("shells reject steps of " + std::to_string(double(h)) +
                             " s: a length must be finite and >= 0");
    return false;
}

void ShellChecks::noteLetGo(const ShellBody& shell, int anchors) {
    m_warnings.push_back(nameOf(shell) + " was let go of at " + std::to_string(anchors) +
                         (anchors == 1 ? " vertex" : " vertices") + " by a body that was teleported without it");
}

void ShellChecks::look(const Island& island) {
    for (const ShellBody* shell : island.shells) known(*shell);
    for (const auto& [index, body] : island.pairs) {
        const btCollisionShape& shape = *island.obstacles[body].object->getCollisionShape();
        const ShellBody& shell = *island.shells[index];
        Known& about = known(shell);
        if (about.warnedOfMargin || !hasCorners(shape) || !(double(shape.getMargin()) > about.size)) continue;
        about.warnedOfMargin = true;
        m_warnings.push_back(nameOf(shell) + " of " + millimetres(about.size) + " is smaller than the margin " +
                             millimetres(double(shape.getMargin())) + " of a " + shape.getName() + " near it");
    }
}

}  // namespace jacket::bullet
