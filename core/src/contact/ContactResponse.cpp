#include "contact/ContactResponse.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "Room.h"
#include "solver/BodySupports.h"

namespace jacket {
namespace {

constexpr double kNone = -std::numeric_limits<double>::infinity();
constexpr double kRowPenalty = 10.0;  // penalty of a soft row over the stiffness of its vertices: a round leaves < 1/10
constexpr double kOffsetDecay = 0.998;     // a step: a lift that is no longer needed goes away
constexpr int kFrictionRoundsGoingOn = 2;  // the same where few are made and contacts are not new
constexpr double kSameContact = 0.3;       // of an edge: how far the point of a face's contact may move in a step

using Normals = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>;
using Shares = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;

double lengthOf(const HalfEdgeMesh::Edge& edge, const Points& x) {
    return (x.col(edge.v0) - x.col(edge.v1)).norm();
}

/// What each of up to three normals takes of an impulse, by least squares.
Shares sharesOf(const Vec3& impulse, const Normals& normals) {
    using Gram = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;
    return Gram(normals.transpose() * normals).fullPivLu().solve(normals.transpose() * impulse);
}

/// The same where none may pull. Of two walls that face nearly the same way one may push by much what the other pulls:
/// neither is what friction hangs on. `shares`: as above.
Shares pushingSharesOf(const Vec3& impulse, const Normals& normals, const Shares& shares) {
    if (normals.cols() == 1) return shares;
    Shares result = shares;
    Normals left = normals;
    for (Eigen::Index k; result.minCoeff(&k) < 0.0; result = sharesOf(impulse, left)) left.col(k).setZero();
    return result;
}

}  // namespace

double strainOfPush(const Shell& shell, double by) {
    constexpr double kNeighbourhood = 4.0;  // stiffness against moving one vertex alone, in E t
    return 0.5 * kNeighbourhood * shell.material().stretchStiffness() * by * by;
}

/// Near an edge the contacts of both its triangles are one, the edge's: a body that rolls over it keeps its contact.
ContactResponse::Key ContactResponse::keyOf(const Contact& c) const {
    const Shell& shell = *m_input.shells[c.shell];
    const HalfEdgeMesh& mesh = shell.mesh();
    int feature = c.feature, corner = 0;
    const int firstTriangle = Feature::triangle(0, mesh.vertexCount(), static_cast<int>(mesh.edges().size()));
    if (!c.isVertex() && feature >= firstTriangle && c.weights.minCoeff(&corner) < kNearEdge)
        feature = Feature::edge(mesh.edgeOf(3 * (feature - firstTriangle) + (corner + 1) % 3), mesh.vertexCount());
    return keyOf(c.shell, c.body, feature);
}

/// What the last step knew of a contact. A point of a face may have moved to a neighbouring one since.
ContactResponse::Memory* ContactResponse::remembered(const Contact& c) {
    const Key key = keyOf(c);
    if (const auto known = m_memory.find(key); known != m_memory.end()) return &known->second;
    if (c.isVertex()) return nullptr;
    Memory* nearest = nullptr;
    double least = kSameContact * m_edge[c.shell];
    const HalfEdgeMesh& mesh = m_input.shells[c.shell]->mesh();
    const auto& [shell, body, feature] = key;
    const auto first = m_memory.lower_bound({shell, body, Feature::edge(0, mesh.vertexCount())});
    for (auto other = first; other != m_memory.end(); ++other) {
        if (std::get<0>(other->first) != shell || std::get<1>(other->first) != body) break;
        if (other->second.isVertex) break;  // beyond the faces: vertices between walls
        const double distance = (other->second.point - c.point).norm();
        if (distance >= least) continue;
        least = distance;
        nearest = &other->second;
    }
    return nearest;
}

/// Of the faces' contacts that have been found again.
void ContactResponse::findHeirs() {
    for (auto& [key, memory] : m_memory) memory.heir = -1;
    for (const Contact& contact : m_found) {
        if (contact.isVertex()) continue;
        if (const auto known = m_memory.find(keyOf(contact)); known != m_memory.end()) inherits(contact, known->second);
    }
}

/// Whether a contact is the one that goes on from what is remembered; others near it only know of its friction. All
/// held because one was, they would pull, and letting them go takes rounds in which those that bear are lost.
bool ContactResponse::inherits(const Contact& c, Memory& memory) const {
    const int feature = std::get<2>(keyOf(c));
    if (memory.heir < 0) memory.heir = feature;
    return memory.heir == feature;
}

void ContactResponse::place(Touch& touch, const Contact& contact) const {
    const CoupledBody& body = m_input.bodies[contact.body];
    Vec3 point = Vec3::Zero();
    for (int a = 0; a < 3; ++a)
        point += contact.weights[a] * m_input.shells[contact.shell]->positions().col(contact.vertices[a]);
    touch.contact = contact;
    touch.arm = point - body.position;
    touch.dynamicBody = m_dynamicIndex[contact.body];
}

/// Mean velocity in the step of what a prescribed body has there, 0 of others: along the chord of its way, as what goes
/// along the tangents in every step leaves a body that turns [m/s].
Vec3 ContactResponse::carriedOf(int body, const Vec3& arm) const {
    if (!m_input.bodies[body].prescribed) return Vec3::Zero();
    return m_input.bodies[body].freeTwist.head<3>() + m_chords[body] * arm;
}

void ContactResponse::findChords() {
    m_chords.assign(m_input.bodies.size(), Mat3::Zero());
    for (std::size_t b = 0; b < m_chords.size(); ++b)
        if (m_input.bodies[b].prescribed) m_chords[b] = chordsOf(m_input.bodies[b].freeTwist.tail<3>(), m_input.h);
}

ContactResponse::Touch ContactResponse::makeTouch(const Contact& contact) const {
    Touch touch;
    place(touch, contact);
    return touch;  // frictionless at first: its normal impulse is not known yet
}

void ContactResponse::add(const Touch& touch) {
    makeRoom(m_touches);
    m_touches.push_back(touch);
}

void ContactResponse::begin(const IslandInput& input, const Numbering& numbering, const Points& expected, Points& y) {
    m_input = input;
    m_expected = &expected;
    m_y = &y;
    m_offsets = numbering.offsets;
    m_dynamicIndex = numbering.dynamicIndex;
    m_stepOf = numbering.stepOf;
    m_touches.clear();
    m_index.clear();
    m_forgotten.clear();
    m_deepestGap = m_workOut = 0.0;
    m_frictionRounds = 0;
    m_mostFrictionRounds = m_memory.empty() ? kFrictionRounds : kFrictionRoundsGoingOn;
    m_anyFast = false;
    m_onlyStops = numbering.onlyStops;
    m_partOfStep = numbering.partOfStep;
    m_pushShare = numbering.pushShare;
    m_held.assign(y.cols(), 0);
    m_filters.clear();
    m_filterOf.assign(y.cols(), -1);
    m_edge.clear();
    double shortest = 1e300;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        for (int i = 0; i < shell.vertexCount(); ++i) m_held[m_offsets[k] + i] = shell.isPinned(i) || shell.isGuided(i);
        m_edge.push_back(shell.meanEdge());
        shortest = std::min(shortest, m_edge.back());
    }
    m_tied.clear();
    for (const auto& anchor : input.anchors) {
        const int vertex = m_offsets[anchor.shell] + anchor.vertex;
        m_held[vertex] = 1;
        m_tied.insert({vertex, anchor.body});
    }
    findChords();
    m_bearsNoBody = false;
    if (!input.contacts) return;

