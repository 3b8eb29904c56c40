#include <gtest/gtest.h>

#include <cstring>

#include "Json.h"
#include "RunProgram.h"
#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

namespace fs = std::filesystem;

/// A binary glTF file, taken apart by the specification alone.
class Glb {
  public:
    explicit Glb(const fs::path& file) : m_bytes(TemporaryFolder::read(file)) {
        EXPECT_EQ(m_bytes.substr(0, 4), "glTF");
        EXPECT_EQ(word(4), 2u);
        EXPECT_EQ(word(8), m_bytes.size());
        m_jsonSize = word(12);
        EXPECT_EQ(m_bytes.substr(16, 4), "JSON");
        EXPECT_EQ(m_jsonSize % 4, 0u);
        m_json = Json::parse(m_bytes.substr(20, m_jsonSize));
        EXPECT_EQ(m_bytes.substr(20 + m_jsonSize + 4, 4), std::string("BIN\0", 4));
        EXPECT_EQ(bufferSize() % 4, 0u);
        EXPECT_EQ(28 + m_jsonSize + bufferSize(), m_bytes.size());
    }
    const Json& json() const { return m_json; }
    std::size_t bufferSize() const { return word(20 + m_jsonSize); }

    /// The elements of an accessor, a column each, which must lie in its bufferView.
    Eigen::MatrixXd values(int index) const {
        const Json& accessor = m_json["accessors"][index];
        const Json& view = m_json["bufferViews"][accessor["bufferView"].get<int>()];
        const int rows = accessor["type"] == "SCALAR" ? 1 : accessor["type"] == "VEC3" ? 3 : 4;
        const int count = accessor["count"];
        const std::size_t offset = accessor["byteOffset"], size = 4u * rows * count;
        EXPECT_EQ(offset % 4, 0u);
        EXPECT_LE(offset + size, view["byteLength"].get<std::size_t>());
        EXPECT_EQ(view.value("byteStride", 4 * rows), 4 * rows);
        const char* from = m_bytes.data() + 28 + m_jsonSize + view["byteOffset"].get<std::size_t>() + offset;
        return accessor["componentType"] == 5126 ? numbers<float>(from, rows, count)
                                                 : numbers<std::uint32_t>(from, rows, count);
    }

    /// What moves a node: the values of its channel, or none.
    Eigen::MatrixXd motion(int node, const char* path) const {
        for (const Json& channel : m_json["animations"][0]["channels"])
            if (channel["target"]["node"] == node && channel["target"]["path"] == path)
                return values(sampler(channel)["output"]);
        return {};
    }
    Eigen::VectorXd times() const { return values(m_json["animations"][0]["samplers"][0]["input"]).transpose(); }
    /// Positions of the mesh of a node at one of those times.
    Eigen::MatrixXd positions(int node, int moment) const {
        const Json& primitive = m_json["meshes"][m_json["nodes"][node]["mesh"].get<int>()]["primitives"][0];
        Eigen::MatrixXd x = values(primitive["attributes"]["POSITION"]);
        if (!primitive.contains("targets")) return x;
        const int targets = static_cast<int>(primitive["targets"].size());
        const Eigen::MatrixXd weights = motion(node, "weights").reshaped(targets, times().size());
        for (int k = 0; k < targets; ++k)
            if (weights(k, moment) != 0) x += weights(k, moment) * values(primitive["targets"][k]["POSITION"]);
        return x;
    }

  private:
    std::uint32_t word(std::size_t offset) const {
        std::uint32_t word;
        std::memcpy(&word, m_bytes.data() + offset, sizeof word);
        return word;
    }
    template <class Number>
    static Eigen::MatrixXd numbers(const char* from, int rows, int count) {
        Eigen::MatrixX<Number> numbers(rows, count);
        std::memcpy(numbers.data(), from, sizeof(Number) * numbers.size());
        return numbers.template cast<double>();
    }
    const Json& sampler(const Json& channel) const {
        return m_json["animations"][0]["samplers"][channel["sampler"].get<int>()];
    }

