#pragma once
#include <algorithm>
#include <limits>
#include <map>
#include <memory_resource>
#include <set>
#include <tuple>
#include <vector>

#include "jacket/Island.h"
#include "solver/CoupledSystem.h"

namespace jacket {

/// Solved velocities of an island, and what was left over: (b - A v) of every vertex.
struct IslandVelocities {
    const Points& v;
    const Eigen::Matrix<double, 6, Eigen::Dynamic>& w;  ///< dynamic bodies
    const Points& unfiltered;
};

/// About what moving one vertex of a shell strains it by while its neighbours stay [J].
double strainOfPush(const Shell& shell, double by);

/// Decides what contacts do to vertices: which hold (active set), which slide or stick, which become filter entries of
/// a vertex and which soft rows. One step is begin, then writeTo, solve, update until update returns false, then
/// finish.
///
/// A vertex contact is an entry of the filter. A point inside an edge or triangle, a second body on the same vertex,
/// and a body on a pinned vertex become soft rows, made exact by an augmented Lagrangian over the rounds.
class ContactResponse {
  public:
    /// Vertices, of which rounds and iterations cost next to nothing: what rests on friction stays where it is.
    static constexpr int kFew = 64;
    /// How an island is numbered.
    struct Numbering {
        const std::vector<int>& offsets;       ///< of each shell's vertices
        const std::vector<int>& dynamicIndex;  ///< of each body; -1: prescribed
        const std::vector<double>& stepOf;     ///< length of the step as each shell's integrator counts it [s]
        bool isAnyFactored;                    ///< some shell: completely
        bool givesWay;                         ///< false: pushOut would strain some shell
        bool mayBeShorter;                     ///< the step, if fast contacts do not settle soon
        bool isInVain;                         ///< more rounds have settled nothing lately
        double partOfStep;                     ///< that is being solved, of one that is solved in parts
        double pushShare;                      ///< of what usually is taken back of a depth at once
        bool onlyStops;  ///< solved velocities need only keep shells from going deeper than they are
    };
    /// Contacts at the start of the step, and the position alteration y of vertices that stand inside a body.
    /// `expected`: velocities at the end of the step as they would be if the last step's change went on; kept by
    /// reference.
    void begin(const IslandInput& input, const Numbering& numbering, const Points& expected, Points& y);
    /// Turns held vertices and active contacts into constraints and rows.
    void writeTo(CoupledSystem& system);
    /// Reads a solve. True when the active set, a linearisation or friction changed so that another solve is needed.
    /// `rough`: the solve was not to the tolerance.
    bool update(const CoupledSystem& system, const IslandVelocities& solved, const Points& y, int round, bool rough);
    /// What contacts give with these velocities, and nothing else of update.
    void readImpulses(const CoupledSystem& system, const IslandVelocities& solved);
    /// Most negative gap that the last update predicted for the end of the step and that it wanted closed [m].
    double deepestGap() const { return m_deepestGap; }
    /// Whether nothing rests on the contacts and the shells give way: they are then looked at once, after a rough
    /// solve if that is by far cheaper, again only where a contact pulls by much or a vertex ends deep inside a body,
    /// and pushOut does what is left.
    bool isQuick() const { return m_care.rounds <= kAmongWalls.rounds; }
    /// Whether that is so although there are free bodies: rigid contacts bear them.
    bool isQuickForBodies() const { return m_bearsNoBody && isQuick(); }
    /// By what pushOut would move vertices, of which some stay where they are [m].
    const std::pmr::map<int, Vec3>& pushes(const Points& v);
    /// Whether a round is the last one that may be.
    bool isLast(int round) const { return round + 1 >= m_care.rounds; }
    /// Whether anything is near.
    bool hasContacts() const { return !m_touches.empty(); }
    /// Whether some contact bounces.
    bool isAnyBouncy() const;
    /// Moves vertices that end inside a body out of it, after finish. `v`: velocities of all vertices; `impulses`: what
    /// that took is added.
    void pushOut(Points& v, std::vector<ContactImpulse>& impulses);
    /// Contacts that carried an impulse; remembers them for the next step.
    void finish(std::vector<ContactImpulse>& impulses);
    /// Of each body the speed of the fastest vertex that touched it in the last solve, by either velocities, -1: none.
    const std::vector<double>& speedsBeside(const Points& a, const Points& b);
    /// What finish remembers then is not of this body.
    void forget(int body) { m_forgotten.insert(body); }
    double slop() const { return m_vertexSlop; }
    /// Whether shells begin the step deep in bodies that stay where they are, among walls, and what it would take to
    /// lift their vertices there by their depths: what they may gain by being taken out [J].
    bool isAnyTakenOut() const;
    double workOut() const { return m_workOut; }
    bool hasFastBody() const { return m_anyFast; }
    /// How deep the step really ends, < 0: the last round may have looked at nothing but what pulls [m].
    double gapAtEnd(const IslandVelocities& solved, const Points& y);
    /// Whether a body goes through a shell with these velocities. `isUnsure`: to be asked of all bodies.
    bool passes(const IslandVelocities& solved, const Points& y, bool isUnsure);

