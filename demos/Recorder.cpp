#include "Recorder.h"

#include <unistd.h>

#include <cstdio>
#include <stdexcept>

namespace jacket::demo {

namespace fs = std::filesystem;

namespace {

fs::path normalised(const fs::path& place) {
    fs::path path = fs::absolute(place).lexically_normal();
    if (!path.has_filename()) path = path.parent_path();
    return path;
}

fs::path sibling(const fs::path& place, const std::string& what) {
    fs::path name = ".";
    name += place.filename();
    name += "." + what + "-" + std::to_string(getpid());
    return place.parent_path() / name;
}

}  // namespace

void OutputDirectory::requireFree(const fs::path& place, const std::string& marker) {
    const fs::path path = normalised(place);
    if (path == path.root_path()) throw InputError("--out " + place.string() + ": is no place for results");
    if (!fs::exists(fs::symlink_status(path))) return;
    if (!fs::is_directory(path))
        throw InputError("--out " + place.string() + ": is there already and is not a directory");
    if (!fs::is_empty(path) && !fs::exists(path / marker))
        throw InputError("--out " + place.string() + ": is there already and holds no " + marker +
                         "; only an earlier result is replaced");
}

OutputDirectory::OutputDirectory(const fs::path& place, const std::string& marker)
    : m_place(normalised(place)), m_folder(sibling(m_place, "partial")) {
    requireFree(place, marker);
    std::error_code error;
    fs::remove_all(m_folder, error);
    if (!fs::create_directories(m_folder, error))
        throw InputError("--out " + place.string() + ": cannot be made: " + error.message());
}

OutputDirectory::~OutputDirectory() {
    std::error_code ignored;
    if (!m_committed) fs::remove_all(m_folder, ignored);
}

void OutputDirectory::commit() {
    const fs::path old = sibling(m_place, "old");
    const bool replaces = fs::exists(m_place);
    if (replaces) fs::rename(m_place, old);
    std::error_code error;
    fs::rename(m_folder, m_place, error);
    if (error) {
        if (replaces) fs::rename(old, m_place);
        throw std::runtime_error(m_place.string() + ": cannot be put in place: " + error.message());
    }
    m_committed = true;
    fs::remove_all(old, error);
}

namespace {

void writeObj(const fs::path& path, const Shell& shell) {
    std::string text = "# " + std::to_string(shell.vertexCount()) + " vertices [m], " +
                       std::to_string(shell.mesh().triangleCount()) + " triangles, at the start of the run\n";
    char line[96];
    for (const auto& x : shell.positions().colwise()) {
        std::snprintf(line, sizeof line, "v %.9g %.9g %.9g\n", x.x(), x.y(), x.z());
        text += line;
    }
    for (const auto& corners : shell.mesh().triangles().colwise()) {
        std::snprintf(line, sizeof line, "f %d %d %d\n", corners[0] + 1, corners[1] + 1, corners[2] + 1);
        text += line;
    }
    writeText(path, text);
}

constexpr const char* kLogHeader =
    "frame,time_s,kinetic_J,membrane_J,bending_J,plastic_work_J,potential_J,total_J,momentum_x_Ns,momentum_y_Ns,"
    "momentum_z_Ns,"
    "contacts,pcg_iterations,solves,max_stretch,penetration_m,ms\n";

std::string logLine(const FrameRecord& r) {
    char line[512];
    std::snprintf(line, sizeof line,
                  "%d,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.12g,%.12g,%.12g,%d,%d,%d,%.6g,%.6g,%.4g\n", r.frame, r.time,
                  r.energy.kinetic, r.energy.membrane, r.energy.bending, r.energy.plasticWork, r.energy.potential,
                  r.energy.total(), r.momentum.x(), r.momentum.y(), r.momentum.z(), r.report.contacts,
                  r.report.pcgIterations, r.report.solves, r.maxStretch, r.penetration.depth, 1e3 * r.report.seconds);
    return line;
}

}  // namespace

void writeText(const fs::path& file, const std::string& text) {
    std::ofstream out(file, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw std::runtime_error(file.string() + ": cannot be written");
}

Recorder::Recorder(const fs::path& folder, const World& start)
    : m_folder(folder), m_log(folder / "log.csv", std::ios::binary) {
    writeText(folder / "scene.json", toJson(start.scene()).dump(2) + "\n");
    m_log << kLogHeader;
    for (int k = 0; k < start.shellCount(); ++k) {
        const std::string name = "mesh_" + std::to_string(k);
        writeObj(folder / (name + ".obj"), start.shell(k));
        m_caches.emplace_back(folder / (name + ".pc2"), start.shell(k).vertexCount());
        m_caches.back().add(start.shell(k).positions());
    }
}

void Recorder::add(const FrameRecord& frame, const World& world) {
    m_log << logLine(frame);
    for (int k = 0; k < world.shellCount(); ++k) m_caches[k].add(world.shell(k).positions());
}

void Recorder::finish(const Json& result) {
    for (PointCacheWriter& cache : m_caches) cache.finish();
    m_log.close();
    if (!m_log) throw std::runtime_error((m_folder / "log.csv").string() + ": cannot be written");
    writeText(m_folder / "result.json", result.dump(2) + "\n");
}

}  // namespace jacket::demo
