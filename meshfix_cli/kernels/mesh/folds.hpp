// Facets that lie upon one another with their insides on the same side, so that the elements inside of them overlap:
// segments of one line, triangles of one plane. Where a boundary folds back upon itself in a line or a plane, two of its
// facets do. The two sides of a slit, and parts in contact, have their insides on different sides.
#pragma once

#include <cmath>
#include <utility>

#include "mesh/crossings.hpp"

namespace meshfix {

// An oriented facet; inside on both sides: it is shared by two simplices.
template <int D>
struct Sided {
    std::array<Vec<D>, D> corners;
    bool both;
};

template <int D>
double largest_coordinate(const Sided<D>& facet) {
    double largest = 0.0;
    for (const auto& p : facet.corners)
        for (double x : p) largest = larger(largest, std::abs(x));
    return largest;
}

inline bool lie_upon_each_other(Sided<2> a, Sided<2> b) {
    Vec<2> along = a.corners[1] - a.corners[0], other = b.corners[1] - b.corners[0];
    if (!a.both && !b.both && !(dot(along, other) > 0.0)) return false;
    if (norm2(along) < norm2(other)) {
        std::swap(a, b);
        std::swap(along, other);
    }
    const double length = std::sqrt(norm2(along)), size = larger(largest_coordinate(a), largest_coordinate(b));
    std::array<double, 2> at;
    for (int k = 0; k < 2; ++k) {
        const Vec<2> to = b.corners[k] - a.corners[0];
        if (!(std::abs(cross(along, to)) <= IN_LINE * size * length)) return false;
        at[k] = dot(along, to) / length;
    }
    const double common = std::min(length, std::max(at[0], at[1])) - std::max(0.0, std::min(at[0], at[1]));
    return common > CROSSING * std::sqrt(norm2(other));
}

// Whether a line through an edge of a triangle has the other triangle beyond it, or touching it.
inline bool an_edge_separates(const std::array<Vec<2>, 3>& t, const std::array<Vec<2>, 3>& other) {
    const int inside = side<2>(t);
    for (int k = 0; k < 3; ++k) {
        bool is_beyond = true;
        for (const auto& p : other) is_beyond &= side<2>({t[k], t[(k + 1) % 3], p}) * inside <= 0;
        if (is_beyond) return true;
    }
    return false;
}

inline bool lie_upon_each_other(Sided<3> a, Sided<3> b) {
    const auto normal_of = [](const Sided<3>& t) {
        return cross(t.corners[1] - t.corners[0], t.corners[2] - t.corners[0]);
    };
    Vec<3> normal = normal_of(a), other = normal_of(b);
    if (!a.both && !b.both && !(dot(normal, other) > 0.0)) return false;
    if (norm2(normal) < norm2(other)) {
        std::swap(a, b);
        std::swap(normal, other);
    }
    const double height = IN_LINE * larger(largest_coordinate(a), largest_coordinate(b)) * std::sqrt(norm2(normal));
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

// Pairs of facets that lie upon each other, as `Crossings` finds what crosses; shared (f,): facets of two simplices.
template <int D>
std::vector<std::int32_t> find_folds(const double* points, const std::int32_t* facets, const std::uint8_t* shared,
                                     std::int64_t count, int threads) {
    const Crossings<D> tree(points, facets, count, threads);
    const auto sided = [&](std::int32_t facet) {
        Sided<D> one{{}, shared[facet] != 0};
        for (int k = 0; k < D; ++k) one.corners[k] = tree.vertex(facet, k);
        return one;
    };
    return tree.find(threads, [&](std::int32_t a, std::int32_t b) { return lie_upon_each_other(sided(a), sided(b)); });
}

}  // namespace meshfix
