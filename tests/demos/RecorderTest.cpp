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

std::string complaintAbout(const fs::path& place) {
    try {
        OutputDirectory::requireFree(place);
    } catch (const InputError& error) {
        return error.what();
    }
    return "accepted";
}

TEST(OutputDirectory, RefusesToReplaceFilesThatNoRunWrote) {
    const TemporaryFolder folder;
    fs::create_directories(folder / "run/frames");
    for (const char* name : {"scene.json", "result.json", "log.csv", "mesh_0.obj", "mesh_12.pc2", "view.html",
                             "anim.glb", "frames/000000.png", "frames/1000000.png"})
        folder.write(std::string("run/") + name, "");
    EXPECT_EQ(complaintAbout(folder / "run"), "accepted");
    for (const char* name : {"notes.txt", "mesh_a.obj", "result.json.bak", "frames/a.blend", ".git", "log.csv "}) {
        const fs::path mine = folder.write(std::string("run/") + name, "mine");
        EXPECT_NE(complaintAbout(folder / "run").find(std::string("run: holds ") + name), std::string::npos) << name;
        fs::remove(mine);
    }
    fs::create_directory(folder / "run/sub");
    EXPECT_NE(complaintAbout(folder / "run").find("holds sub"), std::string::npos);
    fs::remove(folder / "run/sub");
    fs::create_symlink(folder.path(), folder / "run/view.html.tmp");
    fs::rename(folder / "run/view.html.tmp", folder / "run/anim.glb");
    EXPECT_NE(complaintAbout(folder / "run").find("holds anim.glb"), std::string::npos);
}

TEST(OutputDirectory, KeepsFilesThatCameDuringTheRunAndTheResult) {
    const TemporaryFolder folder;
    fs::create_directory(folder / "run");
    folder.write("run/result.json", "old");
    fs::path kept;
    {
        OutputDirectory out(folder / "run");
        writeText(out.folder() / "result.json", "new");
        folder.write("run/notes.txt", "mine");
        EXPECT_THROW(out.commit(), std::runtime_error);
        kept = out.folder();
    }
    EXPECT_EQ(TemporaryFolder::read(folder / "run/notes.txt"), "mine");
    EXPECT_EQ(TemporaryFolder::read(folder / "run/result.json"), "old");
    EXPECT_EQ(TemporaryFolder::read(kept / "result.json"), "new");
}

TEST(OutputDirectory, WritesWhereALinkLeads) {
    const TemporaryFolder folder;
    fs::create_directory(folder / "disk");
    fs::create_directory_symlink(folder / "disk", folder / "link");
    {
        OutputDirectory out(folder / "link");
        writeText(out.folder() / "result.json", "new");
        out.commit();
    }
    EXPECT_TRUE(fs::is_symlink(folder / "link"));
    EXPECT_EQ(TemporaryFolder::read(folder / "disk/result.json"), "new");
    fs::create_directory_symlink(folder / "nowhere", folder / "broken");
    EXPECT_THROW(OutputDirectory{folder / "broken"}, InputError);
}

TEST(OutputDirectory, LeavesNoParentsBehindThatItMade) {
    const TemporaryFolder folder;
    fs::create_directory(folder / "a");
    { OutputDirectory out(folder / "a/b/c/run"); }
    EXPECT_TRUE(fs::is_empty(folder / "a"));
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
