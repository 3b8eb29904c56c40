#pragma once
#include <LinearMath/btTransformUtil.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "support/BulletScene.h"
#include "support/Random.h"

namespace jacket::bullet::testing {

/// A sheet over a floor, and one to four bodies that fall onto it or stand below it: a game's, and some that no game
/// has. Masses are 0.01 to 100 times the sheet's, speeds up to 12 m/s, steps 1/60 to 1/240 s.
class RandomWorld {
  public:
    explicit RandomWorld(unsigned series) : m_random(series) {
        m_scene.addFloor();
        addSheet();
        const int count = 1 + m_random.below(4);
        for (int i = 0; i < count; ++i) addBody(i);
    }
    BulletScene& scene() { return m_scene; }
    const ShellBody& sheet() const { return *m_sheet; }
    const std::vector<btRigidBody*>& bodies() const { return m_bodies; }
    double step() const { return m_step; }
    const std::string& what() const { return m_what; }

  private:
    struct Cut {
        const char* name;
        ShellMaterial material;
        double largest;  ///< side of a sheet that someone would make of it [m]
    };

    void addSheet() {
        const Cut cuts[] = {
            {"cotton", materials::cotton(), 2.0},       {"silk", materials::silk(), 2.0},
            {"denim", materials::denim(), 1.5},         {"leather", materials::leather(), 1.0},
            {"paper", materials::paper(), 0.5},         {"cardboard", materials::cardboard(), 1.0},
            {"rubber", materials::rubber(), 1.0},       {"aluminium 1 mm", materials::aluminium(1e-3), 1.0},
            {"steel 2 mm", materials::steel(2e-3), 1.0}};
        const Cut& cut = m_random.of(cuts);
        m_side = m_random.logBetween(0.15, 1.0) * cut.largest;
        const int cells = int(m_random.logBetween(3, 25));
        m_height = m_random.between(0.3, 1.2);
        m_step = 1.0 / m_random.of({60, 60, 120, 240});
        TriangleMesh mesh = squareSheet(m_side, cells);
        mesh.positions.row(1).array() += m_height;
        m_sheet = &m_scene.shells->add(mesh, cut.material, {.friction = m_random.between(0.0, 1.0)});
        static const char* const holds[] = {"free", "two corners", "one edge", "border", "four corners"};
        const int hold = m_random.below(5);
        pin(hold, cells);
        tell("%s %.2f m, %d cells, %s, 1/%.0f s:", cut.name, m_side, cells, holds[hold], 1.0 / m_step);
    }

    void pin(int hold, int cells) {
        const int row = cells + 1;
        if (hold == 1 || hold == 4)
            for (const int corner : {0, cells}) m_sheet->pin(corner);
        if (hold == 4)
            for (const int corner : {row * cells, row * row - 1}) m_sheet->pin(corner);
        for (int i = 0; hold == 2 && i < row; ++i) m_sheet->pin(i);
        if (hold == 3) pinBorder(*m_sheet);
    }

    void addBody(int index) {
        const double size = std::min(m_side, 0.6) * m_random.logBetween(0.05, 0.4);
        auto shape = drawShape(size);
        const bool isBelow = m_random.below(4) == 0, isHeld = isBelow && m_random.below(2) == 0;
        const double mass = isHeld ? 0.0 : m_sheet->shell().masses().sum() * m_random.logBetween(1e-2, 1e2);
        const double y =
            isBelow ? 1.5 * size + 1e-3 : m_height + 1.7 * size + 0.02 + 0.9 * index * std::min(m_side, 0.6);
        if (isBelow && y + 1.6 * size > m_height) return;
        const double aside = 0.4 * m_side;
        auto& body = m_scene.addBody(std::move(shape), mass, m_random.vector({-aside, y, -aside}, {aside, y, aside}));
        if (!isBelow) {
            const double speed = m_random.logBetween(0.1, 12.0);
            body.setLinearVelocity(
                m_random.vector({-0.3 * speed, -speed, -0.3 * speed}, {0.3 * speed, -speed, 0.3 * speed}));
            body.setAngularVelocity(m_random.vector({-3, -3, 0}, {3, 3, 0}));
        }
        tell(" %.2g m %.2g kg %.2g m/s%s,", size, mass, double(body.getLinearVelocity().length()),
             isBelow ? " below" : "");
        m_bodies.push_back(&body);
    }

