#include <algorithm>
#include <memory_resource>
#include <span>
#include <vector>

#include "IslandImpl.h"

/// What contacts, bodies and shells are told that they exchanged, so that it adds up.
namespace jacket {
namespace {

/// Where a shell touches a body, at the start of the step.
Vec3 contactPoint(const IslandInput& input, const Contact& contact) {
    Vec3 point = Vec3::Zero();
    for (int a = 0; a < 3; ++a)
        point += contact.weights[a] * input.shells[contact.shell]->positions().col(contact.vertices[a]);
    return point;
}

/// From a body's centre of mass to there.
Vec3 contactArm(const IslandInput& input, const Contact& contact) {
    return contactPoint(input, contact) - input.bodies[contact.body].position;
}

/// The part of a contact's impulse that it can give: it pushes, with friction as Coulomb allows it.
Vec3 possiblePart(const ContactImpulse& one) {
    const Vec3& n = one.contact.normal;
    const double pressing = std::max(0.0, one.impulse.dot(n));
    const Vec3 across = one.impulse - one.impulse.dot(n) * n;
    const double most = one.contact.friction * pressing, size = across.norm();
    return pressing * n + (size > most ? Vec3(across * (most / size)) : across);
}

/// By how much damping makes a mass harder to move.
double damping(const IslandInput& input, const Shell& shell) {
    return 1.0 + input.h * shell.material().massDamping;
}

}  // namespace

/// The contacts' last word where they were settled in few rounds.
void IslandSolver::Impl::pushOut(const IslandInput& input, StepReport& report) {
    const auto solved = report.contacts.size();
    response.pushOut(v, report.contacts);
    for (std::size_t i = solved; i < report.contacts.size(); ++i) {
        const auto& [contact, impulse, sticks, slip] = report.contacts[i];
        input.bodies[contact.body].impulse -= pointImpulse(impulse, contactArm(input, contact));
    }
}

/// Where contacts did not settle, some push by a multiple of what others pull, and what bears the shell may yield to
/// the moment of that. Of each shell's contacts with walls what can be is taken, as much as makes up what the shell
/// got, in impulse and in moment: forces that hold a strained shell on both sides of a body would else turn that about.
void IslandSolver::Impl::makePossible(const IslandInput& input, std::span<ContactImpulse> impulses) {
    constexpr double kLeast = 1e-9;  // so that they still share what is missing
    system.velocities(u, reached);   // `v` may have been cut short since
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Points& x = input.shells[k]->positions();
        const Vec3 centre = x.rowwise().mean();
        const double radius = (x.colwise() - centre).colwise().norm().maxCoeff();
        Vec6 possible = Vec6::Zero();
        for (ContactImpulse& one : impulses) {
            if (one.contact.shell != static_cast<int>(k)) continue;
            one.impulse = possiblePart(one);
            possible += pointImpulse(one.impulse, contactPoint(input, one.contact) - centre);
        }
        if (possible.isZero(0.0)) continue;
        Vec6 given = givenTo(input, k, reached, centre);
        for (const Anchor& anchor : input.anchors)
            if (anchor.shell == static_cast<int>(k) && !input.shells[k]->isPinned(anchor.vertex))
                given += pointImpulse(unfiltered().col(offsets[k] + anchor.vertex), x.col(anchor.vertex) - centre);
        possible.tail<3>() /= radius;
        given.tail<3>() /= radius;
        const double share = std::clamp(impulseShare * given.dot(possible) / possible.squaredNorm(), kLeast, 1.0);
        for (ContactImpulse& one : impulses)
            if (one.contact.shell == static_cast<int>(k)) one.impulse *= share;
    }
}

/// What contacts and anchors have given the free vertices of a shell in the last solve, which ended with the velocities
/// `solved`: impulse [N s], and its moment about `centre` [N m s].
Vec6 IslandSolver::Impl::givenTo(const IslandInput& input, std::size_t k, const Points& solved,
                                 const Vec3& centre) const {
    const Shell& shell = *input.shells[k];
    const Points& x = shell.positions();
    const auto unheld = unfiltered().middleCols(offsets[k], shell.vertexCount());
    Vec6 given = Vec6::Zero();
    given.head<3>() = -unheld.rowwise().sum();
    const auto take = [&](int i, const Vec3& impulse) {
        if (shell.isPinned(i))
            given.head<3>() -= impulse;
        else
            given.tail<3>() += (x.col(i) - centre).cross(impulse);
    };
    for (int i = 0; i < shell.vertexCount(); ++i) take(i, -unheld.col(i));
    for (const auto& row : system.rows()) {
        if (row.vertices[0] < offsets[k] || row.vertices[0] >= offsets[k] + shell.vertexCount()) continue;
        const Vec3 impulse = system.rowImpulse(row, solved, u.w);
        given.head<3>() += impulse;
        for (int a = 0; a < 3; ++a)
            if (row.weights[a] > 0.0) take(row.vertices[a] - offsets[k], row.weights[a] * impulse);
    }
    return given;
}

