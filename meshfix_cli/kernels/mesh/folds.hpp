// Facets that lie upon one another with their insides on the same side, so that the elements inside of them overlap:
// segments of one line, triangles of one plane. Where a boundary folds back upon itself in a line or a plane, two of its
// facets do. The two sides of a slit, and parts in contact, have their insides on different sides.
#pragma once

#include <cmath>
#include <utility>

#include "mesh/crossings.hpp"

namespace meshfix {

// An oriented facet, and what every facet near it asks of it.
template <int D>
struct Sided {
    std::array<Vec<D>, D> corners;
    bool both;           // its inside is on both sides: it is shared by two simplices
    Vec<D> direction{};  // along a segment, or normal to a triangle; as long as the segment, or twice the area
    double size2 = 0.0, largest = 0.0;  // square of that length; largest coordinate

    Sided(const std::array<Vec<D>, D>& at, bool is_shared) : corners(at), both(is_shared) {
        if constexpr (D == 2) {
            direction = at[1] - at[0];
        } else {
            direction = cross(at[1] - at[0], at[2] - at[0]);
        }
        size2 = norm2(direction);
        for (const auto& p : corners)
            for (double x : p) largest = larger(largest, std::abs(x));
    }
};

// Whether facets, of which the first is the larger one, have a place in common beyond their rims.
inline bool share_a_place(const Sided<2>& a, const Sided<2>& b) {
    const double length = std::sqrt(a.size2), size = larger(a.largest, b.largest);
    std::array<double, 2> at;
    for (int k = 0; k < 2; ++k) {
        const Vec<2> to = b.corners[k] - a.corners[0];
        if (!(std::abs(cross(a.direction, to)) <= IN_LINE * size * length)) return false;
        at[k] = dot(a.direction, to) / length;
    }
    const double common = std::min(length, std::max(at[0], at[1])) - std::max(0.0, std::min(at[0], at[1]));
    return common > CROSSING * std::sqrt(b.size2);
}

// Whether a line through an edge of a triangle has the other triangle beyond it, or touching it.
inline bool an_edge_separates(const std::array<Vec<2>, 3>& t, const std::array<Vec<2>, 3>& other) {
    const int inside = side<2>(t);
    for (int k = 0; k < 3; ++k) {
        const auto is_beyond = [&](const Vec<2>& p) { return side<2>({t[k], t[(k + 1) % 3], p}) * inside <= 0; };
        if (std::all_of(other.begin(), other.end(), is_beyond)) return true;
    }
    return false;
}

inline bool share_a_place(const Sided<3>& a, const Sided<3>& b) {
    const Vec<3>& normal = a.direction;
    const double height = IN_LINE * larger(a.largest, b.largest) * std::sqrt(a.size2);
    const double edges = std::sqrt(norm2(a.corners[1] - a.corners[0]) * norm2(a.corners[2] - a.corners[0]));
    for (const auto& p : b.corners) {
        const Vec<3> to = p - a.corners[0];
        const double rounding = 1e-15 * edges * std::sqrt(norm2(to));  // which a needle's normal has of itself
        if (!(std::abs(dot(normal, to)) + rounding <= height)) return false;
    }
    int axis = 0;
    for (int k = 1; k < 3; ++k)
        if (std::abs(normal[k]) > std::abs(normal[axis])) axis = k;
    const auto flat = [&](const Sided<3>& t) {
        std::array<Vec<2>, 3> seen;
        for (int k = 0; k < 3; ++k) seen[k] = {t.corners[k][(axis + 1) % 3], t.corners[k][(axis + 2) % 3]};
        return seen;
    };
    const auto one = flat(a), two = flat(b);
    return !an_edge_separates(one, two) && !an_edge_separates(two, one);
}

template <int D>
bool lie_upon_each_other(const Sided<D>& a, const Sided<D>& b) {
    if (!a.both && !b.both && !(dot(a.direction, b.direction) > 0.0)) return false;
    return a.size2 < b.size2 ? share_a_place(b, a) : share_a_place(a, b);
}

// Pairs of facets that lie upon each other, as `Crossings` finds what crosses; shared (f,): facets of two simplices.
// Triangles of one plane are seen along an axis: where their boxes only touch along another, an edge separates them.
template <int D>
std::vector<std::int32_t> find_folds(const Crossings<D>& tree, const std::uint8_t* shared, std::int64_t count, int threads) {
    std::vector<Sided<D>> sided;
    sided.reserve(count);
    for (std::int32_t facet = 0; facet < count; ++facet) {
        std::array<Vec<D>, D> corners;
        for (int k = 0; k < D; ++k) corners[k] = tree.vertex(facet, k);
        sided.emplace_back(corners, shared[facet] != 0);
    }
    const auto fold = [&](std::int32_t a, std::int32_t b) { return lie_upon_each_other(sided[a], sided[b]); };
    return tree.template find<D == 2 ? 0 : 2>(threads, fold);
}

}  // namespace meshfix
