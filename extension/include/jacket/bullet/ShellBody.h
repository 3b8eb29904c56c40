#pragma once
#include <LinearMath/btTransform.h>

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "jacket/Shell.h"
#include "jacket/Statics.h"

class btCollisionObject;
class btMultiBodyLinkCollider;
class btRigidBody;

namespace jacket::bullet {

/// Some of a shell's triangles, of another material than the rest.
struct ShellRegion {
    ShellMaterial material;
    std::vector<int> triangles;
};

/// How a shell behaves in a Bullet world; the defaults are what most scenes want.
struct ShellOptions {
    MembraneModel membrane = StVenantKirchhoffMembrane{};
    BendingModel bending = PatchBending{};
    Integrator integrator = Integrator::BackwardEuler;
    bool plasticity = false;             ///< keep bends and stretches beyond the material's yield stress
    std::vector<ShellRegion> regions{};  ///< later ones win where they overlap
    double tolerance = 1e-2;             ///< of the linear solve, relative; see ShellSettings
    int maxIterations = 1000;            ///< of one linear solve
    double friction = 0.5;               ///< multiplied with the body's, as Bullet does [-]
    double restitution = 0.0;            ///< 0 to 1, multiplied with the body's, as Bullet does [-]
    int collisionGroup = 1;              ///< btBroadphaseProxy::DefaultFilter
    int collisionMask = -1;              ///< btBroadphaseProxy::AllFilter
    double contactThickness = -1.0;      ///< distance kept from surfaces [m]; < 0: half the shell's thickness
    Preconditioner preconditioner = Preconditioner::IncompleteCholesky;
    /// Whether it may fall asleep: once no vertex has moved by 1 % of an edge for a while. Over bodies that never move,
    /// or stand, one that is slow and loses no energy is damped until they stay there, or sleeps as it is some seconds
    /// later.
    bool sleeping = true;
};

class ShellWorld;
struct ShellRest;

/// A contact of a shell with one of Bullet's objects in the last substep. `contact.body` counts within the solve and
/// says nothing here.
struct BodyContact : ContactImpulse {
    btCollisionObject* object = nullptr;  ///< what it touches
    int triangle = -1;                    ///< of the shell; one of several for a point on an edge or a vertex
    Vec3 barycentric{1, 0, 0};            ///< of the point in that triangle
};

/// What test writers can hold a shell to: in every step, what it gains is what it was given, by gravity, by what is
/// noted here, and by forces, pressure, wind, damping (of one that is about to sleep, too) and pins, which are not.
struct ShellLedger {
    ShellEnergy energy;             ///< as it is when its momentum is `momentum`, and plastic work so far [J]
    double frictionLoss = 0.0;      ///< heat of sliding over bodies so far [J]
    Vec3 momentum = Vec3::Zero();   ///< as it is, see linearMomentum() [N s]
    Vec3 exchanged = Vec3::Zero();  ///< given to bodies by contacts and anchors so far, to static ones too [N s]
};

/// One shell of a ShellWorld. Vertices are in the order of the mesh given to ShellWorld::add.
class ShellBody {
  public:
    ~ShellBody();
    ShellBody(const ShellBody&) = delete;
    ShellBody& operator=(const ShellBody&) = delete;

    std::span<const btVector3> positions() const { return m_positions; }  ///< for drawing, as of the last substep [m]
    std::span<const btVector3> normals() const;                           ///< unit, computed when asked for
    btVector3 velocity(int vertex) const;                                 ///< [m/s]
    const Indices<3>& triangles() const { return m_shell.mesh().triangles(); }
    int vertexCount() const { return m_shell.vertexCount(); }

    /// Holds a vertex in space; throws std::out_of_range. One deeper than a millimetre (a fiftieth of an edge, if that
    /// is less) in a static, kinematic or sleeping body does not collide with it, nor does what hangs on it in there.
    void pin(int vertex);
    void movePin(int vertex, const btVector3& target);
    void unpin(int vertex);
    /// Pins an edge together with its tangent: see Shell::clamp.
    void clamp(const std::vector<int>& vertices, std::optional<btVector3> direction = {});
    /// Moves the shell to its equilibrium under gravity, its forces and pressure, as held, without bodies: see
    /// jacket/Statics.h.
    StaticReport settle(const btVector3& gravity, const StaticSettings& settings = {});
    /// Ties a vertex to a body at their present distance. One thing at a time holds a vertex, the one that was asked
    /// for last: an anchor ends the vertex's pin, guide or earlier anchor (also to the same body), and what pins,
    /// clamps or guides the vertex ends its anchor. The vertex does not collide with its body; others do, unless they
    /// hang on it inside the body, as with pin. The body may be removed at any time, which frees the vertex (also if
    /// the body is added again: a new entry of the broadphase is a new body). A body that is teleported (see
    /// isTeleport) takes the shell along as it is, turned with the body, if no pins, guides or other bodies hold it
    /// that stay; else it lets go, of which ShellWorld::takeWarnings() tells. Throws std::out_of_range.
    void anchor(int vertex, btRigidBody& body);
    void anchor(int vertex, btMultiBodyLinkCollider& link);
    /// Ends a vertex's anchor, if it has one; throws std::out_of_range.
    void unanchor(int vertex);

