// Facets that cross each other: segments in the plane, triangles in space. Only what is beyond doubt counts, so that
// facets which touch (a slit, parts in contact) do not.
//
// points (n, D), facets (f, D) vertex numbers
#pragma once

#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "common/parallel.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

// Sign of the determinant of the points; 0 where rounding, here or in a file, could have made it.
template <int D>
int side(const std::array<Vec<D>, D + 1>& p) {
    Edges<D> e;
    for (int k = 0; k < D; ++k) e[k] = p[k + 1] - p[0];
    const double det = determinant(e);
    const auto is_doubtful = [&](double longest2) {
        const double size2 = D == 2 ? longest2 * longest2 : longest2 * longest2 * longest2;
        return !(det * det > CROSSING * CROSSING * size2);
    };
    double longest2 = norm2(e[0]);
    for (int k = 1; k < D; ++k) longest2 = larger(longest2, norm2(e[k]));
    // The other edges are at most twice as long: only where that matters are they looked at.
    if (is_doubtful(longest2)) return 0;
    if (is_doubtful(4.0 * longest2) && is_doubtful(longest_edge2<D>(e))) return 0;
    return det > 0.0 ? 1 : -1;
}

inline bool cross_each_other(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d) {
    return side<2>({a, b, c}) * side<2>({a, b, d}) < 0 && side<2>({c, d, a}) * side<2>({c, d, b}) < 0;
}

// Whether the segment pq, whose ends are on both sides of the triangle's plane, goes through its inside.
inline bool pierces(const Vec<3>& p, const Vec<3>& q, const std::array<Vec<3>, 3>& t) {
    const int first = side<3>({p, q, t[0], t[1]});
    return first != 0 && first == side<3>({p, q, t[1], t[2]}) && first == side<3>({p, q, t[2], t[0]});
}

// A hierarchy of boxes over the facets, as a complete binary tree: node i has the children 2i+1 and 2i+2.
template <int D>
class Crossings {
   public:
    Crossings(const double* points, const std::int32_t* facets, std::int64_t count, int threads)
        : points_(points), facets_(facets), order_(count), leaves_(count) {
        std::iota(order_.begin(), order_.end(), 0);
        if (count == 0) return;
        std::size_t nodes = 1;
        for (std::int64_t size = count; size > LEAF; size = (size + 1) / 2) nodes = 2 * nodes + 1;
        boxes_.resize(nodes);
        split(0, 0, count, 0);
        for_each_item(static_cast<std::int64_t>(parts_.size()), threads, [&](std::int64_t i) {
            build(parts_[i].node, parts_[i].begin, parts_[i].end);
        });
        for (auto node = above_.rbegin(); node != above_.rend(); ++node) join(*node);
    }

    std::vector<std::int32_t> find(int threads) const {
        return find(threads, [&](std::int32_t a, std::int32_t b) { return cross(a, b); });
    }

    // Pairs of facets (a, b) whose boxes meet and for which `holds(a, b)`.
    template <class Holds>
    std::vector<std::int32_t> find(int threads, const Holds& holds) const {
        std::vector<std::vector<std::int32_t>> found(order_.size() / FACETS_PER_ITEM + 1);
        for_each_item(static_cast<std::int64_t>(found.size()), threads, [&](std::int64_t item) {
            const auto count = static_cast<std::int64_t>(order_.size());
            for (std::int64_t i = item * FACETS_PER_ITEM; i < std::min(count, (item + 1) * FACETS_PER_ITEM); ++i)
                search(0, 0, count, static_cast<std::int32_t>(i), box_of(static_cast<std::int32_t>(i)),
                       found[item].size() + 2 * CROSSINGS_PER_FACET, holds, found[item]);
        });
        std::vector<std::int32_t> pairs;
        for (const auto& part : found) pairs.insert(pairs.end(), part.begin(), part.end());
        return pairs;
    }

    Vec<D> vertex(std::int32_t facet, int k) const {
        return load<D>(points_ + static_cast<std::int64_t>(facets_[static_cast<std::int64_t>(facet) * D + k]) * D);
    }

    // In which part besides its own a place lies: one whose oriented facets close around it. -1: in none, or not in its own.
    std::int32_t enclosing(const Vec<D>& place, std::int32_t own, const std::int32_t* parts) const {
        std::vector<std::pair<std::int32_t, int>> turns;  // of each part that the ray meets
        if (!order_.empty()) count_turns(0, 0, static_cast<std::int64_t>(order_.size()), place, parts, turns);
        bool inside = false;
        std::int32_t other = -1;
        for (const auto& [part, turn] : turns) {
            inside |= part == own && turn != 0;
            if (part != own && turn != 0 && other < 0) other = part;
        }
        return inside ? other : -1;
    }

