#pragma once
#include <array>
#include <cstdint>
#include <string>

#include "Json.h"

namespace jacket::demo {

/// A binary glTF 2.0 file (Khronos, ISO/IEC 12113) while it is put together: the lists of its JSON, and the numbers of
/// its buffer. Entries refer to each other by index.
class GltfFile {
  public:
    /// Appends to one of the lists at the top, "nodes" or "meshes" for example; returns the entry's index.
    int add(const std::string& list, const Json& entry);

    /// Accessors to numbers, a column per element; they return the accessor's index.
    int addVertices(const Eigen::Matrix3Xf& values);
    int addIndices(const Indices<3>& triangles);
    int addKeys(const Eigen::MatrixXf& values);  ///< of an animation

    /// The whole file: a scene of all nodes. `generator` names the program that made it.
    std::string bytes(const std::string& generator, const std::string& sceneName) const;

  private:
    /// One bufferView each: the specification wants data of different use apart.
    enum Part { kVertices, kIndices, kKeys, kPartCount };
    template <class Matrix>
    int addAccessor(Part part, const Matrix& values);
    Json document(const std::string& generator, const std::string& sceneName) const;

    Json m_lists = Json::object();
    std::array<std::string, kPartCount> m_parts;
};

}  // namespace jacket::demo
