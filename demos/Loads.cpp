#include "Loads.h"

#include <numeric>

#include "jacket/TriangleMesh.h"

namespace jacket::demo {

std::vector<double> evenShares(const HalfEdgeMesh& mesh, const Points& rest, const std::vector<int>& vertices) {
    std::vector<char> selected(mesh.vertexCount(), 0);
    for (const int v : vertices) selected[v] = 1;
    std::vector<double> weight(mesh.vertexCount(), 0.0);
    double total = 0.0;
    const auto add = [&](std::initializer_list<int> corners, double size) {
        for (const int v : corners)
            if (!selected[v]) return;
        for (const int v : corners) weight[v] += size / static_cast<double>(corners.size());
        total += size;
    };

    const auto& triangles = mesh.triangles();
    for (int t = 0; t < triangles.cols(); ++t) {
        const int a = triangles(0, t), b = triangles(1, t), c = triangles(2, t);
        add({a, b, c}, triangleArea(rest.col(a), rest.col(b), rest.col(c)));
    }
    if (total == 0.0)
        for (const auto& edge : mesh.edges()) add({edge.v0, edge.v1}, (rest.col(edge.v0) - rest.col(edge.v1)).norm());
    if (total == 0.0)
        for (const int v : vertices) add({v}, 1.0);

    std::vector<double> shares;
    for (const int v : vertices) shares.push_back(weight[v] / total);
    return shares;
}

}  // namespace jacket::demo
