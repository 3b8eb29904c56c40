#pragma once
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "jacket/Types.h"

/// Everything that the solver and the collision code say to each other.
namespace jacket {

/// What impulses something may give that holds a body in one direction [N s; N m s about an axis]: contacts and the
/// limits of joints push only, joints pull too, motors do either as far as their force goes. Beyond that it gives way.
struct ImpulseRange {
    double least = 0.0;  ///< <= 0
    double most = std::numeric_limits<double>::infinity();

    bool pulls() const { return least < 0.0; }
    bool isBounded() const { return std::isfinite(least) && std::isfinite(most); }
    /// In a part of the step.
    ImpulseRange part(double share) const { return {share * least, share * most}; }
};

/// A rigid contact of a body with something else, which bore load when the step began, or is closed in it: it keeps
/// row . twist from falling below `velocity`. Or a row of a joint, which keeps it there. Mass and free twist of its
/// body are given as if it held either way, by a stiff term weight row row^T.
struct BodySupport {
    Vec6 row = Vec6::Zero();  ///< velocity along the contact's normal, towards the body, from the body's twist
    double velocity = 0.0;    ///< of what is on the other side, and by which the two are to part at least [m/s]
    double weight = 0.0;      ///< how heavy that is [kg; kg m^2 about an axis], > 0
    ImpulseRange range{};
    /// On a body with that twist, along the row [N s; N m s about an axis].
    double impulseOn(const Vec6& twist) const { return weight * (velocity - row.dot(twist)); }
};

/// A rigid body that takes part in the shells' solve. Twists are (velocity of the centre of mass, angular velocity).
struct CoupledBody {
    Vec3 position = Vec3::Zero();    ///< centre of mass at the start of the step [m]
    Mat6 mass = Mat6::Zero();        ///< blockdiag(m I, R I R^T), and the stiff terms of its supports
    Vec6 freeTwist = Vec6::Zero();   ///< w*: what it would do without the shells, the coming gravity included
    Vec6 startTwist = Vec6::Zero();  ///< as it is when the step begins: what contacts bounce from
    double radius = 0.0;             ///< of a ball around `position` that holds the body [m]
    double inner = 1e300;  ///< of a ball that fits into its thinnest piece: contacts of faster motion are swept [m]
    std::span<const BodySupport> supports{};  ///< kept by the caller
    const void* key = nullptr;                ///< the same from step to step: whose contacts to remember
    bool prescribed = false;      ///< static, kinematic or sleeping: moves with freeTwist whatever the shells do
    Vec6 twist = Vec6::Zero();    ///< out: solved twist at the end of the step, to the solve's tolerance
    Vec6 impulse = Vec6::Zero();  ///< out: what the shells gave it, exactly, about its centre of mass [N s, N m s]
    Vec6 motion = Vec6::Zero();   ///< out: how it moves in the step: displacement and rotation vector [m, rad]

    /// Without the stiff terms of its supports.
    Mat6 ownMass() const {
        Mat6 own = mass;
        for (const BodySupport& support : supports) own -= support.weight * support.row * support.row.transpose();
        return own;
    }
    /// Its own, along the axis where it is least [kg].
    double lightest() const { return ownMass().diagonal().head<3>().minCoeff(); }
    /// What those terms add to its momentum when it moves freely.
    Vec6 supportMomentum() const {
        Vec6 sum = Vec6::Zero();
        for (const BodySupport& support : supports) sum += support.weight * support.velocity * support.row;
        return sum;
    }
};

/// An off-diagonal block of the bodies' common mass matrix: joints, or rigid contacts, make the momentum of one body
/// depend on the twist of another. The whole matrix must be positive definite. Couplings of one pair add up; with a
/// body of prescribed motion they do nothing.
struct BodyCoupling {
    int a = 0, b = 0;          ///< bodies, a != b
    Mat6 mass = Mat6::Zero();  ///< M_ab: body a has momentum M_ab w_b, body b has M_ab^T w_a
};

/// A rigid contact between two dynamic bodies of the island, which bore load when the step began, or is closed in it:
/// it keeps rowA . w_a + rowB . w_b from falling below `velocity`, by a stiff term. Or a row of a joint, which keeps it
/// there. Masses and free twists are given without it. A body of prescribed motion must stand still.
struct RigidContact {
    int a = 0, b = 0;          ///< bodies, a != b
    Vec6 rowA = Vec6::Zero();  ///< how fast it opens, from the twist of a
    Vec6 rowB = Vec6::Zero();  ///< and from that of b
    double weight = 0.0;       ///< of the stiff term [kg; kg m^2 about an axis], > 0
    double velocity = 0.0;     ///< with which the two are to part at least [m/s]
    ImpulseRange range{};

