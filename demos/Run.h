#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "Recorder.h"
#include "Result.h"

/// Running one scene to its end, with all its files: what `run`, `resume` and `sweep run` have in common.
namespace jacket::demo {

/// What a run leaves behind besides its end.
struct RunOutput {
    std::string out;               ///< directory; "": no files
    int pictureEvery = 0;          ///< frames; 0: no pictures
    std::string size = "960x720";  ///< of the pictures [pixels]
    int threads = 1;
    bool html = false, glb = false, profile = false, quiet = false;
};

/// Options --png, --size, --html, --glb, --profile, --threads and --quiet of a command.
void addOutputOptions(CLI::App& command, RunOutput& output);
/// Those that need each other, before anything is built; throws InputError.
void checkOutputOptions(const CLI::App& command, const RunOutput& output);

/// Returns the exit code. `afterFrame`, if given, is called after each frame and may throw, which ends the run without
/// files.
int runScene(const Scene& scene, const RunOutput& output,
             const std::function<void(int frame, const World&)>& afterFrame = {});

/// Throws InputError when that is no number of threads to solve with.
void requireThreads(int threads);

/// A duration that the user gave: a number or a fraction, > 0 [s]. Throws InputError naming the option.
double readDuration(const std::string& option, const std::string& text);

}  // namespace jacket::demo
