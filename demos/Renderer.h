#pragma once
#include <vector>

#include "Png.h"
#include "jacket/Types.h"

/// A small software renderer: triangles into a depth buffer, one light with shadows, 2 x 2 samples per pixel.
namespace jacket::demo {

using Colour = Eigen::Vector3f;  ///< linear light, 0..1

/// Colour as screens name it, e.g. 0x3366cc.
Colour colourFromHex(unsigned rgb);

/// Triangles that look the same.
struct Surface {
    Eigen::Matrix3Xf positions;  ///< [m]
    Eigen::Matrix3Xf normals;    ///< unit, one per vertex
    Indices<3> triangles;        ///< the front is where they are counter-clockwise
    std::vector<float> tints;    ///< brightness of each triangle; empty: 1
    Colour front{0.5f, 0.5f, 0.5f}, back{0.5f, 0.5f, 0.5f};
    bool showEdges = false;  ///< draw the triangles' edges as fine lines
    float gloss = 0.0f;      ///< strength of the highlight
};

/// Endless chequered plane normal . x = offset.
struct Ground {
    Vec3 normal{0, 1, 0};
    double offset = 0.0;
    Colour colour{0.6f, 0.6f, 0.6f};
};

struct Camera {
    Vec3 eye{0, 0, 5}, target{0, 0, 0};
    double fovDegrees = 30.0;  ///< vertical
};

struct View {
    Camera camera;
    std::vector<Surface> surfaces;
    std::vector<Ground> grounds;
    double sceneRadius = 1.0;  ///< for the size of the chequers and where the ground fades away [m]
};

Image render(const View& view, int width, int height);

/// Seen from the side that `towardsEye` points to, as near as all points allow.
Camera frameAll(const Eigen::Matrix3Xf& points, const Vec3& towardsEye, double fovDegrees, double aspect);
/// With the eye or the target already chosen.
Camera frameFrom(const Eigen::Matrix3Xf& points, const Vec3& target, const Vec3& towardsEye, double fovDegrees,
                 double aspect);

}  // namespace jacket::demo
