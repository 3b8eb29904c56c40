#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "accuracy/Motion.h"
#include "report/Html.h"
#include "report/Pareto.h"
#include "report/Svg.h"

namespace jacket::demo {
namespace {

using report::Trial;

TEST(ReportTest, ParetoFrontHoldsWhatNothingBeatsByRisingCost) {
    const std::vector<Trial> trials{{"a", {1}, 0.10, 1.0},
                                    {"a", {2}, 0.20, 2.0},  // dearer and worse than the first
                                    {"a", {3}, 0.01, 5.0},
                                    {"b", {1}, 0.05, 3.0},
                                    {"b", {2}, std::numeric_limits<double>::infinity(), 0.1}};
    EXPECT_EQ(report::paretoFront(trials), (std::vector{0, 3, 2}));
    EXPECT_TRUE(report::paretoFront({}).empty());
}

TEST(ReportTest, CheapestIsNotOneWhoseErrorsCancelByChance) {
    const std::vector<Trial> trials{{"a", {10, 60}, 0.001, 1.0},  // its finer neighbour is worse
                                    {"a", {20, 60}, 0.020, 2.0},
                                    {"a", {20, 240}, 0.004, 8.0},
                                    {"b", {10, 60}, 0.030, 0.5}};
    EXPECT_DOUBLE_EQ(report::reliableError(trials, 0), 0.020);
    EXPECT_EQ(report::cheapestWithin(trials, 0.10), 3);
    EXPECT_EQ(report::cheapestWithin(trials, 0.025), 0);
    EXPECT_EQ(report::cheapestWithin(trials, 0.01), 2);
    EXPECT_EQ(report::cheapestWithin(trials, 0.001), -1);
    EXPECT_EQ(report::mostExact(trials), 2);
    EXPECT_EQ(report::mostExact({}), -1);
}

TEST(ReportTest, AFinerTrialWithoutResultTakesItsFamilyOut) {
    const std::vector<Trial> trials{{"a", {10}, 0.01, 1.0}, {"a", {20}, std::numeric_limits<double>::infinity(), 2.0}};
    EXPECT_EQ(report::cheapestWithin(trials, 0.1), -1);
}

TEST(ReportTest, LogarithmicTicksAreFewAndInside) {
    const auto near = [](const std::vector<double>& got, const std::vector<double>& wanted) {
        ASSERT_EQ(got.size(), wanted.size());
        for (std::size_t i = 0; i < got.size(); ++i) EXPECT_NEAR(got[i], wanted[i], 1e-9 * wanted[i]);
    };
    near(report::logTicks(0.015, 0.6), {0.02, 0.05, 0.1, 0.2, 0.5});
    near(report::logTicks(1.0, 10.0), {1, 2, 5, 10});
    near(report::logTicks(0.5e-4, 2.0), {1e-4, 1e-3, 1e-2, 1e-1, 1});
}

TEST(ReportTest, RangesHoldTheirValuesAndAreNeverEmpty) {
    for (const std::vector<double>& values : {std::vector{3.0}, std::vector{1e-3, 20.0}, std::vector<double>{}}) {
        const report::LogRange range = report::logRangeOf(values);
        EXPECT_GT(range.high / range.low, 1.5);
        for (const double value : values) EXPECT_TRUE(range.low < value && value < range.high);
    }
}

TEST(ReportTest, NumbersAreWrittenForPeople) {
    EXPECT_EQ(report::percent(0.003), "0.3 %");
    EXPECT_EQ(report::percent(44.6), "4460 %");
    EXPECT_EQ(report::duration(0.0000123), "12.3 us");
    EXPECT_EQ(report::duration(0.25), "250 ms");
    EXPECT_EQ(report::duration(0.9999), "1 s");
    EXPECT_EQ(report::escaped("a < b & \"c\""), "a &lt; b &amp; &quot;c&quot;");
}

TEST(ReportTest, APlotLeavesOutWhatALogarithmCannotShow) {
    report::Plot plot;
    plot.title = "a < b";
    plot.series.push_back(
        {.name = "s",
         .colour = "#123456",
         .markers = {{1, 0.1, "seen", false}, {2, 0.0, "zero", false}, {3, std::nan(""), "none", false}},
         .dash = {}});
    const std::string svg = report::drawSvg(plot);
    EXPECT_NE(svg.find("seen"), std::string::npos);
    EXPECT_EQ(svg.find("zero"), std::string::npos);
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    EXPECT_EQ(svg.find("a < b"), std::string::npos);
}

TEST(ReportTest, TablesSetNumbersFlushRight) {
    const std::string html = report::toHtml({{"name", "#size"}, {{"x", "3"}}, ""});
    EXPECT_NE(html.find("<th class=\"number\">size</th>"), std::string::npos);
    EXPECT_NE(html.find("<td>x</td><td class=\"number\">3</td>"), std::string::npos);
}

/// Figures of an independent computation: both methods on x'' = -w^2 x, roots found by iteration.
TEST(ReportTest, TheoryOfIntegratorsAgreesWithAnIndependentComputation) {
    struct Figure {
        Integrator integrator;
        double steps, left, ratio;
    };
    for (const Figure& f : {Figure{Integrator::BackwardEuler, 10, 0.15514466, 1.12003309},
                            Figure{Integrator::BackwardEuler, 100, 0.82097514, 1.00131456},
                            Figure{Integrator::Bdf2, 10, 0.80549018, 1.10206066},
                            Figure{Integrator::Bdf2, 100, 0.99961374, 1.00131071}}) {
        const auto theory = accuracy::vibrationInTheory(f.integrator, f.steps);
        EXPECT_NEAR(theory.amplitudeLeft, f.left, 1e-7);
        EXPECT_NEAR(theory.periodRatio, f.ratio, 1e-7);
    }
}

TEST(ReportTest, IntegratorsDampAVibrationAsTheorySays) {
    for (const Integrator integrator : {Integrator::BackwardEuler, Integrator::Newton, Integrator::Bdf2}) {
        const auto theory = accuracy::vibrationInTheory(integrator, 24);
        const auto measured = accuracy::vibrationMeasured(integrator, 24);
        EXPECT_NEAR(measured.amplitudeLeft, theory.amplitudeLeft, 2e-3);
        EXPECT_NEAR(measured.periodRatio, theory.periodRatio, 1e-3);
    }
}

}  // namespace
}  // namespace jacket::demo
