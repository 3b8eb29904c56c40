#pragma once
#include <cstddef>
#include <vector>

namespace jacket {

/// Room for one more. Of large elements that come by the thousand a list grows by a quarter: doubled, it would soon be
/// twice what is needed, and three times that while it grows.
template <class T>
void makeRoom(std::vector<T>& list) {
    if (list.size() == list.capacity()) list.reserve(list.size() + list.size() / 4 + 16);
}

/// Room for so many and a few more in an empty list.
template <class T>
void makeRoomFor(std::size_t count, std::vector<T>& empty) {
    if (count <= empty.capacity()) return;
    empty = std::vector<T>();  // gives its memory back first
    empty.reserve(count + count / 8 + 16);
}

}  // namespace jacket
