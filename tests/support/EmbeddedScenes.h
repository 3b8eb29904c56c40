#pragma once
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "support/SheetOutcome.h"

namespace jacket::bullet::testing {

/// A sheet of 60 cm that is held inside a body, as users hold flags, curtains and capes: tests run some of the scenes,
/// embedded_bench all.
struct EmbeddedScene {
    /// Who is held in what; and how the user moves the body, and then the pins, if it does.
    struct Held {
        ShellBody& sheet;
        btRigidBody& body;
        std::function<void(double time)> move = nullptr;
    };

    const char* name;
    double fastest;  ///< a vertex that moves faster was thrown [m/s]
    std::function<Held(BulletScene&, const ShellMaterial&, int cells)> make;

    /// Deepest is a vertex that began outside of the body.
    SheetRun run(const ShellMaterial& material, int cells, double h, double seconds = 2.0) const {
        BulletScene scene;
        const Held held = make(scene, material, cells);
        const std::vector<int> outside = verticesOutside(held);
        SheetRun run;
        for (double t = 0.0; t < seconds - 0.5 * h; t += h) {
            if (held.move) held.move(t + h);
            run.step(scene, held.sheet, h, [&] {
                double depth = 0.0;
                for (const int vertex : outside) depth = std::max(depth, -distance(held, vertex));
                return depth;
            });
        }
        return run;
    }

