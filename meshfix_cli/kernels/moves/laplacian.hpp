// Smart Laplacian smoothing, section 3.1; the plain one is `centroid` of star.hpp.
#pragma once

#include "measures/sines.hpp"

namespace meshfix {

// To the geometric centre of the neighbours, only where that raises the smallest sine of the star. `quality`, in and
// out: min_sine2 at the position.
template <int D>
Vec<D> smart_laplacian(const Star<D>& star, double& quality) {
    const double moved = min_sine2<D>(star, star.centre, quality);  // the global coordinates hold it exactly
    if (!(moved > quality)) return star.position;
    quality = moved;
    return star.centre;
}

}  // namespace meshfix
