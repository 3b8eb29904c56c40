#pragma once
#include <array>
#include <vector>

#include "jacket/WorkerTeam.h"

namespace jacket {

/// A list of triangles in ranges, sorted by colour: of one colour no two have a vertex in common, so that threads can
/// add to vertices and blocks at the same time. The order of all sums is the same for any number of threads.
class ColouredRanges {
  public:
    ColouredRanges() = default;
    explicit ColouredRanges(const std::vector<std::array<int, 3>>& triangles);

    /// visit(begin, end) for every range; `begin` is a multiple of eight.
    template <class Visit>
    void run(WorkerTeam* team, const Visit& visit) const {
        for (std::size_t colour = 0; colour + 1 < m_colourStart.size(); ++colour) {
            const int first = m_colourStart[colour];
            runParts(team, m_colourStart[colour + 1] - first,
                     [&](int i) { visit(m_begin[first + i], m_end[first + i]); });
        }
    }

  private:
    std::vector<int> m_begin, m_end;  ///< of each range
    std::vector<int> m_colourStart;   ///< first range of each colour
};

}  // namespace jacket
