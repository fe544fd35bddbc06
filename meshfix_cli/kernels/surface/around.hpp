// The normals that a surface has by what is around its vertices, however it is tangled there.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/star.hpp"
#include "surface/unfold.hpp"

namespace meshfix {

// The unit normals of what is around the vertices (n, 3) and elements (count, 3) of a surface: of the areas as vectors of the
// stars of a vertex and its neighbours, which do not depend on where these are; of an element the sum of its nodes'. Zero: they
// tell none. The stars of vertices on edges (n) tell nothing of what is beside them.
struct AroundNormals {
    std::vector<double> of_vertices, of_elements;
};

inline AroundNormals normals_around(const double* points, const ElementsView& elements, const StarsView& stars, std::int64_t n,
                                    const std::uint8_t* on_edge, int threads) {
    struct Sum {
        Vec<3> area{};
        double size = 0.0;  // of the products of edges

        void add(const Sum& other) {
            area = area + other.area;
            size += other.size;
        }
        Vec<3> normal() const {
            const double length = std::sqrt(norm2(area));
            return length > AREA_AROUND * size ? (1.0 / length) * area : Vec<3>{};
        }
    };
    std::vector<Sum> of_stars(n), sums(n);
    std::array<Vec<3>, 4> nodes{};
    for (std::int64_t e = 0; e < elements.count; ++e) {
        const int count = load_nodes<3>(points, elements, e, nodes);
        const Vec<3> one = nodes[2] - nodes[0], other = nodes[count == 3 ? 1 : 3] - nodes[count == 3 ? 0 : 1];
        const Sum here{area_vector(nodes, count), std::sqrt(norm2(one) * norm2(other))};
        for (std::int32_t i = elements.offsets[e]; i < elements.offsets[e + 1]; ++i)
            if (on_edge[elements.nodes[i]] == 0) of_stars[elements.nodes[i]].add(here);
    }
    for_each_range(n, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t v = begin; v < end; ++v) {
            if (on_edge[v] != 0) continue;
            sums[v] = of_stars[v];
            for (std::int32_t i = stars.neighbour_offsets[v]; i < stars.neighbour_offsets[v + 1]; ++i)
                sums[v].add(of_stars[stars.neighbours[i]]);
        }
    });
    AroundNormals found{std::vector<double>(static_cast<std::size_t>(n) * 3),
                        std::vector<double>(static_cast<std::size_t>(elements.count) * 3)};
    const auto put = [](std::vector<double>& all, std::int64_t i, const Sum& sum) {
        const Vec<3> normal = sum.normal();
        std::copy(normal.begin(), normal.end(), all.begin() + 3 * i);
    };
    for_each_range(n, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t v = begin; v < end; ++v) put(found.of_vertices, v, sums[v]);
    });
    for_each_range(elements.count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t e = begin; e < end; ++e) {
            Sum here;
            for (std::int32_t i = elements.offsets[e]; i < elements.offsets[e + 1]; ++i) here.add(sums[elements.nodes[i]]);
            put(found.of_elements, e, here);
        }
    });
    return found;
}

}  // namespace meshfix
