#include "energy/PatchEnergy.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "Kernel.h"

namespace jacket {
namespace {

constexpr int kVerticesAtATime = 1024;  ///< that a thread of a team takes

TriangleNormal normalOf(const int* v, const Points& x) {
    const Vec3 x0 = x.col(v[0]), x1 = x.col(v[1]), x2 = x.col(v[2]);
    const Vec3 twiceArea = (x1 - x0).cross(x2 - x0);
    const double length2 = std::max(twiceArea.squaredNorm(), 1e-300);
    TriangleNormal result{twiceArea / std::sqrt(length2), {}};
    const Vec3 scaled = twiceArea / length2;
    result.slopes << scaled.cross(x2 - x1), scaled.cross(x0 - x2), scaled.cross(x1 - x0);
    return result;
}

double norm(const Vec3& k) {  // of a symmetric tensor given as uu, vv, uv
    return std::sqrt(k[0] * k[0] + k[1] * k[1] + 2.0 * k[2] * k[2]);
}

/// A matrix of scalars, and positions in fours.
template <class Column>
struct ConstantRows {
    ConstantHessian::Rows<Column> inside, beside;
    const double* x;
    int count;
};

/// visit(rows)
decltype(auto) visitRows(const double* x, int count, const ConstantHessian& scalars, const auto& visit) {
    return scalars.visit([&](const auto& inside, const auto& beside) {
        return visit(ConstantRows{inside, beside, x, count});
    });
}

template <class Scalars>
JACKET_INLINE void addDifference(const Scalars& scalars, int k, const double* x, const double* xi, double (&sum)[4]) {
    const double* const xj = x + 4 * scalars.column[k];
    for (int c = 0; c < 4; ++c) sum[c] += scalars.value[k] * (xj[c] - xi[c]);
}

/// Row i of the matrix times the positions, by rising columns. Its sum is zero, so differences to x_i do: they lose no
/// digits far from the origin.
template <class Column>
JACKET_INLINE void multiplyRow(const ConstantRows<Column>& rows, int i, double (&sum)[4]) {
    const auto &inside = rows.inside, &beside = rows.beside;
    const double *const x = rows.x, *const xi = x + 4 * i;
    for (double& s : sum) s = 0.0;
    int b = beside.start[i];
    const int end = beside.start[i + 1];
    for (int k = inside.start[i]; k < inside.start[i + 1]; ++k) {
        for (; b < end && beside.column[b] < inside.column[k]; ++b) addDifference(beside, b, x, xi, sum);
        addDifference(inside, k, x, xi, sum);
    }
    for (; b < end; ++b) addDifference(beside, b, x, xi, sum);
}

/// to += factor K x for rows begin to end - 1, by three numbers a vertex.
template <class Column>
JACKET_KERNEL void addConstantGradient(const ConstantRows<Column>& rows, int begin, int end, double factor,
                                       double* to) {
    for (int i = begin; i < end; ++i) {
        double sum[4];
        multiplyRow(rows, i, sum);
        for (int c = 0; c < 3; ++c) to[3 * i + c] += factor * sum[c];
    }
}

JACKET_INLINE void loadPosition(const double* x, int i, Double4& to) {
    std::memcpy(&to, x + 4 * static_cast<std::size_t>(i), sizeof(to));
}

template <class Scalars>
JACKET_INLINE void subtractSquare(const Scalars& scalars, int k, const double* x, const Double4& xi, Double4& sum) {
    Double4 xj;
    loadPosition(x, scalars.column[k], xj);
    sum -= scalars.value[k] * ((xj - xi) * (xj - xi));
}

/// x . K x = -sum_{i<j} K_ij |x_j - x_i|^2, for the same reason.
template <class Column>
JACKET_KERNEL double constantProduct(const ConstantRows<Column>& rows) {
    const auto &inside = rows.inside, &beside = rows.beside;
    const double* const x = rows.x;
    Double4 sum{};
    for (int i = 0; i < rows.count; ++i) {
        Double4 xi;
        loadPosition(x, i, xi);
        int b = beside.start[i + 1] - 1;
        const int first = beside.start[i];
        for (int k = inside.start[i + 1] - 1; k >= inside.start[i] && inside.column[k] > i;
             --k) {  // by falling columns
            for (; b >= first && beside.column[b] > inside.column[k]; --b) subtractSquare(beside, b, x, xi, sum);
            subtractSquare(inside, k, x, xi, sum);
        }
        for (; b >= first && beside.column[b] > i; --b) subtractSquare(beside, b, x, xi, sum);
    }
    return sum[0] + sum[1] + sum[2];
}

}  // namespace

PatchEnergy::PatchEnergy(const HalfEdgeMesh& mesh, const RestShape& rest, const std::vector<Plate>& plates) {
    const MirroredMesh mirrored(mesh, rest.mirrors, rest.rigid);
    {
        const std::vector<Patch> patches = makePatches(mesh, mirrored, rest.positions);
        reserve(patches);
        for (int t = 0; t < mesh.triangleCount(); ++t) setUp(t, plates[t], mirrored, patches[t], rest);
    }
    assembleConstant(mesh.vertexCount());
    const auto isFlatForGood = [](const Element& e) { return !e.isCurved() && !e.canYield(); };
    if (!rest.flattened && std::all_of(m_elements.begin(), m_elements.end(), isFlatForGood)) keepMirroredOnly(rest);
}

/// What `setUp` fills; vertices that are seen in mirrors may need more.
void PatchEnergy::reserve(const std::vector<Patch>& patches) {
    std::size_t nodes = 0;
    for (const Patch& patch : patches) nodes += patch.nodes.size();
    m_elements.reserve(patches.size());
    m_vertices.reserve(nodes);
    m_rows.reserve(nodes);
}

Mat3 PatchEnergy::Element::plateMatrix() const {
    const double nu = plate.poisson;
    Mat3 c;
    c << 1.0, nu, 0.0, nu, 1.0, 0.0, 0.0, 0.0, 2.0 * (1.0 - nu);
    return plate.stiffness * area * c;
}

bool PatchEnergy::Element::canYield() const {
    return std::isfinite(plate.yieldCurvature);
}

const PatchEnergy::Element& PatchEnergy::elementOf(int triangle) const {
    assert(m_flatRest.cols() == 0);
    return m_elements[triangle];
}

/// Splits the rest patch's second derivatives into curvature times normal and a share in the triangle's plane, which
/// follows the triangle's two edges: subtracting that from B leaves nothing at rest, and turns and stretches with the
/// shell.
void PatchEnergy::setUp(int triangle, const Plate& plate, const MirroredMesh& mesh, const Patch& patch,
                        const RestShape& shape) {
    constexpr double kFlat = 1e-9;  // curvature times patch size that is rounding
    const Points& rest = shape.positions;
    Element& e = m_elements.emplace_back(Element{.triangle = triangle, .plate = plate, .area = patch.area});
    e.vertices = static_cast<int>(m_vertices.size());
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
    if (std::any_of(patch.nodes.begin(), patch.nodes.end(), isImage)) return setUpMirrored(e, mesh, patch, rows);
    e.rows = static_cast<int>(m_rows.size());
    e.vertexCount = static_cast<int>(patch.nodes.size());
    for (std::size_t k = 0; k < patch.nodes.size(); ++k) {
        m_vertices.push_back(mesh.node(patch.nodes[k]).vertex);
        m_rows.push_back(rows.col(k));
    }
}

void PatchEnergy::setUpMirrored(Element& e, const MirroredMesh& mesh, const Patch& patch,
                                const SecondDerivatives& rows) {
    e.mirrored = static_cast<int>(m_mirrored.size());
    Mirrored m{.rows = {}, .offset = Eigen::Matrix<double, 9, 1>::Zero(), .hessian = {}};
    m.rows.setZero(9, 3 * patch.nodes.size());
    for (std::size_t k = 0; k < patch.nodes.size(); ++k) {
        const auto [vertex, image] = mesh.node(patch.nodes[k]);
        const auto begin = m_vertices.begin() + e.vertices, found = std::find(begin, m_vertices.end(), vertex);
        const auto column = found - begin;
        if (found == m_vertices.end()) m_vertices.push_back(vertex);
        for (int ab = 0; ab < 3; ++ab) {
            m.rows.block<3, 3>(3 * ab, 3 * column) += rows(ab, k) * mesh.worldImage(image).linear;
            m.offset.segment<3>(3 * ab) += rows(ab, k) * mesh.worldImage(image).offset;
        }
    }
    e.vertexCount = static_cast<int>(m_vertices.size()) - e.vertices;
    m.rows.conservativeResize(9, 3 * e.vertexCount);
    const Mat3 plate = e.plateMatrix();
    Eigen::Matrix<double, 9, 9> wide;
    for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) wide.block<3, 3>(3 * a, 3 * b) = plate(a, b) * Mat3::Identity();
    m.hessian.reserve(e.vertexCount * (e.vertexCount + 1) / 2);
    for (int j = 0; j < e.vertexCount; ++j)
        for (int i = j; i < e.vertexCount; ++i)
            m.hessian.push_back(m.rows.middleCols<3>(3 * i).transpose() * wide * m.rows.middleCols<3>(3 * j));
    m_mirrored.push_back(std::move(m));
}

