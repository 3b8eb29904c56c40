#include "Recorder.h"

#include <gtest/gtest.h>

#include <cstring>

#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

namespace fs = std::filesystem;

TEST(OutputDirectory, AppearsOnlyWhenCommitted) {
    const TemporaryFolder folder;
    {
        OutputDirectory out(folder / "run");
        writeText(out.folder() / "result.json", "{}");
        EXPECT_FALSE(fs::exists(folder / "run"));
        out.commit();
    }
    EXPECT_TRUE(fs::exists(folder / "run/result.json"));
    EXPECT_EQ(folder.entries(), 1);
}

TEST(OutputDirectory, LeavesNothingBehindWhenItIsNotCommitted) {
    const TemporaryFolder folder;
    {
        OutputDirectory out(folder / "run");
        writeText(out.folder() / "log.csv", "1\n");
    }
    EXPECT_EQ(folder.entries(), 0);
}

TEST(OutputDirectory, ReplacesAnEarlierResultAndNothingElse) {
    const TemporaryFolder folder;
    fs::create_directories(folder / "run/frames");
    folder.write("run/result.json", "old");
    folder.write("run/frames/000000.png", "old");
    {
        OutputDirectory out(folder / "run/");
        writeText(out.folder() / "result.json", "new");
        EXPECT_EQ(TemporaryFolder::read(folder / "run/result.json"), "old");
        out.commit();
    }
    EXPECT_EQ(TemporaryFolder::read(folder / "run/result.json"), "new");
    EXPECT_FALSE(fs::exists(folder / "run/frames"));
    EXPECT_EQ(folder.entries(), 1);

    fs::create_directories(folder / "mine");
    folder.write("mine/letter.txt", "dear");
    EXPECT_THROW(OutputDirectory{folder / "mine"}, InputError);
    EXPECT_THROW(OutputDirectory{folder.write("file", "")}, InputError);
    EXPECT_EQ(TemporaryFolder::read(folder / "mine/letter.txt"), "dear");
    EXPECT_EQ(folder.entries(), 3);
}

TEST(PointCache, HasItsHeaderAndTheSamplesInOrder) {
    const TemporaryFolder folder;
    Points x(3, 2);
    x << 1, 2, 3, 4, 5, 6;
    PointCacheWriter cache(folder / "a.pc2", 2);
    cache.add(x);
    cache.add(2 * x);
    cache.finish();
    const std::string bytes = TemporaryFolder::read(folder / "a.pc2");
    ASSERT_EQ(bytes.size(), 32u + 2 * 2 * 3 * 4);
    EXPECT_EQ(bytes.substr(0, 12), std::string("POINTCACHE2\0", 12));
    std::int32_t numbers[5];
    std::memcpy(numbers, bytes.data() + 12, sizeof numbers);
    EXPECT_EQ(numbers[0], 1);
    EXPECT_EQ(numbers[1], 2);
    EXPECT_EQ(numbers[4], 2);
    float last[3];
    std::memcpy(last, bytes.data() + bytes.size() - sizeof last, sizeof last);
    EXPECT_EQ(last[0], 4);
    EXPECT_EQ(last[1], 8);
    EXPECT_EQ(last[2], 12);
}

}  // namespace
}  // namespace jacket::demo
