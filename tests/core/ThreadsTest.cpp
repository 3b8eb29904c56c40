#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <stdexcept>
#include <vector>

#include "energy/ColouredRanges.h"
#include "jacket/Island.h"
#include "jacket/WorkerTeam.h"
#include "solver/CompactShell.h"

/// Threads that share a solve: every part once, and the same bits for any number of them.
namespace jacket {
namespace {

TEST(WorkerTeam, DoesEveryPartOnce) {
    for (const int threads : {1, 2, 3, 5}) {
        WorkerTeam team(threads);
        EXPECT_EQ(team.threads(), threads);
        for (const int count : {0, 1, 2, 7, 100, 65535, 140000}) {  // one piece has 65535 at most
            std::vector<std::atomic<int>> calls(count);
            team.run(count, [&](int i) { ++calls[i]; });
            for (const auto& call : calls) EXPECT_EQ(call, 1);
        }
    }
}

TEST(WorkerTeam, SeesWhatThePieceBeforeHasWritten) {
    constexpr int kParts = 11, kPieces = 3000;
    WorkerTeam team(4);
    std::vector<int> numbers(kParts, 0), next(kParts);
    for (int piece = 0; piece < kPieces; ++piece) {
        team.run(kParts, [&](int i) { next[i] = numbers[(i + 1) % kParts] + 1; });
        std::swap(numbers, next);
    }
    EXPECT_EQ(numbers, std::vector<int>(kParts, kPieces));
}

TEST(WorkerTeam, RefusesNoThreads) {
    EXPECT_THROW(WorkerTeam(0), std::invalid_argument);
    EXPECT_THROW(WorkerTeam(-1), std::invalid_argument);
}

TEST(WorkerTeam, CutsRangesThatCoverAll) {
    WorkerTeam two(2);
    for (WorkerTeam* const team : {static_cast<WorkerTeam*>(nullptr), &two})
        for (const int size : {0, 1, 4, 5, 8, 41}) {
            std::vector<int> visits(size, 0);
            runRanges(team, size, 4, [&](int begin, int end) {
                for (int i = begin; i < end; ++i) ++visits[i];
            });
            EXPECT_EQ(visits, std::vector<int>(size, 1));
        }
}

TEST(ColouredRanges, HaveNoVertexInCommonAndMissNoTriangle) {
    const TriangleMesh mesh = makeGrid({.size = {1, 1}, .cells = {50, 50}});
    std::vector<std::array<int, 3>> triangles;
    for (int t = 0; t < mesh.triangles.cols(); ++t) {
        const auto c = mesh.triangles.col(t);
        triangles.push_back({c[0], c[1], c[2]});
    }
    std::vector<int> visits(triangles.size(), 0);
    ColouredRanges(triangles).run(nullptr, [&](int begin, int end) {
        EXPECT_EQ(begin % 8, 0);
        for (int t = begin; t < end; ++t) ++visits[t];
    });
    EXPECT_EQ(visits, std::vector<int>(triangles.size(), 1));
}

/// All triangles share one vertex, so that no two ranges may run at the same time.
TEST(ColouredRanges, TakeOneByOneWhatMeetsEverywhere) {
    std::vector<std::array<int, 3>> fan;
    for (int t = 0; t < 100000; ++t) fan.push_back({0, t + 1, t + 2});
    WorkerTeam team(3);
    std::atomic<int> running{0}, most{0}, visited{0};
    ColouredRanges(fan).run(&team, [&](int begin, int end) {
        most = std::max(most.load(), ++running);
        visited += end - begin;
        --running;
    });
    EXPECT_EQ(most, 1);
    EXPECT_EQ(visited, 100000);
}

/// A fixed ball, by its formula.
class Ball : public ContactDetector {
  public:
    Vec3 centre{0, -0.4, 0};
    double radius = 0.4;

    void find(const ContactPose& pose, double vertexReach, double, std::vector<Contact>& contacts) override {
        const Points& x = *pose.positions[0];
        for (int i = 0; i < x.cols(); ++i) {
            const Vec3 from = x.col(i) - centre;
            Contact contact{.feature = i, .vertices = {i, i, i}, .normal = from.normalized(), .friction = 0.3};
            contact.point = centre + radius * contact.normal;
            contact.gap = from.norm() - radius - 1e-3;
            if (contact.gap <= vertexReach) contacts.push_back(contact);
        }
    }
};

constexpr int kVertices = 60;  // along a side: enough for two strips and a coarse space

Shell clothAboveBall() {
    ShellMaterial material{.young = 1e7, .poisson = 0.3, .thickness = 1e-3, .density = 200.0};
    material.bendingStiffnessOverride = 1e-4;
    Shell cloth(makeGrid({.size = {2, 2}, .cells = {kVertices - 1, kVertices - 1}}), material);
    Points x = cloth.positions();
    x.row(1).array() += 0.02;
    cloth.setPositions(x);
    for (int i = 0; i < kVertices; ++i) cloth.pin(i);
    return cloth;
}

/// Where the cloth is after some steps; `contacts` is how many the last one had.
Points drape(WorkerTeam* team, std::size_t* contacts) {
    constexpr int kSteps = 10;
    Shell cloth = clothAboveBall();
    Shell* const shells[] = {&cloth};
    Ball ball;
    IslandSolver solver;
    for (int step = 0; step < kSteps; ++step) {
        CoupledBody body{.position = ball.centre, .radius = ball.radius, .key = &ball, .prescribed = true};
        IslandInput input;
        input.shells = shells;
        input.bodies = {&body, 1};
        input.contacts = &ball;
        input.team = team;
        const StepReport report = solver.solve(input);
        EXPECT_TRUE(report.finite);
        *contacts = report.contacts.size();
        cloth.advance(input.h);
    }
    return cloth.positions();
}

TEST(Threads, GiveTheSameBits) {
    std::size_t contacts = 0;
    const Points alone = drape(nullptr, &contacts);
    EXPECT_GT(contacts, 20u);
    for (const int threads : {1, 2, 3, 5}) {
        WorkerTeam team(threads);
        std::size_t ofTeam = 0;
        const Points together = drape(&team, &ofTeam);
        EXPECT_TRUE((together.array() == alone.array()).all()) << threads;
        EXPECT_EQ(ofTeam, contacts);
    }
}

TEST(Threads, FindStripsThatOnlySeparatorsJoin) {
    BlockMatrix matrix;
    const Shell cloth = clothAboveBall();
    std::vector<std::pair<int, int>> pairs;
    for (const auto& edge : cloth.mesh().edges()) pairs.emplace_back(edge.v0, edge.v1);
    matrix.setPattern(cloth.vertexCount(), pairs);
    const CompactMatrix compact(matrix);
    const std::vector<int>& starts = compact.partStarts();
    ASSERT_EQ(compact.stripCount(), 2);
    ASSERT_EQ(starts.size(), 4u);
    EXPECT_EQ(starts.front(), 0);
    EXPECT_EQ(starts.back(), compact.size());
    const auto partOf = [&](int row) {
        return std::upper_bound(starts.begin(), starts.end(), row) - starts.begin() - 1;
    };
    for (int row = 0; row < compact.size(); ++row)
        compact.forColumns(row, [&](int column) {
            const auto a = partOf(row), b = partOf(column);
            EXPECT_TRUE(a == b || a == 2 || b == 2) << row;
        });
}

}  // namespace
}  // namespace jacket
