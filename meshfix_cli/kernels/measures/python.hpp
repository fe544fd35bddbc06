// A star that Python gives by itself.
#pragma once

#include "arrays.hpp"
#include "mesh/star.hpp"

namespace meshfix {

// A star given by itself, in its local frame.
template <int D>
Star<D> make_star(const Matrix<const double>& neighbours, const Matrix<const std::uint16_t>& faces, const double* x) {
    Star<D> star;
    for (std::size_t j = 0; j < neighbours.shape(0); ++j) {
        star.neighbours.push_back(load<D>(neighbours.data() + j * D));
        star.radius = std::max(star.radius, std::sqrt(norm2(star.neighbours.back())));
    }
    star.faces = faces.data();
    star.faces_count = static_cast<int>(faces.shape(0));
    star.position = load<D>(x);
    star.fill_blocks();
    return star;
}

}  // namespace meshfix
