#include <gtest/gtest.h>
#include <sys/time.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <sstream>
#include <vector>

#include "Interrupt.h"
#include "Json.h"
#include "RunProgram.h"
#include "SceneFile.h"
#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFallingSheet = R"({
    "seconds": 0.1, "gravity": [0, -10, 0],
    "shells": [ { "name": "sheet", "mesh": { "grid": { "size": [1, 1], "cells": [3, 3] } },
                  "material": { "young": 1e6, "thickness": 1e-3, "density": 1000 } } ],
    "probes": [ { "name": "fall", "shell": "sheet", "quantity": "max_displacement" } ]
})";

/// Of a scene that is to end with exit code 0, run with these options.
Json resultOf(const std::string& scene, const std::vector<std::string>& options = {}) {
    const TemporaryFolder folder;
    std::vector<std::string> arguments{"run", scene, "--out", folder / "out", "--quiet"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const Outcome run = jacket(arguments);
    EXPECT_EQ(run.exitCode, 0) << run.err;
    return parseJson(TemporaryFolder::read(folder / "out/result.json"), "result.json");
}

TEST(Program, WritesEveryFileAndEveryKeyOfTheResult) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("fall.json", kFallingSheet);
    const Outcome run = jacket({"run", scene, "--out", folder / "out", "--png", "3", "--size", "64x48", "--quiet"});
    ASSERT_EQ(run.exitCode, 0) << run.err;
    EXPECT_EQ(run.out + run.err, "");
    for (const char* name : {"scene.json", "mesh_0.obj", "mesh_0.pc2", "log.csv", "result.json", "frames/000000.png",
                             "frames/000003.png", "frames/000006.png"})
        EXPECT_TRUE(fs::exists(folder / "out" / name)) << name;
    const std::string log = TemporaryFolder::read(folder / "out/log.csv");
    EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 1 + 6);
    EXPECT_EQ(fs::file_size(folder / "out/mesh_0.pc2"), 32u + 7 * 16 * 12);

    const Json result = parseJson(TemporaryFolder::read(folder / "out/result.json"), "result.json");
    for (const char* key :
         {"version",        "scene",           "seed",   "precision",      "threads",        "dt",
          "frames",         "simulated_s",     "wall_s", "ms_per_step",    "pcg_iterations", "max_stretch",
          "peak_stretch",   "max_penetration", "energy", "momentum_error", "converged",      "finite",
          "rejected_steps", "passed_steps",    "shells", "bodies",         "probes",         "unconverged_steps",
          "unsettled_steps"})
        EXPECT_TRUE(result.contains(key)) << key;
    for (const char* key : {"kinetic", "membrane", "bending", "plastic_work", "start", "end"})
        EXPECT_TRUE(result["energy"].contains(key)) << key;
    EXPECT_EQ(result["scene"], "fall");
    EXPECT_EQ(result["frames"], 6);
    EXPECT_EQ(result["shells"][0]["vertices"], 16);
    EXPECT_EQ(result["shells"][0]["triangles"], 18);
    EXPECT_LT(result["momentum_error"].get<double>(), 1e-5);
    // six steps of backward Euler from rest: g h^2 (1 + 2 + ... + 6)
    EXPECT_NEAR(result["probes"]["fall"].get<double>(), 10 * 21.0 / 3600, 1e-5);
}

/// A finger that comes down on a sheet which lies on a table lifts it around itself ring by ring: a round of contacts
/// each.
TEST(Program, SettlesTheContactsOfTheGripperThatCloses) {
    const Json result = resultOf("gripper", {"--seconds", "0.4"});
    EXPECT_EQ(result["unconverged_steps"], 0);
    EXPECT_LT(result["max_penetration"].get<double>(), 1e-4);
}

