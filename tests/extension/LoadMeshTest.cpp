#include "jacket/loadMesh.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <tiny_obj_loader.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <string>

namespace jacket {
namespace {

namespace fs = std::filesystem;

/// A file that goes away with the test.
class TemporaryFile {
  public:
    explicit TemporaryFile(const std::string& content, const std::string& name = "mesh.obj") {
        static int counter = 0;
        const std::string folder = "jacket_load_mesh_" + std::to_string(::getpid()) + "_" + std::to_string(counter++);
        m_folder = fs::temp_directory_path() / folder;
        fs::create_directories(m_folder);
        m_path = m_folder / name;
        std::ofstream(m_path, std::ios::binary) << content;
    }
    ~TemporaryFile() { fs::remove_all(m_folder); }
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;
    const fs::path& path() const { return m_path; }

  private:
    fs::path m_folder, m_path;
};

TriangleMesh load(const std::string& content) {
    return loadMesh(TemporaryFile(content).path());
}

/// What loading says, without the folder.
std::string messageOf(const std::string& content) {
    const TemporaryFile file(content);
    try {
        loadMesh(file.path());
    } catch (const MeshFileError& error) {
        const std::string what = error.what(), folder = file.path().parent_path().string() + "/";
        return what.substr(0, folder.size()) == folder ? what.substr(folder.size()) : what;
    }
    return "nothing was thrown";
}

std::vector<int> flat(const Indices<3>& triangles) {
    return {triangles.data(), triangles.data() + triangles.size()};
}

constexpr const char* kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(LoadMesh, ReadsVerticesAndFaces) {
    const TriangleMesh mesh = load(std::string(kSquare) + "f 1 2 3\nf 1 3 4\n");
    ASSERT_EQ(mesh.positions.cols(), 4);
    EXPECT_EQ(mesh.positions.col(2), Vec3(1, 1, 0));
    EXPECT_EQ(flat(mesh.triangles), (std::vector{0, 1, 2, 0, 2, 3}));
}

TEST(LoadMesh, ReadsEverySpellingOfACorner) {
    const std::vector<int> expected{0, 1, 2, 0, 2, 3};
    for (const char* faces : {"f 1 2 3 4", "f 1/1 2/2 3/3 4/4", "f 1//1 2//1 3//1 4//1", "f 1/1/1 2/2/1 3/3/1 4/4/1",
                              "f -4 -3 -2 -1", "f -4/-1/-1 2 3//1 -1/1", "f\t1  2 \t3 4  "})
        EXPECT_EQ(flat(load(std::string(kSquare) + faces).triangles), expected) << faces;
}

TEST(LoadMesh, SplitsPolygonsIntoFans) {
    const TriangleMesh mesh = load("v 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4 5\n");
    EXPECT_EQ(flat(mesh.triangles), (std::vector{0, 1, 2, 0, 2, 3, 0, 3, 4}));
}

TEST(LoadMesh, SkipsWhatIsForRendering) {
    const TriangleMesh mesh = load(
        "# a square\nmtllib a.mtl\no Square\ng part\nv 0 0 0 # first\nv 1 0 0 1.0\n"
        "v 1 1 0 0.5 0.5 0.5\nv 0 1 0\nvt 0 0\nvn 0 0 1\nvp 0.3\nusemtl red\ns off\nl 1 2\n"
        "f 1/1/1 2/1/1 3/1/1 # half\n\n   \nf 1 3 4\n");
    EXPECT_EQ(mesh.positions.cols(), 4);
    EXPECT_EQ(mesh.triangles.cols(), 2);
}

TEST(LoadMesh, TakesAnyLineEndContinuationsAndAByteOrderMark) {
    for (const char* text :
         {"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n", "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3",
          "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", "v 0 \\\n 0 0\nv 1 0\\\r\n0\nv 0 1 0\nf \\\n1 2\\\n3\\",
          "\xEF\xBB\xBFv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3", "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n"}) {
        const TriangleMesh mesh = load(text);
        EXPECT_EQ(mesh.positions, (Points(3, 3) << 0, 1, 0, 0, 0, 1, 0, 0, 0).finished()) << text;
        EXPECT_EQ(flat(mesh.triangles), (std::vector{0, 1, 2})) << text;
    }
}

TEST(LoadMesh, ReadsNumbersExactly) {
    const TriangleMesh mesh = load("v 0.1 -2.5e-3 +1E2\nv 1. .5 -0\nv 0 1 0\nf 1 2 3\n");
    EXPECT_EQ(mesh.positions.col(0), Vec3(0.1, -2.5e-3, 100.0));
    EXPECT_EQ(mesh.positions.col(1), Vec3(1.0, 0.5, 0.0));
}

TEST(LoadMesh, WeldsTextureSeams) {
    const TriangleMesh mesh = load("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 4 5 6\n");
    EXPECT_EQ(mesh.positions.cols(), 4);
    EXPECT_EQ(flat(mesh.triangles), (std::vector{0, 1, 2, 1, 3, 2}));
}

TEST(LoadMesh, UncheckedLeavesSeamsAndFlawsAlone) {
    const TemporaryFile file(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\nf 4 5 6\nf 1 1 2\n");
    const TriangleMesh mesh = loadMeshUnchecked(file.path());
    EXPECT_EQ(mesh.positions.cols(), 7);
    EXPECT_EQ(mesh.triangles.cols(), 3);
    EXPECT_EQ(checkMesh(mesh).size(), 2u + 1u);  // the repeated vertex, the unused one, two parts
    EXPECT_THROW(loadMesh(file.path()), MeshFileError);
}

TEST(LoadMesh, NamesLineFieldValueAndRule) {
    const std::string square = kSquare;
    const std::string corner = "; must be a, a/b, a//c or a/b/c with whole numbers";
    const std::vector<std::array<std::string, 2>> cases{
        {"", "mesh.obj: is empty; must be a Wavefront OBJ file with at least one face"},
        {"solid cube\n",
         "mesh.obj: has 0 vertices (v) and no faces (f); must be a Wavefront OBJ file with at least one face"},
        {square, "mesh.obj: has 4 vertices (v) and no faces (f); must be a Wavefront OBJ file with at least one face"},
        {"v 0 0 0\nv 1 abc 0\n", "mesh.obj:2: v: coordinate y is 'abc'; must be a number"},
        {"v 0 0 0\nv 1 1,5 0\n", "mesh.obj:2: v: coordinate y is '1,5'; must be a number"},
        {"v 0 0 0\nv 1 2\n", "mesh.obj:2: v: coordinate z is missing; a vertex must have three"},
        {"# one\nv 0 nan 0\n", "mesh.obj:2: v: coordinate y is 'nan'; must be finite"},
        {"v -inf 0 0\n", "mesh.obj:1: v: coordinate x is '-inf'; must be finite"},
        {"v 1e999 0 0\n", "mesh.obj:1: v: coordinate x is '1e999'; must lie in the range of double numbers"},
        {"v +-1 0 0\n", "mesh.obj:1: v: coordinate x is '+-1'; must be a number"},
        {"v 0 0 \\\n\\\nzero\n", "mesh.obj:1: v: coordinate z is 'zero'; must be a number"},
        {square + "f 1 2 0\n", "mesh.obj:5: f: corner 3 is '0'; vertices are counted from 1"},
        {square + "f 1 2 5\n", "mesh.obj:5: f: names vertex 5; the file has vertices 1..4"},
        {square + "f 1 -5 2\n", "mesh.obj:5: f: corner 2 is '-5'; only 4 vertices stand before it"},
        {square + "f 1 2 99999999999\n", "mesh.obj:5: f: corner 3 is '99999999999'; must name an existing vertex"},
        {square + "f 1 2\n", "mesh.obj:5: f: has 2 corners; must have at least 3"},
        {square + "f\n", "mesh.obj:5: f: has 0 corners; must have at least 3"},
        {square + "f 1 2 x\n", "mesh.obj:5: f: corner 3 is 'x'" + corner},
        {square + "f 1 2 3.5\n", "mesh.obj:5: f: corner 3 is '3.5'" + corner},
        {square + "f 1/ 2 3\n", "mesh.obj:5: f: corner 1 is '1/'" + corner},
        {square + "f 1// 2 3\n", "mesh.obj:5: f: corner 1 is '1//'" + corner},
        {square + "f /1 2 3\n", "mesh.obj:5: f: corner 1 is '/1'" + corner},
        {square + "f 1/2/3/4 2 3\n", "mesh.obj:5: f: corner 1 is '1/2/3/4'" + corner},
        {square + "f 1 2 3 4\nv 9 9 9\n",
         "mesh.obj:6: vertex 4: belongs to no triangle and would have no mass; every vertex must be used (indices from "
         "0)"},
        {square + "f 1 2 3 4\nf 1 2 2\n",
         "mesh.obj:6: triangle 2 (0 1 1): repeats vertex 1; the three must differ (indices from 0)"},
        {square + "v 2 0 0\nf 1 2 3 4\n\nf 2 1 5\n",
         "mesh.obj:8: triangle 2 (1 0 4): area 0 m^2; must be > 2.23607e-09 m^2, i.e. higher than 1e-09 of the mesh's "
         "size (indices from 0)"},
        {square + "f 1 2 3\nf 1 4 3\n",
         "mesh.obj:3: edge 2-0: triangles 0 and 1 both run along it in this direction; neighbours must be oriented "
         "alike "
         "(indices from 0)"},
        {square + "f 1 2 3 4\nf 1 2 2\nf 3 3 1\nv 0 0 9\n",
         "mesh.obj:6: triangle 2 (0 1 1): repeats vertex 1; the three must differ (indices from 0), and 2 more"}};
    for (const auto& [content, message] : cases) EXPECT_EQ(messageOf(content), message) << content;
}

TEST(LoadMesh, NamesTheLineOfWhatOnlyWeldingShows) {
    // Two squares that overlap along a border, drawn with vertices of their own and facing opposite ways.
    EXPECT_EQ(messageOf("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv 1 0 0\nv 0 -1 0\nf 1 2 3\nf 4 5 6\n"),
              "mesh.obj:1: after welding seams: edge 0-1: triangles 0 and 1 both run along it in this direction; "
              "neighbours must be oriented alike (indices from 0)");
}

TEST(LoadMesh, LongWordsAreCutInMessages) {
    EXPECT_EQ(messageOf("v " + std::string(5000, 'x') + "\n"),
              "mesh.obj:1: v: coordinate x is '" + std::string(40, 'x') + "...'; must be a number");
}

TEST(LoadMesh, SaysWhyAFileCannotBeOpened) {
    const TemporaryFile file("");
    const auto messageFor = [](const fs::path& path) -> std::string {
        try {
            loadMesh(path);
        } catch (const MeshFileError& error) {
            return error.what();
        }
        return "nothing was thrown";
    };
    const fs::path missing = file.path().parent_path() / "missing.obj";
    EXPECT_EQ(messageFor(missing), missing.string() +
                                       ": cannot be opened (No such file or directory); must be a "
                                       "readable Wavefront OBJ file");
    const fs::path folder = file.path().parent_path();
    EXPECT_EQ(messageFor(folder), folder.string() + ": is a directory; must be a Wavefront OBJ file");
}

std::string shortest(double value) {
    std::array<char, 32> digits;
    return {digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr};
}

/// Mesh to OBJ, with corners in the spelling `style`.
std::string objOf(const TriangleMesh& mesh, int style) {
    std::string text = "# generated\no part\nvt 0 0\nvn 0 1 0\n";
    const auto count = mesh.positions.cols();
    for (int v = 0; v < count; ++v) {
        text += "v";
        for (int k = 0; k < 3; ++k) text.append(" ").append(shortest(mesh.positions(k, v)));
        text += style % 2 == 0 ? "\n" : "\r\n";
    }
    for (int t = 0; t < mesh.triangles.cols(); ++t) {
        text += "f";
        for (int k = 0; k < 3; ++k) {
            constexpr std::array<const char*, 5> kRest{"", "/1", "//1", "/1/1", ""};  // style 4 counts backwards
            const auto index = mesh.triangles(k, t) + 1;
            text.append(" ")
                .append(std::to_string(style % 5 == 4 ? index - count - 1 : index))
                .append(kRest[style % 5]);
        }
        text += "\n";
    }
    return text;
}

void expectAgreementWithTinyObjLoader(const TriangleMesh& mesh, int style) {
    const TemporaryFile file(objOf(mesh, style));
    const TriangleMesh ours = loadMeshUnchecked(file.path());
    EXPECT_EQ(ours.positions, mesh.positions);  // to the bit
    EXPECT_EQ(ours.triangles, mesh.triangles);

    tinyobj::ObjReader reader;
    ASSERT_TRUE(reader.ParseFromFile(file.path().string())) << reader.Error();
    const auto& vertices = reader.GetAttrib().vertices;
    ASSERT_EQ(static_cast<Eigen::Index>(vertices.size()), ours.positions.size());
    for (Eigen::Index i = 0; i < ours.positions.size(); ++i)
        EXPECT_NEAR(vertices[i], ours.positions.data()[i], 1e-6 * std::abs(ours.positions.data()[i]) + 1e-7);
    std::vector<int> theirs;
    for (const auto& shape : reader.GetShapes())
        for (const auto& corner : shape.mesh.indices) theirs.push_back(corner.vertex_index);
    EXPECT_EQ(flat(ours.triangles), theirs);
}

TEST(LoadMesh, AgreesWithTinyObjLoaderOnOurMeshes) {
    for (int style = 0; style < 10; ++style) {
        expectAgreementWithTinyObjLoader(makeGrid({.size = {1.3, 0.7}, .cells = {7, 5}}), style);
        expectAgreementWithTinyObjLoader(makeHemisphere(0.3, 6), style);
        expectAgreementWithTinyObjLoader(makeCylinder(0.1, 2.0, 9, 4), style);
    }
}

RC_GTEST_PROP(LoadMeshProperty, AgreesWithTinyObjLoaderOnRandomMeshes, ()) {
    const int vertices = *rc::gen::inRange(3, 30);
    TriangleMesh mesh{Points(3, vertices), Indices<3>(3, *rc::gen::inRange(1, 40))};
    for (double& x : mesh.positions.reshaped()) x = *rc::gen::inRange(-1000000, 1000001) * 1e-3 / 7.0;
    for (int& v : mesh.triangles.reshaped()) v = *rc::gen::inRange(0, vertices);
    // Three different corners: tinyobjloader drops some of the others.
    for (auto triangle : mesh.triangles.colwise()) {
        triangle[1] = (triangle[0] + 1) % vertices;
        triangle[2] = (triangle[0] + 2) % vertices;
    }
    expectAgreementWithTinyObjLoader(mesh, *rc::gen::inRange(0, 10));
}

RC_GTEST_PROP(LoadMeshProperty, SurvivesAnyText, ()) {
    const auto words = *rc::gen::container<std::vector<std::string>>(
        rc::gen::element<std::string>("v", "f", " ", " ", " ", "\n", "\n", "\r", "\\", "\\\n", "#", "/", "//", "0", "1",
                                      "2", "-1", "1e5", "nan", "-", "+", ".", std::string(1, '\0'), "\xff", "1/2",
                                      "v 0 0 0\n", "v 1 0 0\n", "v 0 1 0\n", "f 1 2 3\n", "f -3 -2 -1\n"));
    std::string text;
    for (const std::string& word : words) text += word;
    const TemporaryFile file(text);
    try {
        requireUsable(loadMesh(file.path()));
    } catch (const MeshFileError& error) {
        RC_ASSERT(std::string(error.what()).starts_with(file.path().string() + ":"));
    }
}

}  // namespace
}  // namespace jacket
