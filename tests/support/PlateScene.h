#pragma once
#include "support/HardScenes.h"
#include "support/SheetOutcome.h"

namespace jacket::bullet::testing {

/// A sheet that is laid on a box, or falls on it, which is fixed or free on a floor: tests run some of them,
/// contact_bench all.
struct PlateScene {
    ShellMaterial material;
    double side;                       ///< of the sheet [m]
    int cells;                         ///< along it
    double h;                          ///< [s]
    double boxMass;                    ///< 0: fixed [kg]
    double aside = 0.0, above = 1e-3;  ///< of its middle beside the box's, and above its top [m]
    double boxSide = 0.6;              ///< [m]

    SheetOutcome run() const {
        constexpr double kSeconds = 2.0;
        const btScalar half = btScalar(0.5 * boxSide);
        BulletScene scene;
        scene.addFloor();
        auto& box = scene.addBox(btVector3(half, half, half), boxMass, btVector3(0, half, 0));
        auto& sheet = scene.shells->add(squareSheet(side, cells), material, {.friction = 0.5});
        place(sheet, {aside, boxSide + above, 0.7 * aside});
        SheetOutcome outcome;
        for (double t = 0.0; t < kSeconds; t += h) {
            scene.step(h);
            outcome.note(scene, sheet, penetration(sheet, box));
            outcome.shoved =
                std::max(outcome.shoved, double(box.getWorldTransform().getOrigin().distance(btVector3(0, half, 0))));
        }
        return outcome;
    }
};

}  // namespace jacket::bullet::testing