    findBesideHeld();
    m_creep = creepSpeed();
    m_vertexSlop = std::min(5e-5, 1e-3 * shortest);
    m_faceSlop = std::min(2e-4, 1e-2 * shortest);
    m_startPoses.clear();
    for (const Shell* shell : input.shells) m_startPoses.push_back(&shell->positions());
    m_still.assign(input.bodies.size(), Vec6::Zero());
    findAtStart(findReach());
    const bool areFew = y.cols() <= kFew;
    const Care alone = areFew ? kOfFew : kAtLength, inFull = hasFreeBodies() ? kInFull : alone;
    m_bearsNoBody = hasFreeBodies() && areBorneByOthers();
    const bool mayBeQuick = !areFew && !isAnyStiff() && numbering.givesWay;
    m_care = mayBeQuick && (isAmongWalls() || m_bearsNoBody) ? kAmongWalls : inFull;
    if (numbering.isAnyFactored || m_onlyStops) m_care = kAtLength;
    dropPassed();
    findRoomBesideFaces();
    findHeirs();
    makeRoomFor(m_found.size(), m_touches);
    for (const Contact& contact : m_found) addAtStart(contact, y);
    findFast();
    if (isQuick() && (isAnyBouncy() || m_anyFast)) m_care = inFull;
    if (m_anyFast) sweepAtStart();
    const bool isInPassing = m_anyFast && numbering.mayBeShorter && !hasFreeBodies() && !isAnyBouncy();
    if (isInPassing || numbering.isInVain) m_care = kInPassing;
    keepEarliest();
}

/// How far off a body each vertex may be and yet come to it in the step, by twice as much as it is known to move now;
/// the farthest of all [m]. What comes from farther off is found where it ends.
double ContactResponse::findReach() {
    double speed = 0.0, most = 0.0;
    for (const auto& body : m_input.bodies)
        speed = std::max(speed, body.freeTwist.head<3>().norm() + body.freeTwist.tail<3>().norm() * body.radius);
    m_reach.resize(m_expected->cols());
    m_reachOf.clear();
    for (std::size_t k = 0; k < m_input.shells.size(); ++k) {
        const Points& v = m_input.shells[k]->velocities();
        double* const reach = m_reach.data() + m_offsets[k];
        m_reachOf.push_back(reach);
        for (int i = 0; i < v.cols(); ++i) {
            const double own =
                std::sqrt(std::max(v.col(i).squaredNorm(), m_expected->col(m_offsets[k] + i).squaredNorm()));
            reach[i] = 2.0 * m_input.h * (own + speed + m_input.h * m_input.gravity.norm()) + 10.0 * m_vertexSlop;
            most = std::max(most, reach[i]);
        }
    }
    return most;
}

/// What is near at the start of the step, into m_found. Faces are looked for where the last step held any, or found any
/// embedded, or a part of this one may have left any inside, and as far as vertices where free bodies meet surfaces, or
/// come: known by walls, by pins everywhere and by stiff shells before anything is found, else by the vertices that
/// are.
void ContactResponse::findAtStart(double reach) {
    const auto find = [&](double faceReach) {
        m_found.clear();
        m_input.contacts->find({m_startPoses, m_still, 0.0, m_reachOf}, reach, faceReach, m_found);
        findEmbedded();
        dropHeldInside();
    };
    m_found.clear();
    m_backed.clear();
    m_stiff.clear();
    for (const Shell* shell : m_input.shells)
        m_stiff.push_back(hasFreeBodies() && shell->pinCount() > 0 && shell->isStiffAsAWhole(m_input.h));
    const bool areSurfaces = mayBeBacked() || hasSurfaces();
    const bool wantsFaces = !m_memory.empty() || wasAnyEmbedded() || m_partOfStep < 1.0;
    find(areSurfaces ? reach : wantsFaces ? 10.0 * m_vertexSlop : kNone);
    findComing();
    const bool isAnyComing = std::find(m_comes.begin(), m_comes.end(), 1) != m_comes.end();
    const bool isBesidePin = !areSurfaces && mayBeBacked();
    if (!areSurfaces && (isBesidePin || isAnyComing)) find(reach);
    if (areSurfaces || isBesidePin) findBacked();
    findGapsAtStart();
    m_slack.clear();
    findLeaving();
    if (!isAnyTakenOut()) return;
    findSlack();
    if (wantsFaces) return;
    find(10.0 * m_vertexSlop);
    findGapsAtStart();
}

