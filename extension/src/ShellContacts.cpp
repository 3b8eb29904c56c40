#include "ShellContacts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "ManifoldPoint.h"

namespace jacket::bullet {
namespace {

constexpr double kSameSide = 0.97;   // cosine of the angle below which two normals at a vertex count as one
constexpr double kOnSurface = 0.01;  // of the contact's thickness: what is nearer to a surface lies on it
constexpr double kSamePoint = 0.1;   // of the thickness: what is nearer to a point of a surface is that point
constexpr double kTurning = 0.1;     // of an edge: how far off a body's edges normals turn as the sheet does
constexpr int kLeastToShare = 1000;  // vertices of a shell from which on threads pay
constexpr int kAtATime = 1024;       // vertices or triangles that a thread takes

/// Room for so many more, and a few besides. An empty list gives its memory back first.
template <class T>
void makeRoom(std::vector<T>& list, std::size_t more) {
    const std::size_t count = list.size() + more;
    if (count <= list.capacity()) return;
    if (list.empty()) list = std::vector<T>();
    list.reserve(count + count / 8 + 16);
}

/// Appends to a list of thousands, which grows by a quarter: doubled, it would soon be twice what is needed.
template <class T>
void append(std::vector<T>& list, const T& element) {
    if (list.size() == list.capacity()) list.reserve(list.size() + list.size() / 4 + 16);
    list.push_back(element);
}

/// How a triangle asks about its edges: of two that share one only the second does.
std::array<ShellEdge, 3> edgesOf(const HalfEdgeMesh& mesh, const Points& x, int triangle) {
    std::array<ShellEdge, 3> edges{ShellEdge::kLeftOut, ShellEdge::kLeftOut, ShellEdge::kLeftOut};
    for (int a = 0; a < 3; ++a) {
        const int halfEdge = 3 * triangle + a, twin = mesh.twin(halfEdge);
        if (twin < 0) edges[a] = ShellEdge::kBorder;
        if (twin >= 0 && twin < halfEdge)
            edges[a] = {ShellEdge::kShared, x.col(mesh.triangles()((twin + 2) % 3, twin / 3))};
    }
    return edges;
}

bool isAbove(const Vec3& point, const SurfacePoint& plane) {
    const Vec3 offset = point - plane.point;
    return plane.normal.dot(offset) > 1e-6 * offset.norm();
}

/// Does holding a vertex off one surface say all that another one could? Behind a surface: is it outside once the
/// deeper one has pushed it out; in front: does that one lie behind the plane of the nearer.
bool isCovered(const SurfacePoint& surface, const SurfacePoint& nearer) {
    if (surface.normal.dot(nearer.normal) > kSameSide) return true;
    if (surface.distance < 0) return surface.normal.dot(nearer.point - surface.point) >= 0;
    return !isAbove(surface.point, nearer);
}

/// Whether two surfaces meet in a ridge, not in a valley. Nearest points may both be on the line where they meet, so
/// both are asked.
bool isOverRidge(const SurfacePoint& a, const SurfacePoint& b) {
    return !isAbove(a.point, b) && !isAbove(b.point, a);
}

}  // namespace

/// One shell against one obstacle at one pose.
struct ShellContacts::Query {
    int pair, shell, body;
    const ShellBody& shellBody;
    const Points& x;
    Frame frame;  ///< of the obstacle
    double vertexReach, faceReach;
    const double* ownReach;  ///< of each vertex, null: all have vertexReach
    bool isConvex;           ///< the obstacle is one piece
    std::vector<Contact>& contacts;
    WorkerTeam* team;   ///< null: the shell is too small to be shared
    bool isPrescribed;  ///< the obstacle's motion
    WorkerTeam* teamFor(const ConvexPiece& piece) const { return piece.asksShape() ? nullptr : team; }
    double thickness() const { return shellBody.contactThickness(); }
    double reachOf(int vertex) const { return ownReach ? std::min(vertexReach, ownReach[vertex]) : vertexReach; }
    bool wantsFaces() const { return faceReach > -std::numeric_limits<double>::infinity(); }
    /// Whether a vertex' normal turns as the sheet does at this distance, see turnAsSheetDoes().
    bool turnsAt(double distance) const {
        return isPrescribed && std::abs(distance) < thickness() + kTurning * shellBody.shell().meanEdge();
    }
};

ShellContacts::ShellContacts(std::span<const ShellBody* const> shells, std::span<const Obstacle> obstacles,
                             std::span<const std::pair<int, int>> pairs, Memory& memory, WorkerTeam* team)
    : m_shells(shells),
      m_obstacles(obstacles),
      m_pairs(pairs),
      m_start(&memory.pool),
      m_memory(memory),
      m_team(team),
      m_materials(&memory.pool),
      m_byFeature(&memory.pool),
      m_sides(pairs.size(), &memory.pool),
      m_patches(&memory.pool),
      m_depth(pairs.size(), 0.0, &memory.pool) {
    m_start.reserve(m_obstacles.size());
    for (const Obstacle& obstacle : m_obstacles) m_start.push_back(obstacle.start);
    m_patches.reserve(m_pairs.size());
    for (const auto& [shell, body] : m_pairs) m_patches.emplace_back(m_obstacles[body].shape->concave.size());
}

void ShellContacts::find(const ContactPose& pose, double vertexReach, double faceReach,
                         std::vector<Contact>& contacts) {
    for (int pair = 0; pair < int(m_pairs.size()); ++pair) {
        const auto [shell, body] = m_pairs[pair];
        const Obstacle& obstacle = m_obstacles[body];
        m_byFeature.clear();
        m_memory.candidates.clear();
        const auto first = static_cast<std::ptrdiff_t>(contacts.size());
        Query query{pair,
                    shell,
                    body,
                    *m_shells[shell],
                    *pose.positions[shell],
                    moved(m_start[body], pose.twists[body], pose.time),
                    std::min(vertexReach, obstacle.body.inner),  // beyond that its nearest point says nothing
                    faceReach,
                    pose.vertexReach.empty() ? nullptr : pose.vertexReach[shell],
                    obstacle.shape->pieces.size() == 1 && obstacle.shape->concave.empty(),
                    contacts,
                    m_shells[shell]->vertexCount() < kLeastToShare ? nullptr : m_team,
                    obstacle.body.prescribed};
        for (const auto& piece : obstacle.shape->pieces) {
            markOutside(query, *piece);
            if (query.wantsFaces()) findFaces(query, *piece);
            findVertices(query, *piece);
        }
        for (std::size_t k = 0; k < obstacle.shape->concave.size(); ++k)
            findConcave(query, obstacle.shape->concave[k], m_patches[pair][k]);
        addVertices(query);
        std::for_each(contacts.begin() + first, contacts.end(), [&](Contact& contact) { setMaterial(contact); });
    }
}

void ShellContacts::advance(std::span<const Vec6> twists, double time) {
    for (std::size_t b = 0; b < m_start.size(); ++b) m_start[b] = moved(m_start[b], twists[b], time);
}

template <class Found>
void ShellContacts::collect(WorkerTeam* team, int count, std::vector<std::vector<Found>>& lists, const auto& find,
                            const auto& use) {
    const int ranges = (count + kAtATime - 1) / kAtATime, atOnce = team ? ranges : 1;
    if (std::ssize(lists) < atOnce) lists.resize(atOnce);
    for (int first = 0; first < ranges; first += atOnce) {
        runParts(team, std::min(atOnce, ranges - first), [&](int i) {
            lists[i].clear();
            find((first + i) * kAtATime, std::min((first + i + 1) * kAtATime, count), lists[i]);
        });
        for (int i = 0; i < std::min(atOnce, ranges - first); ++i) std::for_each(lists[i].begin(), lists[i].end(), use);
    }
}

/// Of a piece at a pose of its body, in the world.
Bounds ShellContacts::boundsOfPiece(const ConvexPiece& piece, const Frame& frame) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const Vec3 centre = 0.5 * (piece.lower() + piece.upper()), half = 0.5 * (piece.upper() - piece.lower());
    if (!half.allFinite() || !centre.allFinite() || half.maxCoeff() > 1e15)  // a plane
        return {Vec3::Constant(-kInfinity), Vec3::Constant(kInfinity)};
    const Vec3 at = frame * centre, reach = frame.linear().cwiseAbs() * half;
    return {at - reach, at + reach};
}

