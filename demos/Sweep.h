#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "Json.h"

/// Many runs of one scene: a plan on disk, a directory for each case.
namespace jacket::demo {

/// One value that cases differ in.
struct SweepAxis {
    std::string path;  ///< as --set takes it
    std::vector<std::string> values;
};

struct SweepPlan {
    std::filesystem::path folder;  ///< that holds plan.json and the cases
    std::string scene;             ///< name of a bundled scene, or an absolute path
    std::vector<SweepAxis> axes;

    int cases() const;
    /// The "path=value" of each axis. The last axis runs fastest.
    std::vector<std::string> changes(int index) const;
    std::string label(int index) const;  ///< "case 1 (dt=1/60, shells.0.friction=0.3)", for messages
    std::filesystem::path folderOf(int index) const;
    bool isDone(int index) const;
};

/// "path=a,b,[1,2]": commas inside brackets and quotes separate nothing. Throws InputError.
SweepAxis parseSweepAxis(const std::string& text);

/// Checks that every case is a scene that can be built, and writes folder/plan.json. An equal plan that is there
/// already is left alone, any other is refused: throws InputError.
void writePlan(const SweepPlan& plan);
/// From plan.json or the directory that holds it; throws InputError.
SweepPlan readPlan(const std::filesystem::path& place);

/// A line for each finished case, with what it was set to and what came out; a column for whatever any case has.
std::string collectCsv(const SweepPlan& plan);

}  // namespace jacket::demo