/// Of each vertex how far its edges are from being strained by as much as taking shells out of bodies may bring about:
/// as if all of the shell were, and had its energy from a fall as deep as it is wide. What stands on both sides of a
/// body's middle would else be pulled apart, until it snaps.
void ContactResponse::findSlack() {
    constexpr double kMostStrain = 0.05;
    m_slack.assign(m_expected->cols(), 1.0);
    for (std::size_t k = 0; k < m_input.shells.size(); ++k) {
        const Shell& shell = *m_input.shells[k];
        const double ofFall = shell.material().areaDensity() * weightOf(1.0) * shell.side();
        const double most = std::min(kMostStrain, std::sqrt(2.0 * ofFall / shell.material().stretchStiffness()));
        for (const HalfEdgeMesh::Edge& edge : shell.mesh().edges()) {
            const double strain = lengthOf(edge, shell.positions()) / lengthOf(edge, shell.restPositions()) - 1.0;
            for (const int vertex : {edge.v0, edge.v1}) {
                double& slack = m_slack[m_offsets[k] + vertex];
                slack = std::clamp(1.0 - strain / most, 0.0, slack);
            }
        }
    }
}

double ContactResponse::slackAt(const Contact& contact) const {
    double least = 1.0;
    for (int a = 0; a < (contact.isVertex() ? 1 : 3) && !m_slack.empty(); ++a)
        least = std::min(least, m_slack[globalVertex(contact, a)]);
    return least;
}

/// The deepest of each body; of a free one also what cannot be moved out of it.
void ContactResponse::findGapsAtStart() {
    m_gapAtStart.assign(m_input.bodies.size(), 0.0);
    for (const Contact& contact : m_found)
        if (m_dynamicIndex[contact.body] >= 0 || freeWeights(contact) > kLeastFree)
            m_gapAtStart[contact.body] = std::min(m_gapAtStart[contact.body], contact.gap);
}

bool ContactResponse::hasFreeBodies() const {
    return std::any_of(m_dynamicIndex.begin(), m_dynamicIndex.end(), [](int body) { return body >= 0; });
}

/// Whether rigid contacts bear every free body, none is lighter than the shells, and no shell bears one, nor stands in
/// its way by what is held, by a pin or by another body. Among walls that stand still.
bool ContactResponse::areBorneByOthers() {
    const double mass = m_input.shellMass();
    const auto isBorne = [&](int b) {
        return !m_input.bodies[b].supports.empty() ||
               std::any_of(m_input.rigidContacts.begin(), m_input.rigidContacts.end(),
                           [b](const RigidContact& pair) { return pair.a == b || pair.b == b; });
    };
    for (int b = 0; b < std::ssize(m_input.bodies); ++b) {
        const CoupledBody& body = m_input.bodies[b];
        if (body.prescribed ? isLed(b) : !isBorne(b) || body.lightest() < mass) return false;
    }
    const auto isInTheWay = [&](const Contact& contact) {
        return !m_input.bodies[contact.body].prescribed && (isUnderBody(contact, m_input.gravity) || isHeld(contact));
    };
    return std::none_of(m_found.begin(), m_found.end(), isInTheWay) && !isAnySqueezed();
}

/// Whether nothing rests on the contacts or is thrown by them, and nothing squeezes a shell.
bool ContactResponse::isAmongWalls() const {
    if (m_input.bodies.size() == 1) return m_input.bodies[0].prescribed;
    return std::all_of(m_input.bodies.begin(), m_input.bodies.end(),
                       [](const CoupledBody& b) { return b.prescribed && b.freeTwist.isZero(0.0); });
}

/// A shell that is stiff as a whole does not give way to being pushed out, but is thrown by it.
bool ContactResponse::isAnyStiff() const {
    return std::any_of(m_input.shells.begin(), m_input.shells.end(),
                       [&](const Shell* shell) { return shell->isStiffAsAWhole(m_input.h); });
}

/// A fifth of what a shell may creep that is held by friction, 1e-4 sqrt(g L), L: the side of a square of its size.
double ContactResponse::creepSpeed() const {
    double least = std::numeric_limits<double>::infinity();
    for (const Shell* shell : m_input.shells) least = std::min(least, shell->side());
    return 2e-5 * std::sqrt(std::max(m_input.gravity.norm(), 1e-3) * least);
}

void ContactResponse::addAtStart(const Contact& contact, Points& y) {
    Memory* const memory = remembered(contact);
    if (!contact.isVertex() && !memory && !isSurface(contact) && !m_comes[contact.body])
        return;  // found at the end of the step if it matters
    Touch touch = makeTouch(contact);
    touch.startGap = contact.gap;
    if (memory && memory->offset > 0.0) {
        const auto faces = m_room.find(globalVertex(contact, 0));
        const double most = faces == m_room.end() ? std::numeric_limits<double>::infinity() : faces->second;
        touch.offset = memory->offset - std::clamp((1.0 - kOffsetDecay) * memory->offset, 0.0, std::max(0.0, most));
        if (m_onlyStops) touch.offset = std::clamp(contact.gap, 0.0, touch.offset);
    }
    touch.contact.gap -= touch.offset;
    touch.target = -std::max(touch.contact.gap, 0.0) / m_input.h;
    touch.allowedGap = std::min(touch.contact.gap, 0.0);
    touch.active = timeOfTouch(touch) <= m_input.h;
    if (memory) {
        const double scale = m_input.h / m_memoryStep;
        touch.lambda = memory->impulse * scale;
        touch.sticks = memory->sticks && !isQuick();
        touch.slip = memory->slip;
        touch.slip.limit *= scale;
        touch.slip.held = tangential(touch.contact.normal) * touch.slip.held * scale;
        const double near = inherits(contact, *memory) ? 10.0 * m_vertexSlop : m_vertexSlop;
        touch.active = touch.active || (memory->impulse > 0.0 && touch.contact.gap < near);
    }
    const auto [known, fresh] = m_index.try_emplace(keyOf(contact), static_cast<int>(m_touches.size()));
    if (!fresh && !isRather(touch, m_touches[known->second], memory)) return;
    if (touch.contact.gap < 0.0) alter(touch, y);
    if (fresh)
        add(touch);
    else
        m_touches[known->second] = touch;
}

