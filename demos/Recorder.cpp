#include "Recorder.h"

#include <unistd.h>

#include <cstdio>
#include <regex>
#include <stdexcept>

namespace jacket::demo {

namespace fs = std::filesystem;

namespace {

fs::path resolved(const fs::path& place) {
    std::error_code error;
    fs::path path = fs::weakly_canonical(fs::absolute(place), error);
    if (error) throw InputError(place.string() + ": cannot be reached: " + error.message());
    if (!path.has_filename()) path = path.parent_path();
    return path;
}

/// An entry that is not among the command's own files; "" if there is none. Links are never its own.
std::string foreignEntry(const fs::path& folder, const OutputKind& kind) {
    const std::regex own(kind.paths);
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
        const std::string name = entry.path().lexically_relative(folder).generic_string();
        if (entry.is_symlink() || !std::regex_match(name, own)) return name;
    }
    return "";
}

fs::path sibling(const fs::path& place, const std::string& what) {
    fs::path name = ".";
    name += place.filename();
    name += "." + what + "-" + std::to_string(getpid());
    return place.parent_path() / name;
}

}  // namespace

void OutputDirectory::requireFree(const fs::path& place, const OutputKind& kind) {
    const fs::path path = resolved(place);
    if (path == path.root_path()) throw InputError(place.string() + ": is no place for results");
    if (!fs::exists(fs::symlink_status(path))) return;
    if (!fs::is_directory(path)) throw InputError(place.string() + ": is there already and is not a directory");
    if (fs::is_empty(path)) return;
    if (!fs::exists(path / kind.marker))
        throw InputError(place.string() + ": is there already and holds no " + kind.marker +
                         "; only an earlier result is replaced");
    if (const std::string foreign = foreignEntry(path, kind); !foreign.empty())
        throw InputError(
            place.string() + ": holds " + foreign +
            ", which is no part of an earlier result and would be lost; move it, or give another directory");
}

OutputDirectory::OutputDirectory(const fs::path& place, const OutputKind& kind)
    : m_kind(kind), m_place(resolved(place)), m_folder(sibling(m_place, "partial")) {
    requireFree(place, kind);
    makeFolder(place);
}

void OutputDirectory::makeFolder(const fs::path& asGiven) {
    std::error_code error;
    fs::remove_all(m_folder, error);
    for (fs::path parent = m_folder.parent_path(); !fs::exists(parent); parent = parent.parent_path())
        m_madeParents.push_back(parent);
    if (!fs::create_directories(m_folder, error))
        throw InputError(asGiven.string() + ": cannot be made: " + error.message());
}

OutputDirectory::~OutputDirectory() {
    if (m_isKept) return;
    std::error_code ignored;
    fs::remove_all(m_folder, ignored);
    for (const fs::path& parent : m_madeParents) fs::remove(parent, ignored);  // unless something is in there by now
}

void OutputDirectory::commit() {
    m_isKept = true;  // whatever happens from here on: a long run is not to be lost
    try {
        requireFree(m_place, m_kind);
    } catch (const InputError& error) {  // somebody put it there meanwhile
        throw std::runtime_error(std::string(error.what()) + ". The new result is in " + m_folder.string());
    }
    const fs::path old = sibling(m_place, "old");
    const bool replaces = fs::exists(m_place);
    std::error_code error;
    if (replaces) fs::rename(m_place, old, error);
    if (!error) fs::rename(m_folder, m_place, error);
    if (error) {
        std::error_code ignored;
        if (fs::exists(old)) fs::rename(old, m_place, ignored);
        throw std::runtime_error(m_place.string() + ": cannot be put in place: " + error.message() +
                                 ". The new result is in " + m_folder.string());
    }
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
