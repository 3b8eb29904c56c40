// What contact is to do by theory, over more sheets, places and steps than the tests have time for: metal that is laid
// on boxes, sheets on an incline, boxes much smaller than the triangles that they fall on, bullets that come aslant.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>

#include "support/Incline.h"
#include "support/PlateScene.h"
#include "support/Target.h"

namespace jacket::bullet::testing {
namespace {

btVector3 at(double x, double y, double z) {
    return {btScalar(x), btScalar(y), btScalar(z)};
}

/// Counts what goes wrong of a kind of runs, and says so at its end.
struct Tally {
    const char* name;
    int faulty = 0, all = 0;
    void count(bool isFaulty) {
        faulty += isFaulty ? 1 : 0;
        ++all;
    }
    ~Tally() {
        std::printf("%s: %d of %d go wrong\n", name, faulty, all);
        std::fflush(stdout);
    }
    explicit Tally(const char* what) : name(what) {}
    Tally(const Tally&) = delete;
    Tally& operator=(const Tally&) = delete;
};

struct Named {
    const char* name;
    ShellMaterial material;
};

bool isFaulty(const char* material, const PlateScene& scene) {
    const PlateScene::Outcome outcome = scene.run();
    const char* const fault = outcome.fault();
    if (fault)
        std::printf(
            "  %-9s %s of %g m, %d cells, on a %s box, %g mm aside, %g mm above, 1/%.0f s: %.2g mm deep, at most "
            "%.2g m/s, %d steps unsettled\n",
            fault, material, scene.side, scene.cells, scene.boxMass > 0.0 ? "free" : "fixed", 1e3 * scene.aside,
            1e3 * scene.above, 1.0 / scene.h, 1e3 * outcome.deepest, outcome.fastest, outcome.unsettled);
    return fault;
}

void runPlates() {
    const Named kinds[] = {{"steel 0.5 mm", materials::steel(5e-4)},
                           {"steel 1 mm", materials::steel(1e-3)},
                           {"rubber", materials::rubber()},
                           {"paper", materials::paper()}};
    Tally tally("plates on a box of 60 cm");
    for (const Named& kind : kinds)
        for (const double side : {0.6, 0.9})
            for (const int cells : {2, 6, 12})
                for (const double h : {1.0 / 60, 1.0 / 240})
                    for (const double aside : {0.0, 0.003})
                        for (const double above : {0.0, 0.5 * kind.material.thickness + 1e-4})
                            for (const double boxMass : {0.0, 20.0})
                                tally.count(
                                    isFaulty(kind.name, {kind.material, side, cells, h, boxMass, aside, above}));
}

/// A sheet that lies on an incline of 20 degrees.
struct Inclined {
    const Named& of;
    double side;  ///< [m]
    int cells;
    double h;  ///< [s]