/// Row by row from the patches around each vertex, as a list of all patches' entries would be ten times the matrix.
void PatchEnergy::assembleConstant(int vertexCount) {
    std::vector<int> start(vertexCount + 1, 0), patchOf, placeIn;
    const auto forVertices = [&](const auto& visit) {
        for (std::size_t t = 0; t < m_elements.size(); ++t)
            if (m_elements[t].mirrored < 0)
                for (int i = 0; i < m_elements[t].vertexCount; ++i) visit(static_cast<int>(t), i);
    };
    const auto vertexAt = [&](int t, int i) { return verticesOf(m_elements[t])[i]; };
    forVertices([&](int t, int i) { ++start[vertexAt(t, i) + 1]; });
    for (int v = 0; v < vertexCount; ++v) start[v + 1] += start[v];
    patchOf.resize(start[vertexCount]);
    placeIn.resize(start[vertexCount]);
    std::vector<int> next(start.begin(), start.end() - 1);
    forVertices([&](int t, int i) {
        const int k = next[vertexAt(t, i)]++;
        patchOf[k] = t;
        placeIn[k] = i;
    });

    std::vector<double> row(vertexCount, 0.0);
    std::vector<int> columns;
    std::vector<char> isIn(vertexCount, 0);
    for (int v = 0; v < vertexCount; ++v) {
        columns.clear();
        for (int k = start[v]; k < start[v + 1]; ++k) {
            const Element& e = m_elements[patchOf[k]];
            const Vec3 weighted = e.plateMatrix() * rowsOf(e)[placeIn[k]];
            for (int i = 0; i < e.vertexCount; ++i) {
                const int column = verticesOf(e)[i];
                if (!isIn[column]) columns.push_back(column);
                isIn[column] = 1;
                row[column] += weighted.dot(rowsOf(e)[i]);
            }
        }
        std::sort(columns.begin(), columns.end());
        for (const int column : columns) {
            m_constant.append(column, row[column]);
            row[column] = 0.0;
            isIn[column] = 0;
        }
        m_constant.endRow();
    }
}

