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
};

}  // namespace jacket
