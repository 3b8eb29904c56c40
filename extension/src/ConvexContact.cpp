#include "ConvexContact.h"

#include <ccd/ccd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "ClosedForms.h"
#include "Polytope.h"

namespace jacket::bullet {
namespace {

constexpr int kMprSupports = 500;      // MPR has loops without a limit of their own; NaN ends them
constexpr int kSeparationSteps = 100;  // closest points of separated solids
constexpr int kExpansionSteps = 80;    // of the polytope inside the Minkowski difference
constexpr double kLeast = 0.005;       // an overlap may be this part deeper than the least one
constexpr double kCertificate = 1e-6;  // largest error of an answer that is returned [in units of the solid]

/// The solid and the corners of a triangle (or three times a point) in units of the solid, its centre the origin.
struct Pair {
    const SupportMap& map;
    Vec3 centre;       // [m]
    double scale;      // [m]
    double tolerance;  // [-]
    Mat3 corners;
    bool isPoint;

    Vec3 support(const Vec3& n) const { return (map.support(n) - centre) / scale; }
    int lowest(const Vec3& n) const {
        int corner = 0;
        if (!isPoint) (n.transpose() * corners).minCoeff(&corner);
        return corner;
    }
    /// Separation along the unit vector n, out of the solid; negative: moving by that much along n separates.
    double gap(const Vec3& n) const { return n.dot(corners.col(lowest(n)) - support(n)); }
};

/// How the two touch along `normal`: by `gap` (see Pair) and at these weights of the corners.
struct Answer {
    Vec3 normal;
    double gap;
    Vec3 weights;
};

/// A point of the Minkowski difference triangle - solid, and which corner it came from.
struct Difference {
    Vec3 w;
    int corner;
};

Difference differenceAlong(const Pair& pair, const Vec3& n) {
    const int corner = pair.lowest(n);
    return {pair.corners.col(corner) - pair.support(n), corner};
}

Answer answerAlong(const Pair& pair, const Vec3& n) {
    return {n, pair.gap(n), Vec3::Unit(pair.lowest(n))};
}

// --------------------------------------------------------------------------------------------------------- libccd

struct MprQuery {
    const Pair& pair;
    Vec3 inTriangle;
    Vec3 inSolid;
    mutable int supports = 0;
};

void put(const Vec3& v, ccd_vec3_t* out) {
    ccdVec3Set(out, v.x(), v.y(), v.z());
}

Vec3 get(const ccd_vec3_t& v) {
    return {v.v[0], v.v[1], v.v[2]};
}

const MprQuery& queryOf(const void* object) {
    return *static_cast<const MprQuery*>(object);
}

void supportOfSolid(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* out) {
    const MprQuery& query = queryOf(object);
    const Vec3 d = get(*direction);
    const double length = d.norm();
    if (++query.supports > kMprSupports || !(length > 0) || !std::isfinite(length))
        return put(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()), out);
    put(query.pair.support(d / length), out);
}

void supportOfTriangle(const void* object, const ccd_vec3_t* direction, ccd_vec3_t* out) {
    const Pair& pair = queryOf(object).pair;
    put(pair.corners.col(pair.lowest(-get(*direction))), out);
}

void centreOfSolid(const void* object, ccd_vec3_t* out) {
    put(queryOf(object).inSolid, out);
}

void centreOfTriangle(const void* object, ccd_vec3_t* out) {
    put(queryOf(object).inTriangle, out);
}

/// Normal of an overlap as libccd sees it (unit, finite), or nothing when it sees none.
std::optional<Vec3> mprNormal(const Pair& pair) {
    const Vec3 inTriangle =
        pair.isPoint ? Vec3(pair.corners.col(0)) : closestOnTriangle(Vec3::Zero(), pair.corners).point;
    MprQuery query{pair, inTriangle, Vec3::Zero()};
    if (inTriangle.norm() < 1e-6) query.inSolid = 1e-6 * Vec3(0.6, 0.48, 0.64);  // equal centres tell MPR no direction
    ccd_t ccd;
    CCD_INIT(&ccd);
    ccd.support1 = supportOfSolid;
    ccd.support2 = supportOfTriangle;
    ccd.center1 = centreOfSolid;
    ccd.center2 = centreOfTriangle;
    ccd.max_iterations = 200;
    ccd.mpr_tolerance = std::max(1e-9, pair.tolerance);
    ccd_real_t depth = 0;
    ccd_vec3_t direction, position;
    if (ccdMPRPenetration(&query, &query, &ccd, &depth, &direction, &position) != 0) return std::nullopt;
    const Vec3 n = get(direction);
    if (std::isfinite(n.squaredNorm()) && n.norm() > 0.5) return n.normalized();
    const double distance = inTriangle.norm();
    return distance > 0 ? Vec3(inTriangle / distance) : Vec3(Vec3::UnitY());
}

// ------------------------------------------------------------------------------------------------------- separated

/// Up to four points of the difference and how the nearest point of their hull to the origin is made of them.
struct Simplex {
    std::array<Difference, 4> points;
    Vec4 weights = Vec4::Zero();
    int size = 0;
    Vec3 nearest = Vec3::Zero();

