// Laplacian and smart Laplacian smoothing, section 3.1.
#pragma once

#include "sines.hpp"

namespace meshfix {

// The geometric centre of the neighbours, whatever becomes of the simplices.
template <int D>
Vec<D> laplacian(const StarsView& stars, const double* points, std::int64_t v) {
    return centroid<D>(stars, points, v);
}

// The same only where it raises the smallest sine of the star. `quality`, in and out: min_sine2 at the position.
template <int D>
Vec<D> smart_laplacian(const Star<D>& star, double& quality) {
    const Vec<D> centre{};  // the origin of the local frame, which the global coordinates hold exactly
    const double moved = min_sine2<D>(star, centre, quality);
    if (!(moved > quality)) return star.position;
    quality = moved;
    return centre;
}

}  // namespace meshfix
