#include "Svg.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace jacket::demo::report {

namespace {

constexpr double kWidth = 720, kHeight = 400, kLeft = 66, kRight = 190, kTop = 34, kBottom = 50;

template <class... Args>
std::string format(const char* pattern, Args... args) {
    char text[512];
    std::snprintf(text, sizeof text, pattern, args...);
    return text;
}

bool isDrawable(double value) {
    return std::isfinite(value) && value > 0;
}

std::string tickText(double value, AxisUnit unit) {
    return unit == AxisUnit::Percent   ? percent(value)
           : unit == AxisUnit::Seconds ? duration(value)
                                       : format("%g", value);
}

struct Axes {
    LogRange x, y;

    double left(double value) const {
        return kLeft + (kWidth - kLeft - kRight) * std::log(value / x.low) / std::log(x.high / x.low);
    }
    double top(double value) const {
        return kHeight - kBottom - (kHeight - kTop - kBottom) * std::log(value / y.low) / std::log(y.high / y.low);
    }
};

Axes axesOf(const Plot& plot) {
    std::vector<double> xs, ys;
    for (const Series& series : plot.series)
        for (const Marker& marker : series.markers)
            if (isDrawable(marker.x) && isDrawable(marker.y)) {
                xs.push_back(marker.x);
                ys.push_back(marker.y);
            }
    if (plot.target) ys.push_back(*plot.target);
    return {logRangeOf(xs), logRangeOf(ys)};
}

std::string drawGrid(const Plot& plot, const Axes& axes) {
    const double right = kWidth - kRight, bottom = kHeight - kBottom;
    std::string svg = "<g stroke=\"currentColor\" stroke-opacity=\".15\">";
    std::string texts = "<g fill=\"currentColor\" font-size=\"12\">";
    for (const double x : logTicks(axes.x.low, axes.x.high)) {
        svg += format("<path d=\"M%.1f %.1fV%.1f\"/>", axes.left(x), kTop, bottom);
        texts += format("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>", axes.left(x), bottom + 17,
                        tickText(x, plot.xUnit).c_str());
    }
    for (const double y : logTicks(axes.y.low, axes.y.high)) {
        svg += format("<path d=\"M%.1f %.1fH%.1f\"/>", kLeft, axes.top(y), right);
        texts += format("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s</text>", kLeft - 7, axes.top(y) + 4,
                        tickText(y, plot.yUnit).c_str());
    }
    svg += format("<path d=\"M%.1f %.1fV%.1fH%.1f\" fill=\"none\" stroke-opacity=\".6\"/></g>", kLeft, kTop, bottom,
                  right);
    const double middle = 0.5 * (kTop + bottom);
    texts += "<text x=\"" + format("%.1f", 0.5 * (kLeft + right)) + "\" y=\"" + format("%.1f", kHeight - 12) +
             "\" text-anchor=\"middle\">" + escaped(plot.xLabel) + "</text>";
    texts += format("<text transform=\"translate(15 %.1f) rotate(-90)\" text-anchor=\"middle\">", middle) +
             escaped(plot.yLabel) + "</text>";
    texts += format("<text x=\"%.1f\" y=\"20\" font-size=\"14\" font-weight=\"600\">", kLeft) + escaped(plot.title) +
             "</text></g>";
    return svg + texts;
}

/// Around (0, 0).
const char* outlineOf(MarkerShape shape) {
    switch (shape) {
        case MarkerShape::Square:
            return "M-4-4H4V4H-4Z";
        case MarkerShape::Triangle:
            return "M0-5L4.6 3.6H-4.6Z";
        case MarkerShape::Diamond:
            return "M0-5.6L5.6 0L0 5.6L-5.6 0Z";
        case MarkerShape::Circle:
            break;
    }
    return "M-4.4 0A4.4 4.4 0 1 1 4.4 0A4.4 4.4 0 1 1-4.4 0Z";
}

std::string drawSeries(const Series& series, const Axes& axes, bool fadesRest) {
    std::string line, dots;
    for (const Marker& marker : series.markers) {
        if (!isDrawable(marker.x) || !isDrawable(marker.y)) continue;
        const double x = axes.left(marker.x), y = axes.top(marker.y);
        line += format("%s%.1f %.1f", line.empty() ? "M" : "L", x, y);
        const bool isFaint = fadesRest && !marker.isOnFront;
        dots += format("<path transform=\"translate(%.1f %.1f)\" d=\"%s\"", x, y, outlineOf(series.shape));
        dots += isFaint ? " fill-opacity=\".28\" stroke-opacity=\".5\"" : "";
        dots += "><title>" + escaped(marker.title) + "</title></path>";
    }
    std::string svg = "<g fill=\"" + series.colour + "\" stroke=\"" + series.colour + "\">";
    if (series.isJoined && !line.empty())
        svg += "<path d=\"" + line + "\" fill=\"none\" stroke-width=\"1.6\"" +
               (series.dash.empty() ? "" : " stroke-dasharray=\"" + series.dash + "\"") + "/>";
    return svg + dots + "</g>";
}

std::string drawLegend(const Plot& plot) {
    std::string svg = "<g font-size=\"12\">";
    double y = kTop + 8;
    const double x = kWidth - kRight + 16;
    const auto entry = [&](const std::string& mark, const std::string& name) {
        svg += format("<g transform=\"translate(%.1f %.1f)\">", x, y) + mark +
               "<text x=\"18\" y=\"4\" fill=\"currentColor\">" + escaped(name) + "</text></g>";
        y += 18;
    };
    for (const Series& series : plot.series) {
        if (series.name.empty()) continue;
        const std::string paint = "fill=\"" + series.colour + "\" stroke=\"" + series.colour + "\"";
        std::string mark = "<path " + paint + " d=\"" + outlineOf(series.shape) + "\"/>";
        if (series.isJoined)
            mark += "<path " + paint + " stroke-width=\"1.6\" stroke-dasharray=\"" +
                    (series.dash.empty() ? "none" : series.dash) + "\" d=\"M-12 0H12\"/>";
        entry(mark, series.name);
    }
    if (!plot.front.empty())
        entry("<path stroke=\"currentColor\" stroke-width=\"1.4\" fill=\"none\" d=\"M-9-5H0V5H9\"/>", "Pareto front");
    if (plot.target) entry("<path stroke=\"currentColor\" stroke-dasharray=\"2 3\" d=\"M-12 0H12\"/>", "target");
    return svg + "</g>";
}

std::string drawFront(const Plot& plot, const Axes& axes) {
    std::string path;
    for (const auto& [x, y] : plot.front) {
        if (!isDrawable(x) || !isDrawable(y)) continue;
        path += path.empty() ? format("M%.1f %.1f", axes.left(x), axes.top(y))
                             : format("H%.1fV%.1f", axes.left(x), axes.top(y));
    }
    return path.empty() ? "" : "<path fill=\"none\" stroke=\"currentColor\" stroke-width=\"1.4\" d=\"" + path + "\"/>";
}

}  // namespace