   private:
    struct Part {
        std::size_t node;
        std::int64_t begin, end;
    };

    struct Box {
        Vec<D> low, high;

        void add(const Vec<D>& p) {
            for (int k = 0; k < D; ++k) {
                low[k] = std::min(low[k], p[k]);
                high[k] = std::max(high[k], p[k]);
            }
        }
        void add(const Box& other) {
            add(other.low);
            add(other.high);
        }
        bool meets(const Box& other) const {
            bool meets = true;
            for (int k = 0; k < D; ++k) meets &= low[k] <= other.high[k] && other.low[k] <= high[k];
            return meets;
        }
    };

    // A ray that no axis, diagonal or plane of a lattice is parallel to.
    static constexpr std::array<double, 3> RAY{1.0, 0.003731934, 0.007392857};

    bool ray_meets(const Box& box, const Vec<D>& place) const {
        double near = 0.0, far = INFINITY;
        for (int k = 0; k < D; ++k) {
            near = std::max(near, (box.low[k] - place[k]) / RAY[k]);
            far = std::min(far, (box.high[k] - place[k]) / RAY[k]);
        }
        return near <= far * (1.0 + 1e-12);
    }

    // +1 or -1 where the ray leaves or enters through a facet.
    int turn_at(std::int32_t facet, const Vec<D>& place) const {
        Vec<D> ray;
        std::copy(RAY.begin(), RAY.begin() + D, ray.begin());
        std::array<Vec<D>, D> p;
        for (int k = 0; k < D; ++k) p[k] = vertex(facet, k) - place;
        if constexpr (D == 2) {
            const double first = meshfix::cross(ray, p[0]), second = meshfix::cross(ray, p[1]);
            if ((first > 0.0) == (second > 0.0)) return 0;
            const double ahead = meshfix::cross(p[0], p[1]);  // has the sign of second - first where the facet is ahead
            return (ahead > 0.0) == (second > 0.0) ? (second > 0.0 ? 1 : -1) : 0;
        } else {
            const double a = dot(ray, meshfix::cross(p[0], p[1])), b = dot(ray, meshfix::cross(p[1], p[2]));
            const double c = dot(ray, meshfix::cross(p[2], p[0]));
            if ((a > 0.0) != (b > 0.0) || (b > 0.0) != (c > 0.0)) return 0;
            const double ahead = dot(p[0], meshfix::cross(p[1], p[2]));
            return (ahead > 0.0) == (a > 0.0) ? (a > 0.0 ? 1 : -1) : 0;
        }
    }

    void count_turns(std::size_t node, std::int64_t begin, std::int64_t end, const Vec<D>& place, const std::int32_t* parts,
                     std::vector<std::pair<std::int32_t, int>>& turns) const {
        if (!ray_meets(boxes_[node], place)) return;
        if (end - begin > LEAF) {
            const std::int64_t middle = (begin + end) / 2;
            count_turns(2 * node + 1, begin, middle, place, parts, turns);
            count_turns(2 * node + 2, middle, end, place, parts, turns);
            return;
        }
        for (std::int64_t i = begin; i < end; ++i) {
            const int turn = ray_meets(leaves_[i], place) ? turn_at(order_[i], place) : 0;
            if (turn == 0) continue;
            const std::int32_t part = parts[order_[i]];
            const auto known = std::find_if(turns.begin(), turns.end(), [&](const auto& one) { return one.first == part; });
            if (known == turns.end()) {
                turns.push_back({part, turn});
            } else {
                known->second += turn;
            }
        }
    }

    static constexpr std::int64_t LEAF = 8, FACETS_PER_ITEM = 1024;
    static constexpr int PARTS_AT = 5;  // depth in the tree

    Box box_of(std::int32_t facet) const {
        Box box{vertex(facet, 0), vertex(facet, 0)};
        for (int k = 1; k < D; ++k) box.add(vertex(facet, k));
        return box;
    }

