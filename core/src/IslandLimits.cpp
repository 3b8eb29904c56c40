#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "IslandImpl.h"

/// Keeps what a step does to shells and bodies within bounds where its solve did not settle or would strain them.
namespace jacket {
namespace {

/// Whether other bodies or joints hold it in some directions: its mass against a force at its centre is by far less in
/// the one that it yields to most than in others.
bool isHeldInSome(const Mat6& mass) {
    constexpr double kMost = 0.1;
    const Mat3 coupling = mass.topRightCorner<3, 3>();
    const Mat3 moved =
        mass.topLeftCorner<3, 3>() - coupling * mass.bottomRightCorner<3, 3>().ldlt().solve(Mat3(coupling.transpose()));
    Eigen::SelfAdjointEigenSolver<Mat3> modes;
    return modes.computeDirect(moved, Eigen::EigenvaluesOnly).eigenvalues()[0] <
           kMost * mass.topLeftCorner<3, 3>().trace() / 3.0;
}

}  // namespace

/// Where Newton's method does not settle, as in a stiff shell pinched between bodies, the step would throw the shell
/// about. Its linear and angular momentum are kept then, and of the motion besides that only as much as gains no
/// energy: it stands stiff for a step. If that still gains energy, contacts give only a share of what was solved, to
/// shells and bodies alike. They may give way by that much until the next step, and a fast body may pass.
void IslandSolver::Impl::limitDeformation(const IslandInput& input, StepReport& report) {
    constexpr int kMostHalvings = 40;
    report.limited = true;
    limitPushes(input, patience.isOut() ? 0.0 : kMostEnergyGain);
    const double most = std::max(kEnergyGain, gainOfCoasting(input));
    rigid = v;
    makeRigid(input, rigid, input.h);
    const bool isHeld =
        std::any_of(input.shells.begin(), input.shells.end(), [](const Shell* shell) { return shell->pinCount() > 0; });
    for (int halving = 0; halving < kMostHalvings && energyGain(input) > most; ++halving) {
        blend(input, rigid);
        if (isHeld) impulseShare *= 0.5;  // its pins take the momentum; a light body would keep the shell's old speed
    }
    rigid = start.colwise() + input.h * input.gravity;
    makeRigid(input, rigid, input.h);  // coasting
    for (int halving = 0; halving < kMostHalvings && energyGain(input) > most; ++halving) {
        blend(input, rigid);
        impulseShare *= 0.5;
    }
    if (!(energyGain(input) <= most)) coast(input, rigid);
    for (std::size_t b = 0; impulseShare < 1.0 && b < input.bodies.size(); ++b) response.forget(static_cast<int>(b));
}

/// What moves vertices out of bodies goes half way to a rigid motion until it no longer gains more than that share of
/// the energy: their neighbours will not give way as they were to, and may turn with the shell.
void IslandSolver::Impl::limitPushes(const IslandInput& input, double mostGain) {
    constexpr int kMostHalvings = 40;
    reached = y;
    makeRigid(input, reached, 1.0);
    rigid = start.colwise() + input.h * input.gravity;
    makeRigid(input, rigid, input.h);
    double most = partOfStep * response.workOut();
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        most += elasticAtStart[k] + partOfStep * mostGain * (elasticAtStart[k] + energyOfMotion(input, k));
    const auto energyAfter = [&] {
        double sum = 0.0;
        for (std::size_t k = 0; k < input.shells.size(); ++k) sum += elasticEnergyAfter(input, k, rigid);
        return sum;
    };
    for (int halving = 0; halving < kMostHalvings && energyAfter() > most; ++halving) y = 0.5 * (y + reached);
}

/// Of a step in which shells take nothing from their contacts but what moves them out of bodies: see energyGain.
double IslandSolver::Impl::gainOfCoasting(const IslandInput& input) {
    reached = v;
    v = start.colwise() + input.h * input.gravity;
    makeRigid(input, v, input.h);
    const double share = std::exchange(impulseShare, 0.0), gain = energyGain(input);
    impulseShare = share;
    v.swap(reached);
    return gain;
}

/// Half way from the solved velocities to others, where vertices are free.
void IslandSolver::Impl::blend(const IslandInput& input, const Points& other) {
    for (std::size_t k = 0; k < input.shells.size(); ++k)
        for (int i = 0; i < input.shells[k]->vertexCount(); ++i)
            if (!input.shells[k]->isPinned(i))
                v.col(offsets[k] + i) = 0.5 * (v.col(offsets[k] + i) + other.col(offsets[k] + i));
}

/// As if nothing had been solved: what was is so far off that no share of it can be used. What can yield is moved out
/// of bodies as a whole: it would keep the strain.
void IslandSolver::Impl::coast(const IslandInput& input, const Points& coasting) {
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        for (int i = 0; i < shell.vertexCount(); ++i)
            if (!shell.isPinned(i)) v.col(offsets[k] + i) = coasting.col(offsets[k] + i);
        if (input.bodies.empty() || !shell.settings().plasticity || shell.pinCount() > 0) continue;
        auto alteration = y.middleCols(offsets[k], shell.vertexCount());
        Eigen::Index most = 0;
        alteration.colwise().squaredNorm().maxCoeff(&most);
        alteration.colwise() = Vec3(alteration.col(most));
    }
    impulseShare = 0.0;
}

