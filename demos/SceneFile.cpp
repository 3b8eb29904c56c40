#include "SceneFile.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#ifndef JACKET_SCENE_DIR
#define JACKET_SCENE_DIR ""
#endif

namespace jacket::demo {

namespace fs = std::filesystem;

namespace {

/// Where `cmake --install` puts the scenes, seen from the program; else the source tree.
std::vector<fs::path> sceneFolders() {
    std::vector<fs::path> folders;
    std::error_code error;
    const fs::path program = fs::read_symlink("/proc/self/exe", error);
    if (!error) folders.push_back(program.parent_path().parent_path() / "share" / "jacket" / "scenes");
    folders.emplace_back(JACKET_SCENE_DIR);
    return folders;
}

}  // namespace

std::string readText(const fs::path& file) {
    std::error_code error;
    if (!fs::exists(file, error)) throw InputError(file.string() + ": there is no such file");
    if (!fs::is_regular_file(file, error)) throw InputError(file.string() + ": is not a file");
    std::ifstream in(file, std::ios::binary);
    if (!in) throw InputError(file.string() + ": cannot be read");
    return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<fs::path> bundledScenes() {
    std::vector<fs::path> scenes;
    for (const fs::path& folder : sceneFolders()) {
        std::error_code error;
        for (const auto& entry : fs::directory_iterator(folder, error))
            if (entry.path().extension() == ".json") scenes.push_back(entry.path());
        if (!scenes.empty()) break;
    }
    std::sort(scenes.begin(), scenes.end());
    return scenes;
}

fs::path findScene(const std::string& nameOrFile) {
    if (nameOrFile.ends_with(".json") || nameOrFile.find('/') != std::string::npos) return nameOrFile;
    std::vector<std::string> names;
    for (const fs::path& file : bundledScenes()) {
        names.push_back(file.stem().string());
        if (names.back() == nameOrFile) return file;
    }
    throw InputError("there is no scene \"" + nameOrFile + "\"" + suggestion(nameOrFile, names) +
                     ". A scene file must end in .json");
}

Scene loadScene(const fs::path& file, const SceneChanges& changes) {
    SceneOrigin origin{.source = {.file = file.string(), .overrides = changes.set}, .folder = file.parent_path()};
    Json document = parseJson(readText(file), file.string());
    for (const std::string& change : changes.set) applyOverride(document, change);
    if (document.is_object()) {
        if (changes.dt) document["dt"] = *changes.dt;
        if (changes.seconds) document["seconds"] = *changes.seconds;
        if (changes.seed) document["seed"] = *changes.seed;
    }
    return readScene(document, origin);
}

std::string sceneDescription(const fs::path& file) {
    const Json document = parseJson(readText(file), file.string());
    return document.is_object() ? document.value("description", "") : "";
}

}  // namespace jacket::demo
