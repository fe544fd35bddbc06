// Passes over many vectors of D coordinates, each with the sums in the order in which numpy has them.
#pragma once

#include <cstdint>
#include <vector>

#include "common/vec.hpp"

namespace meshfix {

// Of length 1; what has no length becomes zero.
template <std::size_t D>
std::array<double, D> unit(const std::array<double, D>& v) {
    const double length = std::sqrt(norm2(v));
    std::array<double, D> result{};
    if (length > 0.0)
        for (std::size_t k = 0; k < D; ++k) result[k] = v[k] / length;
    return result;
}

template <int D>
std::vector<double> unit_vectors(const double* vectors, std::int64_t count) {
    std::vector<double> found(static_cast<std::size_t>(count) * D);
    for (std::int64_t i = 0; i < count; ++i) {
        const Vec<D> one = unit(load<D>(vectors + i * D));
        std::copy(one.begin(), one.end(), found.begin() + i * D);
    }
    return found;
}

// The sums (groups, D) of vectors, of rows (count), by their groups (count); rows null: one behind the other.
template <int D>
std::vector<double> summed(const std::int32_t* group, const double* vectors, const std::int32_t* rows, std::int64_t count,
                           std::int64_t groups) {
    std::vector<double> sums(static_cast<std::size_t>(groups) * D);
    for (std::int64_t i = 0; i < count; ++i) {
        const double* one = vectors + (rows == nullptr ? i : rows[i]) * static_cast<std::int64_t>(D);
        double* sum = sums.data() + static_cast<std::int64_t>(group[i]) * D;
        for (int k = 0; k < D; ++k) sum[k] += one[k];
    }
    return sums;
}

// The dot products of pairs (count, 2) of vectors.
template <int D>
std::vector<double> dots(const double* vectors, const std::int32_t* pairs, std::int64_t count) {
    std::vector<double> found(static_cast<std::size_t>(count));
    for (std::int64_t i = 0; i < count; ++i)
        found[i] = dot(load<D>(vectors + static_cast<std::int64_t>(pairs[2 * i]) * D),
                       load<D>(vectors + static_cast<std::int64_t>(pairs[2 * i + 1]) * D));
    return found;
}

// The sine of the angle between two vectors taken as lines; 0 where one has no length.
inline double length_across(const Vec<2>& a, const Vec<2>& b) { return std::fabs(cross(a, b)); }
inline double length_across(const Vec<3>& a, const Vec<3>& b) { return std::sqrt(norm2(cross(a, b))); }

template <int D>
std::vector<double> sines(const double* vectors, const std::int32_t* pairs, std::int64_t count) {
    std::vector<double> found(static_cast<std::size_t>(count));
    for (std::int64_t i = 0; i < count; ++i) {
        const Vec<D> a = load<D>(vectors + static_cast<std::int64_t>(pairs[2 * i]) * D);
        const Vec<D> b = load<D>(vectors + static_cast<std::int64_t>(pairs[2 * i + 1]) * D);
        const double product = std::sqrt(norm2(a)) * std::sqrt(norm2(b));
        if (product > 0.0) found[i] = length_across(a, b) / product;
    }
    return found;
}

}  // namespace meshfix
