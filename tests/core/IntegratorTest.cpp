#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "jacket/Shell.h"
#include "support/SheetMeshes.h"

namespace jacket {
namespace {

using test::MeshKind;
using test::sheet;

/// One triangle, its base held and its tip on rails along x: one oscillator.
struct Oscillator {
    static constexpr int kTip = 2;
    Shell shell;
    double omega;

    explicit Oscillator(Integrator integrator)
        : shell(triangle(), material(), {.integrator = integrator, .tolerance = 1e-10}) {
        shell.pin(0);
        shell.pin(1);
        shell.guide(kTip, Vec3::UnitY());
        shell.guide(kTip, Vec3::UnitZ());
        omega = std::sqrt(0.5 * material().stretchStiffness() / shell.masses()[kTip]);  // area E t / length^2
    }
    static TriangleMesh triangle() {
        TriangleMesh mesh;
        mesh.positions.resize(3, 3);
        mesh.positions << 0, 0, 1, -0.5, 0.5, 0, 0, 0, 0;
        mesh.triangles.resize(3, 1);
        mesh.triangles << 0, 2, 1;
        return mesh;
    }
    static ShellMaterial material() { return {.young = 1e6, .poisson = 0.0, .thickness = 1e-3, .density = 1000.0}; }
    void pull(double by) {
        Points x = shell.positions();
        x(0, kTip) += by;
        shell.setPositions(x);
    }
    double displacement() const { return shell.positions()(0, kTip) - 1.0; }
};

/// Amplitude left after one period and period over the true one, of the discrete oscillator's own exact solution:
/// tests/data/integrators.csv.
struct Expected {
    Integrator integrator;
    int stepsPerPeriod;
    double amplitude, period;
};
class IntegratorDecay : public testing::TestWithParam<Expected> {};
INSTANTIATE_TEST_SUITE_P(Table, IntegratorDecay,
                         testing::Values(Expected{Integrator::BackwardEuler, 50, 0.6745208250, 1.0052418045},
                                         Expected{Integrator::BackwardEuler, 200, 0.9060327582, 1.0003289003},
                                         Expected{Integrator::Newton, 50, 0.6745208250, 1.0052418045},
                                         Expected{Integrator::Newton, 200, 0.9060327582, 1.0003289003},
                                         Expected{Integrator::Bdf2, 50, 0.9969900833, 1.0051821345},
                                         Expected{Integrator::Bdf2, 200, 0.9999514006, 1.0003286574}));

TEST_P(IntegratorDecay, IsTheIntegratorsOwn) {
    const auto [integrator, steps, amplitude, period] = GetParam();
    Oscillator o(integrator);
    constexpr double kPull = 1e-5;  // small: linear
    o.pull(kPull);
    const double h = 2.0 * std::numbers::pi / (o.omega * steps);
    constexpr int kPeriods = 10;
    double lastPeak = kPull, lastTime = 0.0, firstPeak = 0.0, firstTime = 0.0;
    int peaks = 0;
    double before = kPull, here = kPull;
    for (int step = 1; peaks < kPeriods + 1; ++step) {
        o.shell.step(h, Vec3::Zero());
        const double next = o.displacement();
        if (here > before && here >= next && here > 0.0) {  // a parabola through three steps finds the top
            const double curve = before - 2.0 * here + next, slope = 0.5 * (next - before);
            lastTime = (step - 1 - slope / curve) * h;
            lastPeak = here - 0.5 * slope * slope / curve;
            if (peaks++ == 0) firstPeak = lastPeak, firstTime = lastTime;
        }
        before = here;
        here = next;
        ASSERT_LT(step, 100 * steps);
    }
    const double measuredPeriod = (lastTime - firstTime) / kPeriods * o.omega / (2.0 * std::numbers::pi);
    const double measuredAmplitude = std::pow(lastPeak / firstPeak, 1.0 / kPeriods);
    EXPECT_NEAR(measuredAmplitude, amplitude, 0.02 * (1.0 - amplitude) + 2e-5);
    EXPECT_NEAR(measuredPeriod - 1.0, period - 1.0, 0.02 * (period - 1.0) + 2e-5);
}

/// A heavy strip clamped at one end, let go; where its tip is after a fifth of a second.
Vec3 swungTip(Integrator integrator, double h, double stepRatio = 1.0) {
    const TriangleMesh mesh = sheet(MeshKind::OneDiagonal, 0.5, 0.1, 10, 2);
    ShellMaterial material{.young = 2e7, .poisson = 0.0, .thickness = 1e-3, .density = 1000.0};
    Shell shell(mesh, material, {.integrator = integrator, .tolerance = 1e-8});
    shell.clamp(test::verticesWhere(mesh.positions, [](const Vec3& p) { return p.x() < -0.25 + 1e-9; }));
    const int steps = static_cast<int>(std::lround(0.2 / h));
    for (int i = 0; i < steps; i += 2)  // pairs of steps, h (1 + a) and h (1 - a) long
        for (const double part : {2.0 * stepRatio / (1.0 + stepRatio), 2.0 / (1.0 + stepRatio)})
            shell.step(part * h, Vec3(0, 0, -9.81));
    return shell.positions().col(10);
}

TEST(Integrators, OrderOfAccuracyOfASwingingStrip) {
    const Vec3 exact = swungTip(Integrator::Bdf2, 0.2 / 6400);
    const auto order = [&](Integrator integrator, double ratio) {
        const double coarse = (swungTip(integrator, 0.2 / 400, ratio) - exact).norm();
        const double fine = (swungTip(integrator, 0.2 / 800, ratio) - exact).norm();
        return std::log2(coarse / fine);
    };
    EXPECT_NEAR(order(Integrator::BackwardEuler, 1.0), 1.0, 0.15);
    EXPECT_NEAR(order(Integrator::Newton, 1.0), 1.0, 0.15);
    EXPECT_GT(order(Integrator::Bdf2, 1.0), 1.7);
    EXPECT_GT(order(Integrator::Bdf2, 1.5), 1.7);  // steps of unequal length
}

TEST(AdaptiveStep, HalvesWhereASheetIsPulledTightAndGrowsAgain) {
    // A slack sheet falls freely until its pinned corners stop it: only then are short steps of use.
    const TriangleMesh mesh = sheet(MeshKind::OneDiagonal, 1.0, 1.0, 10, 10);
    Shell shell(mesh, {.young = 1e7, .poisson = 0.3, .thickness = 1e-3, .density = 1000.0}, {.tolerance = 1e-4});
    for (const int corner : {0, 10}) shell.pin(corner);
    Points v = Points::Zero(3, shell.vertexCount());
    v.row(0).setConstant(2.0);
    shell.setVelocities(v);
    AdaptiveStep control{.mostStrain = 0.02, .shortest = 2e-4};
    AdaptiveReport all;
    std::vector<double> lengths;
    for (int frame = 0; frame < 60; ++frame) {
        const AdaptiveReport report = shell.stepAdaptively(1.0 / 60.0, Vec3(0, 0, -9.81), control);
        ASSERT_TRUE(report.finite);
        all.steps += report.steps;
        all.rejected += report.rejected;
        lengths.push_back(report.shortest);
    }
    EXPECT_GT(all.rejected, 0);
    EXPECT_LT(*std::min_element(lengths.begin(), lengths.end()), 0.3 / 60.0);
    EXPECT_GT(lengths.back(), 1.9 * *std::min_element(lengths.begin(), lengths.end()));  // grew again
}

TEST(AdaptiveStep, DoesNothingToACalmShell) {
    const TriangleMesh mesh = sheet(MeshKind::OneDiagonal, 1.0, 1.0, 6, 6);
    Shell shell(mesh, {.young = 1e7, .poisson = 0.3, .thickness = 1e-3, .density = 1000.0});
    AdaptiveStep control;
    const AdaptiveReport report = shell.stepAdaptively(0.1, Vec3(0, 0, -9.81), control);
    EXPECT_EQ(report.steps, 1);
    EXPECT_EQ(report.rejected, 0);
    EXPECT_THROW(shell.stepAdaptively(0.0, Vec3::Zero(), control), std::invalid_argument);
}

TEST(Integrators, AFreeSpinningShellKeepsItsMomentum) {
    for (const Integrator integrator : {Integrator::BackwardEuler, Integrator::Newton, Integrator::Bdf2}) {
        const TriangleMesh mesh = makeHemisphere(0.2, 5);
        Shell shell(mesh, {.young = 1e7, .poisson = 0.3, .thickness = 2e-3, .density = 1000.0},
                    {.integrator = integrator, .tolerance = 1e-8});
        const Vec3 spin(1.0, 2.0, -1.5);
        Points v(3, shell.vertexCount());
        const Vec3 centre = mesh.positions * shell.masses() / shell.masses().sum();
        for (int i = 0; i < v.cols(); ++i)
            v.col(i) = spin.cross(Vec3(mesh.positions.col(i)) - centre) + Vec3(0.3, 0, 0);
        shell.setVelocities(v);
        const Vec3 linear = shell.linearMomentum(), angular = shell.angularMomentum(centre);
        double drift[2];
        for (int k = 0; k < 2; ++k) {
            Shell copy(mesh, shell.material(), shell.settings());
            copy.setVelocities(v);
            const double h = k == 0 ? 2e-3 : 1e-3;
            for (int i = 0; i < 100 << k; ++i) copy.step(h, Vec3::Zero());
            const Vec3 now = copy.positions() * copy.masses() / copy.masses().sum();
            drift[k] = (copy.angularMomentum(now) - angular).norm() / angular.norm();
            EXPECT_LT((copy.linearMomentum() - linear).norm(), 1e-9 * linear.norm());
        }
        // what an implicit step loses of a spin itself falls with the step; nothing else may be there
        EXPECT_LT(drift[1], integrator == Integrator::Bdf2 ? 2e-3 : 5e-3) << static_cast<int>(integrator);
        EXPECT_LT(drift[1], 0.6 * drift[0] + 1e-6) << static_cast<int>(integrator);
    }
}

}  // namespace
}  // namespace jacket
