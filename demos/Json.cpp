#include "Json.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <numeric>

namespace jacket::demo {

namespace {

std::string quoted(const Json& value) {
    constexpr std::size_t kLongest = 60;
    std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
    if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
    return text;
}

std::string position(std::string_view text, std::size_t byte) {
    const std::string_view before = text.substr(0, std::min(byte, text.size()));
    const auto line = 1 + std::count(before.begin(), before.end(), '\n');
    const std::size_t start = before.rfind('\n');
    const std::size_t column = start == std::string_view::npos ? before.size() : before.size() - start - 1;
    return std::to_string(line) + ":" + std::to_string(std::max<std::size_t>(column, 1));
}

/// nlohmann's messages start with "[json.exception.parse_error.101] parse error at line 3, column 5: ".
std::string withoutPrefix(const std::string& message) {
    const std::size_t colon = message.find(": ");
    return colon == std::string::npos ? message : message.substr(colon + 2);
}

int typingMistakes(std::string_view a, std::string_view b) {
    std::vector<int> row(b.size() + 1);
    std::iota(row.begin(), row.end(), 0);
    for (std::size_t i = 0; i < a.size(); ++i) {
        int diagonal = row[0];
        row[0] = static_cast<int>(i) + 1;
        for (std::size_t j = 0; j < b.size(); ++j) {
            const int substituted = diagonal + (a[i] == b[j] ? 0 : 1);
            diagonal = row[j + 1];
            row[j + 1] = std::min({substituted, row[j] + 1, diagonal + 1});
        }
    }
    return row.back();
}

bool isIndex(std::string_view text) {
    return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::vector<std::string> split(std::string_view text, char separator) {
    std::vector<std::string> parts(1);
    for (const char c : text)
        if (c == separator)
            parts.emplace_back();
        else
            parts.back() += c;
    return parts;
}

}  // namespace

Json parseJson(std::string_view text, const std::string& file) {
    std::vector<std::set<std::string>> keys;
    std::string repeated;
    const auto watchKeys = [&](int, Json::parse_event_t event, Json& parsed) {
        if (event == Json::parse_event_t::object_start) keys.emplace_back();
        if (event == Json::parse_event_t::object_end) keys.pop_back();
        if (event == Json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second)
            repeated = parsed.get<std::string>();
        return true;
    };
    try {
        Json document = Json::parse(text, watchKeys, /*allow_exceptions=*/true, /*ignore_comments=*/true);
        if (!repeated.empty()) throw InputError(file + ": the key \"" + repeated + "\" is given twice in one object");
        return document;
    } catch (const Json::parse_error& error) {
        throw InputError(file + ":" + position(text, error.byte) + ": not valid JSON: " + withoutPrefix(error.what()));
    } catch (const Json::exception& error) {  // a number that no double can hold
        throw InputError(file + ": not valid JSON: " + error.what());
    }
}

std::string nearest(std::string_view word, std::span<const std::string> candidates) {
    std::string best;
    int fewest = std::numeric_limits<int>::max();
    for (const std::string& candidate : candidates)
        if (const int mistakes = typingMistakes(word, candidate); mistakes < fewest) {
            fewest = mistakes;
            best = candidate;
        }
    return best;
}

std::string suggestion(std::string_view word, std::span<const std::string> candidates) {
    if (candidates.empty()) return "";
    std::string text = "; did you mean \"" + nearest(word, candidates) + "\"? (known: ";
    for (std::size_t i = 0; i < candidates.size(); ++i) text += (i ? ", " : "") + candidates[i];
    return text + ")";
}

std::string JsonSource::label(const std::string& path) const {
    for (auto entry = overrides.rbegin(); entry != overrides.rend(); ++entry) {
        const std::string target = entry->substr(0, entry->find('='));
        if (path == target || path.starts_with(target + ".")) return "--set " + *entry + ": " + path;
    }
    return path.empty() ? file : file + ": " + path;
}

std::string Range::rule() const {
    const std::string above = includesLow ? "must be >= " : "must be > ";
    std::string text = std::isfinite(low) ? above + shortNumber(low) : "";
    if (std::isfinite(high)) text += (text.empty() ? "must be <= " : " and <= ") + shortNumber(high);
    return text.empty() ? "must be finite" : text;
}

ObjectReader::ObjectReader(const Json& object, std::string path, const JsonSource& source)
    : m_object(&object), m_path(std::move(path)), m_source(&source) {
    if (!object.is_object()) failType(m_path, "an object {...}", object);
}

std::string ObjectReader::path(std::string_view key) const {
    return m_path.empty() ? std::string(key) : m_path + "." + std::string(key);
}

void ObjectReader::fail(std::string_view key, const std::string& message) const {
    throw InputError(label(key) + " " + message);
}

void ObjectReader::failType(const std::string& path, std::string_view expected, const Json& value) const {
    throw InputError(m_source->label(path) + (path.empty() ? ": the document" : "") + " must be " +
                     std::string(expected) + ", got " + quoted(value));
}

const Json* ObjectReader::find(std::string_view key) {
    const std::string name(key);
    if (std::find(m_known.begin(), m_known.end(), name) == m_known.end()) m_known.push_back(name);
    const auto entry = m_object->find(name);
    return entry == m_object->end() ? nullptr : &*entry;
}

const Json& ObjectReader::require(std::string_view key) {
    const Json* value = find(key);
    if (!value) fail(key, "is missing");
    return *value;
}

double ObjectReader::numberAt(const Json& value, const std::string& path, const Range& range) const {
    if (!value.is_number()) failType(path, "a number", value);
    const double x = value.get<double>();
    if (std::isfinite(x) && range.contains(x)) return x;
    const std::string unit = range.unit.empty() ? "" : " [" + std::string(range.unit) + "]";
    throw InputError(m_source->label(path) + unit + " " + range.rule() + ", got " + quoted(value));
}

double ObjectReader::number(std::string_view key, const Range& range, std::optional<double> fallback) {
    if (fallback && !has(key)) return *fallback;
    return numberAt(require(key), path(key), range);
}

std::optional<double> ObjectReader::optionalNumber(std::string_view key, const Range& range) {
    if (!has(key)) return std::nullopt;
    return number(key, range);
}

double ObjectReader::duration(std::string_view key, double fallback) {
    const Json* value = find(key);
    if (value && value->is_string()) {
        const auto seconds = parseFraction(value->get<std::string>());
        if (!seconds || !(*seconds > 0))
            fail(key, "[s] must be a number > 0 or a fraction \"1/60\", got " + quoted(*value));
        return *seconds;
    }
    return number(key, Range::positive("s"), fallback);
}

int ObjectReader::integer(std::string_view key, int low, std::optional<int> fallback) {
    if (fallback && !has(key)) return *fallback;
    const Json& value = require(key);
    constexpr std::int64_t kHighest = std::numeric_limits<int>::max();
    if (!value.is_number_integer()) failType(path(key), "a whole number", value);
    const bool fits = value.is_number_unsigned() ? value.get<std::uint64_t>() <= std::uint64_t{kHighest}
                                                 : value.get<std::int64_t>() >= -kHighest;
    if (!fits || value.get<int>() < low) fail(key, "must be >= " + std::to_string(low) + ", got " + quoted(value));
    return value.get<int>();
}

bool ObjectReader::flag(std::string_view key, bool fallback) {
    const Json* value = find(key);
    if (value && !value->is_boolean()) failType(path(key), "true or false", *value);
    return value ? value->get<bool>() : fallback;
}

std::string ObjectReader::text(std::string_view key, std::optional<std::string> fallback) {
    if (fallback && !has(key)) return *fallback;
    const Json& value = require(key);
    if (!value.is_string()) failType(path(key), "a string", value);
    return value.get<std::string>();
}

std::string ObjectReader::choice(std::string_view key, std::span<const std::string> choices,
                                 std::optional<std::string> fallback) {
    const std::string chosen = text(key, std::move(fallback));
    if (std::find(choices.begin(), choices.end(), chosen) == choices.end())
        fail(key, "has the unknown value \"" + chosen + "\"" + suggestion(chosen, choices));
    return chosen;
}

std::vector<double> ObjectReader::numbers(std::string_view key, int count, const Range& range) {
    const Json& value = require(key);
    if (!value.is_array() || static_cast<int>(value.size()) != count)
        failType(path(key), "a list of " + std::to_string(count) + " numbers", value);
    std::vector<double> result;
    for (int i = 0; i < count; ++i) result.push_back(numberAt(value[i], path(key) + "." + std::to_string(i), range));
    return result;
}

Vec3 ObjectReader::vector(std::string_view key, std::optional<Vec3> fallback) {
    if (fallback && !has(key)) return *fallback;
    const auto xyz = numbers(key, 3, Range::any());
    return {xyz[0], xyz[1], xyz[2]};
}

std::vector<int> ObjectReader::indices(std::string_view key) {
    const Json& list = require(key);
    if (!list.is_array() || list.empty()) failType(path(key), "a list of vertex indices", list);
    std::vector<int> result;
    for (std::size_t i = 0; i < list.size(); ++i) {
        const bool valid = list[i].is_number_integer() && numberAt(list[i], path(key), Range::any()) >= 0 &&
                           list[i].get<double>() <= std::numeric_limits<int>::max();
        if (!valid) failType(path(key) + "." + std::to_string(i), "a vertex index >= 0", list[i]);
        result.push_back(list[i].get<int>());
    }
    return result;
}

ObjectReader ObjectReader::object(std::string_view key) {
    return {require(key), path(key), *m_source};
}

void ObjectReader::forEach(std::string_view key, const std::function<void(ObjectReader)>& read) {
    const Json* list = find(key);
    if (!list) return;
    if (!list->is_array()) failType(path(key), "a list [...]", *list);
    for (std::size_t i = 0; i < list->size(); ++i)
        read(ObjectReader((*list)[i], path(key) + "." + std::to_string(i), *m_source));
}

void ObjectReader::notYet(std::string_view key, std::string_view what) {
    if (has(key)) throw NotAvailable(label(key) + ": " + std::string(what) + " is not available yet");
}

std::string ObjectReader::oneOf(std::span<const std::string> keys) {
    std::string found;
    for (const std::string& key : keys) {
        if (!has(key)) continue;
        if (!found.empty()) fail("", "has both \"" + found + "\" and \"" + key + "\"; give one of them");
        found = key;
    }
    if (!found.empty()) return found;
    finish();  // a misspelt key explains more than a missing one
    std::string list;
    for (const std::string& key : keys) list += (list.empty() ? "\"" : ", \"") + key + "\"";
    fail("", "must have one of " + list);
}

void ObjectReader::finish() const {
    for (const auto& [key, value] : m_object->items())
        if (std::find(m_known.begin(), m_known.end(), key) == m_known.end())
            throw InputError(label(key) + ": unknown key \"" + key + "\"" + suggestion(key, m_known));
}

std::optional<double> parseFraction(std::string_view text) {
    const auto parse = [](std::string_view part) -> std::optional<double> {
        double x = 0.0;
        const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), x);
        const bool whole = error == std::errc() && end == part.data() + part.size();
        return whole && std::isfinite(x) ? std::optional(x) : std::nullopt;
    };
    const std::size_t slash = text.find('/');
    if (slash == std::string_view::npos) return parse(text);
    const auto over = parse(text.substr(0, slash)), under = parse(text.substr(slash + 1));
    if (!over || !under || *under == 0.0) return std::nullopt;
    return *over / *under;
}

