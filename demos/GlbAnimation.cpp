#include "GlbAnimation.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "GltfFile.h"

namespace jacket::demo {

namespace {

constexpr double kMomentsPerSecond = 30.0;
constexpr double kMostBytes = 32e6;       ///< of morph targets
constexpr double kBytesPerVertex = 24.0;  ///< of one target: position and normal
constexpr double kMostTargets = 240.0;    ///< WebGL 2 promises 256 layers of a texture, three.js uses one per target
constexpr double kFarthest = 1e9;         ///< [m]
constexpr double kGroundReach = 2.0;      ///< of a plane, around what is to be seen, in the scene's radii
constexpr int kChequers = 16;             ///< of a plane, along each side
constexpr float kChequerTint = 0.88f;

/// Frames from one kept moment to the next.
int strideFor(const World& start) {
    double perMoment = 0.0;
    for (int k = 0; k < start.shellCount(); ++k) perMoment += kBytesPerVertex * start.shell(k).vertexCount();
    const double most = std::clamp(std::floor(kMostBytes / std::max(perMoment, 1.0)), 1.0, kMostTargets);
    const double fewest = std::ceil(start.scene().frames() / most);
    return std::max(1, static_cast<int>(std::max(fewest, std::round(1.0 / (kMomentsPerSecond * start.scene().dt)))));
}

/// A run that failed ends with numbers that are none, which glTF does not know, or far beyond what one can look at.
bool canBeShown(const World& world) {
    bool isNear = true;
    for (int k = 0; k < world.shellCount(); ++k) isNear = isNear && world.shell(k).positions().norm() < kFarthest;
    for (const BodyState& body : world.bodies())
        isNear = isNear && body.position.norm() < kFarthest && body.rotation.allFinite();
    return isNear;
}

/// Of unit length also where triangles without area left none.
Eigen::Matrix3Xf unitNormals(Eigen::Matrix3Xf normals) {
    for (auto n : normals.colwise())
        if (!(std::abs(n.norm() - 1.0f) < 1e-3f)) n = Eigen::Vector3f::UnitY();
    return normals;
}

/// Both sides of a triangle are of one material in glTF: the front's.
int addMaterial(GltfFile& file, const std::string& name, const Colour& colour) {
    return file.add("materials", {{"name", name},
                                  {"pbrMetallicRoughness",
                                   {{"baseColorFactor", {colour.x(), colour.y(), colour.z(), 1.0}},
                                    {"metallicFactor", 0.0},
                                    {"roughnessFactor", 0.7}}},
                                  {"doubleSided", true}});
}

/// The surface as a mesh, with a primitive for the triangles of each tint.
Json meshOf(GltfFile& file, const std::string& name, const Surface& surface) {
    const Json attributes{{"POSITION", file.addVertices(surface.positions)},
                          {"NORMAL", file.addVertices(unitNormals(surface.normals))}};
    std::map<float, std::vector<Eigen::Index>> trianglesOfTint;
    for (Eigen::Index t = 0; t < surface.triangles.cols(); ++t)
        trianglesOfTint[surface.tints.empty() ? 1.0f : surface.tints[t]].push_back(t);
    Json primitives = Json::array();
    for (const auto& [tint, which] : trianglesOfTint)
        primitives.push_back({{"attributes", attributes},
                              {"indices", file.addIndices(surface.triangles(Eigen::all, which))},
                              {"material", addMaterial(file, name, tint * surface.front)}});
    return {{"name", name}, {"primitives", primitives}};
}

/// A square of an endless plane around what is to be seen, in the frame of the body that the plane belongs to.
Surface squareOf(const Ground& ground, const View& stage, const BodyState& body) {
    const double side = 2 * kGroundReach * stage.sceneRadius;
    const TriangleMesh grid = makeGrid({.size = {side, side}, .cells = {kChequers, kChequers}});
    const Vec3 centre = stage.camera.target + (ground.offset - ground.normal.dot(stage.camera.target)) * ground.normal;
    const Mat3 upright = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitY(), ground.normal).toRotationMatrix();
    const Points world = (upright * grid.positions).colwise() + centre;
    Surface surface;
    surface.positions = (body.rotation.transpose() * (world.colwise() - body.position)).cast<float>();
    const Vec3 normal = body.rotation.transpose() * ground.normal;
    surface.normals = normal.cast<float>().replicate(1, world.cols());
    surface.triangles = grid.triangles;
    for (int t = 0; t < grid.triangles.cols(); ++t) {
        const int cell = t / 2;
        surface.tints.push_back((cell / kChequers + cell % kChequers) % 2 == 0 ? 1.0f : kChequerTint);
    }
    surface.front = ground.colour;
    return surface;
}

/// What a shell's mesh is at the start, and how it differs at every later moment.
struct ShellMesh {
    Surface start;
    Json mesh;
    Json targets = Json::array();

