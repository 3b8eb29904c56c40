// A Wavefront OBJ reader of our own, small because shells need positions and faces only. Ready-made readers are built
// for rendering: tinyobjloader gives no line numbers and reads the coordinate `nan` as 0, so that a user would neither
// learn that a file is broken nor where.
#include "jacket/loadMesh.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace jacket {
namespace {

/// A mesh and the lines of the file that its elements come from, 1-based.
struct MeshWithLines {
    TriangleMesh mesh;
    std::vector<int> vertexLines, triangleLines;
};

class ObjReader {
  public:
    ObjReader(std::string file, std::string_view text) : m_file(std::move(file)), m_text(text) {}

    MeshWithLines read() {
        if (m_text.substr(0, 3) == "\xEF\xBB\xBF") m_text.remove_prefix(3);  // byte order mark
        while (nextStatement()) {
            const std::string_view keyword = nextWord();
            if (keyword == "v")
                readVertex();
            else if (keyword == "f")
                readFace();  // everything else is for rendering
        }
        return finish();
    }

  private:
    static constexpr std::string_view kBlank = " \t\v\f";

    [[noreturn]] void fail(int line, const std::string& what) const {
        throw MeshFileError(m_file + ":" + std::to_string(line) + ": " + what);
    }
    static std::string quoted(std::string_view word) {
        constexpr std::size_t kLongest = 40;  // of a word in a message: the file may be anything
        std::string result(1, '\'');
        return result.append(word.substr(0, kLongest)).append(word.size() > kLongest ? "...'" : "'");
    }

    /// One line without its comment and its end: \n, \r\n or \r.
    std::string_view nextLine() {
        const std::size_t end = std::min(m_text.find_first_of("\r\n"), m_text.size());
        const std::string_view line = m_text.substr(0, end);
        m_text.remove_prefix(end);
        m_text.remove_prefix(m_text.substr(0, 2) == "\r\n" ? 2 : m_text.empty() ? 0 : 1);
        ++m_linesRead;
        return line.substr(0, line.find('#'));
    }

    /// The next line with those that a backslash at its end ties to it; false at the end of the file.
    bool nextStatement() {
        if (m_text.empty()) return false;
        m_line = m_linesRead + 1;
        m_rest = nextLine();
        if (m_rest.empty() || m_rest.back() != '\\') return true;
        m_joined.clear();
        while (!m_rest.empty() && m_rest.back() == '\\') {
            m_joined.append(m_rest.substr(0, m_rest.size() - 1)).push_back(' ');
            m_rest = m_text.empty() ? std::string_view{} : nextLine();
        }
        m_joined.append(m_rest);
        m_rest = m_joined;
        return true;
    }

    /// The next word of the statement, empty at its end.
    std::string_view nextWord() {
        m_rest.remove_prefix(std::min(m_rest.find_first_not_of(kBlank), m_rest.size()));
        const std::string_view word = m_rest.substr(0, m_rest.find_first_of(kBlank));
        m_rest.remove_prefix(word.size());
        return word;
    }

    /// v x y z, and what may follow (a weight, a colour) unread.
    void readVertex() {
        for (int k = 0; k < 3; ++k) {
            const std::string field = std::string("v: coordinate ") + "xyz"[k];
            const std::string_view word = nextWord();
            if (word.empty()) fail(m_line, field + " is missing; a vertex must have three");
            std::string_view digits = word;
            if (digits.size() > 1 && digits[0] == '+' && digits[1] != '-') digits.remove_prefix(1);
            double value = 0.0;
            const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
            if (error == std::errc::result_out_of_range)
                fail(m_line, field + " is " + quoted(word) + "; must lie in the range of double numbers");
            if (error != std::errc{} || end != digits.data() + digits.size())
                fail(m_line, field + " is " + quoted(word) + "; must be a number");
            if (!std::isfinite(value)) fail(m_line, field + " is " + quoted(word) + "; must be finite");
            m_coordinates.push_back(value);
        }
        m_vertexLines.push_back(m_line);
    }

    /// f and three or more of a, a/b, a//c, a/b/c: a counts vertices from 1, or from the last one read backwards (-1).
    void readFace() {
        m_corners.clear();
        for (std::string_view word = nextWord(); !word.empty(); word = nextWord())
            m_corners.push_back(vertexOfCorner(word));
        if (m_corners.size() < 3)
            fail(m_line, "f: has " + std::to_string(m_corners.size()) + " corners; must have at least 3");
        for (std::size_t k = 1; k + 1 < m_corners.size(); ++k) {
            m_triangles.insert(m_triangles.end(), {m_corners[0], m_corners[k], m_corners[k + 1]});
            m_triangleLines.push_back(m_line);
        }
    }

