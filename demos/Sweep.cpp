#include "Sweep.h"

#include <algorithm>
#include <map>
#include <utility>

#include "Recorder.h"
#include "SceneFile.h"

namespace jacket::demo {

namespace fs = std::filesystem;

namespace {

constexpr int kMostCases = 1000000;
constexpr const char* kPlanFile = "plan.json";

Json toJson(const SweepPlan& plan) {
    Json json{{"scene", plan.scene}, {"axes", Json::array()}};
    for (const SweepAxis& axis : plan.axes) json["axes"].push_back({{"path", axis.path}, {"values", axis.values}});
    return json;
}

/// In the order in which they were first seen.
class Columns {
  public:
    void set(const std::string& name, const std::string& value) {
        if (m_row.emplace(name, value).second && std::find(m_names.begin(), m_names.end(), name) == m_names.end())
            m_names.push_back(name);
    }
    void endRow() { m_rows.push_back(std::exchange(m_row, {})); }
    std::string csv() const {
        std::string text;
        for (const std::string& name : m_names) text += (text.empty() ? "" : ",") + quoted(name);
        text += '\n';
        for (const auto& row : m_rows) {
            for (const std::string& name : m_names) {
                if (&name != &m_names.front()) text += ',';
                if (const auto found = row.find(name); found != row.end()) text += quoted(found->second);
            }
            text += '\n';
        }
        return text;
    }

