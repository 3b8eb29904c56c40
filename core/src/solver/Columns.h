#pragma once
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

namespace jacket {

/// Numbers of columns, of 16 bits each where a matrix is small enough: beside scalars they are a large part of what an
/// iteration reads.
class Columns {
  public:
    using Narrow = std::uint16_t;
    /// Empties the list, for a matrix of `size` columns; `count`: room for so many numbers.
    void begin(int size, std::size_t count) {
        m_isNarrow = size <= 1 << 16;
        m_narrow.clear();
        m_wide.clear();
        m_isNarrow ? m_narrow.reserve(count) : m_wide.reserve(count);
    }
    void push_back(int column) {
        m_isNarrow ? m_narrow.push_back(static_cast<Narrow>(column)) : m_wide.push_back(column);
    }
    int operator[](std::size_t k) const { return m_isNarrow ? m_narrow[k] : m_wide[k]; }
    bool isNarrow() const { return m_isNarrow; }

    /// All of them as plain memory: Narrow where they are, else int.
    template <class Column>
    const Column* data() const {
        if constexpr (std::is_same_v<Column, Narrow>)
            return m_narrow.data();
        else
            return m_wide.data();
    }
    /// visit(that memory)
    decltype(auto) visit(const auto& visit) const { return m_isNarrow ? visit(data<Narrow>()) : visit(data<int>()); }

  private:
    bool m_isNarrow = true;
    std::vector<Narrow> m_narrow;
    std::vector<int> m_wide;
};

}  // namespace jacket
