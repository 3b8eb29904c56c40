#include "energy/PatchEnergy.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

namespace jacket {
namespace {

/// Unit normal of a triangle, and how it turns: moving corner j by d adds -slope_j (n . d).
struct Normal {
    Vec3 n;
    Mat3 slopes;  ///< gradients of the corners' hat functions, a column each [1/m]
};

Normal normalOf(const std::vector<int>& v, const Points& x) {
    const Vec3 x0 = x.col(v[0]), x1 = x.col(v[1]), x2 = x.col(v[2]);
    const Vec3 twiceArea = (x1 - x0).cross(x2 - x0);
    const double length2 = std::max(twiceArea.squaredNorm(), 1e-300);
    Normal result{twiceArea / std::sqrt(length2), {}};
    const Vec3 scaled = twiceArea / length2;
    result.slopes << scaled.cross(x2 - x1), scaled.cross(x0 - x2), scaled.cross(x1 - x0);
    return result;
}

double norm(const Vec3& k) {  // of a symmetric tensor given as uu, vv, uv
    return std::sqrt(k[0] * k[0] + k[1] * k[1] + 2.0 * k[2] * k[2]);
}

}  // namespace

PatchEnergy::PatchEnergy(const HalfEdgeMesh& mesh, const RestShape& rest, std::vector<Plate> plates)
    : m_plates(std::move(plates)), m_elements(mesh.triangleCount()) {
    const MirroredMesh mirrored(mesh, rest.mirrors, rest.rigid);
    const std::vector<Patch> patches = makePatches(mesh, mirrored, rest.positions);
    for (int t = 0; t < mesh.triangleCount(); ++t) setUp(t, mirrored, patches[t], rest);
    assembleConstant(mesh.vertexCount());
}

Mat3 PatchEnergy::plateMatrix(int triangle) const {
    const auto& [stiffness, nu, yield, hardening] = m_plates[triangle];
    Mat3 c;
    c << 1.0, nu, 0.0, nu, 1.0, 0.0, 0.0, 0.0, 2.0 * (1.0 - nu);
    return stiffness * m_elements[triangle].area * c;
}

/// Splits the rest patch's second derivatives into curvature times normal and a share in the triangle's plane, which
/// follows the triangle's two edges: subtracting that from B leaves nothing at rest, and turns and stretches with the
/// shell.
void PatchEnergy::setUp(int triangle, const MirroredMesh& mesh, const Patch& patch, const RestShape& shape) {
    constexpr double kFlat = 1e-9;  // curvature times patch size that is rounding
    const Points& rest = shape.positions;
    Element& e = m_elements[triangle];
    e.area = patch.area;
    SecondDerivatives rows = patch.derivatives;
    Vectors bent = Vectors::Zero();
    for (std::size_t k = 0; k < patch.nodes.size(); ++k) {
        const auto [vertex, image] = mesh.node(patch.nodes[k]);
        bent += (mesh.restImage(image)(rest.col(vertex)) - patch.centre) * rows.col(k).transpose();
    }
    const Vec3 corner = rest.col(mesh.node(patch.nodes[0]).vertex);
    Eigen::Matrix<double, 3, 2> edges;
    edges << rest.col(mesh.node(patch.nodes[1]).vertex) - corner, rest.col(mesh.node(patch.nodes[2]).vertex) - corner;
    if (bent.cwiseAbs().maxCoeff() * std::sqrt(patch.area) > kFlat && !shape.flattened) {
        e.curvature = bent.transpose() * patch.normal;
        const Eigen::Matrix<double, 2, 3> inPlane = (edges.transpose() * edges).inverse() * edges.transpose() * bent;
        rows.col(1) -= inPlane.row(0).transpose();
        rows.col(2) -= inPlane.row(1).transpose();
        rows.col(0) += (inPlane.row(0) + inPlane.row(1)).transpose();
    }
    const auto isImage = [&](int node) { return mesh.node(node).image != 0; };
    if (std::none_of(patch.nodes.begin(), patch.nodes.end(), isImage)) {
        for (const int i : patch.nodes) e.vertices.push_back(mesh.node(i).vertex);
        e.rows = std::move(rows);
        return;
    }
    e.mirrored = static_cast<int>(m_mirrored.size());
    Mirrored m{.rows = {}, .offset = Eigen::Matrix<double, 9, 1>::Zero(), .hessian = {}};
    m.rows.setZero(9, 3 * patch.nodes.size());
    for (std::size_t k = 0; k < patch.nodes.size(); ++k) {
        const auto [vertex, image] = mesh.node(patch.nodes[k]);
        auto found = std::find(e.vertices.begin(), e.vertices.end(), vertex);
        const auto column = found - e.vertices.begin();
        if (found == e.vertices.end()) e.vertices.push_back(vertex);
        for (int ab = 0; ab < 3; ++ab) {
            m.rows.block<3, 3>(3 * ab, 3 * column) += rows(ab, k) * mesh.worldImage(image).linear;
            m.offset.segment<3>(3 * ab) += rows(ab, k) * mesh.worldImage(image).offset;
        }
    }
    m.rows.conservativeResize(9, 3 * e.vertices.size());
    m_mirrored.push_back(std::move(m));
}

void PatchEnergy::assembleConstant(int vertexCount) {
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t t = 0; t < m_elements.size(); ++t) {
        const Element& e = m_elements[t];
        const Mat3 plate = plateMatrix(static_cast<int>(t));
        if (e.mirrored >= 0) {
            Mirrored& m = m_mirrored[e.mirrored];
            Eigen::Matrix<double, 9, 9> wide;
            for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b) wide.block<3, 3>(3 * a, 3 * b) = plate(a, b) * Mat3::Identity();
            m.hessian = m.rows.transpose() * wide * m.rows;
            continue;
        }
        const Eigen::MatrixXd local = e.rows.transpose() * plate * e.rows;
        for (std::size_t i = 0; i < e.vertices.size(); ++i)
            for (std::size_t j = 0; j < e.vertices.size(); ++j)
                entries.emplace_back(e.vertices[i], e.vertices[j], local(i, j));
    }
    m_constant.resize(vertexCount, vertexCount);
    m_constant.setFromTriplets(entries.begin(), entries.end());
}

