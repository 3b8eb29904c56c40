#include "Tables.h"

#include <cmath>
#include <cstdio>

#include "Svg.h"

namespace jacket::demo::report {

namespace {

using accuracy::nameOf;

Json numberOrNull(double x) {
    return std::isfinite(x) ? Json(x) : Json(nullptr);
}

std::string solverOf(const accuracy::MotionCase& how) {
    return how.isSoftBody ? "btSoftBody" : "jacket";
}

/// How a motion was computed; of btSoftBody only what it knows.
void addHow(Json& json, const accuracy::MotionCase& how) {
    json["solver"] = solverOf(how);
    json["model"] = how.isSoftBody ? Json(nullptr) : Json(nameOf(how.bending));
    json["integrator"] = how.isSoftBody ? Json(nullptr) : Json(nameOf(how.integrator));
    json["dt"] = how.dt;
    json["tolerance"] = how.isSoftBody ? Json(nullptr) : Json(how.tolerance);
    json["mesh"] = how.isSoftBody ? "grid" : nameOf(how.mesh);
    json["cells"] = how.cells;
}

Json toJson(const Machine& machine) {
    return {{"cpu", machine.cpu},           {"cores", machine.cores}, {"threads_used", 1},
            {"compiler", machine.compiler}, {"flags", machine.flags}, {"precision", machine.precision},
            {"bullet", machine.bullet}};
}

Json toJson(const StaticRow& row) {
    return {{"problem", row.problem->name},
            {"quantity", row.problem->quantity},
            {"mesh", nameOf(row.how.mesh)},
            {"cells", row.how.cells},
            {"model", nameOf(row.how.bending)},
            {"poisson", row.how.poisson},
            {"value", row.got.converged ? numberOrNull(row.got.value) : Json(nullptr)},
            {"reference", numberOrNull(row.got.reference)},
            {"error", row.got.converged ? numberOrNull(row.got.error) : Json(nullptr)},
            {"target", row.target()},
            {"seconds", row.got.seconds},
            {"vertices", row.got.vertices},
            {"converged", row.got.converged}};
}

Json toJson(const MotionRow& row) {
    Json json{{"problem", row.problem->name}, {"quantity", row.problem->quantity}};
    addHow(json, row.how);
    json["error"] = numberOrNull(row.got.error);
    json["cost_per_simulated_second"] = row.got.seconds;
    json["vertices"] = row.got.vertices;
    json["converged"] = row.got.converged;
    return json;
}

Json toJson(const Choice& choice) {
    const bool isMotion = choice.motion.problem != nullptr;
    Json json{{"kind", isMotion ? "motion" : "statics"},
              {"problem", choice.problem},
              {"accepted_error", choice.accepted},
              {"reached", choice.isReached},
              {"error", numberOrNull(choice.error)}};
    json[isMotion ? "cost_per_simulated_second" : "seconds"] = choice.cost;
    if (isMotion) {
        addHow(json, choice.motion.how);
    } else {
        json["model"] = nameOf(choice.statics.how.bending);
        json["mesh"] = nameOf(choice.statics.how.mesh);
        json["cells"] = choice.statics.how.cells;
        json["resolution"] = choice.statics.level == 0 ? "coarser" : "finer";
    }
    return json;
}

Json paretoJson(const Report& report) {
    Json list = Json::array();
    for (const auto& problem : accuracy::motionProblems()) {
        const Trials trials = trialsOf(report, problem, /*withSoftBody=*/true);
        for (const int i : paretoFront(trials.trials)) list.push_back(toJson(report.motion[trials.rows[i]]));
    }
    return list;
}

std::string quoted(const std::string& text) {
    std::string result = "\"";
    for (const char c : text) result += c == '"' ? "\"\"" : std::string(1, c);
    return result + '"';
}

std::string csvValue(const Json& value) {
    if (value.is_string()) return quoted(value.get<std::string>());
    if (value.is_null()) return "";
    if (value.is_number_float()) {
        char text[32];
        std::snprintf(text, sizeof text, "%.8g", value.get<double>());
        return text;
    }
    return value.dump();
}

/// Objects with the same keys as lines of a table.
std::string csv(const Json& rows) {
    if (rows.empty()) return "";
    std::string text;
    for (const auto& [key, value] : rows.front().items()) text += (text.empty() ? "" : ",") + key;
    text += '\n';
    for (const Json& row : rows) {
        std::string line;
        for (const auto& [key, value] : row.items()) line += (line.empty() ? "" : ",") + csvValue(value);
        text += line + '\n';
    }
    return text;
}

Json toJson(const IntegratorRow& row) {
    return {{"integrator", nameOf(row.integrator)},
            {"steps_per_period", row.stepsPerPeriod},
            {"amplitude_left", numberOrNull(row.measured.amplitudeLeft)},
            {"amplitude_left_in_theory", row.theory.amplitudeLeft},
            {"period_ratio", numberOrNull(row.measured.periodRatio)},
            {"period_ratio_in_theory", row.theory.periodRatio}};
}

Json toJson(const MomentumRow& row) {
    return {{"system", row.withBall ? "spinning sheet and ball" : "spinning sheet"},
            {"integrator", nameOf(row.integrator)},
            {"dt", row.dt},
            {"linear_drift_per_second", numberOrNull(row.drift.linear)},
            {"angular_drift_per_second", numberOrNull(row.drift.angular)},
            {"energy_change_per_second", numberOrNull(row.drift.energy)}};
}

template <class Rows>
Json listOf(const Rows& rows) {
    Json list = Json::array();
    for (const auto& row : rows) list.push_back(toJson(row));
    return list;
}

std::string howText(const Choice& choice) {
    if (choice.motion.problem) {
        const auto& how = choice.motion.how;
        return nameOf(how.bending) + ", " + nameOf(how.integrator) + ", step " + stepText(how.dt) + ", " +
               nameOf(how.mesh) + ", " + std::to_string(how.cells) + " cells, tolerance " + shortNumber(how.tolerance);
    }
    const auto& how = choice.statics.how;
    const bool isOfMany = choice.problem == kEveryProblem || choice.problem == kEveryFlatProblem;
    const std::string cells =
        isOfMany ? choice.statics.level == 0 ? "coarser cells" : "finer cells" : std::to_string(how.cells) + " cells";
    return nameOf(how.bending) + ", " + nameOf(how.mesh) + ", " + cells;
}

void printChoices(std::ostream& out, const std::vector<Choice>& choices, const char* per) {
    std::string problem;
    for (const Choice& choice : choices) {
        if (choice.problem != problem) out << "  " << (problem = choice.problem) << '\n';
        char start[96];
        if (choice.isReached)
            std::snprintf(start, sizeof start, "    %5s  %8s%s  ", percent(choice.accepted).c_str(),
                          duration(choice.cost).c_str(), per);
        else
            std::snprintf(start, sizeof start, "    %5s  not reached; least error: ", percent(choice.accepted).c_str());
        out << start << howText(choice) << " (error " << percent(choice.error) << ")\n";
    }
}

}  // namespace

std::string stepText(double dt) {
    return "1/" + std::to_string(std::lround(1 / dt)) + " s";
}

Json toJson(const Report& report) {
    Json json{{"version", JACKET_VERSION},
              {"machine", toJson(report.machine)},
              {"quick", report.quick},
              {"wall_s", report.seconds}};
    json["statics"] = listOf(report.statics);
    json["motion"] = listOf(report.motion);
    json["integrators"] = listOf(report.integrators);
    json["momentum"] = listOf(report.momentum);
    json["cheapest"] = listOf(report.cheapestMotion);
    for (const Choice& choice : report.cheapestStatics) json["cheapest"].push_back(toJson(choice));
    json["pareto"] = paretoJson(report);
    return json;
}

std::string staticsCsv(const Report& report) {
    return csv(listOf(report.statics));
}
std::string motionCsv(const Report& report) {
    return csv(listOf(report.motion));
}
std::string integratorsCsv(const Report& report) {
    return csv(listOf(report.integrators));
}
std::string momentumCsv(const Report& report) {
    return csv(listOf(report.momentum));
}
std::string cheapestMotionCsv(const Report& report) {
    return csv(listOf(report.cheapestMotion));
}
std::string cheapestStaticsCsv(const Report& report) {
    return csv(listOf(report.cheapestStatics));
}

void printCheapest(std::ostream& out, const Report& report) {
    out << "Cheapest way to a motion within an error (CPU time per simulated second):\n";
    printChoices(out, report.cheapestMotion, "/s");
    out << "Cheapest way to a settled shape within an error (CPU time of the solve):\n";
    printChoices(out, report.cheapestStatics, "");
    out << "On " << report.machine.cpu << ", one thread, " << report.machine.compiler << ", "
        << report.machine.precision << " precision"
        << (report.quick ? "; a quick look: fewer cases, so that dearer ones may be named.\n" : ".\n");
}

}  // namespace jacket::demo::report
