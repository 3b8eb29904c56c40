#pragma once
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include "support/BulletScene.h"

/// Scenes whose outcome a rounding can decide: tests run them from a few starts, starts_bench from many.
namespace jacket::bullet::testing {

/// A triangulated surface y = height(x, z) over a square of given side about the origin, facing up.
inline std::unique_ptr<btTriangleMesh> surfaceMesh(double side, int cells,
                                                   const std::function<double(double, double)>& height,
                                                   double unit = 1.0) {
    auto mesh = std::make_unique<btTriangleMesh>();
    const auto at = [&](int i, int j) {
        const double x = side * (double(i) / cells - 0.5), z = side * (double(j) / cells - 0.5);
        return btVector3(btScalar(x / unit), btScalar(height(x, z) / unit), btScalar(z / unit));
    };
    for (int i = 0; i < cells; ++i)
        for (int j = 0; j < cells; ++j) {
            mesh->addTriangle(at(i, j), at(i, j + 1), at(i + 1, j + 1));
            mesh->addTriangle(at(i, j), at(i + 1, j + 1), at(i + 1, j));
        }
    return mesh;
}

/// Of an odd number of values, as of several starts.
inline double medianOf(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

inline void place(ShellBody& sheet, const Vec3& by) {
    std::vector<btVector3> x(sheet.positions().begin(), sheet.positions().end());
    for (btVector3& p : x) p += btVector3(btScalar(by.x()), btScalar(by.y()), btScalar(by.z()));
    sheet.setPositions(x);
}

/// Least height of a vertex above a surface [m].
inline double lowestClearance(const ShellBody& sheet, const std::function<double(double, double)>& height) {
    double lowest = std::numeric_limits<double>::infinity();
    for (const auto& p : sheet.shell().positions().colwise()) lowest = std::min(lowest, p.y() - height(p.x(), p.z()));
    return lowest;
}

/// The same, the least that it was in a run.
inline double lowestInRun(BulletScene& scene, const ShellBody& sheet, int steps, double h,
                          const std::function<double(double, double)>& height) {
    double lowest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < steps; ++i) {
        scene.step(h);
        lowest = std::min(lowest, lowestClearance(sheet, height));
    }
    return lowest;
}

/// A heightfield of 41 x 41 points, 4 cm apart, with a hill in its middle.
class Hill {
  public:
    Hill() : m_heights(n * n) {
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) {
                const double x = kCell * i - kHalf, z = kCell * j - kHalf;
                m_heights[j * n + i] = float(0.15 * std::exp(-(x * x + z * z) / 0.08));
            }
    }
    std::unique_ptr<btHeightfieldTerrainShape> shape() const {
        auto shape =
            std::make_unique<btHeightfieldTerrainShape>(n, n, m_heights.data(), btScalar(-1), btScalar(1), 1, false);
        shape->setLocalScaling(btVector3(btScalar(kCell), 1, btScalar(kCell)));
        return shape;
    }
    /// Between the grid's points, with the diagonal that Bullet draws: from (i, j + 1) to (i + 1, j).
    double height(double x, double z) const {
        const double u = (x + kHalf) / kCell, v = (z + kHalf) / kCell;
        const int i = std::clamp(int(u), 0, n - 2), j = std::clamp(int(v), 0, n - 2);
        const double a = u - i, b = v - j;
        const auto h = [&](int di, int dj) { return double(m_heights[(j + dj) * n + i + di]); };
        return a + b <= 1 ? h(0, 0) + a * (h(1, 0) - h(0, 0)) + b * (h(0, 1) - h(0, 0))
                          : h(1, 1) + (1 - a) * (h(0, 1) - h(1, 1)) + (1 - b) * (h(1, 0) - h(1, 1));
    }

    /// The same, none beyond its border.
    double groundAt(double x, double z) const {
        return std::max(std::abs(x), std::abs(z)) < kHalf ? height(x, z) : -std::numeric_limits<double>::infinity();
    }

  private:
    static constexpr int n = 41;
    static constexpr double kCell = 0.04, kHalf = 0.8;
    std::vector<float> m_heights;
};

