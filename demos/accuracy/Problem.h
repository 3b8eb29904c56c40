#pragma once
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "accuracy/SheetMeshes.h"
#include "jacket/Models.h"

/// Problems with known answers: what the accuracy tests assert and `jacket report` tabulates.
namespace jacket::demo::accuracy {

/// One way to solve a problem.
struct Case {
    MeshKind mesh = MeshKind::OneDiagonal;
    int cells = 20;  ///< along the problem's main direction
    BendingModel bending = PatchBending{};
    double poisson = 0.0;
};

struct Measurement {
    double value = 0.0, reference = 0.0;
    double error = 0.0;    ///< signed, in units of the problem's scale: relative, or in lengths of the strip [-]
    double seconds = 0.0;  ///< CPU time of the solve alone
    int vertices = 0;
    bool converged = true;
};

struct Problem {
    std::string name;              ///< e.g. "heavy cantilever, Gamma 3"
    std::string quantity;          ///< what is measured and what `error` is relative to
    std::string source;            ///< of the reference
    std::vector<int> cells;        ///< two resolutions, the finer last
    std::vector<double> targets;   ///< largest |error| wanted at each of them
    std::vector<double> poissons;  ///< ratios it has references for
    std::vector<MeshKind> meshes;
    bool flatRest = true;  ///< false: QuadraticBending cannot be asked
    std::function<Measurement(const Case&)> solve;
};

/// All static problems and natural frequencies.
std::span<const Problem> problems();

}  // namespace jacket::demo::accuracy
