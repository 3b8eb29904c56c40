#include "Result.h"

#include <algorithm>
#include <cmath>
#include <ostream>

#include "Quantile.h"

namespace jacket::demo {

namespace {

/// JSON has no infinity and no NaN.
Json numberOrNull(double x) {
    return std::isfinite(x) ? Json(x) : Json(nullptr);
}

Json shellsToJson(const World& world) {
    Json shells = Json::array();
    for (int k = 0; k < world.shellCount(); ++k)
        shells.push_back({{"name", world.scene().shells[k].name},
                          {"vertices", world.shell(k).vertexCount()},
                          {"triangles", world.shell(k).mesh().triangleCount()},
                          {"contacts", world.contactCount(k)},
                          {"asleep", world.isAsleep(k)}});
    return shells;
}

Json bodiesToJson(const World& world) {
    Json bodies = Json::array();
    for (const BodyState& body : world.bodies()) {
        const Eigen::Quaterniond q(body.rotation);
        bodies.push_back({{"name", body.description->name},
                          {"position", toJson(body.position)},
                          {"rotation", {q.x(), q.y(), q.z(), q.w()}},
                          {"velocity", toJson(body.velocity)}});
    }
    return bodies;
}

}  // namespace

Result::Result(const World& start)
    : m_start(measure(start, 0)),
      m_end(m_start),
      m_weight(movingMass(start) * start.scene().gravity),
      m_deepest(m_start),
      m_peakStretch(m_start.maxStretch),
      m_momentumScale(m_start.momentumScale),
      m_substeps(start.scene().substeps),
      m_finite(m_start.isFinite) {}

void Result::add(const FrameRecord& frame) {
    m_end = frame;
    m_wall += frame.report.seconds;
    m_msPerStep.push_back(1e3 * frame.report.seconds / m_substeps);
    m_iterations += frame.report.pcgIterations;
    m_mostIterations = std::max(m_mostIterations, frame.report.mostIterations);
    m_peakStretch = std::max(m_peakStretch, frame.maxStretch);
    if (frame.penetration.depth > m_deepest.penetration.depth) m_deepest = frame;
    m_momentumScale = std::max(m_momentumScale, frame.momentumScale);
    const Vec3 drift = frame.momentum - m_start.momentum - m_weight * frame.time;
    m_momentumDrift = std::max(m_momentumDrift, drift.norm());
    m_converged = m_converged && frame.report.converged;
    m_finite = m_finite && frame.report.finite && frame.isFinite;
    m_yielding.resize(std::max(m_yielding.size(), frame.report.dents.size()));
    for (std::size_t k = 0; k < frame.report.dents.size(); ++k)
        if (frame.report.dents[k].work > m_yielding[k].most.work) m_yielding[k] = {frame.report.dents[k], frame.time};
}

/// Relative to the momentum at the start or, where that is nearly none, to the sum of the momenta that move about.
double Result::momentumError() const {
    const double start = m_start.momentum.norm();
    const double scale = start > 1e-3 * m_momentumScale ? start : m_momentumScale;
    return scale > 0 ? m_momentumDrift / scale : 0.0;
}

Json Result::json(const World& end) const {
    const Scene& scene = end.scene();
    const double steps = std::max<double>(1.0, static_cast<double>(m_msPerStep.size()) * m_substeps);
    Json result{{"version", JACKET_VERSION},  {"scene", scene.name},
                {"seed", scene.seed},         {"precision", World::precision()},
                {"threads", end.threads()},   {"dt", scene.dt},
                {"substeps", scene.substeps}, {"frames", m_msPerStep.size()},
                {"simulated_s", end.time()},  {"wall_s", m_wall}};
    result["ms_per_step"] = {{"median", quantile(m_msPerStep, 0.5)}, {"p95", quantile(m_msPerStep, 0.95)}};
    result["pcg_iterations"] = {{"mean", m_iterations / steps}, {"max", m_mostIterations}};
    result["max_stretch"] = numberOrNull(m_end.maxStretch);
    result["peak_stretch"] = numberOrNull(m_peakStretch);
    result["max_penetration"] = m_deepest.penetration.depth;
    if (m_deepest.penetration.body >= 0)
        result["deepest"] = {{"frame", m_deepest.frame},
                             {"shell", scene.shells[m_deepest.penetration.shell].name},
                             {"body", scene.bodies[m_deepest.penetration.body].name}};
    result["energy"] = {
        {"kinetic", numberOrNull(m_end.energy.kinetic)},     {"membrane", numberOrNull(m_end.energy.membrane)},
        {"bending", numberOrNull(m_end.energy.bending)},     {"plastic_work", numberOrNull(m_end.energy.plasticWork)},
        {"potential", numberOrNull(m_end.energy.potential)}, {"start", numberOrNull(m_start.energy.total())},
        {"end", numberOrNull(m_end.energy.total())}};
    result["momentum_error"] = isFree(scene) ? numberOrNull(momentumError()) : Json(nullptr);
    result["converged"] = m_converged;
    result["finite"] = m_finite;
    result["unconverged_steps"] = end.unconvergedSteps();
    result["unsettled_steps"] = end.unsettledSteps();
    result["rejected_steps"] = end.rejectedSteps();
    result["passed_steps"] = end.passedSteps();
    result["state"] = stateHash(end);
    result["shells"] = shellsToJson(end);
    for (std::size_t k = 0; k < m_yielding.size(); ++k) {
        const auto& [most, time] = m_yielding[k];
        if (most.triangle < 0) continue;
        result["shells"][k]["dent"] = {{"time", time},
                                       {"position", toJson(most.position)},
                                       {"triangle", most.triangle},
                                       {"elements", most.elements},
                                       {"work", most.work}};
    }
    result["bodies"] = bodiesToJson(end);
    result["probes"] = Json::object();
    for (const ProbeDescription& probe : scene.probes) result["probes"][probe.name] = probeValue(probe, end);
    return result;
}

ExitCode Result::exitCode() const {
    if (!m_finite) return kNotFinite;
    return m_converged ? kOk : kNotConverged;
}

namespace {

double number(const Json& value) {
    return value.is_number() ? value.get<double>() : std::nan("");
}

std::string brief(const Json& value) {
    char text[64];
    if (value.is_number()) {
        std::snprintf(text, sizeof text, "%.5g", value.get<double>());
        return text;
    }
    if (!value.is_array()) return value.dump();
    std::string list;
    for (const Json& entry : value) list += (list.empty() ? "(" : ", ") + brief(entry);
    return list + ")";
}

void printLine(std::ostream& out, const std::string& what, const std::string& value) {
    out << "  " << what << std::string(what.size() < 18 ? 18 - what.size() : 1, ' ') << value << '\n';
}

void printSpeed(std::ostream& out, const Json& result) {
    const double wall = std::max(number(result["wall_s"]), 1e-9), frames = number(result["frames"]);
    const double realTime = number(result["simulated_s"]) / wall;
    printLine(out, "simulated", brief(result["simulated_s"]) + " s in " + brief(result["frames"]) + " frames");
    printLine(out, "speed",
              shortNumber(std::round(10 * frames / wall) / 10) + " frames/s, " + brief(realTime) + " x real time (" +
                  brief(wall) + " s of stepping)");
    printLine(
        out, "ms per step",
        "median " + brief(result["ms_per_step"]["median"]) + ", 95 % below " + brief(result["ms_per_step"]["p95"]));
    printLine(out, "PCG iterations",
              "mean " + brief(result["pcg_iterations"]["mean"]) + ", most " + brief(result["pcg_iterations"]["max"]));
}

std::string whyNotConverged(const Json& result) {
    const Json& steps = result["unconverged_steps"];
    if (steps == 0) return "no equilibrium was found";  // mode static
    const double all = number(result["frames"]) * number(result["substeps"]);
    return "in " + brief(steps) + " of " + brief(Json(all)) +
           " steps a solve used up its iterations, or a contact ended deeper than allowed";
}

}  // namespace

void printSummary(std::ostream& out, const Json& result) {
    out << result["scene"].get<std::string>() << " (" << result["precision"].get<std::string>() << " precision)\n";
    for (const Json& shell : result["shells"])
        printLine(out, shell["name"],
                  brief(shell["vertices"]) + " vertices, " + brief(shell["triangles"]) + " triangles, " +
                      brief(shell["contacts"]) + " in contact at the end");
    printSpeed(out, result);
    printLine(out, "stretch",
              brief(100 * number(result["max_stretch"])) + " % at the end, " +
                  brief(100 * number(result["peak_stretch"])) + " % at most");
    const auto where = [](const Json& d) {
        return " (" + d["shell"].get<std::string>() + " in " + d["body"].get<std::string>() + ", frame " +
               brief(d["frame"]) + ")";
    };
    printLine(out, "penetration",
              brief(1e3 * number(result["max_penetration"])) + " mm at most" +
                  (result.contains("deepest") ? where(result["deepest"]) : ""));
    const Json& energy = result["energy"];
    printLine(out, "energy",
              brief(energy["start"]) + " J at the start, " + brief(energy["end"]) + " J at the end: " + "kinetic " +
                  brief(energy["kinetic"]) + ", membrane " + brief(energy["membrane"]) + ", bending " +
                  brief(energy["bending"]));
    if (!result["momentum_error"].is_null())
        printLine(out, "momentum error", brief(result["momentum_error"]) + " of the momentum");
    for (const Json& body : result["bodies"])
        printLine(out, body["name"],
                  "at " + brief(body["position"]) + " m, velocity " + brief(body["velocity"]) + " m/s");
    for (const auto& [name, value] : result["probes"].items()) printLine(out, name, brief(value));
    if (!result["converged"].get<bool>()) out << "  NOT CONVERGED: " << whyNotConverged(result) << '\n';
    if (!result["finite"].get<bool>()) out << "  NOT FINITE: a step was rejected or gave numbers that are none\n";
}

}  // namespace jacket::demo
