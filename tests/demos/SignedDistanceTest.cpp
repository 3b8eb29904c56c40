#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>

#include "Shape.h"
#include "ShapeSurface.h"

namespace jacket::demo {
namespace {

Points cubeCorners(double half) {
    Points corners(3, 8);
    for (int i = 0; i < 8; ++i) corners.col(i) = half * Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    return corners;
}

struct Case {
    Shape shape;
    Vec3 point;
    double distance;
};

TEST(SignedDistance, IsTheKnownOne) {
    const double diagonal = std::sqrt(2.0), slant = 1.0 / std::sqrt(5.0);
    const Case cases[] = {
        {Sphere{2}, {0, 3, 0}, 1},
        {Sphere{2}, {0, 0, 0}, -2},
        {Box{{2, 4, 6}}, {0, 0, 0}, -1},
        {Box{{2, 4, 6}}, {0.5, 1.9, 0}, -0.1},
        {Box{{2, 4, 6}}, {2, 3, 0}, diagonal},
        {Capsule{1, 4}, {0, 3.5, 0}, 0.5},
        {Capsule{1, 4}, {0.25, 1, 0}, -0.75},
        {Cylinder{1, 4}, {0, 1.75, 0}, -0.25},
        {Cylinder{1, 4}, {2, 3, 0}, diagonal},
        {Cylinder{1, 4}, {0.9, 0, 0}, -0.1},
        {Cone{1, 2}, {0, 0, 0}, -slant},
        {Cone{1, 2}, {0, -0.9, 0}, -0.1},
        {Cone{1, 2}, {0, 2, 0}, 1},
        {Cone{1, 2}, {2, -1, 0}, 1},
        {Plane{{0, 1, 0}, 0.5}, {7, 0.25, 3}, -0.25},
    };
    for (const Case& c : cases)
        EXPECT_NEAR(signedDistance(c.shape, c.point), c.distance, 1e-12)
            << "shape " << c.shape.index() << " at " << c.point.transpose();
}

TEST(SignedDistance, OfTheHullOfACubeIsThatOfTheBox) {
    const Shape hull = Hull{"", std::make_shared<const ConvexHull>(cubeCorners(0.5))}, box = Box{{1, 1, 1}};
    std::mt19937 random(3);
    std::uniform_real_distribution<double> coordinate(-1, 1);
    for (int i = 0; i < 200; ++i) {
        const Vec3 point(coordinate(random), coordinate(random), coordinate(random));
        EXPECT_NEAR(signedDistance(hull, point), signedDistance(box, point), 1e-12) << point.transpose();
    }
}

TEST(SignedDistance, OfMeshesIsThatOfTheNearestTriangle) {
    const ConvexHull cube(cubeCorners(1.0));
    const Shape mesh = Mesh{"", std::make_shared<const SurfaceMesh>(cube.vertices(), cube.triangles())};
    std::mt19937 random(4);
    std::uniform_real_distribution<double> coordinate(-2, 2);
    for (int i = 0; i < 500; ++i) {
        const Vec3 point(coordinate(random), coordinate(random), coordinate(random));
        EXPECT_NEAR(signedDistance(mesh, point), signedDistance(Box{{2, 2, 2}}, point), 1e-12) << point.transpose();
    }
    Points x(3, 6);  // floor y = 0 and wall x = 0, open at the other sides
    x << 0, 0, 2, 2, 0, 0, 0, 0, 0, 0, 2, 2, -1, 1, 1, -1, 1, -1;
    Indices<3> triangles(3, 4);
    triangles << 0, 0, 0, 0, 1, 2, 5, 4, 2, 3, 4, 1;
    const Shape valley = Mesh{"", std::make_shared<const SurfaceMesh>(x, triangles)};
    EXPECT_NEAR(signedDistance(valley, {0.3, 0.2, 0.1}), 0.2, 1e-12);
    EXPECT_NEAR(signedDistance(valley, {0.1, 0.2, 0.1}), 0.1, 1e-12);
    EXPECT_NEAR(signedDistance(valley, {0.3, -0.2, 0.1}), -0.2, 1e-12);
    EXPECT_NEAR(signedDistance(valley, {-0.3, -0.4, 0.1}), -0.5, 1e-12);  // behind the edge between them
    EXPECT_NEAR(signedDistance(valley, {2.3, -0.4, 0.1}), 0.5, 1e-12);    // beyond the border
}

TEST(SignedDistance, OfACompoundIsThatOfTheNearestPart) {
    const Transform turned{{1, 0, 0}, {0, 0, 45}};
    const Shape compound = Compound{{{Sphere{0.5}, {{-1, 0, 0}, {0, 0, 0}}}, {Box{{1, 1, 1}}, turned}}};
    EXPECT_NEAR(signedDistance(compound, {-2, 0, 0}), 0.5, 1e-12);
    EXPECT_NEAR(signedDistance(compound, {1, 1, 0}), 1 - std::sqrt(0.5), 1e-12);
    EXPECT_NEAR(signedDistance(compound, {1, 0, 0}), -0.5, 1e-12);
    EXPECT_NEAR(boundingRadius(compound), 1 + std::sqrt(0.75), 1e-12);
    const Surface surface = triangulate(compound);
    ASSERT_EQ(surface.tints.size(), static_cast<std::size_t>(surface.triangles.cols()));
    for (const auto& p : surface.positions.colwise())
        EXPECT_NEAR(signedDistance(compound, p.cast<double>()), 0, 1e-6) << p.transpose();
}

TEST(SignedDistance, IsZeroOnTheSurfaceThatIsDrawn) {
    const Shape shapes[] = {Sphere{0.3}, Box{{0.2, 0.4, 0.6}}, Capsule{0.2, 0.5}, Cylinder{0.2, 0.5}, Cone{0.3, 0.5}};
    for (const Shape& shape : shapes) {
        const Surface surface = triangulate(shape);
        ASSERT_GT(surface.positions.cols(), 0);
        for (const auto& p : surface.positions.colwise())
            EXPECT_NEAR(signedDistance(shape, p.cast<double>()), 0, 1e-6) << "shape " << shape.index();
    }
}

TEST(ConvexHull, KeepsOnlyTheOutermostPoints) {
    Points points(3, 30);
    points.leftCols(8) = cubeCorners(1.0);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> coordinate(-0.99, 0.99);
    for (int i = 8; i < 30; ++i) points.col(i) = Vec3(coordinate(random), coordinate(random), coordinate(random));
    const ConvexHull hull(points);
    EXPECT_EQ(hull.vertices().cols(), 8);
    EXPECT_EQ(hull.triangles().cols(), 12);
    EXPECT_NEAR(hull.volume(), 8.0, 1e-12);
    EXPECT_LT(hull.centroid().norm(), 1e-12);
}

TEST(ConvexHull, RefusesPointsInAPlane) {
    Points points = cubeCorners(1.0);
    points.row(1).setZero();
    EXPECT_THROW(ConvexHull{points}, std::invalid_argument);
}

}  // namespace
}  // namespace jacket::demo
