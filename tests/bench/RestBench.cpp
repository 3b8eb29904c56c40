// Bodies that are set down on sheets of coarse and less coarse cells: which of them are thrown, sink in, go to and fro
// or leave contacts unsettled, where they should rest, or roll and swing in the dip that they make.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <memory>

#include "support/BulletScene.h"

namespace jacket::bullet::testing {
namespace {

constexpr double kSide = 0.6, kSeconds = 6.0, kLooked = 2.0;  // [m], [s], of these the last [s]
const char* const kShapes[] = {"box", "lying cylinder", "lying capsule", "standing cylinder", "ball"};

std::unique_ptr<btCollisionShape> make(int shape) {
    const auto vector = [](double x, double y, double z) { return btVector3(btScalar(x), btScalar(y), btScalar(z)); };
    if (shape == 0) return std::make_unique<btBoxShape>(vector(0.03, 0.02, 0.025));
    if (shape == 1) return std::make_unique<btCylinderShapeX>(vector(0.04, 0.02, 0.02));
    if (shape == 2) return std::make_unique<btCapsuleShapeX>(btScalar(0.02), btScalar(0.06));
    if (shape == 3) return std::make_unique<btCylinderShape>(vector(0.02, 0.03, 0.02));
    return std::make_unique<btSphereShape>(btScalar(0.025));
}

struct Setting {
    const char* name;
    ShellMaterial material;
    double mass;  ///< of the body [kg]
    int shape, cells;
    double h;       ///< [s]
    bool isPinned;  ///< by its border, or it lies on a floor
    double height() const { return isPinned ? 0.5 : 2e-3; }
};

/// What a body does in the last seconds.
struct Rest {
    double deepest = 0.0, speed = 0.0, spin = 0.0;  ///< [m], mean [m/s], most [rad/s]
    int unsettled = 0;                              ///< steps
    Vec3 end = Vec3::Zero();
    bool asleep = false;
};

Rest restOf(const Setting& setting) {
    BulletScene scene;
    scene.addFloor();
    TriangleMesh mesh = squareSheet(kSide, setting.cells);
    mesh.positions.row(1).array() += setting.height();
    auto& sheet = scene.shells->add(mesh, setting.material, {.friction = 0.5});
    if (setting.isPinned) pinBorder(sheet);
    auto& body = scene.addBody(make(setting.shape), setting.mass,
                               btVector3(btScalar(0.03), btScalar(setting.height() + 0.035), btScalar(0.05)));
    scene.run(kSeconds - kLooked, setting.h);
    Rest rest;
    btTransform last = body.getWorldTransform();
    const int steps = int(kLooked / setting.h + 0.5);
    for (int i = 0; i < steps; ++i) {
        scene.step(setting.h);
        const btTransform& now = body.getWorldTransform();
        rest.deepest = std::max(rest.deepest, penetration(sheet, body));
        rest.speed += double((now.getOrigin() - last.getOrigin()).length()) / kLooked;
        const btQuaternion turn = now.getRotation() * last.getRotation().inverse();
        rest.spin = std::max(rest.spin, double(turn.getAngleShortestPath()) / setting.h);
        rest.unsettled += scene.shells->lastStep().settled ? 0 : 1;
        last = now;
    }
    rest.end = toVec3(last.getOrigin());
    rest.asleep = sheet.isAsleep();
    return rest;
}

/// Why a body is not at rest, null if it is. What is round may roll and swing.
const char* faultOf(const Setting& setting, const Rest& rest) {
    const bool isRound = setting.shape == 1 || setting.shape == 2 || setting.shape == 4;
    const double most = 0.5 * kSide + 0.05;
    if (std::abs(rest.end.x()) > most || std::abs(rest.end.z()) > most || rest.end.y() < setting.height() - 0.3)
        return "gone";
    if (rest.deepest > 5e-4) return "deep";
    if (rest.unsettled > 5) return "unsettled";
    if (isRound ? rest.speed > 0.3 : rest.spin > 2.0 || rest.speed > 0.01) return "restless";
    return nullptr;
}

bool isFaulty(const Setting& setting) {
    const Rest rest = restOf(setting);
    const char* const fault = faultOf(setting, rest);
    if (!fault) return false;
    std::printf(
        "  %-9s %s of %g kg on %s, %d cells, %s, 1/%.0f s: %.2g mm deep, %d steps unsettled, %.2g m/s, %.2g rad/s%s\n",
        fault, kShapes[setting.shape], setting.mass, setting.name, setting.cells,
        setting.isPinned ? "pinned" : "on a floor", 1.0 / setting.h, 1e3 * rest.deepest, rest.unsettled, rest.speed,
        rest.spin, rest.asleep ? ", asleep" : "");
    return true;
}

void run(const char* name, const ShellMaterial& material) {
    int faulty = 0, all = 0;
    for (const double mass : {0.01, 0.1, 1.0})
        for (int shape = 0; shape < int(std::size(kShapes)); ++shape)
            for (const int cells : {2, 4, 7, 12})
                for (const double h : {1.0 / 60, 1.0 / 240})
                    for (const bool isPinned : {false, true}) {
                        faulty += isFaulty({name, material, mass, shape, cells, h, isPinned}) ? 1 : 0;
                        ++all;
                    }
    std::printf("%s: %d of %d are thrown, sink in, or do not come to rest\n", name, faulty, all);
}

}  // namespace
}  // namespace jacket::bullet::testing

int main() {
    using namespace jacket;
    bullet::testing::run("cotton", materials::cotton());
    bullet::testing::run("paper", materials::paper());
    bullet::testing::run("denim", materials::denim());
    bullet::testing::run("rubber", materials::rubber());
    bullet::testing::run("steel 1 mm", materials::steel(1e-3));
}
