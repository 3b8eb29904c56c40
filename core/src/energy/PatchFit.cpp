#include "energy/PatchFit.h"

#include <Eigen/Dense>

#include "jacket/TriangleMesh.h"

#include <algorithm>
#include <cmath>

namespace jacket {
namespace {

using Uv = Eigen::Matrix<double, 2, Eigen::Dynamic>;
using Monomials = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Every node of a triangle that has a vertex in `nodes`, appended.
void grow(const MirroredMesh& mesh, std::vector<int>& nodes, std::vector<char>& inside) {
    const std::size_t count = nodes.size();
    for (std::size_t k = 0; k < count; ++k)
        for (const int t : mesh.trianglesAround(nodes[k]))
            for (const int i : mesh.triangle(t)) {
                if (inside[i]) continue;
                inside[i] = 1;
                nodes.push_back(i);
            }
}

Vec3 restPosition(const MirroredMesh& mesh, const Points& rest, int node) {
    const auto [vertex, image] = mesh.node(node);
    return mesh.restImage(image)(rest.col(vertex));
}

/// The patch's rest positions in its triangle's plane, around that one's centre [m].
Uv inPlane(const MirroredMesh& mesh, const Points& rest, const Patch& patch) {
    Uv uv(2, patch.nodes.size());
    for (std::size_t k = 0; k < patch.nodes.size(); ++k) {
        const Vec3 x = restPosition(mesh, rest, patch.nodes[k]) - patch.centre;
        uv.col(k) << x.dot(patch.axisU), x.dot(patch.axisV);
    }
    return uv;
}

/// Full quadratics at each point: 1, u, v, u^2/2, v^2/2, uv.
Monomials monomialsAt(const Uv& uv) {
    Monomials result(6, uv.cols());
    for (Eigen::Index i = 0; i < uv.cols(); ++i) {
        const double u = uv(0, i), v = uv(1, i);
        result.col(i) << 1.0, u, v, 0.5 * u * u, 0.5 * v * v, u * v;
    }
    return result;
}

/// How much a point counts that lies this far from the origin, in radii of its patch.
Eigen::VectorXd nearness(const Uv& uv) {
    return (uv.colwise().norm().array() + 0.1).pow(-3.0).matrix().transpose();
}

}  // namespace

QuadraticFit fitQuadratic(const Eigen::Ref<const Uv>& uv) {
    constexpr double kSmallest = 1e-3;  // eigenvalue of the scaled normal matrix
    constexpr double kRidge = 1e-5;     // on the quadratic terms alone: affine data keep no second derivatives
    const double radius = std::sqrt(uv.colwise().squaredNorm().mean());
    const Monomials monomials = monomialsAt(uv / radius);
    const Monomials weighted = monomials * (nearness(uv / radius).cwiseAbs2().asDiagonal());
    Eigen::Matrix<double, 6, 6> normal = weighted * monomials.transpose();
    const Eigen::Matrix<double, 6, 1> scale = normal.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::Matrix<double, 6, 6> scaled = scale.asDiagonal() * normal * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(scaled, Eigen::EigenvaluesOnly);
    const bool determined = eigen.eigenvalues()[0] > kSmallest;
    if (!determined)
        for (int k = 3; k < 6; ++k) normal(k, k) += kRidge * std::max(normal(k, k), normal(0, 0));
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> factor(normal);
    return {factor.solve(weighted).bottomRows<3>() / (radius * radius), determined};
}

namespace {

std::vector<Patch> fittedPatches(const MirroredMesh& mesh, int triangleCount, const Points& rest) {
    constexpr std::size_t kFewest = 9;  // nodes
    std::vector<Patch> patches(triangleCount);
    std::vector<char> inside(mesh.nodeCount(), 0);
    for (int t = 0; t < triangleCount; ++t) {
        Patch& patch = patches[t];
        const auto& corners = mesh.triangle(t);
        const Vec3 a = rest.col(corners[0]), b = rest.col(corners[1]), c = rest.col(corners[2]);
        patch.centre = (a + b + c) / 3.0;
        patch.area = triangleArea(a, b, c);
        patch.normal = (b - a).cross(c - a).normalized();
        patch.axisU = (b - a).normalized();
        patch.axisV = patch.normal.cross(patch.axisU);
        patch.nodes.assign(corners.begin(), corners.end());
        if (mesh.isLeftOut(t)) {
            patch.derivatives.setZero(3, 3);
            continue;
        }
        for (const int i : patch.nodes) inside[i] = 1;
        for (bool enough = false, growing = true; growing && !enough;) {
            const std::size_t before = patch.nodes.size();
            grow(mesh, patch.nodes, inside);
            growing = patch.nodes.size() > before;
            if (growing && patch.nodes.size() < kFewest) continue;
            const QuadraticFit fit = fitQuadratic(inPlane(mesh, rest, patch));
            patch.derivatives = fit.derivatives;
            enough = fit.determined;
        }
        for (const int i : patch.nodes) inside[i] = 0;
    }
    return patches;
}

/// Takes the second derivatives (uu, vv, uv) of a triangle's frame to those of a vertex's, or to those that the
/// vertex's image has in its own mirror.
Mat3 changeOfFrame(const Mat2& g) {
    Mat3 m;
    m << g(0, 0) * g(0, 0), g(0, 1) * g(0, 1), 2.0 * g(0, 0) * g(0, 1),  //
        g(1, 0) * g(1, 0), g(1, 1) * g(1, 1), 2.0 * g(1, 0) * g(1, 1),   //
        g(0, 0) * g(1, 0), g(0, 1) * g(1, 1), g(0, 0) * g(1, 1) + g(0, 1) * g(1, 0);
    return m;
}

struct Frame {
    Vec3 u, v, normal;
};

/// Axes of `to` against those of `from` after turning `from` the shortest way onto the other's plane.
Mat2 transport(const Frame& from, const Frame& to) {
    const Mat3 turn = Eigen::Quaterniond::FromTwoVectors(from.normal, to.normal).toRotationMatrix();
    const Vec3 u = turn * from.u, v = turn * from.v;
    Mat2 g;
    g << to.u.dot(u), to.u.dot(v), to.v.dot(u), to.v.dot(v);
    return g;
}

std::vector<Frame> vertexFrames(const MirroredMesh& mesh, const std::vector<Patch>& patches, int vertexCount) {
    std::vector<Frame> frames(vertexCount, {Vec3::Zero(), Vec3::Zero(), Vec3::Zero()});
    for (const auto& patch : patches)
        for (int a = 0; a < 3; ++a) frames[mesh.node(patch.nodes[a]).vertex].normal += patch.area * patch.normal;
    for (auto& [u, v, normal] : frames) {
        normal.normalize();
        u = normal.unitOrthogonal();
        v = normal.cross(u);
    }
    return frames;
}

/// The linear problem of balancePatches: changes of the weights that keep every quadratic's second derivatives, from a
/// multiplier per vertex (three numbers, as second derivatives).
class Balance {
  public:
    Balance(const MirroredMesh& mesh, const Points& rest, const std::vector<char>& balanced,
            const std::vector<Patch>& patches)
        : m_mesh(mesh),
          m_rest(rest),
          m_patches(patches),
          m_balanced(balanced),
          m_frames(vertexFrames(mesh, patches, static_cast<int>(rest.cols()))) {}