/// How many of a patch's vertices, its own corners first, share blocks with all of it.
std::size_t PatchEnergy::columnsOf(std::size_t triangle) const {
    const Element& e = m_elements[triangle];
    if (e.mirrored >= 0) return e.vertices.size();
    return std::isfinite(m_plates[triangle].yieldCurvature) || !e.curvature.isZero(0.0) ? 3 : 0;
}

void PatchEnergy::collectPairs(std::vector<std::pair<int, int>>& pairs) const {
    for (std::size_t t = 0; t < m_elements.size(); ++t) {
        const Element& e = m_elements[t];
        for (std::size_t j = 0; j < columnsOf(t); ++j)
            for (std::size_t i = j + 1; i < e.vertices.size(); ++i) pairs.emplace_back(e.vertices[i], e.vertices[j]);
    }
}

void PatchEnergy::bind(const BlockMatrix& matrix) {
    m_slots.assign(m_elements.size(), {});
    for (std::size_t t = 0; t < m_elements.size(); ++t) {
        const Element& e = m_elements[t];
        for (std::size_t j = 0; j < columnsOf(t); ++j)
            for (std::size_t i = j + 1; i < e.vertices.size(); ++i)
                m_slots[t].push_back(pairSlot(matrix, e.vertices[i], e.vertices[j]));
    }
}

