#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

namespace jacket::demo {

/// Pixels from the top left, row after row; sRGB.
struct Image {
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgb;  ///< 3 width height

    const std::uint8_t* at(int x, int y) const { return &rgb[3 * (static_cast<std::size_t>(y) * width + x)]; }
};

void writePng(const std::filesystem::path& file, const Image& image);  ///< throws std::runtime_error
Image readPng(const std::filesystem::path& file);                      ///< throws std::runtime_error

}  // namespace jacket::demo
