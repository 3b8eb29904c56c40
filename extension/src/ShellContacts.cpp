#include "ShellContacts.h"

#include <array>
#include <limits>

namespace jacket::bullet {
namespace {

/// Bounds of a piece, in the world.
void worldBounds(const ConvexPiece& piece, const Frame& frame, Vec3& lower, Vec3& upper) {
    const Vec3 centre = 0.5 * (piece.lower() + piece.upper()), half = 0.5 * (piece.upper() - piece.lower());
    if (!half.allFinite() || !centre.allFinite() || half.maxCoeff() > 1e15) {  // a plane
        lower.setConstant(-std::numeric_limits<double>::infinity());
        upper.setConstant(std::numeric_limits<double>::infinity());
        return;
    }
    const Vec3 reach = frame.linear().cwiseAbs() * half;
    lower = frame * centre - reach;
    upper = frame * centre + reach;
}

}  // namespace

/// One shell against one obstacle at one pose.
struct ShellContacts::Query {
    int shell, body;
    const ShellBody& shellBody;
    const Points& x;
    Frame frame;  ///< of the obstacle
    double vertexReach, faceReach, friction;
    std::vector<Contact>& contacts;
    double thickness() const { return shellBody.contactThickness(); }
};

ShellContacts::ShellContacts(std::vector<const ShellBody*> shells, const std::vector<Obstacle>& obstacles,
                             std::vector<std::pair<int, int>> pairs)
    : m_shells(std::move(shells)), m_obstacles(obstacles), m_pairs(std::move(pairs)) {}

void ShellContacts::find(const ContactPose& pose, double vertexReach, double faceReach,
                         std::vector<Contact>& contacts) {
    for (const auto& [shell, body] : m_pairs) {
        const Obstacle& obstacle = m_obstacles[body];
        m_byFeature.clear();
        Query query{shell,
                    body,
                    *m_shells[shell],
                    *pose.positions[shell],
                    moved(obstacle.start, pose.twists[body], pose.time),
                    std::min(vertexReach, obstacle.body.inner),  // beyond that its nearest point says nothing
                    faceReach,
                    m_shells[shell]->options().friction * double(obstacle.object->getFriction()),
                    contacts};
        for (const auto& piece : obstacle.shape->pieces) {
            findVertices(query, *piece);
            if (faceReach > -std::numeric_limits<double>::infinity()) findFaces(query, *piece);
        }
    }
}

void ShellContacts::findVertices(Query& query, const ConvexPiece& piece) {
    Vec3 lower, upper;
    worldBounds(piece, query.frame, lower, upper);
    const double reach = std::max(query.vertexReach, query.faceReach) + query.thickness();
    lower.array() -= std::max(reach, 0.0);
    upper.array() += std::max(reach, 0.0);
    const int n = query.shellBody.vertexCount();
    m_outside.resize(n);
    const Frame toBody = query.frame.inverse(Eigen::Isometry);
    for (int i = 0; i < n; ++i) {
        const Vec3 x = query.x.col(i);
        unsigned char outside = 0;
        for (int k = 0; k < 3; ++k) {
            outside |= static_cast<unsigned char>((x[k] < lower[k]) << (2 * k));
            outside |= static_cast<unsigned char>((x[k] > upper[k]) << (2 * k + 1));
        }
        m_outside[i] = outside;
        if (outside) continue;
        if (const auto surface = piece.touch(Vec3(toBody * x), query.vertexReach + query.thickness()))
            add(query, Feature::vertex(i), *surface, {i, i, i}, Vec3::UnitX());
    }
}

void ShellContacts::findFaces(Query& query, const ConvexPiece& piece) {
    const HalfEdgeMesh& mesh = query.shellBody.shell().mesh();
    const Frame toBody = query.frame.inverse(Eigen::Isometry);
    const int edgeCount = static_cast<int>(mesh.edges().size());
    for (int t = 0; t < mesh.triangleCount(); ++t) {
        const auto column = mesh.triangles().col(t);
        const std::array<int, 3> corners{column[0], column[1], column[2]};
        if (m_outside[corners[0]] & m_outside[corners[1]] & m_outside[corners[2]]) continue;
        Mat3 triangle;
        for (int a = 0; a < 3; ++a) triangle.col(a) = toBody * Vec3(query.x.col(corners[a]));
        const auto touch = piece.touch(triangle, query.faceReach + query.thickness());
        if (!touch || touch->weights.maxCoeff() > 1.0 - 1e-6) continue;  // a vertex contact says the same
        int feature = Feature::triangle(t, mesh.vertexCount(), edgeCount);
        for (int a = 0; a < 3; ++a)
            if (touch->weights[a] <= 1e-9)
                feature = Feature::edge(mesh.edgeOf(3 * t + (a + 1) % 3), mesh.vertexCount());
        add(query, feature, touch->surface, corners, touch->weights);
    }
}

void ShellContacts::add(Query& query, int feature, const SurfacePoint& surface, const std::array<int, 3>& vertices,
                        const Vec3& weights) {
    Contact contact;
    contact.shell = query.shell;
    contact.feature = feature;
    contact.body = query.body;
    contact.vertices = vertices;
    contact.weights = weights;
    contact.normal = query.frame.linear() * surface.normal;
    contact.point = query.frame * surface.point;
    contact.gap = surface.distance - query.thickness();
    contact.friction = query.friction;
    const auto [known, fresh] = m_byFeature.try_emplace(feature, query.contacts.size());
    if (fresh)
        query.contacts.push_back(contact);
    else if (contact.gap < query.contacts[known->second].gap)
        query.contacts[known->second] = contact;
}

}  // namespace jacket::bullet
