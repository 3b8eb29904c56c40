#pragma once
#include <BulletCollision/CollisionShapes/btTriangleMesh.h>
#include <BulletCollision/Gimpact/btGImpactShape.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "support/HardScenes.h"

namespace jacket::bullet::testing {

/// The surface of a box of given half extents.
inline std::unique_ptr<btTriangleMesh> boxMesh(const btVector3& half) {
    auto mesh = std::make_unique<btTriangleMesh>();
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {-1, 1}) {
            std::array<btVector3, 4> corners;  // counter-clockwise from outside
            for (int k = 0; k < 4; ++k) {
                corners[k][axis] = side * half[axis];
                corners[k][(axis + 1) % 3] = (k == 1 || k == 2 ? side : -side) * half[(axis + 1) % 3];
                corners[k][(axis + 2) % 3] = (k < 2 ? -1 : 1) * half[(axis + 2) % 3];
            }
            mesh->addTriangle(corners[0], corners[1], corners[2]);
            mesh->addTriangle(corners[0], corners[2], corners[3]);
        }
    return mesh;
}

inline std::unique_ptr<btCollisionShape> gimpactShape(btTriangleMesh& mesh) {
    auto shape = std::make_unique<btGImpactMeshShape>(&mesh);
    shape->updateBound();
    return shape;
}

/// Half the side of the cubes that fly, and the radius of the balls [m].
inline const btVector3 kHalf{btScalar(0.05), btScalar(0.05), btScalar(0.05)};

/// "ball", "box" or "mesh" of 10 cm, or a "rod" 4 cm thick. `cube`: what the mesh is made of, boxMesh(kHalf).
inline std::unique_ptr<btCollisionShape> missile(const std::string& shape, btTriangleMesh& cube) {
    if (shape == "ball") return std::make_unique<btSphereShape>(kHalf.x());
    if (shape == "box") return std::make_unique<btBoxShape>(kHalf);
    if (shape == "rod") return std::make_unique<btCapsuleShapeX>(btScalar(0.02), btScalar(0.3));
    return gimpactShape(cube);
}

/// A sheet of 1 m, held at its border in the plane y = 0, without gravity.
struct Target : BulletScene {
    ShellBody& sheet;
    Target() : BulletScene(0.0), sheet(shells->add(squareSheet(1, 20), trampolineCloth())) { pinBorder(sheet); }

    /// Whether the middle of a body near the sheet's middle is above it: by the heights of the vertices around.
    bool isAbove(const btRigidBody& body) const {
        const Vec3 centre = toVec3(body.getWorldTransform().getOrigin());
        const Points& x = sheet.shell().positions();
        Eigen::Index nearest = 0;
        (Eigen::Matrix2Xd(2, x.cols()) << x.row(0).array() - centre.x(), x.row(2).array() - centre.z())
            .finished()
            .colwise()
            .squaredNorm()
            .minCoeff(&nearest);
        return centre.y() > x(1, nearest) - 0.05;
    }
};

/// A sheet of cotton, 1 m, `cells` a side, that comes down at `speed` [m/s] over a fixed board smaller than itself,
/// `thick` [m].
struct Shelf : BulletScene {
    const btVector3 half;
    btRigidBody& board;
    ShellBody& sheet;
    Shelf(double thick, const Vec3& from, double speed, int cells = 30)
        : half(btScalar(0.2), btScalar(0.5 * thick), btScalar(0.15)),
          board(addBox(half, 0, btVector3(0, 0, 0))),
          sheet(shells->add(squareSheet(1, cells), materials::cotton())) {
        place(sheet, from);
        sheet.setVelocity(btVector3(0, btScalar(-speed), 0));
        const Points& x = sheet.shell().positions();
        for (int i = 0; i < sheet.vertexCount(); ++i)
            if (std::abs(x(0, i)) < double(half.x()) && std::abs(x(2, i)) < double(half.z())) m_over.push_back(i);
    }
    /// Whether what came down over the board lies on it, but for a tenth that may have slipped over its edges.
    bool isHeld() const {
        const Points& x = sheet.shell().positions();
        const auto lies = [&](int i) {
            return x(1, i) > 0.0 && std::abs(x(0, i)) < double(half.x()) + 0.01 &&
                   std::abs(x(2, i)) < double(half.z()) + 0.01;
        };
        return double(std::count_if(m_over.begin(), m_over.end(), lies)) > 0.9 * double(m_over.size());
    }

  private:
    std::vector<int> m_over;  ///< vertices above the board at the start
};

}  // namespace jacket::bullet::testing
