#pragma once
#include <algorithm>
#include <chrono>
#include <vector>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {

/// What a run was at worst, where no body moves faster than a walk and nothing falls from higher than 1 m.
struct SheetOutcome {
    double deepest = 0.0, fastest = 0.0;  ///< the sheet, in a body [m], one of its vertices [m/s]
    double shoved = 0.0;                  ///< how far a body was from where it stood, if that is asked for [m]
    int unsettled = 0;                    ///< steps

    /// After a step; `depth` of the sheet in bodies then [m].
    void note(const BulletScene& scene, const ShellBody& sheet, double depth) {
        deepest = std::max(deepest, depth);
        fastest = std::max(fastest, sheet.shell().velocities().colwise().norm().maxCoeff());
        unsettled += scene.shells->lastStep().settled ? 0 : 1;
    }
    /// What is wrong, null if nothing is. `mostSpeed`: above which a vertex was thrown [m/s].
    const char* fault(double mostSpeed = 5.0) const {
        if (deepest > 5e-4) return "deep";
        if (fastest > mostSpeed) return "thrown";
        if (unsettled > 5) return "unsettled";
        if (shoved > 5e-3) return "shoved";
        return nullptr;
    }
};

using Bodies = std::vector<btRigidBody*>;

/// Of the sheet in any of them [m].
inline double deepestIn(const Bodies& bodies, const ShellBody& sheet) {
    double depth = 0.0;
    for (const btRigidBody* body : bodies) depth = std::max(depth, penetration(sheet, *body));
    return depth;
}

/// What a run has cost, and been at worst.
struct SheetRun {
    SheetOutcome outcome;
    int steps = 0, solves = 0, most = 0;  ///< most: solves of one step
    double seconds = 0.0, longest = 0.0;  ///< of all steps, of one [s]
    double stretch = 0.0;                 ///< of an edge [-]

    /// Steps the scene. `depth()`: of the sheet in bodies then [m].
    template <class Depth>
    void step(BulletScene& scene, const ShellBody& sheet, double h, Depth depth) {
        using Clock = std::chrono::steady_clock;
        const auto before = Clock::now();
        scene.step(h);
        const double took = std::chrono::duration<double>(Clock::now() - before).count();
        const int ofStep = scene.shells->lastStep().solves;
        ++steps;
        seconds += took;
        longest = std::max(longest, took);
        solves += ofStep;
        most = std::max(most, ofStep);
        stretch = std::max(stretch, sheet.shell().maxStretch());
        outcome.note(scene, sheet, depth());
    }
    /// Takes together with another run: sums, and the worst of both.
    void add(const SheetRun& other) {
        steps += other.steps;
        solves += other.solves;
        seconds += other.seconds;
        most = std::max(most, other.most);
        longest = std::max(longest, other.longest);
        stretch = std::max(stretch, other.stretch);
        outcome.deepest = std::max(outcome.deepest, other.outcome.deepest);
        outcome.fastest = std::max(outcome.fastest, other.outcome.fastest);
        outcome.unsettled += other.outcome.unsettled;
    }
};

}  // namespace jacket::bullet::testing
