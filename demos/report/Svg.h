#pragma once
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace jacket::demo::report {

/// "<", ">", "&" and quotes as XML and HTML spell them.
std::string escaped(const std::string& text);

/// Where a logarithmic axis from `low` to `high` (both > 0) has its marks: 1, 2 and 5 of each decade where that is few
/// enough to read, else the decades alone. The marks lie within the range.
std::vector<double> logTicks(double low, double high);

/// A length that both axes of a plot are made of; rounded outward so that a decade's worth is always seen.
struct LogRange {
    double low, high;
};
LogRange logRangeOf(const std::vector<double>& values);

/// 0.05 as "5 %", 0.0002 as "200 us".
std::string percent(double part);
std::string duration(double seconds);

/// How an axis writes its marks.
enum class AxisUnit { Number, Percent, Seconds };

struct Marker {
    double x = 0.0, y = 0.0;
    std::string title;       ///< shown while the pointer is over it
    bool isOnFront = false;  ///< drawn whole, the others faint
};

enum class MarkerShape { Circle, Square, Triangle, Diamond };

struct Series {
    std::string name, colour;
    MarkerShape shape = MarkerShape::Circle;
    std::vector<Marker> markers;
    bool isJoined = false;  ///< by lines, in the order given
    std::string dash;       ///< of that line, as stroke-dasharray; "": whole
};

/// A plot with two logarithmic axes.
struct Plot {
    std::string title, xLabel, yLabel;
    AxisUnit xUnit = AxisUnit::Number, yUnit = AxisUnit::Percent;
    std::vector<Series> series;
    std::vector<std::pair<double, double>> front;  ///< a staircase is drawn through these, by rising x
    std::optional<double> target;                  ///< a horizontal line
    bool fadesRest = false;                        ///< markers that are not on the front are faint
};

/// As an SVG image that takes the colour of its text from around it; values that are not > 0 and finite are left out.
std::string drawSvg(const Plot& plot);

}  // namespace jacket::demo::report
