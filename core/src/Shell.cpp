#include "jacket/Shell.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "ShellAssembly.h"
#include "jacket/Island.h"
#include "jacket/models/StencilTools.h"

namespace jacket {
namespace {

void requireColumns(Eigen::Index columns, int count, const char* what) {
    if (columns != count)
        throw std::invalid_argument(std::string(what) + " must have " + std::to_string(count) + " columns, got " +
                                    std::to_string(columns));
}

void requireSize(const Points& points, int count, const char* what) {
    requireColumns(points.cols(), count, what);
    for (int i = 0; i < count; ++i)
        if (!points.col(i).allFinite())
            throw std::invalid_argument(std::string(what) + " must be finite, vertex " + std::to_string(i) + " is not");
}

void requireFinite(const Vec3& value, const char* what) {
    if (!value.allFinite()) throw std::invalid_argument(std::string(what) + " must be finite");
}

void requireMaterials(const std::vector<ShellMaterial>& materials, const std::vector<int>& ofTriangle,
                      int triangleCount) {
    if (materials.empty()) throw std::invalid_argument("Shell: needs at least one material");
    for (const auto& material : materials) validate(material);
    if (ofTriangle.empty() && materials.size() == 1) return;
    if (static_cast<int>(ofTriangle.size()) != triangleCount)
        throw std::invalid_argument("Shell: a material must be named for each of the " + std::to_string(triangleCount) +
                                    " triangles, got " + std::to_string(ofTriangle.size()));
    for (std::size_t t = 0; t < ofTriangle.size(); ++t)
        if (ofTriangle[t] < 0 || ofTriangle[t] >= static_cast<int>(materials.size()))
            throw std::invalid_argument("Shell: material of triangle " + std::to_string(t) + " must be 0.." +
                                        std::to_string(materials.size() - 1) + ", got " +
                                        std::to_string(ofTriangle[t]));
}

void requireWindFactor(double value, const char* field) {
    requireParameter(value >= 0.0 && std::isfinite(value), field, ">= 0 and finite", value);
}

}  // namespace

void validate(const Wind& wind) {
    requireFinite(wind.velocity, "Wind.velocity [m/s]");
    requireWindFactor(wind.airDensity, "Wind.airDensity [kg/m^3]");
    requireWindFactor(wind.normalDrag, "Wind.normalDrag [-]");
    requireWindFactor(wind.tangentialDrag, "Wind.tangentialDrag [-]");
}

Shell::Shell(const TriangleMesh& mesh, const ShellMaterial& material, const ShellSettings& settings)
    : Shell(mesh, std::vector<ShellMaterial>{material}, {}, settings) {}

Shell::Shell(const TriangleMesh& mesh, std::vector<ShellMaterial> materials, std::vector<int> ofTriangle,
             const ShellSettings& settings)
    : m_settings(settings), m_rest(mesh.positions), m_x(mesh.positions) {
    requireUsable(mesh);
    requireMaterials(materials, ofTriangle, static_cast<int>(mesh.triangles.cols()));
    if (!(settings.tolerance > 0.0 && settings.tolerance < 1.0))
        throw std::invalid_argument("ShellSettings.tolerance must be between 0 and 1, got " +
                                    std::to_string(settings.tolerance));
    if (settings.maxIterations < 1)
        throw std::invalid_argument("ShellSettings.maxIterations must be >= 1, got " +
                                    std::to_string(settings.maxIterations));
    const int n = static_cast<int>(mesh.positions.cols());
    m_mesh = std::make_unique<HalfEdgeMesh>(mesh.triangles, n);
    m_v.setZero(3, n);
    m_force.setZero(3, n);
    m_y.setZero(3, n);
    m_pinned.assign(n, 0);
    m_design = std::make_unique<ShellDesign>();
    m_design->materials = {std::move(materials), std::move(ofTriangle)};
    setMasses();
    rebuild();
}

void Shell::setMasses() {
    m_mass.setZero(vertexCount());
    for (int t = 0; t < m_mesh->triangleCount(); ++t) {
        const auto corners = m_mesh->triangles().col(t);
        const double area = triangleArea(m_rest.col(corners[0]), m_rest.col(corners[1]), m_rest.col(corners[2]));
        const double density = m_design->materials.at(t).areaDensity();
        for (int a = 0; a < 3; ++a) m_mass[corners[a]] += density * area / 3.0;
    }
}

void Shell::rebuild() {
    const auto edges = m_mesh->edges();
    m_restLength.resize(static_cast<Eigen::Index>(edges.size()));
    for (std::size_t i = 0; i < edges.size(); ++i)
        m_restLength[i] = (m_rest.col(edges[i].v1) - m_rest.col(edges[i].v0)).norm();
    m_meanEdge = m_restLength.mean();
    m_assembly = std::make_unique<ShellAssembly>(*this, *m_design);
}

const ShellMaterial& Shell::material() const {
    return m_design->materials.list.front();
}

Shell::~Shell() = default;
Shell::Shell(Shell&&) noexcept = default;
Shell& Shell::operator=(Shell&&) noexcept = default;

void Shell::setPositions(const Points& x) {
    ++m_revision;
    requireSize(x, vertexCount(), "Shell positions");
    m_x = x;
    m_y.setZero();
    m_lastH = 0.0;
    for (auto& [vertex, target] : m_pinTarget) target = m_x.col(vertex);
}

void Shell::setVelocities(const Points& v) {
    ++m_revision;
    requireSize(v, vertexCount(), "Shell velocities");
    m_v = v;
    m_lastH = 0.0;
}

double Shell::bendingLength(double h) const {
    return std::pow(h * h * material().bendingStiffness() / material().areaDensity(), 0.25);
}

bool Shell::isStiff(double h) const {
    constexpr double kEdges = 2.0;
    return bendingLength(h) > kEdges * m_meanEdge;
}

bool Shell::isStiffAsAWhole(double h) const {
    constexpr double kLengths = 16.0;
    return side() < kLengths * bendingLength(h);
}

double Shell::side() const {
    return m_meanEdge * std::sqrt(0.5 * m_mesh->triangleCount());
}

void Shell::displace(int vertex, const Vec3& by) {
    m_x.col(vertex) += by;
    m_lastH = 0.0;
}

void Shell::requireVertex(int vertex, const char* what) const {
    if (vertex < 0 || vertex >= vertexCount())
        throw std::out_of_range(std::string(what) + ": vertex must be 0.." + std::to_string(vertexCount() - 1) +
                                ", got " + std::to_string(vertex));
}

void Shell::pin(int vertex) {
    requireVertex(vertex, "Shell::pin");
    if (m_pinned[vertex] && m_pinTarget.at(vertex) == m_x.col(vertex)) return;
    ++m_revision;
    m_pinCount += m_pinned[vertex] || isGuided(vertex) ? 0 : 1;
    m_pinned[vertex] = 1;
    m_pinTarget[vertex] = m_x.col(vertex);
}

void Shell::movePin(int vertex, const Vec3& target) {
    requireVertex(vertex, "Shell::movePin");
    requireFinite(target, "Shell::movePin: target");
    if (m_pinned[vertex] && m_pinTarget.at(vertex) == target) return;
    ++m_revision;
    pin(vertex);
    m_pinTarget[vertex] = target;
}

void Shell::unpin(int vertex) {
    ++m_revision;
    requireVertex(vertex, "Shell::unpin");
    m_pinCount -= m_pinned[vertex] || isGuided(vertex) ? 1 : 0;
    m_pinned[vertex] = 0;
    m_pinTarget.erase(vertex);
    if (!m_freedom.empty()) {
        m_freedom[vertex].setIdentity();
        m_guided[vertex] = 0;
    }
}

void Shell::setForce(int vertex, const Vec3& force) {
    requireVertex(vertex, "Shell::setForce");
    requireFinite(force, "Shell::setForce: force");
    if (m_force.col(vertex) == force) return;
    ++m_revision;
    m_force.col(vertex) = force;
}

void Shell::setPressure(double pressure) {
    if (!std::isfinite(pressure)) throw std::invalid_argument("Shell::setPressure: pressure [Pa] must be finite");
    if (pressure == m_pressure) return;
    ++m_revision;
    m_pressure = pressure;
}

ShellEnergy Shell::energy() const {
    ShellEnergy e;
    e.kinetic = kineticEnergy();
    e.membrane = m_assembly->membrane().value(m_x);
    e.bending = m_assembly->bending().value(m_x);
    e.plasticWork = m_plasticWork;
    return e;
}

double Shell::kineticEnergy() const {
    return kineticEnergy(m_v);
}

double Shell::kineticEnergy(const Eigen::Ref<const Points>& v) const {
    requireColumns(v.cols(), vertexCount(), "Shell::kineticEnergy: velocities");
    return 0.5 * m_mass.dot(v.colwise().squaredNorm().transpose());
}

Vec3 Shell::linearMomentum() const {
    return m_v * m_mass;
}

Vec3 Shell::angularMomentum(const Vec3& about) const {
    Vec3 sum = Vec3::Zero();
    for (int i = 0; i < vertexCount(); ++i) sum += m_mass[i] * (m_x.col(i) - about).cross(Vec3(m_v.col(i)));
    return sum;
}

double Shell::maxStretch() const {
    double most = 0.0;
    const auto edges = m_mesh->edges();
    for (std::size_t i = 0; i < edges.size(); ++i)
        most = std::max(most, (m_x.col(edges[i].v0) - m_x.col(edges[i].v1)).norm() / m_restLength[i] - 1.0);
    return most;
}

Points Shell::vertexNormals() const {
    Points normals = Points::Zero(3, vertexCount());
    for (int t = 0; t < m_mesh->triangleCount(); ++t) {
        const auto c = m_mesh->triangles().col(t);
        const Vec3 n = (m_x.col(c[1]) - m_x.col(c[0])).cross(m_x.col(c[2]) - m_x.col(c[0]));
        for (int a = 0; a < 3; ++a) normals.col(c[a]) += n;
    }
    for (int i = 0; i < vertexCount(); ++i) {
        const double length = normals.col(i).norm();
        normals.col(i) = length > 0.0 ? Vec3(normals.col(i) / length) : Vec3::UnitY();
    }
    return normals;
}

Points Shell::elasticForces() const {
    Points gradient = Points::Zero(3, vertexCount());
    m_assembly->membrane().addGradient(m_x, gradient);
    m_assembly->bending().addGradient(m_x, gradient);
    return -gradient;
}

double Shell::elasticEnergy(const Points& x) const {
    requireSize(x, vertexCount(), "Shell::elasticEnergy: positions");
    return m_assembly->membrane().value(x) + m_assembly->bending().value(x);
}

Vec3 Shell::reaction(int vertex, const Vec3& gravity) const {
    requireVertex(vertex, "Shell::reaction");
    const StepSystem& system = m_assembly->assembleStatic(*this, gravity, 1.0, HessianKind::Positive);
    return -system.rhs.col(vertex);
}

StepReport Shell::step(double h, const Vec3& gravity, const Wind* wind) {
    if (!m_ownSolver) m_ownSolver = std::make_unique<IslandSolver>();
    Shell* self = this;
    IslandInput input{.h = h, .gravity = gravity, .wind = wind, .shells = {&self, 1}};
    const StepReport report = m_ownSolver->solve(input);
    if (report.finite) advance(h);
    return report;
}

void Shell::advance(double h) {
    m_x += (m_stride * h) * m_v + m_y;
    m_y.setZero();
    m_stride = 1.0;
    flow();
}

void Shell::flow() {
    m_dent = {};
    if (!m_settings.plasticity) return;
    const PlasticFlow flow = m_assembly->flow(m_x);
    if (flow.elements == 0) return;
    m_plasticWork += flow.work;
    const auto c = m_mesh->triangles().col(flow.triangle);
    m_dent = {flow.triangle, (m_x.col(c[0]) + m_x.col(c[1]) + m_x.col(c[2])) / 3.0, flow.work, flow.elements};
}

}  // namespace jacket
