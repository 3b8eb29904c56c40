#include "ConvexPieces.h"

#include <BulletCollision/CollisionShapes/btBox2dShape.h>
#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <BulletCollision/CollisionShapes/btConeShape.h>
#include <BulletCollision/CollisionShapes/btConvex2dShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btHeightfieldTerrainShape.h>
#include <BulletCollision/CollisionShapes/btMinkowskiSumShape.h>
#include <BulletCollision/CollisionShapes/btSdfCollisionShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/CollisionShapes/btStaticPlaneShape.h>
#include <BulletCollision/CollisionShapes/btUniformScalingShape.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>

#include <limits>
#include <type_traits>
#include <utility>

#include "ClosedForms.h"

namespace jacket::bullet {
namespace {

// -------------------------------------------------------------------------------- solids by their support function

constexpr double kBulletAccuracy = sizeof(btScalar) == sizeof(float) ? 2e-7 : 1e-15;

/// What Bullet says.
class ShapeMap final : public SupportMap {
  public:
    ShapeMap(const btConvexShape& shape, bool withMargin) : m_shape(shape), m_withMargin(withMargin) {}
    Vec3 support(const Vec3& direction) const override {
        const btVector3 d = toBullet(direction);
        return fromBullet(m_withMargin ? m_shape.localGetSupportingVertex(d)
                                       : m_shape.localGetSupportingVertexWithoutMargin(d));
    }
    double accuracy() const override { return kBulletAccuracy; }

  private:
    const btConvexShape& m_shape;
    bool m_withMargin;
};

template <class Form>
class FormMap final : public SupportMap {
  public:
    explicit FormMap(Form form) : m_form(std::move(form)) {}
    Vec3 support(const Vec3& direction) const override { return m_form.support(direction); }
    const Form& form() const { return m_form; }

  private:
    Form m_form;
};

/// Turned, moved and uniformly scaled.
class PlacedMap final : public SupportMap {
  public:
    PlacedMap(std::unique_ptr<SupportMap> map, const Frame& frame, double scale)
        : m_map(std::move(map)), m_frame(frame), m_scale(scale) {}
    Vec3 support(const Vec3& direction) const override {
        return m_frame * (m_scale * m_map->support(m_frame.linear().transpose() * direction));
    }
    double accuracy() const override { return m_map->accuracy(); }

  private:
    std::unique_ptr<SupportMap> m_map;
    Frame m_frame;
    double m_scale;
};

/// The points a - b: Bullet's Minkowski "sum".
class DifferenceMap final : public SupportMap {
  public:
    DifferenceMap(std::unique_ptr<SupportMap> a, std::unique_ptr<SupportMap> b)
        : m_a(std::move(a)), m_b(std::move(b)) {}
    Vec3 support(const Vec3& direction) const override { return m_a->support(direction) - m_b->support(-direction); }
    double accuracy() const override { return std::max(m_a->accuracy(), m_b->accuracy()); }

