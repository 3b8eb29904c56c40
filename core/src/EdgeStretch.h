#pragma once
#include "jacket/HalfEdgeMesh.h"
#include "jacket/WorkerTeam.h"

namespace jacket {

/// How much the edges of a shell change their lengths in a motion, over their rest lengths: the largest of all edges.
struct EdgeStretch {
    double lengthening = 0.0;  ///< beyond both the length before and the rest length [-]
    double change = 0.0;       ///< longer or shorter than before [-]
};

/// Of `count` edges at positions `x` that move by h v; `restLength` [m]: one of each edge.
EdgeStretch edgeStretch(const HalfEdgeMesh::Edge* edges, int count, const double* restLength, const double* x,
                        const double* v, double h, WorkerTeam* team = nullptr);

}  // namespace jacket
