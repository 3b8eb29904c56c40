#include "Png.h"

#include <png.h>

#include <stdexcept>

namespace jacket::demo {

namespace {

std::runtime_error pngError(const std::filesystem::path& file, const png_image& png) {
    return std::runtime_error(file.string() + ": " + png.message);
}

}  // namespace

void writePng(const std::filesystem::path& file, const Image& image) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = static_cast<png_uint_32>(image.width);
    png.height = static_cast<png_uint_32>(image.height);
    png.format = PNG_FORMAT_RGB;
    if (!png_image_write_to_file(&png, file.c_str(), 0, image.rgb.data(), 0, nullptr)) throw pngError(file, png);
}

Image readPng(const std::filesystem::path& file) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    if (!png_image_begin_read_from_file(&png, file.c_str())) throw pngError(file, png);
    png.format = PNG_FORMAT_RGB;
    Image image{static_cast<int>(png.width), static_cast<int>(png.height), {}};
    image.rgb.resize(PNG_IMAGE_SIZE(png));
    if (!png_image_finish_read(&png, nullptr, image.rgb.data(), 0, nullptr)) throw pngError(file, png);
    return image;
}

}  // namespace jacket::demo
