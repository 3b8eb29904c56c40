#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "solver/FilteredPcg.h"
#include "solver/StepSystem.h"
#include "support/Differences.h"

/// The parts of the linear solve, each against dense algebra.
namespace jacket {
namespace {

using Dense = Eigen::MatrixXd;
using DenseVector = Eigen::VectorXd;
using Pairs = std::vector<std::pair<int, int>>;

double uniform(std::mt19937& random, double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
}

int anyBelow(std::mt19937& random, int count) {
    return std::uniform_int_distribution<int>(0, count - 1)(random);
}

template <class Matrix>
Matrix randomMatrix(std::mt19937& random) {
    return Matrix::NullaryExpr([&] { return uniform(random, -1.0, 1.0); });
}

Points randomPoints(std::mt19937& random, int count) {
    return Points::NullaryExpr(3, count, [&] { return uniform(random, -1.0, 1.0); });
}

template <int N>
Eigen::Matrix<double, N, N> randomPositive(std::mt19937& random) {
    const auto root = randomMatrix<Eigen::Matrix<double, N, N>>(random);
    return root * root.transpose();
}

Pairs randomPairs(std::mt19937& random, int size, int count) {
    Pairs pairs;
    while (size > 1 && static_cast<int>(pairs.size()) < count) {
        const int i = anyBelow(random, size), j = anyBelow(random, size);
        if (i != j) pairs.emplace_back(i, j);
    }
    return pairs;
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

/// Masses and springs that are stiff in random directions: like a shell's matrix.
void fillWithSprings(BlockMatrix& matrix, std::mt19937& random, double stiffness) {
    matrix.setZero();
    for (int i = 0; i < matrix.size(); ++i) {
        matrix.diagonal()[i].diagonal().array() += uniform(random, 0.5, 1.5);
        for (int k = matrix.rowBegin(i); k < matrix.rowEnd(i); ++k) {
            const Mat3 spring = stiffness * randomPositive<3>(random);
            matrix.diagonal()[i] += spring;
            matrix.diagonal()[matrix.column(k)] += spring;
            matrix.lower()[k] -= spring;
        }
    }
}

TEST(BlockMatrixTest, ProductEqualsDense) {
    std::mt19937 random(1);
    for (const int size : {1, 2, 7, 40}) {
        BlockMatrix matrix;
        matrix.setPattern(size, randomPairs(random, size, 3 * size));
        for (Mat3& block : matrix.diagonal()) block = randomPositive<3>(random);
        for (Mat3& block : matrix.lower()) block = randomMatrix<Mat3>(random);
        const Points x = randomPoints(random, size);
        Points y(3, size);
        matrix.multiply(x.data(), y.data());
        const DenseVector expected = dense(matrix) * x.reshaped();
        EXPECT_LT(test::relativeError(DenseVector(y.reshaped()), expected), 1e-14) << size << " vertices";
    }
}

TEST(BlockMatrixTest, PatternTakesPairsInAnyOrderAndOnce) {
    BlockMatrix matrix;
    matrix.setPattern(5, {{3, 1}, {1, 3}, {0, 4}, {3, 1}, {3, 0}});
    EXPECT_EQ(matrix.lower().size(), 3u);
    EXPECT_EQ(matrix.rowEnd(3) - matrix.rowBegin(3), 2);
    for (const auto& [row, column] : Pairs{{3, 1}, {4, 0}, {3, 0}}) {
        const int slot = matrix.slot(row, column);
        EXPECT_EQ(matrix.column(slot), column);
        EXPECT_TRUE(matrix.rowBegin(row) <= slot && slot < matrix.rowEnd(row));
    }
}

TEST(BlockMatrixTest, SetZeroKeepsThePattern) {
    std::mt19937 random(2);
    BlockMatrix matrix;
    matrix.setPattern(6, randomPairs(random, 6, 10));
    const auto blocks = matrix.lower().size();
    fillWithSprings(matrix, random, 1.0);
    matrix.setZero();
    EXPECT_EQ(matrix.lower().size(), blocks);
    EXPECT_EQ(dense(matrix).norm(), 0.0);
}

/// A step's system and the same one assembled densely.
struct Assembly {
    static constexpr int kSize = 9;
    static constexpr double kStep = 0.02, kBeta = 0.003;
    std::mt19937 random;
    StepSystem system;
    Dense matrix = Dense::Zero(3 * kSize, 3 * kSize);
    DenseVector rhs = DenseVector::Zero(3 * kSize);

    explicit Assembly(unsigned seed) : random(seed) {
        Pairs pairs;
        for (int i = 0; i < kSize; ++i)
            for (int j = 0; j < i; ++j) pairs.emplace_back(j, i);
        system.matrix.setPattern(kSize, pairs);
        system.begin(kStep, kBeta);
    }

    template <int N>
    std::array<int, N> vertices() {
        std::array<int, kSize> all;
        for (int i = 0; i < kSize; ++i) all[i] = i;
        std::shuffle(all.begin(), all.end(), random);
        std::array<int, N> some;
        std::copy_n(all.begin(), N, some.begin());
        return some;
    }

    template <int N>
    void scatter(const std::array<int, N>& at, const Eigen::Matrix<double, 3 * N, 3 * N>& term, double factor) {
        for (int a = 0; a < N; ++a)
            for (int b = 0; b < N; ++b)
                matrix.block<3, 3>(3 * at[a], 3 * at[b]) += factor * term.template block<3, 3>(3 * a, 3 * b);
    }

    template <int N>
    void addEnergy() {
        const auto at = vertices<N>();
        const StencilEval<N> term{
            .energy = 0.0, .gradient = randomMatrix<Stencil<N>>(random), .hessian = randomPositive<3 * N>(random)};
        system.add<N>(at, stencilSlots<N>(system.matrix, at), term);
        scatter<N>(at, term.hessian, kStep * kStep + kStep * kBeta);
        for (int a = 0; a < N; ++a) rhs.segment<3>(3 * at[a]) -= kStep * term.gradient.col(a);
    }

    template <int N>
    void addDamping() {
        const auto at = vertices<N>();
        const Eigen::Matrix<double, 3 * N, 3 * N> term = randomPositive<3 * N>(random);
        system.addDamping<N>(at, stencilSlots<N>(system.matrix, at), term);
        scatter<N>(at, term, kStep);
    }

    void addDrag(const Points& v) {
        const auto at = vertices<3>();
        const Vec3 force = test::randomVector(random, 1.0);
        const Mat3 drag = randomPositive<3>(random);
        system.addDrag(at, stencilSlots<3>(system.matrix, at), force, drag, v);
        const Eigen::Matrix<double, 9, 9> all = drag.replicate<3, 3>();
        scatter<3>(at, all, kStep);
        for (const int a : at)
            for (const int b : at) rhs.segment<3>(3 * a) += kStep * (force / 3.0 + drag * v.col(b));
    }

    void expectEqual() const {
        EXPECT_LT(test::relativeError(dense(system.matrix), matrix), 1e-14);
        EXPECT_LT(test::relativeError(DenseVector(system.rhs.reshaped()), rhs), 1e-13);
    }
};

TEST(StepSystemTest, StencilSlotsSayWhereBlocksAre) {
    BlockMatrix matrix;
    matrix.setPattern(4, {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}});
    const auto slots = stencilSlots<3>(matrix, {2, 0, 3});  // blocks (0, 2), (3, 2), (3, 0)
    EXPECT_EQ(slots[0], ~matrix.slot(2, 0));
    EXPECT_EQ(slots[1], matrix.slot(3, 2));
    EXPECT_EQ(slots[2], matrix.slot(3, 0));
}

TEST(StepSystemTest, EnergiesOfEveryStencilSizeEqualDense) {
    Assembly assembly(3);
    for (int i = 0; i < 20; ++i) {
        assembly.addEnergy<2>();
        assembly.addEnergy<3>();
        assembly.addEnergy<4>();
    }
    assembly.expectEqual();
}

TEST(StepSystemTest, DampingDragAndMassEqualDense) {
    Assembly assembly(4);
    const Points v = randomPoints(assembly.random, Assembly::kSize);
    const DenseVector mass = DenseVector::Random(Assembly::kSize).array() + 2.0;
    for (int i = 0; i < 10; ++i) {
        assembly.addDamping<2>();
        assembly.addDamping<4>();
        assembly.addDrag(v);
    }
    assembly.system.addMass(mass, v, 0.7);
    for (int i = 0; i < Assembly::kSize; ++i) {
        assembly.matrix.block<3, 3>(3 * i, 3 * i) += mass[i] * (1.0 + Assembly::kStep * 0.7) * Mat3::Identity();
        assembly.rhs.segment<3>(3 * i) += mass[i] * v.col(i);
    }
    assembly.expectEqual();
}

TEST(StepSystemTest, TakesAConstantHessianIntoItsBlocksAndBesideThem) {
    constexpr int kSize = 20;
    const double h = Assembly::kStep;
    std::mt19937 random(9);
    Dense dense = Dense::Identity(kSize, kSize);
    for (const auto& [i, j] : randomPairs(random, kSize, 80)) dense(i, j) = dense(j, i) = 0.1 * (i + j + 1);
    ConstantHessian scalars;
    for (int i = 0; i < kSize; ++i) {
        for (int j = 0; j < kSize; ++j)
            if (dense(i, j) != 0.0) scalars.append(j, dense(i, j));
        scalars.endRow();
    }
    StepSystem system;
    system.matrix.setPattern(kSize, randomPairs(random, kSize, 60));
    scalars.split(system.matrix);
    EXPECT_GT(scalars.besideCount(), 0u);
    EXPECT_LT(static_cast<Eigen::Index>(scalars.besideCount()), (dense.array() != 0.0).count() - kSize);
    system.begin(h, Assembly::kBeta, &scalars);
    const Points x = randomPoints(random, kSize);
    Points y(3, kSize);
    system.matrix.multiply(x.data(), y.data());
    const Dense expected = (h * h + h * Assembly::kBeta) * x * dense;
    EXPECT_LT((y - expected).norm(), 1e-14 * expected.norm());
}

TEST(StepSystemTest, AlterationIsAForceOfTheUndampedStiffness) {
    Assembly assembly(5);
    for (int i = 0; i < 10; ++i) assembly.addEnergy<4>();
    const Points y = randomPoints(assembly.random, Assembly::kSize);
    assembly.system.addAlteration(y);
    const double h = Assembly::kStep;
    const Dense stiffness = assembly.matrix / (h * h + h * Assembly::kBeta);
    assembly.rhs -= h * stiffness * y.reshaped();
    assembly.system.addForce(4, Vec3(1, 2, 3));
    assembly.rhs.segment<3>(12) += h * Vec3(1, 2, 3);
    assembly.expectEqual();
}

TEST(FilteredMatrixTest, CopiesWhatIsAlteredAlone) {
    std::mt19937 random(4);
    BlockMatrix matrix;
    matrix.setPattern(25, randomPairs(random, 25, 80));
    fillWithSprings(matrix, random, 3.0);
    const std::vector<Mat3> diagonal = matrix.diagonal(), lower = matrix.lower();
    FilteredMatrix filtered(matrix);
    for (int i = 0; i < 25; i += 3) filtered.alterDiagonal(i) *= 2.0;
    for (int k = 0; k < std::ssize(lower); k += 5) filtered.alterLower(k) *= 3.0;
    filtered.alterLower(5) *= 2.0;  // once more
    for (int i = 0; i < 25; ++i) EXPECT_EQ(filtered.diagonal(i), (i % 3 ? 1.0 : 2.0) * diagonal[i]);
    for (int k = 0; k < std::ssize(lower); ++k)
        EXPECT_EQ(filtered.lower(k), (k % 5 ? 1.0 : k == 5 ? 6.0 : 3.0) * lower[k]);
    EXPECT_EQ(filtered.alteredCount(), 9 + (lower.size() + 4) / 5);
    EXPECT_TRUE(matrix.diagonal() == diagonal);
    EXPECT_TRUE(matrix.lower() == lower);
    filtered.begin(matrix);
    EXPECT_EQ(filtered.diagonal(3), diagonal[3]);
    EXPECT_EQ(filtered.alteredCount(), 0u);
}

/// The operator that `factor` applies.
Dense inverseOf(const IncompleteCholesky& factor, int size) {
    Dense result(3 * size, 3 * size);
    for (int i = 0; i < 3 * size; ++i) {
        const DenseVector unit = DenseVector::Unit(3 * size, i);
        DenseVector z(3 * size);
        factor.apply(unit.data(), z.data());
        result.col(i) = z;
    }
    return result;
}

void expectPositive(const Dense& matrix) {
    ASSERT_TRUE(matrix.allFinite());
    EXPECT_LT((matrix - matrix.transpose()).norm(), 1e-12 * matrix.norm());
    const Eigen::SelfAdjointEigenSolver<Dense> eigen(0.5 * (matrix + matrix.transpose()));
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0.0);
}

TEST(IncompleteCholeskyTest, IsExactWithoutFill) {
    std::mt19937 random(6);
    Pairs chain;
    for (int i = 1; i < 30; ++i) chain.emplace_back(i - 1, i);
    BlockMatrix matrix;
    matrix.setPattern(30, chain);
    fillWithSprings(matrix, random, 3.0);
    IncompleteCholesky factor;
    factor.factor(FilteredMatrix(matrix));
    EXPECT_EQ(factor.shift(), 0.0);
    EXPECT_LT((inverseOf(factor, 30) * dense(matrix) - Dense::Identity(90, 90)).norm(), 1e-11);
}

TEST(IncompleteCholeskyTest, IsAPositivePreconditioner) {
    std::mt19937 random(7);
    BlockMatrix matrix;
    matrix.setPattern(25, randomPairs(random, 25, 80));
    for (const double stiffness : {0.1, 1.0, 100.0}) {
        fillWithSprings(matrix, random, stiffness);
        IncompleteCholesky factor;
        factor.factor(FilteredMatrix(matrix));
        expectPositive(inverseOf(factor, 25));
    }
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

TEST(IncompleteCholeskyTest, ShiftsWhereThePlainFactorBreaksDown) {
    const BlockMatrix matrix = kershaw();
    expectPositive(dense(matrix));
    IncompleteCholesky factor;
    factor.factor(FilteredMatrix(matrix));
    EXPECT_GT(factor.shift(), 0.0);
    expectPositive(inverseOf(factor, 4));
}

TEST(IncompleteCholeskyTest, ForgetsTheShiftWhenTheBreakdownIsOver) {
    BlockMatrix matrix = kershaw();
    IncompleteCholesky factor;
    factor.factor(FilteredMatrix(matrix));
    const double needed = factor.shift();
    factor.factor(FilteredMatrix(matrix));
    EXPECT_LE(factor.shift(), 2.0 * needed);  // does not pile up
    for (Mat3& block : matrix.lower()) block *= 0.1;
    for (int i = 0; i < 40; ++i) factor.factor(FilteredMatrix(matrix));
    EXPECT_EQ(factor.shift(), 0.0);
}

TEST(IncompleteCholeskyTest, EndsOnIndefiniteAndOnNonFiniteMatrices) {
    BlockMatrix matrix = kershaw();
    matrix.diagonal()[2] = -Mat3::Identity();
    IncompleteCholesky factor;
    factor.factor(FilteredMatrix(matrix));
    expectPositive(inverseOf(factor, 4));
    matrix.diagonal()[1].setConstant(std::numeric_limits<double>::quiet_NaN());
    factor.factor(FilteredMatrix(matrix));  // only has to return
}

/// Shells of random matrices, random bodies, and what is asked of them.
struct Island {
    std::mt19937 random;
    std::vector<BlockMatrix> matrices;
    std::vector<Points> rhs;
    CoupledSystem system;
    std::vector<VertexConstraint> constraints;
    std::vector<SoftRow> rows;

    Island(unsigned seed, const std::vector<int>& sizes, int bodies) : random(seed) {
        for (const int size : sizes) addShell(size);
        std::vector<CoupledSystem::ShellPart> parts;
        int count = 0;
        for (std::size_t k = 0; k < sizes.size(); ++k) {
            parts.push_back({&matrices[k], &rhs[k], count});
            count += sizes[k];
        }
        std::vector<Mat6> masses;
        std::vector<Vec6> twists;
        for (int b = 0; b < bodies; ++b) {
            masses.push_back(randomMass());
            twists.push_back(randomMatrix<Vec6>(random));
        }
        system.begin(parts, count, masses, twists);
    }
    Island(const Island&) = delete;

    /// A strip of triangles (i, i + 1, i + 2), and a few springs across.
    void addShell(int size) {
        Pairs pairs = randomPairs(random, size, size / 2);
        for (int i = 1; i < size; ++i) pairs.emplace_back(i, i - 1);
        for (int i = 2; i < size; ++i) pairs.emplace_back(i - 2, i);
        matrices.emplace_back().setPattern(size, pairs);
        fillWithSprings(matrices.back(), random, 4.0);
        rhs.push_back(randomPoints(random, size));
    }

    Mat6 randomMass() {
        const Mat3 turn = test::randomRotation(random);
        const Vec3 inertia(uniform(random, 0.1, 1.0), uniform(random, 0.1, 1.0), uniform(random, 0.1, 1.0));
        Mat6 mass = uniform(random, 0.2, 5.0) * Mat6::Identity();
        mass.bottomRightCorner<3, 3>() = turn * inertia.asDiagonal() * turn.transpose();
        return mass;
    }

    /// Holds `held` random directions of a vertex, relative to a dynamic body or (-1) to something that moves as told.
    void hold(int vertex, int held, int body, double drag = 0.0) {
        const Mat3 frame = test::randomRotation(random);
        VertexConstraint c{.vertex = vertex, .body = body};
        c.free = frame.rightCols(3 - held) * frame.rightCols(3 - held).transpose();
        c.z = frame.leftCols(held) * test::randomVector(random, 1.0).head(held);
        if (body >= 0)
            c.arm = test::randomVector(random, 1.0);
        else
            c.carried = test::randomVector(random, 1.0);
        if (drag > 0.0) {  // slides over the body, with friction
            c.tie = Mat3::Identity() - c.free;
            rows.push_back({{vertex, vertex, vertex}, Vec3::UnitX(), body, c.arm, c.carried, drag * c.free});
        }
        constraints.push_back(c);
    }

    void addRow(const std::array<int, 3>& vertices, const Vec3& weights, int body) {
        SoftRow row{.vertices = vertices, .weights = weights, .body = body};
        if (body >= 0)
            row.arm = test::randomVector(random, 1.0);
        else
            row.carried = test::randomVector(random, 1.0);
        row.stiffness = 20.0 * randomPositive<3>(random);
        row.load = test::randomVector(random, 1.0);
        rows.push_back(row);
    }

    /// Joins bodies by stiff rows between them, some pairs more than once; the rows' terms are the couplings.
    void couple(const Pairs& pairs) {
        std::vector<Mat6> masses = system.mass();
        std::vector<BodyCoupling> couplings;
        for (const auto& [a, b] : pairs) {
            const auto row = randomMatrix<Eigen::Matrix<double, 2, 12>>(random);
            const Eigen::Matrix<double, 12, 12> term = 3.0 * row.transpose() * row;
            masses[a] += term.topLeftCorner<6, 6>();
            masses[b] += term.bottomRightCorner<6, 6>();
            couplings.push_back({a, b, term.topRightCorner<6, 6>()});
        }
        const std::vector<CoupledSystem::ShellPart> parts(system.shells().begin(), system.shells().end());
        system.begin(parts, system.vertexCount(), masses, system.freeTwist(), couplings);
    }

    void finish() { system.setContacts(constraints, rows); }
};

/// Every kind of constraint and row at once.
void makeBusy(Island& island, double drag) {
    const int bodies = island.system.bodyCount();
    for (int i = 0; i < island.system.vertexCount(); i += 2)
        island.hold(i, (i / 2) % 4, i % 3 == 0 ? -1 : i % bodies, drag);
    island.addRow({4, 3, 5}, Vec3(0.2, 0.5, 0.3), 0);
    island.addRow({7, 8, 8}, Vec3(0.25, 0.75, 0.0), 1);
    island.addRow({2, 2, 2}, Vec3(1.0, 0.0, 0.0), 1);  // the vertex is in a filter too
    island.addRow({9, 10, 11}, Vec3(0.1, 0.1, 0.8), -1);
    island.finish();
}

/// Minimises 1/2 x.H x - g.x, x = (v, w), subject to C x = c.
struct DenseIsland {
    Dense H, C;
    DenseVector g, c;
    int vertices;

    explicit DenseIsland(const CoupledSystem& system) : vertices(system.vertexCount()) {
        const int size = 3 * vertices + 6 * system.bodyCount();
        H.setZero(size, size);
        g.setZero(size);
        C.resize(0, size);
        for (const auto& shell : system.shells()) {
            const int n = 3 * shell.matrix->size();
            H.block(3 * shell.offset, 3 * shell.offset, n, n) = dense(*shell.matrix);
            g.segment(3 * shell.offset, n) = shell.rhs->reshaped();
        }
        for (int b = 0; b < system.bodyCount(); ++b) {
            H.block<6, 6>(bodyAt(b), bodyAt(b)) = system.mass()[b];
        }
        for (const auto& coupling : system.couplings()) {
            H.block<6, 6>(bodyAt(coupling.a), bodyAt(coupling.b)) += coupling.mass;
            H.block<6, 6>(bodyAt(coupling.b), bodyAt(coupling.a)) += coupling.mass.transpose();
        }
        for (int b = 0; b < system.bodyCount(); ++b)
            g.tail(6 * system.bodyCount()) +=
                H.bottomRows(6 * system.bodyCount()).middleCols<6>(bodyAt(b)) * system.freeTwist()[b];
        for (const auto& row : system.rows()) addRow(row);
        for (const auto& constraint : system.constraints()) addConstraint(constraint);
    }

    int bodyAt(int body) const { return 3 * vertices + 6 * body; }

    /// Velocity of a point of the shell relative to a body's point, as a matrix on x.
    Dense relative(const std::array<int, 3>& at, const Vec3& weights, int body, const Vec3& arm) const {
        Dense J = Dense::Zero(3, g.size());
        for (int a = 0; a < 3; ++a) J.middleCols<3>(3 * at[a]) += weights[a] * Mat3::Identity();
        if (body < 0) return J;
        J.middleCols<3>(bodyAt(body)) = -Mat3::Identity();
        J.middleCols<3>(bodyAt(body) + 3) = skew(arm);
        return J;
    }

    void addRow(const SoftRow& row) {
        const Dense J = relative(row.vertices, row.weights, row.body, row.arm);
        H += J.transpose() * row.stiffness * J;
        g += J.transpose() * (row.load + row.stiffness * row.carried);
    }

    void addConstraint(const VertexConstraint& constraint) {
        const int i = constraint.vertex;
        const Dense B = relative({i, i, i}, Vec3::UnitX(), constraint.body, constraint.arm);
        const Mat3 held = Mat3::Identity() - constraint.free;
        const Eigen::SelfAdjointEigenSolver<Mat3> eigen(held);
        for (int k = 0; k < 3; ++k) {
            if (eigen.eigenvalues()[k] < 0.5) continue;
            const Vec3 n = eigen.eigenvectors().col(k);
            C.conservativeResize(C.rows() + 1, Eigen::NoChange);
            c.conservativeResize(C.rows());
            C.bottomRows<1>() = n.transpose() * B;
            c[C.rows() - 1] = n.dot(constraint.carried + constraint.z);
        }
    }

    DenseVector solve() const {
        const auto n = H.rows(), m = C.rows();
        Dense kkt = Dense::Zero(n + m, n + m);
        kkt.topLeftCorner(n, n) = H;
        kkt.topRightCorner(n, m) = C.transpose();
        kkt.bottomLeftCorner(m, n) = C;
        DenseVector right(n + m);
        right << g, c;
        return kkt.fullPivLu().solve(right).head(n);
    }
};

struct Solved {
    PcgReport report;
    CoupledVector u;
    Points v, unfiltered;
    DenseVector x() const {
        DenseVector all(v.size() + u.w.size());
        all << v.reshaped(), u.w.reshaped();
        return all;
    }
};

Solved solve(const CoupledSystem& system, Preconditioner kind, double tolerance = 1e-12, int maxIterations = 2000) {
    CoupledPreconditioner preconditioner;
    preconditioner.build(system, kind);
    FilteredPcg pcg;
    Solved result;
    result.u.resize(system.vertexCount(), system.bodyCount());
    const CoupledVector still = result.u;
    system.start(still.s, still.w, result.u);
    const double reference = pcg.begin(system, preconditioner, result.u);
    result.report = pcg.solve(system, preconditioner, reference, tolerance, maxIterations, result.u);
    CoupledVector residual = still;
    system.residual(result.u, residual, result.unfiltered);
    system.velocities(result.u, result.v);
    return result;
}

constexpr auto kPreconditioners = {Preconditioner::BlockJacobi, Preconditioner::IncompleteCholesky};

void expectDenseSolution(const CoupledSystem& system) {
    const DenseVector expected = DenseIsland(system).solve();
    for (const auto kind : kPreconditioners) {
        const Solved solved = solve(system, kind);
        EXPECT_TRUE(solved.report.converged);
        EXPECT_LT(solved.report.residual, 1e-12);
        EXPECT_LT(test::relativeError(solved.x(), expected), 1e-9);
    }
}

TEST(FilteredPcgTest, FreeSystemEqualsDense) {
    Island island(8, {20}, 0);
    island.finish();
    expectDenseSolution(island.system);
}

TEST(FilteredPcgTest, EveryNumberOfFreeDirectionsEqualsDense) {
    for (int held = 0; held <= 3; ++held) {
        SCOPED_TRACE(::testing::Message() << 3 - held << " free directions");
        Island island(9 + held, {20}, 0);
        for (const int vertex : {0, 3, 4, 11, 19}) island.hold(vertex, held, -1);
        island.finish();
        expectDenseSolution(island.system);
    }
}

TEST(FilteredPcgTest, HeldDirectionsMoveAsPrescribed) {
    Island island(13, {12}, 0);
    for (int vertex = 0; vertex < 12; ++vertex) island.hold(vertex, vertex % 4, -1);
    island.finish();
    const Solved solved = solve(island.system, Preconditioner::IncompleteCholesky, 1e-2);
    for (const auto& c : island.constraints) {
        const Vec3 s = solved.v.col(c.vertex) - c.carried;
        EXPECT_LT(((Mat3::Identity() - c.free) * s - c.z).norm(), 1e-13);
    }
}

TEST(FilteredPcgTest, BodiesRowsAndFrictionEqualDense) {
    for (const double drag : {0.0, 3.0}) {
        Island island(14, {13, 8}, 2);
        makeBusy(island, drag);
        expectDenseSolution(island.system);
    }
}

/// Bodies, rows and friction are eliminated exactly; a shell beside that is not costs iterations.
TEST(FilteredPcgTest, CompleteFactorsNeedOneIteration) {
    for (const bool all : {true, false}) {
        Island island(14, {13, 8}, 3);
        island.couple({{0, 2}});
        std::vector<CoupledSystem::ShellPart> parts(island.system.shells().begin(), island.system.shells().end());
        parts[0].isFactored = true;
        parts[1].isFactored = all;
        island.system.begin(parts, 21, island.system.mass(), island.system.freeTwist(),
                            {island.system.couplings().begin(), island.system.couplings().end()});
        makeBusy(island, 3.0);
        const Solved solved = solve(island.system, Preconditioner::IncompleteCholesky, 1e-9);
        EXPECT_LT(test::relativeError(solved.x(), DenseIsland(island.system).solve()), 1e-8);
        EXPECT_LE(solved.report.iterations, all ? 1 : 40);
    }
}

/// Rounding in the preconditioner does not end up in the solution.
TEST(FilteredPcgTest, CompactFactorsServeBodiesRowsAndFriction) {
    Island island(14, {13, 8}, 2);
    std::vector<CoupledSystem::ShellPart> parts(island.system.shells().begin(), island.system.shells().end());
    for (auto& part : parts) part.isCompact = true;
    island.system.begin(parts, 21, island.system.mass(), island.system.freeTwist());
    makeBusy(island, 3.0);
    const Solved solved = solve(island.system, Preconditioner::IncompleteCholesky, 1e-10);
    EXPECT_TRUE(solved.report.converged);
    EXPECT_LT(test::relativeError(solved.x(), DenseIsland(island.system).solve()), 1e-8);
}

TEST(FilteredPcgTest, LightAndHeavyBodiesEqualDense) {
    for (const double ratio : {1e-3, 1e3}) {
        Island island(15, {16}, 1);
        std::vector<Mat6> masses = island.system.mass();
        masses[0] *= ratio;
        const std::vector<CoupledSystem::ShellPart> parts(island.system.shells().begin(), island.system.shells().end());
        island.system.begin(parts, 16, masses, {island.system.freeTwist()[0]});
        for (const int vertex : {2, 3, 9}) island.hold(vertex, 1, 0);
        island.finish();
        expectDenseSolution(island.system);
    }
}

/// Matrix of the filtered operator.
TEST(FilteredPcgTest, CoupledBodiesEqualDense) {
    Island island(40, {13, 8}, 5);
    island.couple({{0, 3}, {4, 1}, {3, 4}, {0, 3}});  // 2 stays alone
    makeBusy(island, 2.0);
    expectDenseSolution(island.system);
}

/// Without contacts the preconditioner of the bodies is the inverse of their operator.
TEST(FilteredPcgTest, GroupsOfCoupledBodiesAreFactoredExactly) {
    Island island(41, {9}, 4);
    island.couple({{2, 0}, {3, 2}, {2, 0}});
    island.finish();
    CoupledPreconditioner preconditioner;
    preconditioner.build(island.system, Preconditioner::BlockJacobi);
    CoupledVector u, r, z;
    for (CoupledVector* vector : {&u, &r, &z}) vector->resize(9, 4);
    u.w = Eigen::Matrix<double, 6, Eigen::Dynamic>::NullaryExpr(6, 4, [&] { return uniform(island.random, -1, 1); });
    island.system.apply(u, r);
    preconditioner.apply(island.system, r, z);
    EXPECT_LT(test::relativeError(DenseVector(z.w.reshaped()), DenseVector(u.w.reshaped())), 1e-11);
}

Dense operatorOf(const CoupledSystem& system) {
    const int split = 3 * system.vertexCount(), size = split + 6 * system.bodyCount();
    Dense result(size, size);
    CoupledVector u, q;
    q.resize(system.vertexCount(), system.bodyCount());
    for (int i = 0; i < size; ++i) {
        u.resize(system.vertexCount(), system.bodyCount());
        (i < split ? u.s.reshaped()(i) : u.w.reshaped()(i - split)) = 1.0;
        system.filter(u);
        system.apply(u, q);
        result.col(i) << q.s.reshaped(), q.w.reshaped();
    }
    return result;
}

TEST(CoupledSystemTest, OperatorIsSymmetricAndPositive) {
    Island island(16, {13, 8}, 2);
    makeBusy(island, 2.0);
    const Dense matrix = operatorOf(island.system);
    EXPECT_LT((matrix - matrix.transpose()).norm(), 1e-13 * matrix.norm());
    const DenseVector eigenvalues = Eigen::SelfAdjointEigenSolver<Dense>(matrix).eigenvalues();
    const auto held = DenseIsland(island.system).C.rows();
    EXPECT_LT(eigenvalues.head(held).cwiseAbs().maxCoeff(), 1e-11);  // the held directions, and nothing else
    EXPECT_GT(eigenvalues[held], 1e-2);
}

TEST(CoupledSystemTest, PreconditionerIsSymmetricAndPositive) {
    Island island(17, {13, 8}, 2);
    makeBusy(island, 2.0);
    const int split = 3 * 21, size = split + 12;
    for (const auto kind : kPreconditioners) {
        CoupledPreconditioner preconditioner;
        preconditioner.build(island.system, kind);
        Dense matrix(size, size);
        CoupledVector r, z;
        z.resize(21, 2);
        for (int i = 0; i < size; ++i) {
            r.resize(21, 2);
            (i < split ? r.s.reshaped()(i) : r.w.reshaped()(i - split)) = 1.0;
            island.system.filter(r);
            preconditioner.apply(island.system, r, z);
            matrix.col(i) << z.s.reshaped(), z.w.reshaped();
        }
        EXPECT_LT((matrix - matrix.transpose()).norm(), 1e-12 * matrix.norm());
        const DenseVector eigenvalues = Eigen::SelfAdjointEigenSolver<Dense>(matrix).eigenvalues();
        const auto held = DenseIsland(island.system).C.rows();
        EXPECT_GT(eigenvalues[held], 1e-6 * eigenvalues[size - 1]);
        EXPECT_GT(eigenvalues[0], -1e-12 * eigenvalues[size - 1]);
    }
}

TEST(CoupledSystemTest, ResidualChangesByTheOperator) {
    Island island(18, {13, 8}, 2);
    makeBusy(island, 2.0);
    const CoupledSystem& system = island.system;
    CoupledVector u, step, r0, r1, q;
    for (CoupledVector* vector : {&u, &r0, &r1, &q}) vector->resize(21, 2);
    step.s = randomPoints(island.random, 21);
    step.w = 0.5 * Eigen::Matrix<double, 6, Eigen::Dynamic>::Ones(6, 2);
    system.start(step.s, step.w, u);
    system.filter(step);
    Points unfiltered;
    system.residual(u, r0, unfiltered);
    u.addScaled(1.0, step);
    system.residual(u, r1, unfiltered);
    system.apply(step, q);
    r1.addScaled(1.0, q);
    r1.addScaled(-1.0, r0);
    EXPECT_LT(r1.dot(r1), 1e-24 * r0.dot(r0));
}

TEST(CoupledSystemTest, StartKeepsFreeVelocities) {
    Island island(19, {13, 8}, 2);
    makeBusy(island, 0.0);
    const Points v = randomPoints(island.random, 21);
    const Eigen::Matrix<double, 6, Eigen::Dynamic> w = Eigen::Matrix<double, 6, Eigen::Dynamic>::Random(6, 2);
    CoupledVector u;
    u.resize(21, 2);
    island.system.start(v, w, u);
    Points started;
    island.system.velocities(u, started);
    EXPECT_EQ(u.w, w);
    for (int i = 0; i < 21; ++i) {
        const VertexConstraint* c = island.system.constraintOf(i);
        const Mat3 free = c ? c->free : Mat3::Identity();
        EXPECT_LT((free * (started.col(i) - v.col(i))).norm(), 1e-13);
    }
}

TEST(CoupledSystemTest, ReactionsOnlyInHeldDirections) {
    Island island(20, {13, 8}, 2);
    makeBusy(island, 0.0);
    const Solved solved = solve(island.system, Preconditioner::IncompleteCholesky);
    for (int i = 0; i < 21; ++i) {
        const VertexConstraint* c = island.system.constraintOf(i);
        const Vec3 reaction = solved.unfiltered.col(i);
        EXPECT_LT(((c ? c->free : Mat3::Identity()) * reaction).norm(), 1e-9) << "vertex " << i;
        const bool isHeld = c && c->free.trace() < 2.5;
        EXPECT_EQ(reaction.norm() > 1e-6, isHeld) << "vertex " << i;
    }
}

TEST(CoupledSystemTest, BodiesGetWhatTheShellsLose) {
    Island island(21, {13, 8}, 2);
    makeBusy(island, 2.0);
    const CoupledSystem& system = island.system;
    const Solved solved = solve(system, Preconditioner::BlockJacobi);
    for (int b = 0; b < 2; ++b) {
        Vec6 impulse = Vec6::Zero();
        for (const auto& c : island.constraints)
            if (c.body == b) impulse += pointImpulse(solved.unfiltered.col(c.vertex), c.arm);
        for (const auto& row : island.rows)
            if (row.body == b) impulse -= pointImpulse(system.rowImpulse(row, solved.v, solved.u.w), row.arm);
        const Vec6 gained = system.mass()[b] * (solved.u.w.col(b) - system.freeTwist()[b]);
        EXPECT_LT((gained - impulse).norm(), 1e-9);
    }
}

TEST(CoupledSystemTest, NewContactsReplaceOldOnes) {
    Island island(22, {20}, 0);
    for (const int vertex : {0, 5, 6}) island.hold(vertex, 3, -1);
    island.addRow({3, 4, 5}, Vec3(0.2, 0.3, 0.5), -1);
    island.finish();
    island.constraints.clear();
    island.rows.clear();
    island.hold(7, 2, -1);
    island.finish();
    EXPECT_EQ(island.system.constraintOf(5), nullptr);
    expectDenseSolution(island.system);
}

/// Vertices, bodies and rows of every kind, with iterations in single precision: as exact as the tolerance asks, also
/// beyond what one row of iterations can reach.
TEST(FilteredPcgTest, SinglePrecisionEqualsDense) {
    for (const double drag : {0.0, 3.0}) {
        Island island(42, {13, 8, 40}, 2);
        makeBusy(island, drag);
        const DenseVector expected = DenseIsland(island.system).solve();
        const std::vector<CoupledSystem::ShellPart> parts(island.system.shells().begin(), island.system.shells().end());
        island.system.begin(parts, island.system.vertexCount(), island.system.mass(), island.system.freeTwist(), {},
                            Precision::Single);
        island.finish();
        for (const double tolerance : {1e-3, 1e-5, 1e-7}) {
            const Solved solved = solve(island.system, Preconditioner::IncompleteCholesky, tolerance);
            EXPECT_TRUE(solved.report.converged);
            EXPECT_LE(solved.report.residual, tolerance);
            EXPECT_LT(test::relativeError(solved.x(), expected), 10.0 * tolerance);
        }
    }
}

/// A preconditioner that has factored completely says so no more when the shell is solved in single precision.
TEST(FilteredPcgTest, CompleteFactorsAreGivenUpForSinglePrecision) {
    Island island(44, {40}, 0);
    std::vector<CoupledSystem::ShellPart> parts(island.system.shells().begin(), island.system.shells().end());
    CoupledPreconditioner preconditioner;
    for (const bool complete : {true, false}) {
        parts[0].isFactored = complete;
        island.system.begin(parts, 40, {}, {}, {}, complete ? Precision::Double : Precision::Single);
        island.finish();
        preconditioner.build(island.system, Preconditioner::IncompleteCholesky);
        EXPECT_EQ(preconditioner.isComplete(), complete);
    }
}

TEST(CoupledSystemTest, SingleOperatorEqualsDouble) {
    Island island(43, {13, 8}, 2);
    makeBusy(island, 2.0);
    const Dense expected = operatorOf(island.system);
    const std::vector<CoupledSystem::ShellPart> parts(island.system.shells().begin(), island.system.shells().end());
    island.system.begin(parts, 21, island.system.mass(), island.system.freeTwist(), {}, Precision::Single);
    island.finish();
    CoupledVector u;
    CompactVector x, y;
    for (CompactVector* vector : {&x, &y}) vector->resize(21, 2);
    for (int i = 0; i < expected.cols(); ++i) {
        u.resize(21, 2);
        (i < 63 ? u.s.reshaped()(i) : u.w.reshaped()(i - 63)) = 1.0;
        island.system.filter(u);
        island.system.round(u.s, u.w, x);
        const std::vector<float> before = x.s;
        island.system.apply(x, y);
        EXPECT_EQ(x.s, before);
        DenseVector column(expected.rows());
        for (int vertex = 0; vertex < 21; ++vertex)
            for (int c = 0; c < 3; ++c) column[3 * vertex + c] = y.s[4 * island.system.compactPlaces()[vertex] + c];
        column.tail(12) = y.w.reshaped();
        EXPECT_LT((column - expected.col(i)).norm(), 1e-5 * expected.norm()) << "column " << i;
    }
}

TEST(FilteredPcgTest, PreconditionersAgree) {
    Island island(23, {40, 30}, 2);
    makeBusy(island, 1.0);
    const Solved jacobi = solve(island.system, Preconditioner::BlockJacobi);
    const Solved cholesky = solve(island.system, Preconditioner::IncompleteCholesky);
    EXPECT_LT(test::relativeError(jacobi.x(), cholesky.x()), 1e-9);
}

TEST(FilteredPcgTest, SaysWhenItsBudgetIsSpent) {
    Island island(24, {40}, 0);
    for (const int vertex : {0, 9}) island.hold(vertex, 2, -1);
    island.finish();
    for (const auto kind : kPreconditioners) {
        const Solved solved = solve(island.system, kind, 1e-10, 1);
        EXPECT_FALSE(solved.report.converged);
        EXPECT_EQ(solved.report.iterations, 1);
        EXPECT_GT(solved.report.residual, 1e-10);
    }
}

TEST(FilteredPcgTest, AnExactStartNeedsNoIteration) {
    Island island(25, {20}, 1);
    for (const int vertex : {0, 9}) island.hold(vertex, 2, 0);
    island.finish();
    Solved solved = solve(island.system, Preconditioner::IncompleteCholesky, 1e-12);
    CoupledPreconditioner preconditioner;
    preconditioner.build(island.system, Preconditioner::IncompleteCholesky);
    FilteredPcg pcg;
    const PcgReport again = pcg.solve(island.system, preconditioner, 1.0, 1e-3, 100, solved.u);
    EXPECT_TRUE(again.converged);
    EXPECT_EQ(again.iterations, 0);
}

TEST(FilteredPcgTest, NonFiniteInputEndsUnconverged) {
    Island island(26, {20}, 0);
    island.rhs[0](1, 3) = std::numeric_limits<double>::quiet_NaN();
    island.finish();
    const Solved solved = solve(island.system, Preconditioner::BlockJacobi);
    EXPECT_FALSE(solved.report.converged);
    EXPECT_LT(solved.report.iterations, 3);
}

}  // namespace
}  // namespace jacket