    /// Per vertex the sum of area times weight over all patches: what a balanced vertex must not have.
    Points unbalance() const {
        Points sum = Points::Zero(3, m_balanced.size());
        for (const Patch& patch : m_patches)
            for (std::size_t k = 0; k < patch.nodes.size(); ++k)
                add(patch, k, changeOfFrame(turnOf(patch, k)), patch.derivatives.col(k), sum);
        return sum;
    }
    /// Needed by what follows only: of regular meshes nothing is kept.
    void prepare() {
        std::size_t nodes = 0;
        for (const Patch& patch : m_patches) nodes += patch.nodes.size();
        m_places.resize(2, nodes);
        m_weights.resize(nodes);
        m_turns.reserve(nodes);
        m_inverses.reserve(m_patches.size());
        m_first.reserve(m_patches.size());
        for (const Patch& patch : m_patches) {
            const std::size_t first = m_turns.size(), count = patch.nodes.size();
            m_first.push_back(first);
            m_places.middleCols(first, count) = inPlane(m_mesh, m_rest, patch) / std::sqrt(patch.area);
            m_weights.segment(first, count) = nearness(0.75 * m_places.middleCols(first, count));
            const Monomials monomials = monomialsAt(m_places.middleCols(first, count));
            m_inverses.push_back((monomials * m_weights.segment(first, count).asDiagonal() * monomials.transpose())
                                     .completeOrthogonalDecomposition()
                                     .pseudoInverse());
            for (std::size_t k = 0; k < count; ++k) m_turns.push_back(turnOf(patch, k));
        }
    }
    /// What the change for `multipliers` adds to unbalance().
    Points apply(const Points& multipliers) const {
        Points sum = Points::Zero(3, m_balanced.size());
        for (std::size_t t = 0; t < m_patches.size(); ++t) {
            const SecondDerivatives rows = change(t, multipliers);
            for (std::size_t k = 0; k < m_patches[t].nodes.size(); ++k)
                add(m_patches[t], k, changeOfFrame(m_turns[m_first[t] + k]), rows.col(k), sum);
        }
        return sum;
    }
    SecondDerivatives change(std::size_t t, const Points& multipliers) const {
        const Patch& patch = m_patches[t];
        const std::size_t first = m_first[t], count = patch.nodes.size();
        const auto weights = m_weights.segment(first, count).asDiagonal();
        const Monomials monomials = monomialsAt(m_places.middleCols(first, count));
        SecondDerivatives wanted(3, count);
        for (std::size_t k = 0; k < count; ++k)
            wanted.col(k) =
                patch.area * (changeOfFrame(m_turns[first + k]).transpose() * multipliers.col(vertexOf(patch, k)));
        wanted = wanted * weights;
        const Eigen::Matrix<double, 3, 6> moments = wanted * monomials.transpose();
        return wanted - moments * m_inverses[t] * monomials * weights;
    }

