// Passes over the whole mesh: signed measure, validity and extreme angles of every simplex.
//
// points (n, D), simplices (m, D+1) positively oriented. Angles are unsigned, in radians: planar angles in 2-D,
// dihedral angles in 3-D; a simplex with an edge or triangle of size zero counts as 0 and pi.
#pragma once

#include <cstdint>
#include <vector>

#include "parallel.hpp"
#include "simplex.hpp"

namespace meshfix {

constexpr std::int64_t SIMPLICES_PER_ITEM = 16384;

template <int D>
Edges<D> edges_of(const double* points, const std::int32_t* simplex) {
    const Vec<D> first = load<D>(points + static_cast<std::int64_t>(simplex[0]) * D);
    Edges<D> e;
    for (int k = 0; k < D; ++k) e[k] = load<D>(points + static_cast<std::int64_t>(simplex[k + 1]) * D) - first;
    return e;
}

struct AngleRange {
    double smallest, largest;
};

// From the extreme cosines, with atan2 of sine and cosine: acos loses half the digits near 0 and 180 degrees.
struct ExtremeAngles {
    double largest_cosine = -2.0, sine_there = 0.0, smallest_cosine = 2.0, sine_here = 0.0;

    void add(double cosine, double sine) {
        if (cosine > largest_cosine) largest_cosine = cosine, sine_there = sine;
        if (cosine < smallest_cosine) smallest_cosine = cosine, sine_here = sine;
    }
    AngleRange range() const {
        return {std::atan2(sine_there, largest_cosine), std::atan2(sine_here, smallest_cosine)};
    }
};

inline AngleRange angles(const Edges<2>& e) {
    const std::array<Vec<2>, 3> sides{e[0], e[1] - e[0], Vec<2>{} - e[1]};
    const double area = std::fabs(determinant(e));
    ExtremeAngles extreme;
    for (int i = 0; i < 3; ++i) {
        const Vec<2>&p = sides[i], &q = sides[(i + 2) % 3];
        const double product = std::sqrt(norm2(p)) * std::sqrt(norm2(q));
        if (!(product > 0.0)) return {0.0, std::acos(-1.0)};
        extreme.add(-dot(p, q) / product, area / product);
    }
    return extreme.range();
}

inline AngleRange angles(const Edges<3>& e) {
    const Vec<3>&A = e[0], &B = e[1], &C = e[2];
    // Outward normals of the faces opposite the vertices 0 to 3, or all inward.
    const std::array<Vec<3>, 4> normals{cross(B - A, C - A), cross(C, B), cross(A, C), cross(B, A)};
    const double volume = std::fabs(determinant(e));
    std::array<double, 4> lengths;
    for (int i = 0; i < 4; ++i) {
        lengths[i] = std::sqrt(norm2(normals[i]));
        if (!(lengths[i] > 0.0)) return {0.0, std::acos(-1.0)};
    }
    // The edge between the faces opposite i and j joins the two other vertices.
    ExtremeAngles extreme;
    const auto add = [&](int i, int j, const Vec<3>& edge) {
        const double product = lengths[i] * lengths[j];
        extreme.add(-dot(normals[i], normals[j]) / product, volume * std::sqrt(norm2(edge)) / product);
    };
    add(0, 1, C - B);
    add(0, 2, C - A);
    add(0, 3, B - A);
    add(1, 2, C);
    add(1, 3, B);
    add(2, 3, A);
    return extreme.range();
}

// Calls f(s, edges) for every simplex.
template <int D, class F>
void for_each_simplex(const double* points, const std::int32_t* simplices, std::int64_t m, int threads, const F& f) {
    for_each_item((m + SIMPLICES_PER_ITEM - 1) / SIMPLICES_PER_ITEM, threads, [&](std::int64_t item) {
        const std::int64_t end = std::min(m, (item + 1) * SIMPLICES_PER_ITEM);
        for (std::int64_t s = item * SIMPLICES_PER_ITEM; s < end; ++s) f(s, edges_of<D>(points, simplices + s * (D + 1)));
    });
}

struct Validity {
    std::int64_t inverted = 0;
    double min_measure = INFINITY;
};

// What a sweep needs to know: only counts and minima, so the bits do not depend on the threads.
template <int D>
Validity check(const double* points, const std::int32_t* simplices, std::int64_t m, int threads) {
    std::vector<Validity> parts(m / SIMPLICES_PER_ITEM + 1);
    for_each_simplex<D>(points, simplices, m, threads, [&](std::int64_t s, const Edges<D>& e) {
        Validity& part = parts[s / SIMPLICES_PER_ITEM];
        const double det = determinant(e);
        part.inverted += !is_valid<D>(det, longest_edge2<D>(e));
        part.min_measure = std::min(part.min_measure, det);
    });
    Validity total;
    for (const auto& part : parts) {
        total.inverted += part.inverted;
        total.min_measure = std::min(total.min_measure, part.min_measure);
    }
    total.min_measure /= factorial(D);
    return total;
}

}  // namespace meshfix
