// What contact is to do by theory, over more sheets, places and steps than the tests have time for: metal that is laid
// on boxes, sheets that fall over crates or lie on an incline, boxes much smaller than the triangles that they fall on,
// bullets that come aslant.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <memory>
#include <string>
#include <utility>

#include "support/Incline.h"
#include "support/PlateScene.h"
#include "support/SmallBox.h"
#include "support/Target.h"

namespace jacket::bullet::testing {
namespace {

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

const Named kSteel{"steel 0.5 mm", materials::steel(5e-4)}, kThickSteel{"steel 1 mm", materials::steel(1e-3)};
const Named kRubber{"rubber", materials::rubber()}, kPaper{"paper", materials::paper()};
const Named kCotton{"cotton", materials::cotton()};
const Named* const kSoftAndStiff[] = {&kCotton, &kPaper, &kRubber, &kSteel};

bool isFaulty(const char* material, const PlateScene& scene) {
    const SheetOutcome outcome = scene.run();
    const char* const fault = outcome.fault();
    if (fault)
        std::printf(
            "  %-9s %s of %g m, %d cells, on a %s box, %g mm aside, %g mm above, 1/%.0f s: %.2g mm deep, at most "
            "%.2g m/s, %d steps unsettled, the box shoved by %.2g mm\n",
            fault, material, scene.side, scene.cells, scene.boxMass > 0.0 ? "free" : "fixed", 1e3 * scene.aside,
            1e3 * scene.above, 1.0 / scene.h, 1e3 * outcome.deepest, outcome.fastest, outcome.unsettled,
            1e3 * outcome.shoved);
    return fault;
}

void runPlates() {
    Tally tally("plates on a box of 60 cm");
    for (const Named* kind : {&kSteel, &kThickSteel, &kRubber, &kPaper})
        for (const double side : {0.6, 0.9})
            for (const int cells : {2, 6, 12})
                for (const double h : {1.0 / 60, 1.0 / 240})
                    for (const double aside : {0.0, 0.003})
                        for (const double above : {0.0, 0.5 * kind->material.thickness + 1e-4})
                            for (const double boxMass : {0.0, 20.0})
                                tally.count(
                                    isFaulty(kind->name, {kind->material, side, cells, h, boxMass, aside, above}));
}

void runDrapes() {
    for (const double boxMass : {0.0, 2.0, 20.0}) {
        const std::string name = "sheets that fall flat on a crate of 30 cm, " + std::to_string(int(boxMass)) + " kg";
        Tally tally(name.c_str());
        for (const Named* kind : {&kCotton, &kPaper, &kRubber})
            for (const int cells : {12, 24, 48})
                for (const double above : {0.01, 0.1, 0.5})
                    for (const double aside : {0.03, 0.041})
                        tally.count(
                            isFaulty(kind->name, {kind->material, 1.2, cells, 1.0 / 60, boxMass, aside, above, 0.3}));
    }
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
    Tally tally("sheets on an incline");
    for (const Named* kind : kSoftAndStiff)
        for (const double side : {0.2, 1.0})
            for (const int cells : {2, 5, 12})
                for (const double h : {1.0 / 60, 1.0 / 240}) {
                    const Inclined sheet{*kind, side, cells, h};
                    for (const double friction : {0.37, 0.5}) tally.count(sheet.isFaultyHeld(friction));
                    for (const double friction : {0.2, 0.35}) tally.count(sheet.isFaultySliding(friction));
                }
}

/// Whether a box ends below the sheet and no step said that it may have passed.
bool isSmallBoxLost(unsigned seed, const Named& of) {
    const SmallBox box(seed, of.material);
    if (box.isBelow)
        std::printf("  %-9s box %u of %.2g kg, %.2g m/s on %s, %d cells, 1/%.0f s\n", box.isSaid ? "(said)" : "lost",
                    seed, box.mass, box.speed, of.name, box.cells, 1.0 / box.h);
    return box.isBelow && !box.isSaid;
}

void runSmallBoxes() {
    Tally tally("boxes of 1 to 3 cm on cells of 20 to 50 cm");
    for (unsigned seed = 0; seed < 1000; ++seed) tally.count(isSmallBoxLost(seed, *kSoftAndStiff[seed % 4]));
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
    const std::pair<std::string, void (*)()> kinds[] = {{"plates", runPlates},
                                                        {"drapes", runDrapes},
                                                        {"inclines", runInclines},
                                                        {"boxes", runSmallBoxes},
                                                        {"shots", runShots}};
    const std::string only = argc > 1 ? argv[1] : "";
    const auto isAsked = [&](const auto& kind) { return only.empty() || kind.first == only; };
    if (argc > 2 || std::none_of(std::begin(kinds), std::end(kinds), isAsked)) {
        std::fprintf(stderr, "usage: contact_bench [plates | drapes | inclines | boxes | shots]\n");
        return 2;
    }
    for (const auto& kind : kinds)
        if (isAsked(kind)) kind.second();
}
