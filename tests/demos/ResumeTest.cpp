#include <gtest/gtest.h>

#include <sstream>

#include "Json.h"
#include "RunProgram.h"
#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

/// log.csv without the milliseconds at the end of each line.
std::string logOf(const std::filesystem::path& folder) {
    std::istringstream in(TemporaryFolder::read(folder / "log.csv"));
    std::string text;
    for (std::string line; std::getline(in, line);) text += line.substr(0, line.rfind(',')) + '\n';
    return text;
}

Json resultOf(const std::filesystem::path& folder) {
    return parseJson(TemporaryFolder::read(folder / "result.json"), "result.json");
}

TEST(Resume, GivesTheBitsOfOneLongRun) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("ball.json", kBallOnSheet);
    ASSERT_EQ(jacket({"run", scene, "--out", folder / "long", "--quiet"}).exitCode, 0);
    ASSERT_EQ(jacket({"run", scene, "--seconds", "0.1", "--out", folder / "part", "--quiet"}).exitCode, 0);
    EXPECT_GT(resultOf(folder / "part")["shells"][0]["contacts"], 0);
    EXPECT_NE(resultOf(folder / "part")["state"], resultOf(folder / "long")["state"]);
    const Outcome resumed = jacket({"resume", folder / "part", "--seconds", "0.2", "--quiet"});
    ASSERT_EQ(resumed.exitCode, 0) << resumed.err;
    EXPECT_EQ(resultOf(folder / "part")["state"], resultOf(folder / "long")["state"]);
    EXPECT_EQ(resultOf(folder / "part")["frames"], 12);
    for (const char* name : {"mesh_0.pc2", "mesh_0.obj", "scene.json"})
        EXPECT_EQ(TemporaryFolder::read(folder / "part" / name), TemporaryFolder::read(folder / "long" / name)) << name;
    EXPECT_EQ(logOf(folder / "part"), logOf(folder / "long"));
}

TEST(Resume, RefusesWhatItCannotContinue) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("ball.json", kBallOnSheet);
    ASSERT_EQ(jacket({"run", scene, "--seconds", "0.1", "--out", folder / "run", "--quiet"}).exitCode, 0);
    const std::string before = TemporaryFolder::read(folder / "run/result.json");
    const auto refused = [&](const std::vector<std::string>& arguments, const char* expected) {
        const Outcome run = jacket(arguments);
        EXPECT_EQ(run.exitCode, 2) << expected;
        EXPECT_NE(run.err.find(expected), std::string::npos) << run.err;
    };
    refused({"resume", folder / "none"}, "there is no such directory");
    refused({"resume", folder / "."}, "holds no result.json");
    refused({"resume", folder / "run"}, "--seconds S is needed");
    refused({"resume", folder / "run", "--seconds", "0.1"}, "is at 0.1 s already");
    EXPECT_EQ(TemporaryFolder::read(folder / "run/result.json"), before);

    Json other = parseJson(TemporaryFolder::read(folder / "run/scene.json"), "scene.json");
    other["bodies"][0]["mass"] = 0.51;  // not the scene of this result
    folder.write("run/scene.json", other.dump());
    refused({"resume", folder / "run", "--seconds", "0.2"}, "the state is not the one that was written");
    EXPECT_EQ(TemporaryFolder::read(folder / "run/result.json"), before);
}

}  // namespace
}  // namespace jacket::demo
