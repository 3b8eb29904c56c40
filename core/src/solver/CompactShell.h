#pragma once
#include <memory>

#include "solver/CoarseSpace.h"
#include "solver/CompactFactor.h"
#include "solver/CompactMatrix.h"

namespace jacket {

/// What solves in single precision keep of one shell from step to step.
struct CompactShell {
    CompactMatrix matrix;
    CompactFactor factor;
    std::unique_ptr<CoarseSpace> coarse;  ///< of shells that are large enough

    explicit CompactShell(const BlockMatrix& blocks) : matrix(blocks), factor(matrix) {}
    CompactShell(const CompactShell&) = delete;  // the factor refers to the matrix

    /// z = P^-1 r, four floats a row. The coarse problem, which has no parts, is solved beside the factor's.
    void precondition(const float* r, float* z, WorkerTeam* team) const {
        const int first = coarse ? 1 : 0, strips = factor.stripCount();
        if (coarse) coarse->restrictFrom(r, team);
        runParts(team, first + strips, [&](int i) { i < first ? coarse->solve() : factor.forward(i - first, r, z); });
        runParts(team, strips - 1, [&](int i) { factor.solveSeparator(i, r, z); });
        runParts(team, strips, [&](int i) { factor.backward(i, z); });
        if (coarse) coarse->prolongTo(z, team);
    }
};

}  // namespace jacket
