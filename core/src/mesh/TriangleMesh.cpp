#include "jacket/TriangleMesh.h"

#include <Eigen/Geometry>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <unordered_map>

#include "mesh/EdgeTable.h"

namespace jacket {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kFlatness = 1e-9;    // a triangle lower than this share of the mesh's size has no usable area [-]
constexpr double kSliverAngle = 5.0;  // below this the linear solver slows down noticeably [degree]

std::string text(double value) {
    std::array<char, 32> digits;
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value, std::chars_format::general, 6);
    return {digits.data(), end.ptr};
}

std::string text(int value) {
    return std::to_string(value);
}

template <typename Number>
void require(bool holds, const char* field, const char* rule, Number value) {
    if (!holds) throw std::invalid_argument(std::string(field) + " must be " + rule + ", got " + text(value));
}

void requirePositive(double value, const char* field) {
    require(std::isfinite(value) && value > 0.0, field, "> 0 and finite", value);
}

/// Collects triangles column by column.
class TriangleCollector {
  public:
    void add(int a, int b, int c) { m_indices.insert(m_indices.end(), {a, b, c}); }
    Indices<3> take() const {
        return Eigen::Map<const Indices<3>>(m_indices.data(), 3, static_cast<Eigen::Index>(m_indices.size() / 3));
    }

  private:
    std::vector<int> m_indices;
};

Points gather(const std::vector<Vec3>& points) {
    Points result(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i) result.col(static_cast<Eigen::Index>(i)) = points[i];
    return result;
}

/// The cell a-b-c-d (counter-clockwise from its lower left corner), cut along a-c or along b-d.
void addCell(TriangleCollector& triangles, int a, int b, int c, int d, bool cutAlongAc) {
    if (cutAlongAc) {
        triangles.add(a, b, c);
        triangles.add(a, c, d);
    } else {
        triangles.add(a, b, d);
        triangles.add(b, c, d);
    }
}

/// Fills the strip between two rows of vertices, always with the shorter of the two possible edges. The upper row lies
/// to the left of the lower one, so that triangles are counter-clockwise. A closed row repeats its first vertex at the
/// end.
void stitch(TriangleCollector& triangles, const std::vector<Vec3>& x, const std::vector<int>& lower,
            const std::vector<int>& upper) {
    std::size_t i = 0, j = 0;
    while (i + 1 < lower.size() || j + 1 < upper.size()) {
        bool advanceLower = j + 1 == upper.size();
        if (!advanceLower && i + 1 < lower.size()) {
            const double overLower = (x[lower[i + 1]] - x[upper[j]]).squaredNorm();
            const double overUpper = (x[lower[i]] - x[upper[j + 1]]).squaredNorm();
            advanceLower = overLower <= overUpper;
        }
        if (advanceLower) {
            triangles.add(lower[i], lower[i + 1], upper[j]);
            ++i;
        } else {
            triangles.add(lower[i], upper[j + 1], upper[j]);
            ++j;
        }
    }
}

}  // namespace

double triangleArea(const Vec3& a, const Vec3& b, const Vec3& c) {
    return 0.5 * (b - a).cross(c - a).norm();
}