/// Of two contacts of one key: the deeper, but the one of the last step if that is nearly as deep. A body that rests in
/// a fold would else be pushed by its two sides in turn for ever.
bool ContactResponse::isRather(const Touch& touch, const Touch& other, const Memory* memory) const {
    double lead = 0.0;
    if (memory && touch.contact.vertices == memory->vertices) lead += m_faceSlop;
    if (memory && other.contact.vertices == memory->vertices) lead -= m_faceSlop;
    return touch.contact.gap < other.contact.gap + lead;
}

/// Per vertex the least gap of the faces and edges around it that have been found: as far as it may come down.
void ContactResponse::findRoomBesideFaces() {
    m_room.clear();
    for (const Contact& contact : m_found) {
        if (contact.isVertex()) continue;
        for (int a = 0; a < 3; ++a) {
            const auto [known, fresh] = m_room.try_emplace(globalVertex(contact, a), contact.gap);
            if (!fresh) known->second = std::min(known->second, contact.gap);
        }
    }
}

/// Free bodies that will touch a vertex of a shell with pins in this step and touched nothing in the last. A ball that
/// comes down on a triangle meets it before its corners, which would throw it aside. (What is free itself goes along
/// with what hits it, by one corner as well as by all; and fingers close on it from both sides.)
void ContactResponse::findComing() {
    m_comes.assign(m_input.bodies.size(), 0);
    if (!hasFreeBodies()) return;
    for (const Contact& contact : m_found)
        if (contact.isVertex() && m_dynamicIndex[contact.body] >= 0 && !m_comes[contact.body] &&
            m_input.shells[contact.shell]->pinCount() > 0)
            m_comes[contact.body] = timeOfTouch(makeTouch(contact)) <= m_input.h;
    for (std::size_t b = 0; b < m_comes.size(); ++b) {
        const auto isOf = [&](const auto& known) { return std::get<1>(known.first) == m_input.bodies[b].key; };
        if (m_comes[b] && std::any_of(m_memory.begin(), m_memory.end(), isOf)) m_comes[b] = 0;
    }
}

/// Whether its user moves it, whatever is in its way.
bool ContactResponse::isLed(int body) const {
    return m_input.bodies[body].prescribed && !m_input.bodies[body].freeTwist.isZero(0.0);
}

/// Whether the shells begin the step deep in a body that stays where it is, among walls: they are taken out of it
/// little by little, and their faces are not to leave it at once.
bool ContactResponse::isTakenOut(int body) const {
    return m_gapAtStart[body] < -kDeepAtStart * m_vertexSlop && !hasFreeBodies() && !isLed(body);
}

bool ContactResponse::isAnyTakenOut() const {
    for (int b = 0; b < std::ssize(m_gapAtStart); ++b)
        if (isTakenOut(b)) return true;
    return false;
}

/// Of a penetration. Where bodies are free the parts of a step take back as much together as a whole one: as much in
/// each of them, in its short time, would throw the bodies, and strain what lies between them. What a body that its
/// user moves has gone into is taken back sooner, for it goes on; and so is sheet metal, which each part that it stays
/// inside strains.
double ContactResponse::shareTakenBack(const Contact& contact) const {
    const bool isPart = m_partOfStep < 1.0 && (hasFreeBodies() || isTakenOut(contact.body)) && !isLed(contact.body);
    const double share = m_pushShare * slackAt(contact) * kAlteration;
    if (!isPart || m_input.shells[contact.shell]->isStiffAsAWhole(m_input.h / m_partOfStep)) return share;
    return 1.0 - std::pow(1.0 - share, m_partOfStep);
}

/// With which a free body leaves a surface that it stands inside and that cannot give way [m/s]: in steps that take
/// back a share of the depth, and never so fast that it would rise above the surface.
double ContactResponse::speedOutOf(double depth, const Touch& touch) const {
    if (isWedged(touch)) return 0.0;
    return std::min(shareTakenBack(touch.contact) * depth / m_input.h,
                    std::sqrt(std::max(m_input.gravity.norm(), 1e-3) * depth));
}

/// Takes out of what was found the vertices and edges that a free body cannot move, and beside which it is nearer to a
/// face, another way: not there do they touch. A ball that has rolled over them would be pushed on by them, and one
/// that comes to them would be held back. Where a sheet gives way it follows the body, and its vertices bear.
void ContactResponse::dropPassed() {
    if (!hasSurfaces()) return;
    std::pmr::multimap<std::pair<int, int>, const Contact*> faces(&m_pool);  // of vertex and body
    for (const Contact& contact : m_found)
        for (int a = 0; a < 3 && !contact.isVertex(); ++a)
            faces.emplace(std::pair(globalVertex(contact, a), contact.body), &contact);
    const auto isPassed = [&](const Contact& contact) {
        Eigen::Index corner = 0;
        contact.weights.maxCoeff(&corner);
        const auto [first, last] = faces.equal_range({globalVertex(contact, int(corner)), contact.body});
        return std::any_of(first, last, [&](const auto& face) { return isBeside(contact, *face.second); });
    };
    std::pmr::vector<char> drops(&m_pool);
    for (const Contact& contact : m_found) drops.push_back(isSurface(contact) && isPassed(contact));
    std::erase_if(m_found, [&](const Contact& contact) { return drops[&contact - m_found.data()] != 0; });
}

/// Whether a face that has all vertices of a contact is nearer than this, another way.
bool ContactResponse::isBeside(const Contact& contact, const Contact& face) {
    constexpr double kNearer = 1e-8;   // what is nearer by less is as near [m]
    constexpr double kSameWay = 1e-9;  // 1 less the cosine of the angle below which normals are the same
    if (face.gap >= contact.gap - kNearer || face.normal.dot(contact.normal) > 1.0 - kSameWay) return false;
    for (int a = 0; a < 3; ++a)
        if (contact.weights[a] > 0.0 &&
            std::count(face.vertices.begin(), face.vertices.end(), contact.vertices[a]) == 0)
            return false;
    return true;
}

