#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>

#include "Commands.h"
#include "Run.h"
#include "SceneFile.h"
#include "Sweep.h"

namespace jacket::demo {

namespace {

namespace fs = std::filesystem;

struct SweepOptions {
    std::string scene, out, plan;
    std::vector<std::string> set;
    int which = -1;
    RunOutput output;
};

int makePlan(const SweepOptions& options) {
    SweepPlan plan;
    plan.folder = fs::absolute(options.out).lexically_normal();
    if (!plan.folder.has_filename()) plan.folder = plan.folder.parent_path();
    const fs::path file = findScene(options.scene);
    plan.scene = file == options.scene ? fs::absolute(file).string() : options.scene;  // a bundled one by its name
    for (const std::string& text : options.set) plan.axes.push_back(parseSweepAxis(text));
    for (const SweepAxis& axis : plan.axes)
        if (std::count_if(plan.axes.begin(), plan.axes.end(), [&](const auto& a) { return a.path == axis.path; }) > 1)
            throw InputError("--set " + axis.path + " is given twice; list all its values in one");
    writePlan(plan);
    std::cout << plan.cases() << " cases, planned in " << options.out << ". To run them, one of\n"
              << "  jacket sweep run " << options.out << "\n"
              << "  seq 0 " << plan.cases() - 1 << " | xargs -P 4 -I{} jacket sweep run " << options.out
              << " --case {} --quiet\n"
              << "  sbatch --array=0-" << plan.cases() - 1 << " --wrap='jacket sweep run " << options.out
              << " --case $SLURM_ARRAY_TASK_ID'\n"
              << "and then  jacket sweep collect " << options.out << "\n";
    return kOk;
}

/// What the run of a finished case had returned.
int exitCodeOf(const SweepPlan& plan, int index) {
    const fs::path file = plan.folderOf(index) / "result.json";
    const Json result = parseJson(readText(file), file.string());
    if (!result.value("finite", true)) return kNotFinite;
    return result.value("converged", true) ? kOk : kNotConverged;
}

int runCase(const SweepPlan& plan, int index, const RunOutput& output) {
    if (plan.isDone(index)) {
        if (!output.quiet) std::cerr << "jacket: case " << index << " is finished already\n";
        return exitCodeOf(plan, index);
    }
    SceneChanges changes;
    changes.set = plan.changes(index);
    RunOutput toCase = output;
    toCase.out = plan.folderOf(index).string();
    return runScene(loadScene(findScene(plan.scene), changes), toCase);
}

/// The same; a case that cannot be run is named, and does not keep others from running.
int tryCase(const SweepPlan& plan, int index, const RunOutput& output) {
    const auto report = [&](const std::exception& error, ExitCode code) {
        std::cerr << "jacket: " << plan.label(index) << ": " << error.what() << '\n';
        return code;
    };
    try {
        return runCase(plan, index, output);
    } catch (const InputError& error) {
        return report(error, kBadInput);
    } catch (const std::exception& error) {
        return report(error, kInternalError);
    }
}

int runPlan(SweepOptions options, const CLI::App& command) {
    const SweepPlan plan = readPlan(options.plan);
    options.output.out = plan.folder.string();  // there is a directory to put things in
    checkOutputOptions(command, options.output);
    if (command.count("--case")) {
        if (options.which < 0 || options.which >= plan.cases())
            throw InputError("--case must be 0.." + std::to_string(plan.cases() - 1) + ", got " +
                             std::to_string(options.which));
        return tryCase(plan, options.which, options.output);
    }
    int failure = kOk, worst = kOk;  // of the first case without a result; of results
    for (int k = 0; k < plan.cases(); ++k) {
        const int code = tryCase(plan, k, options.output);
        if (code == kInterrupted) return code;
        const bool hasFailed = code == kBadInput || code == kInternalError;
        if (hasFailed && failure == kOk) failure = code;
        if (!hasFailed) worst = std::max(worst, code);
    }
    return failure == kOk ? worst : failure;
}

int collect(const SweepOptions& options) {
    const SweepPlan plan = readPlan(options.plan);
    std::string missing;
    int count = 0;
    for (int k = 0; k < plan.cases(); ++k)
        if (!plan.isDone(k) && ++count <= 20) missing += (missing.empty() ? "" : ", ") + std::to_string(k);
    if (count == plan.cases()) throw InputError(options.plan + ": no case is finished; run them first");
    if (count > 0)
        std::cerr << "jacket: note: " << count << " of " << plan.cases() << " cases are not finished: " << missing
                  << (count > 20 ? ", ..." : "") << '\n';
    const std::string csv = collectCsv(plan);
    if (options.out.empty())
        std::cout << csv;
    else
        writeText(options.out, csv);
    return kOk;
}

}  // namespace

void addSweepCommand(CLI::App& app, int& exitCode) {
    CLI::App* command = app.add_subcommand("sweep", "Many runs of one scene with different values");
    command->require_subcommand(1);
    auto options = std::make_shared<SweepOptions>();

    CLI::App* plan = command->add_subcommand("plan", "Writes DIR/plan.json: every combination of the values");
    plan->add_option("scene", options->scene, "Name of a bundled scene, or a scene file FILE.json")->required();
    plan->add_option("--set", options->set, "PATH=VALUE,VALUE,...: what the cases differ in; may be repeated")
        ->allow_extra_args(false)
        ->required();
    plan->add_option("--out", options->out, "Directory for the plan and its cases")->required();
    plan->callback([options, &exitCode] { exitCode = makePlan(*options); });

    CLI::App* run = command->add_subcommand("run", "Runs the cases that are not finished");
    run->add_option("plan", options->plan, "DIR or DIR/plan.json")->required();
    run->add_option("--case", options->which, "Only this one, counted from 0");
    addOutputOptions(*run, options->output);
    run->callback([options, run, &exitCode] { exitCode = runPlan(*options, *run); });

    CLI::App* gather = command->add_subcommand("collect", "All results as one CSV table");
    gather->add_option("plan", options->plan, "DIR or DIR/plan.json")->required();
    gather->add_option("--out", options->out, "FILE.csv; printed if not given");
    gather->callback([options, &exitCode] { exitCode = collect(*options); });

    command->footer(
        "Example:\n"
        "  jacket sweep plan trampoline --set shells.0.material.thickness=1e-3,2e-3 --set dt=1/60,1/120 --out out/s\n"
        "  seq 0 3 | xargs -P 2 -I{} jacket sweep run out/s --case {} --quiet\n"
        "  jacket sweep collect out/s --out out/s.csv\n"
        "A case has a directory DIR/case_0000 as `jacket run --out` writes it; what is finished is not run again.");
}

}  // namespace jacket::demo