    int vertexOfCorner(std::string_view word) const {
        const int vertexCount = static_cast<int>(m_vertexLines.size());
        const std::string field = "f: corner " + std::to_string(m_corners.size() + 1) + " is " + quoted(word);
        std::array<int, 3> parts{0, 0, 0};
        const char* at = word.data();
        const char* const end = word.data() + word.size();
        for (int k = 0;; ++k) {
            const bool mayBeEmpty = k == 1 && at != end && *at == '/';  // a//c
            if (!mayBeEmpty) {
                const auto [next, error] = std::from_chars(at, end, parts[k]);
                if (error == std::errc::result_out_of_range) fail(m_line, field + "; must name an existing vertex");
                if (error != std::errc{}) fail(m_line, field + "; must be a, a/b, a//c or a/b/c with whole numbers");
                at = next;
            }
            if (at == end) break;
            if (*at != '/' || k == 2) fail(m_line, field + "; must be a, a/b, a//c or a/b/c with whole numbers");
            ++at;
        }
        const int index = parts[0];
        if (index == 0) fail(m_line, field + "; vertices are counted from 1");
        if (index < -vertexCount)
            fail(m_line, field + "; only " + std::to_string(vertexCount) + " vertices stand before it");
        return index > 0 ? index - 1 : vertexCount + index;  // whether it is not too large shows at the end of the file
    }

    MeshWithLines finish() {
        const int vertexCount = static_cast<int>(m_vertexLines.size());
        if (m_triangleLines.empty())
            throw MeshFileError(m_file + ": has " + std::to_string(vertexCount) +
                                " vertices (v) and no faces (f); must be a Wavefront OBJ file with at least one face");
        for (std::size_t i = 0; i < m_triangles.size(); ++i)
            if (m_triangles[i] >= vertexCount)
                fail(m_triangleLines[i / 3], "f: names vertex " + std::to_string(m_triangles[i] + 1) +
                                                 "; the file has vertices 1.." + std::to_string(vertexCount));
        MeshWithLines result;
        result.mesh.positions = Eigen::Map<const Points>(m_coordinates.data(), 3, vertexCount);
        result.mesh.triangles =
            Eigen::Map<const Indices<3>>(m_triangles.data(), 3, static_cast<Eigen::Index>(m_triangleLines.size()));
        result.vertexLines = std::move(m_vertexLines);
        result.triangleLines = std::move(m_triangleLines);
        return result;
    }

    std::string m_file;
    std::string_view m_text;          // what has not been read yet
    std::string_view m_rest;          // of the current statement
    std::string m_joined;             // the current statement, if it spans lines
    int m_linesRead = 0, m_line = 0;  // m_line: where the current statement begins
    std::vector<double> m_coordinates;
    std::vector<int> m_triangles, m_corners;
    std::vector<int> m_vertexLines, m_triangleLines;
};

MeshWithLines readObj(const std::filesystem::path& file) {
    const std::string name = file.string();
    std::error_code ignored;
    if (std::filesystem::is_directory(file, ignored))
        throw MeshFileError(name + ": is a directory; must be a Wavefront OBJ file");
    errno = 0;
    std::ifstream stream(file, std::ios::binary);
    if (!stream)
        throw MeshFileError(name + ": cannot be opened (" +
                            (errno ? std::generic_category().message(errno) : "unknown reason") +
                            "); must be a readable Wavefront OBJ file");
    const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    if (stream.bad()) throw MeshFileError(name + ": cannot be read to its end");
    if (text.empty()) throw MeshFileError(name + ": is empty; must be a Wavefront OBJ file with at least one face");
    return ObjReader(name, text).read();
}

/// Throws the first fatal problem with its line. `vertexLines` are those of the mesh given, welded or not.
void requireUsable(const TriangleMesh& mesh, const std::string& file, const std::vector<int>& vertexLines,
                   const std::vector<int>& triangleLines, const std::string& when) {
    std::string message;
    int others = 0;
    for (const MeshProblem& problem : checkMesh(mesh)) {
        if (!problem.fatal) continue;
        if (!message.empty()) {
            ++others;
            continue;
        }
        message = file;
        if (problem.index >= 0) {
            const bool isTriangle = problem.element == MeshProblem::Element::Triangle;
            message.append(":").append(std::to_string((isTriangle ? triangleLines : vertexLines)[problem.index]));
        }
        message.append(": ").append(when).append(problem.what).append(" (indices from 0)");
    }
    if (message.empty()) return;
    throw MeshFileError(message + (others > 0 ? ", and " + std::to_string(others) + " more" : ""));
}

}  // namespace

TriangleMesh loadMesh(const std::filesystem::path& file) {
    const MeshWithLines read = readObj(file);
    requireUsable(read.mesh, file.string(), read.vertexLines, read.triangleLines, "");

    std::vector<int> newIndex;
    TriangleMesh welded = weldSeams(read.mesh, 1e-6, &newIndex);
    if (welded.positions.cols() == read.mesh.positions.cols()) return welded;
    std::vector<int> lines(welded.positions.cols());
    for (std::size_t v = newIndex.size(); v-- > 0;) lines[newIndex[v]] = read.vertexLines[v];  // the first one stays
    requireUsable(welded, file.string(), lines, read.triangleLines, "after welding seams: ");
    return welded;
}

TriangleMesh loadMeshUnchecked(const std::filesystem::path& file) {
    return readObj(file).mesh;
}

}  // namespace jacket
