#include <gtest/gtest.h>

#include <algorithm>

#include "RunProgram.h"
#include "Sweep.h"
#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

namespace fs = std::filesystem;

TEST(Sweep, CommasInsideBracketsAndQuotesSeparateNothing) {
    const SweepAxis cells = parseSweepAxis("shells.0.mesh.grid.cells=[2,3],[4,5]");
    EXPECT_EQ(cells.path, "shells.0.mesh.grid.cells");
    EXPECT_EQ(cells.values, (std::vector<std::string>{"[2,3]", "[4,5]"}));
    EXPECT_EQ(parseSweepAxis("name=\"a,b\",c").values, (std::vector<std::string>{"\"a,b\"", "c"}));
    for (const char* wrong : {"no_values", "=1,2", "dt=1,,2", "dt=1,1"})
        EXPECT_THROW(parseSweepAxis(wrong), InputError) << wrong;
}

TEST(Sweep, CasesAreEveryCombinationOnce) {
    const SweepPlan plan{"out", "drape", {{"a", {"1", "2"}}, {"b", {"x", "y", "z"}}}};
    ASSERT_EQ(plan.cases(), 6);
    EXPECT_EQ(plan.changes(0), (std::vector<std::string>{"a=1", "b=x"}));
    EXPECT_EQ(plan.changes(5), (std::vector<std::string>{"a=2", "b=z"}));
    EXPECT_EQ(plan.folderOf(5), fs::path("out/case_0005"));
}

TEST(Sweep, RunsCasesOneByOneAndCollectsThem) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("ball.json", kBallOnSheet), out = folder / "sweep";
    const std::vector<std::string> plan{"sweep", "plan",          scene,   "--set", "shells.0.friction=0.1,0.9",
                                        "--set", "dt=1/60,1/120", "--out", out};
    const Outcome planned = jacket(plan);
    ASSERT_EQ(planned.exitCode, 0) << planned.err;
    EXPECT_NE(planned.out.find("4 cases"), std::string::npos) << planned.out;
    EXPECT_EQ(jacket({"sweep", "collect", out}).exitCode, 2);

    ASSERT_EQ(jacket({"sweep", "run", out, "--case", "1", "--quiet"}).exitCode, 0);
    EXPECT_TRUE(fs::exists(out + "/case_0001/result.json"));
    EXPECT_FALSE(fs::exists(out + "/case_0000"));
    const Outcome partly = jacket({"sweep", "collect", out});
    EXPECT_EQ(partly.exitCode, 0);
    EXPECT_NE(partly.err.find("3 of 4 cases are not finished: 0, 2, 3"), std::string::npos) << partly.err;

    const auto written = fs::last_write_time(out + "/case_0001/result.json");
    ASSERT_EQ(jacket({"sweep", "run", out + "/plan.json", "--quiet"}).exitCode, 0);
    EXPECT_EQ(fs::last_write_time(out + "/case_0001/result.json"), written) << "what is finished is not run again";
    ASSERT_EQ(jacket({"sweep", "collect", out, "--out", folder / "all.csv"}).exitCode, 0);
    const std::string csv = TemporaryFolder::read(folder / "all.csv");
    EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 5);
    EXPECT_TRUE(csv.starts_with("case,shells.0.friction,dt,")) << csv.substr(0, 80);
    for (const char* part : {"\n0,0.1,1/60,", "\n3,0.9,1/120,", "bodies.ball.position.1", "ms_per_step.median"})
        EXPECT_NE(csv.find(part), std::string::npos) << part;

    EXPECT_EQ(jacket(plan).exitCode, 0) << "the same plan again is no mistake";
    auto other = plan;
    other[4] = "shells.0.friction=0.2";
    EXPECT_EQ(jacket(other).exitCode, 2);
    EXPECT_EQ(jacket({"sweep", "run", out, "--case", "4"}).exitCode, 2);
}

TEST(Sweep, RunsOtherCasesWhereOneCannotBeRun) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("ball.json", kBallOnSheet), out = folder / "sweep";
    ASSERT_EQ(jacket({"sweep", "plan", scene, "--set", "shells.0.friction=0.1,0.2,0.3", "--out", out}).exitCode, 0);
    fs::create_directory(out + "/case_0001");
    folder.write("sweep/case_0001/notes.txt", "not a result");
    const Outcome run = jacket({"sweep", "run", out, "--quiet"});
    EXPECT_EQ(run.exitCode, 2);
    EXPECT_TRUE(run.err.starts_with("jacket: case 1 (shells.0.friction=0.2): ")) << run.err;
    EXPECT_TRUE(fs::exists(out + "/case_0002/result.json"));
    const Outcome collected = jacket({"sweep", "collect", out});
    EXPECT_EQ(collected.exitCode, 0);
    EXPECT_NE(collected.err.find("1 of 3 cases are not finished: 1"), std::string::npos) << collected.err;
    EXPECT_EQ(std::count(collected.out.begin(), collected.out.end(), '\n'), 3);
}

TEST(Sweep, RefusesABadPlanBeforeAnythingIsWritten) {
    const TemporaryFolder folder;
    const std::pair<std::vector<std::string>, const char*> cases[] = {
        {{"trampolin", "--set", "dt=1/60"}, "did you mean \"trampoline\"?"},
        {{"trampoline", "--set", "shells.0.frictoin=0.1"}, "did you mean \"friction\"?"},
        {{"trampoline", "--set", "shells.0.material.thickness=1e-3,-1"}, "must be > 0, got -1"},
        {{"trampoline", "--set", "dt=1/60", "--set", "dt=1/120"}, "is given twice"},
        {{"trampoline", "--set", R"(shells.0.pin=[{"vertices":[1]}],[{"vertices":[99999]}])"},
         R"(case 1 (shells.0.pin=[{"vertices":[99999]}]): )"},
    };
    for (auto [arguments, expected] : cases) {
        arguments.insert(arguments.begin(), {"sweep", "plan"});
        arguments.insert(arguments.end(), {"--out", folder / "out"});
        const Outcome run = jacket(arguments);
        EXPECT_EQ(run.exitCode, 2) << expected;
        EXPECT_NE(run.err.find(expected), std::string::npos) << run.err;
    }
    EXPECT_EQ(folder.entries(), 0);
    const Outcome misspelt = jacket({"sweep", "colect", "out"});
    EXPECT_EQ(misspelt.exitCode, 2);
    EXPECT_NE(misspelt.err.find("did you mean \"collect\"?"), std::string::npos) << misspelt.err;
}

}  // namespace
}  // namespace jacket::demo
