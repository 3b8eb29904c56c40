#include <gtest/gtest.h>

#include "Png.h"
#include "Renderer.h"
#include "TemporaryFolder.h"

namespace jacket::demo {
namespace {

/// The square -1..1 in the plane z = `z`, facing +z.
Surface square(float z, const Colour& front) {
    Surface surface;
    surface.positions.resize(3, 4);
    surface.positions << -1, 1, 1, -1, -1, -1, 1, 1, z, z, z, z;
    surface.normals = Eigen::Vector3f::UnitZ().replicate(1, 4);
    surface.triangles.resize(3, 2);
    surface.triangles << 0, 0, 1, 2, 2, 3;
    surface.front = front;
    surface.back = Colour(0, 0, 1);
    return surface;
}

View viewFrom(double z) {
    View view;
    view.camera = {.eye = {0, 0, z}, .target = {0, 0, 0}, .fovDegrees = 90};
    return view;
}

bool isMostly(const std::uint8_t* pixel, int channel) {
    return pixel[channel] > 3 * std::max(pixel[(channel + 1) % 3], pixel[(channel + 2) % 3]);
}

TEST(Renderer, CoversThePixelsOfASquareAndNoOthers) {
    View view = viewFrom(2);  // half the picture's height is 2 m there: the square takes the middle 20 of 40 pixels
    view.surfaces.push_back(square(0, {1, 0, 0}));
    const Image image = render(view, 40, 40);
    for (int y = 0; y < 40; ++y)
        for (int x = 0; x < 40; ++x)
            EXPECT_EQ(isMostly(image.at(x, y), 0), x >= 10 && x < 30 && y >= 10 && y < 30) << x << ' ' << y;
}

TEST(Renderer, ShowsTheBackFromBehindAndTheNearerOfTwo) {
    View view = viewFrom(-2);
    view.surfaces.push_back(square(0, {1, 0, 0}));
    EXPECT_TRUE(isMostly(render(view, 40, 40).at(20, 20), 2));

    view = viewFrom(2);
    view.surfaces = {square(0, {1, 0, 0}), square(0.5f, {0, 1, 0})};
    EXPECT_TRUE(isMostly(render(view, 40, 40).at(20, 20), 1));
    std::swap(view.surfaces[0], view.surfaces[1]);
    EXPECT_TRUE(isMostly(render(view, 40, 40).at(20, 20), 1));
}

TEST(Renderer, LeavesOutTrianglesThatAreNotFiniteOrBehindTheCamera) {
    View view = viewFrom(2);
    view.surfaces = {square(0, {1, 0, 0}), square(3, {0, 1, 0})};
    view.surfaces[0].positions(0, 3) = std::numeric_limits<float>::quiet_NaN();  // of the upper left triangle
    const Image image = render(view, 40, 40);
    EXPECT_TRUE(isMostly(image.at(25, 25), 0));
    EXPECT_FALSE(isMostly(image.at(12, 12), 0));
    EXPECT_FALSE(isMostly(image.at(20, 20), 1));
}

TEST(Renderer, CastsShadowsOnTheGround) {
    View view;
    view.camera = {.eye = {0, 10, 0.01}, .target = {0, 0, 0}, .fovDegrees = 40};
    view.sceneRadius = 100;  // chequers larger than the picture
    view.grounds.push_back({});
    const Image lit = render(view, 40, 40);
    Surface above = square(0, {1, 0, 0});
    above.positions.row(2) = -above.positions.row(1);
    above.positions.row(1).setConstant(2.0f);
    above.normals = Eigen::Vector3f::UnitY().replicate(1, 4);
    view.surfaces.push_back(above);
    const Image shadowed = render(view, 40, 40);
    int darker = 0;
    for (std::size_t i = 0; i < lit.rgb.size(); i += 3)
        if (shadowed.rgb[i] + 20 < lit.rgb[i]) ++darker;
    EXPECT_GT(darker, 5);  // a rim of the ground beside the square
}

TEST(Renderer, FramesAllPoints) {
    Eigen::Matrix3Xf points = Eigen::Matrix3Xf::Random(3, 50) * 3;
    const Camera camera = frameAll(points, Vec3(1, 1, 1), 30, 1);
    View view;
    view.camera = camera;
    for (const auto& p : points.colwise()) {
        Surface dot = square(0, {1, 0, 0});
        dot.positions = (0.05f * dot.positions).colwise() + p;
        view.surfaces.push_back(dot);
    }
    const Image image = render(view, 200, 200);
    for (int i = 0; i < 200; ++i) {
        EXPECT_FALSE(isMostly(image.at(i, 0), 0) || isMostly(image.at(i, 199), 0)) << i;
        EXPECT_FALSE(isMostly(image.at(0, i), 0) || isMostly(image.at(199, i), 0)) << i;
    }
}

TEST(Png, ReadsBackWhatWasWritten) {
    const TemporaryFolder folder;
    Image image{3, 2, {}};
    for (int i = 0; i < 18; ++i) image.rgb.push_back(static_cast<std::uint8_t>(13 * i));
    writePng(folder / "a.png", image);
    const Image again = readPng(folder / "a.png");
    EXPECT_EQ(again.width, 3);
    EXPECT_EQ(again.height, 2);
    EXPECT_EQ(again.rgb, image.rgb);
    EXPECT_THROW(writePng(folder / "no/such/a.png", image), std::runtime_error);
}

}  // namespace
}  // namespace jacket::demo
