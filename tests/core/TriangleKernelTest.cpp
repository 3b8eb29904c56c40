#include <gtest/gtest.h>

#include <type_traits>
#include <variant>

#include "energy/StencilEnergy.h"
#include "support/Differences.h"

namespace jacket::test {
namespace {

/// Fans of triangles around vertex 0, in random order of their corners so that blocks are met turned either way:
/// stretched, compressed, inside out, or without an area now.
struct Fan {
    Points rest, now;
    std::vector<std::array<int, 3>> triangles;

    explicit Fan(int count) : rest(3, count + 2), now(3, count + 2) {
        std::mt19937 random(static_cast<unsigned>(count));
        rest.col(0).setZero();
        for (int i = 1; i < rest.cols(); ++i) {
            const double angle = 0.5 * i;
            rest.col(i) = Vec3(std::cos(angle), std::sin(angle), 0.0) + randomVector(random, 0.1);
        }
        now = 0.8 * rest;
        for (int i = 0; i < now.cols(); ++i) now.col(i) += randomVector(random, 0.5) + Vec3(100, -200, 300);
        if (count > 2) now.col(3) = now.col(2);                // an edge of no length
        if (count > 5) now.col(6) = now.col(5) + rest.col(6);  // far off
        for (int t = 0; t < count; ++t) {
            std::array<int, 3> corners{0, t + 1, t + 2};
            std::shuffle(corners.begin(), corners.end(), random);
            triangles.push_back(corners);
        }
    }
};

void setAllPairs(BlockMatrix& matrix, int size) {
    std::vector<std::pair<int, int>> pairs;
    for (int i = 0; i < size; ++i)
        for (int j = 0; j < i; ++j) pairs.emplace_back(i, j);
    matrix.setPattern(size, std::move(pairs));
}

double largestDifference(const std::vector<Mat3>& a, const std::vector<Mat3>& b) {
    double most = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).cwiseAbs().maxCoeff());
    return most;
}

/// The energy of a whole list against the sum of the model's own terms, one by one.
template <class Model>
void expectBatchesEqualTerms(const Model& model, int count) {
    const Fan fan(count);
    constexpr double kNever = std::numeric_limits<double>::infinity();
    typename StencilEnergy<Model>::Group group{
        .model = model, .yield = {kNever, kNever, 0.0, 0.0}, .stencils = fan.triangles, .areas = {}, .triangles = {}};
    StepSystem expected, found;
    setAllPairs(expected.matrix, static_cast<int>(fan.now.cols()));
    setAllPairs(found.matrix, static_cast<int>(fan.now.cols()));
    expected.begin(0.02, 0.003);
    found.begin(0.02, 0.003);
    double energy = 0.0;
    for (const auto& corners : fan.triangles) {
        Stencil<3> X, x;
        for (int a = 0; a < 3; ++a) X.col(a) = fan.rest.col(corners[a]), x.col(a) = fan.now.col(corners[a]);
        group.areas.push_back(siteArea<3>(X));
        group.triangles.push_back(0);
        const auto term = model.evaluate(x, model.rest(X, group.areas.back()), HessianKind::Positive);
        energy += term.energy;
        expected.add<3>(corners, stencilSlots<3>(expected.matrix, corners), term);
    }
    StencilEnergy<Model> all({group}, {.positions = fan.rest});
    all.bind(found.matrix);
    all.addTo(found, fan.now, HessianKind::Positive);
    EXPECT_NEAR(all.value(fan.now), energy, 1e-12 * energy) << count << " triangles";
    EXPECT_LT((found.rhs - expected.rhs).norm(), 1e-12 * expected.rhs.norm()) << count << " triangles";
    double scale = 0.0;
    for (const Mat3& block : expected.matrix.diagonal()) scale = std::max(scale, block.cwiseAbs().maxCoeff());
    EXPECT_LT(largestDifference(found.matrix.diagonal(), expected.matrix.diagonal()), 1e-12 * scale);
    EXPECT_LT(largestDifference(found.matrix.lower(), expected.matrix.lower()), 1e-12 * scale);
    for (const Mat3& block : found.matrix.diagonal()) EXPECT_EQ(block, block.transpose());
}

TEST(TriangleKernel, BatchesEqualTheModelsOwnTermsWhateverIsLeftOver) {
    ShellMaterial isotropic{.young = 1000.0, .poisson = 0.3, .thickness = 0.01};
    ShellMaterial woven = isotropic;
    woven.orthotropy = {.weftYoung = 400.0, .shear = 60.0, .warpDirection = Vec3(0.3, -1.0, 2.0)};
    const auto check = [&](const auto& model) {
        if constexpr (TriangleTermModel<std::decay_t<decltype(model)>>)
            for (int count = 1; count <= 17; ++count)
                for (const ShellMaterial& material : {isotropic, woven})
                    expectBatchesEqualTerms(model.fittedTo(material), count);
    };
    const auto checkAll = [&]<class... Models>(const std::variant<Models...>*) { (check(Models{}), ...); };
    checkAll(static_cast<const MembraneModel*>(nullptr));
}

}  // namespace
}  // namespace jacket::test
