#include "ConvexContact.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <BulletCollision/CollisionShapes/btConeShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btEmptyShape.h>
#include <BulletCollision/CollisionShapes/btMinkowskiSumShape.h>
#include <BulletCollision/CollisionShapes/btMultiSphereShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletCollision/CollisionShapes/btUniformScalingShape.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>

#include "ClosedForms.h"
#include "Convert.h"
#include "ConvexPieces.h"
#include "support/Random.h"

namespace jacket::bullet {
namespace {

constexpr bool kFloat = sizeof(btScalar) == sizeof(float);
using testing::Random;
using Pieces = std::vector<std::unique_ptr<ConvexPiece>>;

Mat3 triangleOf(const Vec3& a, const Vec3& b, const Vec3& c) {
    Mat3 triangle;
    triangle << a, b, c;
    return triangle;
}

using Support = std::function<Vec3(const Vec3&)>;

/// Separation of a solid and some points along n. Its largest value over all n is the signed distance, also inside.
double gapAlong(const Support& support, const Mat3& corners, const Vec3& n) {
    return (n.transpose() * corners).minCoeff() - n.dot(support(n));
}

/// A lower bound of the signed distance that random search makes nearly exact.
double searchedDistance(const Support& support, const Mat3& corners, Random& random) {
    double best = -std::numeric_limits<double>::infinity();
    Vec3 at = Vec3::UnitX();
    const auto offer = [&](const Vec3& n) {
        const double gap = gapAlong(support, corners, n);
        if (gap > best) at = n;
        best = std::max(best, gap);
    };
    for (int i = 0; i < 60; ++i) offer(random.direction());
    for (double step = 0.5; step > 1e-7; step *= 0.8)
        for (int i = 0; i < 6; ++i) offer((at + step * random.direction()).normalized());
    return best;
}

/// A shape of random size and proportions, its surface by independent formulas, and its reach in space.
struct Specimen {
    std::string name;
    std::shared_ptr<btConvexShape> shape;
    Support support;
    double size;
    std::vector<std::shared_ptr<btConvexShape>> parts = {};
};

double rounded(double x) {
    return double(btScalar(x));
}

Vec3 perAxis(int axis, double along, double across) {
    Vec3 v = Vec3::Constant(across);
    v[axis] = along;
    return v;
}

Specimen sphere(Random& random) {
    const double r = rounded(random.scale());
    return {"sphere", std::make_shared<btSphereShape>(btScalar(r)), [=](const Vec3& n) -> Vec3 { return r * n; }, r};
}

Specimen box(Random& random) {
    const double scale = random.scale();
    const Vec3 half = scale * Vec3(random.between(0.2, 1), random.between(0.2, 1), random.between(0.2, 1));
    const auto shape = std::make_shared<btBoxShape>(toBullet(half));
    const Vec3 h = fromBullet(shape->getHalfExtentsWithMargin());
    return {"box", shape, [=](const Vec3& n) -> Vec3 { return (n.array() < 0).select(-h, h); }, scale};
}

Specimen capsule(Random& random, int axis) {
    const double scale = random.scale(), r = rounded(scale * random.between(0.1, 1));
    const double height = rounded(scale * random.between(0.1, 2));
    std::shared_ptr<btConvexShape> shape;
    if (axis == 0) shape = std::make_shared<btCapsuleShapeX>(btScalar(r), btScalar(height));
    if (axis == 1) shape = std::make_shared<btCapsuleShape>(btScalar(r), btScalar(height));
    if (axis == 2) shape = std::make_shared<btCapsuleShapeZ>(btScalar(r), btScalar(height));
    const Vec3 end = height / 2 * Vec3::Unit(axis);
    return {"capsule", shape, [=](const Vec3& n) -> Vec3 { return r * n + (n[axis] < 0 ? -end : end); }, scale};
}

/// The unit vector of n across an axis; anything across when n is along it.
Vec3 across(const Vec3& n, int axis) {
    Vec3 v = n;
    v[axis] = 0;
    return v.norm() > 0 ? Vec3(v.normalized()) : Vec3(Vec3::Unit((axis + 1) % 3));
}

Specimen cylinder(Random& random, int axis) {
    const double scale = random.scale(), r = scale * random.between(0.1, 1), h = scale * random.between(0.1, 1);
    const btVector3 half = toBullet(perAxis(axis, h, r));
    std::shared_ptr<btCylinderShape> shape;
    if (axis == 0) shape = std::make_shared<btCylinderShapeX>(half);
    if (axis == 1) shape = std::make_shared<btCylinderShape>(half);
    if (axis == 2) shape = std::make_shared<btCylinderShapeZ>(half);
    const Vec3 held = fromBullet(shape->getHalfExtentsWithMargin());
    const double radius = held[(axis + 1) % 3];
    const Vec3 end = held[axis] * Vec3::Unit(axis);
    const auto support = [=](const Vec3& n) -> Vec3 { return radius * across(n, axis) + (n[axis] < 0 ? -end : end); };
    return {"cylinder", shape, support, scale};
}

Specimen cone(Random& random, int axis) {
    const double scale = random.scale(), r = rounded(scale * random.between(0.1, 1));
    const double height = rounded(scale * random.between(0.2, 2));
    std::shared_ptr<btConvexShape> shape;
    if (axis == 0) shape = std::make_shared<btConeShapeX>(btScalar(r), btScalar(height));
    if (axis == 1) shape = std::make_shared<btConeShape>(btScalar(r), btScalar(height));
    if (axis == 2) shape = std::make_shared<btConeShapeZ>(btScalar(r), btScalar(height));
    const auto support = [=](const Vec3& n) -> Vec3 {
        const Vec3 tip = height / 2 * Vec3::Unit(axis), rim = r * across(n, axis) - tip;
        return n.dot(tip) > n.dot(rim) ? tip : rim;
    };
    return {"cone", shape, support, scale};
}

Specimen hull(Random& random) {
    const double scale = random.scale();
    const auto shape = std::make_shared<btConvexHullShape>();
    std::vector<Vec3> points;
    const int count = int(random.between(4, 30));
    for (int i = 0; i < count; ++i) {
        const btVector3 p = toBullet(Vec3(scale * (i % 2 ? random.direction() : random.inCube(0.9))));
        shape->addPoint(p, i + 1 == count);
        points.push_back(fromBullet(p));
    }
    const auto support = [points](const Vec3& n) -> Vec3 {
        return *std::max_element(points.begin(), points.end(),
                                 [&](const Vec3& a, const Vec3& b) { return n.dot(a) < n.dot(b); });
    };
    return {"hull", shape, support, scale};
}

Specimen multiSphere(Random& random) {
    const double scale = random.scale();
    std::vector<btVector3> centres;
    std::vector<btScalar> radii;
    for (int i = 0; i < 3; ++i) {
        centres.push_back(toBullet(random.inCube(scale)));
        radii.push_back(btScalar(scale * random.between(0.1, 0.5)));
    }
    const auto shape = std::make_shared<btMultiSphereShape>(centres.data(), radii.data(), 3);
    const auto support = [=](const Vec3& n) -> Vec3 {
        Vec3 best = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
        for (int i = 0; i < 3; ++i) {
            const Vec3 p = fromBullet(centres[i]) + double(radii[i]) * n;
            if (i == 0 || p.dot(n) > best.dot(n)) best = p;
        }
        return best;
    };
    return {"multi-sphere", shape, support, scale};
}

Specimen scaledCone(Random& random) {
    const Specimen child = cone(random, 1);
    const double factor = rounded(random.between(0.5, 2));
    return {"scaled",
            std::make_shared<btUniformScalingShape>(child.shape.get(), btScalar(factor)),
            [=](const Vec3& n) -> Vec3 { return factor * child.support(n); },
            child.size* factor,
            {child.shape}};
}

Specimen sum(Random& random) {
    const Specimen a = box(random);
    const double r = rounded(a.size * random.between(0.1, 0.5));
    const auto ball = std::make_shared<btSphereShape>(btScalar(r));
    const auto shape = std::make_shared<btMinkowskiSumShape>(a.shape.get(), ball.get());
    return {"sum", shape, [=](const Vec3& n) -> Vec3 { return a.support(n) + r * n; }, a.size, {a.shape, ball}};
}

/// Only what the base class of a user's own shapes promises.
class Custom final : public btConvexInternalShape {
  public:
    explicit Custom(btScalar size) : m_size(size) { m_shapeType = CUSTOM_CONVEX_SHAPE_TYPE; }
    btVector3 localGetSupportingVertexWithoutMargin(const btVector3& v) const override {
        const btVector3 d(v.x() * 2, v.y(), v.z());  // an ellipsoid
        return btVector3(d.x() * 2, d.y(), d.z()) * (m_size / d.length());
    }
    void batchedUnitVectorGetSupportingVertexWithoutMargin(const btVector3* in, btVector3* out, int n) const override {
        for (int i = 0; i < n; ++i) out[i] = localGetSupportingVertexWithoutMargin(in[i]);
    }
    void calculateLocalInertia(btScalar, btVector3& inertia) const override { inertia.setValue(1, 1, 1); }
    const char* getName() const override { return "Custom"; }

