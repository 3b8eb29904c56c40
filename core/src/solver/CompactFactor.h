#pragma once
#include <vector>

#include "solver/CompactMatrix.h"
#include "solver/FilteredMatrix.h"

namespace jacket {

/// IncompleteCholesky in the rows of a CompactMatrix, factored in double and applied in single precision.
class CompactFactor {
  public:
    /// Of the pattern of `matrix`, which must outlive it.
    explicit CompactFactor(const CompactMatrix& matrix);
    /// `matrix`: of the block matrix that the pattern came from.
    void factor(const FilteredMatrix& matrix, WorkerTeam* team = nullptr);
    /// z = (L D L^T)^-1 r, four floats a row; the last of each is 0 in z. r and z may be the same.
    void apply(const float* r, float* z) const;
    /// The same in parts: forward for every strip, then every separator, then backward for every strip (see
    /// CompactMatrix::stripCount). What one of these says may be done in any order, or at the same time.
    int stripCount() const { return static_cast<int>(m_partStart.size()) / 2; }
    void forward(int strip, const float* r, float* z) const;
    void solveSeparator(int separator, const float* r, float* z) const;
    void backward(int strip, float* z) const;
    double shift() const { return m_shift; }

    /// All that solving reads, as plain memory for the kernels. Blocks are nine floats by columns.
    struct Solving {
        CompactMatrix::Pattern pattern;
        const float *root, *lower;
    };

  private:
    /// Hands out places: those that have been given back before others.
    class Places {
      public:
        int take();
        void giveBack(int place) { m_free.push_back(place); }
        void keepTaken() { m_free.clear(); }  ///< what has been handed out so far stays so
        int count() const { return m_count; }

      private:
        std::vector<int> m_free;
        int m_count = 0;
    };
    void findPairs();
    void placeValues();
    void placeInverse(int row, int first, Places& places);
    void placeScaled(int row, int first, const std::vector<int>& lastUse, Places& places);
    Solving solving() const;
    void factorDiagonally(const FilteredMatrix& matrix);
    const CompactMatrix& m_matrix;  ///< for its pattern
    int m_size;
    std::vector<int> m_partStart;  ///< see CompactMatrix::partStarts
    /// Block k loses L_p D L_q^T for its pairs: p counted within the row, and where L_q D is kept.
    std::vector<int> m_pairStart, m_pairs;
    /// D^-1 of rows and L D of blocks are kept until the last row that needs them, and others take their places.
    std::vector<int> m_inversePlace, m_scaledPlace;
    std::vector<double> m_inverse, m_scaled;
    int m_mostInRow = 0;         ///< lower blocks
    std::vector<double> m_rows;  ///< scratch: one row of L for each strip
    std::vector<float> m_root;   ///< W, W^T W = D^-1
    std::vector<float> m_lower;  ///< L
    double m_shift = 0.0;
};

}  // namespace jacket
