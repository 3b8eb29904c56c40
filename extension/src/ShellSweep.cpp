#include <algorithm>
#include <limits>

#include "BoxTree.h"
#include "ShellContacts.h"

namespace jacket::bullet {
namespace {

constexpr int kMostAdvances = 60;   // of one triangle towards one piece; then the contact is taken where it is
constexpr double kTouching = 0.3;   // of the contact thickness: closer than this they touch
constexpr double kAtVertex = 0.9;   // weight of a corner beyond which a triangle's contact is that corner's
constexpr double kShallow = 0.5;    // of the body: see Sweep::shallow
constexpr double kSameTime = 0.02;  // of the step: a triangle that is hit so little before its corners needs no contact

const std::array<ShellEdge, 3> kAllEdges{ShellEdge::kBorder, ShellEdge::kBorder, ShellEdge::kBorder};

Mat3 transformed(const Frame& frame, const Mat3& triangle) {
    return (frame.linear() * triangle).colwise() + frame.translation();
}

}  // namespace

/// What is swept against, in the body's frame.
class SweepTarget {
  public:
    virtual ~SweepTarget() = default;
    /// Where a triangle is nearest to it, a point if `isPoint`: all corners are the same then.
    virtual std::optional<TrianglePoint> touch(const Mat3& triangle, bool isPoint) const = 0;
    /// Whether the whole of it lies behind the plane through its nearest point.
    virtual bool isConvex() const = 0;
};

namespace {

class ConvexTarget final : public SweepTarget {
  public:
    explicit ConvexTarget(const ConvexPiece& piece) : m_piece(piece) {}
    std::optional<TrianglePoint> touch(const Mat3& triangle, bool isPoint) const override {
        constexpr double kAnyReach = std::numeric_limits<double>::max();
        if (!isPoint) return m_piece.touch(triangle, kAnyReach);
        const auto surface = m_piece.touch(Vec3(triangle.col(0)), kAnyReach);
        return surface ? std::optional(TrianglePoint{*surface, Vec3::UnitX()}) : std::nullopt;
    }
    bool isConvex() const override { return true; }

  private:
    const ConvexPiece& m_piece;
};

/// The triangles of a concave piece; what is deeper than `depth` behind them is not touched.
class ConcaveTarget final : public SweepTarget {
  public:
    ConcaveTarget(const TrianglePatch& patch, const Frame& frame, double depth)
        : m_patch(patch), m_frame(frame), m_depth(depth) {}
    std::optional<TrianglePoint> touch(const Mat3& triangle, bool isPoint) const override {
        const Mat3 local = transformed(m_frame.inverse(Eigen::Isometry), triangle);
        const Bounds& box = m_patch.box();
        const double reach = (box.upper - box.lower).norm() + (local.col(0) - box.lower).norm();  // to any of it
        TrianglePoint nearest{{{}, {}, reach}, {}};
        for (int a = 0; a < (isPoint ? 1 : 3); ++a)
            if (const auto corner = m_patch.touchNearest(local.col(a), nearest.surface.distance, m_depth))
                if (corner->distance < nearest.surface.distance) nearest = {*corner, Vec3::Unit(a)};
        m_touched.clear();
        if (!isPoint) m_patch.touch(local, kAllEdges, std::max(0.0, nearest.surface.distance), m_depth, m_touched);
        for (const TrianglePoint& inside : m_touched)
            if (inside.surface.distance < nearest.surface.distance) nearest = inside;
        if (nearest.surface.distance == reach) return std::nullopt;
        nearest.surface = placed(m_frame, nearest.surface);
        return nearest;
    }
    bool isConvex() const override { return false; }

  private:
    const TrianglePatch& m_patch;
    Frame m_frame;
    double m_depth;
    mutable std::vector<TrianglePoint> m_touched;
};

}  // namespace

/// One shell and one piece of a body through a step.
struct ShellContacts::Sweep {
    const ShellBody& shell;
    const Points &start, &end;
    const Obstacle& obstacle;
    const Frame& bodyStart;
    Vec6 twist;
    double time;