TriangleMesh makeGrid(const GridOptions& options) {
    requirePositive(options.size[0], "GridOptions.size[0] [m]");
    requirePositive(options.size[1], "GridOptions.size[1] [m]");
    const int nx = options.cells[0], ny = options.cells[1];
    require(nx >= 1, "GridOptions.cells[0]", ">= 1", nx);
    require(ny >= 1, "GridOptions.cells[1]", ">= 1", ny);
    const bool equilateral = options.diagonals == GridDiagonals::Equilateral;
    require((nx + 2.0) * (ny + 1.0) * 6.0 < 2147483647.0, "GridOptions.cells", "fewer than 350 million in all", nx);

    std::vector<Vec3> points;
    std::vector<int> rowStart;
    const auto add = [&](double s, int j) {  // s: cells along the first axis
        const double a = options.size[0] * (s / nx - 0.5);
        const double b = options.size[1] * (static_cast<double>(j) / ny - 0.5);
        switch (options.plane) {
            case GridPlane::XZ:
                points.emplace_back(a, 0.0, b);
                break;
            case GridPlane::XY:
                points.emplace_back(a, b, 0.0);
                break;
            case GridPlane::YZ:
                points.emplace_back(0.0, a, b);
                break;
        }
    };
    for (int j = 0; j <= ny; ++j) {
        rowStart.push_back(static_cast<int>(points.size()));
        if (equilateral && j % 2 == 1) {
            add(0.0, j);
            for (int i = 0; i < nx; ++i) add(i + 0.5, j);
            add(nx, j);
        } else {
            for (int i = 0; i <= nx; ++i) add(i, j);
        }
    }
    rowStart.push_back(static_cast<int>(points.size()));

    TriangleCollector triangles;
    for (int j = 0; j < ny; ++j) {
        const int low = rowStart[j], high = rowStart[j + 1];
        if (!equilateral) {
            for (int i = 0; i < nx; ++i) {
                const bool cutAlongAc = options.diagonals == GridDiagonals::Right || (i + j) % 2 == 0;
                addCell(triangles, low + i, low + i + 1, high + i + 1, high + i, cutAlongAc);
            }
        } else if (j % 2 == 0) {  // the upper row is the shifted one: it starts and ends with half a triangle
            for (int i = 0; i <= nx; ++i) {
                triangles.add(low + i, high + i + 1, high + i);
                if (i < nx) triangles.add(low + i, low + i + 1, high + i + 1);
            }
        } else {
            for (int i = 0; i <= nx; ++i) {
                triangles.add(low + i, low + i + 1, high + i);
                if (i < nx) triangles.add(low + i + 1, high + i + 1, high + i);
            }
        }
    }
    TriangleMesh mesh{gather(points), triangles.take()};
    if (options.plane == GridPlane::XZ) mesh.triangles.row(1).swap(mesh.triangles.row(2));  // x cross z is -y
    return mesh;
}

TriangleMesh makeHemisphere(double radius, int rings) {
    requirePositive(radius, "makeHemisphere: radius [m]");
    require(rings >= 1 && rings <= 10000, "makeHemisphere: rings", "1..10000", rings);
    std::vector<Vec3> points{{0.0, radius, 0.0}};
    std::vector<int> inner{0};
    TriangleCollector triangles;
    for (int k = 1; k <= rings; ++k) {
        const double share = static_cast<double>(k) / rings, angle = 0.5 * kPi * share;  // from the pole
        // Edges along the ring as long as those between rings (4 rings sin(angle)), up to a tenth shorter at the rim.
        const double ideal = 4.0 * rings * std::sin(angle) * (1.0 + 0.1 * std::pow(share, 4));
        const int count = std::max(static_cast<int>(std::lround(ideal)), k == 1 ? 6 : 3);
        const double y = k == rings ? 0.0 : std::cos(angle);
        std::vector<int> outer;
        for (int i = 0; i < count; ++i) {
            const double turn = 2.0 * kPi * i / count;
            outer.push_back(static_cast<int>(points.size()));
            points.push_back(radius * Vec3(std::sin(angle) * std::sin(turn), y, std::sin(angle) * std::cos(turn)));
        }
        outer.push_back(outer.front());
        stitch(triangles, points, outer, inner);
        inner = outer;
    }
    return {gather(points), triangles.take()};
}

TriangleMesh makeCylinder(double radius, double height, int around, int along) {
    requirePositive(radius, "makeCylinder: radius [m]");
    requirePositive(height, "makeCylinder: height [m]");
    require(around >= 3, "makeCylinder: around", ">= 3", around);
    require(along >= 1, "makeCylinder: along", ">= 1", along);
    std::vector<Vec3> points;
    TriangleCollector triangles;
    for (int j = 0; j <= along; ++j)
        for (int i = 0; i < around; ++i) {
            const double turn = 2.0 * kPi * i / around, y = height * (static_cast<double>(j) / along - 0.5);
            points.emplace_back(radius * std::sin(turn), y, radius * std::cos(turn));
            if (j == along) continue;
            const int next = (i + 1) % around, low = j * around, high = low + around;
            addCell(triangles, low + i, low + next, high + next, high + i, true);
        }
    return {gather(points), triangles.take()};
}

namespace {

/// Disjoint sets with path halving; the root of a set is its lowest member.
class DisjointSets {
  public:
    explicit DisjointSets(int count) : m_parent(count) { std::iota(m_parent.begin(), m_parent.end(), 0); }
    int root(int i) {
        while (m_parent[i] != i) i = m_parent[i] = m_parent[m_parent[i]];
        return i;
    }
    void join(int i, int j) {
        i = root(i), j = root(j);
        m_parent[std::max(i, j)] = std::min(i, j);
    }