/// A hundred buckles of thin metal: vertices of its rim lift off the press and come back in nearly every step. Those
/// that took their friction along did not settle, in 9 runs of 26 until the metal was torn (a stretch over 0.3).
TEST(Program, SettlesTheContactsOfACanThatIsCrushed) {
    const Json result = resultOf("can_crush");
    EXPECT_EQ(result["unconverged_steps"], 0);
    EXPECT_LT(result["max_penetration"].get<double>(), 1e-4);
    EXPECT_LT(result["peak_stretch"].get<double>(), 0.4);  // 0.06 to 0.26: rounding decides how it folds
}

/// Going on in each step as in the last one took 16 to 18: a sheet that slides over a ball changes its mind.
TEST(Program, DrapesASheetInFewIterations) {
    const Json result = resultOf("drape", {"--set", "shells.0.mesh.grid.cells=[70,70]"});
    EXPECT_LT(result["pcg_iterations"]["mean"].get<double>(), 15.0);  // 10 to 14: rounding decides how it folds
}

TEST(Program, LeavesFilesOfItsUsersAlone) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("fall.json", kFallingSheet), out = folder / "out";
    const std::vector<std::string> run{"run", scene, "--out", out, "--quiet"};
    ASSERT_EQ(jacket(run).exitCode, 0);
    EXPECT_EQ(jacket(run).exitCode, 0) << "an earlier result is replaced";
    folder.write("out/notes.txt", "precious");
    for (const auto& arguments : {run, {"resume", out, "--seconds", "0.2"}}) {
        const Outcome again = jacket(arguments);
        EXPECT_EQ(again.exitCode, 2);
        EXPECT_NE(again.err.find("out: holds notes.txt"), std::string::npos) << again.err;
    }
    EXPECT_EQ(TemporaryFolder::read(folder / "out/notes.txt"), "precious");
}

/// A column of log.csv.
std::vector<double> columnOf(const std::string& log, const std::string& name) {
    std::istringstream lines(log);
    std::string line, cell;
    std::getline(lines, line);
    std::istringstream header(line);
    int column = 0;
    while (std::getline(header, cell, ',') && cell != name) ++column;
    std::vector<double> values;
    while (std::getline(lines, line)) {
        std::istringstream cells(line);
        for (int k = 0; k <= column; ++k) std::getline(cells, cell, ',');
        values.push_back(std::stod(cell));
    }
    return values;
}

/// Sheet and ball fall alike: before the first frame, with the velocity at the end of each.
TEST(Program, EnergiesAndMomentaAreOfOneMoment) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("fall.json", kFallingSheet);
    const std::vector<std::string> bodies[] = {
        {}, {"--set", R"(bodies=[{"shape":{"sphere":0.1},"mass":3,"position":[5,0,0]}])"}};
    for (const auto& options : bodies) {
        std::vector<std::string> run{"run",  scene,  "--out", folder / "out", "--quiet",
                                     "--dt", "1/20", "--set", "substeps=3"};
        run.insert(run.end(), options.begin(), options.end());
        ASSERT_EQ(jacket(run).exitCode, 0);
        const double mass = options.empty() ? 1.0 : 4.0, h = 1.0 / 60;
        const std::string log = TemporaryFolder::read(folder / "out/log.csv");
        const auto kinetic = columnOf(log, "kinetic_J"), momentum = columnOf(log, "momentum_y_Ns"),
                   total = columnOf(log, "total_J");
        ASSERT_EQ(kinetic.size(), 2u);
        for (std::size_t k = 0; k < kinetic.size(); ++k) {
            const double n = 3.0 * static_cast<double>(k + 1);  // steps of symplectic Euler
            EXPECT_NEAR(momentum[k], -mass * 10 * n * h, 1e-5);
            EXPECT_NEAR(kinetic[k], momentum[k] * momentum[k] / (2 * mass), 1e-5);
            EXPECT_NEAR(total[k], -mass * 100 * h * h * n / 2, 1e-5);  // fallen by g h^2 n (n + 1) / 2
        }
    }
}