/// A cloth of 0.8 m falls on the hill, `aside` metres beside its place. The shape reads the hill, which goes last.
struct HillScene : private Hill, BulletScene {
    explicit HillScene(double aside, int cells = 16) : sheet(shells->add(squareSheet(0.8, cells), trampolineCloth())) {
        addBody(shape(), 0, btVector3(0, 0, 0));
        place(sheet, {0.01 + aside, 0.17, 0.02});
    }
    /// Flung at it: how far vertices get below the ground [m], and the most energy, of the start's.
    struct Impact {
        double deepest = 0.0, mostEnergy = 0.0;
    };
    Impact fling(double speed, double h) {
        place(sheet, {0, 0.025 * speed, 0});
        sheet.setVelocity(btVector3(0, btScalar(-speed), 0));
        Impact impact;
        const double start = energy(*this).total();
        for (double t = 0.0; t < 0.8; t += h) {
            step(h);
            impact.deepest = std::max(impact.deepest,
                                      -lowestClearance(sheet, [this](double x, double z) { return groundAt(x, z); }));
            impact.mostEnergy = std::max(impact.mostEnergy, energy(*this).total() / start);
        }
        return impact;
    }
    /// Least height of a vertex above the ground while it drapes [m].
    double lowest() {
        return lowestInRun(*this, sheet, 180, 1.0 / 120, [this](double x, double z) { return height(x, z); });
    }
    ShellBody& sheet;
};

/// Two walls at an angle [degrees] to each other.
struct ValleyWalls {
    explicit ValleyWalls(double angle)
        : slope(1.0 / std::tan(angle / 2 * std::numbers::pi / 180)),
          mesh(surfaceMesh(2, 2, [this](double x, double z) { return height(x, z); })) {}
    double height(double x, double) const { return slope * std::abs(x); }
    double slope;
    std::unique_ptr<btTriangleMesh> mesh;
};

/// A cloth of 0.4 m falls into the valley between them, `aside` metres beside its middle.
struct ValleyScene : ValleyWalls, BulletScene {
    ValleyScene(double angle, double aside)
        : ValleyWalls(angle), sheet(shells->add(squareSheet(0.4, 8), trampolineCloth(), {.friction = 0.1})) {
        addBody(std::make_unique<btBvhTriangleMeshShape>(mesh.get(), true), 0, btVector3(0, 0, 0));
        place(sheet, {aside, 0.21 * slope, 0.0});
    }
    double lowest() {
        return lowestInRun(*this, sheet, 240, 1.0 / 120, [this](double x, double z) { return height(x, z); });
    }
    ShellBody& sheet;
};

/// Boxes of 0.5 kg on each other, on a cloth on a table, the lowest `aside` metres beside its place.
struct StackScene : BulletScene {
    StackScene(int count, double aside)
        : cloth([this]() -> ShellBody& {
              addBox(btVector3(1, btScalar(0.1), 1), 0, btVector3(0, btScalar(-0.1), 0));
              TriangleMesh mesh = squareSheet(0.6, 8);
              mesh.positions.row(1).array() += 2e-4;
              return shells->add(mesh, trampolineCloth());
          }()) {
        for (int i = 0; i < count; ++i)
            boxes.push_back(&addBox(btVector3(btScalar(0.1), btScalar(0.1), btScalar(0.1)), 0.5,
                                    btVector3(btScalar(i == 0 ? aside : 0.0), btScalar(0.101 + 0.201 * i), 0)));
    }
    /// How far a box is from where it began, across [m].
    double crept(int i) const {
        const btVector3 place = boxes[i]->getWorldTransform().getOrigin();
        return std::hypot(double(place.x()), double(place.z()));
    }
    double upright(int i) const { return double(boxes[i]->getWorldTransform().getBasis()[1].y()); }

    ShellBody& cloth;
    std::vector<btRigidBody*> boxes;
};

/// A ball of 2 kg in a sheet that is pinned at its border. Without `angularDamping` (see btRigidBody::setDamping)
/// nothing but the sheet takes the energy with which it rolls to and fro.
struct RestingBall {
    static constexpr double kWeight = 2.0 * 9.81;

    BulletScene scene;
    btRigidBody& ball;
    ShellBody& sheet;

    explicit RestingBall(int cells, double angularDamping = 0.0)
        : ball(scene.addSphere(0.25, 2.0, btVector3(0, btScalar(0.26), 0))),
          sheet(scene.shells->add(squareSheet(2, cells), cloth(), {.sleeping = false})) {
        ball.setActivationState(DISABLE_DEACTIVATION);
        ball.setDamping(0, btScalar(angularDamping));
        pinBorder(sheet);
        scene.run(10.0, kStep);
    }
    static ShellMaterial cloth() {
        ShellMaterial m = trampolineCloth();
        m.massDamping = 5.0;
        return m;
    }
    /// One step; what the sheet bears of the ball in it over the ball's weight, less 1.
    double step() {
        scene.step(kStep);
        return jacket::testing::contactImpulse(sheet, ball).y() / kStep / kWeight - 1.0;
    }
    Vec3 position() const { return toVec3(ball.getWorldTransform().getOrigin()); }
};

}  // namespace jacket::bullet::testing
