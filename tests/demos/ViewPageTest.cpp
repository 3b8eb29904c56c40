#include <gtest/gtest.h>

#include "Json.h"
#include "RunProgram.h"
#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

TEST(ViewPage, HoldsTheWholeMotionAndNothingFromOutside) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("ball.json", kBallOnSheet);
    const Outcome run = jacket({"run", scene, "--out", folder / "out", "--html", "--quiet"});
    ASSERT_EQ(run.exitCode, 0) << run.err;
    const std::string page = TemporaryFolder::read(folder / "out/view.html");
    EXPECT_NE(page.find("<title>ball</title>"), std::string::npos);
    for (const char* outside : {"http:", "https:", "src=", "@import", "@TITLE@", "@SCENE@"})
        EXPECT_EQ(page.find(outside), std::string::npos) << outside;
    const auto start = page.find("const scene = ") + 14;
    const Json json = parseJson(page.substr(start, page.find(";\n", start) - start), "view.html");
    EXPECT_EQ(json["times"].size(), 13u);
    EXPECT_NEAR(json["times"].back().get<double>(), 0.2, 1e-6);
    ASSERT_EQ(json["shells"].size(), 1u);
    ASSERT_EQ(json["bodies"].size(), 1u);
    const std::size_t bytes = 13 * 49 * 3 * 2;
    EXPECT_EQ(json["shells"][0]["positions"].get<std::string>().size(), 4 * ((bytes + 2) / 3));
    EXPECT_EQ(json["bodies"][0]["poses"].get<std::string>().size(), 4u * ((13 * 7 * 4 + 2) / 3));
    EXPECT_EQ(jacket({"run", scene, "--html"}).exitCode, 2);
}

}  // namespace
}  // namespace jacket::demo