double ContactResponse::slopOf(const Contact& contact) const {
    return contact.isVertex() || isSurface(contact) ? m_vertexSlop : m_faceSlop;
}

/// Bodies that move farther relative to some vertex than they are thick, or free ones half as far: from inside them the
/// nearest surface may already be another than the one that hit it, and they would be pushed on through the shell.
void ContactResponse::findFast() {
    m_fast.assign(m_input.bodies.size(), 0);
    m_anyFast = false;
    for (std::size_t b = 0; b < m_input.bodies.size(); ++b) {
        const CoupledBody& body = m_input.bodies[b];
        const double spin = body.freeTwist.tail<3>().norm();
        const double spun = spin > 0.0 ? spin * m_input.h * body.radius : 0.0;  // a plane's radius is infinite
        const double far = std::max(0.0, (body.prescribed ? 1.0 : 0.5) * body.inner - spun);
        const double least = std::pow(far / m_input.h, 2);
        for (int i = 0; i < m_expected->cols() && !m_fast[b]; ++i)
            m_fast[b] = (m_expected->col(i) - body.freeTwist.head<3>()).squaredNorm() > least;
        m_anyFast = m_anyFast || m_fast[b];
    }
}

/// Contacts that only the motion of the step shows.
void ContactResponse::sweepAtStart() {
    m_end.resize(m_input.shells.size());
    for (std::size_t k = 0; k < m_input.shells.size(); ++k) {
        const Points& x = m_input.shells[k]->positions();
        m_end[k] = x + m_input.h * m_expected->middleCols(m_offsets[k], x.cols());
    }
    m_endTwists.clear();
    for (const CoupledBody& body : m_input.bodies) m_endTwists.push_back(body.freeTwist);
    sweepToEnd();
    for (const Contact& contact : m_found) {
        const auto [known, fresh] = m_index.try_emplace(keyOf(contact), static_cast<int>(m_touches.size()));
        if (!fresh) continue;
        Touch touch = makeTouch(contact);
        touch.target = -contact.gap / m_input.h;
        touch.active = true;
        add(touch);
    }
}

/// The first vertices to meet a free body will slow it down, and the others may never come to touch it: held all
/// together they would be dragged to its surface, and a light body thrown about. Those that do touch are found in later
/// rounds.
void ContactResponse::keepEarliest() {
    m_earliest.assign(m_input.bodies.size(), 2.0 * m_input.h);
    const auto isRemembered = [&](const Touch& t) { return remembered(t.contact) != nullptr; };
    for (const Touch& touch : m_touches)
        if (touch.active && touch.dynamicBody >= 0)
            m_earliest[touch.contact.body] =
                std::min(m_earliest[touch.contact.body], isRemembered(touch) ? 0.0 : timeOfTouch(touch));
    for (Touch& touch : m_touches)
        if (touch.active && touch.dynamicBody >= 0 && !isRemembered(touch))
            touch.active = timeOfTouch(touch) <= m_earliest[touch.contact.body] + 0.02 * m_input.h;
}

/// When a contact closes if nothing else happens, from the start of the step; infinite if it does not [s].
double ContactResponse::timeOfTouch(const Touch& touch) const {
    if (touch.contact.time > 0.0) return touch.contact.time;
    const CoupledBody& body = m_input.bodies[touch.contact.body];
    Vec3 velocity = -pointVelocity(body.freeTwist, touch.arm);
    for (int a = 0; a < 3; ++a) velocity += touch.contact.weights[a] * m_expected->col(globalVertex(touch.contact, a));
    const double closing = -velocity.dot(touch.contact.normal);
    return closing > 0.0 ? std::max(touch.contact.gap, 0.0) / closing : std::numeric_limits<double>::infinity();
}

/// What stands inside a body is moved out of it a little; where it cannot be moved by itself, as something holds a
/// corner of it or the body is what must give way, it leaves by its velocity.
void ContactResponse::alter(Touch& touch, Points& y) {
    const Contact& c = touch.contact;
    const bool isHeldThere = isHeld(c);
    if (isBacked(c) || (isHeldThere && !c.isVertex())) {
        touch.target = speedOutOf(-c.gap, touch);
        touch.allowedGap = std::min(0.0, c.gap + m_input.h * touch.target);
        return;
    }
    if (isHeldThere) return;
    const double depth = std::min(-c.gap, m_edge[c.shell]), by = shareTakenBack(c) * depth;
    const double spread = c.weights.squaredNorm();
    for (int a = 0; a < (c.isVertex() ? 1 : 3); ++a) {
        auto column = y.col(globalVertex(c, a));
        const double missing =
            by * c.weights[a] / spread - column.dot(c.normal);  // contacts that share a vertex share y
        if (!(missing > 0.0)) continue;
        column += missing * c.normal;
        if (!isTakenOut(c.body) || by == 0.0) continue;
        const double lifted = std::min(c.weights[a] / spread, missing / by) * depth;  // in the end
        m_workOut += weightOf(m_input.shells[c.shell]->masses()[c.vertices[a]]) * lifted;
    }
    touch.allowedGap = std::min(0.0, c.gap + by);
}

