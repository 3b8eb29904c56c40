#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <limits>

#include "Commands.h"
#include "Json.h"
#include "Result.h"
#include "jacket/HalfEdgeMesh.h"
#include "jacket/loadMesh.h"

namespace jacket::demo {

namespace {

std::string elementName(const MeshProblem& problem) {
    if (problem.index < 0) return "mesh";
    switch (problem.element) {
        case MeshProblem::Element::Vertex:
            return "vertex " + std::to_string(problem.index);
        case MeshProblem::Element::Edge:
            return "edge at vertex " + std::to_string(problem.index);
        case MeshProblem::Element::Triangle:
            return "triangle " + std::to_string(problem.index);
        case MeshProblem::Element::Mesh:
            break;
    }
    return "mesh";
}

/// "triangle 7: ..." unless the sentence begins so itself.
std::string sentence(const MeshProblem& problem) {
    const std::string name = elementName(problem);
    return problem.what.starts_with(name.substr(0, name.find(' '))) ? problem.what : name + ": " + problem.what;
}

void printSizes(const TriangleMesh& mesh) {
    const HalfEdgeMesh topology(mesh.triangles, static_cast<int>(mesh.positions.cols()));
    const auto isBorder = [](const HalfEdgeMesh::Edge& edge) { return edge.isBorder(); };
    const auto edges = topology.edges();
    double shortest = std::numeric_limits<double>::infinity(), longest = 0.0, area = 0.0;
    for (const auto& edge : edges) {
        const double length = (mesh.positions.col(edge.v0) - mesh.positions.col(edge.v1)).norm();
        shortest = std::min(shortest, length);
        longest = std::max(longest, length);
    }
    for (const auto& t : mesh.triangles.colwise())
        area += triangleArea(mesh.positions.col(t[0]), mesh.positions.col(t[1]), mesh.positions.col(t[2]));
    const Vec3 extent = mesh.positions.rowwise().maxCoeff() - mesh.positions.rowwise().minCoeff();
    std::cout << "  edges     " << edges.size() << ", " << std::count_if(edges.begin(), edges.end(), isBorder)
              << " of them on the border\n"
              << "  extent    " << shortNumber(extent.x()) << " x " << shortNumber(extent.y()) << " x "
              << shortNumber(extent.z()) << " m\n"
              << "  area      " << shortNumber(area) << " m2\n"
              << "  edge      " << shortNumber(shortest) << " .. " << shortNumber(longest) << " m\n";
}

int check(const std::string& file) {
    TriangleMesh mesh;
    try {
        mesh = loadMeshUnchecked(file);
    } catch (const MeshFileError& error) {
        throw InputError(error.what());
    }
    const auto problems = checkMesh(mesh);
    const auto fatal = std::count_if(problems.begin(), problems.end(), [](const auto& p) { return p.fatal; });
    std::cout << file << ": " << mesh.positions.cols() << " vertices, " << mesh.triangles.cols() << " triangles\n";
    if (fatal == 0) printSizes(mesh);
    for (const MeshProblem& problem : problems)
        std::cout << (problem.fatal ? "  ERROR     " : "  note      ") << sentence(problem) << '\n';
    if (fatal == 0) {
        std::cout << "  can be used as a shell\n";
        return kOk;
    }
    std::cerr << "jacket: " << file << ": " << fatal << (fatal == 1 ? " error makes" : " errors make")
              << " this mesh unusable as a shell; the first: "
              << sentence(*std::find_if(problems.begin(), problems.end(), [](const auto& p) { return p.fatal; }))
              << '\n';
    return kBadInput;
}

}  // namespace

void addCheckCommand(CLI::App& app, int& exitCode) {
    CLI::App* command = app.add_subcommand("check", "What is wrong with a mesh, by index (0-based)");
    auto file = std::make_shared<std::string>();
    command->add_option("mesh", *file, "Wavefront OBJ file")->required();
    command->footer("Exit code 2 if the mesh cannot be used as a shell.\nExample:  jacket check hood.obj");
    command->callback([file, &exitCode] { exitCode = check(*file); });
}

}  // namespace jacket::demo