void ShellContacts::markOutside(const Query& query, const ConvexPiece& piece) {
    auto [lower, upper] = boundsOfPiece(piece, query.frame);
    const double reach = std::max(query.vertexReach, query.faceReach) + query.thickness();
    lower.array() -= std::max(reach, 0.0);
    upper.array() += std::max(reach, 0.0);
    const int n = query.shellBody.vertexCount();
    m_memory.outside.resize(n);
    runRanges(query.team, n, kAtATime, [&](int begin, int end) {
        for (int i = begin; i < end; ++i) {
            const Vec3 x = query.x.col(i);
            unsigned char outside = 0;
            for (int k = 0; k < 3; ++k) {
                outside |= static_cast<unsigned char>((x[k] < lower[k]) << (2 * k));
                outside |= static_cast<unsigned char>((x[k] > upper[k]) << (2 * k + 1));
            }
            m_memory.outside[i] = outside;
        }
    });
}

/// The sheet's unit normal at a vertex, in the body's frame.
Vec3 ShellContacts::sheetNormal(const Query& query, int vertex) {
    const HalfEdgeMesh& mesh = query.shellBody.shell().mesh();
    Vec3 normal = Vec3::Zero();
    for (const int t : mesh.trianglesAround(vertex)) {
        const auto corners = mesh.triangles().col(t);
        const Vec3 a = query.x.col(corners[0]), b = query.x.col(corners[1]), c = query.x.col(corners[2]);
        normal += (b - a).cross(c - a);
    }
    return (query.frame.linear().transpose() * normal).stableNormalized();
}