/// Of a shell that is flat for good the constant Hessian says all, but what mirrored patches do.
void PatchEnergy::keepMirroredOnly(const RestShape& rest) {
    std::vector<int> vertices;
    std::vector<Element> elements;
    for (Element e : m_elements) {
        if (e.mirrored < 0) continue;
        const int* const own = verticesOf(e);
        e.vertices = static_cast<int>(vertices.size());
        vertices.insert(vertices.end(), own, own + e.vertexCount);
        elements.push_back(e);
    }
    elements.shrink_to_fit();
    vertices.shrink_to_fit();
    m_elements = std::move(elements);
    m_vertices = std::move(vertices);
    m_rows = std::vector<Vec3>();  // gives its memory back, which {} does not
    m_flatRest = rest.positions.colwise() - rest.positions.rowwise().mean();
    m_inverseMoments =
        Mat3(m_flatRest * m_flatRest.transpose()).completeOrthogonalDecomposition().pseudoInverse();  // rank 2
}

/// How many of a patch's vertices, its own corners first, share blocks with all of it.
int PatchEnergy::columnsOf(const Element& e) const {
    if (e.mirrored >= 0) return e.vertexCount;
    return e.canYield() || e.isCurved() ? 3 : 0;
}

void PatchEnergy::collectPairs(std::vector<std::pair<int, int>>& pairs) const {
    for (const Element& e : m_elements) {
        const int* const v = verticesOf(e);
        for (int j = 0; j < columnsOf(e); ++j)
            for (int i = j + 1; i < e.vertexCount; ++i) pairs.emplace_back(v[i], v[j]);
    }
}

