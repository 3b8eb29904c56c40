#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "ShellAssembly.h"
#include "jacket/Shell.h"
#include "solver/CompactShell.h"
#include "solver/FilteredPcg.h"
#include "support/Differences.h"

/// The solve in single precision, part by part, against the same in double.
namespace jacket {
namespace {

using Dense = Eigen::MatrixXd;
using DenseVector = Eigen::VectorXd;
using Pairs = std::vector<std::pair<int, int>>;

constexpr double kStep = 1.0 / 60;
const Vec3 kGravity{0, -9.81, 0};

/// A cloth of 2 x 2 m of which one edge is pinned, after some steps of swinging down.
Shell swingingSheet(int n, int steps, const BendingModel& bending = PatchBending{}, double bendingStiffness = 1e-4) {
    ShellMaterial m{.young = 3.03e7, .poisson = 0.3, .thickness = 3.3e-4, .density = 605.0};
    m.stretchStiffnessOverride = 1e4;
    m.bendingStiffnessOverride = bendingStiffness;
    m.areaDensityOverride = 0.2;
    Shell sheet(makeGrid({.size = {2, 2}, .cells = {n - 1, n - 1}}), m, {.bending = bending});
    for (int i = 0; i < sheet.vertexCount(); ++i)
        if (sheet.restPositions()(0, i) < -1 + 1e-9) sheet.pin(i);
    for (int k = 0; k < steps; ++k) sheet.step(kStep, kGravity);
    return sheet;
}

/// The matrix of a sheet's next step, and its copy in single precision.
struct SheetMatrix {
    Shell sheet;
    ShellAssembly assembly;
    const StepSystem& step;
    CompactShell& compact;

