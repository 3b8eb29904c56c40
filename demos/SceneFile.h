#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "Scene.h"

/// Finding scene files and reading them with the changes of the command line.
namespace jacket::demo {

/// Bundled scenes by name, sorted. Looked for beside the installed program and in the source tree.
std::vector<std::filesystem::path> bundledScenes();

/// A bundled scene's file by its name, or the file itself when the argument ends in ".json". Throws InputError.
std::filesystem::path findScene(const std::string& nameOrFile);

/// What the command line changes in a scene.
struct SceneChanges {
    std::vector<std::string> set;  ///< "path=value"
    std::optional<double> dt, seconds;
    std::optional<int> seed;
};

Scene loadScene(const std::filesystem::path& file, const SceneChanges& changes = {});

/// The whole of a file; throws InputError.
std::string readText(const std::filesystem::path& file);

/// Its "description", also when the rest of the scene cannot be read; "" without one.
std::string sceneDescription(const std::filesystem::path& file);

}  // namespace jacket::demo
