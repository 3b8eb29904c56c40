#pragma once
#include <algorithm>
#include <array>

#include "Kernel.h"
#include "jacket/models/TriangleTerm.h"
#include "solver/StepSystem.h"

/// The loops over triangles whose terms are computed several at a time. The order of all sums is fixed, and a
/// triangle's term does not depend on where in the list it stands: same bits in every run.
namespace jacket {

inline constexpr int kLanes = 8;  ///< triangles at a time

/// Triangles of one material, and what they remember.
template <class Rest>
struct TriangleList {
    const std::array<int, 3>* vertices;
    const std::array<int, 3>* slots;  ///< as of stencilSlots
    const Rest* rest;
    int count;
};

/// Numbers of a batch: one row of lanes each.
template <int N>
using Lanes = double[N][kLanes];

/// The rest data of the batch from `first` on; behind the last triangle that one's again, in `padded`.
template <class Rest>
JACKET_INLINE const Rest* restOf(const TriangleList<Rest>& list, int first, Rest* padded) {
    if (first + kLanes <= list.count) return list.rest + first;
    for (int l = 0; l < kLanes; ++l) padded[l] = list.rest[std::min(first + l, list.count - 1)];
    return padded;
}

template <class Rest>
JACKET_INLINE void gatherCorners(const TriangleList<Rest>& list, int first, const double* x, Lanes<9>& corners) {
    for (int l = 0; l < kLanes; ++l) {
        const auto& vertices = list.vertices[std::min(first + l, list.count - 1)];
        for (int a = 0; a < 3; ++a)
            for (int k = 0; k < 3; ++k) corners[3 * a + k][l] = x[3 * vertices[a] + k];
    }
}

JACKET_INLINE Triple edgeFrom0(const Lanes<9>& corners, int corner, int l) {
    const auto* to = corners + 3 * corner;
    return {to[0][l] - corners[0][l], to[1][l] - corners[1][l], to[2][l] - corners[2][l]};
}

/// Writes minus the sum of two blocks: what the first vertex has with another one, as nothing resists moving all three.
JACKET_INLINE void storeMinusSum(double (*to)[kLanes], int l, const PlainBlock& a, const PlainBlock& b, double factor) {
    const Triple c0 = a.c0 + b.c0, c1 = a.c1 + b.c1, c2 = a.c2 + b.c2;
    to[0][l] = -factor * c0.x, to[1][l] = -factor * c0.y, to[2][l] = -factor * c0.z;
    to[3][l] = -factor * c1.x, to[4][l] = -factor * c1.y, to[5][l] = -factor * c1.z;
    to[6][l] = -factor * c2.x, to[7][l] = -factor * c2.y, to[8][l] = -factor * c2.z;
}

JACKET_INLINE void storeSymmetric(double (*to)[kLanes], int l, const PlainBlock& b, double factor) {
    to[0][l] = factor * b.c0.x, to[1][l] = factor * b.c0.y, to[2][l] = factor * b.c0.z;
    to[3][l] = factor * b.c1.y, to[4][l] = factor * b.c1.z, to[5][l] = factor * b.c2.z;
}

JACKET_INLINE void store3(double (*to)[kLanes], int l, const Triple& v, double factor) {
    to[0][l] = factor * v.x, to[1][l] = factor * v.y, to[2][l] = factor * v.z;
}

/// The block itself, or its transpose where `turned`.
JACKET_INLINE PlainBlock turnedIf(bool turned, const PlainBlock& b) {
    return {{b.c0.x, turned ? b.c1.x : b.c0.y, turned ? b.c2.x : b.c0.z},
            {turned ? b.c0.y : b.c1.x, b.c1.y, turned ? b.c2.y : b.c1.z},
            {turned ? b.c0.z : b.c2.x, turned ? b.c1.z : b.c2.y, b.c2.z}};
}

JACKET_INLINE void addBlock(double* block, const double (*from)[kLanes], int l) {
    for (int k = 0; k < 9; ++k) block[k] += from[k][l];
}

JACKET_INLINE void addSymmetric(double* block, const double (*from)[kLanes], int l) {
    const double xy = from[1][l], xz = from[2][l], yz = from[4][l];
    block[0] += from[0][l], block[1] += xy, block[2] += xz;
    block[3] += xy, block[4] += from[3][l], block[5] += yz;
    block[6] += xz, block[7] += yz, block[8] += from[5][l];
}

/// Adds the positive part of the term of triangles begin to end - 1 at positions `x`. `begin` is a multiple of kLanes,
/// as is `end` unless it is the last one's.
template <class Model>
JACKET_KERNEL void addTriangles(const TriangleList<typename Model::Rest>& list, int begin, int end, const double* x,
                                const TermSink& sink) {
    typename Model::Rest padded[kLanes];
    for (int first = begin; first < end; first += kLanes) {
        const auto* rest = restOf(list, first, padded);
        Lanes<9> corners, gradient, block10, block20, block21;
        Lanes<6> block00, block11, block22;
        Lanes<3> turned;  // 1 where the block is stored as its transpose
        gatherCorners(list, first, x, corners);
        for (int l = 0; l < kLanes; ++l)
            for (int pair = 0; pair < 3; ++pair)
                turned[pair][l] = list.slots[std::min(first + l, list.count - 1)][pair] < 0 ? 1.0 : 0.0;

        const double g = sink.gradientFactor, h = sink.hessianFactor;
        for (int l = 0; l < kLanes; ++l) {
            const TriangleTerm t =
                Model::term(edgeFrom0(corners, 1, l), edgeFrom0(corners, 2, l), rest[l], HessianKind::Positive);
            store3(gradient, l, t.gradient1 + t.gradient2, -g);
            store3(gradient + 3, l, t.gradient1, g);
            store3(gradient + 6, l, t.gradient2, g);
            const PlainBlock block12 = t.block12, transposed = turnedIf(true, block12);
            const PlainBlock with1{t.block11.c0 + block12.c0, t.block11.c1 + block12.c1, t.block11.c2 + block12.c2};
            const PlainBlock with2{t.block22.c0 + transposed.c0, t.block22.c1 + transposed.c1,
                                   t.block22.c2 + transposed.c2};
            storeSymmetric(block00, l, {with1.c0 + with2.c0, with1.c1 + with2.c1, with1.c2 + with2.c2}, h);
            storeSymmetric(block11, l, t.block11, h);
            storeSymmetric(block22, l, t.block22, h);
            storeMinusSum(block10, l, t.block11, turnedIf(turned[0][l] != 0.0, block12), h);
            storeMinusSum(block20, l, t.block22, turnedIf(turned[1][l] == 0.0, block12), h);
            const PlainBlock m21 = turnedIf(turned[2][l] == 0.0, block12);
            store3(block21, l, m21.c0, h), store3(block21 + 3, l, m21.c1, h), store3(block21 + 6, l, m21.c2, h);
        }

        const int filled = std::min(kLanes, list.count - first);
        for (int l = 0; l < filled; ++l) {
            const auto& vertices = list.vertices[first + l];
            const auto& slots = list.slots[first + l];
            for (int a = 0; a < 3; ++a)
                for (int k = 0; k < 3; ++k) sink.rhs[3 * vertices[a] + k] += gradient[3 * a + k][l];
            addSymmetric(sink.diagonal + 9 * vertices[0], block00, l);
            addSymmetric(sink.diagonal + 9 * vertices[1], block11, l);
            addSymmetric(sink.diagonal + 9 * vertices[2], block22, l);
            addBlock(sink.lower + 9 * (slots[0] ^ (slots[0] >> 31)), block10, l);
            addBlock(sink.lower + 9 * (slots[1] ^ (slots[1] >> 31)), block20, l);
            addBlock(sink.lower + 9 * (slots[2] ^ (slots[2] >> 31)), block21, l);
        }
    }
}

/// Sum of the terms' energies at positions `x` [J].
template <class Model>
JACKET_KERNEL double energyOfTriangles(const TriangleList<typename Model::Rest>& list, const double* x) {
    typename Model::Rest padded[kLanes];
    double sums[kLanes] = {};
    for (int first = 0; first < list.count; first += kLanes) {
        const auto* rest = restOf(list, first, padded);
        const int filled = std::min(kLanes, list.count - first);
        Lanes<9> corners;
        gatherCorners(list, first, x, corners);
        for (int l = 0; l < kLanes; ++l) {
            const double energy =
                Model::term(edgeFrom0(corners, 1, l), edgeFrom0(corners, 2, l), rest[l], HessianKind::Exact).energy;
            sums[l] += l < filled ? energy : 0.0;
        }
    }
    double sum = 0.0;
    for (int l = 0; l < kLanes; ++l) sum += sums[l];
    return sum;
}

}  // namespace jacket
