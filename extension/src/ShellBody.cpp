#include "jacket/bullet/ShellBody.h"

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "Convert.h"
#include "ManifoldPoint.h"
#include "ShellProxy.h"
#include "Sleepers.h"
#include "jacket/models/StencilTools.h"

namespace jacket::bullet {
namespace {

ShellSettings settingsOf(const ShellOptions& o) {
    requireParameter(o.friction >= 0.0 && std::isfinite(o.friction), "ShellOptions.friction", ">= 0 and finite",
                     o.friction);
    requireParameter(o.restitution >= 0.0 && o.restitution <= 1.0, "ShellOptions.restitution", "from 0 to 1",
                     o.restitution);
    requireParameter(std::isfinite(o.contactThickness), "ShellOptions.contactThickness [m]", "finite",
                     o.contactThickness);
    return {.membrane = o.membrane,
            .bending = o.bending,
            .integrator = o.integrator,
            .preconditioner = o.preconditioner,
            .tolerance = o.tolerance,
            .maxIterations = o.maxIterations,
            .plasticity = o.plasticity};
}

std::vector<ShellMaterial> materialsOf(const ShellMaterial& material, const ShellOptions& options) {
    std::vector<ShellMaterial> materials{material};
    for (const auto& region : options.regions) materials.push_back(region.material);
    return materials;
}

/// Per triangle: 0 the shell's material, k the k-th region's.
std::vector<int> regionOfTriangles(const TriangleMesh& mesh, const ShellOptions& options) {
    if (options.regions.empty()) return {};
    const int count = static_cast<int>(mesh.triangles.cols());
    std::vector<int> result(count, 0);
    for (std::size_t k = 0; k < options.regions.size(); ++k)
        for (const int t : options.regions[k].triangles) {
            if (t < 0 || t >= count)
                throw std::invalid_argument("ShellOptions.regions: triangle must be 0.." + std::to_string(count - 1) +
                                            ", got " + std::to_string(t));
            result[t] = static_cast<int>(k) + 1;
        }
    return result;
}

}  // namespace

ShellBody::ShellBody(const TriangleMesh& mesh, const ShellMaterial& material, const ShellOptions& options)
    : m_shell(mesh, materialsOf(material, options), regionOfTriangles(mesh, options), settingsOf(options)),
      m_options(options),
      m_contactThickness(options.contactThickness < 0.0 ? 0.5 * material.thickness : options.contactThickness),
      m_positions(mesh.positions.cols()),
      m_rest(std::make_unique<ShellRest>()),
      m_proxy(std::make_unique<Proxy>(*this)) {
    publish();
}

ShellBody::~ShellBody() = default;

btCollisionObject& ShellBody::collisionObject() {
    return *m_proxy;
}
const btCollisionObject& ShellBody::collisionObject() const {
    return *m_proxy;
}

void ShellBody::publish() {
    for (int i = 0; i < vertexCount(); ++i) m_positions[i] = toBullet(Vec3(m_shell.positions().col(i)));
}

std::span<const btVector3> ShellBody::normals() const {
    const Points normals = m_shell.vertexNormals();
    m_normals.resize(m_positions.size());
    for (int i = 0; i < vertexCount(); ++i) m_normals[i] = toBullet(Vec3(normals.col(i)));
    return m_normals;
}

btVector3 ShellBody::velocity(int vertex) const {
    return toBullet(Vec3(m_shell.velocities().col(vertex)));
}

void ShellBody::pin(int vertex) {
    m_shell.pin(vertex);
    endAnchorsOfHeld();
}
void ShellBody::movePin(int vertex, const btVector3& target) {
    m_shell.movePin(vertex, fromBullet(target));
    endAnchorsOfHeld();
}
void ShellBody::unpin(int vertex) {
    m_shell.unpin(vertex);
}

void ShellBody::clamp(const std::vector<int>& vertices, std::optional<btVector3> direction) {
    m_shell.clamp(vertices, direction ? std::optional(fromBullet(*direction)) : std::nullopt);
    endAnchorsOfHeld();
}

StaticReport ShellBody::settle(const btVector3& gravity, const StaticSettings& settings) {
    const StaticReport report = jacket::settle(m_shell, fromBullet(gravity), settings);
    forgetSolvedVelocity();
    publish();
    return report;
}

void ShellBody::anchor(int vertex, btRigidBody& body) {
    anchorTo(vertex, body);
}
void ShellBody::anchor(int vertex, btMultiBodyLinkCollider& link) {
    anchorTo(vertex, link);
}

void ShellBody::anchorTo(int vertex, btCollisionObject& body) {
    requireVertex(vertex, "ShellBody::anchor");
    unanchor(vertex);  // two would be two equations for the same unknowns
    if (m_shell.isPinned(vertex) || m_shell.isGuided(vertex)) m_shell.unpin(vertex);
    const btTransform& pose = body.getWorldTransform();
    m_anchors.push_back({vertex, &body, pose.inverse() * m_positions[vertex], pose});
    activate();
}

void ShellBody::unanchor(int vertex) {
    requireVertex(vertex, "ShellBody::unanchor");
    if (std::erase_if(m_anchors, [&](const Anchor& anchor) { return anchor.vertex == vertex; }) > 0) activate();
}

void ShellBody::endAnchorsOfHeld() {
    std::erase_if(m_anchors, [&](const Anchor& anchor) {
        return m_shell.isPinned(anchor.vertex) || m_shell.isGuided(anchor.vertex);
    });
}

void ShellBody::requireVertex(int vertex, const char* what) const {
    if (vertex < 0 || vertex >= vertexCount())
        throw std::out_of_range(std::string(what) + ": vertex must be 0.." + std::to_string(vertexCount() - 1) +
                                ", got " + std::to_string(vertex));
}

bool ShellBody::isAsleep() const {
    return m_rest->asleep && !m_rest->wakeAsked;
}

void ShellBody::activate() {
    m_rest->wakeAsked = true;
}

void ShellBody::fallAsleep() {
    m_shell.setVelocities(Points::Zero(3, vertexCount()));
    m_pendingGravity.setZero();
    m_hasVelocity = true;
}

BodyContact ShellBody::describe(const ContactImpulse& impulse, btCollisionObject& object) const {
    const Contact& contact = impulse.contact;
    BodyContact result{impulse, &object, triangleOf(m_shell.mesh(), contact), contact.weights};
    if (!contact.isVertex()) return result;
    for (int a = 0; a < 3; ++a)
        result.barycentric[a] = triangles()(a, result.triangle) == contact.vertices[0] ? 1.0 : 0.0;
    return result;
}

void ShellBody::setPositions(std::span<const btVector3> positions) {
    Points x(3, positions.size());
    for (std::size_t i = 0; i < positions.size(); ++i) x.col(i) = fromBullet(positions[i]);
    m_shell.setPositions(x);
    m_proxy->shape().setBounds(toBullet(Vec3(x.rowwise().minCoeff())), toBullet(Vec3(x.rowwise().maxCoeff())));
    publish();
}

void ShellBody::setVelocity(const btVector3& velocity) {
    m_shell.setVelocities(fromBullet(velocity).replicate(1, vertexCount()));
    forgetSolvedVelocity();
}

void ShellBody::forgetSolvedVelocity() {
    m_hasVelocity = false;
    m_pendingGravity.setZero();
}

void ShellBody::forgetImpulses() {
    m_contacts.clear();
    for (Anchor& anchor : m_anchors) anchor.impulse.setZero();
}

void ShellBody::note(const jacket::Anchor& anchor) {
    m_exchanged += anchor.impulse;
    for (Anchor& own : m_anchors)
        if (own.vertex == anchor.vertex) own.impulse = anchor.impulse;
}

Vec3 ShellBody::anchorImpulse(int vertex) const {
    requireVertex(vertex, "ShellBody::anchorImpulse");
    const auto found =
        std::find_if(m_anchors.begin(), m_anchors.end(), [&](const Anchor& anchor) { return anchor.vertex == vertex; });
    return found == m_anchors.end() ? Vec3(Vec3::Zero()) : found->impulse;
}

void ShellBody::note(const BodyContact& contact) {
    m_contacts.push_back(contact);
    m_exchanged -= contact.impulse;
    m_frictionLoss -= contact.impulse.dot(contact.slip);
}

ShellLedger ShellBody::ledger() const {
    ShellLedger ledger{m_shell.energy(), m_frictionLoss, momentum(), m_exchanged};
    ledger.energy.kinetic = kinetic();
    return ledger;
}

btVector3 ShellBody::linearMomentum() const {
    return toBullet(momentum());
}

Vec3 ShellBody::momentum() const {
    return m_shell.linearMomentum() - m_pendingGravity * m_shell.masses().sum();
}

/// Without the gravity that velocities hold ahead of time, as momentum().
double ShellBody::kinetic() const {
    Points velocities = m_shell.velocities();
    for (int i = 0; i < vertexCount(); ++i) velocities.col(i) -= m_shell.freedom(i) * m_pendingGravity;
    return m_shell.kineticEnergy(velocities);
}

}  // namespace jacket::bullet