  private:
    /// Coulomb friction of a contact, as the next solve has it.
    struct Slip {
        bool known = false;       ///< false: no solve has told the normal impulse yet, no friction
        double limit = 0.0;       ///< friction coefficient times normal impulse [N s]
        Vec3 direction{0, 0, 0};  ///< of sliding, unit; 0: not known, friction is then a damping
        double speed = 0.0;       ///< of sliding [m/s]
        Vec3 held{0, 0, 0};       ///< impulse on a sticking soft row, its multiplier [N s]
    };
    /// A contact through the rounds of one step. There are thousands where a sheet comes down: what follows from the
    /// contact is not kept, and small members stand together.
    struct Touch {
        Contact contact;
        Vec3 arm{0, 0, 0};
        double target = 0.0;  ///< least normal velocity relative to the body [m/s]
        double startGap = std::numeric_limits<double>::quiet_NaN();  ///< of a contact as the start found it [m]
        double allowedGap = 0.0;           ///< <= 0: what it stood inside at the start and need not leave at once [m]
        double lambda = 0.0, kappa = 0.0;  ///< soft rows: multiplier [N s] and penalty [kg]
        double missed = 0.0;               ///< by which its multiplier was last raised, if it still aims at that [m/s]
        double between = 0.0;              ///< its target where it is jammed: half way to the other wall [m/s]
        double offset = 0.0;               ///< how far it is kept off the surface for its chords' sake [m]
        double lifted = 0.0;               ///< by how much that grew in this round [m]
        double normalImpulse = 0.0;        ///< < 0: it pulls, and is to be released [N s]
        double pressing = 0.0;             ///< the same where walls that share its vertex may not pull [N s]
        Vec3 impulse{0, 0, 0};             ///< on the shell [N s]
        Vec3 slide{0, 0, 0};               ///< tangential velocity relative to the body in the last solve [m/s]
        Slip slip;
        int dynamicBody = -1;
        int flips = 0;    ///< between sticking and sliding, in this step
        int changes = 0;  ///< how often it was activated or dropped
        bool active = false, sticks = false, isRow = false;
        bool isPlaced = false;   ///< where the end of a solve found it
        bool isVain = false;     ///< its multiplier does not help: others hold it where it is
        bool bothHeld = false;   ///< something holds its vertices, and something else the body: see raiseMultiplier
        bool isPinched = false;  ///< a soft row of vertices that another body holds
        bool bounces = false;    ///< its target is that of restitution
        bool jammed = false;     ///< walls on both sides leave it no room
        bool pressed = false;    ///< a wall faces it: it is not to be kept off the surface
    };
    /// How exactly a step's contacts are settled; what remains is left to the next step.
    struct Care {
        int rounds;   ///< solves, at most
        double pull;  ///< of the largest impulse: a contact that pulls less may stay for the step
    };
    /// Usually 1 to 3 are made; more while a body hits, or bears down on a sheet that lies.
    static constexpr Care kInFull{24, 1e-3};
    /// What is stiff for its mesh passes on what a contact does to all others; its rounds are cheap: see ShellFactor.
    /// So does sheet metal that walls press, and no free body is thrown if it takes long.
    static constexpr Care kAtLength{48, 1e-3};
    static constexpr Care kOfFew{96, 1e-3};  ///< see kFew
    static constexpr Care kAmongWalls{6, 0.02};
    /// Where walls are fast and more does not settle, shorter steps are the quicker way: see StepParts.
    static constexpr Care kInPassing{12, 1e-3};
    /// What a contact's point is moved by, along the normal, at the end of the step.
    struct Push {
        const Contact* contact;
        double by;             ///< at least; < 0: there is room [m]
        double left = 0.0;     ///< gap that remains then [m]
        double impulse = 0.0;  ///< that it took [N s]
    };
    using Key = std::tuple<const void*, const void*, int>;                  ///< shell, body, feature
    using Face = std::tuple<const void*, const void*, std::array<int, 3>>;  ///< shell, body, vertices
    struct Memory {
        double impulse, offset;
        bool sticks;
        Slip slip;
        Vec3 point;
        bool isVertex;
        std::array<int, 3> vertices;
        int heir = -1;  ///< feature of the contact that goes on from it
    };
    /// The contacts that share one vertex's filter entry: up to three normals, against bodies of prescribed motion, or
    /// one against a dynamic body.
    struct VertexFilter {
        int constraint;  ///< index in the system
        int count = 0;
        std::array<int, 3> touches{};
        int friction = -1;  ///< its soft row in the system, where it slides
        int opposite = -1;  ///< a touch from the other side, by a body of prescribed motion too
    };

