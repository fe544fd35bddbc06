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

// Calls f(s, edges, range of angles) for the simplices from `begin` to `end`, LANES at a time, by acos where it is exact.
template <int D, class F>
void for_each_angles(const double* points, const std::int32_t* simplices, std::int64_t begin, std::int64_t end,
                     const F& f) {
    constexpr double FAR_FROM_ONE = 0.95;
    for (std::int64_t s = begin; s < end; s += LANES) {
        std::array<Edges<D>, LANES> e;
        Edges<D, Pack> lanes;
        for (int i = 0; i < LANES; ++i) {
            e[i] = edges_of<D>(points, simplices + std::min(s + i, end - 1) * (D + 1));
            for (int k = 0; k < D; ++k)
                for (int x = 0; x < D; ++x) lanes[k][x][i] = e[i][k][x];
        }
        const auto c = cosines<D>(lanes);
        Pack largest = c[0], smallest = c[0], sum = constant<Pack>(0.0);
        for (const Pack& x : c) {
            largest = larger(largest, x);
            smallest = smaller(smallest, x);
            sum += x;  // NaN where one is
        }
        for (int i = 0; i < std::min<std::int64_t>(LANES, end - s); ++i) {
            const bool exact = largest[i] < FAR_FROM_ONE && smallest[i] > -FAR_FROM_ONE && sum[i] == sum[i];
            f(s + i, e[i], exact ? AngleRange{std::acos(largest[i]), std::acos(smallest[i])} : angles<D>(e[i]));
        }
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
    double min_measure = INFINITY;
};

// What a sweep needs to know: nothing of it depends on the threads.
template <int D>
Validity check(const double* points, const std::int32_t* simplices, std::int64_t m, int threads) {
    const auto look = [&](Validity& part, std::int64_t s, const Edges<D>& e) {
        const double det = determinant(e);
        if (!is_valid<D>(e, det, [&] { return corners_of<D>(points, simplices + s * (D + 1)); })) part.inverted.push_back(static_cast<std::int32_t>(s));
        part.min_measure = std::min(part.min_measure, det);
    };
    Validity total;
    for (const auto& part : for_each_simplex<Validity, D>(points, simplices, m, threads, look)) {
        total.inverted.insert(total.inverted.end(), part.inverted.begin(), part.inverted.end());
        total.min_measure = std::min(total.min_measure, part.min_measure);
    }
    total.min_measure /= factorial(D);
    return total;
}

// The smallest sine^2 of the valid simplices; 1: there are none.
template <int D>
double min_sine2(const double* points, const std::int32_t* simplices, std::int64_t m, int threads) {
    struct Smallest {
        double sine2 = 1.0;
    };
    const auto look = [&](Smallest& part, std::int64_t s, const Edges<D>& e) {
        double sine2 = min_sine2(e, true);
        if (!(sine2 > 0.0)) sine2 = barely_min_sine2<D>(corners_of<D>(points, simplices + s * (D + 1)), 0.0);
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
    std::vector<std::int32_t> inverted;   // simplices, ascending
    std::int64_t folded = 0;              // facets with both simplices on one side
    double min_measure = INFINITY, largest = 0.0;
};

// The histogram has `bins` bins of `width`.
template <int D>
Summary summarise(const double* points, const std::int32_t* simplices, const std::int32_t* mates, std::int64_t m,
                  int bins, double width, int threads) {
    Summary total;
    total.smallest.resize(m);
    std::vector<std::int8_t> sign(m);
    std::vector<Summary> parts(m / PER_ITEM + 1);
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        Summary part;
        part.histogram.resize(bins);
        for_each_angles<D>(points, simplices, begin, end, [&](std::int64_t s, const Edges<D>& e, AngleRange range) {
            const double det = determinant(e);
            if (!is_valid<D>(e, det, [&] { return corners_of<D>(points, simplices + s * (D + 1)); })) part.inverted.push_back(static_cast<std::int32_t>(s));
            part.min_measure = std::min(part.min_measure, det / factorial(D));
            sign[s] = static_cast<std::int8_t>((det > 0.0) - (det < 0.0));
            total.smallest[s] = range.smallest;
            part.sum += range.smallest;
            ++part.histogram[std::min(bins - 1, static_cast<int>(range.smallest / width))];
            part.largest = std::max(part.largest, range.largest);
        });
        parts[item] = std::move(part);
    });
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        std::int64_t folded = 0;
        for (std::int64_t c = begin * (D + 1); c < end * (D + 1); ++c)
            folded += mates[c] > c && sign[c / (D + 1)] * sign[mates[c] / (D + 1)] < 0;
        parts[item].folded = folded;
    });
    total.histogram.assign(bins, 0);
    for (const auto& part : parts) {
        for (std::size_t bin = 0; bin < part.histogram.size(); ++bin) total.histogram[bin] += part.histogram[bin];
        total.sum += part.sum;
        total.inverted.insert(total.inverted.end(), part.inverted.begin(), part.inverted.end());
        total.folded += part.folded;
        total.min_measure = std::min(total.min_measure, part.min_measure);
        total.largest = std::max(total.largest, part.largest);
    }
    return total;
}

}  // namespace meshfix
