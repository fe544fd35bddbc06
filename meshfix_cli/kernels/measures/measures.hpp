// Passes over the whole mesh: signed measure, validity and extreme angles of every simplex.
//
// points (n, D), simplices (m, D+1) positively oriented. Angles are unsigned, in radians: planar angles in 2-D,
// dihedral angles in 3-D; a simplex with an edge or triangle of size zero counts as 0 and pi.
#pragma once

#include <cstdint>
#include <vector>

#include "common/parallel.hpp"
#include "measures/angles.hpp"
#include "measures/sines.hpp"

namespace meshfix {

template <int D>
Edges<D> edges_of(const double* points, const std::int32_t* simplex) {
    const Vec<D> first = load<D>(points + static_cast<std::int64_t>(simplex[0]) * D);
    Edges<D> e;
    for (int k = 0; k < D; ++k) e[k] = load<D>(points + static_cast<std::int64_t>(simplex[k + 1]) * D) - first;
    return e;
}

template <int D>
Corners<D> corners_of(const double* points, const std::int32_t* simplex) {
    Corners<D> p;
    for (int k = 0; k <= D; ++k) p[k] = load<D>(points + static_cast<std::int64_t>(simplex[k]) * D);
    return p;
}

// The edges of LANES simplices from the s-th on; behind the end, those of the last once more.
template <int D>
[[gnu::always_inline]] inline Edges<D, Pack> lanes_of(const double* points, const std::int32_t* simplices, std::int64_t s, std::int64_t end) {
    std::array<const std::int32_t*, LANES> rows;
    for (int i = 0; i < LANES; ++i) rows[i] = simplices + std::min(s + i, end - 1) * (D + 1);
    const auto corner = [&](int k) {
        Vec<D, Pack> p;
        std::array<const double*, LANES> from;
        for (int i = 0; i < LANES; ++i) from[i] = points + static_cast<std::int64_t>(rows[i][k]) * D;
        for (int x = 0; x < D; ++x) p[x] = gathered([&](int i) { return from[i][x]; });
        return p;
    };
    const Vec<D, Pack> first = corner(0);
    Edges<D, Pack> e;
    for (int k = 0; k < D; ++k) e[k] = corner(k + 1) - first;
    return e;
}

// The smallest and the largest cosine of LANES simplices, and for which of them acos of these is exact.
template <int D>
struct CosineRange {
    static constexpr double FAR_FROM_ONE = 0.95;
    Pack smallest, largest, sum = constant<Pack>(0.0);

    explicit CosineRange(const Edges<D, Pack>& e) {
        const auto c = cosines<D>(e);
        smallest = largest = c[0];
        for (const Pack& x : c) {
            largest = larger(largest, x);
            smallest = smaller(smallest, x);
            sum += x;  // NaN where one is
        }
    }
    bool is_exact(int i) const {
        return largest[i] < FAR_FROM_ONE && smallest[i] > -FAR_FROM_ONE && sum[i] == sum[i];
    }
};

// Calls f(s, range of angles) for the simplices from `begin` to `end`, LANES at a time, by acos where it is exact.
template <int D, class F>
void for_each_angles(const double* points, const std::int32_t* simplices, std::int64_t begin, std::int64_t end,
                     const F& f) {
    for (std::int64_t s = begin; s < end; s += LANES) {
        const CosineRange<D> c(lanes_of<D>(points, simplices, s, end));
        for (int i = 0; i < std::min<std::int64_t>(LANES, end - s); ++i)
            f(s + i, c.is_exact(i) ? AngleRange{std::acos(c.largest[i]), std::acos(c.smallest[i])}
                                   : angles<D>(edges_of<D>(points, simplices + (s + i) * (D + 1))));
    }
}

// Calls f(part, s, edges) for every simplex; returns the parts, one for each item. An item has its part to itself until
// it is done: threads that write side by side in memory wait for one another.
template <class Part, int D, class F>
std::vector<Part> for_each_simplex(const double* points, const std::int32_t* simplices, std::int64_t m, int threads,
                                   const F& f) {
    std::vector<Part> parts(m / PER_ITEM + 1);
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        Part part;
        for (std::int64_t s = begin; s < end; ++s) f(part, s, edges_of<D>(points, simplices + s * (D + 1)));
        parts[item] = std::move(part);
    });
    return parts;
}

struct Validity {
    std::vector<std::int32_t> inverted;  // simplices, ascending
    double min_measure = INFINITY;       // d! times that, while it is looked for
};

// Looks at LANES simplices from the s-th on, as far as `end`. Most are valid and none is the smallest so far: that is
// seen of all of them at once.
template <int D>
[[gnu::always_inline]] inline void look_at(Validity& found, const double* points, const std::int32_t* simplices, std::int64_t s, std::int64_t end,
             const Edges<D, Pack>& e, Pack det) {
    const auto plain = is_valid_at_a_glance<D>(e, det);
    if (all(plain & (det >= constant<Pack>(found.min_measure)))) return;
    for (int i = 0; i < std::min<std::int64_t>(LANES, end - s); ++i) {
        found.min_measure = std::min(found.min_measure, double(det[i]));
        if (plain[i]) continue;
        const std::int32_t* simplex = simplices + (s + i) * (D + 1);
        const auto corners = [&] { return corners_of<D>(points, simplex); };
        if (!is_valid<D>(edges_of<D>(points, simplex), det[i], corners)) found.inverted.push_back(static_cast<std::int32_t>(s + i));
    }
}

// Adds what the next item of a pass has found.
inline void add(Validity& total, const Validity& part) {
    total.inverted.insert(total.inverted.end(), part.inverted.begin(), part.inverted.end());
    total.min_measure = std::min(total.min_measure, part.min_measure);
}

