#include "Bench.h"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>

#include "Machine.h"
#include "Measure.h"
#include "Quantile.h"
#include "SceneFile.h"
#include "SoftWorld.h"

namespace jacket::demo::bench {

namespace {

/// What a run is measured by.
struct Trial {
    std::vector<double> ms;       ///< time of each frame
    std::vector<double> stretch;  ///< of each edge at the end [-]
    double peakStretch = 0.0, penetration = 0.0, iterations = 0.0, rssMb = 0.0;
    bool converged = true;
    int vertices = 0;
};

double residentMb() {
    std::ifstream in("/proc/self/statm");
    double all = 0.0, resident = 0.0;
    in >> all >> resident;
    return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1048576.0;
}

/// The edges of a sheet and how long they are at rest.
class EdgeGauge {
  public:
    EdgeGauge(const HalfEdgeMesh& mesh, const Points& rest) : m_mesh(mesh) {
        for (const auto& e : mesh.edges()) m_rest.push_back((rest.col(e.v1) - rest.col(e.v0)).norm());
    }
    std::vector<double> stretch(const Points& x) const {
        std::vector<double> all(m_rest.size());
        for (std::size_t i = 0; i < all.size(); ++i) {
            const auto& e = m_mesh.edges()[i];
            all[i] = (x.col(e.v1) - x.col(e.v0)).norm() / m_rest[i] - 1.0;
            if (!std::isfinite(all[i])) all[i] = std::numeric_limits<double>::infinity();
        }
        return all;
    }