  private:
    static std::string quoted(const std::string& field) {
        if (field.find_first_of(",\"\n") == std::string::npos) return field;
        std::string text = "\"";
        for (const char c : field) text += c == '"' ? "\"\"" : std::string(1, c);
        return text + '"';
    }
    std::vector<std::string> m_names;
    std::map<std::string, std::string> m_row;
    std::vector<std::map<std::string, std::string>> m_rows;
};

/// Numbers and words with the names of the keys above them; lists of numbers by index, lists of objects by their
/// "name".
void flatten(const std::string& name, const Json& value, Columns& columns) {
    const std::string prefix = name.empty() ? "" : name + ".";
    if (value.is_object()) {
        for (const auto& [key, entry] : value.items()) flatten(prefix + key, entry, columns);
    } else if (value.is_array()) {
        for (std::size_t i = 0; i < value.size(); ++i) {
            const bool isNamed = value[i].is_object() && value[i].contains("name") && value[i]["name"].is_string();
            flatten(prefix + (isNamed ? value[i]["name"].get<std::string>() : std::to_string(i)), value[i], columns);
        }
    } else {
        columns.set(name, value.is_null() ? "" : value.is_string() ? value.get<std::string>() : value.dump());
    }
}

/// Meshes, selections and supports are only looked at as the world is built.
void checkCase(const SweepPlan& plan, int index) {
    SceneChanges changes;
    changes.set = plan.changes(index);
    try {
        const World world(loadScene(findScene(plan.scene), changes));
    } catch (const InputError& error) {
        throw InputError(plan.label(index) + ": " + error.what());
    }
}

}  // namespace

int SweepPlan::cases() const {
    int count = 1;
    for (const SweepAxis& axis : axes) count *= static_cast<int>(axis.values.size());
    return count;
}

std::vector<std::string> SweepPlan::changes(int index) const {
    std::vector<std::string> set(axes.size());
    for (std::size_t k = axes.size(); k-- > 0;) {
        const int count = static_cast<int>(axes[k].values.size());
        set[k] = axes[k].path + "=" + axes[k].values[index % count];
        index /= count;
    }
    return set;
}

std::string SweepPlan::label(int index) const {
    std::string text = "case " + std::to_string(index) + " (";
    const std::vector<std::string> set = changes(index);
    for (std::size_t k = 0; k < set.size(); ++k) text += (k == 0 ? "" : ", ") + set[k];
    return text + ")";
}

fs::path SweepPlan::folderOf(int index) const {
    const std::string digits = std::to_string(index);
    return folder / ("case_" + std::string(digits.size() < 4 ? 4 - digits.size() : 0, '0') + digits);
}

bool SweepPlan::isDone(int index) const {
    return fs::exists(folderOf(index) / "result.json");
}

SweepAxis parseSweepAxis(const std::string& text) {
    const auto equals = text.find('=');
    if (equals == std::string::npos || equals == 0)
        throw InputError("--set " + text + ": must be PATH=VALUE,VALUE,... such as shells.0.friction=0.1,0.3");
    SweepAxis axis{text.substr(0, equals), {""}};
    int depth = 0;
    bool isQuoted = false;
    for (std::size_t i = equals + 1; i < text.size(); ++i) {
        const char c = text[i];
        if (c == '"' && text[i - 1] != '\\') isQuoted = !isQuoted;
        if (!isQuoted && (c == '[' || c == '{')) ++depth;
        if (!isQuoted && (c == ']' || c == '}')) --depth;
        if (c == ',' && depth == 0 && !isQuoted)
            axis.values.emplace_back();
        else
            axis.values.back() += c;
    }
    for (std::size_t i = 0; i < axis.values.size(); ++i) {
        if (axis.values[i].empty()) throw InputError("--set " + text + ": value " + std::to_string(i) + " is empty");
        if (std::count(axis.values.begin(), axis.values.end(), axis.values[i]) > 1)
            throw InputError("--set " + text + ": value " + axis.values[i] + " is there twice");
    }
    return axis;
}

void writePlan(const SweepPlan& plan) {
    double count = 1.0;
    for (const SweepAxis& axis : plan.axes) count *= static_cast<double>(axis.values.size());
    if (count > kMostCases)
        throw InputError("the plan has " + shortNumber(count) + " cases; at most " + std::to_string(kMostCases));
    const fs::path file = plan.folder / kPlanFile;
    const std::string text = toJson(plan).dump(2) + "\n";
    if (fs::exists(file)) {
        if (readText(file) == text) return;
        throw InputError("--out " + plan.folder.string() + ": holds another plan already; give another directory");
    }
    if (fs::exists(plan.folder) && (!fs::is_directory(plan.folder) || !fs::is_empty(plan.folder)))
        throw InputError("--out " + plan.folder.string() + ": is there already and holds no plan");
    for (int k = 0; k < plan.cases(); ++k) checkCase(plan, k);
    std::error_code error;
    fs::create_directories(plan.folder, error);
    if (error) throw InputError("--out " + plan.folder.string() + ": cannot be made: " + error.message());
    writeText(file, text);
}

SweepPlan readPlan(const fs::path& place) {
    const fs::path file = fs::is_directory(place) ? place / kPlanFile : place;
    if (fs::is_directory(place) && !fs::exists(file))
        throw InputError(place.string() + ": holds no plan.json, which `jacket sweep plan --out` writes");
    const Json document = parseJson(readText(file), file.string());
    const JsonSource source{.file = file.string(), .overrides = {}};
    ObjectReader reader(document, "", source);
    SweepPlan plan;
    plan.folder = fs::absolute(file).parent_path();
    plan.scene = reader.text("scene");
    reader.forEach("axes", [&](ObjectReader axis) {
        SweepAxis read{axis.text("path"), {}};
        for (const Json& value : axis.require("values"))
            read.values.push_back(value.is_string() ? value.get<std::string>() : value.dump());
        if (read.values.empty()) axis.fail("values", "must hold at least one value");
        axis.finish();
        plan.axes.push_back(std::move(read));
    });
    reader.finish();
    return plan;
}

std::string collectCsv(const SweepPlan& plan) {
    Columns columns;
    for (int k = 0; k < plan.cases(); ++k) {
        if (!plan.isDone(k)) continue;
        columns.set("case", std::to_string(k));
        for (std::size_t a = 0; a < plan.axes.size(); ++a) {
            const std::string change = plan.changes(k)[a];
            columns.set(plan.axes[a].path, change.substr(plan.axes[a].path.size() + 1));
        }
        const fs::path file = plan.folderOf(k) / "result.json";
        flatten("", parseJson(readText(file), file.string()), columns);
        columns.endRow();
    }
    return columns.csv();
}

}  // namespace jacket::demo
