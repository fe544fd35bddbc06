// Elements of a surface one by one in a plane: each in that of its own area, seen from the side of its normal, so that what
// is known of plane elements holds for it. One that is turned over has a negative area there.
#pragma once

#include <vector>

#include "common/parallel.hpp"
#include "measures/elements.hpp"
#include "measures/measures.hpp"

namespace meshfix {

// Where a point of space lies in a plane.
struct Plane {
    Vec<3> along, across;

    // Perpendicular to a vector, and seen from its end.
    explicit Plane(const Vec<3>& normal) {
        int least = 0;
        for (int k = 1; k < 3; ++k)
            if (std::fabs(normal[k]) < std::fabs(normal[least])) least = k;
        Vec<3> axis{};
        axis[least] = 1.0;
        along = cross(axis, normal);
        along = (1.0 / std::sqrt(norm2(along))) * along;
        across = cross(normal, along);
        across = (1.0 / std::sqrt(norm2(across))) * across;
    }
    Plane(const Vec<3>& first, const Vec<3>& second) : along(first), across(second) {}

    Vec<2> coordinates(const Vec<3>& p) const { return {dot(along, p), dot(across, p)}; }
    Vec<3> position(const Vec<2>& x) const { return x[0] * along + x[1] * across; }
};

// Twice the area of a triangle or quadrilateral as a vector.
inline Vec<3> area_vector(const std::array<Vec<3>, 4>& p, int nodes) {
    return nodes == 3 ? cross(p[1] - p[0], p[2] - p[0]) : cross(p[2] - p[0], p[3] - p[1]);
}

// LANES triangles from the e-th on, as `unfold_one` has them.
inline void unfold_triangles(const double* points, const std::int32_t* nodes, const double* normals, double* flat) {
    const Pack zero = constant<Pack>(0.0), one = constant<Pack>(1.0);
    std::array<Vec<3, Pack>, 3> p;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            p[i][k] = gathered([&](int lane) { return points[static_cast<std::int64_t>(nodes[3 * lane + i]) * 3 + k]; });
    Vec<3, Pack> normal;
    for (int k = 0; k < 3; ++k) normal[k] = gathered([&](int lane) { return normals[3 * lane + k]; });
    const std::array<Vec<3, Pack>, 3> to{p[0] - p[0], p[1] - p[0], p[2] - p[0]};
    const Vec<3, Pack> area = cross(to[1], to[2]);
    const Pack size2 = norm2(area);
    const Vec<3, Pack> scaled = (one / square_root(size2)) * area;
    Vec<3, Pack> up, size;
    for (int k = 0; k < 3; ++k) up[k] = select(size2 > zero, scaled[k], normal[k]);
    const PackMask turned = dot(up, normal) < zero;
    for (int k = 0; k < 3; ++k) up[k] = select(turned, -one * up[k], up[k]);
    for (int k = 0; k < 3; ++k) size[k] = select(up[k] < zero, -up[k], up[k]);
    const PackMask second = size[1] < size[0], third = size[2] < smaller(size[1], size[0]);
    const Vec<3, Pack> axis{select(third, zero, select(second, zero, one)), select(third, zero, select(second, one, zero)),
                            select(third, one, zero)};
    Vec<3, Pack> along = cross(axis, up);
    along = (one / square_root(norm2(along))) * along;
    Vec<3, Pack> across = cross(up, along);
    across = (one / square_root(norm2(across))) * across;
    for (int i = 0; i < 3; ++i) {
        const Pack x = dot(along, to[i]), y = dot(across, to[i]);
        for (int lane = 0; lane < LANES; ++lane) {
            flat[6 * lane + 2 * i] = x[lane];
            flat[6 * lane + 2 * i + 1] = y[lane];
        }
    }
}

inline void unfold_one(const double* points, const ElementsView& elements, const double* normals, std::int64_t e, double* flat) {
    std::array<Vec<3>, 4> nodes{};
    const int count = load_nodes<3>(points, elements, e, nodes);
    const Vec<3> normal = load<3>(normals + e * 3), area = area_vector(nodes, count);
    const double size2 = norm2(area);
    Vec<3> up = size2 > 0.0 ? (1.0 / std::sqrt(size2)) * area : normal;
    if (dot(up, normal) < 0.0) up = -1.0 * up;
    const Plane plane(up);
    for (int i = 0; i < count; ++i) {
        const Vec<2> x = plane.coordinates(nodes[i] - nodes[0]);
        std::copy(x.begin(), x.end(), flat + 2 * i);
    }
}

// Elements from `begin` to `end`: their nodes, one element behind the other, the first of each at the origin.
inline void unfold_range(const double* points, const ElementsView& elements, const double* normals, std::int64_t begin,
                         std::int64_t end, double* flat) {
    const auto first = [&](std::int64_t e) { return elements.offsets[e] - elements.offsets[begin]; };
    std::int64_t e = begin;
    while (e < end) {
        if (e + LANES <= end && first(e + LANES) - first(e) == 3 * LANES) {  // none has fewer
            unfold_triangles(points, elements.nodes + elements.offsets[e], normals + e * 3, flat + 2 * static_cast<std::int64_t>(first(e)));
            e += LANES;
        } else {
            unfold_one(points, elements, normals, e, flat + 2 * static_cast<std::int64_t>(first(e)));
            ++e;
        }
    }
}

// The nodes (sum of nodes, 2) of all. points (n, 3), normals (elements, 3), none of them zero.
inline std::vector<double> unfold(const double* points, const ElementsView& elements, const double* normals, int threads) {
    std::vector<double> flat(static_cast<std::size_t>(elements.offsets[elements.count]) * 2);
    for_each_range(elements.count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        unfold_range(points, elements, normals, begin, end, flat.data() + 2 * static_cast<std::int64_t>(elements.offsets[begin]));
    });
    return flat;
}

