#pragma once
#include <CLI/CLI.hpp>
#include <functional>

namespace jacket::demo {

/// Each adds its subcommand; `exitCode` receives what the program returns when that subcommand was given.
void addListCommand(CLI::App& app, int& exitCode);
void addRunCommand(CLI::App& app, int& exitCode);
void addResumeCommand(CLI::App& app, int& exitCode);
void addBenchCommand(CLI::App& app, int& exitCode);
void addSweepCommand(CLI::App& app, int& exitCode);
void addCheckCommand(CLI::App& app, int& exitCode);
void addMaterialCommand(CLI::App& app, int& exitCode);
void addReportCommand(CLI::App& app, int& exitCode);

/// The whole program; never throws.
int runProgram(int argc, const char* const* argv);

}  // namespace jacket::demo