TEST(Program, RunsTheSceneThatItWroteToTheSameEnd) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("fall.json", kFallingSheet);
    ASSERT_EQ(jacket({"run", scene, "--out", folder / "a", "--quiet"}).exitCode, 0);
    ASSERT_EQ(jacket({"run", folder / "a/scene.json", "--out", folder / "b", "--quiet"}).exitCode, 0);
    EXPECT_EQ(TemporaryFolder::read(folder / "a/mesh_0.pc2"), TemporaryFolder::read(folder / "b/mesh_0.pc2"));
}

TEST(Program, EndsInTheSameStateWithAnyNumberOfThreads) {
    const TemporaryFolder folder;
    const auto stateWith = [&](const std::string& threads) {
        const Outcome run = jacket({"run", "drape", "--set", "shells.0.mesh.grid.cells=[50,50]", "--seconds", "0.1",
                                    "--threads", threads, "--out", folder / threads, "--quiet"});
        EXPECT_EQ(run.exitCode, 0) << run.err;
        const Json result = parseJson(TemporaryFolder::read(folder / (threads + "/result.json")), "result.json");
        EXPECT_EQ(result["threads"], std::stoi(threads));
        return result["state"];
    };
    EXPECT_EQ(stateWith("1"), stateWith("3"));
}

/// Exit code 4 is a motion that ended in numbers that are none; 3, steps that did not converge.
TEST(BundledScenes, RunToTheirEnds) {
    const TemporaryFolder folder;
    for (const fs::path& scene : bundledScenes()) {
        const Outcome run = jacket({"run", scene.stem().string(), "--quiet", "--out", folder / "out"});
        EXPECT_EQ(run.exitCode, 0) << scene << ": " << run.err;
        const Json result = parseJson(readText(folder / "out" / "result.json"), "result.json");
        EXPECT_LT(result.at("peak_stretch").get<double>(), 0.5) << scene;
    }
}

TEST(Program, SaysHowManyStepsDidNotConverge) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("fall.json", kFallingSheet);
    const Outcome run = jacket({"run", scene, "--out", folder / "out", "--set", "shells.0.max_iterations=1", "--set",
                                R"(shells.0.pin=[{"vertices":[0]}])"});
    EXPECT_EQ(run.exitCode, 3);
    const Json result = parseJson(readText(folder / "out" / "result.json"), "result.json");
    EXPECT_EQ(result["converged"], false);
    const int steps = result["unconverged_steps"].get<int>();
    EXPECT_GT(steps, 0);
    EXPECT_NE(run.out.find("NOT CONVERGED: in " + std::to_string(steps) + " of 6 steps"), std::string::npos) << run.out;
}

/// Positions and velocities are numbers still, energies are not.
TEST(Program, EnergiesThatOverflowAreNotFinite) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("fall.json", kFallingSheet);
    const Outcome run = jacket({"run", scene, "--out", folder / "out", "--quiet", "--set", "gravity=[0,-1e200,0]"});
    EXPECT_EQ(run.exitCode, 4);
    EXPECT_EQ(parseJson(readText(folder / "out" / "result.json"), "result.json")["finite"], false);
}

TEST(Program, SettlesAStaticScene) {
    const Json result = resultOf("cantilever");
    EXPECT_EQ(result["frames"], 1);
    EXPECT_TRUE(result["momentum_error"].is_null());
    // heavy elastica at Gamma = 3: 0.93151 L out and 0.33965 L down (tests/data/heavy_elastica.csv)
    EXPECT_NEAR(result["probes"]["tip"][0].get<double>(), 0.93151 - 0.5, 0.003);
    EXPECT_NEAR(result["probes"]["tip"][1].get<double>(), -0.33965, 0.003);
    EXPECT_EQ(jacket({"run", "trampoline", "--set", "mode=static", "--quiet"}).exitCode, 2);
}