  private:
    const HalfEdgeMesh& m_mesh;
    std::vector<double> m_rest;
};

/// CPU time of this thread does not show what others do; wall time shows all, other programs too.
enum class Clock { Cpu, Wall };

Clock clockFor(int threads) {
    return threads > 1 ? Clock::Wall : Clock::Cpu;
}

/// Runs a world to the end. Between frames, untimed, `positions()` and `bodies()` are measured.
template <class AnyWorld, class PositionsOf>
Trial follow(AnyWorld& world, const Scene& scene, const EdgeGauge& gauge, const HalfEdgeMesh& mesh, Clock clock,
             const PositionsOf& positionsOf) {
    Trial trial;
    for (int frame = 0; frame < scene.frames(); ++frame) {
        const FrameReport report = world.step();
        trial.ms.push_back(1e3 * (clock == Clock::Wall ? report.seconds : report.cpuSeconds));
        trial.iterations += report.pcgIterations;
        trial.converged = trial.converged && report.converged && report.finite;
        const Points& x = positionsOf(world);
        trial.stretch = gauge.stretch(x);
        trial.peakStretch = std::max(trial.peakStretch, *std::max_element(trial.stretch.begin(), trial.stretch.end()));
        for (const BodyState& body : world.bodies())
            trial.penetration = std::max(trial.penetration, depthIn(body, x, mesh));
        trial.vertices = static_cast<int>(x.cols());
    }
    trial.iterations /= scene.frames() * scene.substeps;
    return trial;
}

Trial runJacket(const Scene& scene, int threads) {
    malloc_trim(0);
    const double before = residentMb();
    World world(scene, threads);
    const Shell& shell = world.shell(0);
    const EdgeGauge gauge(shell.mesh(), shell.restPositions());
    Trial trial =
        follow(world, scene, gauge, shell.mesh(), clockFor(threads), [](World& w) { return w.shell(0).positions(); });
    malloc_trim(0);
    trial.rssMb = residentMb() - before;
    return trial;
}

Trial runSoftBody(const Scene& scene, Clock clock) {
    malloc_trim(0);
    const double before = residentMb();
    const TriangleMesh rest = makeGrid(std::get<GridOptions>(scene.shells[0].mesh));
    const HalfEdgeMesh mesh(rest.triangles, static_cast<int>(rest.positions.cols()));
    const EdgeGauge gauge(mesh, rest.positions);
    SoftWorld world(scene);
    Trial trial = follow(world, scene, gauge, mesh, clock, [](SoftWorld& w) { return w.positions(); });
    trial.iterations = SoftWorld::kIterations;
    malloc_trim(0);
    trial.rssMb = residentMb() - before;
    return trial;
}

Row summed(int n, const std::string& solver, const std::vector<Trial>& trials) {
    std::vector<double> all, medians;
    for (const Trial& trial : trials) {
        all.insert(all.end(), trial.ms.begin(), trial.ms.end());
        medians.push_back(quantile(trial.ms, 0.5));
    }
    const auto [least, most] = std::minmax_element(medians.begin(), medians.end());
    const Trial& first = trials.front();
    Row row{.n = n, .solver = solver};
    row.vertices = first.vertices;
    row.msMedian = quantile(all, 0.5);
    row.msP95 = quantile(all, 0.95);
    row.spread = (*most - *least) / std::max(row.msMedian, 1e-12);
    row.maxStretch = *std::max_element(first.stretch.begin(), first.stretch.end());
    row.p99Stretch = quantile(first.stretch, 0.99);
    row.peakStretch = first.peakStretch;
    row.maxPenetration = first.penetration;
    row.iterations = first.iterations;
    row.rssMb = first.rssMb;
    row.converged = first.converged;
    return row;
}

Scene sceneOf(const Options& options, int n) {
    const auto file = findScene(options.scene);
    const Scene plain = loadScene(file);
    SoftWorld::check(plain);
    const Eigen::Vector2i cells = std::get<GridOptions>(plain.shells[0].mesh).cells;
    const int rows = std::max(1, static_cast<int>(std::lround(double(n - 1) * cells[1] / cells[0])));
    SceneChanges changes;
    changes.set = {"shells.0.mesh.grid.cells=[" + std::to_string(n - 1) + "," + std::to_string(rows) + "]"};
    changes.seconds = options.seconds;
    Scene scene = loadScene(file, changes);
    if (options.substeps) scene.substeps = *options.substeps;
    return scene;
}

void warmUp(const Options& options) {
    Options brief = options;
    const Scene scene = sceneOf(options, options.sizes.front());
    brief.seconds = std::min(scene.seconds, 10 * scene.dt);
    const Scene start = sceneOf(brief, options.sizes.front());
    runJacket(start, options.threads);
    if (options.withSoftBody) runSoftBody(start, clockFor(options.threads));
}

}  // namespace

Bench run(const Options& options, const std::function<void(int, int)>& progress) {
    for (const int n : options.sizes) sceneOf(options, n);  // throws before anything is measured
    warmUp(options);
    const Machine machine = thisMachine();
    const Scene first = sceneOf(options, options.sizes.front());
    Bench bench{.machine = machine.cpu + ", " + std::to_string(machine.cores) + " processors, " + machine.compiler +
                           ", " + machine.flags + ", Bullet " + machine.bullet + " in " + machine.precision,
                .scene = first.name,
                .clock = clockFor(options.threads) == Clock::Wall ? "wall" : "CPU",
                .dt = first.dt,
                .substeps = first.substeps,
                .frames = first.frames(),
                .repeat = options.repeat,
                .rows = {}};
    const int solvers = options.withSoftBody ? 2 : 1;
    int done = 0;
    const int all = static_cast<int>(options.sizes.size()) * options.repeat * solvers;
    for (const int n : options.sizes) {
        const Scene scene = sceneOf(options, n);
        std::vector<Trial> ours, theirs;
        for (int i = 0; i < options.repeat; ++i) {
            ours.push_back(runJacket(scene, options.threads));
            progress(++done, all);
            if (!options.withSoftBody) continue;
            theirs.push_back(runSoftBody(scene, clockFor(options.threads)));
            progress(++done, all);
        }
        bench.rows.push_back(summed(n, "jacket", ours));
        bench.rows.back().threads = options.threads;
        if (options.withSoftBody) bench.rows.push_back(summed(n, "btSoftBody", theirs));
    }
    return bench;
}

}  // namespace jacket::demo::bench