/// The same at a point of a triangle, as if the sheet were smooth.
Vec3 ShellContacts::sheetNormal(const Query& query, int triangle, const Vec3& weights) {
    const auto corners = query.shellBody.shell().mesh().triangles().col(triangle);
    Vec3 normal = Vec3::Zero();
    for (int a = 0; a < 3; ++a)
        if (weights[a] != 0.0) normal += weights[a] * sheetNormal(query, corners[a]);
    return normal.stableNormalized();
}

/// A vertex that is put right on a body may lie on an edge of it, or a corner, where the nearest point's normal is any
/// of many. That of the sheet says on which side of the body it lies. All in the body's frame.
SurfacePoint ShellContacts::besideSheet(const Query& query, const ConvexPiece& piece, int vertex,
                                        const SurfacePoint& surface) {
    const Vec3 normal = sheetNormal(query, vertex);
    SurfacePoint best = surface;
    double most = kSameSide;
    for (const Vec3& out : {normal, Vec3(-normal)}) {
        const auto beside = piece.touch(Vec3(surface.point + query.thickness() * out), 2.0 * query.thickness());
        if (!beside || beside->distance <= 0.0 || beside->normal.dot(out) <= most) continue;
        most = beside->normal.dot(out);
        best = {beside->point, beside->normal, surface.distance};
    }
    return best;
}

/// Where a sheet is folded over a body's edge, all normals between those of its two sides hold it up there. With those
/// of single triangles, or of the nearest point, a vertex that has come to the edge hangs from it like a hook: whatever
/// pulls is borne there, and none of that goes on to what lies behind. So the normal turns from vertex to vertex, as a
/// smooth sheet's does, as far as the body admits.
void ShellContacts::turnAsSheetDoes(const Query& query, const auto& touchAt, const Vec3& sheet, SurfacePoint& surface) {
    const Vec3 normal = sheet.dot(surface.normal) < 0.0 ? Vec3(-sheet) : sheet;
    if (normal.dot(surface.normal) > kSameSide) return;
    const auto beside = touchAt(Vec3(surface.point + query.thickness() * normal), 2.0 * query.thickness());
    if (!beside || beside->distance <= 0.0 || beside->normal.dot(surface.normal) > kSameSide) return;
    surface.distance *= beside->normal.dot(surface.normal);
    surface.normal = beside->normal;
}

