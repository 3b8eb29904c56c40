#include "Pictures.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "ShapeSurface.h"

namespace jacket::demo {

namespace {

struct SheetColours {
    unsigned front, back;
};
constexpr std::array kSheets{SheetColours{0x3f7fbf, 0xe8a33d}, SheetColours{0x4a9c6d, 0xd9d2a0},
                             SheetColours{0x8a5fb0, 0xe3c0d8}, SheetColours{0xc4574d, 0xb9c7cf}};
constexpr std::array kBodies{0xd1495bu, 0x5a8f69u, 0xedae49u, 0x7d6b91u, 0x30638eu, 0xb5838du};
constexpr unsigned kGround = 0xb9bcc0;

/// Side from which a scene is seen when it does not say: from the right, a little from above.
const Vec3 kTowardsEye(0.62, 0.42, 1.0);

Eigen::Matrix3Xf vertexNormals(const Eigen::Matrix3Xf& x, const Indices<3>& triangles) {
    Eigen::Matrix3Xf normals = Eigen::Matrix3Xf::Zero(3, x.cols());
    for (const auto& t : triangles.colwise()) {
        const Eigen::Vector3f a = x.col(t[0]), b = x.col(t[1]), c = x.col(t[2]);
        const Eigen::Vector3f normal = (b - a).cross(c - a);
        for (int k = 0; k < 3; ++k) normals.col(t[k]) += normal;
    }
    for (auto n : normals.colwise()) n.normalize();
    return normals;
}

Surface shellSurface(const Eigen::Matrix3Xf& x, const Indices<3>& triangles, std::size_t index) {
    const SheetColours& colours = kSheets[index % kSheets.size()];
    Surface surface;
    surface.positions = x;
    surface.normals = vertexNormals(x, triangles);
    surface.triangles = triangles;
    surface.front = colourFromHex(colours.front);
    surface.back = colourFromHex(colours.back);
    surface.showEdges = true;
    surface.gloss = 0.08f;
    return surface;
}

Surface moved(Surface surface, const BodyState& body) {
    const Eigen::Matrix3f rotation = body.rotation.cast<float>();
    const Eigen::Vector3f position = body.position.cast<float>();
    surface.positions = (rotation * surface.positions).colwise() + position;
    surface.normals = rotation * surface.normals;
    return surface;
}

Ground groundOf(const Plane& plane, const BodyState& body) {
    const Vec3 normal = body.rotation * plane.normal;
    return {normal, plane.offset + normal.dot(body.position), colourFromHex(kGround)};
}

double radiusOf(const Eigen::Matrix3Xf& points) {
    if (points.cols() == 0) return 1.0;
    return std::max(0.5f * (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).norm(), 1e-4f);
}

}  // namespace

Pictures::Pictures(const World& start, int every)
    : m_camera(start.scene().camera), m_bodies(start.scene().bodies), m_every(every) {
    for (int k = 0; k < start.shellCount(); ++k) m_triangles.push_back(start.shell(k).mesh().triangles());
    for (std::size_t k = 0; k < m_bodies.size(); ++k) {
        m_bodySurfaces.push_back(triangulate(m_bodies[k].shape));
        m_bodySurfaces.back().front = m_bodySurfaces.back().back = colourFromHex(kBodies[k % kBodies.size()]);
        m_bodySurfaces.back().gloss = 0.25f;
    }
    add(start, 0);
}

void Pictures::add(const World& world, int frame) {
    if (frame % m_every == 0) keep(world, frame);
}

void Pictures::keep(const World& world, int frame) {
    Moment moment{frame, {}, world.bodies()};
    for (int k = 0; k < world.shellCount(); ++k) moment.shells.push_back(world.shell(k).positions().cast<float>());
    m_moments.push_back(std::move(moment));
}

/// All shells at all moments, the bodies where they start and, unless they fly far away, where they go.
Eigen::Matrix3Xf Pictures::whatToShow() const {
    std::vector<Eigen::Vector3f> points;
    const auto add = [&](const auto& positions) {
        for (const auto& p : positions.colwise())
            if (p.allFinite()) points.emplace_back(p);
    };
    for (const Moment& moment : m_moments)
        for (const auto& shell : moment.shells) add(shell);
    const auto asMatrix = [&] {
        Eigen::Matrix3Xf all(3, static_cast<Eigen::Index>(points.size()));
        for (std::size_t i = 0; i < points.size(); ++i) all.col(static_cast<Eigen::Index>(i)) = points[i];
        return all;
    };
    const Eigen::Matrix3Xf shells = asMatrix();
    const Eigen::Vector3f centre = 0.5f * (shells.rowwise().minCoeff() + shells.rowwise().maxCoeff());
    const double reach = 3.0 * radiusOf(shells);
    for (const Moment& moment : m_moments)
        for (std::size_t k = 0; k < moment.bodies.size(); ++k) {
            const bool isNear = (moment.bodies[k].position.cast<float>() - centre).norm() < reach;
            if (isNear || &moment == &m_moments.front()) add(moved(m_bodySurfaces[k], moment.bodies[k]).positions);
        }
    return asMatrix();
}

Camera Pictures::camera(const Eigen::Matrix3Xf& points, double aspect) const {
    const double fov = m_camera.fovDegrees;
    if (m_camera.eye && m_camera.target) return {*m_camera.eye, *m_camera.target, fov};
    if (m_camera.target) return frameFrom(points, *m_camera.target, kTowardsEye, fov, aspect);
    const Camera all = frameAll(points, kTowardsEye, fov, aspect);
    if (m_camera.eye) return {*m_camera.eye, all.target, fov};
    return all;
}

View Pictures::stage(double aspect) const {
    View stage;
    const Eigen::Matrix3Xf points = whatToShow();
    stage.camera = camera(points, aspect);
    stage.sceneRadius = radiusOf(points);
    return stage;
}

View Pictures::view(int index, View view) const {
    const Moment& moment = m_moments[index];
    for (std::size_t k = 0; k < moment.shells.size(); ++k)
        view.surfaces.push_back(shellSurface(moment.shells[k], m_triangles[k], k));
    for (std::size_t k = 0; k < moment.bodies.size(); ++k) {
        if (const auto* plane = std::get_if<Plane>(&m_bodies[k].shape))
            view.grounds.push_back(groundOf(*plane, moment.bodies[k]));
        else
            view.surfaces.push_back(moved(m_bodySurfaces[k], moment.bodies[k]));
    }
    return view;
}

void Pictures::write(const std::filesystem::path& folder, int width, int height,
                     const std::function<bool(int)>& drawn) const {
    std::filesystem::create_directory(folder);
    const View empty = stage(static_cast<double>(width) / height);
    for (int i = 0; i < count(); ++i) {
        char name[32];
        std::snprintf(name, sizeof name, "%06d.png", m_moments[i].frame);
        writePng(folder / name, render(view(i, empty), width, height));
        if (!drawn(i + 1)) return;
    }
}

}  // namespace jacket::demo
