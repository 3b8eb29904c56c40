#include <algorithm>
#include <array>
#include <cmath>

#include "IslandImpl.h"
#include "ShellAssembly.h"

/// What energy a step starts with and gains, by which others judge it.
namespace jacket {
namespace {

/// What a body that is moved does by an impulse on a shell [J]. Where it turns, or is round, its surface comes to a
/// place otherwise than the point of it that is there when the step begins: the shell's velocity beside that tells how.
double workOfWall(const Vec3& impulse, const Vec3& carried, const Vec3& beside) {
    if (carried.isZero(0.0)) return 0.0;
    return std::max(0.0, impulse.dot(carried) + std::max(0.0, impulse.dot(beside)));
}

}  // namespace

/// Where velocities lead a shell, in its scratch.
Points& IslandSolver::Impl::endAfter(std::size_t k, const IslandInput& input, const Points& velocities) const {
    const Shell& shell = *input.shells[k];
    const int n = shell.vertexCount();
    Points& end = shell.m_assembly->scratch();
    end = shell.positions() + y.middleCols(offsets[k], n) + stepOf[k] * velocities.middleCols(offsets[k], n);
    return end;
}

double IslandSolver::Impl::elasticEnergyAfter(const IslandInput& input, std::size_t k, const Points& velocities) const {
    return input.shells[k]->elasticEnergy(endAfter(k, input, velocities));
}

/// Of a shell in the solved step [J]. Its sums have one order and cannot be shared, but there are four of them: of
/// either energy at the end and, unless it is known, at the start. They stand so that two threads that take them from
/// both ends have as much to do.
double IslandSolver::Impl::elasticEnergyGain(const IslandInput& input, std::size_t k) const {
    const Shell& shell = *input.shells[k];
    WorkerTeam* const team = teamFor(input);
    const Points& end = endAfter(k, input, v);
    const bool isStartKnown = !std::isnan(elasticAtStart[k]);
    if (!team || !end.allFinite()) {
        if (!isStartKnown) elasticAtStart[k] = shell.elasticEnergy(shell.positions());
        return shell.elasticEnergy(end) - elasticAtStart[k];
    }
    const Energy &membrane = shell.m_assembly->membrane(), &bending = shell.m_assembly->bending();
    std::array<double, 4> sums{};
    runParts(team, isStartKnown ? 2 : 4, [&](int i) {
        if (i == 0) sums[i] = bending.value(end);
        if (i == 1) sums[i] = membrane.value(end);
        if (i == 2) sums[i] = bending.valueBeside(shell.positions(), energyMemory);
        if (i == 3) sums[i] = membrane.value(shell.positions());
    });
    if (!isStartKnown) elasticAtStart[k] = sums[3] + sums[2];
    return sums[1] + sums[0] - elasticAtStart[k];
}

/// What a step of backward Euler minimises: 1/2 |v - v_0|^2_M + W(x + y + h v) - h f_ext . v, and what air adds   [J]
double IslandSolver::Impl::incrementalPotential(const IslandInput& input, const Points& velocities) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        const int n = shell.vertexCount();
        const auto part = velocities.middleCols(offsets[k], n);
        const auto since = part - from().middleCols(offsets[k], n);
        for (int i = 0; i < n; ++i)
            sum += shell.masses()[i] * (0.5 * since.col(i).squaredNorm() - stepOf[k] * input.gravity.dot(part.col(i))) -
                   stepOf[k] * shell.forces().col(i).dot(part.col(i));
        sum += elasticEnergyAfter(input, k, velocities);
        sum += ShellAssembly::potentialOfAir(shell, stepOf[k], input.wind, part);
    }
    return sum;
}

/// Of a shell at the start of the step, or what gravity would give it in one [J].
double IslandSolver::Impl::energyOfMotion(const IslandInput& input, std::size_t k) const {
    const Shell& shell = *input.shells[k];
    return shell.kineticEnergy(from().middleCols(offsets[k], shell.vertexCount())) +
           0.5 * shell.masses().sum() * (stepOf[k] * input.gravity).squaredNorm();
}

