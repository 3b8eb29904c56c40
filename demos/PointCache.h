#pragma once
#include <filesystem>
#include <fstream>

#include "jacket/Types.h"

namespace jacket::demo {

/// Writes a PC2 point cache: the positions of all vertices at one moment after another. Little endian:
///     char[12] "POINTCACHE2\0"   int32 version = 1   int32 points   float32 first frame = 0   float32 frames per
///     sample = 1 int32 samples              (32 bytes) float32 x y z of every point, sample after sample
class PointCacheWriter {
  public:
    PointCacheWriter(const std::filesystem::path& file, int points);
    void add(const Points& positions);
    void finish();  ///< writes the number of samples; throws std::runtime_error when the file could not be written

  private:
    std::filesystem::path m_path;
    std::ofstream m_file;
    int m_samples = 0;
};

}  // namespace jacket::demo