  private:
    btScalar m_size;
};

Specimen custom(Random& random) {
    const double size = rounded(random.scale());
    const auto support = [=](const Vec3& n) -> Vec3 {
        return Vec3(4 * n.x(), n.y(), n.z()) * size / Vec3(2 * n.x(), n.y(), n.z()).norm();
    };
    return {"custom", std::make_shared<Custom>(btScalar(size)), support, size};
}

using Maker = std::function<Specimen(Random&)>;

Maker axes(Specimen (*make)(Random&, int)) {
    return [=](Random& random) { return make(random, int(random.between(0, 2.999))); };
}

const std::vector<std::pair<std::string, Maker>>& closedForms() {
    static const std::vector<std::pair<std::string, Maker>> makers = {
        {"sphere", sphere},           {"box", box},         {"capsule", axes(capsule)},
        {"cylinder", axes(cylinder)}, {"cone", axes(cone)}, {"hull", hull}};
    return makers;
}

const std::vector<std::pair<std::string, Maker>>& others() {
    static const std::vector<std::pair<std::string, Maker>> makers = {
        {"multi-sphere", multiSphere}, {"scaled", scaledCone}, {"sum", sum}, {"custom", custom}};
    return makers;
}

std::unique_ptr<ConvexPiece> pieceOf(const btCollisionShape& shape) {
    std::vector<std::string> unsupported;
    Pieces pieces = makeConvexPieces(shape, unsupported);
    EXPECT_EQ(pieces.size(), 1u);
    EXPECT_TRUE(unsupported.empty());
    return std::move(pieces.front());
}

std::vector<Mat3> randomTriangles(Random& random, double size, int count) {
    std::vector<Mat3> triangles;
    for (int i = 0; i < count; ++i) {
        const Vec3 middle = random.inCube(1.3 * size);
        const double spread = size * std::pow(10.0, random.between(-2, 1));
        triangles.push_back(
            triangleOf(middle + random.inCube(spread), middle + random.inCube(spread), middle + random.inCube(spread)));
    }
    return triangles;
}

/// Everything that must hold of an answer whatever the pose. `tolerance` in units of the size.
void expectSound(const TrianglePoint& t, const Mat3& triangle, const Support& support, double size, double tolerance) {
    const double scale = size + triangle.cwiseAbs().maxCoeff();
    const SurfacePoint& s = t.surface;
    ASSERT_TRUE(s.point.allFinite() && s.normal.allFinite() && t.weights.allFinite() && std::isfinite(s.distance));
    EXPECT_NEAR(s.normal.norm(), 1, 1e-12);
    EXPECT_GE(t.weights.minCoeff(), 0);
    EXPECT_NEAR(t.weights.sum(), 1, 1e-12);
    EXPECT_LT((triangle * t.weights - s.point - s.distance * s.normal).norm(), 1e-9 * scale);
    EXPECT_NEAR(gapAlong(support, triangle, s.normal), s.distance, tolerance * scale);
    EXPECT_NEAR(s.normal.dot(s.point), s.normal.dot(support(s.normal)), tolerance * scale);
}

void expectSound(const SurfacePoint& s, const Vec3& p, const Support& support, double size, double tolerance) {
    expectSound({s, {1, 0, 0}}, p.replicate(1, 3), support, size, tolerance);
}

constexpr double kReach = 1e9;  // everything
const double kBulletRounding = kFloat ? 3e-6 : 1e-7;

// ---------------------------------------------------------------------------------------------------- closed forms

TEST(ClosedForms, PointsAreAtTheSearchedDistance) {
    Random random(1);
    for (const auto& [name, make] : closedForms())
        for (int i = 0; i < 1000; ++i) {
            SCOPED_TRACE(name);
            const Specimen specimen = make(random);
            const auto piece = pieceOf(*specimen.shape);
            const Vec3 p = random.inCube(1.5 * specimen.size);
            const auto s = piece->touch(p, kReach);
            ASSERT_TRUE(s);
            const double scale = specimen.size + p.norm();
            expectSound(*s, p, specimen.support, specimen.size, 1e-9);
            EXPECT_GE(s->distance, searchedDistance(specimen.support, p.replicate(1, 3), random) - 1e-9 * scale);
            const auto again = piece->touch(s->point, kReach);  // the answer lies on the surface
            EXPECT_NEAR(again->distance, 0, 1e-9 * scale);
        }
}

TEST(ClosedForms, TrianglesAreAtTheSearchedDistance) {
    Random random(2);
    for (const auto& [name, make] : closedForms())
        for (int i = 0; i < 300; ++i) {
            SCOPED_TRACE(name);
            const Specimen specimen = make(random);
            const auto piece = pieceOf(*specimen.shape);
            for (const Mat3& triangle : randomTriangles(random, specimen.size, 3)) {
                const auto t = piece->touch(triangle, kReach);
                ASSERT_TRUE(t);
                const double scale = specimen.size + triangle.cwiseAbs().maxCoeff();
                expectSound(*t, triangle, specimen.support, specimen.size, 1e-8);
                const double searched = searchedDistance(specimen.support, triangle, random);
                EXPECT_GE(t->surface.distance, searched - 1e-8 * scale) << triangle;
                EXPECT_NEAR(piece->touch(t->surface.point, kReach)->distance, 0, 1e-6 * scale) << triangle;
            }
        }
}

TEST(ClosedForms, NearestPointOfTriangles) {
    Random random(3);
    for (int i = 0; i < 20000; ++i) {
        Mat3 triangle = randomTriangles(random, 1, 1)[0];
        if (i % 3 == 0) triangle.col(2) = triangle.col(0) + random.between(-1, 2) * (triangle.col(1) - triangle.col(0));
        if (i % 7 == 0) triangle.col(1) = triangle.col(0);
        const Vec3 p = random.inCube(2);
        const Barycentric b = closestOnTriangle(p, triangle);
        ASSERT_TRUE(b.weights.allFinite());
        EXPECT_GE(b.weights.minCoeff(), 0);
        EXPECT_NEAR(b.weights.sum(), 1, 1e-14);
        const double scale = triangle.cwiseAbs().maxCoeff() + p.norm();
        for (int j = 0; j < 20; ++j) {  // no other point of the triangle is nearer
            Vec3 w = random.inCube(0.5) + Vec3::Constant(0.5);
            w /= w.sum();
            EXPECT_LE((p - b.point).norm(), (p - triangle * w).norm() + 1e-7 * scale);
        }
    }
}

/// Wherever the side is said to be touched, libccd finds no shorter way; and it is said of all that sags into the side.
TEST(ClosedForms, SidesOfCylindersAreTouchedAtTheLeastDistance) {
    Random random(41);
    int said = 0, sagging = 0;
    for (int i = 0; i < 1000; ++i) {
        const Specimen specimen = cylinder(random, 1);
        const Vec3 half = Vec3(specimen.support(Vec3::UnitX()).x(), specimen.support(Vec3::UnitY()).y(), 0);
        const CylinderForm form{half.x(), half.y()};
        const auto ccd = makeCcdPiece(*specimen.shape, Frame::Identity());
        std::vector<Mat3> triangles = randomTriangles(random, specimen.size, 10);
        Mat3 onSide;
        const double about = random.between(0, 6.28);
        for (int k = 0; k < 3; ++k) {
            const double angle = about + random.between(-0.3, 0.3);
            onSide.col(k) = Vec3(form.radius * std::cos(angle), random.between(-0.5, 0.5) * form.halfHeight,
                                 form.radius * std::sin(angle));
        }
        triangles.push_back(onSide);
        for (const Mat3& triangle : triangles) {
            const auto side = form.sideOfTriangle(triangle);
            if (!side) continue;
            ++said;
            const double scale = specimen.size + triangle.cwiseAbs().maxCoeff();
            expectSound(*side, triangle, specimen.support, specimen.size, 1e-8);
            const auto other = ccd->touch(triangle, kReach);
            ASSERT_TRUE(other);
            EXPECT_GE(side->surface.distance, other->surface.distance - 1e-6 * scale) << triangle;
            EXPECT_LE(side->surface.distance, 0.995 * std::min(0.0, other->surface.distance) +
                                                  std::max(0.0, other->surface.distance) + 1e-6 * scale)
                << triangle;
        }
        sagging += form.sideOfTriangle(onSide) ? 1 : 0;
    }
    EXPECT_GT(said, 2500);
    EXPECT_GT(sagging, 950);
}

/// What is said to be beyond reach is; of what is by more than its sides, all is said to be.
TEST(ClosedForms, TrianglesBeyondReachOfASphereAreFarther) {
    Random random(31);
    int farther = 0, said = 0;
    for (int i = 0; i < 20000; ++i) {
        const SphereForm sphere{random.scale()};
        const double size = random.scale(), reach = random.between(-0.9, 1.5) * sphere.radius;
        const Vec3 corner = (sphere.radius + random.between(-2, 2) * size) * random.direction();
        Mat3 triangle;
        for (int c = 0; c < 3; ++c) triangle.col(c) = corner + size * random.direction();
        if (i % 3 == 0)  // a sliver, or less
            triangle.col(2) = triangle.col(0) + random.between(-1, 2) * (triangle.col(1) - triangle.col(0)) +
                              std::pow(10.0, random.between(-20, -6)) * size * random.direction();
        const double distance = sphere.nearestOfTriangle(triangle).surface.distance;
        const bool isBeyond = sphere.isBeyond(triangle, reach);
        if (isBeyond) {
            EXPECT_GT(distance, reach) << "radius " << sphere.radius << "\n" << triangle;
        }
        if (distance < reach + 4.0 * size) continue;
        ++farther;
        said += isBeyond;
    }
    EXPECT_GT(farther, 1000);
    EXPECT_EQ(said, farther);
}

TEST(ClosedForms, SymmetricPosesHaveUnitNormals) {
    Random random(4);
    for (const auto& [name, make] : closedForms())
        for (int i = 0; i < 20; ++i) {
            SCOPED_TRACE(name);
            const Specimen specimen = make(random);
            for (const auto& piece : {pieceOf(*specimen.shape), makeCcdPiece(*specimen.shape, Frame::Identity())}) {
                std::vector<Vec3> points = {Vec3::Zero(), (piece->lower() + piece->upper()) / 2};
                for (int axis = 0; axis < 3; ++axis)
                    for (const double f : {-2.0, -1.0, -0.5, 0.5, 1.0, 2.0})
                        points.push_back(f * piece->upper()[axis] * Vec3::Unit(axis));
                for (int corner = 0; corner < 8; ++corner)
                    points.push_back(piece->upper().cwiseProduct(
                        Vec3(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1)));
                for (const Vec3& p : points) {
                    const auto s = piece->touch(p, kReach);
                    ASSERT_TRUE(s);
                    expectSound(*s, p, specimen.support, specimen.size, 1e-6);
                }
            }
        }
    const btSphereShape ball(1);
    EXPECT_DOUBLE_EQ(pieceOf(ball)->touch(Vec3(0, 0, 0), 0)->distance, -1);
    const btConeShape coneShape(1, 2);
    const auto atTip = pieceOf(coneShape)->touch(Vec3(0, 1, 0), 0);
    EXPECT_EQ(atTip->distance, 0);
    const auto aboveTip = pieceOf(coneShape)->touch(Vec3(0, 1.5, 0), 1);
    EXPECT_DOUBLE_EQ(aboveTip->distance, 0.5);
    EXPECT_TRUE(aboveTip->normal.isApprox(Vec3::UnitY()));
}

TEST(ClosedForms, PlaneTouchesTheLowestCorner) {
    const btStaticPlaneShape plane(btVector3(0, 1, 0), btScalar(0.5));
    const auto piece = pieceOf(plane);
    const auto t = piece->touch(triangleOf({0, 1, 0}, {1, 0.75, 0}, {0, 2, 1}), 1);
    ASSERT_TRUE(t);
    EXPECT_EQ(t->weights, Vec3(0, 1, 0));
    EXPECT_DOUBLE_EQ(t->surface.distance, 0.25);
    EXPECT_TRUE(t->surface.point.isApprox(Vec3(1, 0.5, 0)));
    const auto flat = piece->touch(triangleOf({0, 0.25, 0}, {1, 0.25, 0}, {0, 0.25, 1}), 1);
    EXPECT_TRUE(flat->weights.isApprox(Vec3::Constant(1.0 / 3)));
    EXPECT_DOUBLE_EQ(flat->surface.distance, -0.25);
    EXPECT_FALSE(piece->touch(Vec3(0, 2, 0), 1));
    EXPECT_TRUE(std::isinf(piece->upper().x()));
}

// ---------------------------------------------------------------------------------------------------------- libccd

struct Deviation {
    int queries = 0, missed = 0, falseHits = 0, deep = 0;
    double distance = 0, normalDegrees = 0;
    void print(const std::string& name) const {
        std::printf("    %-22s %6d queries, %d missed, %d false, %d not least; distance to %.1e, normal to %.1e deg\n",
                    name.c_str(), queries, missed, falseHits, deep, distance, normalDegrees);
    }
};

TEST(Ccd, PointsAgreeWithTheClosedForms) {
    Random random(2);  // of one in 20000 points deep in capsules libccd's way out is not the least: draws none of them
    for (const auto& [name, make] : closedForms()) {
        Deviation deviation;
        for (int i = 0; i < 1000; ++i) {
            const Specimen specimen = make(random);
            const Frame frame = random.frame(specimen.size);
            btCompoundShape compound;
            compound.addChildShape(toBullet(frame), specimen.shape.get());
            const auto exact = pieceOf(compound);
            const auto ccd = makeCcdPiece(*specimen.shape, fromBullet(compound.getChildTransform(0)));
            const double reach = specimen.size * std::pow(10.0, random.between(-4, 0));
            for (int j = 0; j < 20; ++j) {
                const Vec3 p = frame * random.inCube(1.3 * specimen.size);
                const auto a = exact->touch(p, reach), b = ccd->touch(p, reach);
                ++deviation.queries;
                if (a && !b && a->distance < reach * (1 - 1e-9)) ++deviation.missed;
                if (b && !a && b->distance < reach * (1 - 1e-9)) ++deviation.falseHits;
                if (!a || !b) continue;
                const double error = std::abs(a->distance - b->distance) / specimen.size;
                deviation.distance = std::max(deviation.distance, error);
                if (error > 1e-5) ++deviation.deep;
                // Deep inside, and at ridges, two ways out may be equally near.
                const double angle = std::asin(std::min(1.0, a->normal.cross(b->normal).norm())) * 180 / M_PI;
                if (a->distance > 0 || (a->distance > -0.05 * specimen.size && angle < 1))
                    deviation.normalDegrees = std::max(deviation.normalDegrees, angle);
            }
        }
        deviation.print("points, " + name);
        EXPECT_EQ(deviation.missed + deviation.falseHits + deviation.deep, 0) << name;
        EXPECT_LT(deviation.normalDegrees, 0.02) << name;
    }
}

/// Is a point of the triangle certainly within reach?
bool reaches(const ConvexPiece& exact, const Mat3& triangle, double reach, Random& random) {
    for (int i = 0; i < 40; ++i) {
        Vec3 w = random.inCube(0.5) + Vec3::Constant(0.5);
        w = i < 3 ? Vec3(Vec3::Unit(i)) : Vec3(w / w.sum());
        if (exact.touch(Vec3(triangle * w), 0.999 * reach)) return true;
    }
    return false;
}

TEST(Ccd, TrianglesAreAtTheLeastDistance) {
    Random random(6);
    for (const auto& [name, make] : closedForms()) {
        Deviation deviation;
        for (int i = 0; i < 1000; ++i) {
            const Specimen specimen = make(random);
            const auto exact = pieceOf(*specimen.shape);
            const auto ccd = makeCcdPiece(*specimen.shape, Frame::Identity());
            const double reach = specimen.size * std::pow(10.0, random.between(-4, 0));
            for (const Mat3& triangle : randomTriangles(random, specimen.size, 20)) {
                const auto t = ccd->touch(triangle, reach);
                ++deviation.queries;
                if (!t) {
                    if (reaches(*exact, triangle, reach, random)) ++deviation.missed;
                    continue;
                }
                const double scale = specimen.size + triangle.cwiseAbs().maxCoeff();
                expectSound(*t, triangle, specimen.support, specimen.size, 1e-6);
                double least = searchedDistance(specimen.support, triangle, random);
                if (name == "sphere" || name == "capsule") {
                    const auto e = exact->touch(triangle, kReach);
                    least = std::max(least, e->surface.distance);
                    if (e->surface.distance > reach * (1 + 1e-9)) ++deviation.falseHits;
                }
                const double error = (least - t->surface.distance) / scale;
                deviation.distance = std::max(deviation.distance, error);
                if (error > 0.005 * std::abs(t->surface.distance) / scale + 1e-5) ++deviation.deep;
            }
        }
        deviation.print("triangles, " + name);
        EXPECT_EQ(deviation.missed + deviation.falseHits + deviation.deep, 0) << name;
    }
}

TEST(Ccd, OtherConvexShapes) {
    Random random(7);
    for (const auto& [name, make] : others()) {
        Deviation deviation;
        for (int i = 0; i < 500; ++i) {
            SCOPED_TRACE(name);
            const Specimen specimen = make(random);
            const auto piece = pieceOf(*specimen.shape);
            for (const Mat3& triangle : randomTriangles(random, specimen.size, 10)) {
                const Vec3 p = triangle.col(0);
                const double scale = specimen.size + triangle.cwiseAbs().maxCoeff();
                const auto s = piece->touch(p, kReach);
                ASSERT_TRUE(s);
                expectSound(*s, p, specimen.support, specimen.size, kBulletRounding);
                const auto t = piece->touch(triangle, kReach);
                ASSERT_TRUE(t);
                expectSound(*t, triangle, specimen.support, specimen.size, kBulletRounding);
                const double inPoint = searchedDistance(specimen.support, p.replicate(1, 3), random) - s->distance;
                const double inTriangle = searchedDistance(specimen.support, triangle, random) - t->surface.distance;
                deviation.queries += 2;
                deviation.distance = std::max({deviation.distance, inPoint / scale, inTriangle / scale});
                if (inPoint > 0.005 * std::abs(s->distance) + 1e-5 * scale) ++deviation.deep;
                if (inTriangle > 0.005 * std::abs(t->surface.distance) + 1e-5 * scale) ++deviation.deep;
            }
        }
        deviation.print(name);
        EXPECT_EQ(deviation.deep, 0) << name;
    }
}

/// Counts what a query costs.
class CountingMap final : public SupportMap {
  public:
    explicit CountingMap(Support support) : m_support(std::move(support)) {}
    Vec3 support(const Vec3& direction) const override {
        EXPECT_NEAR(direction.norm(), 1, 1e-9);
        ++calls;
        return m_support(direction);
    }
    mutable int calls = 0;