// What a sweep needs to know: nothing of it depends on the threads.
template <int D>
Validity check(const double* points, const std::int32_t* simplices, std::int64_t m, int threads) {
    std::vector<Validity> parts(m / PER_ITEM + 1);
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        Validity part;
        for (std::int64_t s = begin; s < end; s += LANES) {
            const Edges<D, Pack> e = lanes_of<D>(points, simplices, s, end);
            look_at<D>(part, points, simplices, s, end, e, determinant(e));
        }
        parts[item] = std::move(part);
    });
    Validity total;
    for (const auto& part : parts) add(total, part);
    total.min_measure /= factorial(D);
    return total;
}

// The smallest sine^2 of simplex s with edges e; not positive: it is not valid.
template <int D>
double sine2_of(const double* points, const std::int32_t* simplices, std::int64_t s, const Edges<D>& e) {
    const double sine2 = min_sine2(e, true);
    return sine2 > 0.0 ? sine2 : barely_min_sine2<D>(corners_of<D>(points, simplices + s * (D + 1)), 0.0);
}

// The simplices, ascending, of which that is below some value.
template <int D>
std::vector<std::int32_t> below(const double* points, const std::int32_t* simplices, std::int64_t m, double least,
                                int threads) {
    using Rows = std::vector<std::int32_t>;
    const auto look = [&](Rows& part, std::int64_t s, const Edges<D>& e) {
        if (!(sine2_of<D>(points, simplices, s, e) >= least)) part.push_back(static_cast<std::int32_t>(s));
    };
    Rows rows;
    for (const Rows& part : for_each_simplex<Rows, D>(points, simplices, m, threads, look))
        rows.insert(rows.end(), part.begin(), part.end());
    return rows;
}

// The smallest of the valid simplices; 1: there are none.
template <int D>
double min_sine2(const double* points, const std::int32_t* simplices, std::int64_t m, int threads) {
    struct Smallest {
        double sine2 = 1.0;
    };
    const auto look = [&](Smallest& part, std::int64_t s, const Edges<D>& e) {
        const double sine2 = sine2_of<D>(points, simplices, s, e);
        if (sine2 > 0.0) part.sine2 = std::min(part.sine2, sine2);
    };
    double smallest = 1.0;
    for (const Smallest& part : for_each_simplex<Smallest, D>(points, simplices, m, threads, look))
        smallest = std::min(smallest, part.sine2);
    return smallest;
}

// What a report needs to know. Angles in radians.
struct Summary {
    std::vector<double> smallest;         // (m,) the smallest angle of each simplex
    std::vector<std::int64_t> histogram;  // of these
    double sum = 0.0;                     // of these
    Validity validity{};
    std::int64_t folded = 0;              // facets with both simplices on one side
    double largest = 0.0;
};

// How many facets from `begin` to `end` have a simplex of negative measure on one side, and one of positive on the other.
template <int D>
std::int64_t folded_facets(const std::vector<std::int8_t>& sign, const std::int32_t* mates, std::int64_t begin,
                           std::int64_t end) {
    std::int64_t folded = 0;
    for (std::int64_t s = begin; s < end; ++s) {
        if (sign[s] >= 0) continue;
        for (std::int64_t c = s * (D + 1); c < (s + 1) * (D + 1); ++c) folded += mates[c] >= 0 && sign[mates[c] / (D + 1)] > 0;
    }
    return folded;
}

// The histogram has `bins` bins of `width`.
template <int D>
Summary summarise(const double* points, const std::int32_t* simplices, const std::int32_t* mates, std::int64_t m,
                  int bins, double width, int threads) {
    constexpr double ROUNDING = 1e-15;  // of acos: cosines this near each other may be of the same angle, or exchange theirs
    Summary total;
    total.smallest.resize(m);
    std::vector<std::int8_t> sign(m);
    std::vector<Summary> parts(m / PER_ITEM + 1);
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        Summary part;
        part.histogram.resize(bins);
        double least_cosine = 1.0;
        for (std::int64_t s = begin; s < end; s += LANES) {
            const Edges<D, Pack> e = lanes_of<D>(points, simplices, s, end);
            const Pack det = determinant(e);
            const CosineRange<D> c(e);
            look_at<D>(part.validity, points, simplices, s, end, e, det);
            for (int i = 0; i < std::min<std::int64_t>(LANES, end - s); ++i) {
                double smallest = 0.0;
                if (c.is_exact(i)) {
                    smallest = std::acos(c.largest[i]);
                    if (c.smallest[i] < least_cosine + ROUNDING) {
                        part.largest = std::max(part.largest, std::acos(c.smallest[i]));
                        least_cosine = std::min(least_cosine, c.smallest[i]);
                    }
                } else {
                    const AngleRange range = angles<D>(edges_of<D>(points, simplices + (s + i) * (D + 1)));
                    smallest = range.smallest;
                    part.largest = std::max(part.largest, range.largest);
                }
                sign[s + i] = static_cast<std::int8_t>((det[i] > 0.0) - (det[i] < 0.0));
                total.smallest[s + i] = smallest;
                part.sum += smallest;
                ++part.histogram[std::min(bins - 1, static_cast<int>(smallest / width))];
            }
        }
        parts[item] = std::move(part);
    });
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        parts[item].folded = mates == nullptr ? 0 : folded_facets<D>(sign, mates, begin, end);
    });
    total.histogram.assign(bins, 0);
    for (const auto& part : parts) {
        for (std::size_t bin = 0; bin < part.histogram.size(); ++bin) total.histogram[bin] += part.histogram[bin];
        total.sum += part.sum;
        add(total.validity, part.validity);
        total.folded += part.folded;
        total.largest = std::max(total.largest, part.largest);
    }
    total.validity.min_measure /= factorial(D);
    return total;
}

}  // namespace meshfix
