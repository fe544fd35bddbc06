// Elements of a surface one by one in a plane: each in that of its own area, seen from the side of its normal, so that what
// is known of plane elements holds for it. One that is turned over has a negative area there.
#pragma once

#include <vector>

#include "common/parallel.hpp"
#include "measures/elements.hpp"

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

// The nodes (sum of nodes, 2), one element behind the other, the first of each at the origin. points (n, 3), normals
// (elements, 3), none of them zero.
inline std::vector<double> unfold(const double* points, const ElementsView& elements, const double* normals, int threads) {
    std::vector<double> flat(static_cast<std::size_t>(elements.offsets[elements.count]) * 2);
    for_each_range(elements.count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        std::array<Vec<3>, 4> nodes{};
        for (std::int64_t e = begin; e < end; ++e) {
            const int count = load_nodes<3>(points, elements, e, nodes);
            const Vec<3> normal = load<3>(normals + e * 3), area = area_vector(nodes, count);
            const double size2 = norm2(area);
            Vec<3> up = size2 > 0.0 ? (1.0 / std::sqrt(size2)) * area : normal;
            if (dot(up, normal) < 0.0) up = -1.0 * up;
            const Plane plane(up);
            for (int i = 0; i < count; ++i) {
                const Vec<2> x = plane.coordinates(nodes[i] - nodes[0]);
                std::copy(x.begin(), x.end(), flat.begin() + static_cast<std::int64_t>(elements.offsets[e] + i) * 2);
            }
        }
    });
    return flat;
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