/// A convex body has one side, which is what its contacts are made with; of others that shows when all are known.
void ShellContacts::findVertices(Query& query, const ConvexPiece& piece) {
    const Frame toBody = query.frame.inverse(Eigen::Isometry);
    const auto touchAt = [&](const Vec3& p, double reach) { return piece.touch(p, reach); };
    const auto find = [&](int begin, int end, auto& found) {
        for (int i = begin; i < end; ++i) {
            if (m_memory.outside[i]) continue;
            const Vec3 x = toBody * Vec3(query.x.col(i));
            auto surface = piece.touch(x, query.reachOf(i) + query.thickness());
            if (!surface) continue;
            if (std::abs(surface->distance) < kOnSurface * query.thickness())
                surface = besideSheet(query, piece, i, *surface);
            else if (query.turnsAt(surface->distance))
                turnAsSheetDoes(query, touchAt, sheetNormal(query, i), *surface);
            append(found, {i, *surface});
        }
    };
    const auto use = [&](const Memory::Candidate& found) {
        if (query.isConvex)
            addVertex(query, found.vertex, 0, found.surface);
        else
            append(m_memory.candidates, found);
    };
    collect(query.teamFor(piece), query.shellBody.vertexCount(), m_memory.foundVertices, find, use);
}

void ShellContacts::findFaces(Query& query, const ConvexPiece& piece) {
    const HalfEdgeMesh& mesh = query.shellBody.shell().mesh();
    const Frame toBody = query.frame.inverse(Eigen::Isometry);
    const auto touchAt = [&](const Vec3& p, double reach) { return piece.touch(p, reach); };
    const auto find = [&](int begin, int end, auto& found) {
        for (int t = begin; t < end; ++t) {
            const auto corners = mesh.triangles().col(t);
            if (m_memory.outside[corners[0]] & m_memory.outside[corners[1]] & m_memory.outside[corners[2]]) continue;
            Mat3 triangle;
            for (int a = 0; a < 3; ++a) triangle.col(a) = toBody * Vec3(query.x.col(corners[a]));
            auto touch = piece.touch(triangle, query.faceReach + query.thickness());
            if (!touch) continue;
            if (query.isPrescribed)
                turnAsSheetDoes(query, touchAt, sheetNormal(query, t, touch->weights), touch->surface);
            append(found, {t, *touch});
        }
    };
    collect(query.teamFor(piece), mesh.triangleCount(), m_memory.foundFaces, find,
            [&](const Memory::Face& found) { addFace(query, found.triangle, found.touch); });
}

/// Makes a patch of all triangles in `near`, and by `margin` around it, unless it has them.
void ShellContacts::cover(std::unique_ptr<TrianglePatch>& patch, const ConcavePiece& piece, Bounds near,
                          double margin) {
    if (patch && patch->box().contains(near)) return;
    near.lower.array() -= margin;
    near.upper.array() += margin;
    patch = std::make_unique<TrianglePatch>(*piece.shape, near);
}

