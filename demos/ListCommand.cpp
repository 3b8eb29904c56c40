#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>

#include "Commands.h"
#include "SceneFile.h"

namespace jacket::demo {

namespace {

struct Entry {
    std::filesystem::path file;
    std::string description;
    std::string whyNot;  ///< why it cannot be run; "" when it can
};

std::string oneLine(std::string text) {
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
}

/// "plasticity is not available yet" of "FILE: PATH: plasticity is not available yet".
std::string lastPart(const std::string& message) {
    const std::size_t colon = message.rfind(": ");
    return colon == std::string::npos ? message : message.substr(colon + 2);
}

/// A scene that needs what is not there yet still has a name and a description.
Entry inspect(const std::filesystem::path& file) {
    try {
        return {file, oneLine(loadScene(file).description), ""};
    } catch (const NotAvailable& error) {
        return {file, oneLine(sceneDescription(file)), oneLine(error.what())};
    } catch (const InputError& error) {
        return {file, "", oneLine(error.what())};
    }
}

void printTable(const std::vector<Entry>& entries) {
    std::size_t width = 0;
    for (const Entry& entry : entries) width = std::max(width, entry.file.stem().string().size());
    for (const Entry& entry : entries) {
        const std::string name = entry.file.stem().string();
        std::cout << name << std::string(width + 2 - name.size(), ' ') << entry.description
                  << (entry.whyNot.empty() ? "" : "  [" + lastPart(entry.whyNot) + "]") << '\n';
    }
}

void printJson(const std::vector<Entry>& entries) {
    Json list = Json::array();
    for (const Entry& entry : entries) {
        list.push_back({{"name", entry.file.stem().string()},
                        {"description", entry.description},
                        {"file", entry.file.string()},
                        {"available", entry.whyNot.empty()}});
        if (!entry.whyNot.empty()) list.back()["reason"] = entry.whyNot;
    }
    std::cout << list.dump(2) << '\n';
}

}  // namespace

void addListCommand(CLI::App& app, int&) {
    CLI::App* command = app.add_subcommand("list", "Scenes, one line each");
    auto asJson = std::make_shared<bool>(false);
    command->add_flag("--json", *asJson, "As a JSON list with name, description, file and whether it can be run");
    command->callback([asJson] {
        std::vector<Entry> entries;
        for (const auto& file : bundledScenes()) entries.push_back(inspect(file));
        *asJson ? printJson(entries) : printTable(entries);
    });
}

}  // namespace jacket::demo
