// Passes over the whole mesh: signed measure, validity and extreme angles of every simplex.
//
// points (n, D), simplices (m, D+1) positively oriented. Angles are unsigned, in radians: planar angles in 2-D,
// dihedral angles in 3-D; a simplex with an edge or triangle of size zero counts as 0 and pi.
#pragma once

#include <cstdint>
#include <vector>

#include "parallel.hpp"
#include "sines.hpp"

namespace meshfix {

template <int D>
Edges<D> edges_of(const double* points, const std::int32_t* simplex) {
    const Vec<D> first = load<D>(points + static_cast<std::int64_t>(simplex[0]) * D);
    Edges<D> e;
    for (int k = 0; k < D; ++k) e[k] = load<D>(points + static_cast<std::int64_t>(simplex[k + 1]) * D) - first;
    return e;
}

// The extreme cosines with their sines: acos alone loses half the digits near 0 and 180 degrees.
struct ExtremeAngles {
    double largest_cosine = -2.0, sine_there = 0.0, smallest_cosine = 2.0, sine_here = 0.0;

    void add(double cosine, double sine) {
        if (cosine > largest_cosine) largest_cosine = cosine, sine_there = sine;
        if (cosine < smallest_cosine) smallest_cosine = cosine, sine_here = sine;
    }
    double smallest() const { return std::atan2(sine_there, largest_cosine); }
    double largest() const { return std::atan2(sine_here, smallest_cosine); }
    bool wider_than(const ExtremeAngles& other) const {
        return smallest_cosine != other.smallest_cosine ? smallest_cosine < other.smallest_cosine
                                                        : sine_here < other.sine_here;
    }
};

// Those of a simplex that has an edge or triangle of size zero.
inline ExtremeAngles no_angles() { return {1.0, 0.0, -1.0, 0.0}; }

inline ExtremeAngles angles(const Edges<2>& e) {
    const std::array<Vec<2>, 3> sides{e[0], e[1] - e[0], Vec<2>{} - e[1]};
    const double area = std::fabs(determinant(e));
    ExtremeAngles extreme;
    for (int i = 0; i < 3; ++i) {
        const Vec<2>&p = sides[i], &q = sides[(i + 2) % 3];
        const double product = std::sqrt(norm2(p)) * std::sqrt(norm2(q));
        if (!(product > 0.0)) return no_angles();
        extreme.add(-dot(p, q) / product, area / product);
    }
    return extreme;
}

inline ExtremeAngles angles(const Edges<3>& e) {
    const Vec<3>&A = e[0], &B = e[1], &C = e[2];
    // Outward normals of the faces opposite the vertices 0 to 3, or all inward.
    const std::array<Vec<3>, 4> normals{cross(B - A, C - A), cross(C, B), cross(A, C), cross(B, A)};
    const double volume = std::fabs(determinant(e));
    std::array<double, 4> lengths;
    for (int i = 0; i < 4; ++i) {
        lengths[i] = std::sqrt(norm2(normals[i]));
        if (!(lengths[i] > 0.0)) return no_angles();
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
    return extreme;
}

// Calls f(s, edges) for every simplex.
template <int D, class F>
void for_each_simplex(const double* points, const std::int32_t* simplices, std::int64_t m, int threads, const F& f) {
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t s = begin; s < end; ++s) f(s, edges_of<D>(points, simplices + s * (D + 1)));
    });
}

struct Validity {
    std::vector<std::int32_t> inverted;  // simplices, ascending
    double min_measure = INFINITY;
};

// What a sweep needs to know: nothing of it depends on the threads.
template <int D>
Validity check(const double* points, const std::int32_t* simplices, std::int64_t m, int threads) {
    std::vector<Validity> parts(m / PER_ITEM + 1);
    for_each_simplex<D>(points, simplices, m, threads, [&](std::int64_t s, const Edges<D>& e) {
        Validity& part = parts[s / PER_ITEM];
        const double det = determinant(e);
        if (!is_valid<D>(det, longest_edge2<D>(e))) part.inverted.push_back(static_cast<std::int32_t>(s));
        part.min_measure = std::min(part.min_measure, det);
    });
    Validity total;
    for (const auto& part : parts) {
        total.inverted.insert(total.inverted.end(), part.inverted.begin(), part.inverted.end());
        total.min_measure = std::min(total.min_measure, part.min_measure);
    }
    total.min_measure /= factorial(D);
    return total;
}

// The smallest sign(det) * sine^2 of all simplices, -1 where one is not valid.
template <int D>
double min_sine2(const double* points, const std::int32_t* simplices, std::int64_t m, int threads) {
    std::vector<double> parts(m / PER_ITEM + 1, 1.0);
    for_each_simplex<D>(points, simplices, m, threads, [&](std::int64_t s, const Edges<D>& e) {
        const double sine2 = min_sine2(e);
        if (!(sine2 >= parts[s / PER_ITEM])) parts[s / PER_ITEM] = sine2 > 0.0 ? sine2 : -1.0;
    });
    return *std::min_element(parts.begin(), parts.end());
}

// What a report needs to know. Angles in radians.
struct Summary {
    std::vector<double> smallest;        // (m,) the smallest angle of each simplex
    std::vector<std::int32_t> inverted;  // simplices, ascending
    std::int64_t folded = 0;             // facets with both simplices on one side
    double min_measure = INFINITY, largest = 0.0;
};

template <int D>
Summary summarise(const double* points, const std::int32_t* simplices, const std::int32_t* mates, std::int64_t m,
                  int threads) {
    struct Part {
        std::vector<std::int32_t> inverted;
        std::int64_t folded = 0;
        double min_det = INFINITY;
        ExtremeAngles widest;
    };
    Summary total;
    total.smallest.resize(m);
    std::vector<std::int8_t> sign(m);
    std::vector<Part> parts(m / PER_ITEM + 1);
    for_each_simplex<D>(points, simplices, m, threads, [&](std::int64_t s, const Edges<D>& e) {
        Part& part = parts[s / PER_ITEM];
        const double det = determinant(e);
        if (!is_valid<D>(det, longest_edge2<D>(e))) part.inverted.push_back(static_cast<std::int32_t>(s));
        part.min_det = std::min(part.min_det, det);
        sign[s] = static_cast<std::int8_t>((det > 0.0) - (det < 0.0));
        const ExtremeAngles extreme = angles(e);
        total.smallest[s] = extreme.smallest();
        if (extreme.wider_than(part.widest)) part.widest = extreme;
    });
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        for (std::int64_t c = begin * (D + 1); c < end * (D + 1); ++c)
            parts[item].folded += mates[c] > c && sign[c / (D + 1)] * sign[mates[c] / (D + 1)] < 0;
    });
    ExtremeAngles widest;
    for (const auto& part : parts) {
        total.inverted.insert(total.inverted.end(), part.inverted.begin(), part.inverted.end());
        total.folded += part.folded;
        total.min_measure = std::min(total.min_measure, part.min_det);
        if (part.widest.wider_than(widest)) widest = part.widest;
    }
    total.min_measure /= factorial(D);
    total.largest = widest.largest();
    return total;
}

}  // namespace meshfix