    void tell(const char* what, double friction, double is, double wanted) const {
        std::printf("  %-9s %s of %g m, %d cells, 1/%.0f s, friction %g: %.3g m/s instead of %.3g\n", what, of.name,
                    side, cells, 1.0 / h, friction, is, wanted);
    }
    bool isFaultyHeld(double friction) const {
        constexpr double kSettling = 1.0, kSeconds = 4.0;
        Incline scene(friction, side, cells, of.material);
        scene.run(kSettling, h);
        const Points start = scene.sheet.shell().positions();
        scene.run(kSeconds, h);
        const double creep =
            (scene.downhill.transpose() * (scene.sheet.shell().positions() - start)).cwiseAbs().maxCoeff() / kSeconds;
        const double most = Incline::mostCreep(side);
        if (creep > most) tell("creeps", friction, creep, most);
        return creep > most;
    }
    bool isFaultySliding(double friction) const {
        constexpr double kSeconds = 0.75;
        Incline scene(friction, side, cells, of.material);
        scene.run(kSeconds, h);
        const double wanted = Incline::accelerationByCoulomb(friction) * (kSeconds + h);
        const bool isOff = std::abs(scene.speed() - wanted) > 0.02 * wanted;
        if (isOff) tell("slides", friction, scene.speed(), wanted);
        return isOff;
    }
};

void runInclines() {
    const Named kinds[] = {{"cotton", materials::cotton()},
                           {"paper", materials::paper()},
                           {"rubber", materials::rubber()},
                           {"steel 0.5 mm", materials::steel(5e-4)}};
    Tally tally("sheets on an incline");
    for (const Named& kind : kinds)
        for (const double side : {0.2, 1.0})
            for (const int cells : {2, 5, 12})
                for (const double h : {1.0 / 60, 1.0 / 240}) {
                    const Inclined sheet{kind, side, cells, h};
                    for (const double friction : {0.37, 0.5}) tally.count(sheet.isFaultyHeld(friction));
                    for (const double friction : {0.2, 0.35}) tally.count(sheet.isFaultySliding(friction));
                }
}

/// Whether a body ends below a sheet with its border in the plane y = 0 and no step said that it may have passed.
bool isLostSilently(const BulletScene& scene, const btRigidBody& body, double most) {
    const btVector3& p = body.getWorldTransform().getOrigin();
    const bool isBelow = p.y() < btScalar(-most) && std::abs(p.x()) < btScalar(0.5) && std::abs(p.z()) < btScalar(0.5);
    return isBelow && scene.shells->lastStep().passedSteps == 0;
}

/// A box of 1 to 3 cm that falls on a pinned sheet of 1 m with cells of 20 to 50 cm, turned any way.
bool isSmallBoxLost(unsigned seed, const Named& of) {
    std::mt19937 random(seed);
    const auto draw = [&](double from, double to) {
        return from + (to - from) * (double(random()) / double(std::mt19937::max()));
    };
    BulletScene scene;
    const int cells = int(draw(2.0, 5.99));
    auto& sheet = scene.shells->add(squareSheet(1.0, cells), of.material, {.friction = 0.5});
    pinBorder(sheet);
    const btVector3 half = at(draw(5e-3, 0.015), draw(5e-3, 0.015), draw(5e-3, 0.015));
    const double mass = std::exp(draw(std::log(5e-3), std::log(2.0))), speed = draw(0.5, 8.0);
    auto& box = scene.addBox(half, mass, at(draw(-0.4, 0.4), draw(0.03, 0.15), draw(-0.4, 0.4)));
    btTransform pose = box.getWorldTransform();
    pose.setRotation(btQuaternion(btScalar(draw(-3, 3)), btScalar(draw(-3, 3)), btScalar(draw(-3, 3))));
    box.setWorldTransform(pose);
    box.setLinearVelocity(at(draw(-1, 1), -speed, draw(-1, 1)));
    const double h = seed % 2 == 0 ? 1.0 / 60 : 1.0 / 240;
    const double lowest = [&] {
        double low = 0.0;
        for (double t = 0.0; t < 2.0; t += h) {
            scene.step(h);
            low = std::min(low, sheet.shell().positions().row(1).minCoeff());
        }
        return low;
    }();
    const bool isLost = isLostSilently(scene, box, 0.05 - lowest);
    if (isLost)
        std::printf("  lost      box %u of %.2g kg, %.2g m/s on %s, %d cells, 1/%.0f s\n", seed, mass, speed, of.name,
                    cells, 1.0 / h);
    return isLost;
}

void runSmallBoxes() {
    const Named kinds[] = {{"cotton", materials::cotton()},
                           {"paper", materials::paper()},
                           {"rubber", materials::rubber()},
                           {"steel 0.5 mm", materials::steel(5e-4)}};
    Tally tally("boxes of 1 to 3 cm on cells of 20 to 50 cm");
    for (unsigned seed = 0; seed < 1000; ++seed) tally.count(isSmallBoxLost(seed, kinds[seed % 4]));
}

/// A body of 5 or 10 mm that comes at a sheet of 1 m.
struct Shot {
    const char* shape;
    double size, mass, speed, angle;  ///< [m], [kg], [m/s], from the sheet's normal [rad]
    int which;                        ///< of several places

    std::unique_ptr<btCollisionShape> make() const {
        const btScalar half = btScalar(0.5 * size);
        if (shape == std::string("box")) return std::make_unique<btBoxShape>(btVector3(half, half, half));
        if (shape == std::string("capsule")) return std::make_unique<btCapsuleShapeX>(half, btScalar(size));
        return std::make_unique<btSphereShape>(half);
    }
    bool isFaulty() const {
        Target scene;
        const Vec3 along(std::sin(angle), -std::cos(angle), 0.0);
        const Vec3 target(0.0137 * which - 0.07, 0.0, 0.0213 * which - 0.11);
        const double way = 0.6 + 0.19 * which;  // to the sheet [m]
        auto& body = scene.addBody(make(), mass, Incline::toBullet(target - way * along));
        if (which % 2) scene.step(1.0 / 60);
        body.setLinearVelocity(Incline::toBullet(speed * along));
        for (int i = 0; i < 8 + int(2.0 * way / speed * 60); ++i) scene.step(1.0 / 60);
        const bool isLost = !scene.isAbove(body) && scene.shells->lastStep().passedSteps == 0;
        if (isLost)
            std::printf("  passed    %s of %g mm, %g g, %g m/s, %.0f degrees aslant, shot %d\n", shape, 1e3 * size,
                        1e3 * mass, speed, angle * 180.0 / M_PI, which);
        return isLost;
    }
};

void runShots() {
    Tally tally("shots at a sheet");
    for (const char* const shape : {"ball", "box", "capsule"})
        for (const double size : {0.005, 0.01})
            for (const double mass : {1e-3, 0.03})
                for (const double speed : {20.0, 60.0, 400.0})
                    for (const double degrees : {0.0, 30.0, 60.0})
                        for (int which = 0; which < 10; ++which)
                            tally.count(Shot{shape, size, mass, speed, degrees * M_PI / 180.0, which}.isFaulty());
}

}  // namespace
}  // namespace jacket::bullet::testing

int main(int argc, char** argv) {
    using namespace jacket::bullet::testing;
    const std::string only = argc > 1 ? argv[1] : "";
    if (argc > 2 || (argc == 2 && only != "plates" && only != "inclines" && only != "boxes" && only != "shots")) {
        std::fprintf(stderr, "usage: contact_bench [plates | inclines | boxes | shots]\n");
        return 2;
    }
    if (only.empty() || only == "plates") runPlates();
    if (only.empty() || only == "inclines") runInclines();
    if (only.empty() || only == "boxes") runSmallBoxes();
    if (only.empty() || only == "shots") runShots();
}