  private:
    std::unique_ptr<SupportMap> m_a, m_b;
};

struct PointsForm {
    std::vector<Vec3> points;
    Vec3 support(const Vec3& direction) const { return farthest(points, direction); }
};

// ----------------------------------------------------------------------------------------- pieces of the known kinds

/// Bounds of a solid with a support function, turned and moved.
template <class Solid>
std::pair<Vec3, Vec3> boundsOf(const Solid& solid, const Frame& frame) {
    Vec3 lower, upper;
    for (int axis = 0; axis < 3; ++axis) {
        const Vec3 direction = frame.linear().row(axis).transpose();
        lower[axis] = (frame * solid.support(-direction))[axis];
        upper[axis] = (frame * solid.support(direction))[axis];
    }
    return {lower, upper};
}

std::pair<Vec3, Vec3> boundsOf(const HalfSpaceForm&, const Frame&) {
    const Vec3 infinite = Vec3::Constant(std::numeric_limits<double>::infinity());
    return {-infinite, infinite};
}

/// Closed forms for points and triangles.
template <class Form>
struct ExactSolid {
    Form form;
    std::optional<SurfacePoint> touch(const Vec3& p, double reach) const {
        const SurfacePoint s = form.nearest(p);
        return s.distance <= reach ? std::optional(s) : std::nullopt;
    }
    std::optional<TrianglePoint> touch(const Mat3& triangle, double reach) const {
        if constexpr (requires { form.isBeyond(triangle, reach); })
            if (form.isBeyond(triangle, reach)) return std::nullopt;
        const TrianglePoint t = form.nearestOfTriangle(triangle);
        return t.surface.distance <= reach ? std::optional(t) : std::nullopt;
    }
    auto bounds(const Frame& frame) const { return boundsOf(form, frame); }
};

/// A closed form for points, libccd for triangles, but for those that touch the round side of a cylinder.
template <class Form>
struct PointExactSolid {
    explicit PointExactSolid(Form form) : map(std::make_unique<FormMap<Form>>(std::move(form))), ccd(*map) {}
    std::unique_ptr<FormMap<Form>> map;
    CcdContact ccd;
    std::optional<SurfacePoint> touch(const Vec3& p, double reach) const {
        const SurfacePoint s = map->form().nearest(p);
        return s.distance <= reach ? std::optional(s) : std::nullopt;
    }
    std::optional<TrianglePoint> touch(const Mat3& triangle, double reach) const {
        if constexpr (requires { map->form().sideOfTriangle(triangle); })
            if (const auto side = map->form().sideOfTriangle(triangle))
                return side->surface.distance <= reach ? side : std::nullopt;
        return ccd.touch(triangle, reach);
    }
    auto bounds(const Frame& frame) const { return boundsOf(*map, frame); }
};

/// libccd for both.
struct CcdSolid {
    explicit CcdSolid(std::unique_ptr<SupportMap> theMap) : map(std::move(theMap)), ccd(*map) {}
    std::unique_ptr<SupportMap> map;
    CcdContact ccd;
    std::optional<SurfacePoint> touch(const Vec3& p, double reach) const { return ccd.touch(p, reach); }
    std::optional<TrianglePoint> touch(const Mat3& triangle, double reach) const { return ccd.touch(triangle, reach); }
    auto bounds(const Frame& frame) const { return boundsOf(*map, frame); }
};

/// A solid somewhere in the body's frame.
template <class Solid>
class PlacedPiece final : public ConvexPiece {
  public:
    PlacedPiece(Solid solid, const Frame& frame) : m_solid(std::move(solid)), m_frame(frame) {
        std::tie(m_lower, m_upper) = m_solid.bounds(frame);
    }
    std::optional<SurfacePoint> touch(const Vec3& p, double reach) const override {
        auto s = m_solid.touch(Vec3(m_frame.linear().transpose() * (p - m_frame.translation())), reach);
        if (s) s = placed(m_frame, *s);
        return s;
    }
    std::optional<TrianglePoint> touch(const Mat3& triangle, double reach) const override {
        const Mat3 local = m_frame.linear().transpose() * (triangle.colwise() - m_frame.translation());
        auto t = m_solid.touch(local, reach);
        if (t) t->surface = placed(m_frame, t->surface);
        return t;
    }
    Vec3 lower() const override { return m_lower; }
    Vec3 upper() const override { return m_upper; }
    bool asksShape() const override { return std::is_same_v<Solid, CcdSolid>; }

