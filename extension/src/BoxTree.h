#pragma once
#include <vector>

#include "jacket/Types.h"

namespace jacket::bullet {

/// An axis-aligned box.
struct Bounds {
    Vec3 lower, upper;
    void include(const Bounds& other) {
        lower = lower.cwiseMin(other.lower);
        upper = upper.cwiseMax(other.upper);
    }
    bool overlaps(const Bounds& other) const {
        return (lower.array() <= other.upper.array()).all() && (other.lower.array() <= upper.array()).all();
    }
    bool contains(const Bounds& other) const {
        return (lower.array() <= other.lower.array()).all() && (other.upper.array() <= upper.array()).all();
    }
    double squaredDistance(const Vec3& p) const { return (p - p.cwiseMax(lower).cwiseMin(upper)).squaredNorm(); }
    /// How far it reaches along a direction.
    double farthestAlong(const Vec3& n) const { return n.cwiseProduct((n.array() < 0).select(lower, upper)).sum(); }
};

/// A tree of boxes over boxes, to find those near something.
class BoxTree {
  public:
    BoxTree() = default;  ///< over nothing
    explicit BoxTree(const std::vector<Bounds>& items);

    /// Calls visit(item) for the items below every node for which isNear(bounds) holds.
    template <class IsNear, class Visit>
    void visit(const IsNear& isNear, const Visit& visit) const {
        if (!m_nodes.empty()) descend(0, isNear, visit);
    }

    /// The same for nodes nearer to p than radius, nearest first; visit may shrink the radius.
    template <class Visit>
    void visitNearest(const Vec3& p, const double& radius, const Visit& visit) const {
        if (!m_nodes.empty()) descendNearest(0, p, radius, visit);
    }

  private:
    struct Node {
        Bounds bounds;
        int first, count;  // items of a leaf
        int child;         // of two that follow each other; 0 for a leaf
    };
    void split(int node, const std::vector<Bounds>& items);

    template <class IsNear, class Visit>
    void descend(int index, const IsNear& isNear, const Visit& visit) const {
        const Node& node = m_nodes[index];
        if (!isNear(node.bounds)) return;
        if (node.child == 0) {
            for (int i = 0; i < node.count; ++i) visit(m_order[node.first + i]);
            return;
        }
        descend(node.child, isNear, visit);
        descend(node.child + 1, isNear, visit);
    }

    template <class Visit>
    void descendNearest(int index, const Vec3& p, const double& radius, const Visit& visit) const {
        const Node& node = m_nodes[index];
        if (node.bounds.squaredDistance(p) > radius * radius) return;
        if (node.child == 0) {
            for (int i = 0; i < node.count; ++i) visit(m_order[node.first + i]);
            return;
        }
        const bool swapped =
            m_nodes[node.child + 1].bounds.squaredDistance(p) < m_nodes[node.child].bounds.squaredDistance(p);
        descendNearest(node.child + swapped, p, radius, visit);
        descendNearest(node.child + !swapped, p, radius, visit);
    }

    std::vector<Node> m_nodes;
    std::vector<int> m_order;
};

}  // namespace jacket::bullet