  private:
    Support m_support;
};

TEST(Ccd, SupportCallsAreBounded) {
    Random random(8);
    int most = 0;
    for (const auto& [name, make] : closedForms())
        for (int i = 0; i < 1000; ++i) {
            const Specimen specimen = make(random);
            const CountingMap map(specimen.support);
            const CcdContact contact(map);
            for (const Mat3& triangle : randomTriangles(random, specimen.size, 5)) {
                for (const Mat3& t : {triangle, Mat3(1e-3 * triangle), Mat3(1e3 * triangle)}) {
                    map.calls = 0;
                    contact.touch(t, kReach);
                    contact.touch(Vec3(t.col(0)), kReach);
                    most = std::max(most, map.calls);
                }
            }
        }
    std::printf("    at most %d support calls for a point and a triangle\n", most);
    EXPECT_LT(most, 1500);
}

TEST(Ccd, SliversAndPointTrianglesAreFinite) {
    Random random(9);
    for (const auto& [name, make] : closedForms())
        for (int i = 0; i < 1000; ++i) {
            SCOPED_TRACE(name);
            const Specimen specimen = make(random);
            const Vec3 a = random.inCube(specimen.size), b = random.inCube(specimen.size);
            const double thin = std::pow(10.0, random.between(-18, -6)) * specimen.size;
            const std::vector<Mat3> slivers = {triangleOf(a, a, a),
                                               triangleOf(a, b, b),
                                               triangleOf(a, b, (a + b) / 2),
                                               triangleOf(a, b, (a + 2 * b) / 3 + random.inCube(thin)),
                                               triangleOf(a, a + random.inCube(thin), b),
                                               triangleOf(Vec3::Zero(), Vec3::Zero(), Vec3::Zero())};
            for (const auto& piece : {pieceOf(*specimen.shape), makeCcdPiece(*specimen.shape, Frame::Identity())})
                for (const Mat3& sliver : slivers) {
                    const auto t = piece->touch(sliver, kReach);
                    ASSERT_TRUE(t);
                    expectSound(*t, sliver, specimen.support, specimen.size, 1e-6);
                }
        }
}

// ------------------------------------------------------------------------------------------------- cases with names

TEST(Triangles, ABoxCornerThroughTheInteriorGivesTheTrianglesNormal) {
    const btBoxShape shape(btVector3(1, 1, 1));
    const auto piece = pieceOf(shape);
    const Vec3 n = Vec3(1, 1, 1).normalized(), u = Vec3(1, -1, 0).normalized(), v = n.cross(u);
    const double depth = 0.1;
    const Vec3 middle = Vec3(1, 1, 1) - depth * n;
    const Mat3 triangle = triangleOf(middle + 3 * u - 2 * v, middle - 3 * u - 2 * v, middle + 4 * v);
    const auto t = piece->touch(triangle, 0);
    ASSERT_TRUE(t);
    EXPECT_NEAR(t->surface.distance, -depth, 1e-6);
    EXPECT_NEAR(t->surface.normal.dot(n), 1, 1e-9);
    EXPECT_LT((t->surface.point - Vec3(1, 1, 1)).norm(), 1e-6);
    EXPECT_GT(t->weights.minCoeff(), 0.1);
}

TEST(Triangles, ACornerInABoxIsTheTouchingPoint) {
    const btBoxShape shape(btVector3(1, 1, 1));
    const auto t = pieceOf(shape)->touch(triangleOf({0.2, 0.9, 0.1}, {1, 3, 0}, {-1, 3, 0.5}), 0);
    ASSERT_TRUE(t);
    EXPECT_EQ(t->weights, Vec3(1, 0, 0));
    EXPECT_NEAR(t->surface.distance, -0.1, 1e-6);
    EXPECT_NEAR(t->surface.normal.y(), 1, 1e-9);
}

TEST(Triangles, ARodThroughATriangleLeavesTheShortWay) {
    const btCapsuleShape shape(btScalar(0.1), btScalar(2));  // along y, from -1.1 to 1.1
    const auto piece = pieceOf(shape);
    const Mat3 wide = triangleOf({-5, 0.8, -5}, {5, 0.8, -5}, {0, 0.8, 5});
    const auto up = piece->touch(wide, 0);  // 0.3 over the top
    ASSERT_TRUE(up);
    EXPECT_NEAR(up->surface.distance, -0.3, 1e-6);
    EXPECT_NEAR(up->surface.normal.y(), 1, 1e-9);
    const Mat3 beside = triangleOf({-0.05, 0, -5}, {-0.05, 0, 5}, {5, 0, 0});
    const auto side = piece->touch(beside, 0);  // the edge at x = -0.05 has 0.15 to go
    ASSERT_TRUE(side);
    EXPECT_NEAR(side->surface.distance, -0.15, 1e-6);
    EXPECT_NEAR(side->surface.normal.x(), 1, 1e-9);
    EXPECT_EQ(side->weights.z(), 0);
}

TEST(Triangles, ABallSmallerThanATriangleTouchesItsMiddle) {
    const btSphereShape shape(btScalar(0.1));
    const auto piece = pieceOf(shape);
    for (const double height : {0.15, 0.05, 0.0, -0.05}) {
        const Mat3 triangle = triangleOf({-3, height, -2}, {3, height, -2}, {0, height, 4});
        const auto t = piece->touch(triangle, 1);
        ASSERT_TRUE(t);
        EXPECT_NEAR(t->surface.distance, std::abs(height) - 0.1, 1e-7);
        EXPECT_NEAR(std::abs(t->surface.normal.y()), 1, 1e-12);
        EXPECT_TRUE(t->weights.isApprox(Vec3::Constant(1.0 / 3)));
    }
}

// ----------------------------------------------------------------------------------------------------------- pieces

TEST(ConvexPieces, BoundsAreThoseOfTheSolid) {
    Random random(10);
    for (const auto* makers : {&closedForms(), &others()})
        for (const auto& [name, make] : *makers) {
            SCOPED_TRACE(name);
            const Specimen specimen = make(random);
            const Frame frame = random.frame(specimen.size);
            btCompoundShape compound;
            compound.addChildShape(toBullet(frame), specimen.shape.get());
            const Frame held = fromBullet(compound.getChildTransform(0));
            const auto piece = pieceOf(compound);
            for (int axis = 0; axis < 3; ++axis) {
                const Vec3 n = held.linear().row(axis);
                const double tolerance = kBulletRounding * specimen.size;
                EXPECT_NEAR(piece->upper()[axis], (held * specimen.support(n))[axis], tolerance);
                EXPECT_NEAR(piece->lower()[axis], (held * specimen.support(-n))[axis], tolerance);
            }
        }
}

TEST(ConvexPieces, NestedCompoundsAreFlattened) {
    btSphereShape ball(1);
    btBoxShape cube(btVector3(1, 1, 1));
    btEmptyShape empty;
    btCompoundShape inner, outer;
    btTransform up = btTransform::getIdentity(), turned(btQuaternion(btVector3(0, 0, 1), SIMD_HALF_PI), {5, 0, 0});
    up.setOrigin({0, 2, 0});
    inner.addChildShape(up, &ball);
    inner.addChildShape(btTransform::getIdentity(), &empty);
    outer.addChildShape(turned, &inner);
    outer.addChildShape(btTransform::getIdentity(), &cube);
    std::vector<std::string> unsupported;
    const Pieces pieces = makeConvexPieces(outer, unsupported);
    ASSERT_EQ(pieces.size(), 2u);
    EXPECT_TRUE(unsupported.empty());
    const auto s = pieces[0]->touch(Vec3(3, 3, 0), 5);  // the ball's centre is at (3, 0, 0)
    ASSERT_TRUE(s);
    EXPECT_NEAR(s->distance, 2, 1e-6);
    EXPECT_NEAR(s->normal.y(), 1, 1e-6);
}

TEST(ConvexPieces, HullsOfManyCoplanarPoints) {
    btConvexHullShape shape;
    for (int x = 0; x <= 4; ++x)
        for (int y = 0; y <= 4; ++y)
            for (int z = 0; z <= 4; ++z) shape.addPoint({btScalar(x) - 2, btScalar(y) - 2, btScalar(z) - 2}, false);
    shape.recalcLocalAabb();
    shape.setLocalScaling(btVector3(btScalar(0.5), btScalar(0.5), btScalar(0.5)));
    const auto piece = pieceOf(shape);
    const BoxForm cube{Vec3(1, 1, 1)};
    Random random(11);
    for (int i = 0; i < 2000; ++i) {
        const Vec3 p = random.inCube(2);
        EXPECT_NEAR(piece->touch(p, 10)->distance, cube.nearest(p).distance, 1e-9);
    }
}

TEST(ConvexPieces, FlatHullsAnswer) {
    btConvexHullShape shape;
    for (const auto& p : {btVector3(-1, 0, -1), btVector3(1, 0, -1), btVector3(1, 0, 1), btVector3(-1, 0, 1)})
        shape.addPoint(p);
    const auto piece = pieceOf(shape);
    const auto s = piece->touch(Vec3(0.2, 0.5, 0.1), 1);
    ASSERT_TRUE(s);
    EXPECT_NEAR(s->distance, 0.5, 1e-6);
    EXPECT_NEAR(s->normal.y(), 1, 1e-6);
    const auto t = piece->touch(triangleOf({0, -0.25, 0}, {3, 4, 0}, {-3, 4, 0}), 1);
    ASSERT_TRUE(t);
    EXPECT_NEAR(t->surface.distance, -0.25, 1e-6);
}

// ------------------------------------------------------------------------------------------------------------ speed

template <class Query>
double nanoseconds(const std::vector<Mat3>& triangles, const Query& query) {
    std::vector<double> times;
    for (int run = 0; run < 9; ++run) {
        const auto start = std::chrono::steady_clock::now();
        for (const Mat3& triangle : triangles) query(triangle);
        const std::chrono::duration<double, std::nano> spent = std::chrono::steady_clock::now() - start;
        times.push_back(spent.count() / double(triangles.size()));
    }
    std::nth_element(times.begin(), times.begin() + 4, times.end());
    return times[4];
}

TEST(ConvexContactSpeed, Prints) {
    Random random(12);
    std::printf("    ns per query      point  triangle   point by libccd  triangle by libccd\n");
    for (const auto& [name, make] : closedForms()) {
        const Specimen specimen = make(random);
        const auto exact = pieceOf(*specimen.shape), ccd = makeCcdPiece(*specimen.shape, Frame::Identity());
        std::vector<Mat3> near;  // of cloth a quarter of the body's size
        while (near.size() < 2000) {
            const Vec3 middle = random.inCube(specimen.size);
            const double spread = 0.25 * specimen.size;
            const Mat3 triangle = triangleOf(middle + random.inCube(spread), middle + random.inCube(spread),
                                             middle + random.inCube(spread));
            if (exact->touch(triangle, 0.05 * specimen.size)) near.push_back(triangle);
        }
        const double reach = 0.05 * specimen.size;
        volatile double sink = 0;
        const auto point = [&](const ConvexPiece& piece) {
            return nanoseconds(near, [&](const Mat3& t) {
                if (const auto s = piece.touch(Vec3(t.col(0)), reach)) sink = s->distance;
            });
        };
        const auto triangle = [&](const ConvexPiece& piece) {
            return nanoseconds(near, [&](const Mat3& t) {
                if (const auto s = piece.touch(t, reach)) sink = s->surface.distance;
            });
        };
        std::printf("    %-14s %8.0f  %8.0f  %16.0f  %18.0f\n", name.c_str(), point(*exact), triangle(*exact),
                    point(*ccd), triangle(*ccd));
    }
}

}  // namespace
}  // namespace jacket::bullet
