#include "Renderer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace jacket::demo {

namespace {

using Vec3f = Eigen::Vector3f;
using Vec2f = Eigen::Vector2f;

constexpr int kSamples = 2;  ///< per pixel and direction
constexpr int kShadowMapSize = 1024;

float toLinear(float srgb) {
    return srgb <= 0.04045f ? srgb / 12.92f : std::pow((srgb + 0.055f) / 1.055f, 2.4f);
}
float toSrgb(float linear) {
    return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

/// Where a vertex lands: pixel coordinates, and a number that is larger for what is nearer and linear on the screen.
struct ScreenPoint {
    float x, y, nearness;
};

/// Axes of a camera or light, looking along `forward`.
struct Axes {
    Vec3f origin, right, up, forward;

    Axes(const Vec3f& eye, const Vec3f& direction) : origin(eye), forward(direction.normalized()) {
        const Vec3f vertical = std::abs(forward.y()) < 0.999f ? Vec3f::UnitY().eval() : Vec3f::UnitZ().eval();
        right = forward.cross(vertical).normalized();
        up = right.cross(forward);
    }
    Vec3f local(const Vec3f& p) const {
        const Vec3f d = p - origin;
        return {right.dot(d), up.dot(d), forward.dot(d)};
    }
};

/// Perspective view of width x height pixels; nearness is one over the depth.
class Lens {
  public:
    Lens(const Camera& camera, int width, int height)
        : m_axes(camera.eye.cast<float>(), (camera.target - camera.eye).cast<float>()),
          m_centre(0.5f * static_cast<float>(width), 0.5f * static_cast<float>(height)),
          m_scale(m_centre.y() / static_cast<float>(std::tan(camera.fovDegrees * std::numbers::pi / 360.0))) {}

    ScreenPoint project(const Vec3f& p) const {
        const Vec3f q = m_axes.local(p);
        return {m_centre.x() + m_scale * q.x() / q.z(), m_centre.y() - m_scale * q.y() / q.z(), 1.0f / q.z()};
    }
    bool isInFront(const Vec3f& p) const { return m_axes.local(p).z() > 1e-4f; }
    /// Direction through a pixel whose component along the view is 1.
    Vec3f ray(float x, float y) const {
        return m_axes.forward + ((x - m_centre.x()) * m_axes.right - (y - m_centre.y()) * m_axes.up) / m_scale;
    }
    const Axes& axes() const { return m_axes; }
    float scale() const { return m_scale; }  ///< pixels per unit length at depth 1

  private:
    Axes m_axes;
    Vec2f m_centre;
    float m_scale;
};

/// What is seen in a pixel: a triangle and where in it (barycentric coordinates on the screen).
struct Hit {
    float nearness = -std::numeric_limits<float>::infinity();
    int triangle = -1;
    float b1 = 0, b2 = 0;
};

/// Keeps the nearest triangle of every pixel.
class DepthBuffer {
  public:
    DepthBuffer(int width, int height) : m_width(width), m_height(height), m_hits(std::size_t(width) * height) {}

    const Hit& at(int x, int y) const { return m_hits[std::size_t(y) * m_width + x]; }

    void draw(const ScreenPoint& a, const ScreenPoint& b, const ScreenPoint& c, int triangle) {
        const float area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if (!(std::abs(area) > 1e-12f)) return;  // also when it is not a number
        const int left = clampTo(std::ceil(std::min({a.x, b.x, c.x}) - 0.5f), m_width);
        const int right = clampTo(std::floor(std::max({a.x, b.x, c.x}) - 0.5f) + 1, m_width);
        const int top = clampTo(std::ceil(std::min({a.y, b.y, c.y}) - 0.5f), m_height);
        const int bottom = clampTo(std::floor(std::max({a.y, b.y, c.y}) - 0.5f) + 1, m_height);
        for (int y = top; y < bottom; ++y)
            for (int x = left; x < right; ++x) {
                const float px = static_cast<float>(x) + 0.5f - a.x, py = static_cast<float>(y) + 0.5f - a.y;
                const float b1 = (px * (c.y - a.y) - py * (c.x - a.x)) / area;
                const float b2 = ((b.x - a.x) * py - (b.y - a.y) * px) / area;
                if (b1 < 0 || b2 < 0 || b1 + b2 > 1) continue;
                const float nearness = a.nearness + b1 * (b.nearness - a.nearness) + b2 * (c.nearness - a.nearness);
                Hit& hit = m_hits[std::size_t(y) * m_width + x];
                if (nearness > hit.nearness) hit = {nearness, triangle, b1, b2};
            }
    }

  private:
    static int clampTo(float x, int high) { return static_cast<int>(std::clamp(x, 0.0f, static_cast<float>(high))); }

    int m_width, m_height;
    std::vector<Hit> m_hits;
};

/// The light's own view of everything that casts a shadow.
class ShadowMap {
  public:
    ShadowMap(const View& view, const Vec3f& towardsLight) : m_axes(Vec3f::Zero(), -towardsLight) {
        m_low.setConstant(std::numeric_limits<float>::max());
        Vec2f high = -m_low;
        for (const Surface& surface : view.surfaces)
            for (const auto& p : surface.positions.colwise()) {
                if (!p.allFinite()) continue;
                m_low = m_low.cwiseMin(m_axes.local(p).head<2>());
                high = high.cwiseMax(m_axes.local(p).head<2>());
            }
        m_texel = std::max((high - m_low).maxCoeff(), 1e-6f) / (kShadowMapSize - 8);
        m_low.array() -= 4 * m_texel;
        DepthBuffer buffer(kShadowMapSize, kShadowMapSize);
        for (const Surface& surface : view.surfaces)
            for (const auto& t : surface.triangles.colwise())
                buffer.draw(project(surface.positions.col(t[0])), project(surface.positions.col(t[1])),
                            project(surface.positions.col(t[2])), 0);
        m_nearness.reserve(std::size_t(kShadowMapSize) * kShadowMapSize);
        for (int y = 0; y < kShadowMapSize; ++y)
            for (int x = 0; x < kShadowMapSize; ++x) m_nearness.push_back(buffer.at(x, y).nearness);
    }

    /// Share of the light that reaches a point of a surface, 0..1.
    float light(const Vec3f& point, const Vec3f& normal) const {
        const float slope = 1.0f - std::abs(normal.dot(m_axes.forward));
        const float side = normal.dot(m_axes.forward) > 0 ? -1.0f : 1.0f;
        const ScreenPoint p = project(point + side * (1.5f + 2.5f * slope) * m_texel * normal);
        constexpr int kReach = 2;
        if (!(std::min(p.x, p.y) >= kReach && std::max(p.x, p.y) < kShadowMapSize - kReach)) return 1.0f;
        int lit = 0;
        for (int y = static_cast<int>(p.y) - kReach; y <= static_cast<int>(p.y) + kReach; ++y) {
            const float* row = &m_nearness[std::size_t(y) * kShadowMapSize];
            for (int x = static_cast<int>(p.x) - kReach; x <= static_cast<int>(p.x) + kReach; ++x)
                lit += row[x] <= p.nearness + m_texel ? 1 : 0;
        }
        return static_cast<float>(lit) / ((2 * kReach + 1) * (2 * kReach + 1));
    }

  private:
    ScreenPoint project(const Vec3f& p) const {
        const Vec3f q = m_axes.local(p);
        return {(q.x() - m_low.x()) / m_texel, (q.y() - m_low.y()) / m_texel, -q.z()};
    }

    Axes m_axes;
    std::vector<float> m_nearness;  ///< of what the light meets first
    Vec2f m_low;
    float m_texel = 1.0f;  ///< [m]
};

/// One triangle of the view, as the depth buffer numbers them.
struct TriangleRef {
    const Surface* surface;
    int index;
    std::array<ScreenPoint, 3> screen;

    /// Pixels from a point of the triangle to its nearest edge.
    float edgeDistance(const std::array<float, 3>& b) const {
        float nearest = std::numeric_limits<float>::max();
        for (int k = 0; k < 3; ++k) nearest = std::min(nearest, b[k] * altitude(k));
        return nearest;
    }
    float smallestAltitude() const { return std::min({altitude(0), altitude(1), altitude(2)}); }

  private:
    float altitude(int k) const {
        const ScreenPoint &a = screen[k], &b = screen[(k + 1) % 3], &c = screen[(k + 2) % 3];
        const float doubleArea = std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
        return doubleArea / std::max(std::hypot(c.x - b.x, c.y - b.y), 1e-6f);
    }
};

/// A point of a surface and how it looks without light.
struct Fragment {
    Vec3f position = Vec3f::Zero(), normal = Vec3f::Zero();  ///< the normal on the side that is seen
    Colour colour = Colour::Zero();
    float gloss = 0.0f;
};

class Painter {
  public:
    Painter(const View& view, int width, int height)
        : m_view(view),
          m_width(width * kSamples),
          m_height(height * kSamples),
          m_lens(view.camera, m_width, m_height),
          m_buffer(m_width, m_height),
          m_towardsLight(lightDirection(m_lens.axes())),
          m_shadows(view, m_towardsLight),
          m_chequer(chequerSize(view.sceneRadius)) {
        for (const Ground& ground : view.grounds) m_planes.emplace_back(Vec3f::Zero(), ground.normal.cast<float>());
        for (const Surface& surface : view.surfaces) draw(surface);
    }

    Colour colourAt(int x, int y) const {
        const Hit& hit = m_buffer.at(x, y);
        const Vec3f ray = m_lens.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
        float depth = hit.triangle >= 0 ? 1.0f / hit.nearness : std::numeric_limits<float>::infinity();
        std::size_t ground = m_planes.size();
        for (std::size_t k = 0; k < m_planes.size(); ++k)
            if (const float d = depthOf(k, ray); d > 0 && d < depth) {
                depth = d;
                ground = k;
            }
        if (ground < m_planes.size()) return groundColour(ground, m_lens.axes().origin + depth * ray, depth, y);
        if (hit.triangle < 0) return background(y);
        return shade(fragment(hit));
    }

  private:
    /// From the upper left, behind the camera.
    static Vec3f lightDirection(const Axes& camera) {
        return (-0.85f * camera.right + Vec3f::UnitY() - 0.35f * camera.forward).normalized();
    }

    void draw(const Surface& surface) {
        for (int t = 0; t < surface.triangles.cols(); ++t) {
            TriangleRef ref{&surface, t, {}};
            bool isVisible = true;
            for (int k = 0; k < 3; ++k) {
                const Vec3f p = surface.positions.col(surface.triangles(k, t));
                isVisible = isVisible && p.allFinite() && m_lens.isInFront(p);
                ref.screen[k] = m_lens.project(p);
            }
            if (!isVisible) continue;
            m_buffer.draw(ref.screen[0], ref.screen[1], ref.screen[2], static_cast<int>(m_triangles.size()));
            m_triangles.push_back(ref);
        }
    }

    float depthOf(std::size_t ground, const Vec3f& ray) const {
        const Vec3f& normal = m_planes[ground].forward;
        const float height = normal.dot(m_lens.axes().origin) - static_cast<float>(m_view.grounds[ground].offset);
        const float along = normal.dot(ray);
        return std::abs(along) > 1e-9f ? -height / along : -1.0f;
    }

    Colour background(int y) const {
        const float s = static_cast<float>(y) / static_cast<float>(m_height);
        return (1 - s) * Colour(0.70f, 0.78f, 0.87f) + s * Colour(0.93f, 0.94f, 0.95f);
    }

    Fragment fragment(const Hit& hit) const {
        const TriangleRef& triangle = m_triangles[hit.triangle];
        const Surface& surface = *triangle.surface;
        const std::array<float, 3> onScreen{1 - hit.b1 - hit.b2, hit.b1, hit.b2};
        std::array<int, 3> corner{};
        Vec3f b;
        for (int k = 0; k < 3; ++k) {
            corner[k] = surface.triangles(k, triangle.index);
            b[k] = onScreen[k] * triangle.screen[k].nearness / hit.nearness;
        }
        Fragment result;
        for (int k = 0; k < 3; ++k) {
            result.position += b[k] * surface.positions.col(corner[k]);
            result.normal += b[k] * surface.normals.col(corner[k]);
        }
        const Vec3f p0 = surface.positions.col(corner[0]), p1 = surface.positions.col(corner[1]),
                    p2 = surface.positions.col(corner[2]);
        const bool seesFront = (p1 - p0).cross(p2 - p0).dot(m_lens.axes().origin - p0) > 0;
        if (!seesFront) result.normal = -result.normal;
        result.normal.normalize();
        result.colour = seesFront ? surface.front : surface.back;
        if (!surface.tints.empty()) result.colour *= surface.tints[triangle.index];
        if (surface.showEdges) result.colour *= edgeTint(triangle, onScreen);
        result.gloss = surface.gloss;
        return result;
    }

    /// Darkens the edges of triangles; less and less where triangles are so small that the lines would fill them.
    static float edgeTint(const TriangleRef& triangle, const std::array<float, 3>& onScreen) {
        constexpr float kHalfWidth = 0.55f * kSamples, kDarkness = 0.42f;
        const float line = std::clamp(kHalfWidth + 0.5f - triangle.edgeDistance(onScreen), 0.0f, 1.0f);
        const float room = std::clamp((triangle.smallestAltitude() / kSamples - 2.0f) / 10.0f, 0.0f, 1.0f);
        return 1.0f - kDarkness * line * room;
    }

    Colour shade(const Fragment& f) const {
        const Vec3f towardsEye = (m_lens.axes().origin - f.position).normalized();
        const float cosine = f.normal.dot(m_towardsLight);
        const float light = cosine > 0 ? m_shadows.light(f.position, f.normal) : 0.0f;
        const float sky = 0.5f + 0.5f * f.normal.y();
        const float brightness = 0.20f + 0.22f * sky + 0.12f * std::max(0.0f, f.normal.dot(towardsEye)) +
                                 0.78f * light * std::max(0.0f, cosine);
        if (f.gloss == 0.0f) return f.colour * brightness;
        const float mirror = std::max(0.0f, f.normal.dot((m_towardsLight + towardsEye).normalized()));
        return f.colour * brightness + Colour::Constant(f.gloss * light * std::pow(mirror, 40.0f));
    }

    /// Edge length of the chequers: a round number of metres.
    static float chequerSize(double sceneRadius) {
        const auto target = static_cast<float>(0.5 * sceneRadius);
        const float decade = std::pow(10.0f, std::floor(std::log10(target)));
        for (const float step : {5.0f, 2.0f})
            if (step * decade <= target) return step * decade;
        return decade;
    }

    /// The fainter the chequers, the smaller they are beside a pixel's footprint on the plane.
    float chequerTint(const Axes& plane, const Vec3f& point, float depth) const {
        constexpr float kContrast = 0.22f;
        const float slant = std::abs(plane.forward.dot((point - m_lens.axes().origin).normalized()));
        const float footprint = depth / m_lens.scale() / std::max(slant, 1e-4f);
        const float strength = std::clamp(1.5f - 3.0f * footprint / m_chequer, 0.0f, 1.0f);
        const float cells =
            std::floor(plane.right.dot(point) / m_chequer) + std::floor(plane.up.dot(point) / m_chequer);
        const bool isDark = std::fmod(std::abs(cells), 2.0f) > 0.5f;
        const float even = 1.0f - 0.5f * kContrast;
        return even + strength * kContrast * (isDark ? -0.5f : 0.5f);
    }

    Colour groundColour(std::size_t index, const Vec3f& point, float depth, int y) const {
        const Axes& plane = m_planes[index];
        const float height = plane.forward.dot(m_lens.axes().origin - point);
        const Fragment f{.position = point,
                         .normal = height > 0 ? plane.forward : Vec3f(-plane.forward),
                         .colour = m_view.grounds[index].colour * chequerTint(plane, point, depth)};
        const auto reach = static_cast<float>(m_view.sceneRadius);
        const float away = (point - m_view.camera.target.cast<float>()).norm() / reach;
        const float fade = std::clamp((away - 2.5f) / 5.0f, 0.0f, 1.0f);
        if (fade == 1.0f) return background(y);
        return (1 - fade) * shade(f) + fade * background(y);
    }

    const View& m_view;
    int m_width, m_height;
    Lens m_lens;
    DepthBuffer m_buffer;
    Vec3f m_towardsLight;
    ShadowMap m_shadows;
    float m_chequer;             ///< edge length of the ground's chequers [m]
    std::vector<Axes> m_planes;  ///< of the grounds; forward is the normal
    std::vector<TriangleRef> m_triangles;
};

/// Linear light to a byte of a picture.
std::uint8_t toByte(float linear) {
    constexpr int kEntries = 4096;
    static const auto table = [] {
        std::array<std::uint8_t, kEntries> bytes{};
        for (int i = 0; i < kEntries; ++i)
            bytes[i] = static_cast<std::uint8_t>(std::lround(255.0f * toSrgb(static_cast<float>(i) / (kEntries - 1))));
        return bytes;
    }();
    return table[static_cast<std::size_t>(std::lround(std::clamp(linear, 0.0f, 1.0f) * (kEntries - 1)))];
}

}  // namespace

Colour colourFromHex(unsigned rgb) {
    const auto channel = [&](int shift) { return toLinear(static_cast<float>((rgb >> shift) & 0xffu) / 255.0f); };
    return {channel(16), channel(8), channel(0)};
}

Image render(const View& view, int width, int height) {
    const Painter painter(view, width, height);
    Image image{width, height, {}};
    image.rgb.reserve(3 * static_cast<std::size_t>(width) * height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            Colour sum = Colour::Zero();
            for (int s = 0; s < kSamples * kSamples; ++s)
                sum += painter.colourAt(kSamples * x + s % kSamples, kSamples * y + s / kSamples).cwiseMin(1.0f);
            for (const float channel : sum) image.rgb.push_back(toByte(channel / (kSamples * kSamples)));
        }
    return image;
}

namespace {

/// Distance at which all points fit into the view of a camera on that axis.
float fittingDistance(const Eigen::Matrix3Xf& points, const Axes& axes, const Vec2f& tangents) {
    float distance = 1e-3f;
    for (const auto& point : points.colwise()) {
        const Vec3f q = axes.local(point);
        distance = std::max({distance, std::abs(q.x()) / tangents.x() - q.z(), std::abs(q.y()) / tangents.y() - q.z()});
    }
    return distance;
}

Vec2f tangents(double fovDegrees, double aspect) {
    constexpr double kBorder = 0.90;  // of the picture is filled
    const auto tangent = static_cast<float>(kBorder * std::tan(fovDegrees * std::numbers::pi / 360.0));
    return {tangent * static_cast<float>(aspect), tangent};
}

}  // namespace

Camera frameFrom(const Eigen::Matrix3Xf& points, const Vec3& target, const Vec3& towardsEye, double fovDegrees,
                 double aspect) {
    const Axes axes(target.cast<float>(), -towardsEye.cast<float>());
    const float distance = fittingDistance(points, axes, tangents(fovDegrees, aspect));
    return {target - distance * axes.forward.cast<double>(), target, fovDegrees};
}

Camera frameAll(const Eigen::Matrix3Xf& points, const Vec3& towardsEye, double fovDegrees, double aspect) {
    if (points.cols() == 0) return {towardsEye, Vec3::Zero(), fovDegrees};
    Vec3 target = (0.5f * (points.rowwise().minCoeff() + points.rowwise().maxCoeff())).cast<double>();
    for (int round = 0; round < 4; ++round) {  // centres what is seen, which perspective shifts
        const Camera camera = frameFrom(points, target, towardsEye, fovDegrees, aspect);
        const Axes axes(camera.eye.cast<float>(), (camera.target - camera.eye).cast<float>());
        Vec2f low = Vec2f::Constant(std::numeric_limits<float>::max()), high = -low;
        for (const auto& point : points.colwise()) {
            const Vec3f q = axes.local(point);
            low = low.cwiseMin(q.head<2>() / q.z());
            high = high.cwiseMax(q.head<2>() / q.z());
        }
        const Vec2f shift = 0.5f * (low + high) * static_cast<float>((camera.target - camera.eye).norm());
        target += (shift.x() * axes.right + shift.y() * axes.up).cast<double>();
    }
    return frameFrom(points, target, towardsEye, fovDegrees, aspect);
}

}  // namespace jacket::demo
