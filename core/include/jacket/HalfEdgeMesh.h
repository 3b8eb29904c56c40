#pragma once
#include <array>
#include <span>
#include <vector>

#include "jacket/Types.h"

namespace jacket {

/// Connectivity of a triangle mesh, immutable and apart from geometry. Half-edge 3 t + k of triangle t runs from its
/// corner k to its corner (k + 1) % 3. Accepts borders and several components; throws std::invalid_argument on an edge
/// with more than two triangles or two triangles of opposite orientation (naming the edge's vertices).
class HalfEdgeMesh {
  public:
    struct Edge {
        int v0, v1;    ///< end points, along half-edge `halfEdge`
        int halfEdge;  ///< of the first triangle
        int twin;      ///< half-edge of the second triangle, or -1 on the border
        bool isBorder() const { return twin < 0; }
    };
    /// Interior edge x0 x1 with the vertices opposite to it: triangles (x0 x1 x2) and (x1 x0 x3).
    struct Hinge {
        std::array<int, 4> vertices;
        int edge;
    };

    HalfEdgeMesh(const Indices<3>& triangles, int vertexCount);

    int vertexCount() const { return m_vertexCount; }
    int triangleCount() const { return static_cast<int>(m_triangles.cols()); }
    const Indices<3>& triangles() const { return m_triangles; }
    std::span<const Edge> edges() const { return m_edges; }
    std::vector<Hinge> hinges() const;  ///< in the order of their edges; listed anew by each call
    int edgeOf(int halfEdge) const { return m_edgeOf[halfEdge]; }
    int twin(int halfEdge) const {  ///< -1 on the border
        const Edge& edge = m_edges[m_edgeOf[halfEdge]];
        return edge.halfEdge == halfEdge ? edge.twin : edge.halfEdge;
    }
    int triangleAcross(int triangle, int corner) const;      ///< over half-edge (triangle, corner); -1 on the border
    std::span<const int> trianglesAround(int vertex) const;  ///< in no particular order
    std::vector<int> neighbours(int vertex) const;           ///< one-ring vertices, ascending; listed anew
    bool isBorderVertex(int vertex) const { return m_borderVertex[vertex] != 0; }

  private:
    int m_vertexCount;
    Indices<3> m_triangles;
    std::vector<int> m_edgeOf;
    std::vector<Edge> m_edges;
    std::vector<int> m_triangleStart, m_triangleList;
    std::vector<char> m_borderVertex;
};

}  // namespace jacket