    /// Asleep it stands still and costs nothing until something happens to it, or activate() is called.
    bool isAsleep() const;
    void activate();

    /// Bullet's queries find the shell there after the world's next step or updateAabbs().
    void setPositions(std::span<const btVector3> positions);
    void setVelocity(const btVector3& velocity);  ///< of every vertex
    void setName(std::string name) { m_name = std::move(name); }
    const std::string& name() const { return m_name; }
    /// How Bullet sees the shell: for its queries and for setIgnoreCollisionCheck. Has contact response off, and a
    /// shape and transform of its own that are not to be changed.
    btCollisionObject& collisionObject();
    const btCollisionObject& collisionObject() const;

    Shell& shell() { return m_shell; }  ///< the solver's own, in double precision
    const Shell& shell() const { return m_shell; }
    const ShellOptions& options() const { return m_options; }
    double contactThickness() const { return m_contactThickness; }
    /// Contacts that carried an impulse in the last substep.
    std::span<const BodyContact> contacts() const { return m_contacts; }
    /// What an anchored vertex gave its body in the last substep [N s], zero for others; throws std::out_of_range.
    Vec3 anchorImpulse(int vertex) const;
    /// Linear momentum without the gravity of the coming substep, which Bullet's bodies have not received yet [N s].
    btVector3 linearMomentum() const;
    ShellLedger ledger() const;

  private:
    friend class ShellWorld;
    friend class CarriedVertices;
    friend class FastBodies;
    friend class IslandFinder;
    friend class Sleepers;
    friend class SolvedIslands;
    friend class Teleports;
    ShellBody(const TriangleMesh& mesh, const ShellMaterial& material, const ShellOptions& options);
    struct Anchor {
        int vertex;
        btCollisionObject* body;
        btVector3 local;              ///< in the body's frame
        btTransform pose;             ///< of the body as the last step left it
        int bodyId = -1;              ///< the broadphase's; -1: not asked for yet
        Vec3 impulse = Vec3::Zero();  ///< on the body, in the last substep [N s]
    };
    Shell m_shell;
    ShellOptions m_options;
    double m_contactThickness;
    std::string m_name;
    std::vector<Anchor> m_anchors;
    std::vector<BodyContact> m_contacts;
    double m_frictionLoss = 0.0;
    Vec3 m_exchanged = Vec3::Zero();
    struct Before {
        Points velocities;  ///< empty: it has none
        Vec3 exchanged = Vec3::Zero();
        double frictionLoss = 0.0;
        unsigned revision = 0;  ///< of the shell when it had been solved
    };
    Before m_before;        ///< the last solve with free bodies
    void forgetImpulses();  ///< of the last substep
    void note(const BodyContact& contact);
    void note(const jacket::Anchor& anchor);
    Vec3 momentum() const;  ///< see linearMomentum()
    double kinetic() const;
    std::vector<btVector3> m_positions;
    mutable std::vector<btVector3> m_normals;
    Points m_ahead;  ///< where vertices that touch would be taken along to; empty until one does [m]
    void publish();  ///< copies positions for drawing
    void anchorTo(int vertex, btCollisionObject& body);
    void requireVertex(int vertex, const char* what) const;  ///< throws std::out_of_range
    void endAnchorsOfHeld();                                 ///< of what is pinned or guided
    void fallAsleep();
    void forgetSolvedVelocity();  ///< the user has set another
    BodyContact describe(const ContactImpulse& impulse, btCollisionObject& object) const;
    std::unique_ptr<ShellRest> m_rest;
    bool m_hasVelocity = false;            ///< a solve has been done for the coming motion
    Vec3 m_pendingGravity = Vec3::Zero();  ///< h g that the velocities hold and Bullet's bodies do not yet [m/s]
    class Proxy;                           ///< what Bullet's broadphase and ray tests see
    std::unique_ptr<Proxy> m_proxy;
};

}  // namespace jacket::bullet