  private:
    std::vector<int> m_parent;
};

Eigen::AlignedBox3d boundsOf(const Points& positions) {  // of the finite vertices; a point if there are none
    Eigen::AlignedBox3d box;
    for (int v = 0; v < positions.cols(); ++v)
        if (positions.col(v).allFinite()) box.extend(Vec3(positions.col(v)));
    return box.isEmpty() ? Eigen::AlignedBox3d(Vec3::Zero().eval()) : box;
}

double smallestAngle(const Vec3& a, const Vec3& b, const Vec3& c) {  // [degree]
    const auto angle = [](const Vec3& u, const Vec3& v) { return std::atan2(u.cross(v).norm(), u.dot(v)); };
    return std::min({angle(b - a, c - a), angle(c - b, a - b), angle(a - c, b - c)}) * 180.0 / kPi;
}

bool indicesAreUsable(const TriangleMesh& mesh, int t) {
    const Eigen::Vector3i v = mesh.triangles.col(t);
    return v.minCoeff() >= 0 && v.maxCoeff() < mesh.positions.cols() && v[0] != v[1] && v[1] != v[2] && v[2] != v[0];
}

/// One pass over a mesh; each check skips the triangles that an earlier one has found unusable.
class MeshChecker {
  public:
    explicit MeshChecker(const TriangleMesh& mesh)
        : m_mesh(mesh),
          m_vertexCount(static_cast<int>(mesh.positions.cols())),
          m_triangleCount(static_cast<int>(mesh.triangles.cols())),
          m_usable(m_triangleCount, 1) {}

    std::vector<MeshProblem> run() {
        if (m_vertexCount == 0 || m_triangleCount == 0) {
            add(Element::Mesh, -1, true,
                "the mesh has " + text(m_vertexCount) + " vertices and " + text(m_triangleCount) +
                    " triangles; it must have at least one triangle");
            return std::move(m_problems);
        }
        checkCoordinates();
        checkIndices();
        checkDuplicates();
        checkShapes();
        checkEdgesAndComponents();
        checkUnusedVertices();
        return std::move(m_problems);
    }

  private:
    using Element = MeshProblem::Element;

    void add(Element element, int index, bool fatal, std::string what) {
        m_problems.push_back({element, index, fatal, std::move(what)});
    }

    std::string name(int t) const {
        const auto v = m_mesh.triangles.col(t);
        return "triangle " + text(t) + " (" + text(v[0]) + " " + text(v[1]) + " " + text(v[2]) + ")";
    }

    void checkCoordinates() {
        for (int v = 0; v < m_vertexCount; ++v)
            for (int k = 0; k < 3; ++k)
                if (const double value = m_mesh.positions(k, v); !std::isfinite(value))
                    add(Element::Vertex, v, true,
                        "vertex " + text(v) + ": coordinate " + "xyz"[k] + " is " + text(value) + "; must be finite");
    }

    void checkIndices() {
        for (int t = 0; t < m_triangleCount; ++t) {
            if (indicesAreUsable(m_mesh, t)) continue;
            m_usable[t] = 0;
            for (int k = 0; k < 3; ++k) {
                const int v = m_mesh.triangles(k, t);
                if (v < 0 || v >= m_vertexCount)
                    add(Element::Triangle, t, true,
                        name(t) + ": names vertex " + text(v) + "; indices must lie in 0.." + text(m_vertexCount - 1));
                else if (v == m_mesh.triangles((k + 1) % 3, t))
                    add(Element::Triangle, t, true,
                        name(t) + ": repeats vertex " + text(v) + "; the three must differ");
            }
        }
    }

    void checkDuplicates() {
        std::vector<std::array<int, 4>> sorted;  // vertices ascending, then the triangle
        sorted.reserve(m_triangleCount);
        for (int t = 0; t < m_triangleCount; ++t) {
            if (!m_usable[t]) continue;
            std::array<int, 3> v{m_mesh.triangles(0, t), m_mesh.triangles(1, t), m_mesh.triangles(2, t)};
            std::sort(v.begin(), v.end());
            sorted.push_back({v[0], v[1], v[2], t});
        }
        std::sort(sorted.begin(), sorted.end());
        std::vector<std::array<int, 2>> found;  // the later triangle, the first one
        for (std::size_t i = 1, first = 0; i < sorted.size(); ++i) {
            if (!std::equal(sorted[i].begin(), sorted[i].begin() + 3, sorted[first].begin())) first = i;
            if (first != i) found.push_back({sorted[i][3], sorted[first][3]});
        }
        std::sort(found.begin(), found.end());
        for (const auto& [t, first] : found) {
            m_usable[t] = 0;
            add(Element::Triangle, t, true,
                name(t) + ": has the same vertices as triangle " + text(first) + "; each triangle must occur once");
        }
    }

