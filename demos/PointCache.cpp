#include "PointCache.h"

#include <bit>
#include <cstdint>
#include <stdexcept>

namespace jacket::demo {

static_assert(std::endian::native == std::endian::little, "PC2 files are little endian");

namespace {

constexpr std::streamoff kSamplesOffset = 28;

template <class T>
void write(std::ofstream& file, const T& value) {
    file.write(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

PointCacheWriter::PointCacheWriter(const std::filesystem::path& file, int points)
    : m_path(file), m_file(file, std::ios::binary) {
    m_file.write("POINTCACHE2", 12);
    write(m_file, std::int32_t{1});
    write(m_file, std::int32_t{points});
    write(m_file, 0.0f);
    write(m_file, 1.0f);
    write(m_file, std::int32_t{0});
}

void PointCacheWriter::add(const Points& positions) {
    const Eigen::Matrix3Xf sample = positions.cast<float>();
    m_file.write(reinterpret_cast<const char*>(sample.data()),
                 static_cast<std::streamsize>(sizeof(float)) * sample.size());
    ++m_samples;
}

void PointCacheWriter::finish() {
    m_file.seekp(kSamplesOffset);
    write(m_file, std::int32_t{m_samples});
    m_file.close();
    if (!m_file) throw std::runtime_error(m_path.string() + ": cannot be written");
}

}  // namespace jacket::demo
