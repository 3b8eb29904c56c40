#pragma once
#include <map>
#include <memory>
#include <memory_resource>
#include <tuple>
#include <utility>
#include <vector>

#include "Obstacles.h"
#include "TrianglePatch.h"
#include "jacket/WorkerTeam.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

class SweepTarget;

/// The contacts of an island's shells with the obstacles near them: what the solver asks for at any pose of one step.
///
/// A vertex in a valley, between two pieces of a body or two triangles of one, has a contact with each. Feature ids are
/// those of `Feature` for the first, and higher ones for the others; within the step each side keeps its id.
class ShellContacts final : public ContactDetector {
  public:
    class Memory;
    /// `pairs`: (shell, obstacle) indices that Bullet's broadphase found near each other. All that is given must
    /// outlive this. `team` shares the search in large shells, but for what asks shapes of the user's; the contacts and
    /// their order are the same.
    ShellContacts(std::span<const ShellBody* const> shells, std::span<const Obstacle> obstacles,
                  std::span<const std::pair<int, int>> pairs, Memory& memory, WorkerTeam* team = nullptr);
    void find(const ContactPose& pose, double vertexReach, double faceReach, std::vector<Contact>& contacts) override;
    void sweep(const ContactSweep& motion, std::vector<Contact>& contacts) override;
    bool crosses(const ContactSweep& motion) override;
    void advance(std::span<const Vec6> twists, double time) override;

  private:
    struct Query;
    struct Sweep;
    void sweepPiece(const Sweep& sweep, const SweepTarget& target, const Bounds& bounds,
                    std::vector<Contact>& contacts);
    void boundChunks(const HalfEdgeMesh& mesh, const Points& start, const Points& end);
    const TrianglePatch& wholeOf(const ConcavePiece& piece, double radius);
    static Contact makeContact(const Query& query, int feature, const SurfacePoint& surface,
                               const std::array<int, 3>& vertices, const Vec3& weights);
    /// Calls find(begin, end, list) for ranges of 0 ... count-1, and then use(found) for all that these have appended,
    /// in their order.
    template <class Found>
    static void collect(WorkerTeam* team, int count, std::vector<std::vector<Found>>& lists, const auto& find,
                        const auto& use);
    static Bounds boundsOfPiece(const ConvexPiece& piece, const Frame& frame);
    void markOutside(const Query& query, const ConvexPiece& piece);
    void findVertices(Query& query, const ConvexPiece& piece);
    static Vec3 sheetNormal(const Query& query, int vertex);
    static Vec3 sheetNormal(const Query& query, int triangle, const Vec3& weights);
    static SurfacePoint besideSheet(const Query& query, const ConvexPiece& piece, int vertex,
                                    const SurfacePoint& surface);
    static void turnAsSheetDoes(const Query& query, const auto& touchAt, const Vec3& sheet, SurfacePoint& surface);
    void findFaces(Query& query, const ConvexPiece& piece);
    static void cover(std::unique_ptr<TrianglePatch>& patch, const ConcavePiece& piece, Bounds near, double margin);
    const TrianglePatch& patchOf(int pair, std::size_t concave, const Sweep& sweep);
    void findConcave(Query& query, const ConcavePiece& piece, std::unique_ptr<TrianglePatch>& patch);
    void addFace(Query& query, int triangle, const TrianglePoint& touch);
    void addVertices(Query& query);
    static void addVertex(Query& query, int vertex, int side, const SurfacePoint& surface);
    void setMaterial(Contact& contact);
    using Sides = std::pmr::vector<SurfacePoint>;
    void findSides(Sides& known, std::vector<SurfacePoint>& surfaces);

    std::span<const ShellBody* const> m_shells;
    std::span<const Obstacle> m_obstacles;
    std::span<const std::pair<int, int>> m_pairs;
    std::pmr::vector<Frame> m_start;  ///< of the obstacles: pose that motions are counted from
    Memory& m_memory;
    WorkerTeam* m_team;
    /// What the user made of a contact when it was first found in this step.
    struct Material {
        double friction, restitution;
    };
    std::pmr::map<std::tuple<int, int, int>, Material> m_materials;  ///< of shell, body and feature
    std::pmr::map<int, std::size_t> m_byFeature;  ///< of the present pair: index in the result; vertices where swept
    /// Of each pair, for vertices that came near: the sides of a valley that it has met in this step, in the body's
    /// frame. Their index is part of a contact's id. A convex body has one side, which is not listed.
    std::pmr::vector<std::pmr::map<int, Sides>> m_sides;
    std::pmr::vector<std::vector<std::unique_ptr<TrianglePatch>>> m_patches;  ///< of each pair, of each concave piece
    std::map<const ConcavePiece*, TrianglePatch> m_whole;                     ///< of the shapes of fast bodies
    std::pmr::vector<double> m_depth;  ///< of each pair: from how deep behind triangles a vertex is pushed out [m]
};

/// What ShellContacts works with, kept from step to step: what one step has given back, the next one takes.
class ShellContacts::Memory {
    friend class ShellContacts;
    /// What a vertex can touch of the present body, in the body's frame.
    struct Candidate {
        int vertex;
        SurfacePoint surface;
    };
    struct Face {
        int triangle;
        TrianglePoint touch;
    };
    std::pmr::unsynchronized_pool_resource pool;
    /// What ranges of vertices and triangles have found, one list each where threads share the search.
    std::vector<std::vector<Candidate>> foundVertices;
    std::vector<std::vector<Face>> foundFaces;
    std::vector<unsigned char> outside;  ///< per vertex: which sides of the obstacle's box it lies beyond
    std::vector<Candidate> candidates;
    std::vector<Bounds> chunks;      ///< see boundChunks
    std::vector<SurfacePoint> kept;  ///< of one vertex
    std::vector<int> sides;          ///< which of its sides each of them is
};

}  // namespace jacket::bullet
