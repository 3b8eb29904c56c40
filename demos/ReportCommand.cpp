#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <optional>

#include "Commands.h"
#include "Interrupt.h"
#include "Progress.h"
#include "Recorder.h"
#include "Result.h"
#include "report/Page.h"
#include "report/Tables.h"

namespace jacket::demo {

namespace {

namespace fs = std::filesystem;

constexpr OutputKind kReportOutput{
    "report.json",
    R"(index\.html|report\.json|(statics|motion|integrators|momentum|cheapest_motion|cheapest_statics)\.csv|)"
    R"(plots(/(motion|statics)_[^/]*\.svg)?)"};

struct ReportOptions {
    std::string out;
    bool quick = false, reference = false, quiet = false;
};

void writePictures(const fs::path& folder, const std::vector<report::Picture>& pictures) {
    for (const report::Picture& picture : pictures) writeText(folder / (picture.name + ".svg"), picture.svg);
}

void writeReport(const fs::path& folder, const report::Report& result) {
    writeText(folder / kReportOutput.marker, report::toJson(result).dump(1) + '\n');
    writeText(folder / "statics.csv", report::staticsCsv(result));
    writeText(folder / "motion.csv", report::motionCsv(result));
    writeText(folder / "integrators.csv", report::integratorsCsv(result));
    writeText(folder / "momentum.csv", report::momentumCsv(result));
    writeText(folder / "cheapest_motion.csv", report::cheapestMotionCsv(result));
    writeText(folder / "cheapest_statics.csv", report::cheapestStaticsCsv(result));
    const fs::path plots = folder / "plots";
    fs::create_directory(plots);
    writePictures(plots, report::motionPictures(result));
    writePictures(plots, report::staticPictures(result));
    writeText(folder / "index.html", report::pageOf(result));
}

int printReferences(const ReportOptions& options) {
    std::cerr << "jacket: computing references; this takes minutes\n";
    const std::string lines = accuracy::computeReferences([](int, int) { return !isInterrupted(); });
    if (isInterrupted()) return endInterrupted(!options.out.empty());
    std::cout << lines;
    return kOk;
}

int makeReport(const ReportOptions& options) {
    std::optional<OutputDirectory> directory;
    if (!options.out.empty()) directory.emplace(options.out, kReportOutput);
    std::optional<Progress> progress;  // its number of items is known only once there is one
    const report::Report result = report::makeReport(options.quick, [&](int done, int all) {
        if (!progress) progress.emplace(std::cerr, Progress::styleFor(options.quiet), "report", all);
        progress->update(done);
        return !isInterrupted();
    });
    progress.reset();
    if (isInterrupted()) return endInterrupted(!options.out.empty());
    if (directory) {
        writeReport(directory->folder(), result);
        directory->commit();
    }
    if (!directory || !options.quiet) report::printCheapest(std::cout, result);
    if (directory && !options.quiet)
        std::cout << "Tables and plots: " << (fs::path(options.out) / "index.html").string() << '\n';
    return kOk;
}

}  // namespace

void addReportCommand(CLI::App& app, int& exitCode) {
    CLI::App* command = app.add_subcommand("report", "Speed against error: which settings are cheapest for an error");
    auto options = std::make_shared<ReportOptions>();
    command->add_option("--out", options->out, "Directory for index.html, report.json, tables (CSV) and plots (SVG)");
    command->add_flag("--quick", options->quick, "Fewer cases: about a minute");
    command->add_flag("--quiet", options->quiet, "No progress; with --out nothing at all");
    command->add_flag("--reference", options->reference,
                      "Computes anew, and prints, the stored references of motions; for developers");
    command->footer("Example:  jacket report --quick --out out/report");
    command->callback([options, command, &exitCode] {
        if (command->count("--out")) OutputDirectory::requireFree(options->out, kReportOutput);
        catchInterrupts();
        exitCode = options->reference ? printReferences(*options) : makeReport(*options);
    });
}

}  // namespace jacket::demo