    std::string m_bytes;
    std::size_t m_jsonSize = 0;
    Json m_json;
};

/// The positions at a frame as mesh_K.pc2 has them.
Eigen::MatrixXd recorded(const fs::path& cache, int frame) {
    const std::string bytes = TemporaryFolder::read(cache);
    std::int32_t points = 0;
    std::memcpy(&points, bytes.data() + 16, sizeof points);
    Eigen::Matrix3Xf x(3, points);
    const std::size_t size = sizeof(float) * x.size();
    std::memcpy(x.data(), bytes.data() + 32 + frame * size, size);
    return x.cast<double>();
}

/// Two sheets that fall past each other, and no bodies.
constexpr const char* kTwoSheets = R"({
    "dt": "1/30", "seconds": 0.3,
    "shells": [ { "name": "upper", "mesh": { "grid": { "size": [1, 1], "cells": [3, 2] } }, "material": "cotton",
                  "transform": { "position": [0, 1, 0] }, "pin": [ { "vertices": [0, 3] } ] },
                { "name": "lower", "mesh": { "grid": { "size": [0.5, 1], "cells": [2, 5] } }, "material": "denim",
                  "initial_velocity": [1, 0, 0] } ]
})";

/// A folder in which a scene has been run with --glb.
class GlbOfRun : public testing::Test {
  protected:
    Glb run(const std::string& scene, std::vector<std::string> more = {}) {
        std::vector<std::string> arguments{"run", m_folder.write("scene.json", scene), "--out", out(), "--glb"};
        arguments.insert(arguments.end(), more.begin(), more.end());
        m_run = jacket(arguments);
        EXPECT_EQ(m_run.exitCode, 0) << m_run.err;
        return Glb(out() / "anim.glb");
    }
    fs::path out() const { return m_folder / "out"; }
    void expectRecordedMotion(const Glb& glb, int shell, double dt) const {
        const Eigen::VectorXd times = glb.times();
        for (int i = 0; i < times.size(); ++i) {
            const int frame = static_cast<int>(std::lround(times[i] / dt));
            const Eigen::MatrixXd x = recorded(out() / ("mesh_" + std::to_string(shell) + ".pc2"), frame);
            const Eigen::MatrixXd found = glb.positions(shell, i);
            ASSERT_EQ(found.cols(), x.cols());
            EXPECT_LT((found - x).cwiseAbs().maxCoeff(), 3e-7 * (1 + x.cwiseAbs().maxCoeff())) << frame;
        }
    }

    TemporaryFolder m_folder;
    Outcome m_run;
};

TEST_F(GlbOfRun, KeepsToTheSpecification) {
    const Glb glb = run(kBallOnSheet);
    const Json& json = glb.json();
    EXPECT_EQ(json["asset"]["version"], "2.0");
    EXPECT_EQ(json["asset"]["generator"], "Jacket " JACKET_VERSION);
    EXPECT_EQ(json["buffers"].size(), 1u);
    EXPECT_EQ(json["buffers"][0]["byteLength"], glb.bufferSize());
    EXPECT_EQ(json["scenes"][0]["nodes"], Json({0, 1}));
    std::size_t end = 0;
    for (const Json& view : json["bufferViews"]) {
        EXPECT_EQ(view["byteOffset"], end);
        end += view["byteLength"].get<std::size_t>();
    }
    EXPECT_EQ(end, glb.bufferSize());
    for (std::size_t k = 0; k < json["accessors"].size(); ++k) {
        const Eigen::MatrixXd values = glb.values(static_cast<int>(k));
        const Eigen::VectorXd least = values.rowwise().minCoeff(), most = values.rowwise().maxCoeff();
        EXPECT_EQ(json["accessors"][k]["min"].get<std::vector<double>>(),
                  std::vector<double>(least.begin(), least.end()));
        EXPECT_EQ(json["accessors"][k]["max"].get<std::vector<double>>(),
                  std::vector<double>(most.begin(), most.end()));
    }
    for (const Json& mesh : json["meshes"])
        for (const Json& primitive : mesh["primitives"]) {
            const Eigen::MatrixXd normals = glb.values(primitive["attributes"]["NORMAL"]);
            const Eigen::MatrixXd indices = glb.values(primitive["indices"]);
            EXPECT_LT((normals.colwise().norm().array() - 1).abs().maxCoeff(), 1e-5);
            EXPECT_EQ(indices.size() % 3, 0);
            EXPECT_LT(indices.maxCoeff(), normals.cols());
            EXPECT_EQ(json["accessors"][primitive["attributes"]["POSITION"].get<int>()]["count"], normals.cols());
        }
}