/// Leaves of velocities the rigid motion of each shell with their momentum; none of shells that are held. It is what
/// leads them in `time` to where they have turned: along the tangents they would be stretched.
void IslandSolver::Impl::makeRigid(const IslandInput& input, Points& velocities, double time) const {
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        auto part = velocities.middleCols(offsets[k], shell.vertexCount());
        if (shell.pinCount() > 0) {
            part.setZero();
            continue;
        }
        const Eigen::VectorXd& mass = shell.masses();
        const Vec3 centre = shell.positions() * mass / mass.sum(), mean = part * mass / mass.sum();
        Mat3 inertia = Mat3::Zero();
        Vec3 spin = Vec3::Zero();
        for (int i = 0; i < shell.vertexCount(); ++i) {
            const Vec3 r = shell.positions().col(i) - centre;
            inertia += mass[i] * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
            spin += mass[i] * r.cross(Vec3(part.col(i)));
        }
        const Vec3 omega = inertia.ldlt().solve(spin);
        const Mat3 chord = chordsOf(omega, time);
        for (int i = 0; i < shell.vertexCount(); ++i) part.col(i) = mean + chord * (shell.positions().col(i) - centre);
    }
}

/// What a shell pushes cannot become much faster than the shell: a body that does, as light ones may where contacts did
/// not settle, takes a share of their impulses only, and what they remember is forgotten. Where they did not settle,
/// the shell's velocities at the start are what is known of it, and what bears a body may have been solved as pulling
/// it back from where the shell then throws it.
void IslandSolver::Impl::limitBodies(const IslandInput& input, StepReport& report) {
    const bool isSure = !unsettled && !report.limited;
    const std::vector<double>& speeds = response.speedsBeside(start, isSure ? v : start);
    if (!isSure) {
        twistChange = u.w - freeTwist;
        system.momentum(twistChange, momentum);
    }
    const BodyVectors& after = isSure ? u.w : supports.respond(momentum, input.h * input.gravity.norm());
    double least = 1.0;
    for (std::size_t b = 0; b < dynamicBodies.size(); ++b) {
        const int body = dynamicBodies[b], dynamic = static_cast<int>(b);
        const bool isAnchored = std::any_of(input.anchors.begin(), input.anchors.end(),
                                            [&](const auto& anchor) { return anchor.body == body; });
        if (isAnchored || !(speeds[body] >= 0.0)) continue;
        const double speed = (isSure ? kMostOvertaking : 1.0) * speeds[body];
        bodyShare[b] = shareWithin(input, input.bodies[body], dynamic, after.col(dynamic), speed);
        least = std::min(least, bodyShare[b]);
        if (bodyShare[b] < 1.0) response.forget(body);
    }
    if (least == 1.0) return;
    report.limited = true;
    if (!input.couplings.empty() || !input.rigidContacts.empty())  // what joins them must not be torn
        std::fill(bodyShare.begin(), bodyShare.end(), least);
}