void PatchEnergy::bind(const BlockMatrix& matrix) {
    m_matrix = &matrix;
    m_constant.split(matrix);
    m_slots.clear();
    for (Element& e : m_elements) {
        const int* const v = verticesOf(e);
        e.slots = static_cast<int>(m_slots.size());
        for (int j = 0; j < columnsOf(e); ++j)
            for (int i = j + 1; i < e.vertexCount; ++i) m_slots.push_back(pairSlot(matrix, v[i], v[j]));
    }
}

PatchEnergy::Vectors PatchEnergy::derivatives(const Element& e, const Points& x) const {
    const int* const v = verticesOf(e);
    if (e.mirrored >= 0) {
        const Mirrored& m = m_mirrored[e.mirrored];
        Eigen::Matrix<double, 9, 1> sum = m.offset;
        for (int i = 0; i < e.vertexCount; ++i) sum += m.rows.middleCols<3>(3 * i) * x.col(v[i]);
        return Eigen::Map<const Vectors>(sum.data());
    }
    const Vec3* const rows = rowsOf(e);
    const Vec3 origin = x.col(v[0]);  // loses no digits far from the origin
    Vectors sum = Vectors::Zero();
    for (int i = 1; i < e.vertexCount; ++i) sum += (x.col(v[i]) - origin) * rows[i].transpose();
    return sum;
}

PatchEnergy::Vectors PatchEnergy::residual(const Element& e, const Points& x) const {
    Vectors result = derivatives(e, x);
    if (e.isCurved()) result -= normalOf(verticesOf(e), x).n * e.curvature.transpose();
    return result;
}

double PatchEnergy::valueOf(const Element& e, const Points& x) const {
    const Vectors r = residual(e, x);
    return 0.5 * r.cwiseProduct(r * e.plateMatrix()).sum();
}

double PatchEnergy::value(const Points& x) const {
    return valueIn(x, m_matrix->padded());
}

double PatchEnergy::valueBeside(const Points& x, std::vector<double>& memory) const {
    memory.resize(4 * x.cols());
    return valueIn(x, memory.data());
}

/// `memory`: for a vector in fours, of which the last ones are 0 and stay so.
double PatchEnergy::valueIn(const Points& x, double* memory) const {
    double sum = m_flatRest.cols() > 0 ? flatValue(x, memory) : 0.0;
    for (const Element& e : m_elements) sum += valueOf(e, x);
    return sum;
}

