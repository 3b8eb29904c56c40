// Points and triangles against the triangles of concave shapes, compared with brute force and with closed forms.
#include "TrianglePatch.h"

#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletCollision/CollisionShapes/btScaledBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btTriangleMesh.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "ClosedForms.h"
#include "Convert.h"
#include "support/Random.h"

namespace jacket::bullet {
namespace {

using testing::Random;
using enum ShellEdge::Kind;

const std::array<ShellEdge, 3> kBorders{kBorder, kBorder, kBorder};

constexpr double kAccuracy = sizeof(btScalar) == sizeof(float) ? 1e-6 : 1e-12;

/// A soup of triangles as Bullet rounds them, and the shape made of it.
struct Soup {
    btTriangleMesh mesh;
    std::vector<Mat3> triangles;
    std::unique_ptr<btBvhTriangleMeshShape> shape;

    void add(const Vec3& a, const Vec3& b, const Vec3& c) {
        const btVector3 p[] = {toBullet(a), toBullet(b), toBullet(c)};
        mesh.addTriangle(p[0], p[1], p[2]);
        Mat3& t = triangles.emplace_back();
        for (int i = 0; i < 3; ++i) t.col(i) = fromBullet(p[i]);
    }
    TrianglePatch patch(double size) {
        shape = std::make_unique<btBvhTriangleMeshShape>(&mesh, true);
        return TrianglePatch(*shape, {Vec3::Constant(-size), Vec3::Constant(size)});
    }
};

/// A ball of given radius with bumps, as a closed mesh of 2 n (n - 1) triangles.
void addBall(Soup& soup, double radius, double bumps, int n) {
    const auto at = [&](int i, int j) -> Vec3 {
        const double polar = M_PI * i / n, around = 2 * M_PI * (j % n) / n;
        const double r = radius * (1 + (i % n == 0 ? 0 : bumps * std::sin(3 * around) * std::sin(4 * polar)));
        if (i % n == 0) return {0, i == 0 ? r : -r, 0};
        return r * Vec3(std::sin(polar) * std::cos(around), std::cos(polar), -std::sin(polar) * std::sin(around));
    };
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            if (i > 0) soup.add(at(i, j), at(i + 1, j), at(i, j + 1));
            if (i < n - 1) soup.add(at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
        }
}

/// Solid angle of a closed mesh about p, over 4 pi: 1 inside, 0 outside (van Oosterom and Strackee 1983).
double winding(const std::vector<Mat3>& triangles, const Vec3& p) {
    double sum = 0;
    for (const Mat3& t : triangles) {
        const Vec3 a = t.col(0) - p, b = t.col(1) - p, c = t.col(2) - p;
        const double la = a.norm(), lb = b.norm(), lc = c.norm();
        sum += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
    }
    return sum / (2 * M_PI);
}

double bruteDistance(const std::vector<Mat3>& triangles, const Vec3& p) {
    double least = std::numeric_limits<double>::infinity();
    for (const Mat3& t : triangles) least = std::min(least, (p - closestOnTriangle(p, t).point).norm());
    return least;
}

TEST(TrianglePatch, PointsAreAtTheNearestOfAllTriangles) {
    Random random(21);
    int poses = 0;
    for (int i = 0; i < 200; ++i) {
        const double scale = random.scale();
        Soup soup;
        addBall(soup, scale, i % 2 ? 0.3 : 0.0, 6 + i % 5);
        const TrianglePatch patch = soup.patch(3 * scale);
        ASSERT_EQ(patch.triangleCount(), int(soup.triangles.size()));
        for (int k = 0; k < 100; ++k) {
            const Vec3 p = random.inCube(1.5 * scale);
            const double least = bruteDistance(soup.triangles, p);
            const bool isInside = winding(soup.triangles, p) > 0.5;
            std::vector<SurfacePoint> touched;
            patch.touch(p, 4 * scale, 4 * scale, touched);
            const auto alone = patch.touchNearest(p, 4 * scale, 4 * scale);
            ASSERT_TRUE(alone);
            EXPECT_NEAR(alone->distance, isInside ? -least : least, kAccuracy * scale);
            ++poses;
            ASSERT_FALSE(touched.empty());
            for (const SurfacePoint& s : touched) {
                ASSERT_TRUE(s.point.allFinite() && std::isfinite(s.distance));
                EXPECT_NEAR(s.normal.norm(), 1, 1e-9);
                EXPECT_LT((s.point + s.distance * s.normal - p).norm(), 1e-9 * scale);
            }
            // Behind an edge the planes of its sides are what is touched: no farther than the edge itself.
            const double distance = touched.front().distance;
            EXPECT_EQ(distance < 0, isInside) << p.transpose() / scale;
            if (isInside)
                EXPECT_GE(distance, -least * (1 + 1e-9));
            else
                EXPECT_NEAR(distance, least, 1e-9 * scale);

            const double reach = random.between(0.2, 1.5) * least;  // what is out of reach is not touched
            touched.clear();
            patch.touch(p, reach, reach, touched);
            EXPECT_EQ(touched.empty(), reach < least);
        }
    }
    std::printf("    %d points\n", poses);
}

/// A triangle that cuts off the top of a convex mesh: the deepest corner of the mesh sticks out by the known height.
TEST(TrianglePatch, TipsAreAsDeepAsTheyStickOut) {
    Random random(22);
    for (int i = 0; i < 500; ++i) {
        const double scale = random.scale(), height = scale * random.between(0.5, 2), foot = 0.3 * scale;
        Soup soup;
        const Vec3 tip(0, height, 0),
            corner[] = {{-foot, 0, -foot}, {-foot, 0, foot}, {foot, 0, foot}, {foot, 0, -foot}};
        for (int k = 0; k < 4; ++k) soup.add(corner[k], corner[(k + 1) % 4], tip);
        const TrianglePatch patch = soup.patch(9 * scale);
        const double depth = random.between(-0.2, 0.3) * height, y = height - depth;
        const Vec3 shift = random.inCube(0.3 * scale);
        Mat3 triangle;
        triangle << Vec3(shift.x() - 2 * scale, y, shift.z() - 2 * scale), Vec3(shift.x(), y, shift.z() + 3 * scale),
            Vec3(shift.x() + 2 * scale, y, shift.z() - 2 * scale);
        if (i % 2) triangle.col(0).swap(triangle.col(1));  // of either orientation
        std::vector<TrianglePoint> touched;
        patch.touch(triangle, kBorders, 0.25 * height, 0.4 * height, touched);
        ASSERT_EQ(touched.size(), 1u);
        EXPECT_NEAR(touched[0].surface.distance, -depth, kAccuracy * height);
        EXPECT_NEAR(touched[0].surface.normal.y(), 1, 1e-9);
        EXPECT_LT((triangle * touched[0].weights - Vec3(0, y, 0)).norm(), kAccuracy * scale);
    }
}

/// An edge across the ridge of a roof of random slopes.
TEST(TrianglePatch, EdgesAcrossARidgeAreAsDeepAsTheyCutIt) {
    Random random(23);
    for (int i = 0; i < 500; ++i) {
        const double scale = random.scale(), left = random.between(0.3, 2), right = random.between(0.3, 2);
        Soup soup;
        const Vec3 a(0, 0, -scale), b(0, 0, scale);
        const Vec3 c(-scale, -left * scale, 0), d(scale, -right * scale, 0);
        soup.add(a, c, b);
        soup.add(a, b, d);
        const TrianglePatch patch = soup.patch(9 * scale);
        const double y = -scale * random.between(0.001, 0.05), slant = random.between(-0.5, 0.5);
        Mat3 triangle;  // its first edge lies across, level
        triangle << Vec3(-0.5 * scale, y, -slant * scale), Vec3(0.5 * scale, y, slant * scale),
            Vec3(0.1 * scale, 0.8 * scale, 0);
        std::vector<TrianglePoint> touched;
        patch.touch(triangle, {kBorder, kLeftOut, kLeftOut}, 0, 0.1 * scale, touched);
        ASSERT_EQ(touched.size(), 1u) << y / scale << " " << left << " " << right;
        EXPECT_NEAR(touched[0].surface.distance, y, kAccuracy * scale);
        EXPECT_NEAR(touched[0].surface.normal.y(), 1, 1e-9);
        EXPECT_EQ(touched[0].weights.z(), 0);
        touched.clear();
        patch.touch(triangle, {kLeftOut, kBorder, kBorder}, 0, 0.1 * scale, touched);
        EXPECT_TRUE(touched.empty());
    }
}

/// A level triangle whose first edge cuts off the upright ridge of a post, far below its top. Where the sheet goes on
/// beyond the edge it is pushed up, not along itself; where it ends it may be pushed aside.
TEST(TrianglePatch, SharedEdgesAreNotPushedAlongTheirSheet) {
    Soup soup;  // the post's upper corner is at the origin, it stands in x < 0, z < 0
    const Vec3 corner(0, 0, 0), foot(0, -9, 0), left(-9, 0, 0), back(0, 0, -9);
    soup.add(corner, back, left);
    soup.add(corner, left, foot);
    soup.add(corner, foot, back);
    const TrianglePatch patch = soup.patch(20);
    Mat3 triangle;
    triangle << Vec3(-1.2, -0.8, 1), Vec3(1, -0.8, -1.2), Vec3(2, -0.8, 2);
    std::vector<TrianglePoint> touched;
    patch.touch(triangle, {kBorder, kLeftOut, kLeftOut}, 0, 0.5, touched);
    ASSERT_EQ(touched.size(), 1u);
    EXPECT_NEAR(touched[0].surface.normal.y(), 0, 1e-9);
    EXPECT_NEAR(touched[0].surface.distance, -0.1 * std::sqrt(2), 1e-6);
    touched.clear();
    const ShellEdge shared(kShared, {-2, -0.8, -2});
    patch.touch(triangle, {shared, kLeftOut, kLeftOut}, 0, 0.5, touched);
    EXPECT_TRUE(touched.empty());
    patch.touch(triangle, {shared, kLeftOut, kLeftOut}, 0, 2, touched);
    ASSERT_EQ(touched.size(), 1u);
    EXPECT_NEAR(touched[0].surface.normal.y(), 1, 1e-9);
    EXPECT_NEAR(touched[0].surface.distance, -0.8, 1e-6);
}

/// An edge along which a sheet is folded lies over a ridge; each of its triangles slopes away steeply.
TEST(TrianglePatch, FoldedEdgesArePushedOutOfTheirFold) {
    Soup soup;  // the ridge is the z axis, below it and x > 0 is inside
    const Vec3 a(0, 0, -2), b(0, 0, 2);
    soup.add(a, b, {9, 0, 0});
    soup.add(a, {0, -9, 0}, b);
    const TrianglePatch patch = soup.patch(20);
    const Vec3 start(1, 0.8, 0), end(-0.8, -1, 0), out = Vec3(-1, 1, 0).normalized();
    const auto tip = [&](double side) -> Vec3 { return 0.5 * (start + end) + Vec3(0, 0, side) - 2 * out; };
    Mat3 triangle;
    triangle << start, end, tip(1);
    std::vector<TrianglePoint> touched;
    patch.touch(triangle, {ShellEdge(kShared, tip(-1)), kLeftOut, kLeftOut}, 0, 0.5, touched);
    ASSERT_EQ(touched.size(), 1u);
    EXPECT_NEAR(touched[0].surface.distance, -0.1 * std::sqrt(2), 1e-6);
    EXPECT_NEAR(touched[0].surface.normal.dot(out), 1, 1e-6);
}

TEST(TrianglePatch, AFlatFloorHasNothingForFacesAndOneNormalForPoints) {
    Random random(24);
    Soup soup;
    const auto at = [](int i, int j) { return Vec3(0.1 * i - 0.4, 0.3, 0.1 * j - 0.4); };
    for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 8; ++j) {
            soup.add(at(i, j), at(i, j + 1), at(i + 1, j + 1));
            soup.add(at(i, j), at(i + 1, j + 1), at(i + 1, j));
        }
    const TrianglePatch patch = soup.patch(2);
    for (int i = 0; i < 20000; ++i) {
        Vec3 p = random.inCube(0.29);
        if (i % 3 == 0) p.x() = 0.1 * int(random.between(-3, 3));  // above edges and corners too
        if (i % 9 == 0) p.z() = 0.1 * int(random.between(-3, 3));
        p.y() = soup.triangles[0](1, 0) + random.between(-0.05, 0.05) * std::pow(10, -random.between(0, 12));
        std::vector<SurfacePoint> touched;
        patch.touch(p, 0.06, 0.06, touched);
        ASSERT_FALSE(touched.empty()) << p.transpose();
        for (const SurfacePoint& t : touched) {  // behind an edge: the plane of each side
            EXPECT_NEAR(t.normal.y(), 1, 1e-9) << p.transpose();
            EXPECT_NEAR(t.distance, p.y() - soup.triangles[0](1, 0), 1e-12);
        }
    }
    Mat3 triangle;
    triangle << Vec3(-0.2, 0.29, -0.2), Vec3(-0.1, 0.31, 0.2), Vec3(0.2, 0.29, 0);
    std::vector<TrianglePoint> faces;
    patch.touch(triangle, kBorders, 0.01, 0.05, faces);
    EXPECT_TRUE(faces.empty());
}

TEST(TrianglePatch, InAValleyBothSidesAreTouched) {
    Soup soup;  // floor y = 0 for x > 0, wall x = 0
    const Vec3 a(0, 0, -1), b(0, 0, 1);
    soup.add(a, b, {2, 0, 0});
    soup.add(a, {0, 2, 0}, b);
    const TrianglePatch patch = soup.patch(3);
    std::vector<SurfacePoint> touched;
    patch.touch({0.1, 0.2, 0.05}, 0.3, 0.3, touched);
    ASSERT_EQ(touched.size(), 2u);  // the wall is nearer
    EXPECT_TRUE(touched[0].normal.isApprox(Vec3::UnitX()));
    EXPECT_NEAR(touched[0].distance, 0.1, 1e-12);
    EXPECT_TRUE(touched[1].normal.isApprox(Vec3::UnitY()));
    EXPECT_NEAR(touched[1].distance, 0.2, 1e-12);
    touched.clear();
    patch.touch({-0.1, -0.2, 0.05}, 0, 0.3, touched);  // behind the edge: out of both
    ASSERT_EQ(touched.size(), 2u);
    EXPECT_NEAR(std::min(touched[0].distance, touched[1].distance), -0.2, 1e-12);
    EXPECT_NEAR(std::max(touched[0].distance, touched[1].distance), -0.1, 1e-12);
    touched.clear();
    patch.touch({2.2, -0.1, 0}, 0.3, 0.3, touched);  // below, but beyond the border: nothing is behind there
    ASSERT_EQ(touched.size(), 1u);
    EXPECT_NEAR(touched[0].distance, std::hypot(0.2, 0.1), 1e-12);
    EXPECT_GT(touched[0].normal.x(), 0);
}

TEST(TrianglePatch, BadTrianglesAreLeftOut) {
    Soup soup;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    soup.add({-1, 0, -1}, {-1, 0, 1}, {1, 0, 0});
    struct Broken final : btConcaveShape {
        Soup& soup;
        explicit Broken(Soup& s) : soup(s) { m_shapeType = CUSTOM_CONCAVE_SHAPE_TYPE; }
        void processAllTriangles(btTriangleCallback* callback, const btVector3&, const btVector3&) const override {
            for (const Mat3& t : soup.triangles) {
                btVector3 corners[] = {toBullet(Vec3(t.col(0))), toBullet(Vec3(t.col(1))), toBullet(Vec3(t.col(2)))};
                callback->processTriangle(corners, 0, 0);
            }
        }
        void getAabb(const btTransform&, btVector3& lower, btVector3& upper) const override {
            lower.setValue(-1, -1, -1);
            upper.setValue(1, 1, 1);
        }
        void setLocalScaling(const btVector3&) override {}
        const btVector3& getLocalScaling() const override { return one; }
        void calculateLocalInertia(btScalar, btVector3&) const override {}
        const char* getName() const override { return "Broken"; }
        btVector3 one{1, 1, 1};
    } shape(soup);
    soup.triangles.push_back(Mat3::Constant(nan));
    soup.triangles.push_back(Mat3::Zero());
    Mat3 line;
    line << Vec3(0, 0.1, 0), Vec3(0.5, 0.1, 0), Vec3(0.2, 0.1, 0);
    soup.triangles.push_back(line);
    const TrianglePatch patch(shape, {Vec3::Constant(-2), Vec3::Constant(2)});
    EXPECT_EQ(patch.triangleCount(), 1);
    std::vector<SurfacePoint> touched;
    patch.touch({0, 0.2, 0}, 1, 1, touched);
    ASSERT_EQ(touched.size(), 1u);
    EXPECT_NEAR(touched[0].distance, 0.2, 1e-12);
}

/// Bullet winds heightfields along x and z the other way than along y.
TEST(TrianglePatch, HeightfieldsPointUpAlongEveryAxis) {
    const std::vector<float> heights(25, 0.5f);
    for (int axis = 0; axis < 3; ++axis) {
        const btHeightfieldTerrainShape shape(5, 5, heights.data(), btScalar(-1), btScalar(1), axis, false);
        const TrianglePatch patch(shape, {Vec3::Constant(-3), Vec3::Constant(3)});
        ASSERT_EQ(patch.triangleCount(), 32);
        const Vec3 p = 0.6 * Vec3::Unit(axis) + Vec3(0.1, 0.2, 0.3).cwiseProduct(Vec3::Ones() - Vec3::Unit(axis));
        std::vector<SurfacePoint> touched;
        patch.touch(p, 1, 1, touched);
        ASSERT_EQ(touched.size(), 1u);
        EXPECT_NEAR(touched[0].distance, 0.1, 1e-6);
        EXPECT_NEAR(touched[0].normal[axis], 1, 1e-9);
    }
}

}  // namespace
}  // namespace jacket::bullet
