#include "BoxTree.h"

#include <algorithm>
#include <numeric>

namespace jacket::bullet {

BoxTree::BoxTree(const std::vector<Bounds>& items) : m_order(items.size()) {
    std::iota(m_order.begin(), m_order.end(), 0);
    if (items.empty()) return;
    m_nodes.reserve(items.size());
    m_nodes.push_back({items[0], 0, int(items.size()), 0});
    split(0, items);
}

void BoxTree::split(int index, const std::vector<Bounds>& items) {
    const int first = m_nodes[index].first, count = m_nodes[index].count;
    for (int i = 0; i < count; ++i) m_nodes[index].bounds.include(items[m_order[first + i]]);
    if (count <= 4) return;
    int axis = 0;
    (m_nodes[index].bounds.upper - m_nodes[index].bounds.lower).maxCoeff(&axis);
    const auto middle = [&](int item) { return items[item].lower[axis] + items[item].upper[axis]; };
    const auto begin = m_order.begin() + first;
    std::nth_element(begin, begin + count / 2, begin + count, [&](int a, int b) { return middle(a) < middle(b); });
    const int child = int(m_nodes.size());
    m_nodes[index].child = child;
    m_nodes.push_back({items[m_order[first]], first, count / 2, 0});
    m_nodes.push_back({items[m_order[first + count / 2]], first + count / 2, count - count / 2, 0});
    split(child, items);
    split(child + 1, items);
}

}  // namespace jacket::bullet
