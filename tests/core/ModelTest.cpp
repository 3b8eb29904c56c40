#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "../support/Differences.h"
#include "jacket/Models.h"

namespace jacket::test {
namespace {

/// Numbers near one, so that the tolerances below mean the same for every model.
ShellMaterial exampleMaterial() {
    ShellMaterial material;
    material.young = 1000.0;
    material.poisson = 0.3;
    material.thickness = 0.01;
    material.bendingStiffnessOverride = 2.5;
    return material;
}

/// Parametrised models to test, the default one first. A model with options worth a test of their own specialises this.
template <class Model>
std::vector<Model> examples() {
    return {Model{}.fittedTo(exampleMaterial())};
}
ShellMaterial exampleWeave() {
    ShellMaterial material = exampleMaterial();
    material.orthotropy = {.weftYoung = 400.0, .shear = 60.0, .warpDirection = Vec3(0.3, -1.0, 2.0)};
    return material;
}
template <>
std::vector<StVenantKirchhoffMembrane> examples() {
    return {StVenantKirchhoffMembrane{}.fittedTo(exampleMaterial()),
            StVenantKirchhoffMembrane{}.fittedTo(exampleWeave()),  // and stiff in shear, where what warp and weft add
            StVenantKirchhoffMembrane{.shearStiffness = 20.0}.fittedTo(exampleWeave())};  // to the rest is negative
}
template <>
std::vector<BaraffWitkinMembrane> examples() {
    std::vector<BaraffWitkinMembrane> models(4);
    models[1].conditionDamping = 0.7;
    models[2] = {.stretchU = 12.0, .stretchV = 7.0, .shear = 3.0, .bU = 1.1, .bV = 0.8, .warp = Vec3(0.3, -1.0, 2.0)};
    models[3].areaSquared = true;
    models[3].conditionDamping = 0.3;
    for (auto& model : models) model = model.fittedTo(exampleMaterial());
    models.push_back(BaraffWitkinMembrane{}.fittedTo(exampleWeave()));
    return models;
}
template <>
std::vector<SpringMembrane> examples() {
    return {SpringMembrane{}.fittedTo(exampleMaterial()),
            SpringMembrane{.stretchStiffness = 4.0, .compression = true}.fittedTo(exampleMaterial())};
}

/// Bounds of the relative errors against central differences; a model that approximates says how well.
template <class Model>
constexpr double kGradientBound = std::is_same_v<Model, DihedralDifferenceBending> ? 1e-7 : 1e-8;
template <class Model>
constexpr double kHessianBound = std::is_same_v<Model, DihedralDifferenceBending> ? 1e-5 : 1e-7;

/// Rest shapes that the model leaves in peace: the quadratic one is for flat sheets.
template <class Model>
constexpr double kMaxFold = std::is_same_v<Model, QuadraticBending> ? 0.0 : 2.2;

/// Calls check(model, rest, X, x) for every example and random case.
template <class Model, class Check>
void forCases(const Check& check, double maxFold = 2.2) {
    constexpr int N = Model::kVertices;
    for (const Model& model : examples<Model>())
        for (const auto& [X, x] : randomCases<N>(50, /*seed=*/7, maxFold))
            check(model, model.rest(X, siteArea<N>(X)), X, x);
}

template <class Model, class Rest, int N>
StencilEval<N> exact(const Model& model, const Rest& rest, const Eigen::Matrix<double, 3, N>& x) {
    return model.evaluate(x, rest, HessianKind::Exact);
}

template <class Model>
class StencilModelTest : public testing::Test {};
/// Of all models those with a fixed stencil: PatchBending has a test of its own.
template <class List, class... Models>
struct Filtered {
    using Types = List;
};
template <class... Kept, class Model, class... Models>
struct Filtered<testing::Types<Kept...>, Model, Models...> {
    using Types = typename Filtered<
        std::conditional_t<StencilModel<Model>, testing::Types<Kept..., Model>, testing::Types<Kept...>>,
        Models...>::Types;
};
template <class, class>
struct Joined;
template <class... A, class... B>
struct Joined<std::variant<A...>, std::variant<B...>> {
    using Types = typename Filtered<testing::Types<>, A..., B...>::Types;
};
using AllModels = Joined<MembraneModel, BendingModel>::Types;  // registering a model is what tests it
TYPED_TEST_SUITE(StencilModelTest, AllModels);

TYPED_TEST(StencilModelTest, GradientIsTheDerivativeOfTheEnergy) {
    double worst = 0.0;
    forCases<TypeParam>([&](const auto& model, const auto& rest, const auto&, const auto& x) {
        const auto energy = [&](const auto& y) { return exact(model, rest, y).energy; };
        worst = std::max(worst, relativeError(exact(model, rest, x).gradient, centralDifference(energy, x, 3e-6)));
    });
    EXPECT_LT(worst, kGradientBound<TypeParam>);
    this->RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

TYPED_TEST(StencilModelTest, ExactHessianIsTheDerivativeOfTheGradient) {
    double worst = 0.0;
    forCases<TypeParam>([&](const auto& model, const auto& rest, const auto&, const auto& x) {
        const auto gradient = [&](const auto& y) { return exact(model, rest, y).gradient; };
        worst = std::max(worst, relativeError(exact(model, rest, x).hessian, centralJacobian(gradient, x, 1e-5)));
    });
    EXPECT_LT(worst, kHessianBound<TypeParam>);
    this->RecordProperty("worst", std::to_string(worst * 1e12) + "e-12");
}

TYPED_TEST(StencilModelTest, BothKindsOfEvaluationAgreeOnEnergyAndGradient) {
    forCases<TypeParam>([](const auto& model, const auto& rest, const auto&, const auto& x) {
        const auto a = exact(model, rest, x), b = model.evaluate(x, rest, HessianKind::Positive);
        EXPECT_EQ(a.energy, b.energy);
        EXPECT_EQ(a.gradient, b.gradient);
    });
}

TYPED_TEST(StencilModelTest, EnergyAloneIsThatOfTheEvaluation) {
    forCases<TypeParam>([](const auto& model, const auto& rest, const auto&, const auto& x) {
        if constexpr (requires { model.energy(x, rest); }) {
            const double expected = exact(model, rest, x).energy;
            EXPECT_NEAR(model.energy(x, rest), expected, 1e-12 * expected + 1e-300);
        }
    });
}

TYPED_TEST(StencilModelTest, PositiveHessianIsSymmetricAndPositiveSemiDefinite) {
    forCases<TypeParam>([](const auto& model, const auto& rest, const auto&, const auto& x) {
        const auto H = model.evaluate(x, rest, HessianKind::Positive).hessian;
        EXPECT_LE((H - H.transpose()).norm(), 1e-13 * H.norm());
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(H, Eigen::EigenvaluesOnly);
        EXPECT_GE(eigen.eigenvalues().minCoeff(), -1e-13 * H.norm());
    });
}

TYPED_TEST(StencilModelTest, HessiansGiveNoForceToATranslation) {
    forCases<TypeParam>([](const auto& model, const auto& rest, const auto&, const auto& x) {
        for (const auto kind : {HessianKind::Exact, HessianKind::Positive}) {
            const auto H = model.evaluate(x, rest, kind).hessian;
            for (int axis = 0; axis < 3; ++axis) {
                Stencil<TypeParam::kVertices> shift = Stencil<TypeParam::kVertices>::Zero();
                shift.row(axis).setOnes();
                const bool differenced = std::is_same_v<TypeParam, DihedralDifferenceBending>;
                EXPECT_LE((H * shift.reshaped()).norm(), (differenced ? 1e-6 : 1e-12) * H.norm());
            }
        }
    });
}

TYPED_TEST(StencilModelTest, RestShapeStoresNothingWhereverItIsMoved) {
    std::mt19937 random(11);
    for (const auto& model : examples<TypeParam>()) {
        if constexpr (requires { model.bU; })
            if (model.bU != 1.0) continue;  // its rest size is another one than its rest shape's, on purpose
        for (const auto& [X, x] : randomCases<TypeParam::kVertices>(50, /*seed=*/7, kMaxFold<TypeParam>)) {
            const auto rest = model.rest(X, siteArea<TypeParam::kVertices>(X));
            const Mat3 rotation = randomRotation(random);
            const Vec3 translation = randomVector(random, 10.0);
            const Stencil<TypeParam::kVertices> moved = (rotation * X).colwise() + translation;
            const auto eval = exact(model, rest, moved);
            EXPECT_NEAR(eval.energy, 0.0, 1e-13 * exact(model, rest, x).hessian.norm() + 1e-25);
            EXPECT_LT(eval.gradient.norm(), 1e-13 * eval.hessian.norm() + 1e-13);
        }
    }
}

TYPED_TEST(StencilModelTest, RigidMotionKeepsTheEnergyAndTurnsTheGradient) {
    std::mt19937 random(12);
    forCases<TypeParam>([&](const auto& model, const auto& rest, const auto&, const auto& x) {
        const Mat3 rotation = randomRotation(random);
        const Vec3 translation = randomVector(random, 3.0);
        const Stencil<TypeParam::kVertices> moved = (rotation * x).colwise() + translation;
        const auto a = exact(model, rest, x), b = exact(model, rest, moved);
        EXPECT_NEAR(a.energy, b.energy, 1e-11 * (1.0 + a.energy));
        const bool differenced = std::is_same_v<TypeParam, DihedralDifferenceBending>;
        EXPECT_LE((rotation * a.gradient - b.gradient).norm(),
                  (differenced ? 1e-8 : 1e-11) * (1.0 + a.gradient.norm()));
    });
}

TYPED_TEST(StencilModelTest, ForcesSumToZeroAndTurnNothing) {
    forCases<TypeParam>([](const auto& model, const auto& rest, const auto&, const auto& x) {
        const auto gradient = exact(model, rest, x).gradient;
        Vec3 torque = Vec3::Zero();
        for (int i = 0; i < gradient.cols(); ++i) torque += Vec3(x.col(i)).cross(Vec3(gradient.col(i)));
        const bool differenced = std::is_same_v<TypeParam, DihedralDifferenceBending>;
        const double bound = (differenced ? 1e-8 : 1e-12) * (1.0 + gradient.norm());
        EXPECT_LT(gradient.rowwise().sum().norm(), bound);
        EXPECT_LT(torque.norm(), bound);
    });
}

TYPED_TEST(StencilModelTest, AtRestThePositiveHessianIsTheExactOne) {
    for (const auto& model : examples<TypeParam>()) {
        if constexpr (requires { model.bU; })
            if (model.bU != 1.0) continue;
        // flat, for the cubic and the quadratic model: their constant parts are all there is only then
        const bool flat = std::is_same_v<TypeParam, QuadraticBending> || std::is_same_v<TypeParam, CubicShellBending>;
        for (const auto& [X, x] : randomCases<TypeParam::kVertices>(20, /*seed=*/3, flat ? 0.0 : 2.2)) {
            const auto rest = model.rest(X, siteArea<TypeParam::kVertices>(X));
            EXPECT_LT(
                relativeError(exact(model, rest, X).hessian, model.evaluate(X, rest, HessianKind::Positive).hessian),
                1e-9);
        }
    }
}

TYPED_TEST(StencilModelTest, AtRestARigidRotationMeetsNoForce) {  // else an implicit step would stop a shell's spinning
    constexpr int N = TypeParam::kVertices;
    for (const auto& model : examples<TypeParam>()) {
        if constexpr (requires { model.bU; })
            if (model.bU != 1.0) continue;
        for (const auto& [X, x] : randomCases<N>(20, /*seed=*/3, kMaxFold<TypeParam>)) {
            const auto rest = model.rest(X, siteArea<N>(X));
            Stencil<N> spin;
            for (int i = 0; i < N; ++i) spin.col(i) = Vec3(-2.0, 1.0, 0.5).cross(Vec3(X.col(i)));
            const bool differenced = std::is_same_v<TypeParam, DihedralDifferenceBending>;
            for (const auto kind : {HessianKind::Exact, HessianKind::Positive}) {
                const auto H = model.evaluate(X, rest, kind).hessian;
                EXPECT_LE((H * spin.reshaped()).norm(), (differenced ? 1e-8 : 1e-12) * H.norm());
            }
        }
    }
}

TYPED_TEST(StencilModelTest, CollapsedAndInvertedShapesStayFinite) {
    constexpr int N = TypeParam::kVertices;
    std::mt19937 random(5);
    const auto checkFinite = [](const auto& model, const auto& rest, const Stencil<N>& x) {
        for (const auto kind : {HessianKind::Exact, HessianKind::Positive}) {
            const auto eval = model.evaluate(x, rest, kind);
            EXPECT_TRUE(std::isfinite(eval.energy));
            EXPECT_TRUE(eval.gradient.allFinite());
            EXPECT_TRUE(eval.hessian.allFinite());
        }
    };
    forCases<TypeParam>([&](const auto& model, const auto& rest, const Stencil<N>& X, const Stencil<N>& x) {
        checkFinite(model, rest, Stencil<N>::Zero());                          // a point
        checkFinite(model, rest, Stencil<N>(Vec3(0.6, 0.0, 0.8) * x.row(0)));  // a line
        checkFinite(model, rest, Stencil<N>(-X));                              // inside out
        Stencil<N> y = x;
        y.col(1) = y.col(0);  // an edge of no length
        checkFinite(model, rest, y);
        y.col(1) += randomVector(random, 1e-12);  // hardly one
        checkFinite(model, rest, y);
        y = x;
        y.col(N - 1) = 0.5 * (y.col(0) + y.col(1)) + randomVector(random, 1e-13);  // a triangle of no area
        checkFinite(model, rest, y);
        checkFinite(model, rest, Stencil<N>(1e6 * x));
    });
}

TYPED_TEST(StencilModelTest, DegenerateRestShapesAreRefused) {
    constexpr int N = TypeParam::kVertices;
    const auto model = examples<TypeParam>().front();
    EXPECT_THROW(model.rest(Stencil<N>::Zero(), 1.0), std::invalid_argument);
    Stencil<N> X = randomCases<N>(1, 1).front().X;
    X.col(1) = X.col(0);
    EXPECT_THROW(model.rest(X, 1.0), std::invalid_argument);
    X.setConstant(std::numeric_limits<double>::quiet_NaN());
    EXPECT_THROW(model.rest(X, 1.0), std::invalid_argument);
}

TYPED_TEST(StencilModelTest, DampingIsSymmetricPositiveAndIgnoresRigidMotions) {
    if constexpr (DampedStencilModel<TypeParam>) {
        constexpr int N = TypeParam::kVertices;
        forCases<TypeParam>([](const auto& model, const auto& rest, const auto&, const Stencil<N>& x) {
            const auto C = model.damping(x, rest);
            EXPECT_EQ(model.isDamped(), C.norm() > 0.0);
            EXPECT_LE((C - C.transpose()).norm(), 1e-13 * C.norm());
            const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(C, Eigen::EigenvaluesOnly);
            EXPECT_GE(eigen.eigenvalues().minCoeff(), -1e-13 * C.norm());
            Stencil<N> twist;
            for (int i = 0; i < N; ++i) twist.col(i) = Vec3(1.0, 2.0, 3.0) + Vec3(-2.0, 1.0, 0.5).cross(Vec3(x.col(i)));
            EXPECT_LE((C * twist.reshaped()).norm(), 1e-12 * C.norm());
        });
    } else {
        GTEST_SKIP() << "no damping of its own";
    }
}

TEST(BaraffWitkinMembraneTest, DampingIsTheSumOverTheConditionsGradients) {
    for (const auto& damped : examples<BaraffWitkinMembrane>()) {
        if (!damped.isDamped()) continue;
        for (const auto& [X, x] : randomCases<3>(20, /*seed=*/21)) {
            const auto rest = damped.rest(X, siteArea<3>(X));
            // one condition at a time: with its stiffness 1 and the others' 0, the energy is C^2/2 and |C| is its root
            Eigen::Matrix<double, 9, 9> sum = Eigen::Matrix<double, 9, 9>::Zero();
            for (int i = 0; i < 3; ++i) {
                BaraffWitkinMembrane one = damped;
                one.stretchU = i == 0 ? 1.0 : 0.0;
                one.stretchV = i == 1 ? 1.0 : 0.0;
                one.shear = i == 2 ? 1.0 : 0.0;
                const auto condition = [&](const auto& y) {
                    return std::sqrt(2.0 * one.evaluate(y, rest, HessianKind::Exact).energy);
                };
                const Stencil<3> slope = centralDifference(condition, x, 1e-6);
                sum += damped.conditionDamping * slope.reshaped() * slope.reshaped().transpose();
            }
            EXPECT_LT(relativeError(damped.damping(x, rest), sum), 1e-7);
        }
    }
}

TEST(BaraffWitkinMembraneTest, AreaSquaredMultipliesByTheArea) {
    const auto models = examples<BaraffWitkinMembrane>();
    for (const auto& [X, x] : randomCases<3>(5, /*seed=*/22)) {
        const double area = siteArea<3>(X);
        const double plain = models[0].evaluate(x, models[0].rest(X, area), HessianKind::Exact).energy;
        const double squared = models[3].evaluate(x, models[3].rest(X, area), HessianKind::Exact).energy;
        EXPECT_NEAR(squared, area * plain, 1e-12 * squared);
    }
}

TEST(SpringMembraneTest, OneSidedSpringsDoNotPush) {
    const auto model = SpringMembrane{.stretchStiffness = 3.0}.fittedTo(exampleMaterial());
    Stencil<2> X = Stencil<2>::Zero(), x = X;
    X(0, 1) = 2.0;
    const auto rest = model.rest(X, 0.5);
    EXPECT_DOUBLE_EQ(rest.stiffness, 3.0 * 0.5 / 4.0);
    x(0, 1) = 1.9;
    EXPECT_EQ(model.evaluate(x, rest, HessianKind::Exact).energy, 0.0);
    EXPECT_TRUE(model.evaluate(x, rest, HessianKind::Exact).gradient.isZero(0.0));
    x(0, 1) = 2.1;
    EXPECT_NEAR(model.evaluate(x, rest, HessianKind::Exact).gradient(0, 1), 0.375 * 0.1, 1e-14);
}

TEST(DihedralBendingTest, AngleIsPositiveWhereTheSurfaceBendsAwayFromItsNormals) {
    Stencil<4> x;
    x.col(0) = Vec3(0, 0, 0);
    x.col(1) = Vec3(1, 0, 0);
    x.col(2) = Vec3(0.5, 1, 0);
    for (const double angle : {-3.0, -1.0, 0.0, 0.5, 1.6, 3.1}) {
        x.col(3) = Vec3(0.4, -std::cos(angle), -std::sin(angle));  // the normal of (x0 x1 x2) is +z
        EXPECT_NEAR(DihedralBending::angle(x), angle, 1e-14);
    }
}

TEST(DihedralBendingTest, EnergyIsContinuousThroughHalfATurn) {
    const auto model = DihedralBending{2.0};
    const auto hinge = [](double angle) {
        Stencil<4> x;
        x << 0, 1, 0.5, 0.5, 0, 0, 1, -std::cos(angle), 0, 0, 0, -std::sin(angle);
        return x;
    };
    const auto rest = model.rest(hinge(2.0), 1.0);  // D l^2 / area = 2
    for (const double angle : {3.1, 3.2, 4.0})      // beyond pi, as the fold goes on
        EXPECT_NEAR(model.evaluate(hinge(angle), rest, HessianKind::Positive).energy, (angle - 2.0) * (angle - 2.0),
                    1e-12);
}

/// A hinge of edge length 1 with the given fold; triangles keep their shapes.
Stencil<4> hingeOf(double angle) {
    Stencil<4> x;
    x << 0, 1, 0.3, 0.6, 0, 0, 0.8, -1.1 * std::cos(angle), 0, 0, 0, -1.1 * std::sin(angle);
    return x;
}

TEST(BendingModelsTest, UnstretchedHingesStoreWhatTheAngleSays) {
    const double D = 1.7, area = siteArea<4>(hingeOf(0.0)), weight = D / area;
    const QuadraticBending quadratic{D};
    const auto flat = quadratic.rest(hingeOf(0.0), area);
    for (const double angle : {-2.0, -0.4, 0.1, 1.0, 3.0})
        EXPECT_NEAR(quadratic.evaluate(hingeOf(angle), flat, HessianKind::Exact).energy, weight * (1 - std::cos(angle)),
                    1e-13);
    const CubicShellBending cubic{D};
    for (const double restAngle : {-1.5, -0.5, 0.0, 0.3, 1.2}) {
        const auto rest = cubic.rest(hingeOf(restAngle), area);
        for (const double angle : {-2.0, -0.4, 0.1, 1.0, 3.0})
            EXPECT_NEAR(cubic.evaluate(hingeOf(angle), rest, HessianKind::Exact).energy,
                        weight * (1 - std::cos(angle - restAngle)), 1e-13);
    }
}

TEST(BendingModelsTest, CubicAgreesWithDihedralToSecondOrderAboutACurvedRestShape) {
    const double D = 1.7, area = siteArea<4>(hingeOf(0.0));
    for (const double restAngle : {-1.0, -0.2, 0.4, 1.3}) {
        const DihedralBending dihedral{D};
        const CubicShellBending cubic{D};
        const Stencil<4> X = hingeOf(restAngle);
        const auto restD = dihedral.rest(X, area);
        const auto restC = cubic.rest(X, area);
        // along the bending that stretches no edge
        const Eigen::Matrix<double, 12, 1> bending =
            (hingeOf(restAngle + 1e-5) - hingeOf(restAngle - 1e-5)).reshaped() / 2e-5;
        const double stiffness = bending.dot(dihedral.evaluate(X, restD, HessianKind::Exact).hessian * bending);
        EXPECT_NEAR(bending.dot(cubic.evaluate(X, restC, HessianKind::Exact).hessian * bending), stiffness, 1e-8);
        EXPECT_NEAR(bending.dot(cubic.evaluate(X, restC, HessianKind::Positive).hessian * bending), stiffness, 1e-8);
    }
}

TEST(ModelParametersTest, UnsetOnesComeFromTheMaterialAndSetOnesStay) {
    ShellMaterial material;
    material.young = 2e9;
    material.poisson = 0.25;
    material.thickness = 1e-3;
    EXPECT_DOUBLE_EQ(*StVenantKirchhoffMembrane{}.fittedTo(material).stretchStiffness, 2e6);
    EXPECT_DOUBLE_EQ(*StVenantKirchhoffMembrane{}.fittedTo(material).poisson, 0.25);
    EXPECT_DOUBLE_EQ(*BaraffWitkinMembrane{}.fittedTo(material).stretchU, 2e6);
    EXPECT_DOUBLE_EQ(*BaraffWitkinMembrane{}.fittedTo(material).shear, 2e6 / 2.5);
    EXPECT_DOUBLE_EQ(*SpringMembrane{}.fittedTo(material).stretchStiffness, 2e6);
    EXPECT_DOUBLE_EQ(*DihedralBending{}.fittedTo(material).stiffness, material.bendingStiffness());
    EXPECT_DOUBLE_EQ(*DihedralBending{0.5}.fittedTo(material).stiffness, 0.5);
    EXPECT_DOUBLE_EQ(*BaraffWitkinMembrane{.shear = 30.0}.fittedTo(material).shear, 30.0);
    EXPECT_THROW(DihedralBending{-1.0}.fittedTo(material), std::invalid_argument);
    EXPECT_THROW((StVenantKirchhoffMembrane{.poisson = 0.7}.fittedTo(material)), std::invalid_argument);
    EXPECT_THROW(BaraffWitkinMembrane{.bU = 0.0}.fittedTo(material), std::invalid_argument);
}

TEST(ModelParametersTest, AnOrthotropicMaterialsComeByDirection) {
    const ShellMaterial weave = exampleWeave();
    const auto stvk = StVenantKirchhoffMembrane{}.fittedTo(weave);
    EXPECT_DOUBLE_EQ(*stvk.stretchStiffness, 10.0);
    EXPECT_DOUBLE_EQ(*stvk.weftStiffness, 4.0);
    EXPECT_DOUBLE_EQ(*stvk.shearStiffness, 0.6);
    EXPECT_EQ(*stvk.warp, Vec3(0.3, -1.0, 2.0));
    EXPECT_DOUBLE_EQ(*StVenantKirchhoffMembrane{.weftStiffness = 7.0}.fittedTo(weave).weftStiffness, 7.0);
    const auto cloth = BaraffWitkinMembrane{}.fittedTo(weave);
    EXPECT_DOUBLE_EQ(*cloth.stretchU, 10.0);
    EXPECT_DOUBLE_EQ(*cloth.stretchV, 4.0);
    EXPECT_DOUBLE_EQ(*cloth.shear, 0.6);
    EXPECT_EQ(*cloth.warp, Vec3(0.3, -1.0, 2.0));
    EXPECT_EQ(*BaraffWitkinMembrane{.warp = Vec3::UnitY()}.fittedTo(weave).warp, Vec3::UnitY());
    EXPECT_THROW(SpringMembrane{}.fittedTo(weave), std::invalid_argument);
    // 0.3^2 x 120 > 10: warp and weft together could release energy
    EXPECT_THROW(StVenantKirchhoffMembrane{.weftStiffness = 120.0}.fittedTo(weave), std::invalid_argument);
    EXPECT_THROW((StVenantKirchhoffMembrane{.weftStiffness = 1.0, .warp = Vec3(0, 0, 0)}.fittedTo(exampleMaterial())),
                 std::invalid_argument);
}

TEST(ModelParametersTest, AWarpNormalToATriangleIsRefused) {
    ShellMaterial weave = exampleWeave();
    weave.orthotropy->warpDirection = Vec3(0, 0, 2);
    Stencil<3> X;
    X << 0, 1, 0, 0, 0, 1, 5, 5, 5;  // in the plane z = 5
    const auto complaint = [&](const auto& model) -> std::string {
        try {
            model.fittedTo(weave).rest(X, 0.5);
        } catch (const std::invalid_argument& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_EQ(complaint(StVenantKirchhoffMembrane{}),
              "StVenantKirchhoffMembrane: warp direction (0 0 2) is normal to a rest triangle, at (0 0 5)");
    EXPECT_EQ(complaint(BaraffWitkinMembrane{}),
              "BaraffWitkinMembrane: warp direction (0 0 2) is normal to a rest triangle, at (0 0 5)");
    weave.orthotropy.reset();  // nobody said where the warp is: any direction will do
    EXPECT_EQ(complaint(BaraffWitkinMembrane{}), "");
    Stencil<3> facingX = X;
    facingX.row(0) = X.row(2);
    facingX.row(2) = X.row(0);
    EXPECT_NO_THROW(BaraffWitkinMembrane{}.fittedTo(weave).rest(facingX, 0.5));
}

}  // namespace
}  // namespace jacket::test
