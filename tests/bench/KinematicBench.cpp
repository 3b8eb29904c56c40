// Bodies that their user moves against sheets: which of them come into a sheet, throw it, or leave contacts unsettled.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <memory>
#include <numbers>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

constexpr double kSide = 0.8, kSeconds = 4.0;  // [m], [s]
const char* const kShapes[] = {"ball", "box", "capsule", "disc", "rod"};
constexpr double kHalfHeights[] = {0.08, 0.05, 0.04, 0.04, 0.05};  // of each [m]

btVector3 vector(double x, double y, double z) {
    return {btScalar(x), btScalar(y), btScalar(z)};
}

btTransform at(double x, double y, const btQuaternion& turn = btQuaternion::getIdentity()) {
    return btTransform(turn, vector(x, y, 0.02));
}

std::unique_ptr<btCollisionShape> make(int shape) {
    if (shape == 0) return std::make_unique<btSphereShape>(btScalar(0.08));
    if (shape == 1) return std::make_unique<btBoxShape>(vector(0.1, 0.05, 0.1));
    if (shape == 2) return std::make_unique<btCapsuleShapeX>(btScalar(0.04), btScalar(0.2));
    if (shape == 3) return std::make_unique<btCylinderShape>(vector(0.12, 0.04, 0.12));
    return std::make_unique<btCylinderShapeZ>(vector(0.05, 0.05, 0.3));
}

/// How a body is moved, and how the sheet is held that it meets.
struct Course {
    const char* name;
    btTransform (*pose)(double time, double halfHeight);  ///< [s], of the body [m]
    double height;                                        ///< of the sheet at the start [m]
    bool isPinned = false;                                ///< by its border
    bool isOnShelves = false;                             ///< by two of its edges
};

btTransform pressDown(double t, double half) {
    return at(0.03, 0.54 + half - 0.15 * std::min({t, 1.0, std::max(0.0, 3.0 - t)}));
}
btTransform lift(double t, double half) {
    return at(0.03, 0.3 - half + std::min(0.5 * std::max(t - 0.2, 0.0), 0.7));
}
btTransform shake(double t, double) {
    return at(t < 1.0 || t > 3.0 ? 0.0 : 0.1 * std::sin(2.0 * std::numbers::pi * (t - 1.0)), 0.4);
}
btTransform turn(double t, double) {
    return at(0.0, 0.4, btQuaternion(vector(0, 1, 0), btScalar(2.0 * std::clamp(t - 0.5, 0.0, 2.5))));
}
btTransform push(double t, double half) {
    return at(-0.6 + std::min(0.3 * t, 0.9), half + 5e-3);
}
btTransform spin(double t, double) {
    const btQuaternion turn(vector(0, 0, 1), btScalar(6.0 * std::min(t, 3.0)));
    return at(0.03, std::min(0.38 + 0.05 * t, 0.45), turn);
}

constexpr Course kCourses[] = {{"pressed down on a pinned sheet", pressDown, 0.5, true},
                               {"lifts a sheet off shelves", lift, 0.403, false, true},
                               {"shaken under a sheet", shake, 0.52},
                               {"turned under a sheet", turn, 0.52},
                               {"pushed over a sheet on a floor", push, 3e-3},
                               {"spins under a pinned sheet", spin, 0.5, true}};

struct Setting {
    const char* name;
    ShellMaterial material;
    const Course* course;
    int shape, cells;
    double h;  ///< [s]
};

struct Outcome {
    double deepest = 0.0, fastest = 0.0;  ///< [m], [m/s]
    int unsettled = 0;                    ///< steps
};

Outcome outcomeOf(const Setting& setting) {
    const double half = kHalfHeights[setting.shape];
    BulletScene scene;
    scene.addFloor();
    for (const double side : {-1.0, 1.0})
        if (setting.course->isOnShelves) scene.addBox(vector(0.05, 0.2, 0.6), 0.0, vector(0.35 * side, 0.2, 0.0));
    TriangleMesh mesh = squareSheet(kSide, setting.cells);
    mesh.positions.row(1).array() += setting.course->height;
    auto& sheet = scene.shells->add(mesh, setting.material, {.friction = 0.5});
    if (setting.course->isPinned) pinBorder(sheet);
    auto& body = scene.addBody(make(setting.shape), 0.0, setting.course->pose(0.0, half).getOrigin());
    makeKinematic(body);
    Outcome outcome;
    for (double t = setting.h; t < kSeconds; t += setting.h) {
        body.setWorldTransform(setting.course->pose(t, half));
        scene.step(setting.h);
        outcome.deepest =
            std::max({outcome.deepest, penetration(sheet, body), -sheet.shell().positions().row(1).minCoeff()});
        outcome.fastest = std::max(outcome.fastest, sheet.shell().velocities().colwise().norm().maxCoeff());
        outcome.unsettled += scene.shells->lastStep().settled ? 0 : 1;
    }
    return outcome;
}

/// What is wrong, null if nothing is. No body moves faster than 0.75 m/s, and nothing falls from higher than 1 m.
const char* faultOf(const Outcome& outcome) {
    if (outcome.deepest > 5e-4) return "deep";
    if (outcome.fastest > 5.0) return "thrown";
    if (outcome.unsettled > 5) return "unsettled";
    return nullptr;
}

bool isFaulty(const Setting& setting) {
    const Outcome outcome = outcomeOf(setting);
    const char* const fault = faultOf(outcome);
    if (!fault) return false;
    std::printf("  %-9s %s %s: %s, %d cells, 1/%.0f s: %.2g mm deep, at most %.2g m/s, %d steps unsettled\n", fault,
                kShapes[setting.shape], setting.course->name, setting.name, setting.cells, 1.0 / setting.h,
                1e3 * outcome.deepest, outcome.fastest, outcome.unsettled);
    return true;
}

void run(const char* name, const ShellMaterial& material) {
    int faulty = 0, all = 0;
    for (const Course& course : kCourses)
        for (int shape = 0; shape < int(std::size(kShapes)); ++shape)
            for (const int cells : {5, 12})
                for (const double h : {1.0 / 60, 1.0 / 240}) {
                    faulty += isFaulty({name, material, &course, shape, cells, h}) ? 1 : 0;
                    ++all;
                }
    std::printf("%s: %d of %d go wrong\n", name, faulty, all);
    std::fflush(stdout);
}

}  // namespace
}  // namespace jacket::bullet::testing

int main() {
    using namespace jacket;
    bullet::testing::run("cotton", materials::cotton());
    bullet::testing::run("paper", materials::paper());
    bullet::testing::run("rubber", materials::rubber());
    bullet::testing::run("steel 0.5 mm", materials::steel(5e-4));
}
