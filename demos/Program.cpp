#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>

#include "Commands.h"
#include "Result.h"

namespace jacket::demo {

namespace {

constexpr const char* kExamples =
    "Examples:\n"
    "  jacket list                                              what there is to run\n"
    "  jacket run trampoline                                    a ball falls onto a sheet; prints what happened\n"
    "  jacket run cloth_sphere --out out/cloth --png 4          the same kind of thing, with files and pictures\n"
    "  jacket run drape --seconds 1 --dt 1/240 --set 'shells.0.mesh.grid.cells=[40,40]'\n"
    "  jacket run my_scene.json --set shells.sheet.material.thickness=2e-3\n"
    "  jacket resume out/cloth --seconds 8                      the same run, longer\n"
    "  jacket bench --sizes 31,101                              milliseconds and strains beside btSoftBody\n"
    "  jacket sweep plan drape --set shells.0.friction=0.1,0.3 --out out/sweep\n"
    "  jacket check hood.obj                                    what is wrong with a mesh\n"
    "  jacket material denim                                    what a preset means\n"
    "  jacket report --quick --out out/report                   which settings are cheapest for an error\n"
    "\n"
    "Exit codes: 0 ok, 2 bad input, 3 not converged, 4 not finite.";

/// The command that was being read.
const CLI::App& parsed(const CLI::App& app) {
    const auto used = app.get_subcommands();
    return used.empty() ? app : parsed(*used.front());
}

/// What would have been right: the option that a misspelt one resembles, or what one with a bad value is for.
std::string hint(const CLI::App& command, const CLI::ParseError& error) {
    const std::string message = error.what();
    std::vector<std::string> names;
    for (const CLI::Option* option : command.get_options()) {
        const std::string name = option->get_name();
        names.push_back(name);
        if (message.find(name + " ") != std::string::npos || message.starts_with(name + ":"))
            return "; " + name + ": " + option->get_description();
    }
    const auto word = message.rfind("--");
    if (error.get_exit_code() != static_cast<int>(CLI::ExitCodes::ExtrasError) || word == std::string::npos) return "";
    return suggestion(message.substr(word, message.find_first_of(" =", word) - word), names);
}

/// CLI11 wants its mistakes printed by itself; ours are short.
int reportUsage(const CLI::App& app, const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    std::cerr << "jacket: " << error.what() << hint(parsed(app), error)
              << "\nRun \"jacket --help\" or \"jacket COMMAND --help\" for what can be given.\n";
    return kBadInput;
}

/// A misspelt command, or a misspelt part of one such as `sweep`; CLI11 would say that one is required.
void checkCommand(const CLI::App& app, int argc, const char* const* argv, int at = 1) {
    const std::vector<const CLI::App*> commands = app.get_subcommands([](const CLI::App*) { return true; });
    if (commands.empty() || argc <= at || argv[at][0] == '-') return;
    std::vector<std::string> names;
    for (const CLI::App* command : commands) {
        if (command->get_name() == argv[at]) return checkCommand(*command, argc, argv, at + 1);
        names.push_back(command->get_name());
    }
    throw InputError("there is no command \"" + (at == 1 ? "" : app.get_name() + " ") + argv[at] + "\"" +
                     suggestion(argv[at], names));
}

}  // namespace

int runProgram(int argc, const char* const* argv) {
    int exitCode = kOk;
    CLI::App app("jacket: thin shells in Bullet's worlds", "jacket");
    app.set_version_flag("--version", "jacket " JACKET_VERSION " (Bullet " + World::bulletVersion() + ", " +
                                          World::precision() + " precision)");
    app.require_subcommand(1);
    app.footer(kExamples);
    try {
        addListCommand(app, exitCode);
        addRunCommand(app, exitCode);
        addResumeCommand(app, exitCode);
        addBenchCommand(app, exitCode);
        addSweepCommand(app, exitCode);
        addCheckCommand(app, exitCode);
        addMaterialCommand(app, exitCode);
        addReportCommand(app, exitCode);
        checkCommand(app, argc, argv);
        app.parse(argc, argv);
        return exitCode;
    } catch (const CLI::ParseError& error) {
        return reportUsage(app, error);
    } catch (const InputError& error) {
        std::cerr << "jacket: " << error.what() << '\n';
        return kBadInput;
    } catch (const std::exception& error) {
        std::cerr << "jacket: " << error.what() << '\n';
        return kInternalError;
    }
}

}  // namespace jacket::demo
