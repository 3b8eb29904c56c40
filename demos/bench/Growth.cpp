#include <cstdio>
#include <functional>

#include "Bench.h"
#include "report/Svg.h"

namespace jacket::demo::bench {

namespace {

report::Plot plotOf(const Bench& bench, const std::string& title, const std::string& yLabel, report::AxisUnit unit,
                    const std::function<double(const Row&)>& value) {
    report::Plot plot;
    plot.title = title;
    plot.xLabel = "vertices";
    plot.yLabel = yLabel;
    plot.yUnit = unit;
    report::Series series;
    series.name = "jacket";
    series.colour = "#3f7fbf";
    series.isJoined = true;
    for (const Row& row : bench.rows) {
        if (row.solver != "jacket") continue;
        char text[96];
        std::snprintf(text, sizeof text, "%d x %d vertices: %.4g", row.n, row.vertices / row.n, value(row));
        series.markers.push_back({.x = double(row.vertices), .y = value(row), .title = text});
    }
    plot.series.push_back(series);
    return plot;
}

}  // namespace

std::string growthPlots(const Bench& bench) {
    using report::AxisUnit;
    constexpr int kWidth = 720, kHeight = 400;  // of one plot
    const report::Plot plots[] = {
        plotOf(bench, bench.scene + ": CPU time per vertex and step", "time", AxisUnit::Seconds,
               [&](const Row& row) { return 1e-3 * row.msMedian / bench.substeps / row.vertices; }),
        plotOf(bench, "iterations of a step", "iterations", AxisUnit::Number,
               [](const Row& row) { return row.iterations; }),
        plotOf(bench, "memory per vertex, some 7 MB of pools of Bullet's included", "kB", AxisUnit::Number,
               [](const Row& row) { return 1024 * row.rssMb / row.vertices; })};
    std::string svg =
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 720 1200\" color=\"#1d2125\">"
        "<rect width=\"720\" height=\"1200\" fill=\"#fff\"/>";
    int top = 0;
    for (const report::Plot& plot : plots) {
        svg += "<svg y=\"" + std::to_string(top) + "\" width=\"" + std::to_string(kWidth) + "\" height=\"" +
               std::to_string(kHeight) + "\">" + report::drawSvg(plot) + "</svg>";
        top += kHeight;
    }
    return svg + "</svg>\n";
}

}  // namespace jacket::demo::bench