    Bounds boundsOfBody() const {
        const Vec3 radius = Vec3::Constant(obstacle.body.radius + shell.contactThickness());
        const Vec3 first = moved(bodyStart, twist, 0.0).translation(),
                   last = moved(bodyStart, twist, time).translation();
        return {first.cwiseMin(last) - radius, first.cwiseMax(last) + radius};
    }
    /// Of one of its pieces. Between its poses at both ends of the step a turning point is off the straight way by no
    /// more than |w|^2 r t^2 / 8.
    Bounds boundsOfSwept(const ConvexPiece& piece) const {
        const double turn = twist.tail<3>().norm() * time, aside = 0.125 * turn * turn * obstacle.body.radius;
        const Vec3 room = Vec3::Constant(aside + shell.contactThickness());
        Bounds bounds = ShellContacts::boundsOfPiece(piece, moved(bodyStart, twist, 0.0));
        bounds.include(ShellContacts::boundsOfPiece(piece, moved(bodyStart, twist, time)));
        const Bounds whole = boundsOfBody();
        return {whole.lower.cwiseMax(bounds.lower - room), whole.upper.cwiseMin(bounds.upper + room)};
    }
    Bounds boundsOf(const std::array<int, 3>& corners) const {
        Bounds bounds{start.col(corners[0]), start.col(corners[0])};
        for (const int i : corners)
            for (const Vec3& p : {Vec3(start.col(i)), Vec3(end.col(i))}) bounds.include({p, p});
        return bounds;
    }
    Mat3 triangleAt(const std::array<int, 3>& corners, double t) const {
        Mat3 triangle;
        for (int a = 0; a < 3; ++a)
            triangle.col(a) = start.col(corners[a]) + (t / time) * (end.col(corners[a]) - start.col(corners[a]));
        return triangle;
    }
    /// Velocity of a triangle's corner relative to the body there [m/s].
    Vec3 relativeVelocity(int vertex, const Vec3& centre, const Vec3& at) const {
        return (end.col(vertex) - start.col(vertex)) / time - twist.head<3>() - twist.tail<3>().cross(at - centre);
    }
    double closingSpeed(const std::array<int, 3>& corners, const Vec3& centre, const Mat3& triangle) const;
    double timeAbove(const SurfacePoint& plane, const std::array<int, 3>& corners, const Vec3& centre,
                     const Mat3& triangle, double least) const;
    std::optional<Contact> advance(const SweepTarget& target, const std::array<int, 3>& corners) const;
    struct Touch {
        Contact contact;
        double approach;  ///< [m/s]
    };
    Touch touchAt(double t, const TrianglePoint& touch, const std::array<int, 3>& corners) const;
    /// What goes in by less than this is found at the end of the step [m].
    double shallow() const { return kShallow * obstacle.body.inner; }
};

/// How fast any of the corners may come nearer to the target, but for the body's spin [m/s].
double ShellContacts::Sweep::closingSpeed(const std::array<int, 3>& corners, const Vec3& centre,
                                          const Mat3& triangle) const {
    double closing = 0.0;
    for (int a = 0; a < 3; ++a)
        closing = std::max(closing, relativeVelocity(corners[a], centre, triangle.col(a)).norm());
    return closing;
}

/// For how long all corners are higher than `least` over a plane that goes with the body, in front of which they are
/// now: no point of a convex body comes to the triangle before. As a body turns, a corner's velocity relative to it
/// changes by no more than 2 |w| |u| + |w|^2 |y|, where u is its velocity and y its place as seen from the centre.
double ShellContacts::Sweep::timeAbove(const SurfacePoint& plane, const std::array<int, 3>& corners, const Vec3& centre,
                                       const Mat3& triangle, double least) const {
    const double spin = twist.tail<3>().norm(), little = 1e-2 * shell.contactThickness();
    double soonest = std::numeric_limits<double>::infinity();
    for (int a = 0; a < 3; ++a) {
        const Vec3 at = triangle.col(a), from = at - centre;
        const double height = std::max(plane.normal.dot(at - plane.point) - least, little);
        const double rate = plane.normal.dot(relativeVelocity(corners[a], centre, at));
        const double speed = ((end.col(corners[a]) - start.col(corners[a])) / time - twist.head<3>()).norm();
        const double bend = spin * (2.0 * speed + spin * (from.norm() + speed * time));
        soonest = std::min(soonest, 2.0 * height / (std::sqrt(rate * rate + 2.0 * bend * height) - rate));
    }
    return soonest;
}

/// Conservative advancement (Mirtich 1996): as far in time as the plane between the two stays between them, or the
/// distance allows at the largest closing speed, again and again, until they touch or the step is over. For a vertex
/// all corners are the same. What touches without closing in by much goes on until it is deep: a triangle that tilts
/// may yet let pass what its middle keeps up with.
std::optional<Contact> ShellContacts::Sweep::advance(const SweepTarget& target,
                                                     const std::array<int, 3>& corners) const {
    const double thickness = shell.contactThickness(), spin = twist.tail<3>().norm() * obstacle.body.radius;
    const bool isPoint = corners[0] == corners[1];
    double t = 0.0, sought = kTouching * thickness;
    int most = kMostAdvances;
    for (int i = 0;; ++i) {
        const Frame frame = moved(bodyStart, twist, t);
        const Mat3 triangle = triangleAt(corners, t);
        const auto touch = target.touch(transformed(frame.inverse(Eigen::Isometry), triangle), isPoint);
        if (!touch) return std::nullopt;
        if (i == 0 && touch->surface.distance < 0.0) return std::nullopt;  // there from the start: not of this motion
        double left = touch->surface.distance - sought;
        if (left <= 1e-3 * thickness || i >= most) {
            const Touch found = touchAt(t, *touch, corners);
            if (found.approach * (time - t) >= shallow() || sought < 0.0) return found.contact;
            sought = -shallow();
            most += kMostAdvances;
            left = touch->surface.distance - sought;
        }
        if (target.isConvex())
            t += timeAbove(placed(frame, touch->surface), corners, frame.translation(), triangle, sought);
        else
            t += std::max(left, 1e-2 * thickness) / (closingSpeed(corners, frame.translation(), triangle) + spin);
        if (t >= time) return std::nullopt;
    }
}

/// A contact at a time, as if the motion had come to it straight.
ShellContacts::Sweep::Touch ShellContacts::Sweep::touchAt(double t, const TrianglePoint& touch,
                                                          const std::array<int, 3>& corners) const {
    const Frame frame = moved(bodyStart, twist, t);
    const Mat3 triangle = triangleAt(corners, t);
    Contact contact;
    contact.vertices = corners;
    contact.weights = touch.weights;
    contact.normal = frame.linear() * touch.surface.normal;
    contact.point = frame * touch.surface.point;
    contact.time = t;
    Vec3 relative = Vec3::Zero();
    for (int a = 0; a < 3; ++a)
        relative += touch.weights[a] * relativeVelocity(corners[a], frame.translation(), triangle.col(a));
    const double approach = -contact.normal.dot(relative);
    contact.gap = t * approach + touch.surface.distance - shell.contactThickness();
    return {contact, approach};
}

/// All vertices are swept against what stands or is led: a sheet that lies flat on it at the end of the step is held by
/// each. A free body is stopped by what it hits first, and its other contacts come about later.
void ShellContacts::sweepPiece(const Sweep& sweep, const SweepTarget& target, const Bounds& bounds,
                               std::vector<Contact>& contacts) {
    const HalfEdgeMesh& mesh = sweep.shell.shell().mesh();
    const bool isLed = sweep.obstacle.body.prescribed;
    const auto isSaidByCorner = [&](const Contact& contact, const std::array<int, 3>& corners) {
        return std::any_of(corners.begin(), corners.end(), [&](int corner) {
            const auto known = m_byFeature.find(Feature::vertex(corner));
            return known != m_byFeature.end() && contacts[known->second].time <= contact.time + kSameTime * sweep.time;
        });
    };
    const auto offer = [&](const std::array<int, 3>& corners, int feature) {
        if (!sweep.boundsOf(corners).overlaps(bounds)) return;
        auto contact = sweep.advance(target, corners);
        if (!contact || (isLed && isSaidByCorner(*contact, corners))) return;
        contact->feature = feature;
        int corner = 0;
        if (contact->weights.maxCoeff(&corner) > kAtVertex) {
            contact->feature = Feature::vertex(corners[corner]);
            contact->vertices.fill(corners[corner]);
            contact->weights = Vec3::UnitX();
        }
        const auto [known, fresh] = m_byFeature.try_emplace(contact->feature, contacts.size());
        if (fresh)
            contacts.push_back(*contact);
        else if (contact->time < contacts[known->second].time)
            contacts[known->second] = *contact;
    };
    for (int i = 0; isLed && i < mesh.vertexCount(); ++i) offer({i, i, i}, Feature::vertex(i));
    const int edgeCount = static_cast<int>(mesh.edges().size());
    for (int t = 0; t < mesh.triangleCount(); ++t) {
        const auto column = mesh.triangles().col(t);
        offer({column[0], column[1], column[2]}, Feature::triangle(t, mesh.vertexCount(), edgeCount));
    }
}

/// All triangles of a concave piece, read from Bullet's shape once a step.
const TrianglePatch& ShellContacts::wholeOf(const ConcavePiece& piece, double radius) {
    const auto known = m_whole.find(&piece);
    if (known != m_whole.end()) return known->second;
    const Vec3 centre = piece.frame.inverse(Eigen::Isometry).translation();
    return m_whole.try_emplace(&piece, *piece.shape, Bounds{centre.array() - radius, centre.array() + radius})
        .first->second;
}

/// What is swept against: of a body that stands, the triangles where the shell goes.
const TrianglePatch& ShellContacts::patchOf(int pair, std::size_t concave, const Sweep& sweep) {
    const ConcavePiece& piece = sweep.obstacle.shape->concave[concave];
    if (!sweep.twist.isZero(0.0)) return wholeOf(piece, sweep.obstacle.body.radius);
    const Frame toPiece = piece.frame.inverse(Eigen::Isometry) * sweep.bodyStart.inverse(Eigen::Isometry);
    const Points start = toPiece * sweep.start, end = toPiece * sweep.end;
    const double margin = sweep.shell.shell().meanEdge() + sweep.shell.contactThickness();
    const Bounds near{start.rowwise().minCoeff().cwiseMin(end.rowwise().minCoeff()).array() - margin,
                      start.rowwise().maxCoeff().cwiseMax(end.rowwise().maxCoeff()).array() + margin};
    cover(m_patches[pair][concave], piece, near, margin);
    return *m_patches[pair][concave];
}

void ShellContacts::sweep(const ContactSweep& motion, std::vector<Contact>& contacts) {
    for (int pair = 0; pair < int(m_pairs.size()); ++pair) {
        const auto [shell, body] = m_pairs[pair];
        if (!motion.bodies[body]) continue;
        const Obstacle& obstacle = m_obstacles[body];
        const Sweep sweep{*m_shells[shell], *motion.start[shell], *motion.end[shell], obstacle,
                          m_start[body],    motion.twists[body],  motion.time};
        const auto first = static_cast<std::ptrdiff_t>(contacts.size());
        m_byFeature.clear();
        for (const auto& piece : obstacle.shape->pieces)
            sweepPiece(sweep, ConvexTarget(*piece), sweep.boundsOfSwept(*piece), contacts);
        for (std::size_t k = 0; k < obstacle.shape->concave.size(); ++k)
            sweepPiece(sweep,
                       ConcaveTarget(patchOf(pair, k, sweep), obstacle.shape->concave[k].frame, obstacle.body.inner),
                       sweep.boundsOfBody(), contacts);
        std::for_each(contacts.begin() + first, contacts.end(), [&, shell = shell, body = body](Contact& contact) {
            contact.shell = shell;
            contact.body = body;
            setMaterial(contact);
        });
    }
}

}  // namespace jacket::bullet
