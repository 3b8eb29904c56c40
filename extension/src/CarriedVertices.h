#pragma once
#include <optional>
#include <vector>

#include "Obstacles.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// Vertices that move with a body until the next step. Other bodies, joints or users may make the body do something
/// else than the solve assumed: the vertices are taken along.
class CarriedVertices {
  public:
    /// `twist`: of the solve. `anchor`: where the vertex is tied to the body, in the world, at the start of the step;
    /// null: it touches it.
    void add(ShellBody& shell, int vertex, const Obstacle& obstacle, const Vec6& twist, const Vec3* anchor);
    /// After the shells have moved by what was solved for. Forgets them all.
    void move(const btCollisionWorld& world, double h);
    void clear() { m_vertices.clear(); }

  private:
    struct Carried {
        ShellBody* shell;
        int vertex;
        const btCollisionObject* object;
        int objectId;
        Frame start;
        Vec6 twist;
        std::optional<Vec3> anchor;  ///< in the body's frame
    };
    /// Where a vertex is to be moved.
    struct Shift {
        const Carried* carried;
        Vec3 by;  ///< [m]
    };
    void findShifts(const ShellBody& shell, const btCollisionWorld& world, double h);
    static void moveAsOne(ShellBody& shell, std::vector<Shift>& shifts);

    std::vector<Carried> m_vertices;
    std::vector<ShellBody*> m_shells;  ///< that have any
    std::vector<Shift> m_shifts;       ///< of one of them
};

}  // namespace jacket::bullet