/// Constraints of what is pinned, guided or anchored.
void ContactResponse::holdVertices() {
    m_constraints.clear();
    for (std::size_t k = 0; k < m_input.shells.size(); ++k) {
        const Shell& shell = *m_input.shells[k];
        if (shell.pinCount() == 0) continue;
        for (int i = 0; i < shell.vertexCount(); ++i) {
            if (!shell.isPinned(i) && !shell.isGuided(i)) continue;
            VertexConstraint c{.vertex = m_offsets[k] + i};
            c.free = shell.freedom(i);
            if (shell.isPinned(i))
                c.carried = (shell.pinTarget(i) - shell.positions().col(i) - m_y->col(m_offsets[k] + i)) / m_stepOf[k];
            m_constraints.push_back(c);
        }
    }
    for (const auto& anchor : m_input.anchors) {
        const Shell& shell = *m_input.shells[anchor.shell];
        if (shell.isPinned(anchor.vertex)) continue;
        const CoupledBody& body = m_input.bodies[anchor.body];
        VertexConstraint c{.vertex = m_offsets[anchor.shell] + anchor.vertex, .body = m_dynamicIndex[anchor.body]};
        c.arm = anchor.point - body.position;
        c.z = (anchor.point - shell.positions().col(anchor.vertex)) / m_input.h;
        c.carried = carriedOf(anchor.body, c.arm);
        m_constraints.push_back(c);
    }
}

void ContactResponse::writeTo(CoupledSystem& system) {
    for (const auto& filter : m_filters) m_filterOf[globalVertex(m_touches[filter.touches[0]].contact, 0)] = -1;
    m_filters.clear();
    holdVertices();
    m_rows.clear();
    for (std::size_t i = 0; i < m_touches.size(); ++i) {
        Touch& touch = m_touches[i];
        touch.isRow = touch.active && !joinFilter(static_cast<int>(i));
    }
    findJams();
    findRowsByVertex();
    for (Touch& touch : m_touches)  // after them, as what holds their vertices matters
        if (touch.isRow) m_rows.push_back(makeRow(touch, system));
    for (auto& filter : m_filters) finishFilter(filter, m_constraints[filter.constraint]);
    system.setContacts(m_constraints, m_rows);
}

bool ContactResponse::joinFilter(int index) {
    const Touch& touch = m_touches[index];
    const int vertex = globalVertex(touch.contact, 0);
    if (!touch.contact.isVertex() || m_held[vertex]) return false;
    if (m_filterOf[vertex] < 0) {
        m_filterOf[vertex] = static_cast<int>(m_filters.size());
        m_filters.push_back(
            {.constraint = static_cast<int>(m_constraints.size()), .count = 1, .touches = {index, 0, 0}});
        VertexConstraint c{.vertex = vertex, .body = touch.dynamicBody};
        c.arm = touch.arm;
        c.carried = carriedOf(touch);
        m_constraints.push_back(c);
        return true;
    }
    VertexFilter& filter = m_filters[m_filterOf[vertex]];
    const bool bothPrescribed = touch.dynamicBody < 0 && m_touches[filter.touches[0]].dynamicBody < 0;
    if (!bothPrescribed || filter.count == 3) return false;
    for (int k = 0; k < filter.count; ++k) {  // opposite walls cannot both be met exactly
        if (touch.contact.normal.dot(m_touches[filter.touches[k]].contact.normal) > -0.9) continue;
        if (k > 0 || filter.opposite >= 0) return false;
        filter.opposite = index;
        return true;
    }
    filter.touches[filter.count++] = index;
    return true;
}

/// Whether a wall that faces this contact's leaves it no room. Half way between them is what it is to do then: made
/// exact, the two would push against each other with forces without bound.
void ContactResponse::jam(Touch& touch, const Touch& other) const {
    const Vec3& n = touch.contact.normal;
    if (touch.dynamicBody >= 0 || other.dynamicBody >= 0 || !isFacing(touch.contact, other.contact)) return;
    const double most = -other.target + n.dot(carriedOf(other) - carriedOf(touch));
    if (touch.target <= most) return;
    const double between = 0.5 * (touch.target + most);
    touch.between = touch.jammed ? std::min(touch.between, between) : between;
    touch.jammed = true;
}

/// Soft rows that share vertices with contacts, or are close to rows, from the other side.
void ContactResponse::findJams() {
    constexpr double kClose = 0.6;  // of an edge
    m_rowsAtWalls.clear();
    for (Touch& touch : m_touches) {
        touch.jammed = false;
        if (touch.isRow && touch.dynamicBody < 0) m_rowsAtWalls.push_back(&touch);
    }
    for (Touch* row : m_rowsAtWalls) {
        const Contact& c = row->contact;
        for (int a = 0; a < 3; ++a) {
            const int filter = m_filterOf[globalVertex(c, a)];
            if (c.weights[a] < 1.0 - kClose || filter < 0) continue;
            for (int k = 0; k < m_filters[filter].count; ++k) jam(*row, m_touches[m_filters[filter].touches[k]]);
            if (m_filters[filter].opposite >= 0) jam(*row, m_touches[m_filters[filter].opposite]);
        }
        for (const Touch* other : m_rowsAtWalls)
            if (other->contact.shell == c.shell && (other->contact.point - c.point).norm() < kClose * m_edge[c.shell])
                jam(*row, *other);
    }
}

void ContactResponse::finishFilter(VertexFilter& filter, VertexConstraint& constraint) {
    Touch& first = m_touches[filter.touches[0]];
    if (filter.opposite >= 0) {
        jam(first, m_touches[filter.opposite]);
        m_touches[filter.opposite].jammed = first.jammed;
    }
    if (first.jammed) {  // held fast, with whatever force that takes
        constraint.free.setZero();
        constraint.z = first.between * first.contact.normal;
        return;
    }
    Mat3 held = Mat3::Zero();
    for (int k = 0; k < filter.count; ++k) {
        const Touch& touch = m_touches[filter.touches[k]];
        const Vec3& n = touch.contact.normal;
        const double target = touch.target + n.dot(carriedOf(touch) - carriedOf(first));
        const Vec3 fresh = n - held * n;  // the part of this normal that earlier ones leave open
        const double length2 = fresh.squaredNorm();
        if (length2 < 1e-4) continue;
        constraint.z += fresh * ((target - n.dot(constraint.z)) / length2);
        held += fresh * fresh.transpose() / length2;
    }
    if (first.sticks) {
        constraint.free.setZero();
        return;
    }
    constraint.free = Mat3::Identity() - held;
    constraint.tie = held;
    const int v = constraint.vertex;
    SoftRow friction{{v, v, v}, Vec3::UnitX(), constraint.body, constraint.arm, constraint.carried};
    for (int k = 0; k < filter.count; ++k) addFriction(m_touches[filter.touches[k]], friction.stiffness, friction.load);
    friction.stiffness = (constraint.free * friction.stiffness * constraint.free).eval();
    friction.load = (constraint.free * friction.load).eval();
    if (friction.stiffness.isZero(0.0) && friction.load.isZero(0.0)) return;
    filter.friction = static_cast<int>(m_rows.size());
    m_rows.push_back(friction);
}

