#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "jacket/Types.h"
#include "solver/BlockFactor.h"
#include "solver/CompactMatrix.h"

namespace jacket {

/// The rigid motions of patches of a shell: what a factor without fill does not see. P^T A P is formed for the matrix
/// and the constraints of a step, with rotations about the vertices' present places, and factored.
class CoarseSpace {
  public:
    /// Takes the pattern, the scalars beside it too, and divides the shell into patches.
    explicit CoarseSpace(const CompactMatrix& matrix);

    /// A soft row's part: stiffness on the weighted sum of some rows' velocities.
    struct Tie {
        std::array<int, 3> rows;
        Vec3 weights;
        Mat3 stiffness;
    };
    /// `free`: projector of each constrained row, null for all others.
    void build(const CompactMatrix& matrix, const Points& positions, const std::vector<const Mat3*>& free,
               std::span<const Tie> ties, WorkerTeam* team = nullptr);
    /// z += P (P^T A P)^-1 P^T r, four floats a row.
    void addTo(const float* r, float* z) const;
    /// The same in steps.
    void restrictFrom(const float* r, WorkerTeam* team) const;
    void solve() const { m_factor.solve(m_coarse.data()); }
    void prolongTo(float* z, WorkerTeam* team) const;
    int patchCount() const { return m_factor.size(); }
    int heldCount() const { return m_heldCount; }                  ///< constrained rows when it was built
    const std::vector<int>& patchOf() const { return m_patchOf; }  ///< of each row

  private:
    void findTargets(const CompactMatrix& matrix);
    void listScalars(const CompactMatrix& matrix, int row);
    int placeOf(int p, int q);
    void placeArms(const CompactMatrix& matrix, const Points& positions);
    void addTies(const std::vector<const Mat3*>& free, std::span<const Tie> ties);
    void collect(double besideFactor, int begin, int end);
    std::vector<int> m_patchOf;                ///< of each row; patches are numbered as they are eliminated
    std::vector<int> m_patchStart, m_members;  ///< rows of each patch
    BlockFactor m_factor;
    /// The factor's blocks that P^T A P has, the others being fill: first each patch' own. What is added up for them
    /// stands in this order.
    std::vector<int> m_blockOf;
    std::vector<int> m_placeOf;  ///< of each of the factor's blocks in it; -1: fill
    std::vector<int> m_target;   ///< the same of each block below the matrix's diagonal, or of its transpose
    /// Of each row three groups of scalars, by their order in the row: in the patch and below the diagonal; beyond it,
    /// by the places that they belong to; those whose mirror images do so. Before them stands how many the first are,
    /// and how many places follow; before those of a place stands that, in two halves, and how many they are. Of 16
    /// bits: a row of more scalars would have four billion beside it.
    std::vector<int> m_scalarStart;
    std::vector<std::uint16_t> m_scalars;
    int m_heldCount = 0;
    std::vector<char> m_isHeld;        ///< rows with a projector
    std::vector<char> m_isNearHeld;    ///< and those beside them
    std::vector<float> m_arms;         ///< of each row from its patch' centre over the patch' size, and 1
    std::vector<double> m_sums;        ///< P^T A P of the blocks: 6 columns of (3, 0, 3, 0) a block
    std::vector<float> m_moments;      ///< of the scalars: sum s (r_i, 1) (r_j, 1)^T a block
    std::vector<double> m_besideSums;  ///< the last entry of each moment, which must add up to 0
    std::vector<Vec3> m_centre;        ///< of each patch [m]
    std::vector<double> m_size;        ///< its size: root mean square of its rows' distances from the centre [m]
    mutable std::vector<double> m_coarse;
};

}  // namespace jacket