    void checkShapes() {
        const double size = boundsOf(m_mesh.positions).diagonal().norm();
        for (int t = 0; t < m_triangleCount; ++t) {
            if (!m_usable[t]) continue;
            const Vec3 a = m_mesh.positions.col(m_mesh.triangles(0, t)),
                       b = m_mesh.positions.col(m_mesh.triangles(1, t)),
                       c = m_mesh.positions.col(m_mesh.triangles(2, t));
            if (!a.allFinite() || !b.allFinite() || !c.allFinite()) continue;
            const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
            const double area = triangleArea(a, b, c), least = 0.5 * longest * kFlatness * size;
            if (!(area > least)) {
                add(Element::Triangle, t, true,
                    name(t) + ": area " + text(area) + " m^2; must be > " + text(least) + " m^2, i.e. higher than " +
                        text(kFlatness) + " of the mesh's size");
            } else if (const double angle = smallestAngle(a, b, c); angle < kSliverAngle) {
                add(Element::Triangle, t, false,
                    name(t) + ": smallest angle " + text(angle) + " degrees; below " + text(kSliverAngle) +
                        " the solver converges slowly");
            }
        }
    }

    /// Edges; and on the way the fans of each vertex and the parts of the mesh, joined over shared edges and vertices.
    void checkEdgesAndComponents() {
        const auto& triangles = m_mesh.triangles;
        DisjointSets corners(3 * m_triangleCount), parts(m_vertexCount);
        const auto cornerAt = [&](int h, int vertex) {  // of the triangle of half-edge h
            for (int k = 3 * (h / 3);; ++k)
                if (triangles(k % 3, k / 3) == vertex) return k;
        };
        const EdgeTable table(triangles, m_vertexCount, [this](int t) { return m_usable[t] != 0; });
        table.forEachEdge([&](auto first, auto last) {
            const int g = *first, v0 = table.from(g), v1 = table.to(g);
            parts.join(v0, v1);
            for (auto h = first + 1; h != last; ++h)
                for (const int v : {v0, v1}) corners.join(cornerAt(g, v), cornerAt(*h, v));
            const std::string edge = "edge " + text(v0) + "-" + text(v1);
            if (last - first > 2) {
                std::string list;
                for (auto h = first; h != last; ++h) list += (h == first ? "" : ", ") + text(*h / 3);
                add(Element::Edge, v0, true,
                    edge + ": shared by " + text(static_cast<int>(last - first)) + " triangles (" + list +
                        "); at most two may share an edge");
            } else if (last - first == 2 && table.from(first[1]) == v0) {
                add(Element::Edge, v0, true,
                    edge + ": triangles " + text(g / 3) + " and " + text(first[1] / 3) +
                        " both run along it in this direction; neighbours must be oriented alike");
            }
        });

        std::vector<int> fans(m_vertexCount, 0);
        for (int c = 0; c < 3 * m_triangleCount; ++c)
            if (m_usable[c / 3] && corners.root(c) == c) ++fans[triangles(c % 3, c / 3)];
        int components = 0;
        for (int v = 0; v < m_vertexCount; ++v) {
            if (fans[v] > 1)
                add(Element::Vertex, v, false,
                    "vertex " + text(v) + ": joins " + text(fans[v]) +
                        " parts of the surface that share no edge there; they will turn freely about it");
            if (fans[v] > 0 && parts.root(v) == v) ++components;
        }
        if (components > 1)
            add(Element::Mesh, -1, false,
                "the mesh has " + text(components) + " parts that are not connected; each will move on its own");
    }

    void checkUnusedVertices() {
        std::vector<char> used(m_vertexCount, 0);
        for (int t = 0; t < m_triangleCount; ++t)
            for (const int v : m_mesh.triangles.col(t))
                if (v >= 0 && v < m_vertexCount) used[v] = 1;
        for (int v = 0; v < m_vertexCount; ++v)
            if (!used[v])
                add(Element::Vertex, v, true,
                    "vertex " + text(v) + ": belongs to no triangle and would have no mass; every vertex must be used");
    }

    const TriangleMesh& m_mesh;
    int m_vertexCount, m_triangleCount;
    std::vector<char> m_usable;
    std::vector<MeshProblem> m_problems;
};

}  // namespace

