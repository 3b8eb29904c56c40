#pragma once
#include <map>
#include <memory>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include "Obstacles.h"
#include "TrianglePatch.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// The contacts of an island's shells with the obstacles near them: what the solver asks for at any pose of one step.
///
/// A vertex in a valley, between two pieces of a body or two triangles of one, has a contact with each. Feature ids are
/// those of `Feature` for the first, and higher ones for the others; within the step each side keeps its id.
class ShellContacts final : public ContactDetector {
  public:
    /// `pairs`: (shell, obstacle) indices that Bullet's broadphase found near each other.
    ShellContacts(std::vector<const ShellBody*> shells, const std::vector<Obstacle>& obstacles,
                  std::vector<std::pair<int, int>> pairs);
    void find(const ContactPose& pose, double vertexReach, double faceReach, std::vector<Contact>& contacts) override;
    void sweep(const ContactSweep& motion, std::vector<Contact>& contacts) override;

  private:
    struct Query;
    struct Sweep;
    void add(Query& query, int feature, const SurfacePoint& surface, const std::array<int, 3>& vertices,
             const Vec3& weights);
    void findVertices(Query& query, const ConvexPiece& piece);
    void findFaces(Query& query, const ConvexPiece& piece);
    void findConcave(Query& query, const ConcavePiece& piece, std::unique_ptr<TrianglePatch>& patch);
    void addFace(Query& query, int triangle, const TrianglePoint& touch);
    void addVertices(Query& query);
    void setMaterial(Contact& contact);
    using Sides = std::vector<SurfacePoint>;
    static std::vector<int> sidesOf(Sides& known, std::vector<SurfacePoint>& surfaces);

    std::vector<const ShellBody*> m_shells;
    const std::vector<Obstacle>& m_obstacles;
    std::vector<std::pair<int, int>> m_pairs;
    /// What the user made of a contact when it was first found in this step.
    struct Material {
        double friction, restitution;
    };
    std::map<std::tuple<int, int, int>, Material> m_materials;  ///< of shell, body and feature
    std::vector<unsigned char> m_outside;    ///< per vertex: which sides of the obstacle's box it lies beyond
    std::map<int, std::size_t> m_byFeature;  ///< of the present pair: index in the result

    /// What a vertex can touch of the present body, in the body's frame.
    struct Candidate {
        int vertex;
        SurfacePoint surface;
    };
    std::vector<Candidate> m_candidates;
    /// Of each pair, for vertices that came near: the sides of a valley that it has met in this step, in the body's
    /// frame. Their index is part of a contact's id.
    std::vector<std::unordered_map<int, Sides>> m_sides;
    std::vector<std::vector<std::unique_ptr<TrianglePatch>>> m_patches;  ///< of each pair, of each concave piece
    std::vector<double> m_depth;  ///< of each pair: from how deep behind triangles a vertex is pushed out [m]
};

}  // namespace jacket::bullet
