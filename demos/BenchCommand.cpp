#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <optional>

#include "Commands.h"
#include "Progress.h"
#include "Run.h"
#include "bench/Bench.h"

namespace jacket::demo {

namespace {

namespace fs = std::filesystem;

struct BenchOptions {
    bench::Options what;
    std::string json, growth, seconds;
    int substeps = 1;
    bool markdown = false, quiet = false;
};

/// A file that cannot be written should be known before minutes of measuring.
void requireFolderOf(const std::string& option, const fs::path& file) {
    const fs::path folder = file.has_parent_path() ? file.parent_path() : ".";
    if (!file.has_filename() || !fs::is_directory(folder))
        throw InputError(option + " " + file.string() + ": there is no directory " + folder.string());
}

bench::Options read(const BenchOptions& options, const CLI::App& command) {
    bench::Options what = options.what;
    for (const int n : what.sizes)
        if (n < 2 || n > 4000)
            throw InputError("--sizes must be vertices along a side, each 2..4000, got " + std::to_string(n));
    if (what.repeat < 1) throw InputError("--repeat must be >= 1, got " + std::to_string(what.repeat));
    if (command.count("--substeps")) {
        if (options.substeps < 1) throw InputError("--substeps must be >= 1, got " + std::to_string(options.substeps));
        what.substeps = options.substeps;
    }
    requireThreads(what.threads);
    if (!options.seconds.empty()) what.seconds = readDuration("--seconds", options.seconds);
    if (!options.json.empty()) requireFolderOf("--json", options.json);
    if (options.growth.empty()) return what;
    requireFolderOf("--growth", options.growth);
    what.withSoftBody = false;
    if (!command.count("--repeat")) what.repeat = 1;
    if (!command.count("--sizes")) what.sizes = {11, 21, 31, 51, 71, 101, 141, 201, 317, 501, 1001};
    constexpr double kSwing = 0.6;  // onto the sphere; all four seconds would take an hour
    if (!what.seconds) what.seconds = kSwing;
    return what;
}

void measureAndWrite(const BenchOptions& options, const CLI::App& command) {
    const bench::Options what = read(options, command);
    std::optional<Progress> progress;
    const bench::Bench result = bench::run(what, [&](int done, int all) {
        if (!progress) progress.emplace(std::cerr, Progress::styleFor(options.quiet), "bench", all);
        progress->update(done);
    });
    progress.reset();
    if (!options.json.empty()) writeText(options.json, toJson(result).dump(2) + "\n");
    if (!options.growth.empty()) writeText(options.growth, growthPlots(result));
    if (!options.quiet || options.json.empty())
        std::cout << (options.markdown ? bench::markdown(result) : bench::table(result));
}

}  // namespace

void addBenchCommand(CLI::App& app, int& exitCode) {
    CLI::App* command = app.add_subcommand("bench", "Times, strains and penetration beside btSoftBody's");
    auto options = std::make_shared<BenchOptions>();
    command->add_option("--scene", options->what.scene, "A scene with one shell, of a grid; drape if not given");
    command->add_option("--sizes", options->what.sizes, "Vertices along a side; 11,31,71,101 if not given")
        ->delimiter(',');
    command->add_option("--repeat", options->what.repeat, "Runs of each solver, in turn; 3 if not given");
    command->add_option("--substeps", options->substeps, "Steps a frame, of both; the scene's if not given");
    command->add_option("--seconds", options->seconds, "Simulated time [s]; the scene's if not given");
    command->add_option("--threads", options->what.threads,
                        "Threads that share Jacket's solve; above 1 wall time is measured. 1 if not given");
    command->add_option("--json", options->json, "FILE for the figures");
    command->add_option("--growth", options->growth,
                        "FILE.svg: Jacket alone, from 11 to 1001 vertices a side; plots time, iterations and memory");
    command->add_flag("--markdown", options->markdown, "Prints the table as Markdown");
    command->add_flag("--quiet", options->quiet, "No progress; with --json nothing at all");
    command->footer(
        "Examples:\n"
        "  jacket bench                                     takes minutes; run nothing else meanwhile\n"
        "  jacket bench --sizes 31 --substeps 2 --json out/bench.json\n"
        "  jacket bench --growth out/growth.svg --seconds 0.25");
    command->callback([options, command, &exitCode] {
        measureAndWrite(*options, *command);
        exitCode = 0;
    });
}

}  // namespace jacket::demo
