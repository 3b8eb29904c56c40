#pragma once
#include <vector>

#include "jacket/HalfEdgeMesh.h"

namespace jacket::demo {

/// Shares of a load that is spread evenly over what is selected, summing to 1: over the area of the triangles that are
/// wholly selected; if there are none, over the length of such edges; if there are none, over the vertices.
std::vector<double> evenShares(const HalfEdgeMesh& mesh, const Points& rest, const std::vector<int>& vertices);

}  // namespace jacket::demo