/// What shells and bodies gain in the solved step besides what gravity, forces, air and moved supports do, over the
/// energy that they start with, or that gravity and air give what starts from rest.
double IslandSolver::Impl::energyGain(const IslandInput& input) const {
    const double out = partOfStep * response.workOut();
    double atStart = 0.0, gain = -out, pushed = -out, mass = 0.0;
    for (std::size_t k = 0; k < input.shells.size(); ++k) {
        const Shell& shell = *input.shells[k];
        const int n = shell.vertexCount();
        const auto part = v.middleCols(offsets[k], n);
        const auto before = from().middleCols(offsets[k], n);
        const double ofAir = ShellAssembly::workOfAir(shell, stepOf[k], input.wind, before, part);
        gain -= ofAir;
        pushed -= ofAir;
        atStart += std::max(ofAir, 0.0);
        for (int i = 0; i < n; ++i) {
            const Vec3 mean = 0.5 * (part.col(i) + before.col(i));
            const double kinetic = 0.5 * shell.masses()[i] * before.col(i).squaredNorm();
            const Vec3 load = shell.masses()[i] * input.gravity + shell.forces().col(i);
            atStart += kinetic + 0.5 * shell.masses()[i] * (stepOf[k] * input.gravity).squaredNorm();
            mass += shell.masses()[i];
            pushed += 0.5 * shell.masses()[i] * part.col(i).squaredNorm() - stepOf[k] * load.dot(mean);
            gain += 0.5 * shell.masses()[i] * part.col(i).squaredNorm() - kinetic - stepOf[k] * load.dot(mean);
        }
        gain += elasticEnergyGain(input, k);
        atStart += elasticAtStart[k];
    }
    const double ofBodies = supports.kineticEnergy(freeTwist);
    atStart += ofBodies;
    gain += supports.kineticEnergy(endTwists()) - ofBodies;
    double fastest2 = 0.0;
    for (const auto& held : system.constraints()) {  // work of pins and bodies that are moved
        if (held.body >= 0) continue;
        gain -= workOfWall(-unfiltered().col(held.vertex), held.carried, v.col(held.vertex) - held.carried);
        fastest2 = std::max(fastest2, held.carried.squaredNorm());
    }
    for (const auto& row : system.rows()) {
        if (row.body >= 0) continue;
        gain -= workOfWall(system.rowImpulse(row, v, u.w), row.carried, system.rowVelocity(row, v, u.w));
        fastest2 = std::max(fastest2, row.carried.squaredNorm());
    }
    // Jammed between walls the work is any number; but what they push cannot be much faster than they are.
    const double most = std::max(atStart + 0.5 * kMostOvertaking * kMostOvertaking * mass * fastest2, 1e-300);
    return std::max(gain / std::max(atStart, 1e-300), pushed / most - 1.0);
}

/// Whether most of the energy comes with the bodies.
bool IslandSolver::Impl::bodiesLead(const IslandInput& input) const {
    double inShells = 0.0, inBodies = 0.0;
    for (const Shell* shell : input.shells) {
        const ShellEnergy energy = shell->energy();
        inShells += energy.kinetic + energy.membrane + energy.bending;
    }
    for (const int b : dynamicBodies)
        inBodies += 0.5 * input.bodies[b].freeTwist.dot(input.bodies[b].mass * input.bodies[b].freeTwist);
    return inBodies > inShells;
}

/// Twists of the dynamic bodies at the end of the step.
const BodyVectors& IslandSolver::Impl::endTwists() const {
    const Eigen::Map<const Eigen::RowVectorXd> share(bodyShare.data(), freeTwist.cols());
    return twistsAtEnd = freeTwist + impulseShare * ((u.w - freeTwist).array().rowwise() * share.array()).matrix();
}

}  // namespace jacket
