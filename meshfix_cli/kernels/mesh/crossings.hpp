// Facets that cross each other: segments in the plane, triangles in space. Only what is beyond doubt counts, so that
// facets which touch (a slit, parts in contact) do not.
//
// points (n, D), facets (f, D) vertex numbers
#pragma once

#include <cstdint>
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
        : points_(points), facets_(facets), order_(count) {
        if (count == 0) return;
        std::size_t nodes = 1;
        for (std::int64_t size = count; size > LEAF; size = (size + 1) / 2) nodes = 2 * nodes + 1;
        boxes_.resize(nodes);
        for (int k = 0; k < D; ++k) {
            low_[k].resize(count + LANES);
            high_[k].resize(count + LANES);
        }
        std::vector<Item> items(count);
        for (std::int32_t i = 0; i < count; ++i) items[i] = {vertex(i, 0), i};
        split(items, {0, 0, count}, 0);
        for_each_item(static_cast<std::int64_t>(parts_.size()), threads, [&](std::int64_t i) { build(items, parts_[i]); });
        for (auto node = above_.rbegin(); node != above_.rend(); ++node) join(*node);
    }

    // Pairs of facets that cross. Those whose boxes only touch along an axis do not: a plane is between them.
    std::vector<std::int32_t> find(int threads) const {
        return find<D>(threads, [&](std::int32_t a, std::int32_t b) {
            return shared_by(a, b) < D - 1 && cross(corners_of(a), corners_of(b));
        });
    }

    // Pairs of facets (a, b) for which `holds(a, b)` and whose boxes meet, along at least AXES axes beyond touching.
    template <int AXES, class Holds>
    std::vector<std::int32_t> find(int threads, const Holds& holds) const {
        std::vector<std::vector<std::int32_t>> found(parts_.size());
        for_each_item(static_cast<std::int64_t>(parts_.size()), threads, [&](std::int64_t item) {
            std::vector<Part> near;
            std::vector<std::int32_t> pairs;
            for_each_leaf(parts_[item], [&](const Part& leaf) {
                near.clear();
                find_leaves<AXES>({0, 0, static_cast<std::int64_t>(order_.size())}, boxes_[leaf.node], near);
                for (std::int64_t i = leaf.begin; i < leaf.end; ++i) search<AXES>(near, i, holds, pairs);
            });
            found[item] = std::move(pairs);
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

    // A facet and its first vertex.
    struct Item {
        Vec<D> at;
        std::int32_t facet;
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

        // As the boxes of pairs must, and so those of the nodes above them.
        template <int AXES>
        bool meets(const Box& other) const {
            bool meets = true;
            int overlaps = 0;
            for (int k = 0; k < D; ++k) {
                meets &= (low[k] <= other.high[k]) & (other.low[k] <= high[k]);
                overlaps += (low[k] < other.high[k]) & (other.low[k] < high[k]);
            }
            return meets & (overlaps >= AXES);
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
            const int turn = ray_meets(box_at(i), place) ? turn_at(order_[i], place) : 0;
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

    static constexpr std::int64_t LEAF = 8;
    static constexpr int PARTS_AT = 5;  // depth in the tree

    Box box_of(std::int32_t facet) const {
        Box box{vertex(facet, 0), vertex(facet, 0)};
        for (int k = 1; k < D; ++k) box.add(vertex(facet, k));
        return box;
    }

    // That of a facet by its place in the order.
    Box box_at(std::int64_t i) const {
        Box box;
        for (int k = 0; k < D; ++k) {
            box.low[k] = low_[k][i];
            box.high[k] = high_[k][i];
        }
        return box;
    }

    // Which of the facets at LANES places from one on have boxes that meet another so.
    template <int AXES>
    PackMask meet_at(std::int64_t i, const Box& box) const {
        PackMask meet = constant<Pack>(box.high[0]) >= load_pack(&low_[0][i]);
        Pack overlaps = constant<Pack>(0.0);
        for (int k = 0; k < D; ++k) {
            const Pack low = load_pack(&low_[k][i]), high = load_pack(&high_[k][i]);
            const Pack bottom = constant<Pack>(box.low[k]), top = constant<Pack>(box.high[k]);
            meet = meet & (top >= low) & (high >= bottom);
            overlaps += select((top > low) & (high > bottom), constant<Pack>(1.0), constant<Pack>(0.0));
        }
        return meet & (overlaps >= constant<Pack>(AXES));
    }

    // Cuts down to parts that are built by themselves.
    void split(std::vector<Item>& items, const Part& part, int depth) {
        if (depth == PARTS_AT || part.end - part.begin <= LEAF) return parts_.push_back(part);
        above_.push_back(part.node);
        halve(items, part);
        split(items, first_half(part), depth + 1);
        split(items, second_half(part), depth + 1);
    }

    void build(std::vector<Item>& items, const Part& part) {
        if (part.end - part.begin <= LEAF) {
            for (std::int64_t i = part.begin; i < part.end; ++i) {
                order_[i] = items[i].facet;
                const Box box = box_of(order_[i]);
                for (int k = 0; k < D; ++k) {
                    low_[k][i] = box.low[k];
                    high_[k][i] = box.high[k];
                }
            }
            boxes_[part.node] = box_at(part.begin);
            for (std::int64_t i = part.begin + 1; i < part.end; ++i) boxes_[part.node].add(box_at(i));
            return;
        }
        halve(items, part);
        build(items, first_half(part));
        build(items, second_half(part));
        join(part.node);
    }

    void join(std::size_t node) {
        boxes_[node] = boxes_[2 * node + 1];
        boxes_[node].add(boxes_[2 * node + 2]);
    }

    // Puts them in two halves along the longest side of the box of their first vertices.
    void halve(std::vector<Item>& items, const Part& part) {
        Box box{items[part.begin].at, items[part.begin].at};
        for (std::int64_t i = part.begin; i < part.end; ++i) box.add(items[i].at);
        int axis = 0;
        for (int c = 1; c < D; ++c)
            if (box.high[c] - box.low[c] > box.high[axis] - box.low[axis]) axis = c;
        const auto first = items.begin();
        std::nth_element(first + part.begin, first + first_half(part).end, first + part.end,
                         [axis](const Item& a, const Item& b) {
                             return a.at[axis] != b.at[axis] ? a.at[axis] < b.at[axis] : a.facet < b.facet;
                         });
    }

    template <class F>
    void for_each_leaf(const Part& part, const F& f) const {
        if (part.end - part.begin <= LEAF) return f(part);
        for_each_leaf(first_half(part), f);
        for_each_leaf(second_half(part), f);
    }

    // Appends the leaves whose boxes meet another so.
    template <int AXES>
    void find_leaves(const Part& part, const Box& box, std::vector<Part>& leaves) const {
        if (!boxes_[part.node].template meets<AXES>(box)) return;
        if (part.end - part.begin <= LEAF) return leaves.push_back(part);
        find_leaves<AXES>(first_half(part), box, leaves);
        find_leaves<AXES>(second_half(part), box, leaves);
    }

    static Part first_half(const Part& part) { return {2 * part.node + 1, part.begin, (part.begin + part.end) / 2}; }
    static Part second_half(const Part& part) { return {2 * part.node + 2, (part.begin + part.end) / 2, part.end}; }

    // Appends the first pairs of a facet, by its place in the order, with those behind it by number that lie in some leaves.
    template <int AXES, class Holds>
    void search(const std::vector<Part>& near, std::int64_t at, const Holds& holds, std::vector<std::int32_t>& found) const {
        const std::int32_t facet = order_[at];
        const Box box = box_at(at);
        const std::size_t full = found.size() + 2 * CROSSINGS_PER_FACET;
        std::array<std::int32_t, LEAF> others;
        for (const Part& leaf : near) {
            if (found.size() >= full) return;
            if (!boxes_[leaf.node].template meets<AXES>(box)) continue;
            int count = 0;
            for (std::int64_t i = leaf.begin; i < leaf.end; i += LANES) {
                const PackMask meet = meet_at<AXES>(i, box);
                const int lanes = static_cast<int>(std::min<std::int64_t>(LANES, leaf.end - i));
                for (int lane = 0; lane < lanes; ++lane) {  // without branches, which nobody could foresee
                    others[count] = order_[i + lane];
                    count += (meet[lane] != 0) & (order_[i + lane] > facet);
                }
            }
            for (int k = 0; k < count; ++k)
                if (holds(facet, others[k])) found.insert(found.end(), {facet, others[k]});
        }
    }

    struct Facet {
        std::array<std::int32_t, D> vertices;
        std::array<Vec<D>, D> at;

        bool has(std::int32_t v) const {
            bool found = vertices[0] == v;
            for (int k = 1; k < D; ++k) found |= vertices[k] == v;
            return found;
        }
    };

    Facet corners_of(std::int32_t facet) const {
        Facet corners;
        for (int k = 0; k < D; ++k) {
            corners.vertices[k] = facets_[static_cast<std::int64_t>(facet) * D + k];
            corners.at[k] = vertex(facet, k);
        }
        return corners;
    }

    // How many vertices two facets have in common; those that have an edge, or in the plane a vertex, do not cross.
    int shared_by(std::int32_t a, std::int32_t b) const {
        const std::int32_t *one = facets_ + static_cast<std::int64_t>(a) * D, *other = facets_ + static_cast<std::int64_t>(b) * D;
        int shared = 0;
        for (int k = 0; k < D; ++k)
            for (int l = 0; l < D; ++l) shared += one[k] == other[l];
        return shared;
    }

    static bool cross(const Facet& a, const Facet& b) {
        if constexpr (D == 2) {
            return cross_each_other(a.at[0], a.at[1], b.at[0], b.at[1]);
        } else {
            const Sides first = sides(a, b);
            return !first.one && (any_edge_pierces(a, first, b) || any_edge_pierces(b, sides(b, a), a));
        }
    }

    // On which sides of a triangle the vertices of another are, 0 for one that they share: its edges do not cross.
    struct Sides {
        std::array<int, 3> of{};
        bool one = true;  // all but that one are on one side beyond doubt
    };

    static Sides sides(const Facet& a, const Facet& b) {
        Sides result;
        int known = 0;
        for (int k = 0; k < 3; ++k) {
            if (b.has(a.vertices[k])) continue;
            result.of[k] = side<3>({a.at[k], b.at[0], b.at[1], b.at[2]});
            result.one &= result.of[k] != 0 && known * result.of[k] >= 0;
            known = result.of[k];
        }
        return result;
    }

    static bool any_edge_pierces(const Facet& a, const Sides& sides, const Facet& b) {
        for (int k = 0; k < 3; ++k) {
            const int next = (k + 1) % 3;
            if (sides.of[k] * sides.of[next] < 0 && pierces(a.at[k], a.at[next], b.at)) return true;
        }
        return false;
    }

    const double* points_;
    const std::int32_t* facets_;
    std::vector<std::int32_t> order_;
    std::vector<Part> parts_;         // of the tree, and the nodes above them, each before its children
    std::vector<std::size_t> above_;
    std::array<std::vector<double>, D> low_, high_;  // of the boxes of the facets in `order_`, and LANES numbers more
    std::vector<Box> boxes_;                         // of the nodes
};

}  // namespace meshfix