  private:
    Solid m_solid;
    Frame m_frame;
    Vec3 m_lower, m_upper;
};

template <class Solid>
std::unique_ptr<ConvexPiece> place(Solid solid, const Frame& frame) {
    return std::make_unique<PlacedPiece<Solid>>(std::move(solid), frame);
}

// -------------------------------------------------------------------------------------- what Bullet's shapes measure

/// Rotation that brings y to the given axis.
Frame upright(int axis) {
    Frame frame = Frame::Identity();
    if (axis == 0) frame.linear() << 0, 1, 0, -1, 0, 0, 0, 0, 1;
    if (axis == 2) frame.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    return frame;
}

SphereForm formOf(const btSphereShape& s) {
    return {double(s.getRadius())};
}
BoxForm formOf(const btBoxShape& s) {
    return {fromBullet(s.getHalfExtentsWithMargin())};
}
BoxForm formOf(const btBox2dShape& s) {
    return {fromBullet(s.getHalfExtentsWithMargin())};
}
CapsuleForm formOf(const btCapsuleShape& s) {
    return {double(s.getRadius()), double(s.getHalfHeight())};
}
CylinderForm formOf(const btCylinderShape& s) {
    return {double(s.getRadius()), double(s.getHalfExtentsWithMargin()[s.getUpAxis()])};
}
ConeForm formOf(const btConeShape& s) {
    return {double(s.getRadius()), double(s.getHeight()) / 2};
}

std::vector<Vec3> pointsOf(const btConvexHullShape& s) {
    std::vector<Vec3> points(s.getNumPoints());
    for (int i = 0; i < s.getNumPoints(); ++i) points[i] = fromBullet(s.getScaledPoint(i));
    return points;
}

template <class Shape>
const Shape& as(const btCollisionShape& shape) {
    return static_cast<const Shape&>(shape);
}

template <class Form>
std::unique_ptr<SupportMap> mapOf(Form form, int axis = 1) {
    auto map = std::make_unique<FormMap<Form>>(std::move(form));
    if (axis == 1) return map;
    return std::make_unique<PlacedMap>(std::move(map), upright(axis), 1.0);
}

/// A shape of the user's own: its margin counts only where there is nothing without it.
std::unique_ptr<SupportMap> mapOfCustom(const btConvexShape& shape) {
    const auto [lower, upper] = boundsOf(ShapeMap(shape, false), Frame::Identity());
    const Vec3 extents = upper - lower;
    const bool isSkeleton = !(extents.minCoeff() > 1e-6 * (extents.maxCoeff() + double(shape.getMargin())));
    return std::make_unique<ShapeMap>(shape, isSkeleton);
}

std::unique_ptr<SupportMap> makeMap(const btConvexShape& shape);

std::unique_ptr<SupportMap> mapOfSum(const btMinkowskiSumShape& s) {
    return std::make_unique<DifferenceMap>(
        std::make_unique<PlacedMap>(makeMap(*s.getShapeA()), fromBullet(s.getTransformA()), 1.0),
        std::make_unique<PlacedMap>(makeMap(*s.getShapeB()), fromBullet(s.getTransformB()), 1.0));
}

std::unique_ptr<SupportMap> makeMap(const btConvexShape& shape) {
    switch (shape.getShapeType()) {
        case SPHERE_SHAPE_PROXYTYPE:
            return mapOf(formOf(as<btSphereShape>(shape)));
        case BOX_SHAPE_PROXYTYPE:
            return mapOf(formOf(as<btBoxShape>(shape)));
        case BOX_2D_SHAPE_PROXYTYPE:
            return mapOf(formOf(as<btBox2dShape>(shape)));
        case CONVEX_2D_SHAPE_PROXYTYPE:
            return makeMap(*as<btConvex2dShape>(shape).getChildShape());
        case CAPSULE_SHAPE_PROXYTYPE:
            return mapOf(formOf(as<btCapsuleShape>(shape)), as<btCapsuleShape>(shape).getUpAxis());
        case CYLINDER_SHAPE_PROXYTYPE:
            return mapOf(formOf(as<btCylinderShape>(shape)), as<btCylinderShape>(shape).getUpAxis());
        case CONE_SHAPE_PROXYTYPE:
            return mapOf(formOf(as<btConeShape>(shape)), as<btConeShape>(shape).getConeUpIndex());
        case CONVEX_HULL_SHAPE_PROXYTYPE:
            return mapOf(PointsForm{pointsOf(as<btConvexHullShape>(shape))});
        case MULTI_SPHERE_SHAPE_PROXYTYPE:
            return std::make_unique<ShapeMap>(shape, true);
        case MINKOWSKI_DIFFERENCE_SHAPE_PROXYTYPE:
            [[fallthrough]];
        case MINKOWSKI_SUM_SHAPE_PROXYTYPE:
            return mapOfSum(as<btMinkowskiSumShape>(shape));
        case UNIFORM_SCALING_SHAPE_PROXYTYPE: {
            const auto& scaled = as<btUniformScalingShape>(shape);
            return std::make_unique<PlacedMap>(makeMap(*scaled.getChildShape()), Frame::Identity(),
                                               double(scaled.getUniformScalingFactor()));
        }
        case CUSTOM_CONVEX_SHAPE_TYPE:
            return mapOfCustom(shape);
        default:
            return std::make_unique<ShapeMap>(shape, false);
    }
}

HalfSpaceForm formOf(const btStaticPlaneShape& s) {
    const Vec3 normal = fromBullet(s.getPlaneNormal());
    const double length = normal.norm();
    return {normal / length, double(s.getPlaneConstant()) / length};
}

std::unique_ptr<ConvexPiece> makePiece(const btConvexShape& shape, const Frame& frame) {
    switch (shape.getShapeType()) {
        case SPHERE_SHAPE_PROXYTYPE:
            return place(ExactSolid<SphereForm>{formOf(as<btSphereShape>(shape))}, frame);
        case BOX_SHAPE_PROXYTYPE:
            return place(PointExactSolid<BoxForm>(formOf(as<btBoxShape>(shape))), frame);
        case BOX_2D_SHAPE_PROXYTYPE:
            return place(PointExactSolid<BoxForm>(formOf(as<btBox2dShape>(shape))), frame);
        case CONVEX_2D_SHAPE_PROXYTYPE:
            return makePiece(*as<btConvex2dShape>(shape).getChildShape(), frame);
        case CAPSULE_SHAPE_PROXYTYPE: {
            const auto& capsule = as<btCapsuleShape>(shape);
            return place(ExactSolid<CapsuleForm>{formOf(capsule)}, frame * upright(capsule.getUpAxis()));
        }
        case CYLINDER_SHAPE_PROXYTYPE: {
            const auto& cylinder = as<btCylinderShape>(shape);
            return place(PointExactSolid<CylinderForm>(formOf(cylinder)), frame * upright(cylinder.getUpAxis()));
        }
        case CONE_SHAPE_PROXYTYPE: {
            const auto& cone = as<btConeShape>(shape);
            return place(PointExactSolid<ConeForm>(formOf(cone)), frame * upright(cone.getConeUpIndex()));
        }
        case CONVEX_HULL_SHAPE_PROXYTYPE:
            if (auto hull = HullForm::of(pointsOf(as<btConvexHullShape>(shape))))
                return place(PointExactSolid<HullForm>(std::move(*hull)), frame);
            return makeCcdPiece(shape, frame);
        default:
            return makeCcdPiece(shape, frame);
    }
}

const btGImpactCompoundShape* asGImpactCompound(const btCollisionShape& shape) {
    if (shape.getShapeType() != GIMPACT_SHAPE_PROXYTYPE) return nullptr;
    const auto& impact = as<btGImpactShapeInterface>(shape);
    return impact.getGImpactShapeType() == CONST_GIMPACT_COMPOUND_SHAPE ? &as<btGImpactCompoundShape>(shape) : nullptr;
}

/// Calls use(part, frame) for the shape, or for every child of a compound.
template <class Use>
void forEachPart(const btCollisionShape& shape, const Frame& frame, const Use& use) {
    const auto* impact = asGImpactCompound(shape);
    if (shape.isCompound()) {
        const auto& compound = as<btCompoundShape>(shape);
        for (int i = 0; i < compound.getNumChildShapes(); ++i)
            forEachPart(*compound.getChildShape(i), frame * fromBullet(compound.getChildTransform(i)), use);
    } else if (impact) {
        for (int i = 0; i < impact->getNumChildShapes(); ++i) {
            const Frame child =
                impact->childrenHasTransform() ? fromBullet(impact->getChildTransform(i)) : Frame(Frame::Identity());
            forEachPart(*impact->getChildShape(i), frame * child, use);
        }
    } else {
        use(shape, frame);
    }
}

/// Bullet's distance fields list no triangles.
bool hasTriangles(const btCollisionShape& shape) {
    return shape.isConcave() && shape.getShapeType() != STATIC_PLANE_PROXYTYPE &&
           !dynamic_cast<const btSdfCollisionShape*>(&shape);
}

}  // namespace

std::unique_ptr<ConvexPiece> makeCcdPiece(const btConvexShape& shape, const Frame& frame) {
    return place(CcdSolid(makeMap(shape)), frame);
}

std::vector<std::unique_ptr<ConvexPiece>> makeConvexPieces(const btCollisionShape& shape,
                                                           std::vector<std::string>& unsupported) {
    std::vector<std::unique_ptr<ConvexPiece>> pieces;
    forEachPart(shape, Frame::Identity(), [&](const btCollisionShape& part, const Frame& frame) {
        if (part.getShapeType() == STATIC_PLANE_PROXYTYPE)
            pieces.push_back(place(ExactSolid<HalfSpaceForm>{formOf(as<btStaticPlaneShape>(part))}, frame));
        else if (part.getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE && as<btConvexHullShape>(part).getNumPoints() == 0)
            unsupported.emplace_back("empty Convex");
        else if (part.isConvex())
            pieces.push_back(makePiece(as<btConvexShape>(part), frame));
        else if (!hasTriangles(part))
            unsupported.emplace_back(part.getName());
    });
    return pieces;
}

namespace {

class EdgeLengths final : public btTriangleCallback {
  public:
    void processTriangle(btVector3* corners, int, int) override {
        for (int i = 0; i < 3; ++i) m_sum += double(corners[i].distance(corners[(i + 1) % 3]));
        m_count += 3;
    }
    double mean() const { return m_count > 0 ? m_sum / double(m_count) : std::numeric_limits<double>::infinity(); }