    static constexpr int kFrictionRounds = 4;     ///< then the lagged friction of the last round stands
    static constexpr double kAlteration = 0.2;    ///< share of a penetration that a step takes back
    static constexpr double kLeastFree = 0.25;    ///< see freeWeights(): what is mostly held is not pushed
    static constexpr double kDeepAtStart = 20.0;  ///< times the slop: what begins deeper in a body leaves it slowly
    static constexpr double kNearEdge = 0.1;  ///< weight of a triangle's corner below which its contact is an edge's
    static constexpr int kMostChanges = 10;   ///< a contact that flips more often than this stays as it is

    static bool isFacing(const Contact& a, const Contact& b) { return a.normal.dot(b.normal) < -0.7; }
    /// Projector on the directions across a normal.
    static Mat3 tangential(const Vec3& n) { return Mat3::Identity() - n * n.transpose(); }
    /// Velocity of a body's point along unit t, from the body's twist.
    static Vec6 rowOf(const Touch& touch, const Vec3& t) {
        Vec6 row;
        row << t, touch.arm.cross(t);
        return row;
    }
    Key keyOf(const Contact& c) const;
    Key keyOf(int shell, int body, int feature) const {
        return {m_input.shells[shell], m_input.bodies[body].key, feature};
    }
    Face faceOf(const Contact& c) const { return {m_input.shells[c.shell], m_input.bodies[c.body].key, c.vertices}; }
    Memory* remembered(const Contact& c);
    void findHeirs();
    bool inherits(const Contact& c, Memory& memory) const;
    Touch makeTouch(const Contact& contact) const;
    void add(const Touch& touch);
    Vec3 carriedOf(int body, const Vec3& arm) const;
    Vec3 carriedOf(const Touch& touch) const { return carriedOf(touch.contact.body, touch.arm); }
    void findChords();
    void place(Touch& touch, const Contact& contact) const;
    Vec3 relativeVelocity(const Touch& touch, const IslandVelocities& solved) const;
    double timeOfTouch(const Touch& touch) const;
    void findFast();
    void sweepAtStart();
    void moveToEnd(const IslandVelocities& solved, const Points& y);
    ContactSweep wayToEnd(std::span<const char> bodies);
    void sweepToEnd();
    void findThrown(const IslandVelocities& solved);
    bool closeFirst(int round);
    bool closePassed(const Contact& contact, int round);
    double findReach();
    void findAtStart(double reach);
    void findGapsAtStart();
    void findRoomBesideFaces();
    void findComing();
    void findEmbedded();
    bool isHeldDeep(const Contact& contact) const;
    bool mayHangInside(const Contact& contact) const;
    bool wasAnyEmbedded() const;
    bool wasEmbedded(const Contact& contact, int vertex) const;
    void findLeaving();
    void rememberEmbedded();
    bool isHeldInside(const Contact& contact) const;
    void dropHeldInside();
    void findBesideHeld();
    bool mayBeBacked() const;
    void findBacked();
    bool isAnySqueezed();
    bool isBacked(const Contact& contact) const;
    bool hasSurfaces() const;
    bool isSurface(const Contact& contact) const;
    bool isLed(int body) const;
    bool isTakenOut(int body) const;
    void findSlack();
    double slackAt(const Contact& contact) const;
    bool leavesSlowly(const Contact& contact) const;
    double shareTakenBack(const Contact& contact) const;
    double speedOutOf(double depth, const Touch& touch) const;
    void dropPassed();
    static bool isBeside(const Contact& contact, const Contact& face);
    double slopOf(const Contact& contact) const;
    void addAtStart(const Contact& contact, Points& y);
    bool isRather(const Touch& touch, const Touch& other, const Memory* memory) const;
    void keepEarliest();
    void alter(Touch& touch, Points& y);
    void holdVertices();
    bool joinFilter(int touch);
    void jam(Touch& touch, const Touch& other) const;
    void findJams();
    void finishFilter(VertexFilter& filter, VertexConstraint& constraint);
    SoftRow makeRow(Touch& touch, const CoupledSystem& system) const;
    bool isBetweenBodies(const Touch& touch) const;
    bool isWedged(const Touch& touch) const;
    double pinchedMass(const CoupledSystem& system, const Touch& touch) const;
    void findRowsByVertex();
    double massBetween(const Touch& touch, const Touch& other) const;
    bool hasTakenVertex(const Touch& row) const;
    bool mayYield(const Touch& touch) const;
    double pressedMass(const Touch& touch) const;
    double vertexStiffness(const CoupledSystem& system, const Touch& touch) const;
    void letGo(Touch& touch) const;
    bool releasePulling(int round);
    void raiseMultiplier(Touch& touch) const;
    double leavingSpeed(const Touch& touch) const;
    bool bounce(const IslandVelocities& solved);
    void addFriction(const Touch& touch, Mat3& damping, Vec3& load) const;
    bool updateFriction(const CoupledSystem& system);
    bool updateFrictionQuickly(bool rough);
    bool loosenExcess(const CoupledSystem& system);
    static void slideFrom(Touch& touch, const Vec3& held, double stiffness);
    /// Coulomb's [N s].
    static double frictionLimit(const Touch& touch) { return touch.contact.friction * std::max(touch.pressing, 0.0); }
    /// What a contact gives besides its normal impulse, and what the solve left over there [N s].
    static Vec3 heldBy(const Touch& touch) { return touch.impulse - touch.pressing * touch.contact.normal; }
    bool updateQuickly(const IslandVelocities& solved, const Points& y, int round, bool rough);
    bool closeFound(const IslandVelocities& solved, int round);
    bool isAnyDeep() const;
    bool isAnyStuck() const;
    bool isMuchUnmet() const;
    double missing(const Contact& contact, int touch) const;
    Vec3 armAtEnd(const Contact& contact) const;
    void relaxDamping();
    static void dropFriction(Touch& touch);
    void dropExcessFriction();
    double updateSticking(Touch& touch, double matters, double stiffness) const;
    double updateSliding(Touch& touch, double matters, double stiffness) const;
    static double bodyInertia(const Mat6& mass, const Touch& touch, const Vec3& t);
    bool wouldTurn(const Touch& touch, double limit, double stiffness) const;
    void updateCreeping(Touch& touch) const;
    bool creeps(const Touch& touch) const { return isQuick() && touch.slip.known && touch.slide.norm() <= m_creep; }
    double slowest() const { return 1e-3 * m_input.h * std::max(m_input.gravity.norm(), 1e-3); }
    /// Where there is no gravity, of one that would take shells out of bodies in a while [N].
    double weightOf(double mass) const { return mass * std::max(m_input.gravity.norm(), 1.0); }
    bool hasFreeBodies() const;
    bool isAmongWalls() const;
    bool areBorneByOthers();
    bool isAnyStiff() const;
    double creepSpeed() const;
    void findAtEnd(const IslandVelocities& solved, const Points& y);
    void findPushes(const Points& v);
    double gapBefore(const Touch& touch) const;
    Vec3 sinceFound(const Contact& contact, int corner, const Points& v) const;
    bool push(Push& one);
    bool isHeld(const Contact& contact) const;
    double freeWeights(const Contact& contact) const;
    bool checkEnd(const IslandVelocities& solved, const Points& y, int round);
    int touchOf(const Contact& contact) const;
    int touchAtVertex(const Contact& contact, int corner) const;
    bool isSaidByVertex(const Contact& contact) const;
    bool isForVertices(const Contact& contact, const IslandVelocities& solved) const;
    bool closeAtEnd(const Contact& contact, const IslandVelocities& solved, int round);
    void aim(Touch& touch, double lacks, const IslandVelocities& solved) const;
    bool entersThere(const Contact& contact, const Touch& touch, const IslandVelocities& solved) const;
    void putDown(const Contact& contact);
    bool liftVertices(const Contact& contact, double by, const IslandVelocities& solved);
    double endGap(const Touch& touch, const IslandVelocities& solved) const;
    int globalVertex(const Contact& c, int corner) const { return m_offsets[c.shell] + c.vertices[corner]; }

