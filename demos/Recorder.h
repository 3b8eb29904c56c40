#pragma once
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "Measure.h"
#include "PointCache.h"

namespace jacket::demo {

/// What a command writes into its directory. Nothing but this may be replaced.
struct OutputKind {
    const char* marker;  ///< the file by which an earlier result is known
    const char* paths;   ///< regular expression for every file and folder in it, as in "frames/000000.png"
};

inline constexpr OutputKind kRunOutput{
    "result.json", R"(scene\.json|result\.json|log\.csv|mesh_\d+\.(obj|pc2)|view\.html|anim\.glb|frames(/\d+\.png)?)"};

/// A directory that appears whole or not at all: it is filled under another name beside its place, which the
/// destructor removes unless commit() has moved it there. A place that is a link stands for where the link leads.
class OutputDirectory {
  public:
    /// Throws InputError when the place is taken by anything but an empty directory or an earlier result of this kind,
    /// also when something else is in there beside that.
    explicit OutputDirectory(const std::filesystem::path& place, const OutputKind& kind = kRunOutput);
    ~OutputDirectory();
    OutputDirectory(const OutputDirectory&) = delete;
    OutputDirectory& operator=(const OutputDirectory&) = delete;

    /// What the constructor asks, without touching anything.
    static void requireFree(const std::filesystem::path& place, const OutputKind& kind = kRunOutput);

    const std::filesystem::path& folder() const { return m_folder; }  ///< where to write until commit()
    const std::filesystem::path& place() const { return m_place; }
    /// Throws std::runtime_error when it cannot be put in place, or somebody has meanwhile put files of their own
    /// there; folder() stays then.
    void commit();

  private:
    void makeFolder(const std::filesystem::path& asGiven);

    OutputKind m_kind;
    std::filesystem::path m_place, m_folder;
    std::vector<std::filesystem::path> m_madeParents;  ///< innermost first
    bool m_isKept = false;                             ///< the folder, or it has become the place
};

/// Files that are written while a scene runs: scene.json, mesh_K.obj, mesh_K.pc2, log.csv; at the end result.json.
class Recorder {
  public:
    Recorder(const std::filesystem::path& folder, const World& start);
    void add(const FrameRecord& frame, const World& world);
    void finish(const Json& result);  ///< throws std::runtime_error when a file could not be written

  private:
    std::filesystem::path m_folder;
    std::ofstream m_log;
    std::vector<PointCacheWriter> m_caches;
};

/// Throws std::runtime_error when the file could not be written.
void writeText(const std::filesystem::path& file, const std::string& text);

}  // namespace jacket::demo
