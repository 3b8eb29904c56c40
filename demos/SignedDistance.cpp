#include <algorithm>
#include <cmath>
#include <limits>

#include "Segment.h"
#include "Shape.h"

namespace jacket::demo {

namespace {

/// Distance from the axis and height: half a section of a shape that is round about y.
Vec2 section(const Vec3& p) {
    return {std::hypot(p.x(), p.z()), p.y()};
}

/// Of a box around the origin in any dimension, given how far |p| is beyond each half extent.
template <class Vector>
double boxDistance(const Vector& beyond) {
    return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

struct Distance {
    const Vec3& p;

    double operator()(const Sphere& s) const { return p.norm() - s.radius; }
    double operator()(const Box& s) const { return boxDistance(Vec3(p.cwiseAbs() - 0.5 * s.size)); }
    double operator()(const Capsule& s) const {
        const double along = std::clamp(p.y(), -0.5 * s.height, 0.5 * s.height);
        return (p - Vec3(0, along, 0)).norm() - s.radius;
    }
    double operator()(const Cylinder& s) const {
        return boxDistance(Vec2(section(p).cwiseAbs() - Vec2(s.radius, 0.5 * s.height)));
    }
    double operator()(const Cone& s) const {
        const Vec2 q = section(p), apex(0, 0.5 * s.height), rim(s.radius, -0.5 * s.height), base(0, -0.5 * s.height);
        const double distance = std::min(distanceToSegment(q, apex, rim), distanceToSegment(q, rim, base));
        const Vec2 slope = rim - apex;
        const bool isInside = q.y() > base.y() && slope.x() * (q.y() - apex.y()) - slope.y() * (q.x() - apex.x()) < 0;
        return isInside ? -distance : distance;
    }
    double operator()(const Plane& s) const { return s.normal.dot(p) - s.offset; }
    double operator()(const Hull& s) const { return s.geometry->signedDistance(p); }
    double operator()(const Mesh& s) const { return s.geometry->signedDistance(p); }
    double operator()(const Compound& s) const {
        double least = std::numeric_limits<double>::infinity();
        for (const CompoundPart& part : s.parts) {
            const Vec3 local = part.transform.rotation().transpose() * (p - part.transform.position);
            least = std::min(least, signedDistance(part.shape, local));
        }
        return least;
    }
};

struct Radius {
    double operator()(const Sphere& s) const { return s.radius; }
    double operator()(const Box& s) const { return 0.5 * s.size.norm(); }
    double operator()(const Capsule& s) const { return s.radius + 0.5 * s.height; }
    double operator()(const Cylinder& s) const { return std::hypot(s.radius, 0.5 * s.height); }
    double operator()(const Cone& s) const { return std::hypot(s.radius, 0.5 * s.height); }
    double operator()(const Plane&) const { return std::numeric_limits<double>::infinity(); }
    double operator()(const Hull& s) const {
        return std::sqrt(s.geometry->vertices().colwise().squaredNorm().maxCoeff());
    }
    double operator()(const Mesh& s) const {
        return std::sqrt(s.geometry->vertices().colwise().squaredNorm().maxCoeff());
    }
    double operator()(const Compound& s) const {
        double radius = 0;
        for (const CompoundPart& part : s.parts)
            radius = std::max(radius, part.transform.position.norm() + boundingRadius(part.shape));
        return radius;
    }
};

}  // namespace

double signedDistance(const Shape& shape, const Vec3& point) {
    return std::visit(Distance{point}, shape);
}

double boundingRadius(const Shape& shape) {
    return std::visit(Radius{}, shape);
}

}  // namespace jacket::demo
