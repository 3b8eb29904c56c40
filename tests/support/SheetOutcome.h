#pragma once
#include <algorithm>

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

}  // namespace jacket::bullet::testing