PatchEnergy::Vectors PatchEnergy::derivatives(const Element& e, const Points& x) const {
    if (e.mirrored >= 0) {
        const Mirrored& m = m_mirrored[e.mirrored];
        Eigen::Matrix<double, 9, 1> sum = m.offset;
        for (std::size_t i = 0; i < e.vertices.size(); ++i) sum += m.rows.middleCols<3>(3 * i) * x.col(e.vertices[i]);
        return Eigen::Map<const Vectors>(sum.data());
    }
    const Vec3 origin = x.col(e.vertices[0]);  // loses no digits far from the origin
    Vectors sum = Vectors::Zero();
    for (std::size_t i = 1; i < e.vertices.size(); ++i)
        sum += (x.col(e.vertices[i]) - origin) * e.rows.col(i).transpose();
    return sum;
}

PatchEnergy::Vectors PatchEnergy::residual(const Element& e, const Points& x, const Vec3& normal) const {
    return derivatives(e, x) - normal * e.curvature.transpose();
}

double PatchEnergy::valueOf(int triangle, const Points& x) const {
    const Element& e = m_elements[triangle];
    const Vectors r = residual(e, x, normalOf(e.vertices, x).n);
    return 0.5 * r.cwiseProduct(r * plateMatrix(triangle)).sum();
}

double PatchEnergy::value(const Points& x) const {
    double sum = 0.0;
    for (std::size_t t = 0; t < m_elements.size(); ++t) sum += valueOf(static_cast<int>(t), x);
    return sum;
}

void PatchEnergy::addElementGradient(int triangle, const Points& x, Points& gradient) const {
    const Element& e = m_elements[triangle];
    const Normal normal = normalOf(e.vertices, x);
    const Vectors moments = residual(e, x, normal.n) * plateMatrix(triangle);
    if (e.mirrored >= 0) {
        const auto& rows = m_mirrored[e.mirrored].rows;
        const Eigen::Map<const Eigen::Matrix<double, 9, 1>> flat(moments.data());
        for (std::size_t i = 0; i < e.vertices.size(); ++i)
            gradient.col(e.vertices[i]) += rows.middleCols<3>(3 * i).transpose() * flat;
    } else {
        for (std::size_t i = 0; i < e.vertices.size(); ++i) gradient.col(e.vertices[i]) += moments * e.rows.col(i);
    }
    const Vec3 pull = moments * e.curvature;  // d(-b n) . moments
    for (int j = 0; j < 3; ++j) gradient.col(e.vertices[j]) += normal.slopes.col(j).dot(pull) * normal.n;
}

void PatchEnergy::addGradient(const Points& x, Points& gradient) const {
    for (std::size_t t = 0; t < m_elements.size(); ++t) addElementGradient(static_cast<int>(t), x, gradient);
}

void PatchEnergy::addTo(StepSystem& system, const Points& x, HessianKind kind) const {
    Points gradient = Points::Zero(3, x.cols());
    const Points centred = x.colwise() - x.col(0);
    gradient.transpose() = m_constant * centred.transpose();
    for (std::size_t t = 0; t < m_elements.size(); ++t) {
        const int triangle = static_cast<int>(t);
        if (m_elements[t].mirrored >= 0) addMirrored(triangle, system, x, gradient);
        if (!m_elements[t].curvature.isZero(0.0)) addNormalTerms(triangle, system, x, kind, gradient);
    }
    system.addGradient(gradient);
}

/// A mirrored patch's whole gradient, and its constant Hessian, which is no scalar.
void PatchEnergy::addMirrored(int triangle, StepSystem& system, const Points& x, Points& gradient) const {
    const Element& e = m_elements[triangle];
    addElementGradient(triangle, x, gradient);
    const auto& hessian = m_mirrored[e.mirrored].hessian;
    const int* slot = m_slots[triangle].data();
    for (std::size_t j = 0; j < e.vertices.size(); ++j) {
        system.addDiagonal(e.vertices[j], hessian.block<3, 3>(3 * j, 3 * j));
        for (std::size_t i = j + 1; i < e.vertices.size(); ++i)
            system.addPair(*slot++, hessian.block<3, 3>(3 * i, 3 * j));
    }
}

