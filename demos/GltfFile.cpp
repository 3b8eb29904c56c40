#include "GltfFile.h"

#include <bit>
#include <type_traits>

namespace jacket::demo {

static_assert(std::endian::native == std::endian::little, "glTF files are little endian");

namespace {

// Numbers that the specification gives names to.
constexpr int kUnsignedInt = 5125, kFloat = 5126;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr std::uint32_t kMagic = 0x46546C67, kVersion = 2, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;
constexpr std::uint32_t kHeaderBytes = 12, kChunkHeaderBytes = 8;

const char* typeOf(Eigen::Index rows) {
    return rows == 1 ? "SCALAR" : rows == 3 ? "VEC3" : "VEC4";
}

/// One number, or a list of them.
template <class Column>
Json listOf(const Column& values) {
    return std::vector<typename Column::Scalar>(values.begin(), values.end());
}

void append(std::string& bytes, std::uint32_t number) {
    bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
}

/// Chunks are multiples of four bytes long.
std::string padded(std::string bytes, char filling) {
    bytes.resize((bytes.size() + 3) / 4 * 4, filling);
    return bytes;
}

void appendChunk(std::string& file, std::uint32_t type, const std::string& content) {
    append(file, static_cast<std::uint32_t>(content.size()));
    append(file, type);
    file += content;
}

}  // namespace

int GltfFile::add(const std::string& list, const Json& entry) {
    m_lists[list].push_back(entry);
    return static_cast<int>(m_lists[list].size()) - 1;
}

/// The bounds are required of positions and of times, and do no harm elsewhere.
template <class Matrix>
int GltfFile::addAccessor(Part part, const Matrix& values) {
    std::string& bytes = m_parts[part];
    const Json accessor{{"bufferView", part},
                        {"byteOffset", bytes.size()},
                        {"componentType", std::is_same_v<typename Matrix::Scalar, float> ? kFloat : kUnsignedInt},
                        {"count", values.cols()},
                        {"type", typeOf(values.rows())},
                        {"min", listOf(values.rowwise().minCoeff().eval())},
                        {"max", listOf(values.rowwise().maxCoeff().eval())}};
    bytes.append(reinterpret_cast<const char*>(values.data()), sizeof(typename Matrix::Scalar) * values.size());
    return add("accessors", accessor);
}

int GltfFile::addVertices(const Eigen::Matrix3Xf& values) {
    return addAccessor(kVertices, values);
}

int GltfFile::addKeys(const Eigen::MatrixXf& values) {
    return addAccessor(kKeys, values);
}

int GltfFile::addIndices(const Indices<3>& triangles) {
    return addAccessor(kIndices, triangles.cast<std::uint32_t>().reshaped<Eigen::AutoOrder>().transpose().eval());
}

/// Keys come last, as only they may be missing, and the others' indices are those of their parts.
Json GltfFile::document(const std::string& generator, const std::string& sceneName) const {
    Json document{{"asset", {{"version", "2.0"}, {"generator", generator}}}, {"scene", 0}};
    document.update(m_lists);
    Json nodes = Json::array(), views = Json::array();
    for (std::size_t i = 0; i < document["nodes"].size(); ++i) nodes.push_back(i);
    document["scenes"] = Json::array({{{"name", sceneName}, {"nodes", nodes}}});
    std::size_t offset = 0;
    for (int part = 0; part < kPartCount && !m_parts[part].empty(); ++part) {
        Json view{{"buffer", 0}, {"byteOffset", offset}, {"byteLength", m_parts[part].size()}};
        if (part == kVertices) view["byteStride"] = 3 * sizeof(float);
        if (part != kKeys) view["target"] = part == kVertices ? kArrayBuffer : kElementArrayBuffer;
        views.push_back(view);
        offset += m_parts[part].size();
    }
    document["bufferViews"] = views;
    document["buffers"] = Json::array({{{"byteLength", offset}}});
    return document;
}

std::string GltfFile::bytes(const std::string& generator, const std::string& sceneName) const {
    const std::string json = padded(document(generator, sceneName).dump(), ' ');
    std::string numbers;
    for (const std::string& part : m_parts) numbers += part;
    numbers = padded(numbers, '\0');
    std::string file;
    append(file, kMagic);
    append(file, kVersion);
    append(file, static_cast<std::uint32_t>(kHeaderBytes + 2 * kChunkHeaderBytes + json.size() + numbers.size()));
    appendChunk(file, kJsonChunk, json);
    appendChunk(file, kBinaryChunk, numbers);
    return file;
}

}  // namespace jacket::demo
