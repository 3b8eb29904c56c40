#include "solver/FilteredMatrix.h"

#include "Room.h"

namespace jacket {

void FilteredMatrix::begin(const BlockMatrix& matrix, bool isDiagonal) {
    m_matrix = &matrix;
    m_hasLower = !isDiagonal && !matrix.lower().empty();
    m_diagonalPlace.assign(matrix.diagonal().size(), -1);
    m_lowerPlace.assign(m_hasLower ? matrix.lower().size() : 0, -1);
    m_altered.clear();
}

Mat3& FilteredMatrix::alter(int& place, const Mat3& block) {
    if (place >= 0) return m_altered[place];
    makeRoom(m_altered);
    place = static_cast<int>(m_altered.size());
    m_altered.push_back(block);
    return m_altered.back();
}

}  // namespace jacket
