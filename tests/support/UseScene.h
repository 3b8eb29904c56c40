#pragma once
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "support/EmbeddedScenes.h"

namespace jacket::bullet::testing {

/// A thing as users build it of a shell and bodies. Tests run some of them, uses_bench all.
struct UseScene {
    /// What is in it; and how the user moves something before the step that ends at a time.
    struct Things {
        ShellBody& sheet;
        Bodies bodies;
        std::function<void(double time)> move = nullptr;
    };
    struct Run : SheetRun {
        double fastestBody = 0.0;  ///< [m/s]
    };

    const char* name;
    double seconds;
    double fastest;                      ///< a vertex that moves faster was thrown [m/s]
    std::vector<std::string> materials;  ///< of `byName`, at their usual thickness
    /// `fineness`: 1, 2, ...
    std::function<Things(BulletScene&, const ShellMaterial&, int fineness)> make;

    /// `use(run, material, h)`: of each of its materials, in steps of 1/60 and 1/240 s.
    template <class Use>
    void runAll(int fineness, Use use) const {
        for (const std::string& material : materials)
            for (const double h : {1.0 / 60, 1.0 / 240}) use(run(material, fineness, h), material, h);
    }

    Run run(const std::string& material, int fineness, double h) const {
        BulletScene scene;
        const Things things = make(scene, materials::byName(material), fineness);
        Run run;
        for (double t = 0.0; t < seconds - 0.5 * h; t += h) {
            if (things.move) things.move(t + h);
            run.step(scene, things.sheet, h, [&] { return deepestIn(things.bodies, things.sheet); });
            for (const btRigidBody* body : things.bodies)
                run.fastestBody = std::max(run.fastestBody, double(body->getLinearVelocity().length()));
        }
        return run;
    }
};

namespace use_scenes {

using Things = UseScene::Things;
using embedded_scenes::anchorWhere;
using embedded_scenes::pinWhere;
using embedded_scenes::verticesWhere;

inline btVector3 vector(double x, double y, double z) {
    return {btScalar(x), btScalar(y), btScalar(z)};
}
inline btRigidBody& addBall(BulletScene& scene, double radius, double mass, const btVector3& at,
                            const btVector3& velocity = {0, 0, 0}) {
    btRigidBody& ball = scene.addSphere(radius, mass, at);
    ball.setLinearVelocity(velocity);
    return ball;
}
inline void moveTo(btRigidBody& body, const btVector3& at, const btQuaternion& turn = btQuaternion::getIdentity()) {
    body.setWorldTransform(btTransform(turn, at));
}
/// Its length is that of its cylinder, along its own y [m].
inline btRigidBody& addCapsule(BulletScene& scene, double radius, double length, double mass, const btVector3& at,
                               const btQuaternion& turn = btQuaternion::getIdentity()) {
    auto& body = scene.addBody(std::make_unique<btCapsuleShape>(btScalar(radius), btScalar(length)), mass, at);
    moveTo(body, at, turn);
    return body;
}
/// A character: a capsule that is kept upright and awake, for its user to walk.
inline btRigidBody& addWalker(BulletScene& scene, double radius, double length, double mass, const btVector3& at) {
    auto& walker = addCapsule(scene, radius, length, mass, at);
    walker.setAngularFactor(0);
    walker.setActivationState(DISABLE_DEACTIVATION);
    return walker;
}
/// By its velocity along x and z; it falls as it does.
inline void walk(btRigidBody& walker, double x, double z) {
    walker.setLinearVelocity(vector(x, double(walker.getLinearVelocity().y()), z));
}
/// Pins that their user moves together, by vertex, and where they were.
using Pins = std::vector<std::pair<int, btVector3>>;
inline Pins pinAll(ShellBody& sheet, const std::vector<int>& vertices) {
    Pins pins;
    for (const int vertex : vertices) {
        sheet.pin(vertex);
        pins.emplace_back(vertex, sheet.positions()[vertex]);
    }
    return pins;
}
inline void movePins(ShellBody& sheet, const Pins& pins, const btVector3& by) {
    for (const auto& [vertex, at] : pins) sheet.movePin(vertex, at + by);
}
inline TriangleMesh moved(TriangleMesh mesh, const Vec3& by) {
    mesh.positions.colwise() += by;
    return mesh;
}
/// Upright, in the plane z = 0 around `middle`.
inline TriangleMesh upright(double width, double height, int across, int down, const Vec3& middle) {
    return moved(makeGrid({.size = {width, height}, .cells = {across, down}, .plane = GridPlane::XY}), middle);
}

inline const std::vector<std::string> kSoft{"cotton", "rubber", "paper"};

}  // namespace use_scenes
}  // namespace jacket::bullet::testing
