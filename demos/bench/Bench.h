#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "Scene.h"

/// Jacket and btSoftBody on the same scene, in turn, in one process.
namespace jacket::demo::bench {

struct Options {
    std::string scene = "drape";              ///< with one shell, of a grid
    std::vector<int> sizes{11, 31, 71, 101};  ///< vertices along the grid's first axis
    int repeat = 3;                           ///< runs of each solver
    int threads = 1;                          ///< of Jacket; above 1 frames are measured by wall time
    std::optional<int> substeps;              ///< the scene's if not given
    std::optional<double> seconds;            ///< simulated; the scene's if not given
    bool withSoftBody = true;
};

struct Row {
    int n = 0;  ///< vertices along the first axis
    std::string solver;
    int threads = 1, vertices = 0;
    double msMedian = 0.0, msP95 = 0.0;  ///< time of a frame (Bench::clock), over all frames of all runs
    double spread = 0.0;                 ///< largest less smallest median of a run, over msMedian [-]
    double maxStretch = 0.0, p99Stretch = 0.0, peakStretch = 0.0;  ///< of edges: at the end twice, over the run [-]
    double maxPenetration = 0.0;                                   ///< over the run [m]
    double iterations = 0.0;                                       ///< mean of a step
    double rssMb = 0.0;  ///< by how much the process was larger at a run's end than before its world was made
    bool converged = true;
};

struct Bench {
    std::string machine, scene;
    std::string clock = "CPU";  ///< or "wall": whose time the frames' is
    double dt = 0.0;            ///< length of a frame [s]
    int substeps = 1, frames = 0, repeat = 0;
    std::vector<Row> rows;  ///< by size; of each size Jacket's first
};

/// Throws InputError when the scene or a size cannot be used. `progress` is called after every run.
Bench run(const Options& options, const std::function<void(int done, int all)>& progress);

/// {"machine", "scene", "rows": [...], "ratios": [{"n", "time", "stretch"}]}: ratios are Jacket's over btSoftBody's.
Json toJson(const Bench& bench);
/// What was measured, the ratios, and beside it the figures of other solvers that are kept in Peers.h.
std::string table(const Bench& bench);
/// The same as one Markdown table, a row for each size.
std::string markdown(const Bench& bench);
/// Time per vertex and step, iterations and memory per vertex against the number of vertices, as an SVG image.
std::string growthPlots(const Bench& bench);

}  // namespace jacket::demo::bench
