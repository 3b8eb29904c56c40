#pragma once
#include "jacket/Shell.h"

namespace jacket {

struct StaticSettings {
    int increments = 1;       ///< steps in which gravity, forces and pressure grow to their full size, >= 1
    int maxIterations = 100;  ///< Newton steps of one increment, >= 1
    double tolerance = 1e-8;  ///< unbalanced force left, relative to the largest force of the shell, > 0
};

struct StaticReport {
    bool converged = true;
    int iterations = 0;      ///< Newton steps of all increments
    int increments = 0;      ///< done, repeated and halved ones included
    double residual = 0.0;   ///< largest unbalanced force on a free vertex [N]
    int negativePivots = 0;  ///< of the exact Hessian at the end: > 0 where the equilibrium is not stable
};

/// Moves a shell to where it hangs in balance under gravity, its forces and pressure, held where it is pinned, guided
/// or clamped: Newton's method with the exact Hessian (its positive part where that is not positive definite) and a
/// line search on the energy; the load grows in increments, halved where one does not converge. Velocities become zero.
/// Not converged: the shell stands at the last balanced increment. Throws std::invalid_argument on unusable settings,
/// std::runtime_error when the held vertices leave the shell free to move as a whole.
StaticReport settle(Shell& shell, const Vec3& gravity, const StaticSettings& settings = {});

/// Number of negative pivots of the exact Hessian at the shell's present state: of its unstable directions.
int unstableDirections(Shell& shell);

/// The lowest `count` natural frequencies of small free motions about the shell's present state [rad/s], ascending. A
/// shell that is not held has its zero ones among them. Masses are lumped.
std::vector<double> naturalFrequencies(Shell& shell, int count);

}  // namespace jacket