/// Makes the ledger exact whatever the tolerance: what the contacts report, what the bodies got and what the shells'
/// momentum changed by are the same to rounding. The residual that the solve left is spread over contacts and vertices.
void IslandSolver::Impl::balance(const IslandInput& input, std::vector<ContactImpulse>& impulses) {
    const auto count = input.bodies.size();
    std::pmr::vector<Vec6> onBodies(count, Vec6::Zero(), &pool);
    std::pmr::vector<double> pressed(count, 0.0, &pool);
    const auto add = [&](int body, const Vec3& impulse, const Vec3& arm) {
        onBodies[body] -= pointImpulse(impulse, arm);
        pressed[body] += impulse.norm();
    };
    std::pmr::vector<char> isTouched(count, 0, &pool);
    for (const auto& [contact, impulse, sticks, slip] : impulses) {
        add(contact.body, impulse, contactArm(input, contact));
        isTouched[contact.body] = 1;
    }
    for (Anchor& anchor : input.anchors) {
        anchor.impulse = impulseShare * unfiltered().col(offsets[anchor.shell] + anchor.vertex);
        add(anchor.body, -anchor.impulse, anchor.point - input.bodies[anchor.body].position);
    }
    for (std::size_t b = 0; b < count; ++b) {
        Vec6& impulse = input.bodies[b].impulse;
        if (input.bodies[b].prescribed || !(pressed[b] > 0.0))
            impulse = onBodies[b];
        else if (!isTouched[b])
            impulse -= excessOf(static_cast<int>(b), impulse - onBodies[b]);
    }
    std::pmr::vector<Vec3> onShells(input.shells.size(), Vec3::Zero(), &pool);
    const auto missing = [&](int body, const Vec3& impulse) -> Vec3 {
        if (!(pressed[body] > 0.0)) return Vec3::Zero();
        const Vec3 all = input.bodies[body].impulse.head<3>() - onBodies[body].head<3>();
        return all * (impulse.norm() / pressed[body]);
    };
    for (auto& [contact, impulse, sticks, slip] : impulses) {
        impulse -= missing(contact.body, impulse);
        onShells[contact.shell] += impulse;
    }
    for (Anchor& anchor : input.anchors) {
        anchor.impulse += missing(anchor.body, anchor.impulse);
        onShells[anchor.shell] -= anchor.impulse;
    }
    shift(input, onShells, impulses);
}

/// What of a change of momentum is to be taken back so that a body's equations, of which the solve has left `residual`
/// over, are fulfilled with the shells' velocities around it. Neither what its anchors give it nor its solved change of
/// momentum would do: a light body far from its anchor would spin by that, and one that rests on something would be
/// lifted off it.
Vec6 IslandSolver::Impl::excessOf(int body, const Vec6& residual) const {
    const int dynamic = dynamicIndex[body];
    return supports.masses()[dynamic] * preconditioner.twistBy(dynamic, residual);
}

/// The shells' part of it. Walls take what is missing, and bodies twice as heavy as the shell: one that they hold is
/// stiff, and its mass would turn little force into much speed, into them. A shell that touches none moves by it.
void IslandSolver::Impl::shift(const IslandInput& input, std::span<const Vec3> onShells,
                               std::vector<ContactImpulse>& impulses) {
    system.velocities(u, reached);  // `v` may have been cut short since
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        if (shell.pinCount() > 0) continue;
        const Vec3 missing = impulseShare * givenTo(input, k, reached, Vec3::Zero()).head<3>() - onShells[k];
        if (giveToWalls(input, static_cast<int>(k), missing, impulses)) continue;
        v.middleCols(offsets[k], shell.vertexCount()).colwise() -=
            (missing / (shell.masses().sum() * damping(input, shell))).eval();
    }
}

/// Adds an impulse to those that walls, and what is as good as one to a shell, have given it by contacts and anchors;
/// false if there are none.
bool IslandSolver::Impl::giveToWalls(const IslandInput& input, int shell, const Vec3& impulse,
                                     std::vector<ContactImpulse>& impulses) const {
    constexpr double kHeavy = 2.0;  // times the shell's mass
    const double least = kHeavy * input.shells[shell]->masses().sum();
    const auto isWalls = [&](int ofShell, int body) {
        if (ofShell != shell) return false;
        const int dynamic = dynamicIndex[body];
        return dynamic < 0 || supports.lightest(dynamic) > least;
    };
    double pressed = 0.0;
    for (const ContactImpulse& one : impulses)
        if (isWalls(one.contact.shell, one.contact.body)) pressed += one.impulse.norm();
    for (const Anchor& anchor : input.anchors)
        if (isWalls(anchor.shell, anchor.body)) pressed += anchor.impulse.norm();
    if (!(pressed > 0.0)) return false;
    for (ContactImpulse& one : impulses) {
        if (!isWalls(one.contact.shell, one.contact.body)) continue;
        const Vec3 part = impulse * (one.impulse.norm() / pressed);
        one.impulse += part;
        input.bodies[one.contact.body].impulse -= pointImpulse(part, contactArm(input, one.contact));
    }
    for (Anchor& anchor : input.anchors) {
        if (!isWalls(anchor.shell, anchor.body)) continue;
        CoupledBody& body = input.bodies[anchor.body];
        const Vec3 part = impulse * (anchor.impulse.norm() / pressed);
        anchor.impulse -= part;
        body.impulse -= pointImpulse(part, anchor.point - body.position);
    }
    return true;
}

}  // namespace jacket
