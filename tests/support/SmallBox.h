#pragma once
#include <algorithm>
#include <cmath>

#include "support/BulletScene.h"
#include "support/Random.h"

namespace jacket::bullet::testing {

/// A box of 1 to 3 cm, of 5 g to 2 kg, that falls turned any way on a pinned sheet of 1 m with cells of 20 to 50 cm.
struct SmallBox {
    double mass, speed, h;  ///< [kg], [m/s], of a step [s]
    int cells;
    bool isBelow;  ///< it ends below the sheet
    bool isSaid;   ///< steps said that something went through

    SmallBox(unsigned seed, const ShellMaterial& material) {
        Random random(seed);
        BulletScene scene;
        cells = 2 + random.below(4);
        auto& sheet = scene.shells->add(squareSheet(1.0, cells), material, {.friction = 0.5});
        pinBorder(sheet);
        const btVector3 half = random.vector(Vec3::Constant(5e-3), Vec3::Constant(0.015));
        mass = random.logBetween(5e-3, 2.0), speed = random.between(0.5, 8.0);
        auto& box = scene.addBox(half, mass, random.vector({-0.4, 0.03, -0.4}, {0.4, 0.15, 0.4}));
        const btVector3 turn = random.vector(Vec3::Constant(-3.0), Vec3::Constant(3.0));
        box.setWorldTransform(
            btTransform(btQuaternion(turn.x(), turn.y(), turn.z()), box.getWorldTransform().getOrigin()));
        box.setLinearVelocity(random.vector({-1, -speed, -1}, {1, -speed, 1}));
        h = seed % 2 == 0 ? 1.0 / 60 : 1.0 / 240;
        double lowest = 0.0;
        for (double t = 0.0; t < 2.0; t += h) {
            scene.step(h);
            lowest = std::min(lowest, sheet.shell().positions().row(1).minCoeff());
        }
        const Vec3 end = toVec3(box.getWorldTransform().getOrigin());
        isBelow = end.y() < lowest - 0.05 && std::max(std::abs(end.x()), std::abs(end.z())) < 0.5;
        isSaid = scene.shells->lastStep().passedSteps > 0;
    }
};

}  // namespace jacket::bullet::testing