/// The triangles near the shell; the old ones if they still hold all of them. Bullet's shape is asked about once a
/// step.
void ShellContacts::findConcave(Query& query, const ConcavePiece& piece, std::unique_ptr<TrianglePatch>& patch) {
    if (!query.x.allFinite()) return;
    const HalfEdgeMesh& mesh = query.shellBody.shell().mesh();
    const double reach = query.vertexReach + query.thickness(), faceReach = query.faceReach + query.thickness();
    // A vertex that has come from the front in this step, or stands no deeper than a triangle is wide, is pushed out.
    double& depth = m_depth[query.pair];
    if (depth == 0.0) depth = std::max(query.vertexReach, 0.5 * query.shellBody.shell().meanEdge());
    const Frame toPiece = piece.frame.inverse(Eigen::Isometry);
    const Points x = (toPiece * query.frame.inverse(Eigen::Isometry)) * query.x;
    const double margin = std::max({reach, query.wantsFaces() ? faceReach : 0.0, depth});
    const Bounds near{x.rowwise().minCoeff().array() - margin, x.rowwise().maxCoeff().array() + margin};
    cover(patch, piece, near, margin);
    // Moving meshes get deeper into coarse sheets.
    const bool isStill = query.isPrescribed && m_obstacles[query.body].body.freeTwist.isZero(0.0);
    // The other side of a valley may be nearer to what lies beside a contact.
    const auto besideAt = [&](const SurfacePoint& surface) {
        return [&, at = surface.point](const Vec3& p, double within) -> std::optional<SurfacePoint> {
            const auto nearest = patch->touchNearest(toPiece * p, within, 0.0);
            if (!nearest || (nearest->point - at).norm() > kSamePoint * query.thickness()) return {};
            return placed(piece.frame, *nearest);
        };
    };
    const auto findVerticesIn = [&](int begin, int end, auto& found) {
        std::vector<SurfacePoint> touched;
        for (int i = begin; i < end; ++i) {
            touched.clear();
            patch->touch(Vec3(x.col(i)), query.reachOf(i) + query.thickness(), depth, touched);
            for (const SurfacePoint& surface : touched) {
                append(found, {i, placed(piece.frame, surface)});
                if (isStill && query.turnsAt(surface.distance))
                    turnAsSheetDoes(query, besideAt(surface), sheetNormal(query, i), found.back().surface);
            }
        }
    };
    collect(query.team, query.shellBody.vertexCount(), m_memory.foundVertices, findVerticesIn,
            [&](const Memory::Candidate& found) { append(m_memory.candidates, found); });
    if (!query.wantsFaces()) return;
    const auto findFacesIn = [&](int begin, int end, auto& found) {
        std::vector<TrianglePoint> touched;
        for (int t = begin; t < end; ++t) {
            Mat3 triangle;
            for (int a = 0; a < 3; ++a) triangle.col(a) = x.col(mesh.triangles()(a, t));
            touched.clear();
            patch->touch(triangle, edgesOf(mesh, x, t), faceReach, depth, touched);
            for (const auto& [surface, weights] : touched) {
                append(found, {t, {placed(piece.frame, surface), weights}});
                if (isStill)
                    turnAsSheetDoes(query, besideAt(surface), sheetNormal(query, t, weights),
                                    found.back().touch.surface);
            }
        }
    };
    collect(query.team, mesh.triangleCount(), m_memory.foundFaces, findFacesIn,
            [&](const Memory::Face& found) { addFace(query, found.triangle, found.touch); });
}

void ShellContacts::addFace(Query& query, int triangle, const TrianglePoint& touch) {
    if (touch.weights.maxCoeff() > 1.0 - 1e-6) return;  // a vertex contact says the same
    const HalfEdgeMesh& mesh = query.shellBody.shell().mesh();
    const auto corners = mesh.triangles().col(triangle);
    int feature = Feature::triangle(triangle, mesh.vertexCount(), static_cast<int>(mesh.edges().size()));
    for (int a = 0; a < 3; ++a)
        if (touch.weights[a] <= 1e-9)
            feature = Feature::edge(mesh.edgeOf(3 * triangle + (a + 1) % 3), mesh.vertexCount());
    const Contact contact =
        makeContact(query, feature, touch.surface, {corners[0], corners[1], corners[2]}, touch.weights);
    const auto [known, fresh] = m_byFeature.try_emplace(feature, query.contacts.size());
    if (fresh)
        append(query.contacts, contact);
    else if (contact.gap < query.contacts[known->second].gap)
        query.contacts[known->second] = contact;
}

/// Of all that a vertex can touch, what is not covered by something nearer.
void ShellContacts::addVertices(Query& query) {
    auto& candidates = m_memory.candidates;
    const auto isBefore = [](const auto& a, const auto& b) {
        return std::pair(a.vertex, a.surface.distance) < std::pair(b.vertex, b.surface.distance);
    };
    if (!std::is_sorted(candidates.begin(), candidates.end(), isBefore))  // one piece: it is
        std::stable_sort(candidates.begin(), candidates.end(), isBefore);
    makeRoom(query.contacts, candidates.size());
    std::vector<SurfacePoint>& kept = m_memory.kept;
    for (std::size_t first = 0, next; first < candidates.size(); first = next) {
        const int vertex = candidates[first].vertex;
        kept.clear();
        for (next = first; next < candidates.size() && candidates[next].vertex == vertex; ++next) {
            const SurfacePoint& surface = candidates[next].surface;
            if (std::none_of(kept.begin(), kept.end(), [&](const auto& nearer) { return isCovered(surface, nearer); }))
                kept.push_back(surface);
        }
        findSides(m_sides[query.pair][vertex], kept);
        for (std::size_t k = 0; k < kept.size(); ++k) addVertex(query, vertex, m_memory.sides[k], kept[k]);
    }
}

