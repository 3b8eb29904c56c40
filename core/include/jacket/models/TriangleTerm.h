#pragma once
#include <concepts>

#include "jacket/models/StencilModel.h"

/// The words in which a triangle's formula is written so that a compiler can apply it to many triangles at once: plain
/// numbers, no branches, all of it inlined. Eigen's small matrices bring vector instructions of their own, across x, y
/// and z, which stand in the way.
namespace jacket {

#define JACKET_FORMULA [[gnu::always_inline]] inline

struct Triple {
    double x, y, z;
};
JACKET_FORMULA Triple operator+(const Triple& a, const Triple& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}
JACKET_FORMULA Triple operator-(const Triple& a, const Triple& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
JACKET_FORMULA Triple operator*(double s, const Triple& a) {
    return {s * a.x, s * a.y, s * a.z};
}
JACKET_FORMULA double dot(const Triple& a, const Triple& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// A 3 x 3 block, by columns.
struct PlainBlock {
    Triple c0, c1, c2;
};
/// u p^T + v q^T + s I
JACKET_FORMULA PlainBlock outerSum(const Triple& u, const Triple& p, const Triple& v, const Triple& q, double s) {
    return {{u.x * p.x + v.x * q.x + s, u.y * p.x + v.y * q.x, u.z * p.x + v.z * q.x},
            {u.x * p.y + v.x * q.y, u.y * p.y + v.y * q.y + s, u.z * p.y + v.z * q.y},
            {u.x * p.z + v.x * q.z, u.y * p.z + v.y * q.z, u.z * p.z + v.z * q.z + s}};
}

/// One triangle's term of an energy, by the edges a = x1 - x0 and b = x2 - x0. Moving all three vertices does nothing.
struct TriangleTerm {
    double energy;                ///< [J]
    Triple gradient1, gradient2;  ///< dE/dx1, dE/dx2 [N]
    PlainBlock block11, block22;  ///< d2E/dx1 dx1, d2E/dx2 dx2: symmetric [N/m]
    PlainBlock block12;           ///< d2E/dx1 dx2 [N/m]
};

/// A triangle's model that is written this way: energies that are sums over triangles loop over several at a time.
template <class Model>
concept TriangleTermModel = StencilModel<Model> && requires(const Triple edge, const typename Model::Rest rest) {
    { Model::term(edge, edge, rest, HessianKind::Positive) } -> std::same_as<TriangleTerm>;
};

inline Triple triple(const Vec3& v) {
    return {v.x(), v.y(), v.z()};
}
inline Vec3 vec3(const Triple& t) {
    return {t.x, t.y, t.z};
}
inline Mat3 mat3(const PlainBlock& b) {
    Mat3 m;
    m << vec3(b.c0), vec3(b.c1), vec3(b.c2);
    return m;
}

}  // namespace jacket
