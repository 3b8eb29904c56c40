#pragma once
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "jacket/models/StencilModel.h"

/// Central differences and random stencils: what the tests of models share.
namespace jacket::test {

/// Gradient of a scalar function of a stencil, O(h^2).
template <class Function, int N>
Stencil<N> centralDifference(const Function& f, const Eigen::Matrix<double, 3, N>& x, double h) {
    Stencil<N> gradient;
    for (int i = 0; i < 3 * N; ++i) {
        Stencil<N> plus = x, minus = x;
        plus.reshaped()(i) += h;
        minus.reshaped()(i) -= h;
        gradient.reshaped()(i) = (f(plus) - f(minus)) / (2.0 * h);
    }
    return gradient;
}

/// Derivative of a stencil-valued function (a gradient): column i is its derivative by coordinate i.
template <class Function, int N>
Eigen::Matrix<double, 3 * N, 3 * N> centralJacobian(const Function& f, const Eigen::Matrix<double, 3, N>& x, double h) {
    Eigen::Matrix<double, 3 * N, 3 * N> jacobian;
    for (int i = 0; i < 3 * N; ++i) {
        Stencil<N> plus = x, minus = x;
        plus.reshaped()(i) += h;
        minus.reshaped()(i) -= h;
        const Stencil<N> difference = f(plus) - f(minus);
        jacobian.col(i) = difference.reshaped() / (2.0 * h);
    }
    return jacobian;
}

/// |a - b| over the larger of their norms; 0 when both vanish.
template <class A, class B>
double relativeError(const Eigen::MatrixBase<A>& a, const Eigen::MatrixBase<B>& b) {
    const double scale = std::max(a.norm(), b.norm());
    return scale > 0.0 ? (a - b).norm() / scale : 0.0;
}

/// Uniformly distributed rotation.
inline Mat3 randomRotation(std::mt19937& random) {
    std::normal_distribution<double> normal;
    Vec4 q(normal(random), normal(random), normal(random), normal(random));
    q.normalize();
    const double w = q(0);
    const Vec3 v = q.tail<3>();
    return (w * w - v.squaredNorm()) * Mat3::Identity() + 2.0 * v * v.transpose() + 2.0 * w * skew(v);
}

inline Vec3 randomVector(std::mt19937& random, double size) {
    std::uniform_real_distribution<double> uniform(-size, size);
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    return {x, y, z};
}

/// Rest area of the triangles at a stencil's site; an edge gets one square metre.
template <int N>
double siteArea(const Stencil<N>& X) {
    const auto twiceArea = [&](int a, int b, int c) { return (X.col(b) - X.col(a)).cross(X.col(c) - X.col(a)).norm(); };
    if constexpr (N == 3) return 0.5 * twiceArea(0, 1, 2);
    if constexpr (N == 4) return 0.5 * (twiceArea(0, 1, 2) + twiceArea(1, 0, 3));
    return 1.0;
}

/// Smallest height of a stencil's triangles over its longest edge; an edge's length.
template <int N>
double roundness(const Stencil<N>& x) {
    const auto shape = [&](int a, int b, int c) {
        const Vec3 ab = x.col(b) - x.col(a), bc = x.col(c) - x.col(b), ca = x.col(a) - x.col(c);
        return ab.cross(ca).norm() / std::max({ab.squaredNorm(), bc.squaredNorm(), ca.squaredNorm()});
    };
    if constexpr (N == 3) return shape(0, 1, 2);
    if constexpr (N == 4) return std::min(shape(0, 1, 2), shape(1, 0, 3));
    return (x.col(1) - x.col(0)).norm();
}

/// Rest shape and deformed shape of one stencil.
template <int N>
struct StencilCase {
    Stencil<N> X;  ///< [m], edges of 0.3 .. 1.7
    Stencil<N> x;  ///< X with every vertex moved by up to 0.25 in each direction, rotated and translated
};

/// The same cases for the same seed. No triangle is a sliver, neither at rest nor deformed. Hinges are folded by up to
/// `maxFold` [rad] at rest, either way.
template <int N>
std::vector<StencilCase<N>> randomCases(int count, unsigned seed, double maxFold = 2.2) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    std::vector<StencilCase<N>> cases;
    while (static_cast<int>(cases.size()) < count) {
        Stencil<N> X = Stencil<N>::Zero();
        X.col(1).x() = 1.0 + 0.3 * uniform(random);
        if constexpr (N > 2) X.col(2) = Vec3(0.5 + 0.5 * uniform(random), 0.9 + 0.3 * uniform(random), 0.0);
        if constexpr (N > 3) {
            const double fold = maxFold * uniform(random), height = 0.9 + 0.3 * uniform(random);
            X.col(3) = Vec3(0.5 + 0.5 * uniform(random), -height * std::cos(fold), -height * std::sin(fold));
        }
        const Mat3 placing = randomRotation(random), moving = randomRotation(random);
        const Vec3 placed = randomVector(random, 1.0), moved = randomVector(random, 1.0);
        X = (placing * X).colwise() + placed;
        Stencil<N> x = X;
        for (int i = 0; i < N; ++i) x.col(i) += randomVector(random, 0.25);
        x = (moving * x).colwise() + moved;
        if (roundness<N>(X) > 0.3 && roundness<N>(x) > 0.3) cases.push_back({X, x});
    }
    return cases;
}

}  // namespace jacket::test