std::string escaped(const std::string& text) {
    std::string result;
    for (const char c : text) {
        if (c == '<')
            result += "&lt;";
        else if (c == '>')
            result += "&gt;";
        else if (c == '&')
            result += "&amp;";
        else if (c == '"')
            result += "&quot;";
        else
            result += c;
    }
    return result;
}

std::vector<double> logTicks(double low, double high) {
    constexpr double kDecadesWithParts = 2.6;  // more would run into each other
    const bool hasParts = std::log10(high / low) < kDecadesWithParts;
    std::vector<double> ticks;
    for (int decade = static_cast<int>(std::floor(std::log10(low))) - 1; std::pow(10.0, decade) <= high; ++decade)
        for (const double part : {1.0, 2.0, 5.0}) {
            const double tick = part * std::pow(10.0, decade);
            const bool isInside = tick >= low * (1 - 1e-9) && tick <= high * (1 + 1e-9);
            if (isInside && (hasParts || part == 1.0)) ticks.push_back(tick);
        }
    return ticks;
}

LogRange logRangeOf(const std::vector<double>& values) {
    double low = 1.0, high = 1.0;
    if (!values.empty()) {
        low = *std::min_element(values.begin(), values.end());
        high = *std::max_element(values.begin(), values.end());
    }
    constexpr double kMargin = 1.25, kLeastSpan = 6.0;
    const double grow = std::max(kMargin, std::sqrt(kLeastSpan / (high / low)));
    return {low / grow, high * grow};
}

std::string percent(double part) {
    return 100 * part < 999.5 ? format("%.3g %%", 100 * part) : format("%.0f %%", 100 * part);
}

std::string duration(double seconds) {
    if (seconds < 1e-3 * 0.9995) return format("%.3g us", 1e6 * seconds);
    if (seconds < 0.9995) return format("%.3g ms", 1e3 * seconds);
    return format("%.3g s", seconds);
}

std::string drawSvg(const Plot& plot) {
    const Axes axes = axesOf(plot);
    std::string svg =
        format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %g %g\" font-family=\"system-ui, sans-serif\" ",
               kWidth, kHeight);
    svg += "role=\"img\" aria-label=\"" + escaped(plot.title) + "\">";
    svg += drawGrid(plot, axes);
    if (plot.target)
        svg += format("<path stroke=\"currentColor\" stroke-dasharray=\"2 3\" d=\"M%.1f %.1fH%.1f\"/>", kLeft,
                      axes.top(*plot.target), kWidth - kRight);
    svg += drawFront(plot, axes);
    for (const Series& series : plot.series) svg += drawSeries(series, axes, plot.fadesRest);
    return svg + drawLegend(plot) + "</svg>\n";
}

}  // namespace jacket::demo::report
