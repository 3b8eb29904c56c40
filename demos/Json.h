#pragma once
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "jacket/Types.h"

/// Reading JSON so that every mistake in it is found and named.
namespace jacket::demo {

using Json = nlohmann::ordered_json;

/// Something the user gave that cannot be used; what() is the one message to print. Exit code 2.
class InputError : public std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// The input asks for a part of Jacket that does not exist yet.
class NotAvailable : public InputError {
    using InputError::InputError;
};

/// Parses JSON with // and /* */ comments. Throws InputError "FILE:LINE:COLUMN: ..." on a syntax error, and on a key
/// that is given twice.
Json parseJson(std::string_view text, const std::string& file);

/// The candidate that is the fewest typing mistakes away; "" when there are none.
std::string nearest(std::string_view word, std::span<const std::string> candidates);

/// "; did you mean "x"? (known: x, y, z)", or "" without candidates.
std::string suggestion(std::string_view word, std::span<const std::string> candidates);

/// Where the values of a JSON document come from: a file, some of them replaced by --set.
struct JsonSource {
    std::string file;
    std::vector<std::string> overrides;  ///< "path=value" as typed

    /// "FILE: path", or "--set path=value: path" when that option set the value.
    std::string label(const std::string& path) const;
};

/// Which numbers are allowed, and in what unit.
struct Range {
    std::string_view unit = "";
    double low = -std::numeric_limits<double>::infinity();
    bool includesLow = true;
    double high = std::numeric_limits<double>::infinity();

    bool contains(double x) const { return (includesLow ? x >= low : x > low) && x <= high; }
    std::string rule() const;  ///< "must be > 0"

    static constexpr Range any(std::string_view unit = "") { return {.unit = unit}; }
    static constexpr Range positive(std::string_view unit = "") {
        return {.unit = unit, .low = 0, .includesLow = false};
    }
    static constexpr Range nonNegative(std::string_view unit = "") { return {.unit = unit, .low = 0}; }
};

/// One object of a document. Every key that is asked for becomes a known one; finish() refuses all others. Paths are
/// written as --set takes them: shells.0.material.thickness.
class ObjectReader {
  public:
    ObjectReader(const Json& object, std::string path, const JsonSource& source);

    /// The value, or nullptr when it is not given.
    const Json* find(std::string_view key);
    bool has(std::string_view key) { return find(key) != nullptr; }
    const Json& require(std::string_view key);

    /// A value of that kind; the fallback when it is not given, an error when there is no fallback.
    double number(std::string_view key, const Range& range, std::optional<double> fallback = {});
    std::optional<double> optionalNumber(std::string_view key, const Range& range);
    double duration(std::string_view key, double fallback);  ///< > 0 [s]; a number, or a fraction such as "1/60"
    int integer(std::string_view key, int low, std::optional<int> fallback = {});
    bool flag(std::string_view key, bool fallback);
    std::string text(std::string_view key, std::optional<std::string> fallback = {});
    std::string choice(std::string_view key, std::span<const std::string> choices, std::optional<std::string> fallback);
    Vec3 vector(std::string_view key, std::optional<Vec3> fallback = {});
    std::vector<double> numbers(std::string_view key, int count, const Range& range);
    std::vector<int> indices(std::string_view key);
    ObjectReader object(std::string_view key);
    /// Calls `read` for each element of a list of objects; a missing list is an empty one.
    void forEach(std::string_view key, const std::function<void(ObjectReader)>& read);

    /// Throws NotAvailable when the key is given.
    void notYet(std::string_view key, std::string_view what);
    /// Exactly one of these keys must be there; returns it.
    std::string oneOf(std::span<const std::string> keys);
    /// Throws on keys that nobody asked for, naming the nearest known one.
    void finish() const;

    std::string path(std::string_view key) const;
    const std::string& path() const { return m_path; }
    std::string label(std::string_view key = "") const { return m_source->label(key.empty() ? m_path : path(key)); }
    const JsonSource& source() const { return *m_source; }
    [[noreturn]] void fail(std::string_view key, const std::string& message) const;

  private:
    double numberAt(const Json& value, const std::string& path, const Range& range) const;
    [[noreturn]] void failType(const std::string& path, std::string_view expected, const Json& value) const;

    const Json* m_object;
    std::string m_path;
    const JsonSource* m_source;
    std::vector<std::string> m_known;
};

/// "1/120", "0.5" or "5e-3" as a number; nothing when it is none.
std::optional<double> parseFraction(std::string_view text);

/// Replaces one value: "shells.sheet.friction=0.1". Elements of lists go by index or by their "name". The value is
/// JSON, or else a string. Throws InputError when the path leads nowhere, naming the nearest.
void applyOverride(Json& document, const std::string& pathAndValue);

Json toJson(const Vec3& v);

/// A number as people write it: 0.001, not 1.000000e-03.
std::string shortNumber(double x);

}  // namespace jacket::demo