double ContactResponse::vertexStiffness(const CoupledSystem& system, const Touch& touch) const {
    const auto& part = system.shells()[touch.contact.shell];
    const Vec3& n = touch.contact.normal;
    double sum = 0.0;
    for (int a = 0; a < 3; ++a)
        sum += touch.contact.weights[a] * n.dot(part.matrix->diagonal()[touch.contact.vertices[a]] * n);
    return sum;
}

SoftRow ContactResponse::makeRow(Touch& touch, const CoupledSystem& system) const {
    const Contact& c = touch.contact;
    const double pinched = pinchedMass(system, touch);
    touch.kappa = kRowPenalty * std::max({vertexStiffness(system, touch), pinched, pressedMass(touch)});
    touch.bothHeld = pinched > 0.0 && isHeld(c) && !m_input.bodies[c.body].supports.empty();
    touch.isPinched = isBetweenBodies(touch);
    SoftRow row;
    for (int a = 0; a < 3; ++a) row.vertices[a] = globalVertex(c, a);
    row.weights = c.weights;
    row.body = touch.dynamicBody;
    row.arm = touch.arm;
    row.carried = carriedOf(touch);
    if (touch.jammed) {
        row.stiffness = touch.kappa * Mat3::Identity();
        row.load = touch.kappa * touch.between * c.normal;
        return row;
    }
    row.stiffness = touch.kappa * c.normal * c.normal.transpose();
    row.load = (touch.kappa * touch.target + touch.lambda) * c.normal;
    addFriction(touch, row.stiffness, row.load);
    return row;
}

Vec3 ContactResponse::relativeVelocity(const Touch& touch, const IslandVelocities& solved) const {
    Vec3 u = -carriedOf(touch);
    for (int a = 0; a < 3; ++a) u += touch.contact.weights[a] * solved.v.col(globalVertex(touch.contact, a));
    if (touch.dynamicBody >= 0) u -= pointVelocity(solved.w.col(touch.dynamicBody), touch.arm);
    return u;
}

bool ContactResponse::update(const CoupledSystem& system, const IslandVelocities& solved, const Points& y, int round,
                             bool rough) {
    if (!m_input.contacts) return false;
    for (Touch& touch : m_touches) touch.lifted = 0.0;
    readImpulses(system, solved);
    if (isQuick()) return updateQuickly(solved, y, round, rough);
    const bool released = releasePulling(round);
    // Where everything ends is worth looking at only when no contact pulls: before, velocities can be anything.
    const bool entered = !released && checkEnd(solved, y, round);
    const bool bounced = !released && !entered && bounce(solved);
    // Friction follows the normal impulses only when these have settled: lagged behind a passing one it runs away.
    // What it changes must settle too: in the second half of the rounds it stays as it is.
    const bool isTime = 2 * round < m_care.rounds;
    const bool slid = !released && !entered && !bounced && isTime && updateFriction(system);
    if (released || entered || bounced) relaxDamping();
    const bool changed = released || entered || bounced || slid;
    if (changed && isLast(round + 1)) dropExcessFriction();
    return changed && !isLast(round);
}

/// All at once after the first solve; later only what pulls by much, what ends deep inside a body, and friction. What
/// hardly matters is noted for the next step, and pushOut does its part in this one.
bool ContactResponse::updateQuickly(const IslandVelocities& solved, const Points& y, int round, bool rough) {
    findAtEnd(solved, y);
    const bool isStuck = isAnyStuck(), matters = rough || isStuck || isMuchUnmet();
    const bool released = releasePulling(round);
    const bool entered = (round == 0 || isStuck || isAnyDeep()) && closeFound(solved, round);
    const bool slid = updateFrictionQuickly(rough);
    return ((matters && (released || entered)) || slid) && !isLast(round);
}

/// Whether contacts that pull, and moving out what ends inside bodies, amount to much: of all that pushes, or of what
/// pushOut may strain. A sheet that has come to lie has a few of either in most steps.
bool ContactResponse::isMuchUnmet() const {
    constexpr double kMuch = 0.01, kMuchStrain = 0.25;
    double pushing = 0.0, unmet = 0.0, strain = 0.0, kick = 0.0;
    for (const Touch& touch : m_touches) {
        pushing += std::max(touch.pressing, 0.0);
        if (touch.active) unmet += std::max(-touch.normalImpulse, 0.0);
    }
    for (const Contact& contact : m_found) {
        const Shell& shell = *m_input.shells[contact.shell];
        const double by = std::max(-missing(contact, touchOf(contact)), 0.0);
        strain += strainOfPush(shell, by);
        for (int a = 0; a < 3; ++a)
            if (contact.weights[a] > 0.0)
                unmet += contact.weights[a] * shell.masses()[contact.vertices[a]] * by / m_input.h;
    }
    for (const Shell* shell : m_input.shells)
        kick += 0.5 * shell->masses().sum() * (m_input.h * m_input.gravity).squaredNorm();
    return unmet > kMuch * pushing || strain > kMuchStrain * kick;
}

