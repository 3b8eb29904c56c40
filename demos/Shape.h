#pragma once
#include <filesystem>
#include <memory>
#include <string_view>
#include <variant>
#include <vector>

#include "ConvexHull.h"
#include "SurfaceMesh.h"
#include "jacket/Types.h"

/// Shapes of rigid bodies as scene files give them, each in its own frame; long axes along y.
namespace jacket::demo {

struct Transform {
    Vec3 position = Vec3::Zero();     ///< [m]
    Vec3 rotationDeg = Vec3::Zero();  ///< about the fixed x, then y, then z axis [degrees]

    Mat3 rotation() const;
};

struct Sphere {
    double radius;  ///< [m]
};
struct Box {
    Vec3 size;  ///< whole edge lengths [m]
};
struct Capsule {
    double radius, height;  ///< height between the centres of the two caps [m]
};
struct Cylinder {
    double radius, height;  ///< [m]
};
struct Cone {
    double radius, height;  ///< apex at +height/2, base at -height/2 [m]
};
/// The half space normal . x <= offset is solid.
struct Plane {
    Vec3 normal;    ///< unit
    double offset;  ///< [m]
};
/// Convex hull of a mesh's vertices.
struct Hull {
    std::filesystem::path file;
    std::shared_ptr<const ConvexHull> geometry;  ///< once the file has been read
};
/// A mesh's triangles as they are, solid behind them. Cannot move by forces.
struct Mesh {
    std::filesystem::path file;
    std::shared_ptr<const SurfaceMesh> geometry;  ///< once the file has been read
};
struct CompoundPart;
/// Several shapes, of the same density, as one.
struct Compound {
    std::vector<CompoundPart> parts;
};
using Shape = std::variant<Sphere, Box, Capsule, Cylinder, Cone, Plane, Hull, Mesh, Compound>;
struct CompoundPart {
    Shape shape;
    Transform transform;
};

/// Exact distance of a point, in the shape's frame, from the shape's true surface; negative inside [m]. Written from
/// the definitions of the shapes alone, as a check on the collision code. Inside a compound it is that of the part in
/// which the point is deepest.
double signedDistance(const Shape& shape, const Vec3& point);

/// Radius around the origin of the shape's frame that holds all of it; infinite for planes [m].
double boundingRadius(const Shape& shape);

}  // namespace jacket::demo
