#include "energy/ColouredRanges.h"

#include <algorithm>
#include <bit>
#include <cstdint>

namespace jacket {

ColouredRanges::ColouredRanges(const std::vector<std::array<int, 3>>& triangles) : m_colourStart(1, 0) {
    constexpr int kLength = 1024, kMasked = 64;  // colours that a mask has room for; others have one range each
    const int count = static_cast<int>(triangles.size());
    int vertices = 0;
    for (const auto& triangle : triangles) vertices = std::max(vertices, 1 + *std::ranges::max_element(triangle));
    std::vector<std::uint64_t> coloursAt(vertices, 0);
    std::vector<std::vector<int>> byColour(kMasked);
    for (int begin = 0; begin < count; begin += kLength) {
        const int end = std::min(begin + kLength, count);
        std::uint64_t taken = 0;
        for (int t = begin; t < end; ++t)
            for (const int vertex : triangles[t]) taken |= coloursAt[vertex];
        const int colour = std::countr_one(taken);
        if (colour == kMasked) {
            byColour.push_back({begin});
            continue;
        }
        byColour[colour].push_back(begin);
        for (int t = begin; t < end; ++t)
            for (const int vertex : triangles[t]) coloursAt[vertex] |= std::uint64_t{1} << colour;
    }
    for (const std::vector<int>& begins : byColour) {
        if (begins.empty()) continue;
        for (const int begin : begins) {
            m_begin.push_back(begin);
            m_end.push_back(std::min(begin + kLength, count));
        }
        m_colourStart.push_back(static_cast<int>(m_begin.size()));
    }
}

}  // namespace jacket