/// The energy's term -p(x) . n(x), p = sum_i w_i x_i, w = D A B^T C b: its gradient (a mirrored patch has that
/// already), and its second derivatives. With s_j the slopes:
///   x_i x_j:  w_i s_j n^T;   x_j x_k:  -(s_j . p) s_k n^T - (s_k . p) n s_j^T + (n . p) (s_j . s_k) n n^T
/// Gauss-Newton keeps of the latter the last term, with its value at rest, b C b, for n . p.
void PatchEnergy::addNormalTerms(int triangle, StepSystem& system, const Points& x, HessianKind kind,
                                 Points& gradient) const {
    const Element& e = m_elements[triangle];
    const Normal normal = normalOf(e.vertices, x);
    const Vec3& n = normal.n;
    const Vec3 weighted = plateMatrix(triangle) * e.curvature;
    const bool mirrored = e.mirrored >= 0;
    const Vec3 p = derivatives(e, x) * weighted;
    const double stiff = kind == HessianKind::Exact ? n.dot(p) : e.curvature.dot(weighted);
    const auto ofCorners = [&](int j, int k) {
        const Vec3 sj = normal.slopes.col(j), sk = normal.slopes.col(k);
        Mat3 m = stiff * sj.dot(sk) * n * n.transpose();
        if (kind == HessianKind::Exact) m -= sj.dot(p) * sk * n.transpose() + sk.dot(p) * n * sj.transpose();
        return m;
    };
    const auto ofVertex = [&](std::size_t i, int j) -> Mat3 {  // derivative of the force on i by corner j
        const Vec3 slope = normal.slopes.col(j);
        if (!mirrored) return weighted.dot(e.rows.col(i)) * slope * n.transpose();
        Mat3 w = Mat3::Zero();
        for (int ab = 0; ab < 3; ++ab)
            w += weighted[ab] * m_mirrored[e.mirrored].rows.block<3, 3>(3 * ab, 3 * i).transpose();
        return w * slope * n.transpose();
    };
    if (!mirrored) {
        for (std::size_t i = 0; i < e.vertices.size(); ++i)
            gradient.col(e.vertices[i]) -= weighted.dot(e.rows.col(i)) * n;
        for (int j = 0; j < 3; ++j) gradient.col(e.vertices[j]) += normal.slopes.col(j).dot(p) * n;
    }
    std::size_t slot = 0;
    for (int j = 0; j < 3; ++j) {  // the pairs of the corners come first
        for (std::size_t i = j; i < e.vertices.size(); ++i) {
            Mat3 block = ofVertex(i, j);
            if (i < 3) {
                block += ofVertex(j, static_cast<int>(i)).transpose();
                block += ofCorners(static_cast<int>(i), j);
            }
            if (static_cast<int>(i) == j)
                system.addDiagonal(e.vertices[j], block);
            else
                system.addPair(m_slots[triangle][slot++], block);
        }
    }
}

Vec3 PatchEnergy::bendingStrain(int triangle, const Points& x) const {
    const Element& e = m_elements[triangle];
    const Vec3 n = normalOf(e.vertices, x).n;
    return derivatives(e, x).transpose() * n - e.curvature;
}

PlasticFlow PatchEnergy::flow(const Points& x) {
    PlasticFlow result;
    for (std::size_t t = 0; t < m_elements.size(); ++t) {
        const Plate& plate = m_plates[t];
        if (!std::isfinite(plate.yieldCurvature)) continue;
        Element& e = m_elements[t];
        const Vec3 strain = bendingStrain(static_cast<int>(t), x);
        const double size = norm(strain), limit = plate.yieldCurvature + plate.hardening * e.accumulated;
        if (!(size > limit * (1.0 + kYieldRounding))) continue;
        const double before = valueOf(static_cast<int>(t), x);
        const double slip = (size - limit) / (1.0 + plate.hardening);
        e.accumulated += slip;
        e.curvature += slip / size * strain;
        result.add(before - valueOf(static_cast<int>(t), x), static_cast<int>(t));
    }
    return result;
}

}  // namespace jacket