TEST_F(GlbOfRun, HoldsTheMotionThatWasRecorded) {
    const Glb glb = run(kBallOnSheet);
    const Eigen::VectorXd times = glb.times();
    ASSERT_EQ(times.size(), 7);  // of 12 frames of 1/60 s
    EXPECT_EQ(times[0], 0);
    EXPECT_NEAR(times[6], 0.2, 1e-7);
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(times[i + 1] - times[i], 1.0 / 30, 1e-7);
    EXPECT_EQ(glb.json()["nodes"][0]["name"], "sheet");
    expectRecordedMotion(glb, 0, 1.0 / 60);
    EXPECT_NE(m_run.out.find("anim.glb          7 of 13 frames, "), std::string::npos) << m_run.out;
}

TEST_F(GlbOfRun, BodiesEndWhereTheResultSaysTheyDo) {
    Json scene = parseJson(kBallOnSheet, "ball.json");
    scene["bodies"][0]["angular_velocity"] = {40, 3, -20};
    scene["bodies"].push_back({{"name", "ground"}, {"shape", {{"plane", {0.6, 0.8, 0, -1}}}}, {"position", {0, 0, 1}}});
    scene["bodies"].push_back({{"name", "post"},
                               {"shape", {{"box", {0.1, 0.2, 0.3}}}},
                               {"position", {2, 0, 0}},
                               {"rotation_deg", {0, 90, 0}}});
    const Glb glb = run(scene.dump());
    const Json result = parseJson(TemporaryFolder::read(out() / "result.json"), "result.json");
    const auto expectNear = [](const Eigen::VectorXd& found, const Json& expected) {
        const auto numbers = expected.get<std::vector<double>>();
        const Eigen::VectorXd x = Eigen::Map<const Eigen::VectorXd>(numbers.data(), found.size());
        EXPECT_LT(std::min((found - x).norm(), found.size() == 4 ? (found + x).norm() : 1.0), 1e-6);
    };
    const Eigen::MatrixXd positions = glb.motion(1, "translation"), rotations = glb.motion(1, "rotation");
    ASSERT_EQ(positions.cols(), glb.times().size());
    ASSERT_EQ(rotations.cols(), glb.times().size());
    expectNear(positions.rightCols(1), result["bodies"][0]["position"]);
    expectNear(rotations.rightCols(1), result["bodies"][0]["rotation"]);
    EXPECT_LT((rotations.colwise().norm().array() - 1).abs().maxCoeff(), 1e-6);
    for (int i = 1; i < rotations.cols(); ++i) EXPECT_GE(rotations.col(i).dot(rotations.col(i - 1)), 0) << i;
    for (const int node : {2, 3}) {  // that stand
        EXPECT_EQ(glb.motion(node, "translation").size() + glb.motion(node, "rotation").size(), 0);
        const auto& numbers = glb.json()["nodes"][node];
        const auto position = numbers["translation"].get<std::vector<double>>();
        const auto rotation = numbers["rotation"].get<std::vector<double>>();
        expectNear(Eigen::Map<const Eigen::VectorXd>(position.data(), 3), result["bodies"][node - 1]["position"]);
        expectNear(Eigen::Map<const Eigen::VectorXd>(rotation.data(), 4), result["bodies"][node - 1]["rotation"]);
    }
    const Eigen::MatrixXd ground = glb.positions(2, 0);
    const Eigen::VectorXd heights = Vec3(0.6, 0.8, 0).transpose() * ground;
    EXPECT_LT((heights.array() + 1).abs().maxCoeff(), 1e-5);
}

