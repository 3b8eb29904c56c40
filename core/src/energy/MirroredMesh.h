#pragma once
#include <array>
#include <vector>

#include "jacket/HalfEdgeMesh.h"

namespace jacket {

/// A plane beyond which a shell goes on as its mirror image: along a clamped edge, or where a symmetric scene is cut.
/// The rest shape has a plane of its own, so that a shell may be clamped at another angle than it was made.
struct MirrorPlane {
    std::vector<int> vertices;   ///< on the plane
    Vec3 restPoint, restNormal;  ///< unit normal
    Vec3 point, normal;          ///< the same in the world, unit normal
};

/// x -> linear x + offset.
struct AffineMap {
    Mat3 linear = Mat3::Identity();
    Vec3 offset = Vec3::Zero();
    Vec3 operator()(const Vec3& x) const { return linear * x + offset; }
};

/// A shell's triangles and, beyond its mirror planes, two rings of their images.
class MirroredMesh {
  public:
    /// A vertex of the shell, seen in a mirror; image 0 is the vertex itself.
    struct Node {
        int vertex, image;
    };
    /// `leftOut`: triangles that are nobody's neighbour; empty: none.
    MirroredMesh(const HalfEdgeMesh& mesh, const std::vector<MirrorPlane>& planes,
                 const std::vector<char>& leftOut = {});

    int nodeCount() const { return static_cast<int>(m_nodes.size()); }
    const Node& node(int i) const { return m_nodes[i]; }  ///< the first nodes are the shell's vertices
    const std::array<int, 3>& triangle(int t) const { return m_triangles[t]; }  ///< the first ones are the shell's
    const std::vector<int>& trianglesAround(int node) const { return m_around[node]; }
    bool isLeftOut(int triangle) const { return m_leftOut[triangle] != 0; }
    bool isOnPlane(int vertex) const { return m_onPlane[vertex] != 0; }
    const AffineMap& restImage(int image) const { return m_images[image].rest; }
    const AffineMap& worldImage(int image) const { return m_images[image].world; }

  private:
    struct Image {
        AffineMap rest, world;
        Vec3 normal = Vec3::Zero();  ///< of the plane; 0 for the shell itself and for images of images
        bool ofImage = false;
    };
    void reflect(const MirrorPlane& plane, int vertexCount);
    int imageNode(int node, const MirrorPlane& plane, const std::vector<char>& onPlane, std::vector<int>& imageOf,
                  std::vector<int>& nodeOf);
    std::vector<char> m_leftOut, m_onPlane;
    std::vector<Node> m_nodes;
    std::vector<std::array<int, 3>> m_triangles;
    std::vector<std::vector<int>> m_around;
    std::vector<Image> m_images;
};

}  // namespace jacket
