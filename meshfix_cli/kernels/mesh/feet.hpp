// Of many points, each on its shape of a reference: the places there that are nearest, and the directions.
#pragma once

#include <vector>

#include "common/parallel.hpp"
#include "mesh/reference.hpp"

namespace meshfix {

// Points (count, D) and their shapes (count); pieces `near` from which searches begin, or null.
struct OnShapes {
    const double* points;
    const std::int32_t* shapes;
    std::int64_t count;
    const std::int32_t* near;
};

// Calls look(i, foot).
template <int D, class F>
void for_each_foot(const Reference& reference, const OnShapes& on, int threads, const F& look) {
    for_each_range(on.count, 1024, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t i = begin; i < end; ++i)
            look(i, reference.foot<D>(on.shapes[i], load<D>(on.points + i * D), on.near == nullptr ? Reference::ANY : on.near[i], true));
    });
}

// The nearest positions (count, D), and the distances (count) from the pieces themselves.
template <int D>
void find_nearest(const Reference& reference, const OnShapes& on, int threads, double* there, double* distances) {
    for_each_foot<D>(reference, on, threads, [&](std::int64_t i, const Foot<D>& foot) {
        const Vec<D> x = reference.rounded<D>(on.shapes[i], foot);
        std::copy(x.begin(), x.end(), there + i * D);
        distances[i] = std::sqrt(foot.distance2);
    });
}

// The directions of the shapes there (count, D, D): of each the first rows, orthonormal; others are 0.
template <int D>
void find_axes(const Reference& reference, const OnShapes& on, int threads, double* found) {
    for_each_foot<D>(reference, on, threads, [&](std::int64_t i, const Foot<D>& foot) {
        const Edges<D> axes = reference.axes<D>(on.shapes[i], foot);
        for (int k = 0; k < D; ++k) std::copy(axes[k].begin(), axes[k].end(), found + (i * D + k) * D);
    });
}

}  // namespace meshfix
