#pragma once
#include <functional>
#include <string>
#include <vector>

#include "Machine.h"
#include "Pareto.h"
#include "accuracy/Motion.h"
#include "accuracy/Problem.h"

/// What `jacket report` measures. No formatting: see Tables.h and Page.h.
namespace jacket::demo::report {

inline constexpr double kAcceptedErrors[] = {0.10, 0.03, 0.01, 0.003};

/// Choices for many problems at once bear these names.
inline constexpr const char* kEveryProblem = "every problem";
inline constexpr const char* kEveryFlatProblem = "every problem of a flat sheet";

struct StaticRow {
    const accuracy::Problem* problem = nullptr;
    accuracy::Case how;
    int level = 0;  ///< which of the problem's resolutions
    accuracy::Measurement got;

    double target() const { return problem->targets[level]; }
    double absoluteError() const;  ///< infinite when the solve did not converge
};

struct MotionRow {
    const accuracy::MotionProblem* problem = nullptr;
    accuracy::MotionCase how;
    accuracy::MotionResult got;
};

struct IntegratorRow {
    Integrator integrator;
    int stepsPerPeriod;
    accuracy::Vibration measured, theory;
};

struct MomentumRow {
    Integrator integrator;
    bool withBall;
    double dt;
    accuracy::MomentumDrift drift;
};

/// The cheapest way to a result within an error that is accepted.
struct Choice {
    std::string problem;
    double accepted = 0.0;
    bool isReached = false;
    double error = 0.0, cost = 0.0;  ///< reliable error of that way; when none is reached, of the most exact one
    StaticRow statics;               ///< that way, of a settled shape; of many problems, one of the rows
    MotionRow motion;                ///< that way, of a motion
};

struct Report {
    Machine machine;
    bool quick = false;
    double seconds = 0.0;  ///< of wall time that the report took
    std::vector<StaticRow> statics;
    std::vector<MotionRow> motion;
    std::vector<IntegratorRow> integrators;
    std::vector<MomentumRow> momentum;
    std::vector<Choice> cheapestStatics, cheapestMotion;
};

/// Measures everything. `progress(done, all)` is called after every case; false ends it early, with what is there.
Report makeReport(bool quick, const std::function<bool(int done, int all)>& progress);

/// The rows of one problem as they are compared. A settled shape's error is the largest over Poisson's ratios, and its
/// `rows` say which one that is of.
struct Trials {
    std::vector<Trial> trials;
    std::vector<int> rows;  ///< of each trial, in Report::statics or Report::motion
};
Trials trialsOf(const Report& report, const accuracy::Problem& problem);
Trials trialsOf(const Report& report, const accuracy::MotionProblem& problem, bool withSoftBody);

}  // namespace jacket::demo::report
