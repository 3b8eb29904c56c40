#include "Page.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <map>

#include "Html.h"
#include "Json.h"
#include "Svg.h"
#include "Tables.h"

namespace jacket::demo::report {

namespace {

using accuracy::MeshKind;
using accuracy::MotionCase;
using accuracy::MotionProblem;
using accuracy::nameOf;
using accuracy::Problem;

/// Of a bending model; they are told apart on white and on black, and by people who see red and green alike.
std::string colourOf(const std::string& model) {
    static const std::map<std::string, std::string> colours{
        {"patch", "#2f7fd0"}, {"dihedral", "#d98200"}, {"quadratic", "#199e77"}, {"cubic", "#cc5ba0"}};
    const auto found = colours.find(model);
    return found == colours.end() ? "#8a8f94" : found->second;
}

MarkerShape shapeOf(Integrator integrator) {
    return integrator == Integrator::BackwardEuler ? MarkerShape::Circle
           : integrator == Integrator::Newton      ? MarkerShape::Square
                                                   : MarkerShape::Triangle;
}

std::string dashOf(MeshKind mesh) {
    return mesh == MeshKind::OneDiagonal ? "" : mesh == MeshKind::Alternating ? "6 3" : "2 3";
}

std::string fileName(const std::string& title) {
    std::string name;
    for (const unsigned char c : title) {
        if (std::isalnum(c))
            name += static_cast<char>(std::tolower(c));
        else if (!name.empty() && name.back() != '_')
            name += '_';
    }
    return name;
}

std::string fixed(const char* pattern, double value) {
    char text[48];
    std::snprintf(text, sizeof text, pattern, value);
    return text;
}

std::string errorText(double error) {
    return std::isfinite(error) ? percent(error) : "no result";
}

std::string describe(const MotionRow& row) {
    const MotionCase& how = row.how;
    const std::string cost = ": error " + errorText(row.got.error) + ", " + duration(row.got.seconds) + " a second";
    const std::string size = "step " + stepText(how.dt) + ", " + std::to_string(how.cells) + " cells";
    if (how.isSoftBody) return "btSoftBody, " + size + cost;
    return nameOf(how.bending) + ", " + nameOf(how.integrator) + ", " + size + ", " + nameOf(how.mesh) +
           ", tolerance " + shortNumber(how.tolerance) + cost;
}

// --- plots ------------------------------------------------------------------------------------------------------

/// A series of each model with each integrator; the mesh kinds share it, and the titles tell them apart.
Plot scatterOf(const Report& report, const MotionProblem& problem) {
    const Trials trials = trialsOf(report, problem, /*withSoftBody=*/true);
    const std::vector<int> front = paretoFront(trials.trials);
    Plot plot{.title = problem.name + ": error against cost",
              .xLabel = "CPU time per simulated second",
              .yLabel = "error",
              .xUnit = AxisUnit::Seconds,
              .series = {},
              .front = {},
              .target = {},
              .fadesRest = true};
    std::vector<std::string> names;
    for (std::size_t k = 0; k < trials.trials.size(); ++k) {
        const MotionRow& row = report.motion[trials.rows[k]];
        const std::string model = row.how.isSoftBody ? "btSoftBody" : nameOf(row.how.bending);
        const std::string name = row.how.isSoftBody ? model : model + ", " + nameOf(row.how.integrator);
        auto found = std::find(names.begin(), names.end(), name);
        if (found == names.end()) {
            const MarkerShape shape = row.how.isSoftBody ? MarkerShape::Diamond : shapeOf(row.how.integrator);
            plot.series.push_back({.name = name, .colour = colourOf(model), .shape = shape, .markers = {}, .dash = {}});
            names.push_back(name);
            found = names.end() - 1;
        }
        const bool isOnFront = std::find(front.begin(), front.end(), static_cast<int>(k)) != front.end();
        plot.series[found - names.begin()].markers.push_back(
            {row.got.seconds, row.got.error, describe(row), isOnFront});
    }
    for (const int i : front) plot.front.emplace_back(trials.trials[i].cost, trials.trials[i].error);
    return plot;
}

Plot convergenceOf(const Report& report, const Problem& problem) {
    const Trials trials = trialsOf(report, problem);
    Plot plot{.title = problem.name,
              .xLabel = "cells along the main direction",
              .yLabel = "|error|",
              .series = {},
              .front = {},
              .target = {}};
    if (!problem.targets.empty()) plot.target = problem.targets.back();
    std::map<std::string, Series> byFamily;
    for (std::size_t k = 0; k < trials.trials.size(); ++k) {
        const StaticRow& row = report.statics[trials.rows[k]];
        const std::string model = nameOf(row.how.bending);
        Series& series = byFamily[trials.trials[k].family];
        series.colour = colourOf(model);
        series.name = model + ", " + nameOf(row.how.mesh);
        series.isJoined = true;
        series.dash = dashOf(row.how.mesh);
        series.markers.push_back(
            {double(row.how.cells), trials.trials[k].error,
             series.name + ", " + std::to_string(row.how.cells) + " cells: " + errorText(trials.trials[k].error),
             false});
    }
    for (auto& [family, series] : byFamily) plot.series.push_back(series);
    return plot;
}

// --- the answer -------------------------------------------------------------------------------------------------

std::string costCell(const Choice& choice) {
    return choice.isReached ? "<b>" + duration(choice.cost) + "</b>" : "not reached";
}

std::string nameCell(const Choice& choice, std::string& last) {
    return choice.problem == last ? "" : "<b>" + escaped(last = choice.problem) + "</b>";
}

std::string noteOf(const Choice& choice) {
    return choice.isReached ? "" : " <small>the least error of all</small>";
}

HtmlTable cheapestMotion(const Report& report) {
    HtmlTable table{
        {"motion", "#accepted", "#CPU per second", "bending", "integrator", "#step", "mesh", "#cells", "#tolerance",
         "#error"},
        {},
        "CPU time of stepping per simulated second. The error is the largest of that case and of every finer one of "
        "its kind that was tried, so that errors that happen to cancel are not taken for accuracy."};
    std::string last;
    for (const Choice& choice : report.cheapestMotion) {
        const MotionCase& how = choice.motion.how;
        table.rows.push_back({nameCell(choice, last), percent(choice.accepted), costCell(choice), nameOf(how.bending),
                              nameOf(how.integrator), stepText(how.dt), nameOf(how.mesh), std::to_string(how.cells),
                              shortNumber(how.tolerance), percent(choice.error) + noteOf(choice)});
    }
    return table;
}

bool isOfMany(const Choice& choice) {
    return choice.problem == kEveryProblem || choice.problem == kEveryFlatProblem;
}

HtmlTable cheapestStatics(const Report& report, bool ofMany) {
    HtmlTable table{{"settled shape", "#accepted", "#CPU", "bending", "mesh", "#cells", "#error"}, {}, ""};
    if (ofMany)
        table.caption =
            "The largest error over all problems; CPU time is the mean of their solves. Each problem has a "
            "coarser and a finer resolution of its own.";
    std::string last;
    for (const Choice& choice : report.cheapestStatics) {
        if (isOfMany(choice) != ofMany) continue;
        const auto& how = choice.statics.how;
        const std::string cells = !ofMany ? std::to_string(how.cells) : choice.statics.level == 0 ? "coarser" : "finer";
        table.rows.push_back({nameCell(choice, last), percent(choice.accepted), costCell(choice), nameOf(how.bending),
                              nameOf(how.mesh), cells, percent(choice.error) + noteOf(choice)});
    }
    return table;
}

std::string answer(const Report& report) {
    std::string html =
        "<p>For an error that you accept: the cheapest of all cases that were tried, and what it costs.</p>\n";
    html += toHtml(cheapestMotion(report));
    const HtmlTable all = cheapestStatics(report, true), each = cheapestStatics(report, false);
    if (all.rows.empty()) return html + toHtml(each);
    return html + toHtml(all) + folded("Settled shapes, problem by problem", toHtml(each));
}

// --- the parts --------------------------------------------------------------------------------------------------

HtmlTable motionTable(const Report& report, const MotionProblem& problem) {
    HtmlTable table{{"bending", "integrator", "#step", "mesh", "#cells", "#tolerance", "#vertices", "#error",
                     "#CPU per second", ""},
                    {},
                    ""};
    for (const MotionRow& row : report.motion) {
        if (row.problem != &problem) continue;
        const MotionCase& how = row.how;
        const bool soft = how.isSoftBody;
        table.rows.push_back({soft ? "btSoftBody" : nameOf(how.bending), soft ? "" : nameOf(how.integrator),
                              stepText(how.dt), soft ? "grid" : nameOf(how.mesh), std::to_string(how.cells),
                              soft ? "" : shortNumber(how.tolerance), std::to_string(row.got.vertices),
                              errorText(row.got.error), duration(row.got.seconds),
                              row.got.converged ? "" : "a step did not converge"});
    }
    return table;
}

std::string motionPart(const Report& report) {
    std::string html =
        "<h2>Motion</h2>\n<p>Hold the pointer over a mark to see what it is. Marks on the Pareto front are "
        "whole: nothing tried is both cheaper and more exact.</p>\n<div class=\"plots\">\n";
    for (const Picture& picture : motionPictures(report)) html += "<div>" + picture.svg + "</div>\n";
    html += "</div>\n";
    for (const MotionProblem& problem : accuracy::motionProblems())
        html += "<h3>" + escaped(problem.name) + "</h3>\n<p class=\"soft\">Error: " + escaped(problem.quantity) +
                ". Reference: " + escaped(problem.source) + ". Compared: " + escaped(problem.sweepText) + ".</p>\n" +
                folded("All cases", toHtml(motionTable(report, problem)));
    return html;
}

std::string integratorPart(const Report& report) {
    HtmlTable table{
        {"integrator", "#steps per period", "#amplitude left", "#in theory", "#period ratio", "#in theory"},
        {},
        "After one period of the lowest mode of a clamped strip, with tolerance 1e-9. In theory: the root z of "
        "the method's characteristic polynomial for x'' = -w&sup2;x; backward Euler keeps 1/(1+(wh)&sup2;) of "
        "the energy in a step."};
    for (const IntegratorRow& row : report.integrators)
        table.rows.push_back({nameOf(row.integrator), std::to_string(row.stepsPerPeriod),
                              fixed("%.4f", row.measured.amplitudeLeft), fixed("%.4f", row.theory.amplitudeLeft),
                              fixed("%.4f", row.measured.periodRatio), fixed("%.4f", row.theory.periodRatio)});
    return "<h2>What the integrators do to a vibration</h2>\n" + toHtml(table);
}

std::string momentumPart(const Report& report) {
    HtmlTable table{
        {"system", "integrator", "#step", "#linear momentum", "#angular momentum", "#energy"},
        {},
        "A 1 x 1 m sheet that turns about once a second in free space, alone or hit by a spinning ball: largest "
        "change per second, relative; of the energy what is gained or lost. Near bodies every integrator takes "
        "steps of backward Euler."};
    for (const MomentumRow& row : report.momentum)
        table.rows.push_back({row.withBall ? "sheet and ball" : "sheet", nameOf(row.integrator), stepText(row.dt),
                              fixed("%.1e", row.drift.linear), percent(row.drift.angular), percent(row.drift.energy)});
    return "<h2>Momentum</h2>\n" + toHtml(table);
}

std::string signedError(const StaticRow& row) {
    if (!row.got.converged) return "<span class=\"bad\">no result</span>";
    const bool isGood = row.absoluteError() <= row.target();
    return std::string("<span class=\"") + (isGood ? "good" : "bad") + "\">" + fixed("%+.3g %%", 100 * row.got.error) +
           "</span>";
}

/// A line of each mesh, resolution and ratio; the models side by side.
HtmlTable staticTable(const Report& report, const Problem& problem) {
    std::vector<std::string> models;
    std::map<std::array<double, 3>, std::map<std::string, const StaticRow*>> lines;  // ratio, mesh, cells
    for (const StaticRow& row : report.statics) {
        if (row.problem != &problem) continue;
        const std::string model = nameOf(row.how.bending);
        if (std::find(models.begin(), models.end(), model) == models.end()) models.push_back(model);
        lines[{row.how.poisson, double(row.how.mesh), double(row.how.cells)}][model] = &row;
    }
    HtmlTable table{{"#Poisson", "mesh", "#cells", "#vertices", "#target"}, {}, ""};
    for (const std::string& model : models) table.headings.push_back("#" + model);
    table.headings.push_back("#CPU, patch");
    for (const auto& [key, cells] : lines) {
        const StaticRow& any = *cells.begin()->second;
        std::vector<std::string> line{shortNumber(any.how.poisson), nameOf(any.how.mesh), std::to_string(any.how.cells),
                                      std::to_string(any.got.vertices), percent(any.target())};
        for (const std::string& model : models)
            line.push_back(cells.contains(model) ? signedError(*cells.at(model)) : "");
        line.push_back(cells.contains("patch") ? duration(cells.at("patch")->got.seconds) : "");
        table.rows.push_back(line);
    }
    return table;
}

std::string staticPart(const Report& report) {
    std::string html =
        "<h2>Settled shapes</h2>\n<p>Signed errors of the models side by side; green where within the "
        "target. In the plots: the largest over Poisson's ratios.</p>\n";
    const std::vector<Picture> pictures = staticPictures(report);
    std::size_t k = 0;
    for (const Problem& problem : accuracy::problems()) {
        html += "<h3>" + escaped(problem.name) + "</h3>\n<p class=\"soft\">" + escaped(problem.quantity) +
                ". Reference: " + escaped(problem.source) + ".</p>\n<div class=\"plots\"><div>" +
                toHtml(staticTable(report, problem)) + "</div><div>" + pictures[k++].svg + "</div></div>\n";
    }
    return html;
}

std::string machineText(const Report& report) {
    const Machine& m = report.machine;
    return escaped("jacket " JACKET_VERSION ", Bullet " + m.bullet + " in " + m.precision + " precision; " + m.cpu +
                   ", one thread; " + m.compiler + ", " + m.flags + ". The report took " +
                   std::to_string(std::lround(report.seconds)) + " s.");
}

std::string methodPart() {
    return "<h2>How it was measured</h2>\n<p>Costs are CPU time of one thread, of the steps or the solve alone: "
           "without "
           "building the mesh or writing files. Times under 0.2 s are the median of three runs. "
           "Settled shapes are found by Newton's method from the flat or rolled rest shape. btSoftBody has the same "
           "number "
           "of nodes, the same mass and links as stiff as they go, with bending links, 10 iterations and a margin "
           "of 0.05 m; it knows no Young's modulus, and an error of many times 100 % means that the ball fell through. "
           "A "
           "plastic strip's spring-back is asserted by the tests and not timed here.</p>\n"
           "<p>The same numbers are in report.json and in the CSV tables beside this page, the plots in plots/.</p>\n";
}

}  // namespace

std::vector<Picture> motionPictures(const Report& report) {
    std::vector<Picture> pictures;
    for (const MotionProblem& problem : accuracy::motionProblems())
        pictures.push_back({"motion_" + fileName(problem.name), drawSvg(scatterOf(report, problem))});
    return pictures;
}

std::vector<Picture> staticPictures(const Report& report) {
    std::vector<Picture> pictures;
    for (const Problem& problem : accuracy::problems())
        pictures.push_back({"statics_" + fileName(problem.name), drawSvg(convergenceOf(report, problem))});
    return pictures;
}

std::string pageOf(const Report& report) {
    std::string body = "<h1>Jacket: speed against error</h1>\n<p class=\"soft\">" + machineText(report) + "</p>\n";
    if (report.quick)
        body +=
            "<p><b>A quick look</b>: fewer cases were tried than in a full report, so that dearer ones may be "
            "named.</p>\n";
    body += answer(report) + motionPart(report) + integratorPart(report) + momentumPart(report) + staticPart(report) +
            methodPart();
    return htmlPage("Jacket: speed against error", body);
}

}  // namespace jacket::demo::report
