#include <gtest/gtest.h>

#include "Json.h"
#include "RunProgram.h"
#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

TEST(Profile, SplitsTheTimeOfAStepWithoutRest) {
    const TemporaryFolder folder;
    const std::string scene = folder.write("ball.json", kBallOnSheet);
    ASSERT_EQ(jacket({"run", scene, "--out", folder / "plain", "--quiet"}).exitCode, 0);
    const Json plain = parseJson(TemporaryFolder::read(folder / "plain/result.json"), "result.json");
    EXPECT_FALSE(plain.contains("profile"));

    const Outcome run = jacket({"run", scene, "--out", folder / "out", "--profile"});
    ASSERT_EQ(run.exitCode, 0) << run.err;
    EXPECT_NE(run.out.find("where the time went"), std::string::npos) << run.out;
    const Json result = parseJson(TemporaryFolder::read(folder / "out/result.json"), "result.json");
    const Json& profile = result["profile"];
    EXPECT_EQ(profile["steps"], 12);
    EXPECT_GE(profile["solves_per_step"].get<double>(), 1.0);
    double sum = 0.0, percent = 0.0;
    for (const Json& part : profile["parts"]) {
        EXPECT_GE(part["ms_per_step"].get<double>(), -1e-6) << part;
        sum += part["ms_per_step"].get<double>();
        percent += part["percent"].get<double>();
        if (part["part"] == "narrow phase of shells" || part["part"] == "assembly") {
            EXPECT_GT(part["ms_per_step"].get<double>(), 0.0) << part;
        }
    }
    EXPECT_NEAR(sum, profile["ms_per_step"].get<double>(), 1e-9 * sum);
    EXPECT_NEAR(percent, 100.0, 1e-6);
}

}  // namespace
}  // namespace jacket::demo