std::vector<MeshProblem> checkMesh(const TriangleMesh& mesh) {
    return MeshChecker(mesh).run();
}

void requireUsable(const TriangleMesh& mesh) {
    const MeshProblem* first = nullptr;
    int others = 0;
    const std::vector<MeshProblem> problems = checkMesh(mesh);
    for (const MeshProblem& problem : problems) {
        if (!problem.fatal) continue;
        if (first)
            ++others;
        else
            first = &problem;
    }
    if (!first) return;
    throw std::invalid_argument(first->what + (others > 0 ? " (and " + text(others) + " more)" : ""));
}

TriangleMesh weldSeams(const TriangleMesh& mesh, double tolerance, std::vector<int>* map) {
    require(tolerance >= 0.0 && tolerance < 1.0, "weldSeams: tolerance", ">= 0 and < 1", tolerance);
    const int vertexCount = static_cast<int>(mesh.positions.cols());
    const int triangleCount = static_cast<int>(mesh.triangles.cols());
    const auto isUsable = [&](int t) { return indicesAreUsable(mesh, t); };

    std::vector<char> onBorder(vertexCount, 0);
    const EdgeTable table(mesh.triangles, vertexCount, isUsable);
    table.forEachEdge([&](auto first, auto last) {
        if (last - first == 1) onBorder[table.from(*first)] = onBorder[table.to(*first)] = 1;
    });
    std::vector<std::vector<int>> trianglesOf(vertexCount);  // of border vertices
    for (int t = 0; t < triangleCount; ++t)
        if (isUsable(t))
            for (const int v : mesh.triangles.col(t))
                if (onBorder[v]) trianglesOf[v].push_back(t);

    // Each border vertex takes the place of the first earlier one within reach. Only those that stay are entered into
    // the grid, so nothing moves by more than the tolerance.
    const Eigen::AlignedBox3d bounds = boundsOf(mesh.positions);
    const Vec3 origin = bounds.min();
    const double size = bounds.diagonal().norm(), reach = tolerance * size, cell = std::max(reach, 1e-12 * size);
    std::vector<int> target(vertexCount);
    std::iota(target.begin(), target.end(), 0);
    std::unordered_map<std::uint64_t, std::vector<int>> grid;
    const auto key = [](const Eigen::Matrix<std::int64_t, 3, 1>& c) {
        std::uint64_t hash = 0;
        for (int k = 0; k < 3; ++k)
            hash = (hash ^ static_cast<std::uint64_t>(c[k])) * 0x9e3779b97f4a7c15ULL, hash ^= hash >> 29;
        return hash;
    };
    const auto sharesTriangle = [&](int v, int with) {
        for (const int t : trianglesOf[v])
            for (const int w : mesh.triangles.col(t))
                if (w != v && target[w] == with) return true;
        return false;
    };
    const auto earlierOne = [&](int v, const Eigen::Matrix<std::int64_t, 3, 1>& at) {
        for (int i = 0; i < 27; ++i) {
            const auto found =
                grid.find(key(at + Eigen::Matrix<std::int64_t, 3, 1>(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)));
            if (found == grid.end()) continue;
            for (const int w : found->second)
                if ((mesh.positions.col(w) - mesh.positions.col(v)).norm() <= reach && !sharesTriangle(v, w)) return w;
        }
        return -1;
    };
    for (int v = 0; v < vertexCount; ++v) {
        if (!onBorder[v] || !mesh.positions.col(v).allFinite() || cell == 0.0) continue;
        const Eigen::Matrix<std::int64_t, 3, 1> at =
            ((mesh.positions.col(v) - origin) / cell).array().floor().cast<std::int64_t>();
        if (const int w = earlierOne(v, at); w >= 0)
            target[v] = w;
        else
            grid[key(at)].push_back(v);
    }

    std::vector<int> newIndex(vertexCount);
    int kept = 0;
    for (int v = 0; v < vertexCount; ++v) newIndex[v] = target[v] == v ? kept++ : newIndex[target[v]];
    TriangleMesh welded{Points(3, kept), mesh.triangles};
    for (int v = 0; v < vertexCount; ++v)
        if (target[v] == v) welded.positions.col(newIndex[v]) = mesh.positions.col(v);
    for (int t = 0; t < triangleCount; ++t)
        for (int& v : welded.triangles.col(t))
            if (v >= 0 && v < vertexCount) v = newIndex[v];
    if (map) *map = std::move(newIndex);
    return welded;
}

}  // namespace jacket
