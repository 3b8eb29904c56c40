#pragma once
#include <map>
#include <utility>
#include <vector>

#include "Obstacles.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// The contacts of an island's shells with the obstacles near them: what the solver asks for at any pose.
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

    std::vector<const ShellBody*> m_shells;
    const std::vector<Obstacle>& m_obstacles;
    std::vector<std::pair<int, int>> m_pairs;
    std::vector<unsigned char> m_outside;    ///< per vertex: which sides of the obstacle's box it lies beyond
    std::map<int, std::size_t> m_byFeature;  ///< of the present pair: index in the result
};

}  // namespace jacket::bullet
