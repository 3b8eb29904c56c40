#pragma once
#include <optional>
#include <span>
#include <vector>

#include "Obstacles.h"
#include "jacket/bullet/ShellBody.h"

namespace jacket::bullet {

/// Vertices that move with a body until the next step. Other bodies, joints or users may make the body do something
/// else than the solve assumed: the vertices are taken along.
class CarriedVertices {
  public:
    /// A vertex that touches the body. `twist`: of the solve; `normal`: out of the body.
    void addTouching(ShellBody& shell, int vertex, const Obstacle& obstacle, const Frame& end, const Vec3& normal);
    /// A vertex that is tied to the body at `point`, in the world, at the start of the step.
    void addTied(ShellBody& shell, int vertex, const Obstacle& obstacle, const Frame& end, const Vec3& point);
    /// After the shells have moved by what was solved for: to where the bodies are.
    void move(const btCollisionWorld& world, const Vec3& gravity, double h);
    /// Before shells that have no velocity are solved for a motion that bodies have made already: to where kinematic
    /// bodies begin it, should that not be where they were. (Bullet takes one to the end of all substeps in the first
    /// of them, with the velocity that takes it there in all.)
    void moveToStart(const btCollisionWorld& world, Obstacles& obstacles, const Vec3& gravity, double h);
    void forget(const ShellBody& shell);
    void clear() {
        m_vertices.clear();
        m_moved.clear();
    }

  private:
    struct Carried {
        ShellBody* shell;
        int vertex;
        btCollisionObject* object;
        int objectId;
        Frame end;                   ///< where the body was solved to go, then where it is
        std::optional<Vec3> anchor;  ///< in the body's frame; none: it touches the body
        Vec3 normal;                 ///< of what touches
        bool isTied() const { return anchor.has_value(); }
    };
    /// Where a vertex is to be moved.
    struct Shift {
        const Carried* carried;
        Vec3 by;  ///< [m]
    };
    /// Takes vertices from where their bodies end to where `goals` has them.
    void carry(std::span<const Carried> vertices, std::span<const Frame> goals, const Vec3& gravity, double h);
    void findShifts(const ShellBody& shell, std::span<const Carried> vertices, std::span<const Frame> goals, double h);
    static double energyOfMotion(const Shell& shell, const Vec3& gravity, double h);
    static void moveAsOne(ShellBody& shell, std::vector<Shift>& shifts);
    void bringAlong(ShellBody& shell, const Vec3& gravity, double h);
    std::optional<Points> wayOfAll(Shell& shell, double h) const;
    std::optional<Points> wayWhenLed(Shell& shell, double h, double share) const;
    double energyAlong(ShellBody& shell, const Points& way) const;
    void follow(Shell& shell, const Points& way);
    double strainAlone(const Shell& shell, bool ofTied) const;
    void spare(ShellBody& shell, const Vec3& gravity, double h);
    double energyAfter(ShellBody& shell, double share) const;

    std::vector<Carried> m_vertices;
    std::vector<Carried> m_moved;  ///< with the last motion; of shells that sleep, with their last one
    bool m_hasMoved = false;       ///< any of shells that are awake
    std::vector<Frame> m_goals;
    std::vector<ShellBody*> m_shells;  ///< that have any
    std::vector<Shift> m_shifts;       ///< of one of them
};

}  // namespace jacket::bullet