    std::pmr::unsynchronized_pool_resource m_pool;  ///< what a step gives back, the next one takes
    IslandInput m_input;
    const Points *m_expected = nullptr, *m_y = nullptr;
    std::vector<int> m_offsets, m_dynamicIndex;
    std::vector<double> m_stepOf;
    std::vector<Touch> m_touches;
    std::pmr::map<Key, int> m_index{&m_pool};
    std::pmr::map<Key, Memory> m_memory{&m_pool};
    double m_memoryStep = 0.0;
    std::vector<char> m_held;              ///< pinned or anchored
    std::vector<char> m_besideHeld;        ///< see findBesideHeld
    std::vector<double> m_reach;           ///< of each vertex: see findReach [m]
    std::vector<const double*> m_reachOf;  ///< where that of each shell begins
    std::vector<double> m_edge;            ///< mean edge length of each shell [m]
    std::vector<Points> m_end;             ///< where the solved motion ends, of each shell
    std::vector<Vec6> m_endTwists;         ///< of each body
    std::vector<char> m_fast;              ///< per body: may pass a shell within the step
    std::vector<char> m_mayCross;          ///< per body: see passes
    std::vector<char> m_comes;             ///< per body: see findComing
    bool m_anyFast = false;
    std::vector<double> m_gapAtStart;  ///< per body: of what stands deepest in it then, 0: nothing [m]
    std::vector<char> m_stiff;         ///< per shell: has pins and is stiff as a whole, beside free bodies
    bool m_onlyStops = false;          ///< see Numbering
    double m_partOfStep = 1.0;         ///< see Numbering
    std::vector<double> m_slack;       ///< of vertices: see findSlack; none: nothing is taken out of bodies
    double m_pushShare = 1.0;          ///< see Numbering
    double m_workOut = 0.0;            ///< see workOut [J]
    std::vector<Contact> m_found;
    std::pmr::map<int, double> m_room{&m_pool};              ///< of vertices: see findRoomBesideFaces [m]
    std::pmr::set<std::pair<int, int>> m_backed{&m_pool};    ///< (vertex, free body): see findBacked
    std::pmr::set<std::pair<int, int>> m_tied{&m_pool};      ///< (vertex, body): anchored to it
    std::pmr::set<std::pair<int, int>> m_embedded{&m_pool};  ///< (vertex, body): see findEmbedded
    std::pmr::set<Face> m_leaving{&m_pool};                  ///< see findLeaving
    std::pmr::set<Face> m_leavingBefore{&m_pool};            ///< the same of the last step
    std::pmr::set<Key> m_embeddedBefore{&m_pool};            ///< with features of vertices
    std::pmr::map<int, Vec3> m_raised{
        &m_pool};  ///< by what their own contacts take vertices out of bodies in this round [m]
    std::pmr::set<int> m_claimed{&m_pool};    ///< vertices of the soft rows that this round has added
    std::pmr::set<int> m_forgotten{&m_pool};  ///< bodies
    Care m_care = kInFull;
    double m_vertexSlop = 0.0, m_faceSlop = 0.0, m_deepestGap = 0.0;
    bool m_bearsNoBody = false;  ///< while there are free ones
    double m_creep = 0.0;  ///< sliding speed below which friction may hold less than its limit, where isQuick() [m/s]
    int m_frictionRounds = 0, m_mostFrictionRounds = 0;
    std::vector<VertexFilter> m_filters;
    std::vector<int> m_filterOf;  ///< per vertex, -1: none
    std::vector<VertexConstraint> m_constraints;
    std::vector<SoftRow> m_rows;
    std::pmr::multimap<int, const Touch*> m_rowsByVertex{&m_pool};
    std::vector<Touch*> m_rowsAtWalls;  ///< soft rows of prescribed bodies: see findJams
    std::vector<Push> m_pushes;
    std::pmr::map<int, Vec3> m_pushed{&m_pool};           ///< by what pushOut has moved vertices [m]
    std::vector<const Points*> m_startPoses, m_endPoses;  ///< of each shell
    std::vector<Vec6> m_still;                            ///< twists of bodies that do not move
    std::vector<double> m_speeds;                         ///< of each body: see speedsBeside [m/s]
    std::vector<double> m_earliest;                       ///< of each body: see keepEarliest [s]
    std::vector<Mat3> m_chords;                           ///< of each prescribed body: see chordsOf [1/s]
};

}  // namespace jacket
