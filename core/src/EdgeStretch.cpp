#include "EdgeStretch.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "Kernel.h"

namespace jacket {
namespace {

constexpr int kLanes = 8;

JACKET_KERNEL void largestStretch(const HalfEdgeMesh::Edge* edges, int count, const double* restLength, const double* x,
                                  const double* v, double h, EdgeStretch* result) {
    double lengthening[kLanes] = {}, change[kLanes] = {};
    for (int first = 0; first < count; first += kLanes) {
        double edge[3][kLanes], velocity[3][kLanes], rest[kLanes];
        for (int l = 0; l < kLanes; ++l) {
            const int e = std::min(first + l, count - 1);  // the last one again where there are no more
            const int v0 = 3 * edges[e].v0, v1 = 3 * edges[e].v1;
            for (int k = 0; k < 3; ++k) edge[k][l] = x[v1 + k] - x[v0 + k];
            for (int k = 0; k < 3; ++k) velocity[k][l] = v[v1 + k] - v[v0 + k];
            rest[l] = restLength[e];
        }
        for (int l = 0; l < kLanes; ++l) {
            const double a0 = edge[0][l], a1 = edge[1][l], a2 = edge[2][l];
            const double b0 = a0 + h * velocity[0][l], b1 = a1 + h * velocity[1][l], b2 = a2 + h * velocity[2][l];
            const double now = std::sqrt(a0 * a0 + a1 * a1 + a2 * a2), then = std::sqrt(b0 * b0 + b1 * b1 + b2 * b2);
            const double inverse = 1.0 / rest[l], before = now > rest[l] ? now : rest[l];
            const double longer = (then - before) * inverse, other = std::abs(then - now) * inverse;
            lengthening[l] = longer > lengthening[l] ? longer : lengthening[l];
            change[l] = other > change[l] ? other : change[l];
        }
    }
    result->lengthening = *std::max_element(lengthening, lengthening + kLanes);
    result->change = *std::max_element(change, change + kLanes);
}

}  // namespace

EdgeStretch edgeStretch(const HalfEdgeMesh::Edge* edges, int count, const double* restLength, const double* x,
                        const double* v, double h, WorkerTeam* team) {
    constexpr int kMostParts = 8, kLeastAtATime = 1024;
    const int length = std::max(kLeastAtATime, (count + kMostParts - 1) / kMostParts);
    std::array<EdgeStretch, kMostParts> parts;
    runRanges(team, count, length, [&](int begin, int end) {
        largestStretch(edges + begin, end - begin, restLength + begin, x, v, h, &parts[begin / length]);
    });
    EdgeStretch result;
    for (const EdgeStretch& part : parts) {
        result.lengthening = std::max(result.lengthening, part.lengthening);
        result.change = std::max(result.change, part.change);
    }
    return result;
}

}  // namespace jacket
