// Smart Laplacian smoothing, section 3.1; the plain one is `centroid` of star.hpp.
#pragma once

#include "measures/sines.hpp"

namespace meshfix {

// To the geometric centre of the neighbours, only where that raises the smallest sine of the star. `quality`, in and
// out: min_sine2 at the position.
template <int D>
Vec<D> smart_laplacian(const Star<D>& star, double& quality) {
    const Vec<D> centre{};  // the origin of the local frame, which the global coordinates hold exactly
    const double moved = min_sine2<D>(star, centre, quality);
    if (!(moved > quality)) return star.position;
    quality = moved;
    return centre;
}

}  // namespace meshfix