void ShellContacts::addVertex(Query& query, int vertex, int side, const SurfacePoint& surface) {
    const HalfEdgeMesh& mesh = query.shellBody.shell().mesh();
    const int featureCount = mesh.vertexCount() + static_cast<int>(mesh.edges().size()) + mesh.triangleCount();
    append(query.contacts, makeContact(query, Feature::vertex(vertex) + side * featureCount, surface,
                                       {vertex, vertex, vertex}, Vec3::UnitX()));
}

/// For each surface that a vertex touches the index of the known side that it belongs to: of much the same normal, or
/// one over whose ridge the vertex has gone. Others become known.
void ShellContacts::findSides(Sides& known, std::vector<SurfacePoint>& surfaces) {
    if (known.empty())  // the same order in the next step, whichever is nearer then
        std::sort(surfaces.begin(), surfaces.end(), [](const SurfacePoint& a, const SurfacePoint& b) {
            return std::lexicographical_compare(a.normal.data(), a.normal.data() + 3, b.normal.data(),
                                                b.normal.data() + 3);
        });
    const int knownCount = int(known.size());
    std::vector<int>& sides = m_memory.sides;
    sides.assign(surfaces.size(), -1);
    const auto isFree = [&](int side) { return std::find(sides.begin(), sides.end(), side) == sides.end(); };
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
        double most = kSameSide;
        for (int side = 0; side < knownCount; ++side) {
            const double along = known[side].normal.dot(surfaces[i].normal);
            if (along > most && isFree(side)) sides[i] = side, most = along;
        }
    }
    for (std::size_t i = 0; i < surfaces.size(); ++i) {  // after them: a side that is still there was not left
        for (int side = 0; side < knownCount && sides[i] < 0; ++side)
            if (isFree(side) && isOverRidge(surfaces[i], known[side])) sides[i] = side;
        if (sides[i] < 0) {
            sides[i] = int(known.size());
            known.push_back(surfaces[i]);
        }
    }
    for (std::size_t i = 0; i < surfaces.size(); ++i) known[sides[i]] = surfaces[i];
}

/// What shell and body make of it together: the products, as Bullet combines them, or what the user makes of these. A
/// body that gives back more than it gets would do so without end.
void ShellContacts::setMaterial(Contact& contact) {
    const ShellBody& shell = *m_shells[contact.shell];
    const btCollisionObject& body = *m_obstacles[contact.body].object;
    contact.friction = shell.options().friction * double(body.getFriction());
    contact.restitution = std::clamp(shell.options().restitution * double(body.getRestitution()), 0.0, 1.0);
    if (!isMaterialCustom(shell.collisionObject(), body)) return;
    const auto [known, fresh] = m_materials.try_emplace({contact.shell, contact.body, contact.feature});
    Material& material = known->second;
    if (fresh) {
        customiseMaterial(contact, shell.shell().mesh(), shell.collisionObject(), body);
        material = {contact.friction, contact.restitution};
    }
    contact.friction = material.friction;
    contact.restitution = material.restitution;
}

Contact ShellContacts::makeContact(const Query& query, int feature, const SurfacePoint& surface,
                                   const std::array<int, 3>& vertices, const Vec3& weights) {
    Contact contact;
    contact.shell = query.shell;
    contact.feature = feature;
    contact.body = query.body;
    contact.vertices = vertices;
    contact.weights = weights;
    contact.normal = query.frame.linear() * surface.normal;
    contact.point = query.frame * surface.point;
    contact.gap = surface.distance - query.thickness();
    return contact;
}

}  // namespace jacket::bullet