/// 1/2 u . K u of what is left of the positions without the affine map of the rest positions nearest to them, which
/// stores nothing: of sheets that are nearly flat no digits are lost either.
double PatchEnergy::flatValue(const Points& x, double* memory) const {
    const Vec3 first = x.col(0);
    Vec3 mean = Vec3::Zero();
    Mat3 moments = Mat3::Zero();
    for (int i = 0; i < x.cols(); ++i) {
        mean += x.col(i) - first;
        moments += (x.col(i) - first) * m_flatRest.col(i).transpose();  // the rest positions' sum is zero
    }
    mean = first + mean / static_cast<double>(x.cols());
    const Mat3 map = moments * m_inverseMoments;
    for (int i = 0; i < x.cols(); ++i) Eigen::Map<Vec3>(memory + 4 * i) = x.col(i) - mean - map * m_flatRest.col(i);
    return 0.5 * visitRows(memory, static_cast<int>(x.cols()), m_constant,
                           [](const auto& rows) { return constantProduct(rows); });
}

/// Of a mirrored patch, whose share the constant Hessian does not have.
void PatchEnergy::addElementGradient(const Element& e, const Points& x, const auto& add) const {
    const int* const v = verticesOf(e);
    const TriangleNormal normal = normalOf(v, x);
    const Vectors moments = residual(e, x) * e.plateMatrix();
    const auto& rows = m_mirrored[e.mirrored].rows;
    const Eigen::Map<const Eigen::Matrix<double, 9, 1>> flat(moments.data());
    for (int i = 0; i < e.vertexCount; ++i) add(v[i], Vec3(rows.middleCols<3>(3 * i).transpose() * flat));
    const Vec3 pull = moments * e.curvature;  // d(-b n) . moments
    for (int j = 0; j < 3; ++j) add(v[j], Vec3(normal.slopes.col(j).dot(pull) * normal.n));
}

const double* PatchEnergy::padded(const Points& x) const {
    double* const result = m_matrix->padded();
    for (int i = 0; i < x.cols(); ++i) Eigen::Map<Vec3>(result + 4 * i) = x.col(i);
    return result;
}

void PatchEnergy::addGradient(const Points& x, Points& gradient) const {
    visitRows(padded(x), static_cast<int>(x.cols()), m_constant,
              [&](const auto& rows) { addConstantGradient(rows, 0, rows.count, 1.0, gradient.data()); });
    const auto add = [&](int vertex, const Vec3& g) { gradient.col(vertex) += g; };
    for (const Element& e : m_elements) {
        if (e.mirrored >= 0)
            addElementGradient(e, x, add);
        else if (e.isCurved())
            addNormalGradient(e, normalOf(verticesOf(e), x), x, add);
    }
}

void PatchEnergy::addTo(StepSystem& system, const Points& x, HessianKind kind) const {
    const TermSink sink = system.sink();
    visitRows(padded(x), static_cast<int>(x.cols()), m_constant, [&](const auto& rows) {
        runRanges(system.team(), rows.count, kVerticesAtATime,
                  [&](int begin, int end) { addConstantGradient(rows, begin, end, sink.gradientFactor, sink.rhs); });
    });
    for (const Element& e : m_elements) {
        if (e.mirrored >= 0) addMirrored(e, system, x);
        if (e.isCurved()) addNormalTerms(e, system, x, kind);
    }
}

/// A mirrored patch's whole gradient, and its constant Hessian, which is no scalar.
void PatchEnergy::addMirrored(const Element& e, StepSystem& system, const Points& x) const {
    addElementGradient(e, x, [&](int vertex, const Vec3& g) { system.addGradient(vertex, g); });
    const Mat3* block = m_mirrored[e.mirrored].hessian.data();
    const int* slot = m_slots.data() + e.slots;
    for (int j = 0; j < e.vertexCount; ++j) {
        system.addDiagonal(verticesOf(e)[j], *block++);
        for (int i = j + 1; i < e.vertexCount; ++i) system.addPair(*slot++, *block++);
    }
}

