#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <optional>

#include "Commands.h"
#include "Pictures.h"
#include "Progress.h"
#include "Recorder.h"
#include "Result.h"
#include "SceneFile.h"

namespace jacket::demo {

namespace {

volatile std::sig_atomic_t interrupted = 0;

struct RunOptions {
    std::string scene, out, dt, seconds, size = "960x720";
    std::vector<std::string> set;
    int seed = 0, every = 0;
    bool quiet = false;
};

double readDuration(const std::string& option, const std::string& text) {
    const auto seconds = parseFraction(text);
    if (!seconds || !(*seconds > 0))
        throw InputError(option + " [s] must be a number > 0 or a fraction such as 1/120, got " + text);
    return *seconds;
}

struct Size {
    int width, height;
};

Size readSize(const std::string& text) {
    Size size{};
    char rest = 0;
    constexpr int kLeast = 16, kMost = 8192;
    const bool isRead = std::sscanf(text.c_str(), "%dx%d%c", &size.width, &size.height, &rest) == 2;
    if (!isRead || std::min(size.width, size.height) < kLeast || std::max(size.width, size.height) > kMost)
        throw InputError("--size must be WIDTHxHEIGHT in pixels, 16..8192 each, got " + text);
    return size;
}

Scene load(const RunOptions& options, const CLI::App& command) {
    SceneChanges changes{.set = options.set, .dt = {}, .seconds = {}, .seed = {}};
    if (!options.dt.empty()) changes.dt = readDuration("--dt", options.dt);
    if (!options.seconds.empty()) changes.seconds = readDuration("--seconds", options.seconds);
    if (command.count("--seed")) changes.seed = options.seed;
    Scene scene = loadScene(findScene(options.scene), changes);
    if (changes.seed && !scene.usesSeed())
        std::cerr << "jacket: note: --seed changes nothing here: no shell of the scene has a \"perturbation\"\n";
    return scene;
}

/// The options that need each other, before anything is built.
void checkOptions(const RunOptions& options, const CLI::App& command) {
    if (command.count("--png") && options.every < 1)
        throw InputError("--png must be >= 1 (a picture every so many frames), got " + std::to_string(options.every));
    if (command.count("--png") && options.out.empty()) throw InputError("--png needs --out DIR to put the pictures in");
    if (command.count("--size") && !command.count("--png"))
        throw InputError("--size needs --png: it is the pictures' size");
    if (command.count("--out")) OutputDirectory::requireFree(options.out);
}

/// Where files and pictures of a run go, if anywhere.
class Output {
  public:
    Output(const RunOptions& options, const World& start) {
        if (options.out.empty()) return;
        m_directory.emplace(options.out);
        m_recorder.emplace(m_directory->folder(), start);
        if (options.every > 0) m_pictures.emplace(start, options.every);
        m_size = readSize(options.size);
    }
    void add(const FrameRecord& frame, const World& world) {
        if (m_recorder) m_recorder->add(frame, world);
        if (m_pictures) m_pictures->add(world, frame.frame);
    }
    void finish(const Json& result, Progress::Style style) {
        if (!m_directory) return;
        m_recorder->finish(result);
        if (m_pictures) {
            Progress progress(std::cerr, style, "pictures", m_pictures->count());
            m_pictures->write(m_directory->folder() / "frames", m_size.width, m_size.height, [&](int drawn) {
                progress.update(drawn);
                return interrupted == 0;
            });
        }
        if (!interrupted) m_directory->commit();
    }

  private:
    std::optional<OutputDirectory> m_directory;
    std::optional<Recorder> m_recorder;
    std::optional<Pictures> m_pictures;
    Size m_size{};
};

/// Steps to the end, or until there is no sense in going on.
void simulate(World& world, Result& result, Output& output, Progress::Style style) {
    const int frames = world.scene().frames();
    Progress progress(std::cerr, style, world.scene().name, frames, world.scene().dt);
    for (int frame = 1; frame <= frames && !interrupted; ++frame) {
        const FrameReport report = world.step();
        const FrameRecord record = measure(world, frame, report);
        result.add(record);
        output.add(record, world);
        progress.update(frame);
        if (!record.isStateFinite) break;
    }
}

int run(const RunOptions& options, const CLI::App& command) {
    checkOptions(options, command);
    readSize(options.size);
    World world(load(options, command));
    Result result(world);
    Output output(options, world);
    std::signal(SIGINT, [](int) { interrupted = 1; });
    std::signal(SIGTERM, [](int) { interrupted = 1; });

    const Progress::Style style = Progress::styleFor(options.quiet);
    simulate(world, result, output, style);
    for (const std::string& warning : world.takeWarnings()) std::cerr << "jacket: note: " << warning << '\n';
    const Json summary = result.json(world);
    output.finish(summary, style);
    if (interrupted) {
        std::cerr << "jacket: interrupted" << (options.out.empty() ? "" : "; nothing was written") << '\n';
        return kInterrupted;
    }
    if (options.out.empty() || !options.quiet) printSummary(std::cout, summary);
    if (!options.out.empty() && !options.quiet) std::cout << "  written to        " << options.out << '\n';
    return result.exitCode();
}

}  // namespace

void addRunCommand(CLI::App& app, int& exitCode) {
    CLI::App* command = app.add_subcommand("run", "Runs a scene");
    auto options = std::make_shared<RunOptions>();
    command->add_option("scene", options->scene, "Name of a bundled scene, or a scene file FILE.json")->required();
    command->add_option("--seconds", options->seconds, "Simulated time [s]");
    command->add_option("--dt", options->dt, "Length of a frame [s], also as a fraction: 1/120");
    command->add_option("--seed", options->seed, "Of the random \"perturbation\" of shells")
        ->check(CLI::NonNegativeNumber);
    command->add_option("--set", options->set, "PATH=VALUE: changes the scene, e.g. shells.0.material.thickness=1e-3")
        ->allow_extra_args(false);
    command->add_option("--out", options->out,
                        "Directory for scene.json, mesh_K.obj, mesh_K.pc2, log.csv, result.json");
    command->add_option("--png", options->every, "EVERY: a picture every so many frames, in DIR/frames");
    command->add_option("--size", options->size, "WIDTHxHEIGHT of the pictures; 960x720 if not given");
    command->add_flag("--quiet", options->quiet, "No progress; with --out nothing at all");
    command->footer(
        "Examples:\n"
        "  jacket run trampoline\n"
        "  jacket run cloth_sphere --set shells.0.bending=quadratic --out out/cloth --png 4\n"
        "  jacket run drape --dt 1/240 --seconds 1 --set 'shells.0.mesh.grid.cells=[40,40]'\n"
        "  jacket run my_scene.json --set shells.sheet.friction=0.1\n"
        "Without --out a summary is printed. An earlier result in DIR is replaced, anything else is not touched.");
    command->callback([options, command, &exitCode] { exitCode = run(*options, *command); });
}

}  // namespace jacket::demo