TEST(Program, ReportsADent) {
    const TemporaryFolder folder;
    const Outcome run = jacket({"run", "hood", "--seconds", "0.1", "--out", folder / "out", "--quiet"});
    ASSERT_EQ(run.exitCode, 0) << run.err;
    const Json result = parseJson(TemporaryFolder::read(folder / "out/result.json"), "result.json");
    EXPECT_GT(result["energy"]["plastic_work"].get<double>(), 0.1);
    const Json& dent = result["shells"][0]["dent"];
    EXPECT_GT(dent["work"].get<double>(), 0.0);
    EXPECT_GT(dent["time"].get<double>(), 0.0);
    EXPECT_LE(dent["time"].get<double>(), 0.1);
    // On the hood, between its held borders. Wanted: within 0.15 m of the ball. Where the panel yields most is decided
    // by where the ball hits it, to less than a millimetre: of six places one to two millimetres apart half are
    // farther.
    EXPECT_LT(std::abs(dent["position"][0].get<double>()), 0.69);
    EXPECT_LT(std::abs(dent["position"][2].get<double>()), 0.49);
    EXPECT_NEAR(dent["position"][1].get<double>(), 0.68, 0.05);
}

/// In a process of its own: raises SIGINT after half a second of running a scene whose first frame takes a minute.
[[noreturn]] void runInterrupted(const std::string& scene, const std::string& out) {
    std::signal(SIGALRM, [](int) { std::raise(SIGINT); });
    const itimerval halfASecond{{0, 0}, {0, 500000}};
    setitimer(ITIMER_REAL, &halfASecond, nullptr);
    const char* arguments[] = {"jacket", "run", scene.c_str(), "--out", out.c_str(), "--set", "substeps=1000000"};
    std::exit(runProgram(std::size(arguments), arguments));
}

TEST(ProgramDeathTest, EndsBetweenTheStepsOfAFrameWhenInterrupted) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("fall.json", kFallingSheet);
    EXPECT_EXIT(runInterrupted(scene, folder / "out"), testing::ExitedWithCode(130),
                "interrupted; nothing was written");
    EXPECT_EQ(folder.entries(), 1);
}

TEST(ProgramDeathTest, ASecondSignalEndsItAtOnce) {
    const auto interruptTwice = [](int first, int second) {
        catchInterrupts();
        std::raise(first);
        if (!isInterrupted()) std::exit(1);
        catchInterrupts();  // the next case of a sweep
        std::raise(second);
        std::exit(2);
    };
    EXPECT_EXIT(interruptTwice(SIGINT, SIGINT), testing::KilledBySignal(SIGINT), "");
    EXPECT_EXIT(interruptTwice(SIGINT, SIGTERM), testing::KilledBySignal(SIGTERM), "");
}

TEST(Program, BadInputIsExitCode2WithOneMessageAndNothingWritten) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("fall.json", kFallingSheet);
    const std::string out = folder / "out";
    const std::pair<std::vector<std::string>, const char*> cases[] = {
        {{"run", folder / "none.json"}, "none.json: there is no such file"},
        {{"run", "trampolin"}, "did you mean \"trampoline\"?"},
        {{"run", scene, "--dt", "fast"}, "--dt [s] must be a number > 0"},
        {{"run", scene, "--seconds", "-1"}, "--seconds [s] must be a number > 0"},
        {{"run", scene, "--set", "shells.0.pin=[{\"vertices\":[99]}]"}, "vertex 99 does not exist"},
        {{"run", scene, "--set", "shells.0.pin=[{\"box\":[[5,5,5],[6,6,6]]}]"}, "selects no vertex"},
        {{"run", scene, "--set", "shells.0.material.thickness=-1"}, "must be > 0, got -1"},
        {{"run", scene, "--set", "probes.0.box=[[5,5,5],[6,6,6]]"}, "probes.0.box selects no vertex"},
        {{"run", scene, "--set", "shells.0.transform={\"position\":[0,1e300,0]}"}, "starts too far from the origin"},
        {{"run", scene, "--threads", "0"}, "--threads must be 1..64, got 0"},
        {{"run", scene, "--threads", "65"}, "--threads must be 1..64, got 65"},
        {{"run", "cantilever", "--profile"}, "takes no steps"},
        {{"run", scene, "--png", "0"}, "--png must be >= 1"},
        {{"run", scene, "--png", "1", "--size", "big"}, "--size must be WIDTHxHEIGHT"},
    };
    for (auto [arguments, expected] : cases) {
        arguments.insert(arguments.end(), {"--out", out});
        const Outcome run = jacket(arguments);
        EXPECT_EQ(run.exitCode, 2) << expected;
        EXPECT_NE(run.err.find(expected), std::string::npos) << run.err;
        EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
        EXPECT_EQ(folder.entries(), 1) << expected;
    }
    EXPECT_EQ(jacket({"run", scene, "--png", "1"}).exitCode, 2);
    EXPECT_EQ(jacket({"run", scene, "--nonsense"}).exitCode, 2);
    EXPECT_EQ(jacket({}).exitCode, 2);
    EXPECT_NE(jacket({"run", scene, "--thread", "2"}).err.find("did you mean \"--threads\"?"), std::string::npos);
    EXPECT_NE(jacket({"bench", "--sizes", "11,x"}).err.find("--sizes: Vertices along a side"), std::string::npos);
    EXPECT_NE(jacket({"rum"}).err.find("there is no command \"rum\"; did you mean \"run\"?"), std::string::npos);
}

