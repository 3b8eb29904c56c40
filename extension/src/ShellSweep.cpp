#include <algorithm>
#include <limits>

#include "BoxTree.h"
#include "ShellContacts.h"

namespace jacket::bullet {
namespace {

constexpr int kMostAdvances = 60;  // of one triangle towards one piece; then the contact is taken where it is
constexpr double kTouching = 0.3;  // of the contact thickness: closer than this they touch
constexpr double kAtVertex = 0.9;  // weight of a corner beyond which a triangle's contact is that corner's
constexpr double kShallow = 0.5;   // of the body: what goes in less than that is found at the end of the step

}  // namespace

/// One shell and one piece of a body through a step.
struct ShellContacts::Sweep {
    const ShellBody& shell;
    const Points &start, &end;
    const Obstacle& obstacle;
    const ConvexPiece& piece;
    Vec6 twist;
    double time;

    Bounds boundsOfBody() const {
        const Vec3 radius = Vec3::Constant(obstacle.body.radius + shell.contactThickness());
        const Vec3 first = moved(obstacle.start, twist, 0.0).translation(),
                   last = moved(obstacle.start, twist, time).translation();
        return {first.cwiseMin(last) - radius, first.cwiseMax(last) + radius};
    }
    Bounds boundsOfTriangle(const std::array<int, 3>& corners) const {
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
    std::optional<Contact> advance(const std::array<int, 3>& corners) const;
};

/// Conservative advancement (Mirtich 1996): as far in time as the distance allows at the largest closing speed, again
/// and again, until they touch or the step is over.
std::optional<Contact> ShellContacts::Sweep::advance(const std::array<int, 3>& corners) const {
    const double thickness = shell.contactThickness(), spin = twist.tail<3>().norm() * obstacle.body.radius;
    double t = 0.0;
    for (int i = 0;; ++i) {
        const Frame frame = moved(obstacle.start, twist, t);
        const Frame toBody = frame.inverse(Eigen::Isometry);
        const Mat3 triangle = triangleAt(corners, t);
        Mat3 local;
        for (int a = 0; a < 3; ++a) local.col(a) = toBody * Vec3(triangle.col(a));
        const auto touch = piece.touch(local, std::numeric_limits<double>::max());
        if (!touch) return std::nullopt;
        if (i == 0 && touch->surface.distance < 0.0) return std::nullopt;  // there from the start: not of this motion
        const Vec3 normal = frame.linear() * touch->surface.normal;
        double closing = 0.0;
        for (int a = 0; a < 3; ++a)
            closing =
                std::max(closing, -normal.dot(relativeVelocity(corners[a], frame.translation(), triangle.col(a))));
        const double left = touch->surface.distance - kTouching * thickness;
        if (left <= 1e-3 * thickness || i == kMostAdvances) {
            Contact contact;
            contact.vertices = corners;
            contact.weights = touch->weights;
            contact.normal = normal;
            contact.point = frame * touch->surface.point;
            contact.time = t;
            Vec3 relative = Vec3::Zero();
            for (int a = 0; a < 3; ++a)
                relative += touch->weights[a] * relativeVelocity(corners[a], frame.translation(), triangle.col(a));
            const double depth = -(time - t) * normal.dot(relative);  // at the end of the step
            if (depth < kShallow * obstacle.body.inner) return std::nullopt;
            contact.gap = -t * normal.dot(relative) + touch->surface.distance - thickness;
            return contact;
        }
        if (closing + spin <= 0.0) return std::nullopt;
        t += std::max(left, 1e-2 * thickness) / (closing + spin);
        if (t >= time) return std::nullopt;
    }
}

void ShellContacts::sweep(const ContactSweep& motion, std::vector<Contact>& contacts) {
    const auto first = static_cast<std::ptrdiff_t>(contacts.size());
    for (const auto& [shell, body] : m_pairs) {
        if (!motion.fast[body]) continue;
        const Obstacle& obstacle = m_obstacles[body];
        const HalfEdgeMesh& mesh = m_shells[shell]->shell().mesh();
        const int edgeCount = static_cast<int>(mesh.edges().size());
        m_byFeature.clear();
        for (const auto& piece : obstacle.shape->pieces) {
            const Sweep sweep{*m_shells[shell], *motion.start[shell], *motion.end[shell], obstacle,
                              *piece,           motion.twists[body],  motion.time};
            const Bounds bounds = sweep.boundsOfBody();
            for (int t = 0; t < mesh.triangleCount(); ++t) {
                const auto column = mesh.triangles().col(t);
                const std::array<int, 3> corners{column[0], column[1], column[2]};
                if (!sweep.boundsOfTriangle(corners).overlaps(bounds)) continue;
                auto contact = sweep.advance(corners);
                if (!contact) continue;
                contact->shell = shell;
                contact->body = body;
                contact->feature = Feature::triangle(t, mesh.vertexCount(), edgeCount);
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
            }
        }
    }
    std::for_each(contacts.begin() + first, contacts.end(), [&](Contact& contact) { setMaterial(contact); });
}

}  // namespace jacket::bullet