    void keep(const std::array<int, 3>& which, const Vec3& w, const Vec3& point) {
        const std::array<Difference, 4> old = points;
        size = 0;
        for (int i = 0; i < 3; ++i) {
            if (w[i] == 0) continue;
            points[size] = old[which[i]];
            weights[size++] = w[i];
        }
        nearest = point;
    }
};

void reduceTriangle(Simplex& s) {
    const int third = s.size == 3 ? 2 : 0;  // a segment is a triangle with two equal corners
    Mat3 corners;
    corners << s.points[0].w, s.points[1].w, s.points[third].w;
    const Barycentric b = closestOnTriangle(Vec3::Zero(), corners);
    Vec3 w = b.weights;
    if (third == 0) w = {w[0] + w[2], w[1], 0};
    s.keep({0, 1, third}, w, b.point);
}

/// False if the tetrahedron contains the origin.
bool reduceTetrahedron(Simplex& s) {
    constexpr std::array<std::array<int, 4>, 4> kFaces = {{{0, 1, 2, 3}, {0, 2, 3, 1}, {0, 3, 1, 2}, {1, 3, 2, 0}}};
    double least = std::numeric_limits<double>::infinity();
    std::array<int, 3> face{};
    Barycentric best;
    for (const auto& f : kFaces) {
        const Vec3 a = s.points[f[0]].w;
        const Vec3 n = (s.points[f[1]].w - a).cross(s.points[f[2]].w - a);
        const double inside = n.dot(s.points[f[3]].w - a), origin = -n.dot(a);
        if (inside * origin > 0 && std::abs(inside) > 1e-12 * n.norm()) continue;
        Mat3 corners;
        corners << a, s.points[f[1]].w, s.points[f[2]].w;
        const Barycentric b = closestOnTriangle(Vec3::Zero(), corners);
        if (const double d2 = b.point.squaredNorm(); d2 < least) {
            least = d2;
            best = b;
            face = {f[0], f[1], f[2]};
        }
    }
    if (!std::isfinite(least)) return false;
    s.keep(face, best.weights, best.point);
    return true;
}

enum class Apart { kTooFar, kSeparated, kTouching };

/// Closest points by the method of Gilbert, Johnson and Keerthi (1988). `answer` holds the last direction in any case.
Apart separate(const Pair& pair, double reach, const Vec3& first, Answer& answer) {
    Simplex s;
    s.points[0] = differenceAlong(pair, first);
    s.weights[0] = 1;
    s.size = 1;
    s.nearest = s.points[0].w;
    answer = answerAlong(pair, first);
    const double touching = 10 * pair.tolerance;
    Apart result = Apart::kSeparated;
    for (int step = 0; step < kSeparationSteps; ++step) {
        const double distance = s.nearest.norm();
        if (!(distance > touching)) return Apart::kTouching;
        const Vec3 n = s.nearest / distance;
        const Difference next = differenceAlong(pair, n);
        const double bound = n.dot(next.w);
        if (bound > reach) return Apart::kTooFar;
        answer.normal = n;
        answer.gap = bound;
        if (distance - bound <= pair.tolerance * std::max(1.0, distance)) break;
        const auto known = [&](const Difference& d) { return d.w == next.w; };
        if (std::any_of(s.points.begin(), s.points.begin() + s.size, known)) break;
        const Simplex before = s;
        s.points[s.size++] = next;
        if (s.size < 4)
            reduceTriangle(s);
        else if (!reduceTetrahedron(s))
            return Apart::kTouching;
        if (!(s.nearest.norm() < distance)) {
            s = before;
            break;
        }
    }
    answer.weights.setZero();
    for (int i = 0; i < s.size; ++i) answer.weights[s.points[i].corner] += s.weights[i];
    return result;
}

// ----------------------------------------------------------------------------------------------------- overlapping

/// The polytope inside solid - triangle that grows where it is nearest to the origin (van den Bergen 2001).
class Expansion {
  public:
    Expansion(const Pair& pair, const Vec3& seed) : m_pair(pair), m_best(answerAlong(pair, seed)) {}

