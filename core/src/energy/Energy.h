#pragma once
#include <Eigen/SparseCore>

#include <memory>
#include <utility>
#include <vector>

#include "energy/MirroredMesh.h"
#include "jacket/HalfEdgeMesh.h"
#include "jacket/Models.h"
#include "solver/StepSystem.h"

namespace jacket {

/// What yielded in one step.
struct PlasticFlow {
    double work = 0.0;  ///< elastic energy that became heat [J]
    int elements = 0;   ///< hinges or triangles that yielded
    int triangle = -1;  ///< where the most work was done
    double most = 0.0;  ///< there [J]

    void add(double elementWork, int where) {
        work += elementWork;
        ++elements;
        if (elementWork >= most) most = elementWork, triangle = where;
    }
};

/// What a shell is when nothing acts on it.
struct RestShape {
    const Points& positions;
    std::vector<MirrorPlane> mirrors{};  ///< along clamped edges and planes of symmetry
    std::vector<char> rigid{};           ///< triangles whose corners are all clamped: they do not bend; empty: none
    bool flattened = false;              ///< bending forgets the curvature that the positions have
};

/// One energy of one shell: a sum over stencils.
class Energy {
  public:
    virtual ~Energy() = default;
    virtual void collectPairs(std::vector<std::pair<int, int>>& pairs) const = 0;  ///< vertex pairs it couples
    virtual void bind(const BlockMatrix& matrix) = 0;                              ///< looks up its blocks, once
    /// The part of the Hessian that never changes and is a scalar per vertex pair; addTo leaves it out. From bind on it
    /// is split for that matrix. At most one energy of a shell has one.
    virtual const ConstantHessian* constantHessian() const { return nullptr; }
    virtual void addTo(StepSystem& system, const Points& x, HessianKind kind) const = 0;  ///< A and b at x
    virtual double value(const Points& x) const = 0;                                      ///< [J]
    /// The same, while another thread may ask for the value at other positions: works in `memory`.
    virtual double valueBeside(const Points& x, std::vector<double>& /*memory*/) const { return value(x); }
    virtual void addGradient(const Points& x, Points& gradient) const = 0;  ///< += dE/dx [N]
    /// Newton's method on positions and stresses together: until the next call, exact Hessians take in their geometric
    /// part the stresses that the step dx from x was to lead to, not those that it did. Thin shells then need a handful
    /// of steps, not hundreds: stretching answers a finite rotation with stresses that no equilibrium has (Magisano,
    /// Leonetti and Garcea, Int. J. Numer. Meth. Engng 109, 2017). Empty dx: back to plain Newton.
    virtual void predictStress(const Points& /*x*/, const Points& /*dx*/) {}
    /// Moves the rest shape where x is beyond the elastic limit.
    virtual PlasticFlow flow(const Points&) { return {}; }
};

}  // namespace jacket
