// Scenes whose outcome a rounding can decide, from many starts that differ by less than a micrometre: how often they
// end well, and how badly otherwise. And how still a ball rests that may roll.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "support/HardScenes.h"
#include "support/Random.h"
#include "support/Target.h"

namespace jacket::bullet::testing {
namespace {

/// Metres beside the first start; every fifth a hundred times farther.
double aside(int start) {
    return 3.7e-9 * start * (start % 5 == 4 ? 100 : 1);
}

std::vector<double> sorted(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values;
}

void clearance(const char* scene, int starts, const std::function<double(double)>& lowest) {
    constexpr double kDeep = -1e-4;
    std::vector<double> found;
    for (int i = 0; i < starts; ++i) found.push_back(lowest(aside(i)));
    found = sorted(std::move(found));
    const auto deep = std::lower_bound(found.begin(), found.end(), kDeep) - found.begin();
    std::printf("%-28s %3d of %d deeper than 0.1 mm; least clearance %9.3g mm, median %.3g mm\n", scene, int(deep),
                starts, 1e3 * found.front(), 1e3 * found[found.size() / 2]);
}

/// Until it sleeps, 8 s at most.
void stack(int count, double h, int starts) {
    constexpr double kLimit = 8.0;  // [s]
    std::vector<double> crept, times;
    int toppled = 0;
    for (int i = 0; i < starts; ++i) {
        StackScene scene(count, aside(i));
        double t = 0.0;
        for (; t < kLimit && !scene.cloth.isAsleep(); t += h) scene.step(h);
        if (scene.cloth.isAsleep()) times.push_back(t);
        crept.push_back(scene.crept(count - 1));
        toppled += scene.upright(count - 1) < 0.999;
    }
    crept = sorted(std::move(crept));
    times = sorted(std::move(times));
    std::printf(
        "%d boxes on a cloth, 1/%-3.0f s    %3d of %d sleep within %g s, median %.3g s; %d toppled; crept %.3g mm, "
        "median %.3g mm\n",
        count, 1.0 / h, int(times.size()), starts, kLimit, times.empty() ? kLimit : times[times.size() / 2], toppled,
        1e3 * crept.back(), 1e3 * crept[crept.size() / 2]);
}

/// A ball of `ratio` vertex masses, dropped on a trampoline in steps of 1/10 s: its energy over what it fell with.
void lightBall(double ratio, int starts) {
    constexpr double h = 0.1;
    std::vector<double> gains;
    for (int i = 0; i < starts; ++i) {
        BulletScene scene;
        const double height = 1.0 + 0.01 * i, mass = ratio * 0.3 * 4.0 / 400;
        auto& ball = scene.addSphere(0.25, mass, btVector3(btScalar(0.003 * (i % 7)), btScalar(height), 0));
        pinBorder(scene.shells->add(squareSheet(2, 20), trampolineCloth()));
        double most = 0.0;
        for (double t = 0; t < 2.0; t += h) {
            scene.step(h);
            const double rise = std::max(0.0, double(ball.getLinearVelocity().y()) - 9.81 * h);
            most = std::max(most, 0.5 * rise * rise + 9.81 * double(ball.getWorldTransform().getOrigin().y()));
        }
        gains.push_back(most / (9.81 * height + 0.5 * 9.81 * 9.81 * h * h));
    }
    gains = sorted(std::move(gains));
    const auto thrown = gains.end() - std::upper_bound(gains.begin(), gains.end(), 1.0 + 1e-6);
    std::printf("ball of %-5g vertex masses     %3d of %d thrown; most energy %.3g of what it fell with\n", ratio,
                int(thrown), starts, gains.back());
}

/// Bodies 10 cm thick (rods: 4 cm) that fly against a sheet in steps of 1/60 s: 0.03 to 1 kg, from 11 to 91 cm away.
void missiles(const std::string& shape, double speed, int starts) {
    const auto cube = boxMesh(kHalf);
    int stopped = 0, silent = 0;
    double most = 0.0;
    Random random(7);
    for (int i = 0; i < starts; ++i) {
        Target scene;
        const double x = random.between(-0.1, 0.1), z = random.between(-0.1, 0.1), y = random.between(0.11, 0.91);
        auto& body = scene.addBody(missile(shape, *cube), std::pow(10.0, random.between(-1.5, 0.0)),
                                   btVector3(btScalar(x), btScalar(y), btScalar(z)));
        body.setLinearVelocity(btVector3(0, btScalar(-speed), 0));
        const double start = jacket::testing::energy(scene).total();
        for (int k = 0; k < 25 + int(60.0 * y / speed); ++k) {
            scene.step(kStep);
            most = std::max(most, jacket::testing::energy(scene).total() / start);
        }
        const bool isAbove = scene.isAbove(body);
        stopped += isAbove;
        silent += !isAbove && scene.shells->lastStep().passedSteps == 0;
    }
    std::printf(
        "%-4s against a sheet, %4.3g m/s   %3d of %d stopped, %d silently through; most energy %.3g of the start's\n",
        shape.c_str(), speed, stopped, starts, silent, most);
}

/// Sheets of 1 m that come down at 4.6 to 10 m/s, from 10 to 60 cm, over a board of 40 x 30 cm in steps of 1/60 s.
void shelf(double thick, int starts) {
    int held = 0, silent = 0, unsettled = 0, solves = 0;
    Random random(11);
    for (int i = 0; i < starts; ++i) {
        const Vec3 from(random.between(-0.05, 0.05), random.between(0.1, 0.6), random.between(-0.05, 0.05));
        const double speed = random.between(4.6, 10.0);
        Shelf scene(thick, from, speed);
        for (int k = 0; k < int(60.0 * (from.y() / speed + 0.7)); ++k) {
            scene.step(kStep);
            solves = std::max(solves, scene.shells->lastStep().solves);
        }
        held += scene.isHeld();
        silent += !scene.isHeld() && scene.shells->lastStep().passedSteps == 0;
        unsettled += scene.shells->lastStep().unsettledSteps;
    }
    std::printf(
        "sheet over a board of %4.3g cm    %3d of %d held, %d silently through; %d steps unsettled, at most %d solves "
        "in one\n",
        1e2 * thick, held, starts, silent, unsettled, solves);
}

/// Cloths of 80 cm, of 16 and 32 cells a side.
void flungAtHill(double speed, double h, int starts) {
    HillScene::Impact worst;
    for (int i = 0; i < starts; ++i)
        for (const int cells : {16, 32}) {
            const HillScene::Impact impact = HillScene(0.04 * i / starts, cells).fling(speed, h);
            worst.deepest = std::max(worst.deepest, impact.deepest);
            worst.mostEnergy = std::max(worst.mostEnergy, impact.mostEnergy);
        }
    std::printf("cloth at %g m/s on a hill, 1/%.0f s: most energy %.2f of the start's, vertices %.1f mm deep at most\n",
                speed, 1.0 / h, worst.mostEnergy, 1e3 * worst.deepest);
    std::fflush(stdout);
}

/// After 10 s that it has to come to rest.
void ballAtRest(int cells, int steps) {
    RestingBall resting(cells);
    const Vec3 start = resting.position();
    double moved = 0.0, sum = 0.0, worst = 0.0;
    for (int i = 0; i < steps; ++i) {
        const double off = resting.step();
        sum += off;
        worst = std::max(worst, std::abs(off));
        moved = std::max(moved, (resting.position() - start).norm());
    }
    std::printf("ball at rest on %2d cells, %d steps: moved %.3g mm; force off by %.2g at most, %.1g on average\n",
                cells, steps, 1e3 * moved, worst, std::abs(sum / steps));
}

void runAll(int starts) {
    clearance("cloth on a hill", starts, [](double x) { return HillScene(x).lowest(); });
    for (const double angle : {60.0, 90.0, 120.0})
        clearance(("cloth in a valley, " + std::to_string(int(angle)) + " deg").c_str(), starts,
                  [&](double x) { return ValleyScene(angle, x).lowest(); });
    for (const int count : {2, 3})
        for (const double h : {1.0 / 60, 1.0 / 240}) stack(count, h, starts);
    for (const double ratio : {1e-3, 1e-2, 1.0}) lightBall(ratio, starts);
    for (const char* shape : {"ball", "rod", "box", "mesh"})
        for (const double speed : {1.5, 3.0, 5.0, 15.0, 60.0}) missiles(shape, speed, starts);
    for (const double thick : {0.01, 0.015, 0.02, 0.025}) shelf(thick, starts);
    for (const double speed : {2.0, 5.0, 10.0, 20.0})
        for (const double h : {1.0 / 60, 1.0 / 120}) flungAtHill(speed, h, std::max(1, starts / 5));
    for (const int cells : {11, 12, 16, 24}) ballAtRest(cells, 500 * starts);
}

}  // namespace
}  // namespace jacket::bullet::testing

int main(int argc, char** argv) {
    const int starts = argc > 1 ? std::atoi(argv[1]) : 20;
    if (argc > 2 || starts < 1) {
        std::fprintf(stderr, "usage: starts_bench [STARTS]\n  STARTS  how many, > 0; 20 if not given\n");
        return 2;
    }
    jacket::bullet::testing::runAll(starts);
}