    /// From the body's true surface, < 0: inside [m].
    static double distance(const Held& held, int vertex) {
        const btVector3 local = held.body.getWorldTransform().inverse() * held.sheet.positions()[vertex];
        return jacket::testing::detail::signedDistance(*held.body.getCollisionShape(), toVec3(local));
    }
    static std::vector<int> verticesOutside(const Held& held) {
        std::vector<int> outside;
        for (int i = 0; i < held.sheet.vertexCount(); ++i)
            if (distance(held, i) > 0.0) outside.push_back(i);
        return outside;
    }
};

namespace embedded_scenes {

constexpr double kSide = 0.6;          ///< of the sheets [m]
constexpr double kTop = 1.5;           ///< of those that hang [m]
constexpr double kHair = 1e-9 * kTop;  ///< [m]

inline ShellBody& addLying(BulletScene& scene, const ShellMaterial& material, int cells, const Vec3& middle) {
    TriangleMesh mesh = squareSheet(kSide, cells);
    mesh.positions.colwise() += middle;
    return scene.shells->add(mesh, material, {.friction = 0.5});
}

/// From x = 0 on, below kTop.
inline ShellBody& addHanging(BulletScene& scene, const ShellMaterial& material, int cells, double z = 0.0) {
    TriangleMesh mesh = squareSheet(kSide, cells);
    for (Eigen::Index i = 0; i < mesh.positions.cols(); ++i)
        mesh.positions.col(i) = Vec3(0.5 * kSide + mesh.positions(0, i), kTop - 0.5 * kSide + mesh.positions(2, i), z);
    return scene.shells->add(mesh, material, {.friction = 0.5});
}

/// Of those vertices of which `is` says so of their places.
inline std::vector<int> verticesWhere(const ShellBody& sheet, const std::function<bool(const Vec3&)>& is) {
    std::vector<int> vertices;
    for (int i = 0; i < sheet.vertexCount(); ++i)
        if (is(sheet.shell().positions().col(i))) vertices.push_back(i);
    return vertices;
}
inline void pinWhere(ShellBody& sheet, const std::function<bool(const Vec3&)>& is) {
    for (const int i : verticesWhere(sheet, is)) sheet.pin(i);
}
inline void anchorWhere(ShellBody& sheet, btRigidBody& body, const std::function<bool(const Vec3&)>& is) {
    for (const int i : verticesWhere(sheet, is)) sheet.anchor(i, body);
}
inline bool isOnPole(const Vec3& x) {
    return x.x() < kHair;
}
inline bool isAtTop(const Vec3& x) {
    return x.y() > kTop - kHair;
}
inline bool isAtBottom(const Vec3& x) {
    return x.y() < kTop - kSide + kHair;
}

inline std::unique_ptr<btCollisionShape> makeBox(double x, double y, double z) {
    return std::make_unique<btBoxShape>(btVector3(btScalar(x), btScalar(y), btScalar(z)));
}
inline std::unique_ptr<btCollisionShape> makePole() {
    return std::make_unique<btCapsuleShape>(btScalar(0.03), btScalar(1.6));
}
inline std::unique_ptr<btCollisionShape> makeSquarePole() {
    return makeBox(0.03, 0.8, 0.03);
}

/// A flag in the wind, by the axis of its pole.
inline EmbeddedScene flag(const char* name, bool isAnchored, bool byCorners = false,
                          std::unique_ptr<btCollisionShape> (*shape)() = makePole) {
    return {name, 4.0, [=](BulletScene& scene, const ShellMaterial& material, int cells) -> EmbeddedScene::Held {
                scene.shells->setWind({.velocity = Vec3(3, 0, 2)});
                auto& pole = scene.addBody(shape(), 0.0, btVector3(0, btScalar(0.8), 0));
                auto& sheet = addHanging(scene, material, cells);
                for (const int i : verticesWhere(sheet, isOnPole)) {
                    const Vec3 x = sheet.shell().positions().col(i);
                    if (byCorners && !isAtTop(x) && !isAtBottom(x)) continue;
                    if (isAnchored)
                        sheet.anchor(i, pole);
                    else
                        sheet.pin(i);
                }
                return {sheet, pole};
            }};
}

/// By its upper edge, in the middle of a ceiling.
inline EmbeddedScene curtain(const char* name) {
    return {name, 4.0, [](BulletScene& scene, const ShellMaterial& material, int cells) -> EmbeddedScene::Held {
                scene.shells->setWind({.velocity = Vec3(1, 0, 3)});
                auto& ceiling = scene.addBody(makeBox(1, 0.1, 1), 0.0, btVector3(0, btScalar(kTop), 0));
                auto& sheet = addHanging(scene, material, cells);
                pinWhere(sheet, isAtTop);
                return {sheet, ceiling};
            }};
}

/// By one edge in a wall; it swings down.
inline EmbeddedScene awning(const char* name) {
    return {name, 6.0, [](BulletScene& scene, const ShellMaterial& material, int cells) -> EmbeddedScene::Held {
                auto& wall = scene.addBody(makeBox(0.1, 1, 1), 0.0, btVector3(btScalar(-0.05), 1, 0));
                auto& sheet = addLying(scene, material, cells, Vec3(0.5 * kSide, 1.5, 0));
                pinWhere(sheet, isOnPole);
                return {sheet, wall};
            }};
}

/// By its upper edge, inside a figure that walks to and fro at up to 1 m/s and turns.
inline EmbeddedScene cape(const char* name, bool isAnchored) {
    return {name, 6.0, [=](BulletScene& scene, const ShellMaterial& material, int cells) -> EmbeddedScene::Held {
                constexpr double kMiddle = 1.3;
                auto& figure = scene.addBody(std::make_unique<btCapsuleShape>(btScalar(0.15), btScalar(0.5)), 0.0,
                                             btVector3(btScalar(0.5 * kSide), btScalar(kMiddle), 0));
                makeKinematic(figure);
                auto& sheet = addHanging(scene, material, cells, -0.1);
                const std::vector<int> top = verticesWhere(sheet, isAtTop);
                std::vector<btVector3> local;
                for (const int i : top) {
                    local.push_back(figure.getWorldTransform().inverse() * sheet.positions()[i]);
                    if (isAnchored)
                        sheet.anchor(i, figure);
                    else
                        sheet.pin(i);
                }
                return {sheet, figure, [=, &sheet, &figure](double t) {
                            const btQuaternion turn(btVector3(0, 1, 0), btScalar(0.8 * std::sin(3.0 * t)));
                            const btVector3 at(btScalar(0.5 * kSide), btScalar(kMiddle),
                                               btScalar(0.5 - 0.5 * std::cos(2.0 * t)));
                            figure.setWorldTransform(btTransform(turn, at));
                            for (std::size_t k = 0; !isAnchored && k < top.size(); ++k)
                                sheet.movePin(top[k], figure.getWorldTransform() * local[k]);
                        }};
            }};
}

/// A ball in the middle of a sheet that is pinned around, tied to it within some distance of its centre.
inline EmbeddedScene ballInSheet(const char* name, double radius, double within) {
    return {name, 4.0, [=](BulletScene& scene, const ShellMaterial& material, int cells) -> EmbeddedScene::Held {
                auto& ball = scene.addSphere(btScalar(radius), btScalar(0.5), btVector3(0, 1, 0));
                auto& sheet = addLying(scene, material, cells, Vec3(0, 1, 0));
                pinBorder(sheet);
                const auto isIn = [=](const Vec3& x) { return (x - Vec3(0, 1, 0)).norm() < within; };
                anchorWhere(sheet, ball, isIn);
                return {sheet, ball};
            }};
}

/// A block of 5 kg that hangs on a strip of cloth, whose last row is tied in its middle.
inline EmbeddedScene hangingBlock(const char* name) {
    return {name, 4.0, [](BulletScene& scene, const ShellMaterial& material, int cells) -> EmbeddedScene::Held {
                auto& block = scene.addBody(makeBox(0.32, 0.1, 0.1), 5.0,
                                            btVector3(btScalar(0.5 * kSide), btScalar(kTop - kSide), 0));
                auto& sheet = addHanging(scene, material, cells);
                pinWhere(sheet, isAtTop);
                anchorWhere(sheet, block, isAtBottom);
                return {sheet, block};
            }};
}

inline std::vector<EmbeddedScene> all() {
    return {flag("flag pinned in its pole", false),
            flag("flag anchored in its pole", true),
            flag("flag in a square pole", false, false, makeSquarePole),
            flag("flag pinned by two corners", false, true),
            curtain("curtain in a ceiling"),
            awning("awning in a wall"),
            cape("cape anchored in a figure", true),
            cape("cape pinned in a figure", false),
            ballInSheet("ball tied by its centre", 0.1, 0.05),
            ballInSheet("ball tied by a patch", 0.15, 0.09),
            hangingBlock("block that hangs on a strip")};
}

}  // namespace embedded_scenes
}  // namespace jacket::bullet::testing
