#pragma once
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "Measure.h"
#include "PointCache.h"

namespace jacket::demo {

/// A directory that appears whole or not at all: it is filled under another name beside its place, which the
/// destructor removes unless commit() has moved it there.
class OutputDirectory {
  public:
    /// Throws InputError when the place is taken by anything but an empty directory or an earlier result, which is one
    /// that holds a file named `marker`.
    explicit OutputDirectory(const std::filesystem::path& place, const std::string& marker = "result.json");
    ~OutputDirectory();
    OutputDirectory(const OutputDirectory&) = delete;
    OutputDirectory& operator=(const OutputDirectory&) = delete;

    /// What the constructor asks, without touching anything.
    static void requireFree(const std::filesystem::path& place, const std::string& marker = "result.json");

    const std::filesystem::path& folder() const { return m_folder; }  ///< where to write until commit()
    const std::filesystem::path& place() const { return m_place; }
    void commit();

  private:
    std::filesystem::path m_place, m_folder;
    bool m_committed = false;
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