    explicit SheetMatrix(int n, const BendingModel& bending = PatchBending{}, double bendingStiffness = 1e-4)
        : sheet(swingingSheet(n, 10, bending, bendingStiffness)),
          assembly(sheet, design()),
          step(assembly.assemble(sheet, kStep, kGravity, nullptr, sheet.velocities(),
                                 Points::Zero(3, sheet.vertexCount()))),
          compact(step.matrix.compact()) {
        compact.matrix.setValues(step.matrix);
    }
    ShellDesign design() const {
        ShellDesign result;
        result.materials.list = {sheet.material()};
        return result;
    }
    int size() const { return step.matrix.size(); }
};

std::vector<float> packed(const CompactMatrix& matrix, const Points& x) {
    std::vector<float> result(4 * x.cols());
    for (int i = 0; i < x.cols(); ++i)
        for (int c = 0; c < 3; ++c) result[4 * matrix.rowOf()[i] + c] = static_cast<float>(x(c, i));
    return result;
}

Points unpacked(const CompactMatrix& matrix, const std::vector<float>& x) {
    Points result(3, matrix.size());
    for (int i = 0; i < matrix.size(); ++i)
        for (int c = 0; c < 3; ++c) result(c, i) = x[4 * matrix.rowOf()[i] + c];
    return result;
}

Points randomPoints(std::mt19937& random, int count) {
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    return Points::NullaryExpr(3, count, [&] { return uniform(random); });
}

Points product(const CompactMatrix& matrix, const Points& x) {
    std::vector<float> y(4 * x.cols(), std::numeric_limits<float>::quiet_NaN());
    matrix.multiply(packed(matrix, x).data(), y.data());
    for (std::size_t i = 3; i < y.size(); i += 4) EXPECT_EQ(y[i], 0.0f);
    return unpacked(matrix, y);
}

double inner(const Points& a, const Points& b) {
    return a.cwiseProduct(b).sum();
}

TEST(CompactMatrixTest, RowsAreAPermutation) {
    const SheetMatrix m(12);
    std::vector<int> rows = m.compact.matrix.rowOf();
    std::sort(rows.begin(), rows.end());
    for (int i = 0; i < m.size(); ++i) EXPECT_EQ(rows[i], i);
}

TEST(CompactMatrixTest, ProductEqualsDouble) {
    const SheetMatrix m(21);
    ASSERT_NE(m.step.matrix.beside(), nullptr);
    std::mt19937 random(1);
    const Points x = randomPoints(random, m.size());
    Points expected(3, m.size());
    m.step.matrix.multiply(x.data(), expected.data());
    EXPECT_LT((product(m.compact.matrix, x) - expected).norm(), 1e-6 * expected.norm());
}

TEST(CompactMatrixTest, TakesWhatStandsBesideOnceAndLetsItGo) {
    BlockMatrix matrix;
    matrix.setPattern(4, {{0, 1}, {1, 2}, {2, 3}});
    matrix.setZero();
    for (Mat3& block : matrix.diagonal()) block.setIdentity();
    ConstantHessian scalars;
    const Pairs rows[] = {{{2, 1}, {3, -4}}, {}, {{0, 1}}, {{0, -4}}};  // columns, and twice the scalars
    for (const Pairs& row : rows) {
        for (const auto& [column, twice] : row) scalars.append(column, 0.5 * twice);
        scalars.endRow();
    }
    scalars.split(matrix);
    CompactMatrix compact(matrix);
    std::mt19937 random(2);
    const Points x = randomPoints(random, 4);
    const auto expectEqual = [&] {
        Points expected(3, 4);
        matrix.multiply(x.data(), expected.data());
        EXPECT_LT((product(compact, x) - expected).norm(), 1e-6 * expected.norm());
    };
    matrix.setBeside(&scalars, 3.0);
    EXPECT_TRUE(compact.setValues(matrix));
    expectEqual();
    matrix.setBeside(&scalars, 7.0);
    EXPECT_FALSE(compact.setValues(matrix));
    expectEqual();
    matrix.setBeside(nullptr, 0.0);
    EXPECT_TRUE(compact.setValues(matrix));
    expectEqual();
}

/// Stiffness against mass is 1e5 : 1 here: products of rounded blocks would leave a hundredth of the mass to chance.
TEST(CompactMatrixTest, ASheetThatMovesAsOneFeelsItsMassAlone) {
    const SheetMatrix m(41);
    const Points x = Vec3(0.3, -0.7, 0.2).replicate(1, m.size());
    const Points y = product(m.compact.matrix, x);
    for (int i = 0; i < m.size(); ++i) {
        const Vec3 momentum = m.sheet.masses()[i] * x.col(i);
        EXPECT_LT((y.col(i) - momentum).norm(), 1e-6 * momentum.norm()) << "vertex " << i;
    }
}

TEST(CompactMatrixTest, IsSymmetric) {
    const SheetMatrix m(21);
    std::mt19937 random(3);
    const Points x = randomPoints(random, m.size()), y = randomPoints(random, m.size());
    const double xy = inner(x, product(m.compact.matrix, y)), yx = inner(y, product(m.compact.matrix, x));
    EXPECT_LT(std::abs(xy - yx), 1e-6 * x.norm() * product(m.compact.matrix, y).norm());
}

/// The operator that `factor` applies, in the order of vertices.
Dense inverseOf(const CompactMatrix& matrix, const CompactFactor& factor) {
    Dense result(3 * matrix.size(), 3 * matrix.size());
    for (int i = 0; i < 3 * matrix.size(); ++i) {
        Points unit = Points::Zero(3, matrix.size());
        unit.reshaped()[i] = 1.0;
        std::vector<float> z = packed(matrix, unit);
        factor.apply(z.data(), z.data());
        result.col(i) = unpacked(matrix, z).reshaped();
    }
    return result;
}

void expectPositive(const Dense& matrix) {
    ASSERT_TRUE(matrix.allFinite());
    EXPECT_LT((matrix - matrix.transpose()).norm(), 1e-4 * matrix.norm());
    const Eigen::SelfAdjointEigenSolver<Dense> eigen(0.5 * (matrix + matrix.transpose()));
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0.0);
}

Mat3 randomPositive(std::mt19937& random) {
    const Mat3 root = randomPoints(random, 3);
    return root * root.transpose();
}

void fillWithSprings(BlockMatrix& matrix, std::mt19937& random, double stiffness) {
    matrix.setZero();
    for (int i = 0; i < matrix.size(); ++i) {
        matrix.diagonal()[i].diagonal().array() += 1.0;
        for (int k = matrix.rowBegin(i); k < matrix.rowEnd(i); ++k) {
            const Mat3 spring = stiffness * randomPositive(random);
            matrix.diagonal()[i] += spring;
            matrix.diagonal()[matrix.column(k)] += spring;
            matrix.lower()[k] -= spring;
        }
    }
}

Dense dense(const BlockMatrix& matrix) {
    Dense result = Dense::Zero(3 * matrix.size(), 3 * matrix.size());
    for (int i = 0; i < matrix.size(); ++i) {
        result.block<3, 3>(3 * i, 3 * i) = matrix.diagonal()[i];
        for (int k = matrix.rowBegin(i); k < matrix.rowEnd(i); ++k) {
            result.block<3, 3>(3 * i, 3 * matrix.column(k)) = matrix.lower()[k];
            result.block<3, 3>(3 * matrix.column(k), 3 * i) = matrix.lower()[k].transpose();
        }
    }
    return result;
}

TEST(CompactFactorTest, IsExactWithoutFill) {
    std::mt19937 random(6);
    Pairs tree;
    for (int i = 1; i < 30; ++i) tree.emplace_back((i - 1) / 2, i);
    BlockMatrix matrix;
    matrix.setPattern(30, tree);
    fillWithSprings(matrix, random, 3.0);
    CompactShell& compact = matrix.compact();
    compact.factor.factor(FilteredMatrix(matrix));
    EXPECT_EQ(compact.factor.shift(), 0.0);
    EXPECT_LT((inverseOf(compact.matrix, compact.factor) * dense(matrix) - Dense::Identity(90, 90)).norm(), 1e-4);
}

TEST(CompactFactorTest, IsAPositivePreconditioner) {
    std::mt19937 random(7);
    Pairs pairs;
    for (int i = 0; i < 80; ++i) {
        const int a = std::uniform_int_distribution<int>(0, 24)(random);
        const int b = std::uniform_int_distribution<int>(0, 24)(random);
        if (a != b) pairs.emplace_back(a, b);
    }
    BlockMatrix matrix;
    matrix.setPattern(25, pairs);
    for (const double stiffness : {0.1, 1.0, 100.0}) {
        fillWithSprings(matrix, random, stiffness);
        CompactShell& compact = matrix.compact();
        compact.factor.factor(FilteredMatrix(matrix));
        expectPositive(inverseOf(compact.matrix, compact.factor));
    }
}

TEST(CompactFactorTest, IsThatOfTheAlteredMatrix) {
    std::mt19937 random(8);
    Pairs pairs;
    for (int i = 1; i < 30; ++i) pairs.emplace_back(i / 2, i), pairs.emplace_back(i - 1, i);
    BlockMatrix matrix, altered;
    for (BlockMatrix* m : {&matrix, &altered}) m->setPattern(30, pairs);
    fillWithSprings(matrix, random, 3.0);
    altered.diagonal() = matrix.diagonal();
    altered.lower() = matrix.lower();
    FilteredMatrix filtered(matrix);
    for (int i = 0; i < 30; i += 4) filtered.alterDiagonal(i) = altered.diagonal()[i] *= 2.0;
    for (int k = 1; k < std::ssize(altered.lower()); k += 3) filtered.alterLower(k) = altered.lower()[k] *= 0.5;
    matrix.compact().factor.factor(filtered);
    altered.compact().factor.factor(FilteredMatrix(altered));
    EXPECT_EQ(inverseOf(matrix.compact().matrix, matrix.compact().factor),
              inverseOf(altered.compact().matrix, altered.compact().factor));
}

/// Kershaw's matrix: positive definite, but the factor on its own pattern has a negative pivot.
BlockMatrix kershaw() {
    BlockMatrix matrix;
    matrix.setPattern(4, {{0, 1}, {1, 2}, {2, 3}, {0, 3}});
    for (Mat3& block : matrix.diagonal()) block = 3.0 * Mat3::Identity();
    for (Mat3& block : matrix.lower()) block = -2.0 * Mat3::Identity();
    matrix.lower()[matrix.slot(3, 0)] = 2.0 * Mat3::Identity();
    return matrix;
}

TEST(CompactFactorTest, StaysPositiveWhereThePlainFactorBreaksDown) {
    const BlockMatrix matrix = kershaw();
    CompactShell& compact = matrix.compact();
    compact.factor.factor(FilteredMatrix(matrix));
    expectPositive(inverseOf(compact.matrix, compact.factor));
}

TEST(CompactFactorTest, EndsOnIndefiniteAndOnNonFiniteMatrices) {
    BlockMatrix matrix = kershaw();
    matrix.diagonal()[2] = -Mat3::Identity();
    CompactShell& compact = matrix.compact();
    compact.factor.factor(FilteredMatrix(matrix));
    expectPositive(inverseOf(compact.matrix, compact.factor));
    matrix.diagonal()[1].setConstant(std::numeric_limits<double>::quiet_NaN());
    compact.factor.factor(FilteredMatrix(matrix));  // only has to return
}

/// S x of every vertex with a projector.
Points filtered(const std::vector<const Mat3*>& free, const CompactMatrix& matrix, Points x) {
    for (int i = 0; i < matrix.size(); ++i)
        if (const Mat3* s = free[matrix.rowOf()[i]]) x.col(i) = (*s * x.col(i)).eval();
    return x;
}

Points coarse(const SheetMatrix& m, const std::vector<const Mat3*>& free, const Points& r) {
    const CompactMatrix& matrix = m.compact.matrix;
    std::vector<float> z(4 * m.size(), 0.0f);
    m.compact.coarse->addTo(packed(matrix, r).data(), z.data());
    return filtered(free, matrix, unpacked(matrix, z));
}

/// On what it spans a Galerkin correction is the inverse: P (P^T A P)^-1 P^T applied to A P y is P y.
void expectProjection(SheetMatrix& m, const std::vector<const Mat3*>& free, std::span<const CoarseSpace::Tie> ties) {
    const CompactMatrix& matrix = m.compact.matrix;
    m.compact.coarse = std::make_unique<CoarseSpace>(matrix);
    m.compact.coarse->build(matrix, m.sheet.positions(), free, ties);
    std::mt19937 random(9);
    const Points r = filtered(free, matrix, randomPoints(random, m.size()));
    const Points z = coarse(m, free, r);
    Points az(3, m.size());
    m.step.matrix.multiply(z.data(), az.data());
    for (const auto& tie : ties) {
        std::array<int, 3> vertices;
        Vec3 u = Vec3::Zero();
        for (int a = 0; a < 3; ++a) {
            const auto found = std::find(matrix.rowOf().begin(), matrix.rowOf().end(), tie.rows[a]);
            vertices[a] = static_cast<int>(found - matrix.rowOf().begin());
            u += tie.weights[a] * z.col(vertices[a]);
        }
        for (int a = 0; a < 3; ++a) az.col(vertices[a]) += tie.weights[a] * (tie.stiffness * u);
    }
    const Points again = coarse(m, free, filtered(free, matrix, az));
    EXPECT_GT(z.norm(), 0.0);
    EXPECT_LT((again - z).norm(), 2e-3 * z.norm());
    const Points s = filtered(free, matrix, randomPoints(random, m.size()));
    EXPECT_NEAR(inner(s, z), inner(r, coarse(m, free, s)), 1e-4 * s.norm() * z.norm());
    EXPECT_GT(inner(r, z), 0.0);
}

TEST(CoarseSpaceTest, IsExactOnItsMotionsWithBending) {
    SheetMatrix m(31);
    const std::vector<const Mat3*> free(m.size(), nullptr);
    expectProjection(m, free, {});
    EXPECT_EQ(m.compact.coarse->patchCount(), 15);
    std::vector<int> members(15);
    for (const int patch : m.compact.coarse->patchOf()) ++members[patch];
    EXPECT_GE(*std::min_element(members.begin(), members.end()), 60);
    EXPECT_LE(*std::max_element(members.begin(), members.end()), 68);
}

/// Pins, vertices that slide in a plane or along a line, and soft rows; hinges, whose blocks are all in the pattern.
TEST(CoarseSpaceTest, IsExactOnItsMotionsUnderConstraints) {
    SheetMatrix m(31, DihedralBending{});
    ASSERT_EQ(m.step.matrix.beside(), nullptr);
    const Vec3 n = Vec3(1, 2, -1).normalized();
    const Mat3 pinned = Mat3::Zero(), inPlane = Mat3::Identity() - n * n.transpose(), onLine = n * n.transpose();
    std::vector<const Mat3*> free(m.size(), nullptr);
    for (int i = 0; i < 31; ++i) free[m.compact.matrix.rowOf()[31 * i]] = &pinned;
    for (int i = 0; i < 200; ++i) free[m.compact.matrix.rowOf()[400 + i]] = i % 3 == 0 ? &onLine : &inPlane;
    const auto& rowOf = m.compact.matrix.rowOf();
    const std::vector<CoarseSpace::Tie> ties{{{rowOf[700], rowOf[701], rowOf[732]}, Vec3(0.2, 0.3, 0.5), 10.0 * onLine},
                                             {{rowOf[410], rowOf[410], rowOf[410]}, Vec3(1, 0, 0), 0.1 * inPlane}};
    expectProjection(m, free, ties);
}

/// The same of bending over many edges, whose pairs with pinned vertices are of both signs.
TEST(CoarseSpaceTest, IsExactOnItsMotionsBesidePins) {
    SheetMatrix m(31, PatchBending{}, 10.0);
    ASSERT_NE(m.step.matrix.beside(), nullptr);
    const Mat3 pinned = Mat3::Zero();
    std::vector<const Mat3*> free(m.size(), nullptr);
    for (int i = 0; i < m.size(); i += 7) free[m.compact.matrix.rowOf()[i]] = &pinned;
    expectProjection(m, free, {});
}

/// Of a sheet that lies on a plane all vertices are held along its normal but some at the end of a patch. Those that
/// are let go after that are loose at most: r^T P^-1 r <= r^T M^-1 r.
TEST(CoarseSpaceTest, WhatIsLetGoFeelsItsMassAtLeast) {
    SheetMatrix m(31);
    const CompactMatrix& matrix = m.compact.matrix;
    m.compact.coarse = std::make_unique<CoarseSpace>(matrix);
    const Vec3 n = Vec3(1e-4, 1, 2e-4).normalized();
    const Mat3 inPlane = Mat3::Identity() - n * n.transpose();
    std::vector<const Mat3*> free(m.size(), &inPlane);
    std::vector<int> openIn(m.compact.coarse->patchCount(), 0);
    for (int row = 0; row < m.size(); ++row)  // 0, 1, 2, ... of the first patches
        if (const int patch = m.compact.coarse->patchOf()[row]; openIn[patch] < patch) {
            free[row] = nullptr;
            ++openIn[patch];
        }
    m.compact.coarse->build(matrix, m.sheet.positions(), free, {});
    for (int i = 0; i < m.size(); ++i) {
        if (!free[matrix.rowOf()[i]]) continue;
        Points r = Points::Zero(3, m.size());
        r.col(i) = n;
        std::vector<float> z(4 * m.size(), 0.0f);
        m.compact.coarse->addTo(packed(matrix, r).data(), z.data());
        const double work = inner(r, unpacked(matrix, z));
        EXPECT_GT(work, 0.0);
        EXPECT_LT(work, 1.01 / m.sheet.masses()[i]) << "vertex " << i;
    }
}

/// A patch of vertices on a line cannot turn about it. One that is pinned altogether has nothing but its mass, and
/// stays where it is whatever happens beside it.
TEST(CoarseSpaceTest, LeavesOutMotionsThatAreNone) {
    BlockMatrix matrix;
    Pairs chain;
    for (int i = 1; i < 256; ++i) chain.emplace_back(i - 1, i);
    matrix.setPattern(256, chain);
    std::mt19937 random(10);
    fillWithSprings(matrix, random, 5.0);
    CompactShell& compact = matrix.compact();
    compact.matrix.setValues(matrix);
    CoarseSpace space(compact.matrix);
    ASSERT_EQ(space.patchCount(), 4);
    Points line(3, 256);
    for (int i = 0; i < 256; ++i) line.col(i) = Vec3(0.1 * i, 0, 0);
    const Mat3 pinned = Mat3::Zero();
    std::vector<const Mat3*> free(256, nullptr);
    for (int row = 0; row < 256; ++row)
        if (space.patchOf()[row] == 2) free[row] = &pinned;
    space.build(compact.matrix, line, free, {});
    const std::vector<float> r = packed(compact.matrix, filtered(free, compact.matrix, randomPoints(random, 256)));
    std::vector<float> z(4 * 256, 0.0f);
    space.addTo(r.data(), z.data());
    double most = 0.0, work = 0.0;
    for (int row = 0; row < 256; ++row)
        for (int c = 0; c < 3; ++c) {
            ASSERT_TRUE(std::isfinite(z[4 * row + c]));
            if (free[row]) {
                EXPECT_EQ(z[4 * row + c], 0.0f);
            }
            most = std::max<double>(most, std::abs(z[4 * row + c]));
            work += r[4 * row + c] * z[4 * row + c];
        }
    EXPECT_GT(work, 0.0);
    EXPECT_LT(most, 100.0);
}

struct Solved {
    PcgReport report;
    double measured;  ///< residual as the report has it, anew
    Points v, unfiltered;
};

Solved solve(const SheetMatrix& m, Precision precision, double tolerance, bool withPositions = true,
             bool isCompact = false) {
    CoupledSystem system;
    system.begin({{.matrix = &m.step.matrix,
                   .rhs = &m.step.rhs,
                   .offset = 0,
                   .positions = withPositions ? &m.sheet.positions() : nullptr,
                   .isCompact = isCompact}},
                 m.size(), {}, {}, {}, precision);
    std::vector<VertexConstraint> pins;
    for (int i = 0; i < m.size(); ++i)
        if (m.sheet.isPinned(i)) pins.push_back({.vertex = i});
    system.setContacts(pins, {});
    CoupledPreconditioner preconditioner;
    preconditioner.build(system, Preconditioner::IncompleteCholesky);
    FilteredPcg pcg;
    CoupledVector u;
    system.start(m.sheet.velocities(), Eigen::Matrix<double, 6, Eigen::Dynamic>(6, 0), u);
    const double reference = pcg.begin(system, preconditioner, u);
    Solved result;
    result.report = pcg.solve(system, preconditioner, reference, tolerance, 3000, u);
    system.velocities(u, result.v);
    result.unfiltered = pcg.unfilteredResidual();
    result.measured = std::sqrt(pcg.begin(system, preconditioner, u) / reference);
    return result;
}

TEST(CompactSolveTest, VelocitiesEqualThoseOfTheDoubleSolve) {
    const SheetMatrix m(61);  // large enough for a coarse space
    const Solved expected = solve(m, Precision::Double, 1e-9);
    ASSERT_TRUE(expected.report.converged);
    const Points change = expected.v - m.sheet.velocities();
    for (const double tolerance : {1e-2, 1e-3, 1e-4, 1e-5}) {
        const Solved single = solve(m, Precision::Single, tolerance);
        EXPECT_TRUE(single.report.converged);
        EXPECT_LE(single.report.residual, tolerance);
        EXPECT_LT(single.measured, 1.02 * tolerance);
        EXPECT_LT((single.v - expected.v).norm(), 10.0 * tolerance * change.norm());
    }
}

TEST(CompactSolveTest, PreconditionsSolvesInDoubleToo) {
    const SheetMatrix m(61);
    const Solved expected = solve(m, Precision::Double, 1e-9);
    const Solved solved = solve(m, Precision::Double, 1e-9, true, true);
    EXPECT_TRUE(solved.report.converged);
    EXPECT_LT(2 * solved.report.iterations, expected.report.iterations);
    const Points change = expected.v - m.sheet.velocities();
    EXPECT_LT((solved.v - expected.v).norm(), 1e-7 * change.norm());
}

/// The residual is that of the double system at the end, exact to rounding in double: bodies and the ledger of momentum
/// depend on it.
TEST(CompactSolveTest, ResidualIsDouble) {
    const SheetMatrix m(31);
    const Solved solved = solve(m, Precision::Single, 1e-3);
    Points expected(3, m.size());
    m.step.matrix.multiply(solved.v.data(), expected.data());
    expected = m.step.rhs - expected;
    EXPECT_LT((solved.unfiltered - expected).norm(), 1e-13 * m.step.rhs.norm());
}

/// Solves of one step differ little in what they start from, and only that is multiplied again: each of two shells, and
/// whatever changes between.
TEST(CompactSolveTest, ResidualsAreDoubleWhereFewVerticesMove) {
    const SheetMatrix first(31), second(21);
    const int n = first.size(), all = n + second.size();
    CoupledSystem system;
    system.begin({{&first.step.matrix, &first.step.rhs, 0}, {&second.step.matrix, &second.step.rhs, n}}, all, {}, {},
                 {}, Precision::Single);
    std::mt19937 random(12);
    Points v = randomPoints(random, all);
    for (const int moved : {0, 1, 60, all}) {
        for (int k = 0; k < moved; ++k) v.col((37 * k) % all) = randomPoints(random, 1);
        CoupledVector u, r;
        system.start(v, Eigen::Matrix<double, 6, Eigen::Dynamic>(6, 0), u);
        r.resize(all, 0);
        Points unfiltered, expected(3, all);
        system.residual(u, r, unfiltered);
        first.step.matrix.multiply(v.data(), expected.data());
        second.step.matrix.multiply(v.data() + 3 * n, expected.data() + 3 * n);
        expected.leftCols(n) = first.step.rhs - expected.leftCols(n);
        expected.rightCols(all - n) = second.step.rhs - expected.rightCols(all - n);
        EXPECT_LT((unfiltered - expected).norm(), 1e-13 * expected.norm()) << moved << " moved";
    }
}

/// Contacts come in a step: few, which the coarse space need not know, or so many that it is made anew.
TEST(CompactSolveTest, ACoarseSpaceIsKeptAsLongAsItServes) {
    const SheetMatrix m(61);
    for (const int apart : {97, 9}) {
        CoupledSystem system;
        system.begin({{.matrix = &m.step.matrix, .rhs = &m.step.rhs, .offset = 0, .positions = &m.sheet.positions()}},
                     m.size(), {}, {}, {}, Precision::Single);
        std::vector<VertexConstraint> pins, contacts;
        for (int i = 0; i < m.size(); ++i) {
            if (m.sheet.isPinned(i))
                pins.push_back({.vertex = i});
            else if (i % apart == 0)
                contacts.push_back({.vertex = i, .free = Vec3(1, 0, 1).asDiagonal()});
        }
        contacts.insert(contacts.end(), pins.begin(), pins.end());
        CoupledPreconditioner preconditioner;
        system.setContacts(pins, {});
        preconditioner.build(system, Preconditioner::IncompleteCholesky);
        system.setContacts(contacts, {});
        std::array<CoupledVector, 2> solved;
        std::array<int, 2> iterations{};
        for (const bool keepsCoarse : {true, false}) {
            preconditioner.build(system, Preconditioner::IncompleteCholesky, keepsCoarse);
            FilteredPcg pcg;
            CoupledVector& u = solved[keepsCoarse];
            system.start(m.sheet.velocities(), Eigen::Matrix<double, 6, Eigen::Dynamic>(6, 0), u);
            const double reference = pcg.begin(system, preconditioner, u);
            iterations[keepsCoarse] = pcg.solve(system, preconditioner, reference, 1e-2, 3000, u).iterations;
            EXPECT_TRUE(pcg.solve(system, preconditioner, reference, 1e-5, 3000, u).converged);
        }
        EXPECT_LT((solved[true].s - solved[false].s).norm(), 1e-3 * solved[false].s.norm());
        EXPECT_LE(iterations[true], iterations[false] + 6) << apart << " apart";  // what building it costs
    }
}

TEST(CompactSolveTest, SaysWhenItsBudgetIsSpent) {
    const SheetMatrix m(21);
    CoupledSystem system;
    system.begin({{&m.step.matrix, &m.step.rhs, 0}}, m.size(), {}, {}, {}, Precision::Single);
    CoupledPreconditioner preconditioner;
    preconditioner.build(system, Preconditioner::IncompleteCholesky);
    FilteredPcg pcg;
    CoupledVector u;
    system.start(m.sheet.velocities(), Eigen::Matrix<double, 6, Eigen::Dynamic>(6, 0), u);
    const double reference = pcg.begin(system, preconditioner, u);
    const PcgReport report = pcg.solve(system, preconditioner, reference, 1e-5, 2, u);
    EXPECT_EQ(report.iterations, 2);
    EXPECT_FALSE(report.converged);
    EXPECT_GT(report.residual, 1e-5);
}

double iterationsOfASolve(int n) {
    Shell sheet = swingingSheet(n, 0);
    int iterations = 0, solves = 0;
    for (int k = 0; k < 8; ++k) {
        const StepReport report = sheet.step(kStep, kGravity);
        EXPECT_TRUE(report.converged);
        iterations += report.pcgIterations;
        solves += report.solves;
    }
    return double(iterations) / solves;
}

TEST(CompactSolveTest, IterationsHardlyGrowWithTheNumberOfVertices) {
    const double few = iterationsOfASolve(71), many = iterationsOfASolve(141);  // four times as many vertices
    EXPECT_LE(few, 20.0);
    EXPECT_LT(many, 1.5 * few);  // without a coarse space: 2.3
}

TEST(CompactSolveTest, ACoarseSpaceSavesMostIterations) {
    const SheetMatrix m(101);
    const Solved with = solve(m, Precision::Single, 1e-3), without = solve(m, Precision::Single, 1e-3, false);
    EXPECT_LE(with.report.iterations, 25);
    EXPECT_LT(2 * with.report.iterations, without.report.iterations);
}

}  // namespace
}  // namespace jacket
