// Smoothing of the mean: steepest ascent for the sum of the smallest angles of a star's simplices, of which none that is
// below a floor gets smaller and none that is above it falls below.
//
// In place of an angle t stands sin t - cos t, which grows nearly as t does, where 15 < t < 75 degrees.
#pragma once

#include <vector>

#include "measures/angles.hpp"
#include "measures/sines.hpp"

namespace meshfix {

// w . dn, as the derivative by x of w . n, the normal of face k: the edges e leave x, and face 0 does not move.
inline Vec<2> pulled_back(const Edges<2>&, int k, const Vec<2>& w) {
    if (k == 0) return {};
    return k == 1 ? Vec<2>{-w[1], w[0]} : Vec<2>{w[1], -w[0]};
}
inline Vec<3> pulled_back(const Edges<3>& e, int k, const Vec<3>& w) {
    if (k == 0) return {};
    const int next = k % 3, last = (k + 1) % 3;  // of the edges, after the one to the vertex opposite the face
    return cross(e[last] - e[next], w);
}

// The gradient by x of the largest cosine of a simplex, whose value is `cosine`.
template <int D>
Vec<D> slope_of_largest_cosine(const Edges<D>& e, double& cosine) {
    const auto c = cosines<D>(e);
    const auto k = static_cast<std::size_t>(std::max_element(c.begin(), c.end()) - c.begin());
    cosine = c[k];
    const auto [i, j] = FACES_AT<D>[k];
    const auto n = normals(e);
    const double length_i = std::sqrt(norm2(n[i])), length_j = std::sqrt(norm2(n[j]));
    const Vec<D> u = (1.0 / length_i) * n[i], v = (1.0 / length_j) * n[j];
    return pulled_back(e, i, (-1.0 / length_i) * (v + cosine * u)) +
           pulled_back(e, j, (-1.0 / length_j) * (u + cosine * v));
}

template <int D>
struct MeanAngle {
    std::vector<Pack> allowed;  // the largest cosine that each simplex may have

    // The sum at x; -infinity where a simplex has a larger cosine than it may.
    double at(const Star<D>& star, const Vec<D>& x) const {
        LaneSum sum;
        for (std::size_t b = 0; b < star.blocks.size(); ++b) {
            const Pack cosine = largest_cosine(star, b, x);
            for (int i = 0; i < LANES; ++i)
                if (!(cosine[i] <= allowed[b][i])) return -INFINITY;
            sum.add(b, star.weights(b) * angle(cosine));
        }
        return sum.total();
    }

    // From a valid position to one of a larger sum; `floor` and `quality` as for the mean ratio.
    template <class F>
    Vec<D> improve(const Star<D>& star, double quality, double floor, const F& reachable) {
        const Vec<D> start = star.position;
        const double floor_cosine = std::sqrt(std::max(0.0, 1.0 - floor));
        const double least = std::min(quality, floor) * (1.0 - SAME_SINE2);
        allowed.resize(star.blocks.size());
        for (std::size_t b = 0; b < star.blocks.size(); ++b)
            allowed[b] = larger(largest_cosine(star, b, start), constant<Pack>(floor_cosine));
        const double value = at(star, start);
        const Vec<D> up = slope(star, start);
        double step = ASCENT_STEP * star.radius / std::sqrt(norm2(up));
        for (int trial = 0; trial < ASCENT_TRIALS && step < INFINITY; ++trial, step *= 0.5) {
            const Vec<D> x = reachable(start + step * up);
            if (at(star, x) > value && min_sine2<D>(star, x, least) > 0.0) return x;
        }
        return start;
    }

    // Of the sum at x: a subgradient, where two angles of a simplex are its smallest.
    static Vec<D> slope(const Star<D>& star, const Vec<D>& x) {
        Vec<D> sum{};
        for (int i = 0; i < star.faces_count; ++i) {
            double cosine = 0.0;
            const Vec<D> rising = slope_of_largest_cosine<D>(star.edges(i, x), cosine);
            const double sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
            if (sine > 0.0) sum = sum - (cosine / sine + 1.0) * rising;
        }
        return sum;
    }

   private:
    static Pack largest_cosine(const Star<D>& star, std::size_t block, const Vec<D>& x) {
        const auto c = cosines<D>(star.edges(star.blocks[block], x));
        Pack largest = c[0];
        for (const Pack& other : c) largest = larger(largest, other);
        return largest;
    }
    static Pack angle(Pack cosine) {
        return square_root(larger(constant<Pack>(0.0), constant<Pack>(1.0) - cosine * cosine)) - cosine;
    }
};

}  // namespace meshfix