    // Cuts down to parts that are built by themselves.
    void split(std::size_t node, std::int64_t begin, std::int64_t end, int depth) {
        if (depth == PARTS_AT || end - begin <= LEAF) {
            parts_.push_back({node, begin, end});
            return;
        }
        above_.push_back(node);
        const std::int64_t middle = halve(begin, end);
        split(2 * node + 1, begin, middle, depth + 1);
        split(2 * node + 2, middle, end, depth + 1);
    }

    void build(std::size_t node, std::int64_t begin, std::int64_t end) {
        if (end - begin <= LEAF) {
            for (std::int64_t i = begin; i < end; ++i) leaves_[i] = box_of(order_[i]);
            boxes_[node] = leaves_[begin];
            for (std::int64_t i = begin + 1; i < end; ++i) boxes_[node].add(leaves_[i]);
            return;
        }
        const std::int64_t middle = halve(begin, end);
        build(2 * node + 1, begin, middle);
        build(2 * node + 2, middle, end);
        join(node);
    }

    void join(std::size_t node) {
        boxes_[node] = boxes_[2 * node + 1];
        boxes_[node].add(boxes_[2 * node + 2]);
    }

    // In two halves along the longest side of the box of the first vertices.
    std::int64_t halve(std::int64_t begin, std::int64_t end) {
        Box box{vertex(order_[begin], 0), vertex(order_[begin], 0)};
        for (std::int64_t i = begin; i < end; ++i) box.add(vertex(order_[i], 0));
        int axis = 0;
        for (int c = 1; c < D; ++c)
            if (box.high[c] - box.low[c] > box.high[axis] - box.low[axis]) axis = c;
        const std::int64_t middle = (begin + end) / 2;
        std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                         [&](std::int32_t a, std::int32_t b) {
                             const double p = vertex(a, 0)[axis], q = vertex(b, 0)[axis];
                             return p != q ? p < q : a < b;
                         });
        return middle;
    }

    // Appends pairs until there are `full` numbers.
    template <class Holds>
    void search(std::size_t node, std::int64_t begin, std::int64_t end, std::int32_t facet, const Box& box,
                std::size_t full, const Holds& holds, std::vector<std::int32_t>& found) const {
        if (found.size() >= full || !boxes_[node].meets(box)) return;
        if (end - begin > LEAF) {
            const std::int64_t middle = (begin + end) / 2;
            search(2 * node + 1, begin, middle, facet, box, full, holds, found);
            search(2 * node + 2, middle, end, facet, box, full, holds, found);
            return;
        }
        for (std::int64_t i = begin; i < end; ++i)
            if (order_[i] > facet && leaves_[i].meets(box) && holds(facet, order_[i]))
                found.insert(found.end(), {facet, order_[i]});
    }

    bool shares(std::int32_t facet, std::int32_t v) const {
        const std::int32_t* f = facets_ + static_cast<std::int64_t>(facet) * D;
        return std::find(f, f + D, v) != f + D;
    }

    bool cross(std::int32_t a, std::int32_t b) const {
        if constexpr (D == 2) {
            if (shares(b, facets_[a * 2]) || shares(b, facets_[a * 2 + 1])) return false;
            return cross_each_other(vertex(a, 0), vertex(a, 1), vertex(b, 0), vertex(b, 1));
        } else {
            int shared = 0;
            for (int k = 0; k < 3; ++k) shared += shares(b, facets_[a * 3 + k]);
            return shared < 2 && (any_edge_pierces(a, b) || any_edge_pierces(b, a));
        }
    }

    bool any_edge_pierces(std::int32_t a, std::int32_t b) const {
        const std::array<Vec<3>, 3> triangle{vertex(b, 0), vertex(b, 1), vertex(b, 2)};
        std::array<int, 3> sides;  // 0 for a vertex that the two share: its edges do not cross
        for (int k = 0; k < 3; ++k)
            sides[k] = shares(b, facets_[a * 3 + k]) ? 0 : side<3>({vertex(a, k), triangle[0], triangle[1], triangle[2]});
        for (int k = 0; k < 3; ++k) {
            const int next = (k + 1) % 3;
            if (sides[k] * sides[next] < 0 && pierces(vertex(a, k), vertex(a, next), triangle)) return true;
        }
        return false;
    }

    const double* points_;
    const std::int32_t* facets_;
    std::vector<std::int32_t> order_;
    std::vector<Part> parts_;         // of the tree, and the nodes above them, each before its children
    std::vector<std::size_t> above_;
    std::vector<Box> leaves_, boxes_;  // of the facets in `order_`, of the nodes
};

}  // namespace meshfix