/// The largest share of its change of twist to `after` with which a body keeps within its energy without the shells and
/// that of its mass at `speed`. Where it is held in some directions, that mass says nothing of the others: there its
/// speed is asked for too, besides what gravity may do to it.
double IslandSolver::Impl::shareWithin(const IslandInput& input, const CoupledBody& body, int dynamic,
                                       const Vec6& after, double speed) const {
    constexpr int kMostHalvings = 40;
    const Vec6 before = freeTwist.col(dynamic), change = impulseShare * (after - before);
    const auto energy = [&](const Vec6& twist) { return 0.5 * twist.dot(supports.ownMass(dynamic) * twist); };
    const double mass = body.mass.topLeftCorner<3, 3>().trace() / 3.0;
    const double most = std::max(energy(body.freeTwist), energy(before)) + 0.5 * mass * speed * speed;
    double most2 = std::numeric_limits<double>::infinity();
    if (isHeldInSome(body.mass))
        most2 = std::max(body.freeTwist.head<3>().squaredNorm(), before.head<3>().squaredNorm()) + speed * speed +
                (input.h * input.gravity).squaredNorm();
    double share = 1.0;
    for (int i = 0; i < kMostHalvings; ++i, share *= 0.5) {
        const Vec6 twist = before + share * change;
        if (energy(twist) <= most && twist.head<3>().squaredNorm() <= most2) return share;
    }
    return 0.0;
}

/// Sheet metal is strained by every push, of however little, for as long as anything touches it; cloth that once was
/// lies as before soon after.
bool IslandSolver::Impl::wouldBeStrained(const IslandInput& input) {
    constexpr int kSteps = 10;
    const double kick = (input.h * input.gravity).squaredNorm();
    return ++stepsInFull < kSteps || std::any_of(input.shells.begin(), input.shells.end(), [&](const Shell* shell) {
        return strainOfPush(*shell, response.slop()) > kMostEnergyGain * 0.5 * shell->masses().sum() * kick;
    });
}

/// Whether pushOut would strain the shells, which then do not give way to it: sheet metal that stands on its edge, a
/// bowl on its rim.
bool IslandSolver::Impl::pushesStrain(const IslandInput& input) {
    const double most = partOfStep * kMostEnergyGain;
    if (!response.isQuick() || !unfiltered().allFinite()) return false;
    const auto& pushes = response.pushes(v);
    const auto energyAfter = [&] {
        double sum = 0.0;
        for (std::size_t k = 0; k < input.shells.size(); ++k) sum += elasticEnergyAfter(input, k, v);
        return sum;
    };
    double moving = 0.0, stretching = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        moving += shell.kineticEnergy(v.middleCols(offsets[k], shell.vertexCount()));
        moving += 0.5 * shell.masses().sum() * (stepOf[k] * input.gravity).squaredNorm();
        const auto end = pushes.lower_bound(offsets[k] + shell.vertexCount());
        for (auto one = pushes.lower_bound(offsets[k]); one != end; ++one)
            stretching += strainOfPush(shell, one->second.norm());
    }
    if (stretching <= most * moving) return false;
    reached = v;
    const double before = energyAfter();
    for (const auto& [vertex, by] : pushes) v.col(vertex) += by / input.h;
    const double after = energyAfter();
    v.swap(reached);
    return after - before > most * (moving + before);
}

}  // namespace jacket