    /// Whether the body of that row bears the other one there, rather than lies on it or is beside it. What a joint
    /// holds together bears each other.
    bool bears(const Vec6& row, const Vec3& gravity) const {
        constexpr double kBeside = 0.1;  // cosine of the angle between the contact's normal and gravity
        const double along = row.head<3>().dot(gravity);
        return (range.pulls() ? std::abs(along) : along) > kBeside * gravity.norm();
    }
};

/// Where a piece of a shell meets a body: one vertex (weights 1 0 0), or a point of an edge or triangle.
struct Contact {
    int shell = 0;                  ///< index in the island
    int feature = 0;                ///< id that stays the same while the same piece touches: see `Feature`
    int body = 0;                   ///< index of the body
    std::array<int, 3> vertices{};  ///< of the shell; for a vertex contact all three the same
    Vec3 weights{1, 0, 0};          ///< barycentric, >= 0, sum 1
    Vec3 normal{0, 1, 0};           ///< unit, out of the body
    Vec3 point{0, 0, 0};            ///< on the body's surface [m]
    double gap = 0.0;               ///< signed distance minus contact thickness at the queried configuration [m]
    double friction = 0.0;          ///< Coulomb coefficient of the pair [-]
    double restitution = 0.0;       ///< Newton's coefficient of the pair, 0 to 1 [-]
    double time = 0.0;              ///< of touch, where it was found by sweeping [s]
    bool isVertex() const { return weights.x() == 1.0; }
};

/// A vertex tied to a point of a body.
struct Anchor {
    int shell = 0, vertex = 0, body = 0;
    Vec3 point{0, 0, 0};    ///< where the body has that point at the start of the step [m]
    Vec3 impulse{0, 0, 0};  ///< out: what the vertex gave the body there [N s]
};

/// What a contact did during the step, on the shell; the body got the opposite.
struct ContactImpulse {
    Contact contact;
    Vec3 impulse{0, 0, 0};  ///< [N s]
    bool sticks = false;    ///< friction held it
    Vec3 slip{0, 0, 0};     ///< how the shell slides over the body [m/s]
};

/// Feature ids: vertices, then edges, then triangles of the half-edge mesh.
struct Feature {
    static int vertex(int v) { return v; }
    static int edge(int e, int vertexCount) { return vertexCount + e; }
    static int triangle(int t, int vertexCount, int edgeCount) { return vertexCount + edgeCount + t; }
};

/// Where everything is when contacts are asked for: shells at `positions`, every body moved by `twists` for `time`.
struct ContactPose {
    std::span<const Points* const> positions;  ///< one per shell of the island
    std::span<const Vec6> twists;              ///< one per body
    double time;                               ///< 0 at the start of the step, h at its end [s]
    /// Optional, one per shell: of each of its vertices, from where on it need not be found [m].
    std::span<const double* const> vertexReach{};
};

/// A motion through one step: straight for vertices, with constant twists for bodies.
struct ContactSweep {
    std::span<const Points*const> start, end;  ///< positions, one per shell of the island [m]
    std::span<const Vec6> twists;              ///< one per body
    std::span<const char> bodies;              ///< one per body: whether to look at it
    double time;                               ///< the step's length [s]
};

/// The collision code, as the solver sees it.
class ContactDetector {
  public:
    virtual ~ContactDetector() = default;
    /// Appends every vertex contact whose gap is at most `vertexReach` [m] at that pose, and every contact of an edge
    /// or triangle whose gap is at most `faceReach` (-infinity: none); at most one contact per feature and body, the
    /// deepest.
    virtual void find(const ContactPose& pose, double vertexReach, double faceReach,
                      std::vector<Contact>& contacts) = 0;
    /// Appends the contacts that vertices, edges and triangles make with these bodies on their way, for bodies that
    /// could have passed a shell between two poses. `gap` is how far that motion brings them together along the normal
    /// until they touch, `normal` and `point` are those of that moment; `time` is when it is.
    virtual void sweep(const ContactSweep&, std::vector<Contact>&) {}
    /// Whether a shell goes through the centre of mass of one of these bodies on that way; of those that have it
    /// inside.
    virtual bool crosses(const ContactSweep&) { return false; }
    /// Bodies have moved by `twists`, one per body, for a time [s]: poses are counted from there on.
    virtual void advance(std::span<const Vec6>, double) {}
};

}  // namespace jacket
