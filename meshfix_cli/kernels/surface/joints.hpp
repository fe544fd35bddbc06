// Where facets in space meet, and the normals of those that go on in each other around a vertex.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/counting.hpp"
#include "surface/vectors.hpp"

namespace meshfix {

// Facets (count, width) of three or four vertices, -1: no fourth; their corners are numbered one facet behind the other.
struct FacetsView {
    const std::int32_t* rows;
    std::int64_t count;
    int width;

    const std::int32_t* operator[](std::int64_t f) const { return rows + f * width; }
    int corners(std::int64_t f) const { return width == 4 && (*this)[f][3] < 0 ? 3 : width; }
};

// The sides of facets, from the smaller vertex to the larger one, and the edges that these and lines are.
struct Joints {
    std::vector<std::int32_t> ends{};    // (sides, 2): the corners at their ends
    std::vector<std::int32_t> owners{};  // (sides): their facets
    std::vector<std::int32_t> edges{};   // (edges, 2), ascending
    std::vector<std::int32_t> order{};   // (sides): edge by edge
    std::vector<std::int64_t> count{};   // (edges): how many sides each has
    std::vector<std::uint8_t> is_line{};

    Joints(const FacetsView& facets, const std::int32_t* lines, std::int64_t line_count, std::int64_t vertices) {
        std::size_t sides = 0;
        for (std::int64_t f = 0; f < facets.count; ++f) sides += facets.corners(f);
        std::vector<std::int32_t> pairs(2 * sides);  // of sides, then of lines
        ends.resize(2 * sides);
        owners.resize(sides);
        std::int32_t corner = 0;
        for (std::int64_t f = 0; f < facets.count; ++f) {
            const int corners = facets.corners(f);
            for (int i = 0; i < corners; ++i) {
                const int after = i + 1 < corners ? i + 1 : 0;
                const bool turned = facets[f][i] > facets[f][after];
                const std::size_t side = static_cast<std::size_t>(corner) + i;
                pairs[2 * side + turned] = facets[f][i];
                pairs[2 * side + !turned] = facets[f][after];
                ends[2 * side + turned] = corner + i;
                ends[2 * side + !turned] = corner + after;
                owners[side] = static_cast<std::int32_t>(f);
            }
            corner += corners;
        }
        for (std::int64_t i = 0; i < line_count; ++i)
            pairs.insert(pairs.end(), {std::min(lines[2 * i], lines[2 * i + 1]), std::max(lines[2 * i], lines[2 * i + 1])});
        number(pairs, vertices);
    }

   private:
    void number(const std::vector<std::int32_t>& pairs, std::int64_t vertices) {
        std::vector<std::int32_t> offsets;
        std::vector<std::int32_t> all = counted_order(static_cast<std::int64_t>(pairs.size() / 2), vertices, offsets,
                                                      [&](std::int64_t i) { return pairs[2 * i]; });
        const auto sides = static_cast<std::int32_t>(owners.size());
        order.reserve(owners.size());
        edges.reserve(pairs.size());
        count.reserve(pairs.size() / 2);
        is_line.reserve(pairs.size() / 2);
        for (std::int64_t v = 0; v < vertices; ++v) {
            std::sort(all.begin() + offsets[v], all.begin() + offsets[v + 1], [&](std::int32_t a, std::int32_t b) {
                return pairs[2 * a + 1] != pairs[2 * b + 1] ? pairs[2 * a + 1] < pairs[2 * b + 1] : a < b;
            });
            for (std::int32_t i = offsets[v]; i < offsets[v + 1]; ++i) {
                const std::int32_t one = all[i], other = pairs[2 * one + 1];
                if (i == offsets[v] || other != edges.back()) {
                    edges.insert(edges.end(), {static_cast<std::int32_t>(v), other});
                    count.push_back(0);
                    is_line.push_back(0);
                }
                if (one < sides) {
                    order.push_back(one);
                    ++count.back();
                } else {
                    is_line.back() = 1;
                }
            }
        }
    }
};

// The unit normals (corners, 3) of fans, each by the number of its corners: those of facets (facets, 3), weighted by their
// angles there.
inline std::vector<double> fan_normals(const double* points, const FacetsView& facets, const double* normals,
                                       const std::int32_t* fan, std::int64_t corners) {
    std::vector<double> sums(static_cast<std::size_t>(corners) * 3);
    std::int64_t corner = 0;
    for (std::int64_t f = 0; f < facets.count; ++f) {
        const int count = facets.corners(f);
        std::array<Vec<3>, 4> at, way;  // and to the corner behind
        for (int i = 0; i < count; ++i) at[i] = load<3>(points + static_cast<std::int64_t>(facets[f][i]) * 3);
        for (int i = 0; i < count; ++i) way[i] = unit(at[(i + 1) % count] - at[i]);
        for (int i = 0; i < count; ++i) {
            const double cosine = -dot(way[i], way[(i + count - 1) % count]);
            const double angle = std::acos(std::clamp(cosine, -1.0, 1.0));
            double* sum = sums.data() + static_cast<std::int64_t>(fan[corner++]) * 3;
            for (int k = 0; k < 3; ++k) sum[k] += angle * normals[f * 3 + k];
        }
    }
    return unit_vectors<3>(sums.data(), corners);
}

// What is around the vertices that slide: of each piece of a shape that one is a corner of, the other corners.
//
// triangles (t, 3), segments (s, width)   pieces, by vertices; of the latter the first two
// shape, place (t + s)                     the shape of each, -1: none, and where it is among the pieces of shapes
// bounded (vertices)                       those that are asked about
struct Around {
    std::vector<std::int32_t> offsets{}, rows{};  // (vertices + 1), (r, 4): one or two corners, -1: no more; shape and place

    struct Pieces {
        const std::int32_t *triangles, *segments;
        std::int64_t triangle_count, segment_count;
        int width;
        const std::int32_t *shape, *place;

        // Calls with a vertex, the one or two others, and the piece: all triangles from their first corners, from their
        // second ones, and so on.
        template <class F>
        void for_each_corner(const F& call) const {
            for (int i = 0; i < 3; ++i)
                for (std::int64_t p = 0; p < triangle_count; ++p)
                    if (const std::int32_t* v = triangles + 3 * p; shape[p] >= 0) call(v[i], v[(i + 1) % 3], v[(i + 2) % 3], p);
            for (int i = 0; i < 2; ++i)
                for (std::int64_t p = 0; p < segment_count; ++p)
                    if (const std::int32_t* v = segments + width * p; shape[triangle_count + p] >= 0)
                        call(v[i], v[1 - i], -1, triangle_count + p);
        }
    };

    Around(const Pieces& pieces, const std::uint8_t* bounded, std::int64_t vertices) {
        offsets.assign(static_cast<std::size_t>(vertices) + 1, 0);
        pieces.for_each_corner([&](std::int32_t v, std::int32_t, std::int32_t, std::int64_t) { offsets[v + 1] += bounded[v] != 0; });
        for (std::int64_t v = 0; v < vertices; ++v) offsets[v + 1] += offsets[v];
        rows.resize(static_cast<std::size_t>(offsets.back()) * 4);
        std::vector<std::int32_t> next(offsets.begin(), offsets.end() - 1);
        pieces.for_each_corner([&](std::int32_t v, std::int32_t a, std::int32_t b, std::int64_t piece) {
            if (bounded[v] == 0) return;
            std::int32_t* row = rows.data() + 4 * static_cast<std::int64_t>(next[v]++);
            row[0] = a;
            row[1] = b;
            row[2] = pieces.shape[piece];
            row[3] = pieces.place[piece];
        });
    }
};

}  // namespace meshfix