  private:
    int vertexOf(const Patch& patch, std::size_t k) const { return m_mesh.node(patch.nodes[k]).vertex; }
    /// From the triangle's axes to those of its k-th node.
    Mat2 turnOf(const Patch& patch, std::size_t k) const {
        const auto [vertex, image] = m_mesh.node(patch.nodes[k]);
        const Mat3& mirror = m_mesh.restImage(image).linear;  // its own inverse, or a turn by 180 degrees
        const Frame& own = m_frames[vertex];
        const Vec3 normal = mirror * own.normal;
        const Frame seen{mirror * own.u, mirror * own.v, normal.dot(patch.normal) < 0.0 ? Vec3(-normal) : normal};
        return transport({patch.axisU, patch.axisV, patch.normal}, seen);
    }
    void add(const Patch& patch, std::size_t k, const Mat3& toVertex, const Vec3& row, Points& sum) const {
        const int v = vertexOf(patch, k);
        if (m_balanced[v]) sum.col(v) += patch.area * (toVertex * row);
    }

    const MirroredMesh& m_mesh;
    const Points& m_rest;
    const std::vector<Patch>& m_patches;
    const std::vector<char>& m_balanced;
    std::vector<Frame> m_frames;  ///< of the vertices
    // By patch, or by their nodes one behind the other:
    std::vector<std::size_t> m_first;
    std::vector<Eigen::Matrix<double, 6, 6>> m_inverses;  ///< of the moments of the weights
    Uv m_places;                                          ///< in the triangle's plane, in roots of its area
    Eigen::VectorXd m_weights;
    std::vector<Mat2> m_turns;
};

/// Vertices that no patch at a free edge reaches.
std::vector<char> innerVertices(const HalfEdgeMesh& mesh, const MirroredMesh& mirrored) {
    std::vector<char> outer(mesh.vertexCount(), 0);
    for (const auto& edge : mesh.edges())
        if (edge.isBorder() && !(mirrored.isOnPlane(edge.v0) && mirrored.isOnPlane(edge.v1)))
            outer[edge.v0] = outer[edge.v1] = 1;
    for (int ring = 0; ring < 2; ++ring) {
        std::vector<char> wider = outer;
        for (const auto& edge : mesh.edges())
            if (outer[edge.v0] || outer[edge.v1]) wider[edge.v0] = wider[edge.v1] = 1;
        outer = std::move(wider);
    }
    std::vector<char> inner(mesh.vertexCount());
    for (int i = 0; i < mesh.vertexCount(); ++i) inner[i] = !outer[i] && !mirrored.isOnPlane(i);
    return inner;
}

/// Conjugate gradients to a tenth of the unbalance: what is left of the error is then below the mesh's own.
void balancePatches(const MirroredMesh& mesh, const Points& rest, const std::vector<char>& inner,
                    std::vector<Patch>& patches) {
    constexpr int kMostIterations = 60;
    constexpr double kLeft = 0.1, kNegligible = 1e-6;  // of the unbalance; of a patch's own weight
    Balance balance(mesh, rest, inner, patches);
    Points multipliers = Points::Zero(3, rest.cols());
    Points residual = -balance.unbalance(), direction = residual;
    const double first = residual.squaredNorm();
    double now = first, gross = 0.0;
    for (const auto& patch : patches) gross += patch.area * patch.area * patch.derivatives.squaredNorm();
    if (!(first > kNegligible * gross)) return;  // a regular mesh
    balance.prepare();
    for (int i = 0; i < kMostIterations && now > kLeft * kLeft * first; ++i) {
        const Points product = balance.apply(direction);
        const double along = now / direction.cwiseProduct(product).sum();
        multipliers += along * direction;
        residual -= along * product;
        const double next = residual.squaredNorm();
        direction = residual + next / now * direction;
        now = next;
    }
    for (std::size_t t = 0; t < patches.size(); ++t) patches[t].derivatives += balance.change(t, multipliers);
}

}  // namespace

std::vector<Patch> makePatches(const HalfEdgeMesh& mesh, const MirroredMesh& mirrored, const Points& rest) {
    std::vector<Patch> patches = fittedPatches(mirrored, mesh.triangleCount(), rest);
    balancePatches(mirrored, rest, innerVertices(mesh, mirrored), patches);
    return patches;
}

}  // namespace jacket