void ContactResponse::readImpulses(const CoupledSystem& system, const IslandVelocities& solved) {
    for (Touch& touch : m_touches) {
        touch.impulse.setZero();
        touch.normalImpulse = touch.pressing = 0.0;
        if (touch.active) touch.slide = tangential(touch.contact.normal) * relativeVelocity(touch, solved);
        if (!touch.isRow) continue;
        const Vec3 u = relativeVelocity(touch, solved);
        const Vec3& n = touch.contact.normal;
        if (touch.jammed) {
            touch.impulse = touch.kappa * (touch.between * n - u);
            touch.normalImpulse = touch.pressing = n.dot(touch.impulse);
            continue;
        }
        touch.normalImpulse = touch.pressing = touch.lambda + touch.kappa * (touch.target - u.dot(n));
        Mat3 damping = Mat3::Zero();
        touch.impulse = touch.normalImpulse * n;
        addFriction(touch, damping, touch.impulse);
        touch.impulse -= damping * u;
    }
    for (const auto& filter : m_filters) {
        const Vec3 total = -solved.unfiltered.col(system.constraints()[filter.constraint].vertex);
        Normals normals(3, filter.count);
        for (int k = 0; k < filter.count; ++k) normals.col(k) = m_touches[filter.touches[k]].contact.normal;
        const Shares along = sharesOf(total, normals), pushing = pushingSharesOf(total, normals, along);
        for (int k = 0; k < filter.count; ++k) {
            Touch& touch = m_touches[filter.touches[k]];
            touch.normalImpulse = along[k];
            touch.pressing = pushing[k];
            touch.impulse = pushing[k] * touch.contact.normal;
        }
        Vec3& friction = m_touches[filter.touches[0]].impulse;
        friction += total - normals * pushing;
        if (filter.friction >= 0) friction += system.rowImpulse(system.rows()[filter.friction], solved.v, solved.w);
    }
}

/// What pulls at a wall has no friction either, nor what sticks to a free body. Held by both it would come back and
/// stick: what the friction held can lead into the wall by more than what pulled led out of it. Where there are rounds
/// enough, the friction goes first: often it pulls because of that only.
void ContactResponse::letGo(Touch& touch) const {
    const bool hadFriction = touch.sticks || touch.slip.known;
    if (!isQuick() && (touch.dynamicBody < 0 || touch.sticks)) {
        dropFriction(touch);
        if (hadFriction && m_care.rounds >= kAtLength.rounds) return;
    }
    touch.active = false;
    touch.lambda = 0.0;
    ++touch.changes;
}

/// Where few rounds are made, later ones let go only what pulls by much.
bool ContactResponse::releasePulling(int round) {
    constexpr double kMuch = 0.3;  // of the largest impulse
    const bool isLater = isQuick() && round > 0;
    bool changed = false;
    double most = 0.0;
    for (const Touch& touch : m_touches) most = std::max(most, touch.pressing);
    for (Touch& touch : m_touches) {
        if (!touch.active) continue;
        const double pull = isLater ? kMuch : touch.isPinched ? kAmongWalls.pull : m_care.pull;
        // In doubt a wall holds, for what is released last may end inside it, unless it goes away and drags the shell.
        const bool mayHold = touch.dynamicBody < 0 && carriedOf(touch).dot(touch.contact.normal) >= 0.0;
        const bool mayGo = touch.changes < kMostChanges - mayHold && !(mayHold && isLast(round + 1));
        if (touch.normalImpulse < -pull * most && !touch.jammed && mayGo) {
            letGo(touch);
            changed = true;
        } else if (touch.isRow && !touch.isPinched && !isLater) {
            raiseMultiplier(touch);
        }
    }
    return changed && !isLast(round);
}

/// As an augmented Lagrangian has it. Between walls that cannot all be met, and between what is held and a body that
/// something else holds, the multipliers would grow without bound: one that leaves most of what it was raised for is
/// put back, and the penalty alone holds that contact in this step.
void ContactResponse::raiseMultiplier(Touch& touch) const {
    constexpr double kVain = 0.5;  // of what was missing
    const double missing = (touch.normalImpulse - touch.lambda) / touch.kappa;
    const bool isWall = touch.dynamicBody < 0 || touch.bothHeld;
    const bool isVain =
        isWall && touch.missed > 0.0 && missing > kVain * touch.missed && missing * m_input.h > m_vertexSlop;
    touch.isVain = touch.isVain || touch.jammed || isVain;
    touch.lambda = touch.isVain ? 0.0 : std::max(touch.normalImpulse, 0.0);
    touch.missed = missing;
}

const std::vector<double>& ContactResponse::speedsBeside(const Points& a, const Points& b) {
    std::vector<double>& speeds = m_speeds;
    speeds.assign(m_input.bodies.size(), -1.0);
    for (const Touch& touch : m_touches) {
        if (touch.impulse.isZero(0.0)) continue;
        double& most = speeds[touch.contact.body];
        for (int k = 0; k < 3; ++k)
            if (touch.contact.weights[k] > 0.0)
                most = std::max(
                    {most, a.col(globalVertex(touch.contact, k)).norm(), b.col(globalVertex(touch.contact, k)).norm()});
    }
    return speeds;
}

void ContactResponse::finish(std::vector<ContactImpulse>& impulses) {
    m_memory.clear();
    m_memoryStep = m_input.h;
    rememberEmbedded();
    for (const Touch& touch : m_touches) {
        const bool pushes = touch.active && (touch.pressing > 0.0 || touch.isVain) && !touch.bounces;
        if (!touch.impulse.isZero(0.0))  // took part in the last solve
            impulses.push_back({touch.contact, touch.impulse, touch.sticks || creeps(touch), touch.slide});
        // Vertices that come and go in a sliding sheet are not without friction in the step in which they come back.
        const bool maySlideOn = isQuick() && touch.contact.isVertex() && touch.slip.known;
        if ((pushes || maySlideOn) && !m_forgotten.count(touch.contact.body))
            m_memory[keyOf(touch.contact)] = {pushes && !touch.isVain ? touch.pressing : 0.0,
                                              pushes ? touch.offset : 0.0,
                                              touch.sticks,
                                              touch.slip,
                                              touch.contact.point,
                                              touch.contact.isVertex(),
                                              touch.contact.vertices};
    }
}

}  // namespace jacket