    /// Least translation; the seed's own where the polytope cannot be built or gives nothing better.
    Answer run() {
        if (!start()) return m_best;
        for (int step = 0; step < kExpansionSteps; ++step) {
            const Polytope::Face face = nearestFace();
            if (!std::isfinite(face.offset)) break;
            const double depth = -m_best.gap;
            if (m_isPolished && depth - face.offset <= kLeast * depth) break;  // no other way out is much shorter
            const double growth = grow(face);
            if (growth <= m_pair.tolerance) break;
            if (growth < m_polishBelow * depth) polish(face);
        }
        if (m_isFace) m_best.weights = weightsAlong(m_best.normal);
        return m_best;
    }

  private:
    const Pair& m_pair;
    Answer m_best;
    std::array<int, 4 + kExpansionSteps> m_corners{};
    bool m_isFace = false;       // the best normal is that of a face,
    bool m_isPolished = false;   // or of a smooth part
    double m_polishBelow = 0.1;  // next when the polytope's last growth was this part of the depth; three attempts
    static Polytope& polytope() {
        thread_local Polytope scratch;
        return scratch;
    }

    Difference outermost(const Vec3& n) const {
        const Difference d = differenceAlong(m_pair, n);
        return {-d.w, d.corner};
    }

    /// Four points far apart: along the seed, against it, and across.
    bool start() {
        std::array<Difference, 4> p;
        const Vec3 seed = m_best.normal;
        p[0] = outermost(seed);
        p[1] = outermost(-seed);
        const Vec3 line = p[1].w - p[0].w;
        const Vec3 across = anyPerpendicular(line);
        p[2] = farther(across, [&](const Difference& d) { return line.cross(d.w - p[0].w).norm(); });
        const Vec3 plane = line.cross(p[2].w - p[0].w);
        if (!(plane.norm() > 0)) return false;
        for (const double side : {-1.0, 1.0}) offer(side * plane.normalized());  // the way out where all is flat
        p[3] = farther(plane.normalized(), [&](const Difference& d) { return std::abs(plane.dot(d.w - p[0].w)); });
        for (int i = 0; i < 4; ++i) m_corners[i] = p[i].corner;
        return polytope().start({p[0].w, p[1].w, p[2].w, p[3].w});
    }

    void offer(const Vec3& n) {
        if (const Answer a = answerAlong(m_pair, n); a.gap > m_best.gap) m_best = a;
    }

    template <class Measure>
    Difference farther(const Vec3& n, const Measure& measure) const {
        const Difference a = outermost(n), b = outermost(-n);
        return measure(a) >= measure(b) ? a : b;
    }

    Polytope::Face nearestFace() const {
        const auto& faces = polytope().faces();
        const auto byOffset = [](const auto& a, const auto& b) { return a.offset < b.offset; };
        return *std::min_element(faces.begin(), faces.end(), byOffset);
    }

    /// Tries the face's normal and pushes the face out to the solid; returns by how much.
    double grow(const Polytope::Face& face) {
        const Difference d = outermost(face.normal);
        const double depth = face.normal.dot(d.w);
        if (depth <= -m_best.gap + (m_isPolished ? 0 : m_pair.tolerance)) {
            m_best = {face.normal, -depth, Vec3::Unit(d.corner)};
            m_isFace = true;
            m_isPolished = false;
        }
        const int index = int(polytope().points().size());
        if (depth - face.offset <= m_pair.tolerance) return 0;
        if (!polytope().add(d.w, 1e-3 * m_pair.tolerance)) return 0;
        m_corners[index] = d.corner;
        return depth - face.offset;
    }

    /// A round solid would take tens of steps to the last digits: near the end Newton's method takes two or three.
    void polish(const Polytope::Face& face) {
        m_polishBelow = m_polishBelow > 2e-3 ? 0.1 * m_polishBelow : 0;
        const auto found = polishedFrom(face.normal, m_corners[face.corners[0]], otherCorner(face));
        if (!found || found->gap < m_best.gap - m_pair.tolerance) return;
        m_best = *found;
        m_isFace = false;
        m_isPolished = true;
    }