    void addTarget(GltfFile& file, const Surface& later) {
        targets.push_back({{"POSITION", file.addVertices(later.positions - start.positions)},
                           {"NORMAL", file.addVertices(unitNormals(later.normals) - unitNormals(start.normals))}});
    }
    int addTo(GltfFile& file) {
        if (!targets.empty()) mesh["primitives"][0]["targets"] = targets;
        return file.add("meshes", mesh);
    }
};

/// At the start no target counts, at each later moment only its own, so that between them vertices go straight.
Eigen::RowVectorXf weights(int moments) {
    const int targets = moments - 1;
    Eigen::MatrixXf weights = Eigen::MatrixXf::Zero(targets, moments);
    weights.rightCols(targets).setIdentity();
    return weights.reshaped().transpose();
}

/// Where a body is, a column for each moment.
struct Poses {
    Eigen::Matrix3Xf positions;
    Eigen::Matrix4Xf rotations;  ///< quaternions x y z w
};

/// Of q and -q, which are the same rotation, the one nearer to the moment before: viewers interpolate the numbers.
Poses posesOf(const std::vector<Pictures::Moment>& moments, std::size_t body) {
    const auto count = static_cast<Eigen::Index>(moments.size());
    Poses poses{Eigen::Matrix3Xf(3, count), Eigen::Matrix4Xf(4, count)};
    Eigen::Vector4d last = Eigen::Vector4d::Zero();
    for (Eigen::Index i = 0; i < count; ++i) {
        const BodyState& state = moments[i].bodies[body];
        const Eigen::Vector4d q = Eigen::Quaterniond(state.rotation).normalized().coeffs();
        last = q.dot(last) < 0 ? Eigen::Vector4d(-q) : q;
        poses.positions.col(i) = state.position.cast<float>();
        poses.rotations.col(i) = last.cast<float>();
    }
    return poses;
}

/// How the nodes move, all at the same times.
class Motion {
  public:
    Motion(GltfFile& file, const Eigen::RowVectorXf& times) : m_file(file) {
        if (times.size() > 1) m_times = file.addKeys(times);
    }

    void animate(int node, const char* path, int values) {
        m_samplers.push_back({{"input", m_times}, {"interpolation", "LINEAR"}, {"output", values}});
        m_channels.push_back({{"sampler", m_samplers.size() - 1}, {"target", {{"node", node}, {"path", path}}}});
    }
    /// By these values, a column for each time; not at all where they never change.
    void animateIfMoved(int node, const char* path, const Eigen::MatrixXf& values) {
        const bool isMoved = ((values.colwise() - values.col(0)).array() != 0).any();
        if (isMoved) animate(node, path, m_file.addKeys(values));
    }
    void finish() {
        if (!m_channels.empty()) m_file.add("animations", {{"channels", m_channels}, {"samplers", m_samplers}});
    }

  private:
    GltfFile& m_file;
    int m_times = -1;
    Json m_channels = Json::array(), m_samplers = Json::array();
};

Json listOf(const Eigen::VectorXf& values) {
    return std::vector<float>(values.begin(), values.end());
}

void addShells(GltfFile& file, Motion& motion, const Pictures& pictures, const std::vector<std::string>& names) {
    const View start = pictures.view(0, {});  // its first surfaces are the shells
    std::vector<ShellMesh> shells;
    for (std::size_t k = 0; k < names.size(); ++k)
        shells.push_back({start.surfaces[k], meshOf(file, names[k], start.surfaces[k])});
    for (int i = 1; i < pictures.count(); ++i) {
        const View view = pictures.view(i, {});
        for (std::size_t k = 0; k < names.size(); ++k) shells[k].addTarget(file, view.surfaces[k]);
    }
    const bool isMoving = pictures.count() > 1;
    const int values = isMoving ? file.addKeys(weights(pictures.count())) : -1;
    for (std::size_t k = 0; k < names.size(); ++k) {
        const int node = file.add("nodes", {{"name", names[k]}, {"mesh", shells[k].addTo(file)}});
        if (isMoving) motion.animate(node, "weights", values);
    }
}

void addBodies(GltfFile& file, Motion& motion, const Pictures& pictures, const std::vector<std::string>& names) {
    const View stage = pictures.stage(1.0), start = pictures.view(0, stage);
    std::size_t ground = 0;
    for (std::size_t k = 0; k < names.size(); ++k) {
        const Poses poses = posesOf(pictures.moments(), k);
        const Surface& surface = pictures.bodySurfaces()[k];
        const bool isPlane = surface.triangles.cols() == 0;
        const Json mesh =
            meshOf(file, names[k],
                   isPlane ? squareOf(start.grounds[ground++], stage, pictures.moments().front().bodies[k]) : surface);
        const int node = file.add("nodes", {{"name", names[k]},
                                            {"mesh", file.add("meshes", mesh)},
                                            {"translation", listOf(poses.positions.col(0))},
                                            {"rotation", listOf(poses.rotations.col(0))}});
        motion.animateIfMoved(node, "translation", poses.positions);
        motion.animateIfMoved(node, "rotation", poses.rotations);
    }
}

}  // namespace

GlbAnimation::GlbAnimation(const World& start)
    : m_title(start.scene().name),
      m_dt(start.scene().dt),
      m_frames(start.scene().frames()),
      m_pictures(start, strideFor(start)) {
    for (const ShellDescription& shell : start.scene().shells) m_shellNames.push_back(shell.name);
    for (const BodyDescription& body : start.scene().bodies) m_bodyNames.push_back(body.name);
}

void GlbAnimation::add(const World& world, int frame) {
    if (!canBeShown(world)) return;
    if (frame == m_frames)
        m_pictures.keep(world, frame);
    else
        m_pictures.add(world, frame);
}

std::string GlbAnimation::glb() const {
    Eigen::RowVectorXf times(momentCount());
    for (int i = 0; i < momentCount(); ++i) times[i] = static_cast<float>(m_dt * m_pictures.moments()[i].frame);
    GltfFile file;
    Motion motion(file, times);
    addShells(file, motion, m_pictures, m_shellNames);
    addBodies(file, motion, m_pictures, m_bodyNames);
    motion.finish();
    return file.bytes("Jacket " JACKET_VERSION, m_title);
}

}  // namespace jacket::demo