namespace {

/// "steel" may stand for {"preset": "steel"}: written out when something inside is set.
void expandShorthand(Json& value, const std::string& key) {
    if (!value.is_string()) return;
    if (key == "material") value = Json{{"preset", value}};
    if (key == "membrane" || key == "bending") value = Json{{"model", value}};
}

Json& element(Json& list, const std::string& step, const std::string& where) {
    std::vector<std::string> names;
    for (Json& entry : list) {
        const bool named = entry.is_object() && entry.contains("name") && entry["name"].is_string();
        if (named && entry["name"] == step) return entry;
        if (named) names.push_back(entry["name"]);
    }
    if (isIndex(step) && step.size() < 9 && std::stoul(step) < list.size()) return list[std::stoul(step)];
    const std::string size = list.empty()       ? "the list is empty"
                             : list.size() == 1 ? "it has one element, 0"
                                                : "its elements are 0.." + std::to_string(list.size() - 1);
    throw InputError(where + " has no element \"" + step + "\": " + size +
                     (isIndex(step) ? std::string() : suggestion(step, names)));
}

}  // namespace

void applyOverride(Json& document, const std::string& pathAndValue) {
    const std::size_t equals = pathAndValue.find('=');
    if (equals == std::string::npos || equals == 0)
        throw InputError("--set " + pathAndValue + ": must be path=value, as in shells.0.friction=0.1");
    const std::string text = pathAndValue.substr(equals + 1);
    Json value = Json::parse(text, nullptr, /*allow_exceptions=*/false, /*ignore_comments=*/true);
    if (value.is_discarded()) value = text;

    Json* node = &document;
    std::string walked;
    for (const std::string& step : split(pathAndValue.substr(0, equals), '.')) {
        expandShorthand(*node, walked.substr(walked.rfind('.') + 1));
        if (step.empty()) throw InputError("--set " + pathAndValue + ": the path has an empty part");
        if (node->is_array())
            node = &element(*node, step, "--set " + pathAndValue + ": " + walked);
        else if (node->is_object() || node->is_null())
            node = &(*node)[step];
        else
            throw InputError("--set " + pathAndValue + ": " + walked + " is " + quoted(*node) + " and has no \"" +
                             step + "\" in it");
        walked += (walked.empty() ? "" : ".") + step;
    }
    *node = std::move(value);
}

Json toJson(const Vec3& v) {
    return Json::array({v.x(), v.y(), v.z()});
}

std::string shortNumber(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", x);
    return text;
}

}  // namespace jacket::demo
