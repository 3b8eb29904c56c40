#include <CLI/CLI.hpp>
#include <filesystem>

#include "Commands.h"
#include "Run.h"
#include "SceneFile.h"

namespace jacket::demo {

namespace {

namespace fs = std::filesystem;

struct ResumeOptions {
    std::string seconds;
    RunOutput output;  ///< `out` is also where the earlier run is
};

/// What an earlier run says of its end.
struct Earlier {
    int frames;
    double simulated;  ///< [s]
    std::string state;
};

Earlier readEarlier(const fs::path& folder) {
    const fs::path file = folder / "result.json";
    if (!fs::is_directory(folder)) throw InputError(folder.string() + ": there is no such directory");
    if (!fs::exists(file) || !fs::exists(folder / "scene.json"))
        throw InputError(folder.string() + ": holds no result.json and scene.json, which `jacket run --out` writes");
    const Json result = parseJson(readText(file), file.string());
    const JsonSource source{.file = file.string(), .overrides = {}};
    ObjectReader reader(result, "", source);
    const Earlier earlier{reader.integer("frames", 0), reader.number("simulated_s", Range::nonNegative("s")),
                          reader.text("state", "")};
    if (earlier.state.empty()) reader.fail("state", "is missing: an older version of Jacket wrote this; run it anew");
    if (!reader.flag("finite", true))
        reader.fail("finite", "is false: this run ended in numbers that are none, and cannot go on");
    if (const std::string precision = reader.text("precision", ""); precision != World::precision())
        reader.fail("precision", "is \"" + precision + "\", but this program computes in " + World::precision() +
                                     " precision: use " + (precision == "float" ? "jacket-float" : "jacket"));
    return earlier;
}

int resume(const ResumeOptions& options, const CLI::App& command) {
    checkOutputOptions(command, options.output);
    const fs::path folder = options.output.out;
    const Earlier earlier = readEarlier(folder);
    OutputDirectory::requireFree(folder);
    SceneChanges changes;
    if (!options.seconds.empty()) changes.seconds = readDuration("--seconds", options.seconds);
    const Scene scene = loadScene(folder / "scene.json", changes);
    if (scene.isStatic)
        throw InputError((folder / "scene.json").string() + ": mode is \"static\": there is nothing to go on with");
    if (scene.frames() <= earlier.frames)
        throw InputError((options.seconds.empty() ? "--seconds S is needed" : "--seconds " + options.seconds) +
                         ": the run in " + folder.string() + " is at " + shortNumber(earlier.simulated) +
                         " s already; give the time at which to end, later than that");
    return runScene(scene, options.output, [&](int frame, const World& world) {
        if (frame == earlier.frames && stateHash(world) != earlier.state)
            throw InputError(folder.string() + ": cannot be continued: at " + shortNumber(earlier.simulated) +
                             " s the state is not the one that was written. Another build or machine wrote it, or a "
                             "mesh file has changed; run it anew");
    });
}

}  // namespace

void addResumeCommand(CLI::App& app, int& exitCode) {
    CLI::App* command = app.add_subcommand("resume", "Continues a run to a later time");
    auto options = std::make_shared<ResumeOptions>();
    command
        ->add_option("dir", options->output.out,
                     "Directory that `jacket run --out DIR` wrote; it is replaced, if nothing else is in it")
        ->required();
    command->add_option("--seconds", options->seconds, "Simulated time at which to end [s], later than DIR's");
    addOutputOptions(*command, options->output);
    command->footer(
        "Example:  jacket run trampoline --seconds 1 --out out/t && jacket resume out/t --seconds 3\n"
        "The result is that of one long run, to the last bit: the run is computed again from its scene.json, compared\n"
        "with DIR's state where that ended, and goes on from there. So it takes as long as the long run.");
    command->callback([options, command, &exitCode] { exitCode = resume(*options, *command); });
}

}  // namespace jacket::demo
