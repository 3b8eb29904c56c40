#pragma once
#include <algorithm>

namespace jacket::demo {

/// Distance of a point from the segment a b, in two or three dimensions.
template <class Vector>
double distanceToSegment(const Vector& p, const Vector& a, const Vector& b) {
    const Vector ab = b - a;
    const double s = std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
    return (p - a - s * ab).norm();
}

}  // namespace jacket::demo
