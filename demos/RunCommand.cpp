#include <CLI/CLI.hpp>
#include <iostream>

#include "Commands.h"
#include "Run.h"
#include "SceneFile.h"

namespace jacket::demo {

namespace {

struct RunOptions {
    std::string scene, dt, seconds;
    std::vector<std::string> set;
    int seed = 0;
    RunOutput output;
};

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

int run(const RunOptions& options, const CLI::App& command) {
    checkOutputOptions(command, options.output);
    if (command.count("--out")) OutputDirectory::requireFree(options.output.out);
    return runScene(load(options, command), options.output);
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
    command->add_option("--out", options->output.out,
                        "Directory for scene.json, mesh_K.obj, mesh_K.pc2, log.csv, result.json");
    addOutputOptions(*command, options->output);
    command->footer(
        "Examples:\n"
        "  jacket run trampoline\n"
        "  jacket run cloth_sphere --set shells.0.bending=quadratic --out out/cloth --png 4 --html\n"
        "  jacket run drape --dt 1/240 --seconds 1 --set 'shells.0.mesh.grid.cells=[40,40]' --profile\n"
        "  jacket run my_scene.json --set shells.sheet.friction=0.1\n"
        "Without --out a summary is printed. An earlier result in DIR is replaced; a DIR that holds anything\n"
        "else, also beside such a result, is refused.");
    command->callback([options, command, &exitCode] { exitCode = run(*options, *command); });
}

}  // namespace jacket::demo
