// Sheets that are held inside bodies, or begin in them: what their steps cost, and what is thrown, torn or stays
// inside. Times are of this machine; compare those of one run.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <string>

#include "support/EmbeddedScenes.h"

namespace jacket::bullet::testing {
namespace {

struct Named {
    const char* name;
    ShellMaterial material;
};

const Named kMaterials[] = {{"cotton", materials::cotton()},
                            {"paper", materials::paper()},
                            {"rubber", materials::rubber()},
                            {"steel 0.5 mm", materials::steel(5e-4)}};

/// One line a scene and mesh, over materials and steps; one besides for each that goes wrong.
void runHeld(const EmbeddedScene& scene, int cells) {
    SheetRun sum;
    int all = 0, faulty = 0;
    for (const Named& of : kMaterials)
        for (const double h : {1.0 / 20, 1.0 / 60, 1.0 / 240}) {
            const SheetRun run = scene.run(of.material, cells, h);
            const char* const fault = run.outcome.fault(scene.fastest);
            if (fault)
                std::printf("  %-9s %s, 1/%.0f s: at most %.2g m/s, %.2g mm deep, stretched by %.2g, %d unsettled\n",
                            fault, of.name, 1.0 / h, run.outcome.fastest, 1e3 * run.outcome.deepest, run.stretch,
                            run.outcome.unsettled);
            faulty += fault ? 1 : 0;
            ++all;
            sum.add(run);
        }
    std::printf(
        "%-28s %2d cells: %5.1f solves, at most %4d; %6.2f ms, at most %5.0f; at most %5.2f m/s, stretched by %.2g; "
        "%d of %d go wrong\n",
        scene.name, cells, double(sum.solves) / sum.steps, sum.most, 1e3 * sum.seconds / sum.steps, 1e3 * sum.longest,
        sum.outcome.fastest, sum.stretch, faulty, all);
    std::fflush(stdout);
}

std::unique_ptr<btCollisionShape> makeBall() {
    return std::make_unique<btSphereShape>(btScalar(0.25));
}
std::unique_ptr<btCollisionShape> makeCrate() {
    return embedded_scenes::makeBox(0.2, 0.2, 0.2);
}
std::unique_ptr<btCollisionShape> makeLog() {
    return std::make_unique<btCapsuleShapeX>(btScalar(0.15), btScalar(0.4));
}
void pinEdge(ShellBody& sheet) {
    for (const int i : embedded_scenes::verticesWhere(sheet, [](const Vec3& x) { return x.x() < -0.499; }))
        sheet.pin(i);
}
void leaveFree(ShellBody&) {}

struct Form {
    const char* name;
    std::unique_ptr<btCollisionShape> (*make)();
};
constexpr Form kForms[] = {{"ball", makeBall}, {"crate", makeCrate}, {"log", makeLog}};
struct Hold {
    const char* name;
    void (*hold)(ShellBody&);
};
constexpr Hold kHolds[] = {{"its border", pinBorder}, {"one edge", pinEdge}, {"nothing", leaveFree}};

/// Sheets of 1 m that begin in a fixed body, in its middle or above.
void runBegun(const Form& form, const Hold& hold) {
    constexpr int kSteps = 120, kCells = 12;
    int solves = 0, most = 0, out = 0, all = 0;
    SheetOutcome outcome;  // of all
    for (const Named& of : kMaterials)
        for (const double height : {0.0, 0.05, 0.1}) {
            BulletScene scene;
            const auto& body =
                scene.addBody(form.make(), 0.0, btVector3(btScalar(-0.02), btScalar(-height), btScalar(0.05)));
            auto& sheet = scene.shells->add(squareSheet(1.0, kCells), of.material, {.friction = 0.5});
            hold.hold(sheet);
            for (int i = 0; i < kSteps; ++i) {
                scene.step(kStep);
                solves += scene.shells->lastStep().solves;
                most = std::max(most, int(scene.shells->lastStep().solves));
                outcome.note(scene, sheet, 0.0);
            }
            out += penetration(sheet, body) < 1e-3 ? 1 : 0;
            ++all;
        }
    std::printf(
        "begins in a %-5s held by %-10s %6.1f solves, at most %4d; %d steps unsettled; at most %.2g m/s; %d of "
        "%d come out\n",
        form.name, hold.name, double(solves) / (all * kSteps), most, outcome.unsettled, outcome.fastest, out, all);
    std::fflush(stdout);
}

void runHeld(const std::string& only) {
    for (const int cells : {8, 14, 28})
        for (const EmbeddedScene& scene : embedded_scenes::all())
            if (std::string(scene.name).find(only) != std::string::npos) runHeld(scene, cells);
}

void runBegun() {
    for (const Form& form : kForms)
        for (const Hold& hold : kHolds) runBegun(form, hold);
}

}  // namespace
}  // namespace jacket::bullet::testing

int main(int argc, char** argv) {
    using namespace jacket::bullet::testing;
    const std::string part = argc > 1 ? argv[1] : "", only = argc > 2 ? argv[2] : "";
    if (argc > 3 || (!part.empty() && part != "held" && part != "begun")) {
        std::fprintf(stderr, "usage: embedded_bench [held [part of a scene's name] | begun]\n");
        return 2;
    }
    if (part != "begun") runHeld(only);
    if (part != "held") runBegun();
}
