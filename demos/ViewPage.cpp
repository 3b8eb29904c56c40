#include "ViewPage.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>

#include "ViewTemplate.h"
#include "report/Svg.h"

namespace jacket::demo {

namespace {

constexpr double kMostBytes = 16e6;  ///< of positions, before they are written as text

/// Every frame, or fewer of a long run of a fine mesh.
int strideFor(const World& start) {
    double perFrame = 0.0;
    for (int k = 0; k < start.shellCount(); ++k) perFrame += 6.0 * start.shell(k).vertexCount();
    return std::max(1, static_cast<int>(std::ceil(perFrame * start.scene().frames() / kMostBytes)));
}

std::string base64(std::span<const std::uint8_t> bytes) {
    constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string text;
    text.reserve(4 * ((bytes.size() + 2) / 3));
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const auto at = [&](std::size_t k) { return i + k < bytes.size() ? unsigned(bytes[i + k]) : 0u; };
        const unsigned three = at(0) << 16 | at(1) << 8 | at(2);
        for (std::size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : kDigits[(three >> (18 - 6 * k)) & 63];
    }
    return text;
}

/// Little endian, as the processors that this is built for are and as the page reads it.
template <class Number>
std::string packed(const std::vector<Number>& numbers) {
    std::vector<std::uint8_t> bytes(numbers.size() * sizeof(Number));
    if (!bytes.empty()) std::memcpy(bytes.data(), numbers.data(), bytes.size());
    return base64(bytes);
}

std::string packed(const Eigen::Matrix3Xf& x) {
    return packed(std::vector<float>(x.data(), x.data() + x.size()));
}

std::string packed(const Indices<3>& triangles) {
    return packed(std::vector<std::uint32_t>(triangles.data(), triangles.data() + triangles.size()));
}

Json listOf(const Eigen::Vector3f& v) {
    return {v.x(), v.y(), v.z()};
}

/// Positions of a shell at all moments as 16-bit numbers between the corners of a box that holds them.
Json motionOf(const std::vector<Pictures::Moment>& moments, std::size_t shell) {
    Eigen::Vector3f low = Eigen::Vector3f::Constant(1e30f), high = -low;
    for (const auto& moment : moments)
        for (const auto& p : moment.shells[shell].colwise())
            if (p.allFinite()) {
                low = low.cwiseMin(p);
                high = high.cwiseMax(p);
            }
    const Eigen::Vector3f step = ((high - low) / 65535.0f).cwiseMax(1e-12f);
    std::vector<std::uint16_t> numbers;
    for (const auto& moment : moments)
        for (const auto& p : moment.shells[shell].colwise())
            for (int k = 0; k < 3; ++k) {
                const float at = std::isfinite(p[k]) ? (p[k] - low[k]) / step[k] : 0.0f;
                numbers.push_back(static_cast<std::uint16_t>(std::clamp(std::lround(at), 0l, 65535l)));
            }
    return {{"low", listOf(low)}, {"step", listOf(step)}, {"positions", packed(numbers)}};
}

/// Position and quaternion (x y z w) at all moments.
std::string posesOf(const std::vector<Pictures::Moment>& moments, std::size_t body) {
    std::vector<float> numbers;
    for (const auto& moment : moments) {
        const BodyState& state = moment.bodies[body];
        const Eigen::Quaternionf q(state.rotation.cast<float>());
        for (int k = 0; k < 3; ++k) numbers.push_back(static_cast<float>(state.position[k]));
        for (const float part : {q.x(), q.y(), q.z(), q.w()}) numbers.push_back(part);
    }
    return packed(numbers);
}

/// One brightness for each triangle.
std::string tintsOf(const Surface& surface) {
    std::vector<float> tints = surface.tints;
    tints.resize(static_cast<std::size_t>(surface.triangles.cols()), 1.0f);
    return packed(tints);
}

void replace(std::string& text, const std::string& what, const std::string& by) {
    if (const auto at = text.find(what); at != std::string::npos) text.replace(at, what.size(), by);
}

}  // namespace

ViewPage::ViewPage(const World& start)
    : m_title(start.scene().name), m_dt(start.scene().dt), m_pictures(start, strideFor(start)) {}

std::string ViewPage::html() const {
    const auto& moments = m_pictures.moments();
    const View stage = m_pictures.stage(4.0 / 3.0), view = m_pictures.view(0, stage);
    Json scene{{"eye", toJson(stage.camera.eye)},
               {"target", toJson(stage.camera.target)},
               {"fov", stage.camera.fovDegrees},
               {"radius", stage.sceneRadius}};
    scene["times"] = Json::array();
    for (const auto& moment : moments) scene["times"].push_back(std::round(1e6 * m_dt * moment.frame) / 1e6);
    scene["shells"] = Json::array();
    for (std::size_t k = 0; k < moments.front().shells.size(); ++k) {  // the view's first surfaces
        const Surface& surface = view.surfaces[k];
        Json shell = motionOf(moments, k);
        shell["triangles"] = packed(surface.triangles);
        shell["front"] = listOf(surface.front);
        shell["back"] = listOf(surface.back);
        scene["shells"].push_back(shell);
    }
    scene["bodies"] = Json::array();
    for (std::size_t k = 0; k < m_pictures.bodySurfaces().size(); ++k) {
        const Surface& surface = m_pictures.bodySurfaces()[k];
        if (surface.triangles.cols() == 0) continue;  // a plane
        scene["bodies"].push_back({{"positions", packed(surface.positions)},
                                   {"normals", packed(surface.normals)},
                                   {"triangles", packed(surface.triangles)},
                                   {"tints", tintsOf(surface)},
                                   {"colour", listOf(surface.front)},
                                   {"poses", posesOf(moments, k)}});
    }
    scene["grounds"] = Json::array();
    for (const Ground& ground : view.grounds)
        scene["grounds"].push_back(
            {{"normal", toJson(ground.normal)}, {"offset", ground.offset}, {"colour", listOf(ground.colour)}});
    std::string page = kViewTemplate;
    replace(page, "@TITLE@", report::escaped(m_title));
    replace(page, "@TITLE@", report::escaped(m_title));
    replace(page, "@SCENE@", scene.dump());
    return page;
}

}  // namespace jacket::demo
