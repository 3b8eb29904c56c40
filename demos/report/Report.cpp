#include "Report.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <set>

namespace jacket::demo::report {

namespace {

using accuracy::Case;
using accuracy::MotionCase;
using accuracy::MotionProblem;
using accuracy::MotionResult;
using accuracy::Problem;

/// One of each formula: dihedral-difference has the energy of dihedral, so that its answers are the same.
std::vector<BendingModel> modelsFor(const Problem& problem) {
    std::vector<BendingModel> models{PatchBending{}, DihedralBending{}, CubicShellBending{}};
    if (problem.flatRest) models.insert(models.begin() + 2, QuadraticBending{});
    return models;
}

std::vector<StaticRow> plannedStatics(bool quick) {
    std::vector<StaticRow> rows;
    for (const Problem& problem : accuracy::problems()) {
        const int levels = quick ? 1 : static_cast<int>(problem.cells.size());
        for (const double poisson : problem.poissons) {
            if (quick && poisson != problem.poissons.back()) continue;
            for (const BendingModel& model : modelsFor(problem))
                for (const accuracy::MeshKind mesh : problem.meshes)
                    for (int level = 0; level < levels; ++level)
                        rows.push_back(
                            {.problem = &problem,
                             .how = {.mesh = mesh, .cells = problem.cells[level], .bending = model, .poisson = poisson},
                             .level = level,
                             .got = {}});
        }
    }
    return rows;
}

std::vector<MotionRow> plannedMotion(bool quick) {
    std::vector<MotionRow> rows;
    for (const MotionProblem& problem : accuracy::motionProblems())
        for (const MotionCase& motion : problem.sweep(quick))
            rows.push_back({.problem = &problem, .how = motion, .got = {}});
    return rows;
}

double median(double a, double b, double c) {
    return std::max(std::min(a, b), std::min(std::max(a, b), c));
}

constexpr double kShort = 0.2;  // [s] below which one timing says little

void measure(StaticRow& row) {
    try {
        row.got = row.problem->solve(row.how);
        if (row.got.seconds < kShort)
            row.got.seconds =
                median(row.got.seconds, row.problem->solve(row.how).seconds, row.problem->solve(row.how).seconds);
    } catch (const std::exception&) {  // a model that cannot do this problem has no answer
        row.got.converged = false;
    }
    if (!std::isfinite(row.got.error)) row.got.converged = false;
}

void measure(MotionRow& row) {
    try {
        row.got = row.problem->run(row.how);
        if (row.got.seconds * row.problem->simulated < kShort)
            row.got.seconds =
                median(row.got.seconds, row.problem->run(row.how).seconds, row.problem->run(row.how).seconds);
    } catch (const std::exception&) {
        row.got.converged = false;
        row.got.error = std::numeric_limits<double>::infinity();
    }
}

constexpr Integrator kIntegrators[] = {Integrator::BackwardEuler, Integrator::Newton, Integrator::Bdf2};

std::vector<IntegratorRow> plannedIntegrators() {
    std::vector<IntegratorRow> rows;
    for (const Integrator integrator : kIntegrators)
        for (const int steps : {12, 24, 48, 96}) rows.push_back({integrator, steps, {}, {}});
    return rows;
}

std::vector<MomentumRow> plannedMomentum(bool quick) {
    std::vector<MomentumRow> rows;
    for (const bool withBall : {false, true})
        for (const Integrator integrator : kIntegrators)
            for (const double dt : {1.0 / 60, 1.0 / 240})
                if (!quick || dt > 0.01) rows.push_back({integrator, withBall, dt, {}});
    return rows;
}

// --- choosing ---------------------------------------------------------------------------------------------------

std::string familyOf(const Case& how) {
    return accuracy::nameOf(how.bending) + ' ' + accuracy::nameOf(how.mesh);
}

std::string familyOf(const MotionCase& how) {
    if (how.isSoftBody) return "btSoftBody";
    return accuracy::nameOf(how.bending) + ' ' + accuracy::nameOf(how.mesh) + ' ' + accuracy::nameOf(how.integrator);
}

/// The best of these for each error, as choices without their rows; `index` of each receives the trial's.
std::vector<Choice> choose(const std::string& name, std::span<const Trial> trials, std::vector<int>& index) {
    std::vector<Choice> choices;
    for (const double accepted : kAcceptedErrors) {
        int best = cheapestWithin(trials, accepted);
        const bool isReached = best >= 0;
        if (!isReached) best = mostExact(trials);
        if (best < 0) continue;
        choices.push_back({.problem = name,
                           .accepted = accepted,
                           .isReached = isReached,
                           .error = reliableError(trials, best),
                           .cost = trials[best].cost,
                           .statics = {},
                           .motion = {}});
        index.push_back(best);
    }
    return choices;
}

/// All problems as one: the largest error of a model and mesh over them at their coarser or finer resolution, and the
/// mean cost. Only what could be asked of every one of them takes part.
Trials trialsOfAll(const Report& report, bool onlyFlat) {
    std::set<const Problem*> problems;
    for (const StaticRow& row : report.statics)
        if (!onlyFlat || row.problem->flatRest) problems.insert(row.problem);
    struct Sum {
        std::set<const Problem*> problems;
        double error = 0.0, cost = 0.0;
        int rows = 0, worst = 0;
    };
    std::map<std::pair<std::string, int>, Sum> sums;
    for (std::size_t i = 0; i < report.statics.size(); ++i) {
        const StaticRow& row = report.statics[i];
        if (!problems.contains(row.problem)) continue;
        Sum& sum = sums[{familyOf(row.how), row.level}];
        sum.problems.insert(row.problem);
        sum.cost += row.got.seconds;
        ++sum.rows;
        if (row.absoluteError() < sum.error) continue;
        sum.error = row.absoluteError();
        sum.worst = static_cast<int>(i);
    }
    Trials result;
    for (const auto& [key, sum] : sums) {
        if (sum.problems != problems) continue;
        result.trials.push_back({key.first, {double(key.second)}, sum.error, sum.cost / sum.rows});
        result.rows.push_back(sum.worst);
    }
    return result;
}

void chooseStatics(Report& report, const std::string& name, const Trials& trials) {
    std::vector<int> best;
    std::vector<Choice> choices = choose(name, trials.trials, best);
    for (std::size_t k = 0; k < choices.size(); ++k) {
        choices[k].statics = report.statics[trials.rows[best[k]]];
        report.cheapestStatics.push_back(choices[k]);
    }
}

void chooseMotion(Report& report, const MotionProblem& problem) {
    const Trials trials = trialsOf(report, problem, /*withSoftBody=*/false);
    std::vector<int> best;
    std::vector<Choice> choices = choose(problem.name, trials.trials, best);
    for (std::size_t k = 0; k < choices.size(); ++k) {
        choices[k].motion = report.motion[trials.rows[best[k]]];
        report.cheapestMotion.push_back(choices[k]);
    }
}

void chooseAll(Report& report) {
    for (const MotionProblem& problem : accuracy::motionProblems()) chooseMotion(report, problem);
    const auto problems = accuracy::problems();
    const bool allFlat = std::all_of(problems.begin(), problems.end(), [](const Problem& p) { return p.flatRest; });
    if (problems.size() > 1) {
        chooseStatics(report, kEveryProblem, trialsOfAll(report, false));
        if (!allFlat) chooseStatics(report, kEveryFlatProblem, trialsOfAll(report, true));
    }
    for (const Problem& problem : problems) chooseStatics(report, problem.name, trialsOf(report, problem));
}

}  // namespace

double StaticRow::absoluteError() const {
    return got.converged ? std::abs(got.error) : std::numeric_limits<double>::infinity();
}

Trials trialsOf(const Report& report, const Problem& problem) {
    std::map<std::pair<std::string, int>, std::vector<int>> ratios;  // rows that differ in Poisson's ratio alone
    for (std::size_t i = 0; i < report.statics.size(); ++i) {
        const StaticRow& row = report.statics[i];
        if (row.problem == &problem) ratios[{familyOf(row.how), row.how.cells}].push_back(static_cast<int>(i));
    }
    Trials result;
    for (const auto& [key, rows] : ratios) {
        const int worst = *std::max_element(rows.begin(), rows.end(), [&](int a, int b) {
            return report.statics[a].absoluteError() < report.statics[b].absoluteError();
        });
        const StaticRow& row = report.statics[worst];
        result.trials.push_back({key.first, {double(key.second)}, row.absoluteError(), row.got.seconds});
        result.rows.push_back(worst);
    }
    return result;
}

Trials trialsOf(const Report& report, const MotionProblem& problem, bool withSoftBody) {
    Trials result;
    for (std::size_t i = 0; i < report.motion.size(); ++i) {
        const MotionRow& row = report.motion[i];
        if (row.problem != &problem || (row.how.isSoftBody && !withSoftBody)) continue;
        result.trials.push_back({familyOf(row.how),
                                 {double(row.how.cells), 1.0 / row.how.dt, 1.0 / row.how.tolerance},
                                 row.got.error,
                                 row.got.seconds});
        result.rows.push_back(static_cast<int>(i));
    }
    return result;
}

Report makeReport(bool quick, const std::function<bool(int done, int all)>& progress) {
    const auto start = std::chrono::steady_clock::now();
    Report report{.machine = thisMachine(),
                  .quick = quick,
                  .statics = plannedStatics(quick),
                  .motion = plannedMotion(quick),
                  .integrators = plannedIntegrators(),
                  .momentum = plannedMomentum(quick),
                  .cheapestStatics = {},
                  .cheapestMotion = {}};
    const int all = static_cast<int>(report.statics.size() + report.motion.size() + report.integrators.size() +
                                     report.momentum.size());
    int done = 0;
    const auto forEach = [&](auto& rows, const auto& work) {
        for (auto& row : rows) {
            work(row);
            if (!progress(++done, all)) return false;
        }
        return true;
    };
    const bool isWhole =
        forEach(report.integrators,
                [](IntegratorRow& row) {
                    row.theory = accuracy::vibrationInTheory(row.integrator, row.stepsPerPeriod);
                    row.measured = accuracy::vibrationMeasured(row.integrator, row.stepsPerPeriod);
                }) &&
        forEach(report.momentum,
                [](MomentumRow& row) { row.drift = accuracy::momentumDrift(row.integrator, row.withBall, row.dt); }) &&
        forEach(report.motion, [](MotionRow& row) { measure(row); }) &&
        forEach(report.statics, [](StaticRow& row) { measure(row); });
    if (isWhole) chooseAll(report);
    report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
}

}  // namespace jacket::demo::report