TEST_F(GlbOfRun, HasTwoShellsAndNoBodies) {
    const Glb glb = run(kTwoSheets, {"--quiet"});
    EXPECT_EQ(m_run.out, "");
    ASSERT_EQ(glb.json()["nodes"].size(), 2u);
    EXPECT_EQ(glb.json()["nodes"][1]["name"], "lower");
    ASSERT_EQ(glb.times().size(), 10);
    expectRecordedMotion(glb, 0, 1.0 / 30);
    expectRecordedMotion(glb, 1, 1.0 / 30);
    EXPECT_GT((glb.positions(1, 9) - glb.positions(1, 0)).norm(), 0.1);
}

TEST_F(GlbOfRun, KeepsFewerFramesOfALongRunButAlwaysItsEnd) {
    const Glb glb = run(kTwoSheets, {"--seconds", "8.9"});  // 267 frames
    const Eigen::VectorXd times = glb.times();
    ASSERT_EQ(times.size(), 135);
    EXPECT_NEAR(times[1], 2.0 / 30, 1e-6);
    EXPECT_NEAR(times[134], 8.9, 1e-6);
    for (int i = 1; i < times.size(); ++i) EXPECT_LT(times[i - 1], times[i]);
    expectRecordedMotion(glb, 1, 1.0 / 30);
}

TEST_F(GlbOfRun, IsOfTheWholeRunWhenThatIsResumed) {
    run(kBallOnSheet, {"--seconds", "0.1"});
    const Outcome resumed = jacket({"resume", out(), "--seconds", "0.2", "--quiet", "--glb"});
    ASSERT_EQ(resumed.exitCode, 0) << resumed.err;
    EXPECT_NEAR(Glb(out() / "anim.glb").times().maxCoeff(), 0.2, 1e-6);
}

TEST_F(GlbOfRun, LeavesOutWhatIsFartherAwayThanNumbersReach) {
    Json scene = parseJson(kTwoSheets, "sheets.json");
    scene["shells"][1]["initial_velocity"] = {1e200, 0, 0};
    EXPECT_NE(jacket({"run", m_folder.write("scene.json", scene.dump()), "--out", out(), "--glb", "--quiet"}).exitCode,
              0);
    const Glb glb(out() / "anim.glb");
    EXPECT_FALSE(glb.json().contains("animations"));
    EXPECT_EQ(glb.json()["bufferViews"].size(), 2u);
    EXPECT_LT(glb.positions(1, 0).norm(), 10);
}

TEST_F(GlbOfRun, IsNotThereWhenTheRunFails) {
    const std::string scene = m_folder.write("scene.json", kBallOnSheet);
    EXPECT_EQ(jacket({"run", scene, "--glb"}).exitCode, 2);
    EXPECT_EQ(jacket({"run", scene, "--out", scene, "--glb"}).exitCode, 2);
    EXPECT_EQ(m_folder.entries(), 1);

    ASSERT_EQ(jacket({"run", scene, "--seconds", "0.1", "--out", out(), "--quiet"}).exitCode, 0);
    Json other = parseJson(TemporaryFolder::read(out() / "scene.json"), "scene.json");
    other["bodies"][0]["mass"] = 0.51;  // so that the run ends where the earlier one did, in another state
    m_folder.write("out/scene.json", other.dump());
    EXPECT_EQ(jacket({"resume", out(), "--seconds", "0.2", "--glb"}).exitCode, 2);
    EXPECT_FALSE(fs::exists(out() / "anim.glb"));
    EXPECT_EQ(m_folder.entries(), 2);
}

}  // namespace
}  // namespace jacket::demo