  private:
    double m_sum = 0.0;
    long m_count = 0;
};

/// A heightfield, of which there may be millions, is asked for its scaling only: it has a point in each unit.
double grainOf(const btConcaveShape& shape) {
    if (shape.getShapeType() == CUSTOM_CONCAVE_SHAPE_TYPE) return std::numeric_limits<double>::infinity();
    if (shape.getShapeType() == TERRAIN_SHAPE_PROXYTYPE) {
        const int up = as<btHeightfieldTerrainShape>(shape).getUpAxis();
        const btVector3& unit = shape.getLocalScaling();
        return 0.5 * double(btFabs(unit[(up + 1) % 3]) + btFabs(unit[(up + 2) % 3]));
    }
    btVector3 lower, upper;
    shape.getAabb(btTransform::getIdentity(), lower, upper);
    EdgeLengths lengths;
    shape.processAllTriangles(&lengths, lower, upper);
    return lengths.mean();
}

}  // namespace

std::vector<ConcavePiece> concavePieces(const btCollisionShape& shape) {
    std::vector<ConcavePiece> pieces;
    forEachPart(shape, Frame::Identity(), [&](const btCollisionShape& part, const Frame& frame) {
        if (hasTriangles(part)) pieces.push_back({&as<btConcaveShape>(part), frame, grainOf(as<btConcaveShape>(part))});
    });
    return pieces;
}

std::size_t fingerprintOf(const btCollisionShape& shape) {
    std::size_t hash = 0;
    const auto mix = [&](auto value) { hash = 31 * hash + std::hash<decltype(value)>{}(value); };
    forEachPart(shape, Frame::Identity(), [&](const btCollisionShape& part, const Frame& frame) {
        mix(&part);
        mix(part.getShapeType());
        for (const double entry : frame.matrix().topRows<3>().reshaped()) mix(entry);
        if (hasTriangles(part)) return;
        btVector3 lower, upper;
        part.getAabb(btTransform::getIdentity(), lower, upper);
        for (int k = 0; k < 3; ++k) mix(lower[k]), mix(upper[k]);
    });
    return hash;
}

}  // namespace jacket::bullet