    /// A second corner of the triangle that the face knows; the first again where it knows one only.
    int otherCorner(const Polytope::Face& face) const {
        const int a = m_corners[face.corners[0]], b = m_corners[face.corners[1]];
        return a != b ? b : m_corners[face.corners[2]];
    }

    /// The stationary depth near n where an edge (or a corner, b = a) of the triangle touches a smooth part.
    std::optional<Answer> polishedFrom(Vec3 n, int a, int b) const {
        const Vec3 edge = m_pair.corners.col(b) - m_pair.corners.col(a);
        const bool isEdge = a != b && edge.norm() > 1e-9;
        if (isEdge) n = (n - n.dot(edge) / edge.squaredNorm() * edge).normalized();
        if (!n.allFinite()) return std::nullopt;
        const auto offsetAlong = [&](const Vec3& d) { return Vec3(m_pair.support(d) - m_pair.corners.col(a)); };
        for (int step = 0; step < 8; ++step) {
            const Vec3 w = offsetAlong(n), u = isEdge ? Vec3(edge.cross(n).normalized()) : anyPerpendicular(n);
            const Vec3 v = n.cross(u);
            const double depth = n.dot(w);
            const Vec2 slope(u.dot(w), isEdge ? 0 : v.dot(w));
            if (slope.norm() <= 10 * m_pair.tolerance) return stationary(n, a, isEdge ? b : a);
            const double turn = 1e-4;
            const Vec3 du = (offsetAlong((n + turn * u).normalized()) - w) / turn;
            const Vec3 dv = isEdge ? v : Vec3((offsetAlong((n + turn * v).normalized()) - w) / turn);
            const double shear = isEdge ? 0 : (u.dot(dv) + v.dot(du)) / 2;
            Mat2 hessian;
            hessian << u.dot(du) - depth, shear, shear, isEdge ? 1 : v.dot(dv) - depth;
            const double determinant = hessian.determinant();
            if (!(hessian.trace() > 0) || !(determinant > 0)) return std::nullopt;
            const Vec2 move(-(hessian(1, 1) * slope[0] - shear * slope[1]) / determinant,
                            -(hessian(0, 0) * slope[1] - shear * slope[0]) / determinant);
            if (!(move.norm() < 0.5)) return std::nullopt;
            n = (n + move[0] * u + move[1] * v).normalized();
        }
        return std::nullopt;
    }

    std::optional<Answer> stationary(const Vec3& n, int a, int b) const {
        Answer answer = answerAlong(m_pair, n);
        const Vec3 end = m_pair.corners.col(a), edge = m_pair.corners.col(b) - end;
        const Vec3 support = m_pair.support(n);
        if (std::abs(n.dot(end - support) - answer.gap) > m_pair.tolerance)
            return std::nullopt;  // another corner is deeper
        const double t = a != b ? (support + answer.gap * n - end).dot(edge) / edge.squaredNorm() : 0;
        if (t < 0 || t > 1) return std::nullopt;
        answer.weights = (1 - t) * Vec3::Unit(a) + t * Vec3::Unit(b);
        return answer;
    }

