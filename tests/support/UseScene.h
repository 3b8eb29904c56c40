#pragma once
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
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
