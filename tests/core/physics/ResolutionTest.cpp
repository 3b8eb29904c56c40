// The same sheet on finer meshes: what differs must be the mesh, not the step or the iterations.
#include <gtest/gtest.h>

#include <cmath>

#include "jacket/Shell.h"

namespace jacket {
namespace {

ShellMaterial dampedCloth() {
    ShellMaterial m{.young = 1e7, .poisson = 0.3, .thickness = 1e-3, .density = 300.0};
    m.stretchStiffnessOverride = 1e4;
    m.bendingStiffnessOverride = 1e-4;
    m.massDamping = 8.0;  // so that it comes to rest
    return m;
}

/// Sag of a 2 x 2 m sheet held at its border, after it has come to rest [m].
double sag(int cells, double h, double tolerance) {
    Shell sheet(makeGrid({.size = {2, 2}, .cells = {cells, cells}, .diagonals = GridDiagonals::Alternating}),
                dampedCloth(), {.tolerance = tolerance});
    for (int i = 0; i < sheet.vertexCount(); ++i)
        if (sheet.mesh().isBorderVertex(i)) sheet.pin(i);
    for (double t = 0; t < 3.0; t += h) EXPECT_TRUE(sheet.step(h, {0, -9.81, 0}).converged);
    return -sheet.positions()(1, (cells + 1) * (cells + 1) / 2);
}

TEST(Resolution, TheMeshMakesTheDifferenceNotTheStepOrTheIterations) {
    const double coarse = sag(10, 1.0 / 60, 1e-3), middle = sag(20, 1.0 / 60, 1e-3), fine = sag(40, 1.0 / 60, 1e-3);
    RecordProperty("sag_10_20_40_mm", std::to_string(1e3 * coarse) + " " + std::to_string(1e3 * middle) + " " +
                                          std::to_string(1e3 * fine));
    EXPECT_GT(fine, 0.01);
    EXPECT_LT(std::abs(fine - middle), 0.5 * std::abs(middle - coarse)) << coarse << " " << middle << " " << fine;
    EXPECT_NEAR(sag(20, 1.0 / 240, 1e-3), middle, 2e-3 * middle);
    EXPECT_NEAR(sag(20, 1.0 / 60, 1e-7), middle, 2e-3 * middle);
    EXPECT_NEAR(sag(10, 1.0 / 240, 1e-7), coarse, 2e-3 * coarse);
}

}  // namespace
}  // namespace jacket
