#pragma once
#include <algorithm>
#include <vector>

#include "jacket/Types.h"

namespace jacket {

/// The half-edges of a triangle mesh sorted by undirected edge, so that those of one edge are neighbours.
/// Half-edge 3 t + k runs from corner k of triangle t to corner (k + 1) % 3.
class EdgeTable {
  public:
    /// Takes the triangles for which keep(t) is true; their indices must lie in 0..vertexCount-1.
    template <typename Keep>
    EdgeTable(const Indices<3>& triangles, int vertexCount, Keep keep) : m_triangles(triangles) {
        // A bucket per lower vertex, then a small sort in each: linear for ordinary meshes.
        std::vector<int> start(static_cast<std::size_t>(vertexCount) + 1, 0);
        const int triangleCount = static_cast<int>(triangles.cols());
        for (int t = 0; t < triangleCount; ++t)
            if (keep(t))
                for (int k = 0; k < 3; ++k) ++start[lower(3 * t + k) + 1];
        for (int v = 0; v < vertexCount; ++v) start[v + 1] += start[v];
        m_halfEdges.resize(start[vertexCount]);
        std::vector<int> fill(start.begin(), start.end() - 1);
        for (int t = 0; t < triangleCount; ++t)
            if (keep(t))
                for (int h = 3 * t; h < 3 * t + 3; ++h) m_halfEdges[fill[lower(h)]++] = h;
        const auto byUpper = [this](int g, int h) { return upper(g) != upper(h) ? upper(g) < upper(h) : g < h; };
        for (int v = 0; v < vertexCount; ++v)
            std::sort(m_halfEdges.begin() + start[v], m_halfEdges.begin() + start[v + 1], byUpper);
    }

    int from(int h) const { return m_triangles(h % 3, h / 3); }
    int to(int h) const { return m_triangles((h + 1) % 3, h / 3); }
    int lower(int h) const { return std::min(from(h), to(h)); }
    int upper(int h) const { return std::max(from(h), to(h)); }

    /// Calls visit(first, last) with the half-edges of each edge, ascending.
    template <typename Visit>
    void forEachEdge(Visit visit) const {
        for (auto first = m_halfEdges.begin(); first != m_halfEdges.end();) {
            auto last = first + 1;
            while (last != m_halfEdges.end() && lower(*last) == lower(*first) && upper(*last) == upper(*first)) ++last;
            visit(first, last);
            first = last;
        }
    }

  private:
    const Indices<3>& m_triangles;
    std::vector<int> m_halfEdges;
};

}  // namespace jacket
