#include <cmath>
#include <cstdio>

#include "Bench.h"
#include "Peers.h"

namespace jacket::demo::bench {

namespace {

template <class... Args>
std::string format(const char* pattern, Args... args) {
    char text[320];
    std::snprintf(text, sizeof text, pattern, args...);
    return text;
}

Json numberOrNull(double x) {
    return std::isfinite(x) ? Json(x) : Json(nullptr);
}

const Row* find(const Bench& bench, int n, const std::string& solver) {
    for (const Row& row : bench.rows)
        if (row.n == n && row.solver == solver) return &row;
    return nullptr;
}

std::vector<int> sizesOf(const Bench& bench) {
    std::vector<int> sizes;
    for (const Row& row : bench.rows)
        if (sizes.empty() || sizes.back() != row.n) sizes.push_back(row.n);
    return sizes;
}

const PeerRow* peersOf(int n) {
    for (const PeerRow& row : kPeers)
        if (row.n == n) return &row;
    return nullptr;
}

/// "15.2 [1.6/0.13/18]"
std::string cell(const Row* row) {
    if (!row) return "-";
    return format("%.3g [%.2g/%.2g/%.2g]", row->msMedian, 100 * row->maxStretch, 100 * row->p99Stretch,
                  100 * row->peakStretch);
}

/// A line of its own where Jacket has several.
std::string threadsOf(const Bench& bench) {
    const int threads = bench.rows.empty() ? 1 : bench.rows.front().threads;
    if (threads == 1) return "";
    return format("Jacket with %d threads, btSoftBody with one; times are wall times, other programs' share included\n",
                  threads);
}

std::string heading(const Bench& bench) {
    const bool isAlone = bench.rows.empty() || !find(bench, bench.rows.front().n, "btSoftBody");
    return format("%s: %d frames of %.4g s, %d step%s a frame; %s, %d time%s\n", bench.scene.c_str(), bench.frames,
                  bench.dt, bench.substeps, bench.substeps == 1 ? "" : "s",
                  isAlone ? "Jacket alone" : "Jacket and btSoftBody in turn", bench.repeat,
                  bench.repeat == 1 ? "" : "s each") +
           bench.machine + "\n" + threadsOf(bench);
}

std::string measuredTable(const Bench& bench) {
    std::string text = format("%5s  %-10s %9s %9s %7s %9s %9s %9s %11s %10s %7s\n", "n", "solver", "ms/frame", "95 %",
                              "spread", "max end", "p99 end", "peak", "penetr./mm", "iterations", "MB");
    for (const int n : sizesOf(bench)) {
        const Row *ours = find(bench, n, "jacket"), *theirs = find(bench, n, "btSoftBody");
        for (const Row* row : {ours, theirs})
            if (row)
                text += format("%5d  %-10s %9.4g %9.4g %5.0f %% %7.3g %% %7.3g %% %7.3g %% %11.3g %10.3g %7.3g%s\n", n,
                               row->solver.c_str(), row->msMedian, row->msP95, 100 * row->spread, 100 * row->maxStretch,
                               100 * row->p99Stretch, 100 * row->peakStretch, 1e3 * row->maxPenetration,
                               row->iterations, row->rssMb, row->converged ? "" : "  not converged");
        if (ours && theirs)
            text += format("%5s  %-10s %9.3g %27.3g %11.3g %11.3g\n", "", "ratio", ours->msMedian / theirs->msMedian,
                           ours->maxStretch / theirs->maxStretch, ours->p99Stretch / theirs->p99Stretch,
                           ours->peakStretch / theirs->peakStretch);
    }
    return text;
}

std::string peerTable(const Bench& bench) {
    std::string text;
    const auto add = [&](const char* n, const char* a, const char* b, const char* c, const char* d, const char* e,
                         const char* f) {
        text += format("%5s  %-20s %-20s %-20s %-20s %-18s %s\n", n, a, b, c, d, e, f);
    };
    for (const int n : sizesOf(bench))
        if (const PeerRow* p = peersOf(n)) {
            if (text.empty())
                add("n", "btSoftBody, 10", "Jolt, 20 iterations", "Jolt, 80", "Jolt, 320", "MuJoCo elastic2d",
                    "ARCSim");
            add(std::to_string(n).c_str(), p->softBody, p->jolt20, p->jolt80, p->jolt320, p->mujoco, p->arcsim);
        }
    if (text.empty()) return text;
    return "\nNOT measured in this run: figures of other solvers, kept from an earlier day (tests/bench/README.md);\n"
           "CPU ms a frame [strain in %: largest at the end / 99th percentile at the end / peak]\n" +
           text;
}

}  // namespace

Json toJson(const Bench& bench) {
    Json json{{"machine", bench.machine}, {"scene", bench.scene}, {"rows", Json::array()}, {"ratios", Json::array()}};
    for (const Row& row : bench.rows)
        json["rows"].push_back({{"n", row.n},
                                {"solver", row.solver},
                                {"threads", row.threads},
                                {"ms_median", row.msMedian},
                                {"ms_p95", row.msP95},
                                {"max_stretch", numberOrNull(row.maxStretch)},
                                {"p99_stretch", numberOrNull(row.p99Stretch)},
                                {"peak_stretch", numberOrNull(row.peakStretch)},
                                {"max_penetration", row.maxPenetration},
                                {"iterations", row.iterations},
                                {"rss_mb", row.rssMb}});
    for (const int n : sizesOf(bench)) {
        const Row *ours = find(bench, n, "jacket"), *theirs = find(bench, n, "btSoftBody");
        if (ours && theirs)
            json["ratios"].push_back({{"n", n},
                                      {"time", numberOrNull(ours->msMedian / theirs->msMedian)},
                                      {"stretch", numberOrNull(ours->maxStretch / theirs->maxStretch)}});
    }
    return json;
}

std::string table(const Bench& bench) {
    return heading(bench) + bench.clock + " time of stepping alone; strain of edges at the end and at its peak\n\n" +
           measuredTable(bench) + (bench.scene == "drape" ? peerTable(bench) : "");
}

std::string markdown(const Bench& bench) {
    const bool hasPeers = bench.scene == "drape";
    std::string text =
        heading(bench) +
        "\n| n | Jacket | btSoftBody, 10 iterations | Jacket / btSoftBody | penetration [mm] | "
        "iterations | MB |" +
        (hasPeers ? " Jolt, 20 iterations * | Jolt, 80 * | Jolt, 320 * | MuJoCo elastic2d * | ARCSim * |" : "") +
        "\n|---|---|---|---|---|---|---|" + (hasPeers ? "---|---|---|---|---|" : "") + "\n";
    for (const int n : sizesOf(bench)) {
        const Row *ours = find(bench, n, "jacket"), *theirs = find(bench, n, "btSoftBody");
        text += format("| %d | %s | %s | %s | %.3g | %.3g | %.3g |", n, cell(ours).c_str(), cell(theirs).c_str(),
                       theirs ? format("%.2f", ours->msMedian / theirs->msMedian).c_str() : "-",
                       1e3 * ours->maxPenetration, ours->iterations, ours->rssMb);
        const PeerRow* p = peersOf(n);
        if (hasPeers && p)
            text += format(" %s | %s | %s | %s | %s |", p->jolt20, p->jolt80, p->jolt320, p->mujoco, p->arcsim);
        else if (hasPeers)
            text += " - | - | - | - | - |";
        text += "\n";
    }
    text += "\n" + bench.clock +
            " ms a frame [strain of edges in %: largest at the end / 99th percentile at the end / peak].";
    if (hasPeers) text += " * Not measured in this run.";
    return text + "\n";
}

}  // namespace jacket::demo::bench
