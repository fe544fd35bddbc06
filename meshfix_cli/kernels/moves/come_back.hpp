// Back towards where a vertex came from, as far as its star stays valid: each determinant is affine in its position, so
// the largest share of the way is the smallest of one quotient a face.
#pragma once

#include "mesh/star.hpp"

namespace meshfix {

// The share of the way from a valid position to `target` on which no determinant falls below `floor`, or below what it is.
template <int D>
double share_of_way(const Star<D>& star, const Vec<D>& target, double floor) {
    double share = 1.0;
    for (int i = 0; i < star.faces_count; ++i) {
        const double here = determinant(star.edges(i, star.position)), there = determinant(star.edges(i, target));
        const double least = std::min(here, floor);
        if (there < least) share = std::min(share, (here - least) / (here - there));
    }
    return share;
}

}  // namespace meshfix