TEST(Program, BadMeshesAreNamedByFileAndLineOrIndex) {
    const TemporaryFolder folder;
    const std::string start = "v 0 0 0\nv 1 0 0\nv 0 0 1\n";
    const std::pair<std::string, const char*> cases[] = {
        {start + "f 1 2 7\n", "mesh.obj:4"},
        {"v 0 0 0\nv nan 0 0\nv 0 0 1\nf 1 2 3\n", "mesh.obj:2"},
        {start + "v 0.5 0 0\nf 1 2 4\nf 1 2 3\n", "triangle 0"},
    };
    const std::string scene =
        folder.write("scene.json", R"({ "shells": [ { "mesh": { "file": "mesh.obj" }, "material": "cotton" } ] })");
    for (const auto& [mesh, expected] : cases) {
        folder.write("mesh.obj", mesh);
        for (const auto& arguments : {std::vector<std::string>{"run", scene, "--out", folder / "out"},
                                      std::vector<std::string>{"check", folder / "mesh.obj"}}) {
            const Outcome run = jacket(arguments);
            EXPECT_EQ(run.exitCode, 2) << mesh;
            EXPECT_NE(run.err.find(expected), std::string::npos) << run.err;
            EXPECT_EQ(folder.entries(), 2);
        }
    }
    folder.write("mesh.obj", start + "f 1 3 2\n");
    const Outcome good = jacket({"check", folder / "mesh.obj"});
    EXPECT_EQ(good.exitCode, 0) << good.err;
    EXPECT_NE(good.out.find("3 vertices, 1 triangles"), std::string::npos) << good.out;
}

TEST(Program, ListsScenesAndMaterials) {
    const Outcome table = jacket({"list"});
    EXPECT_EQ(table.exitCode, 0);
    EXPECT_NE(table.out.find("trampoline"), std::string::npos);
    const Json list = parseJson(jacket({"list", "--json"}).out, "list");
    EXPECT_TRUE(
        std::any_of(list.begin(), list.end(), [](const Json& entry) { return entry["name"] == "cloth_sphere"; }));

    EXPECT_NE(jacket({"material", "steel", "--thickness", "1e-3"}).out.find("bending stiffness"), std::string::npos);
    const Outcome unknown = jacket({"material", "stel"});
    EXPECT_EQ(unknown.exitCode, 2);
    EXPECT_NE(unknown.err.find("did you mean \"steel\"?"), std::string::npos) << unknown.err;
    EXPECT_EQ(jacket({"--version"}).exitCode, 0);
    EXPECT_EQ(jacket({"--help"}).exitCode, 0);
    EXPECT_EQ(jacket({"run", "--help"}).exitCode, 0);
}

}  // namespace
}  // namespace jacket::demo
