#include "jacket/HalfEdgeMesh.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "mesh/EdgeTable.h"

namespace jacket {
namespace {

std::string triangleName(const Indices<3>& triangles, int t) {
    return "triangle " + std::to_string(t) + " (" + std::to_string(triangles(0, t)) + " " +
           std::to_string(triangles(1, t)) + " " + std::to_string(triangles(2, t)) + ")";
}

void requireIndices(const Indices<3>& triangles, int vertexCount) {
    if (vertexCount < 0)
        throw std::invalid_argument("HalfEdgeMesh: the vertex count must be >= 0, got " + std::to_string(vertexCount));
    for (int t = 0; t < triangles.cols(); ++t)
        for (int k = 0; k < 3; ++k) {
            const int v = triangles(k, t);
            if (v < 0 || v >= vertexCount)
                throw std::invalid_argument(triangleName(triangles, t) + ": names vertex " + std::to_string(v) +
                                            "; indices must lie in 0.." + std::to_string(vertexCount - 1));
            if (v == triangles((k + 1) % 3, t))
                throw std::invalid_argument(triangleName(triangles, t) + ": repeats vertex " + std::to_string(v) +
                                            "; the three must differ");
        }
}

/// Turns counts per vertex, stored one place to the right, into the start of each vertex's list.
void countsToStarts(std::vector<int>& counts) {
    for (std::size_t v = 1; v < counts.size(); ++v) counts[v] += counts[v - 1];
}

}  // namespace

HalfEdgeMesh::HalfEdgeMesh(const Indices<3>& triangles, int vertexCount)
    : m_vertexCount(vertexCount), m_triangles(triangles) {
    requireIndices(m_triangles, vertexCount);
    const int halfEdgeCount = 3 * triangleCount();

    // Twins: the two half-edges of an edge, which must run in opposite directions.
    std::vector<int> twins(halfEdgeCount, -1);
    const EdgeTable table(m_triangles, vertexCount, [](int) { return true; });
    table.forEachEdge([&](auto first, auto last) {
        if (last - first == 1) return;
        const int g = first[0], h = first[1];
        const std::string edge = "edge " + std::to_string(table.from(g)) + "-" + std::to_string(table.to(g));
        if (last - first > 2)
            throw std::invalid_argument(edge + ": has " + std::to_string(last - first) +
                                        " triangles; at most two may share an edge");
        if (table.from(g) == table.from(h))
            throw std::invalid_argument(edge + ": triangles " + std::to_string(g / 3) + " and " +
                                        std::to_string(h / 3) +
                                        " both run along it in this direction; neighbours must be oriented alike");
        twins[g] = h;
        twins[h] = g;
    });

    // Edges in the order of their first half-edges, so that neighbours in memory are neighbours on the surface.
    m_edgeOf.assign(halfEdgeCount, -1);
    m_borderVertex.assign(vertexCount, 0);
    m_edges.reserve(halfEdgeCount / 2 + 1);
    for (int h = 0; h < halfEdgeCount; ++h) {
        if (m_edgeOf[h] >= 0) continue;
        const int edge = static_cast<int>(m_edges.size()), v0 = table.from(h), v1 = table.to(h), other = twins[h];
        m_edges.push_back({.v0 = v0, .v1 = v1, .halfEdge = h, .twin = other});
        m_edgeOf[h] = edge;
        if (other >= 0) {
            m_edgeOf[other] = edge;
        } else {
            m_borderVertex[v0] = m_borderVertex[v1] = 1;
        }
    }
    m_edges.shrink_to_fit();

    // Triangles of each vertex, as lists one behind the other.
    m_triangleStart.assign(vertexCount + 1, 0);
    for (int h = 0; h < halfEdgeCount; ++h) ++m_triangleStart[table.from(h) + 1];
    countsToStarts(m_triangleStart);
    m_triangleList.resize(halfEdgeCount);
    std::vector<int> fill(m_triangleStart.begin(), m_triangleStart.end() - 1);
    for (int h = 0; h < halfEdgeCount; ++h) m_triangleList[fill[table.from(h)]++] = h / 3;
}

std::vector<HalfEdgeMesh::Hinge> HalfEdgeMesh::hinges() const {
    std::vector<Hinge> result;
    const auto opposite = [this](int h) { return m_triangles((h + 2) % 3, h / 3); };
    for (std::size_t i = 0; i < m_edges.size(); ++i) {
        const Edge& e = m_edges[i];
        if (e.isBorder()) continue;
        result.push_back(
            {.vertices = {e.v0, e.v1, opposite(e.halfEdge), opposite(e.twin)}, .edge = static_cast<int>(i)});
    }
    return result;
}

int HalfEdgeMesh::triangleAcross(int triangle, int corner) const {
    const int other = twin(3 * triangle + corner);
    return other < 0 ? -1 : other / 3;
}

std::span<const int> HalfEdgeMesh::trianglesAround(int vertex) const {
    return {m_triangleList.data() + m_triangleStart[vertex], m_triangleList.data() + m_triangleStart[vertex + 1]};
}

std::vector<int> HalfEdgeMesh::neighbours(int vertex) const {
    std::vector<int> result;
    for (const int t : trianglesAround(vertex))
        for (int k = 0; k < 3; ++k)
            if (m_triangles(k, t) != vertex) result.push_back(m_triangles(k, t));
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
}

}  // namespace jacket
