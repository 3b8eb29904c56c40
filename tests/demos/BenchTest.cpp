#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <gtest/gtest.h>

#include <set>

#include "RunProgram.h"
#include "SceneFile.h"
#include "SoftSheet.h"
#include "SoftWorld.h"
#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

std::vector<std::string> keysOf(const Json& object) {
    std::vector<std::string> keys;
    for (const auto& [key, value] : object.items()) keys.push_back(key);
    return keys;
}

TEST(Bench, WritesWhatItPromises) {
    const TemporaryFolder folder;
    const Outcome run = jacket(
        {"bench", "--sizes", "5,8", "--repeat", "1", "--seconds", "0.1", "--json", folder / "bench.json", "--quiet"});
    ASSERT_EQ(run.exitCode, 0) << run.err;
    EXPECT_EQ(run.out + run.err, "");
    const Json json = parseJson(TemporaryFolder::read(folder / "bench.json"), "bench.json");
    EXPECT_EQ(keysOf(json), (std::vector<std::string>{"machine", "scene", "rows", "ratios"}));
    EXPECT_EQ(json["scene"], "drape");
    ASSERT_EQ(json["rows"].size(), 4u);
    for (const Json& row : json["rows"])
        EXPECT_EQ(keysOf(row),
                  (std::vector<std::string>{"n", "solver", "threads", "ms_median", "ms_p95", "max_stretch",
                                            "p99_stretch", "peak_stretch", "max_penetration", "iterations", "rss_mb"}));
    EXPECT_EQ(json["rows"][0]["solver"], "jacket");
    EXPECT_EQ(json["rows"][1]["solver"], "btSoftBody");
    EXPECT_EQ(json["rows"][1]["iterations"], 10);
    EXPECT_EQ(json["rows"][3]["n"], 8);
    ASSERT_EQ(json["ratios"].size(), 2u);
    EXPECT_EQ(keysOf(json["ratios"][0]), (std::vector<std::string>{"n", "time", "stretch"}));
    EXPECT_NEAR(json["ratios"][1]["time"].get<double>(),
                json["rows"][2]["ms_median"].get<double>() / json["rows"][3]["ms_median"].get<double>(), 1e-12);
}

TEST(Bench, PrintsTablesAndPlots) {
    const TemporaryFolder folder;
    const std::vector<std::string> brief{"bench", "--sizes", "5,11", "--repeat", "1", "--seconds", "0.05", "--quiet"};
    const Outcome table = jacket(brief);
    EXPECT_NE(table.out.find("btSoftBody"), std::string::npos);
    EXPECT_NE(table.out.find("NOT measured in this run"), std::string::npos);
    auto arguments = brief;
    arguments.push_back("--markdown");
    EXPECT_NE(jacket(arguments).out.find("\n| 11 | "), std::string::npos);
    arguments = brief;
    arguments.insert(arguments.end(), {"--growth", folder / "growth.svg"});
    const Outcome growth = jacket(arguments);
    ASSERT_EQ(growth.exitCode, 0) << growth.err;
    EXPECT_NE(growth.out.find("Jacket alone"), std::string::npos) << growth.out;
    EXPECT_EQ(growth.out.find("  btSoftBody "), std::string::npos) << growth.out;
    const std::string svg = TemporaryFolder::read(folder / "growth.svg");
    for (const char* part : {"time per vertex", "iterations of a step", "memory per vertex", "11 x 11 vertices"})
        EXPECT_NE(svg.find(part), std::string::npos) << part;
}

TEST(Bench, RefusesWhatCannotBeCompared) {
    const TemporaryFolder folder;
    const std::pair<std::vector<std::string>, const char*> cases[] = {
        {{"--scene", "bowl"}, "is no grid of rectangles"},
        {{"--scene", "drap"}, "did you mean \"drape\"?"},
        {{"--sizes", "1"}, "--sizes must be vertices along a side, each 2..4000, got 1"},
        {{"--sizes", "many"}, "--sizes"},
        {{"--repeat", "0"}, "--repeat must be >= 1"},
        {{"--substeps", "0"}, "--substeps must be >= 1"},
        {{"--threads", "0"}, "--threads must be 1..64, got 0"},
        {{"--json", folder / "none/bench.json"}, "there is no directory"},
    };
    for (auto [arguments, expected] : cases) {
        arguments.insert(arguments.begin(), "bench");
        const Outcome run = jacket(arguments);
        EXPECT_EQ(run.exitCode, 2) << expected;
        EXPECT_NE(run.err.find(expected), std::string::npos) << run.err;
    }
}

TEST(SoftSheet, HasTheLinksThatBulletsHelpersMake) {
    SoftSheet sheet;
    sheet.mesh = makeGrid({.size = {1, 1}, .cells = {5, 5}});
    sheet.links = gridLinks(sheet.mesh, 6);
    sheet.masses = lumpedMasses(sheet.mesh, 0.2);
    btSoftBodyWorldInfo info;
    const auto ours = makeSoftBody(info, sheet);
    const auto a = btScalar(0.5);
    const std::unique_ptr<btSoftBody> bullets(
        btSoftBodyHelpers::CreatePatch(info, {-a, 0, -a}, {a, 0, -a}, {-a, 0, a}, {a, 0, a}, 6, 6, 0, false));
    bullets->generateBendingConstraints(2);
    const auto pairsOf = [](const btSoftBody& body) {
        std::set<std::pair<int, int>> pairs;
        for (int i = 0; i < body.m_links.size(); ++i) {
            const int x = static_cast<int>(body.m_links[i].m_n[0] - &body.m_nodes[0]);
            const int y = static_cast<int>(body.m_links[i].m_n[1] - &body.m_nodes[0]);
            pairs.insert(std::minmax(x, y));
        }
        return pairs;
    };
    EXPECT_EQ(ours->m_links.size(), bullets->m_links.size());
    EXPECT_EQ(pairsOf(*ours), pairsOf(*bullets));
    EXPECT_NEAR(double(ours->getTotalMass()), 0.2, 1e-6);
}

TEST(SoftWorld, FallsAsItsSceneSaysAndStaysWhereItIsPinned) {
    SceneChanges changes;
    changes.set = {"shells.0.mesh.grid.cells=[8,8]"};
    const Scene scene = loadScene(findScene("drape"), changes);
    SoftWorld soft(scene);
    World shells(scene);
    const Points start = soft.positions();
    EXPECT_LT((start - shells.shell(0).positions()).norm(), 1e-12);
    constexpr int kFrames = 12;
    for (int frame = 0; frame < kFrames; ++frame) {
        soft.step();
        shells.step();
    }
    const Points end = soft.positions();
    const double fallen = 0.5 * 9.81 * kFrames * (kFrames + 1) / 3600.0;  // of semi-implicit Euler
    for (int i = 0; i < end.cols(); ++i)
        if (start(0, i) < 1e-9) {
            EXPECT_EQ(end.col(i), start.col(i)) << i;
        }
    EXPECT_NEAR(start(1, 8) - end(1, 8), fallen, 0.02);  // the free edge has not felt the pins yet
    EXPECT_LT((end - shells.shell(0).positions()).colwise().norm().maxCoeff(), 0.25);
}

}  // namespace
}  // namespace jacket::demo