    /// Weights of the triangle's corners at the end of the least translation: the faces about there may be coplanar,
    /// one of them holds it.
    Vec3 weightsAlong(const Vec3& n) const {
        double least = std::numeric_limits<double>::infinity();
        Vec3 result = m_best.weights;
        for (const Polytope::Face& face : polytope().faces()) {
            if (face.normal.dot(n) < 0.999) continue;
            Mat3 corners;
            for (int i = 0; i < 3; ++i) corners.col(i) = polytope().points()[face.corners[i]];
            const Barycentric b = closestOnTriangle(-m_best.gap * n, corners);
            const double distance = (b.point + m_best.gap * n).squaredNorm();
            if (distance >= least) continue;
            least = distance;
            result.setZero();
            for (int i = 0; i < 3; ++i) result[m_corners[face.corners[i]]] += b.weights[i];
        }
        return result;
    }
};

// ---------------------------------------------------------------------------------------------------------- checks

bool isCertified(const Pair& pair, const Answer& a) {
    const double size = std::max({1.0, std::abs(a.gap), 10 * pair.tolerance / kCertificate});
    return a.normal.allFinite() && a.weights.allFinite() && std::abs(a.normal.norm() - 1) < 1e-9 &&
           std::abs(pair.gap(a.normal) - a.gap) < kCertificate * size &&
           std::abs(a.normal.dot(pair.corners * a.weights) - pair.support(a.normal).dot(a.normal) - a.gap) <
               kCertificate * size;
}

/// The best of a few directions; any direction is a way out.
Answer bestOfFew(const Pair& pair, const Vec3& seed) {
    Answer best = answerAlong(pair, seed);
    const Vec3 across = triangleNormal(pair.corners);
    for (const Vec3& n : {across, Vec3(Vec3::UnitX()), Vec3(Vec3::UnitY()), Vec3(Vec3::UnitZ())})
        for (const double side : {-1.0, 1.0})
            if (const Answer a = answerAlong(pair, side * n); a.gap > best.gap) best = a;
    return best;
}

std::optional<Answer> solve(const Pair& pair, double reach) {
    Answer answer;
    Vec3 seed;
    if (const auto normal = mprNormal(pair)) {
        seed = *normal;
        answer = Expansion(pair, seed).run();
    } else {
        const Vec3 toward =
            pair.isPoint ? Vec3(pair.corners.col(0)) : closestOnTriangle(Vec3::Zero(), pair.corners).point;
        seed = toward.norm() > 0 ? Vec3(toward.normalized()) : triangleNormal(pair.corners);
        const Apart apart = separate(pair, reach, seed, answer);
        if (apart == Apart::kTooFar) return std::nullopt;
        seed = answer.normal;
        if (apart == Apart::kTouching) answer = Expansion(pair, seed).run();
    }
    if (isCertified(pair, answer)) return answer;
    return bestOfFew(pair, answer.normal.allFinite() && answer.normal.norm() > 0.5 ? answer.normal.normalized() : seed);
}

}  // namespace

CcdContact::CcdContact(const SupportMap& map) : m_map(map), m_centre(Vec3::Zero()) {
    for (int axis = 0; axis < 3; ++axis) {
        m_lower[axis] = map.support(-Vec3::Unit(axis))[axis];
        m_upper[axis] = map.support(Vec3::Unit(axis))[axis];
    }
    for (int i = 0; i < 14; ++i) {  // towards the faces and the corners of a cube: their mean is inside
        const Vec3 direction = i < 6 ? Vec3((i % 2 ? 1 : -1) * Vec3::Unit(i / 2))
                                     : Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, (i - 6) & 4 ? 1 : -1).normalized();
        m_centre += map.support(direction) / 14;
    }
    const Vec3 extents = m_upper - m_lower;
    m_scale = std::max(extents.minCoeff(), 1e-3 * extents.maxCoeff()) / 2;
    if (!(m_scale > 0)) m_scale = 1;
    const double size = std::max(m_lower.cwiseAbs().maxCoeff(), m_upper.cwiseAbs().maxCoeff());
    m_tolerance = std::max(1e-9, 10 * map.accuracy() * size / m_scale);
}

std::optional<TrianglePoint> CcdContact::touch(const Mat3& triangle, double reach) const {
    if (((triangle.rowwise().minCoeff() - m_upper).array() > reach).any()) return std::nullopt;
    if (((m_lower - triangle.rowwise().maxCoeff()).array() > reach).any()) return std::nullopt;
    const Mat3 corners = (triangle.colwise() - m_centre) / m_scale;
    const auto answer = solve({m_map, m_centre, m_scale, m_tolerance, corners, false}, reach / m_scale);
    if (!answer) return std::nullopt;
    const double distance = answer->gap * m_scale;
    if (distance > reach) return std::nullopt;
    return TrianglePoint{{triangle * answer->weights - distance * answer->normal, answer->normal, distance},
                         answer->weights};
}

std::optional<SurfacePoint> CcdContact::touch(const Vec3& p, double reach) const {
    if (((p - m_upper).array() > reach).any() || ((m_lower - p).array() > reach).any()) return std::nullopt;
    const Mat3 corners = ((p - m_centre) / m_scale).replicate(1, 3);
    const auto answer = solve({m_map, m_centre, m_scale, m_tolerance, corners, true}, reach / m_scale);
    if (!answer) return std::nullopt;
    const double distance = answer->gap * m_scale;
    if (distance > reach) return std::nullopt;
    return SurfacePoint{p - distance * answer->normal, answer->normal, distance};
}

}  // namespace jacket::bullet