    std::unique_ptr<btCollisionShape> drawShape(double size) {
        static const char* const names[] = {"ball", "box", "capsule", "cylinder", "dumbbell"};
        const int kind = m_random.below(5);
        tell(" %s", names[kind]);
        const btScalar s = btScalar(size), slim = btScalar(0.7 * size);
        if (kind == 0) return std::make_unique<btSphereShape>(s);
        if (kind == 1)
            return std::make_unique<btBoxShape>(m_random.vector({size, 0.3 * size, 0.3 * size}, {size, size, size}));
        if (kind == 2) return std::make_unique<btCapsuleShape>(btScalar(0.5 * size), s);
        if (kind == 3) return std::make_unique<btCylinderShape>(btVector3(slim, s, slim));
        m_parts.push_back(std::make_unique<btSphereShape>(btScalar(0.4 * size)));
        auto dumbbell = std::make_unique<btCompoundShape>();
        for (const double side : {-0.6, 0.6})
            dumbbell->addChildShape(btTransform(btQuaternion::getIdentity(), btVector3(btScalar(side * size), 0, 0)),
                                    m_parts.back().get());
        return dumbbell;
    }

    template <class... Values>
    void tell(const char* format, Values... values) {
        char text[200];
        std::snprintf(text, sizeof text, format, values...);
        m_what += text;
    }

    Random m_random;
    std::vector<std::unique_ptr<btCollisionShape>> m_parts;  ///< of compounds, which do not own them
    BulletScene m_scene;
    ShellBody* m_sheet = nullptr;
    std::vector<btRigidBody*> m_bodies;
    double m_side = 0.0, m_height = 0.0, m_step = 0.0;
    std::string m_what;
};

/// Kinetic energy of the way that bodies really went in a step [J]. What they are given as velocities is no measure:
/// what a shell presses onto a ball on a floor, the floor takes in the next step.
class MotionOfBodies {
  public:
    MotionOfBodies(const std::vector<btRigidBody*>& bodies, double h) : m_bodies(bodies), m_h(h) { remember(); }
    double energySinceLast() {
        double sum = 0.0;
        for (std::size_t i = 0; i < m_bodies.size(); ++i) {
            const btRigidBody& body = *m_bodies[i];
            if (!(body.getInvMass() > 0)) continue;
            btVector3 linear, angular;
            btTransformUtil::calculateVelocity(m_last[i], body.getWorldTransform(), btScalar(m_h), linear, angular);
            const Vec3 spin = toVec3(angular);
            sum += 0.5 * double(linear.length2()) / double(body.getInvMass()) +
                   0.5 * spin.dot(jacket::testing::detail::inertia(body) * spin);
        }
        remember();
        return sum;
    }

  private:
    void remember() {
        m_last.clear();
        for (const btRigidBody* body : m_bodies) m_last.push_back(body->getWorldTransform());
    }
    const std::vector<btRigidBody*>& m_bodies;
    double m_h;
    std::vector<btTransform> m_last;
};

struct Outcome {
    unsigned seed = 0;
    std::string what{};
    double gain = 0.0;         ///< largest energy at any time, less that at the start, over that [-]
    double deepest = 0.0;      ///< at the end [m]
    double unsettled = 0.0;    ///< share of the steps
    double unconverged = 0.0;  ///< share of the steps
    double iterations = 0.0;   ///< mean of a step
    bool finite = true;
};

/// `tell`: called after each step with its number, the energy and how much it has changed [J].
template <class Tell>
Outcome outcomeOf(unsigned seed, double seconds, Tell tell) {
    RandomWorld world(seed);
    BulletScene& scene = world.scene();
    Outcome outcome{.seed = seed, .what = world.what()};
    MotionOfBodies motion(world.bodies(), world.step());
    const double start = energy(scene).total();
    const int steps = int(seconds / world.step() + 0.5);
    double last = start;
    for (int i = 0; i < steps; ++i) {
        scene.step(world.step());
        auto now = energy(scene);
        now.kineticOfBodies = motion.energySinceLast();
        tell(i, now, now.total() - last, scene.shells->lastStep());
        last = now.total();
        outcome.finite = outcome.finite && std::isfinite(last);
        outcome.gain = std::max(outcome.gain, (last - start) / start);
        outcome.iterations += double(scene.shells->lastStep().pcgIterations) / steps;
    }
    for (const btRigidBody* body : world.bodies())
        outcome.deepest = std::max(outcome.deepest, penetration(world.sheet(), *body));
    outcome.unsettled = double(scene.shells->lastStep().unsettledSteps) / steps;
    outcome.unconverged = double(scene.shells->lastStep().unconvergedSteps) / steps;
    return outcome;
}

inline Outcome outcomeOf(unsigned seed, double seconds) {
    return outcomeOf(seed, seconds, [](auto&&...) {});
}

}  // namespace jacket::bullet::testing