/// The energy's term -p(x) . n(x), p = sum_i w_i x_i, w = D A B^T C b: its gradient.
void PatchEnergy::addNormalGradient(const Element& e, const TriangleNormal& normal, const Points& x,
                                    const auto& add) const {
    const int* const v = verticesOf(e);
    const Vec3 weighted = e.plateMatrix() * e.curvature;
    const Vec3 p = derivatives(e, x) * weighted;
    for (int i = 0; i < e.vertexCount; ++i) add(v[i], Vec3(-weighted.dot(rowsOf(e)[i]) * normal.n));
    for (int j = 0; j < 3; ++j) add(v[j], Vec3(normal.slopes.col(j).dot(p) * normal.n));
}

/// That gradient (a mirrored patch has it already), and its second derivatives. With s_j the slopes:
///   x_i x_j:  w_i s_j n^T;   x_j x_k:  -(s_j . p) s_k n^T - (s_k . p) n s_j^T + (n . p) (s_j . s_k) n n^T
/// Gauss-Newton keeps of the latter the last term, with its value at rest, b C b, for n . p.
void PatchEnergy::addNormalTerms(const Element& e, StepSystem& system, const Points& x, HessianKind kind) const {
    const int* const v = verticesOf(e);
    const TriangleNormal normal = normalOf(v, x);
    const Vec3& n = normal.n;
    const Vec3 weighted = e.plateMatrix() * e.curvature;
    const bool mirrored = e.mirrored >= 0, exact = kind == HessianKind::Exact;
    if (!mirrored) addNormalGradient(e, normal, x, [&](int vertex, const Vec3& g) { system.addGradient(vertex, g); });
    const Vec3 p = exact ? Vec3(derivatives(e, x) * weighted) : Vec3::Zero();
    const double stiff = exact ? n.dot(p) : e.curvature.dot(weighted);
    const auto ofCorners = [&](int j, int k) {
        const Vec3 sj = normal.slopes.col(j), sk = normal.slopes.col(k);
        Mat3 m = stiff * sj.dot(sk) * n * n.transpose();
        if (exact) m -= sj.dot(p) * sk * n.transpose() + sk.dot(p) * n * sj.transpose();
        return m;
    };
    const auto ofVertex = [&](int i, int j) -> Mat3 {  // derivative of the force on i by corner j
        const Vec3 slope = normal.slopes.col(j);
        if (!mirrored) return weighted.dot(rowsOf(e)[i]) * slope * n.transpose();
        Mat3 w = Mat3::Zero();
        for (int ab = 0; ab < 3; ++ab)
            w += weighted[ab] * m_mirrored[e.mirrored].rows.block<3, 3>(3 * ab, 3 * i).transpose();
        return w * slope * n.transpose();
    };
    const int* slot = m_slots.data() + e.slots;
    for (int j = 0; j < 3; ++j) {  // the pairs of the corners come first
        for (int i = j; i < e.vertexCount; ++i) {
            Mat3 block = ofVertex(i, j);
            if (i < 3) {
                block += ofVertex(j, i).transpose();
                block += ofCorners(i, j);
            }
            if (i == j)
                system.addDiagonal(v[j], block);
            else
                system.addPair(*slot++, block);
        }
    }
}

Vec3 PatchEnergy::bendingStrain(int triangle, const Points& x) const {
    const Element& e = elementOf(triangle);
    return derivatives(e, x).transpose() * normalOf(verticesOf(e), x).n - e.curvature;
}

PlasticFlow PatchEnergy::flow(const Points& x) {
    PlasticFlow result;
    for (Element& e : m_elements) {
        if (!e.canYield()) continue;
        const Vec3 strain = bendingStrain(e.triangle, x);
        const double size = norm(strain), limit = e.plate.yieldCurvature + e.plate.hardening * e.accumulated;
        if (!(size > limit * (1.0 + kYieldRounding))) continue;
        const double before = valueOf(e, x);
        const double slip = (size - limit) / (1.0 + e.plate.hardening);
        e.accumulated += slip;
        e.curvature += slip / size * strain;
        result.add(before - valueOf(e, x), e.triangle);
    }
    return result;
}

}  // namespace jacket