// What `check` finds of triangles that are unfolded: only those that a quick look in space does not tell to be valid are.
inline Validity check_unfolded(const double* points, const ElementsView& triangles, const double* normals, int threads) {
    std::vector<Validity> parts(triangles.count / PER_ITEM + 1);
    for_each_range(triangles.count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        Validity part;
        Pack least = constant<Pack>(INFINITY);  // the square of twice the smallest area, with its sign
        for (std::int64_t t = begin; t < end; t += LANES) {
            std::array<std::int64_t, LANES> rows;
            for (int i = 0; i < LANES; ++i) rows[i] = std::min(t + i, end - 1);
            const auto corner = [&](int k) {
                std::array<const double*, LANES> from;
                for (int i = 0; i < LANES; ++i) from[i] = points + static_cast<std::int64_t>(triangles.nodes[3 * rows[i] + k]) * 3;
                Vec<3, Pack> p;
                for (int x = 0; x < 3; ++x) p[x] = gathered([&](int i) { return from[i][x]; });
                return p;
            };
            const Vec<3, Pack> first = corner(0), a = corner(1) - first, b = corner(2) - first, area = cross(a, b);
            Vec<3, Pack> normal;
            for (int x = 0; x < 3; ++x) normal[x] = gathered([&](int i) { return normals[3 * rows[i] + x]; });
            const Pack area2 = norm2(area), zero = constant<Pack>(0.0);
            const Pack signed2 = select(dot(area, normal) < zero, -area2, area2);
            const Pack longest2 = constant<Pack>(4.0 * VALID) * larger(norm2(a), norm2(b));
            const PackMask plain = (signed2 > zero) & (area2 > longest2 * longest2);
            least = smaller(least, signed2);
            if (all(plain)) continue;
            for (int i = 0; i < LANES && t + i < end; ++i) {
                if (plain[i]) continue;
                std::array<double, 6> flat;
                unfold_one(points, triangles, normals, t + i, flat.data());
                const std::array<std::int32_t, 3> numbers{0, 1, 2};
                const Edges<2> e = edges_of<2>(flat.data(), numbers.data());
                if (!is_valid<2>(e, determinant(e), [&] { return corners_of<2>(flat.data(), numbers.data()); }))
                    part.inverted.push_back(static_cast<std::int32_t>(t + i));
            }
        }
        for (int i = 0; i < LANES; ++i) part.min_measure = std::min<double>(part.min_measure, least[i]);
        part.min_measure = std::copysign(std::sqrt(std::fabs(part.min_measure)), part.min_measure);
        parts[item] = std::move(part);
    });
    Validity total;
    for (const Validity& part : parts) add(total, part);
    total.min_measure /= factorial(2);
    return total;
}

// The area of each element (count, 3) as a vector, in the units of points.
inline std::vector<double> area_vectors(const double* points, const ElementsView& elements, int threads) {
    std::vector<double> areas(static_cast<std::size_t>(elements.count) * 3);
    for_each_range(elements.count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        std::array<Vec<3>, 4> nodes{};
        for (std::int64_t e = begin; e < end; ++e) {
            const int count = load_nodes<3>(points, elements, e, nodes);
            const Vec<3> area = 0.5 * area_vector(nodes, count);
            std::copy(area.begin(), area.end(), areas.begin() + e * 3);
        }
    });
    return areas;
}

}  // namespace meshfix
