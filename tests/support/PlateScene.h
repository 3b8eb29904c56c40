#pragma once
#include "support/HardScenes.h"
#include "support/SheetOutcome.h"

namespace jacket::bullet::testing {

/// A sheet that is laid on a box of 60 cm, fixed or free on a floor: tests run some of them, contact_bench all.
struct PlateScene {
    ShellMaterial material;
    double side;                       ///< of the sheet [m]
    int cells;                         ///< along it
    double h;                          ///< [s]
    double boxMass;                    ///< 0: fixed [kg]
    double aside = 0.0, above = 1e-3;  ///< of its middle beside the box's, and above its top [m]

    SheetOutcome run() const {
        constexpr double kHalf = 0.3, kSeconds = 2.0;  // of the box [m], [s]
        BulletScene scene;
        scene.addFloor();
        auto& box = scene.addBox(btVector3(btScalar(kHalf), btScalar(kHalf), btScalar(kHalf)), boxMass,
                                 btVector3(0, btScalar(kHalf), 0));
        auto& sheet = scene.shells->add(squareSheet(side, cells), material, {.friction = 0.5});
        place(sheet, {aside, 2.0 * kHalf + above, 0.7 * aside});
        SheetOutcome outcome;
        for (double t = 0.0; t < kSeconds; t += h) {
            scene.step(h);
            outcome.note(scene, sheet, penetration(sheet, box));
        }
        return outcome;
    }
};

}  // namespace jacket::bullet::testing
