#include <algorithm>
#include <array>

#include "BoxTree.h"
#include "ShellContacts.h"

/// Shells that go through the middle of a body.
namespace jacket::bullet {
namespace {

constexpr int kChunk = 64;  // triangles that are asked about together

/// A triangle on its straight way through a step, seen from a point on its own.
struct PassingTriangle {
    Mat3 start, end;  ///< corners less the point

    Mat3 at(double share) const { return start + share * (end - start); }
    /// Whether it goes through the point: where the plane does, half-way between two times that it is on either side.
    bool meetsPoint() const {
        constexpr int kHalvings = 40;
        const bool isFront = start.determinant() >= 0.0;
        if (isFront == (end.determinant() >= 0.0)) return false;
        double before = 0.0, after = 1.0;
        for (int i = 0; i < kHalvings; ++i) {
            const double middle = 0.5 * (before + after);
            (isFront == (at(middle).determinant() >= 0.0) ? before : after) = middle;
        }
        return hasInside(at(after));
    }
    /// Whether the origin is between the corners of a triangle in whose plane it lies.
    static bool hasInside(const Mat3& corners) {
        constexpr double kBeside = 1e-9;  // so that nothing goes between two triangles
        const Vec3 normal = (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0));
        const double least = -kBeside * normal.squaredNorm();
        for (int a = 0; a < 3; ++a)
            if (normal.dot(corners.col((a + 1) % 3).cross(corners.col((a + 2) % 3))) < least) return false;
        return true;
    }
};

Bounds boundsOf(const Vec3& a, const Vec3& b) {
    return {a.cwiseMin(b), a.cwiseMax(b)};
}

/// Whether its centre of mass is in it: of a ring it is not, nor does what goes through a ring go through its middle.
bool hasMiddle(const ShapePieces& shape) {
    return std::any_of(shape.pieces.begin(), shape.pieces.end(), [](const auto& piece) {
        const auto surface = piece->touch(Vec3(Vec3::Zero()), 0.0);
        return surface && surface->distance < 0.0;
    });
}

}  // namespace

/// Bounds of a shell's triangles on their way, so many at a time.
void ShellContacts::boundChunks(const HalfEdgeMesh& mesh, const Points& start, const Points& end) {
    std::vector<Bounds>& chunks = m_memory.chunks;
    chunks.clear();
    for (int t = 0; t < mesh.triangleCount(); ++t) {
        for (const int i : mesh.triangles().col(t)) {
            const Bounds way = boundsOf(start.col(i), end.col(i));
            if (t / kChunk == std::ssize(chunks))
                chunks.push_back(way);
            else
                chunks.back().include(way);
        }
    }
}

bool ShellContacts::crosses(const ContactSweep& motion) {
    int bounded = -1;  // the shell that the chunks are of
    for (const auto& [shell, body] : m_pairs) {
        if (!motion.bodies[body] || !hasMiddle(*m_obstacles[body].shape)) continue;
        const HalfEdgeMesh& mesh = m_shells[shell]->shell().mesh();
        const Points &start = *motion.start[shell], &end = *motion.end[shell];
        if (bounded != shell) boundChunks(mesh, start, end);
        bounded = shell;
        const Vec3 first = m_start[body].translation(),
                   last = moved(m_start[body], motion.twists[body], motion.time).translation();
        const Bounds way = boundsOf(first, last);
        const auto meets = [&](int t) {
            PassingTriangle triangle;
            for (int a = 0; a < 3; ++a) {
                triangle.start.col(a) = start.col(mesh.triangles()(a, t)) - first;
                triangle.end.col(a) = end.col(mesh.triangles()(a, t)) - last;
            }
            return triangle.meetsPoint();
        };
        for (int chunk = 0; chunk < std::ssize(m_memory.chunks); ++chunk) {
            if (!m_memory.chunks[chunk].overlaps(way)) continue;
            const int from = chunk * kChunk, to = std::min(from + kChunk, mesh.triangleCount());
            for (int t = from; t < to; ++t)
                if (meets(t)) return true;
        }
    }
    return false;
}

}  // namespace jacket::bullet
