// The edges of elements of several shapes, each once, and the rows of those that are parallel in the ideal elements.
//
// offsets (n+1), ends    the edges at each vertex to larger ones, ascending; an edge has the number of its place in `ends`
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "mesh/elements.hpp"

namespace meshfix {

// For each shape its edges as pairs of nodes, those together that are parallel in the ideal element.
struct EdgeTable {
    struct Edge {
        int group, one, other;
    };
    std::array<std::vector<Edge>, SHAPES.size()> of_shape;
};

struct EdgesView {
    const std::int32_t* offsets;
    const std::int32_t* ends;

    // The number of the edge between two vertices; -1: there is none.
    std::int32_t find(std::int32_t one, std::int32_t other) const {
        const std::int32_t smaller = std::min(one, other), larger = std::max(one, other);
        const std::int32_t* const last = ends + offsets[smaller + 1];
        const std::int32_t* const at = std::lower_bound(ends + offsets[smaller], last, larger);
        return at != last && *at == larger ? static_cast<std::int32_t>(at - ends) : -1;
    }
};

struct EdgeList {
    std::vector<std::int32_t> offsets, ends;
};

// Calls f(edge, one, other) for the edges of each element, in the order of its shape's.
template <class F>
void for_each_edge(const Elements& elements, const EdgeTable& table, const F& f) {
    for (std::int64_t e = 0; e < elements.size(); ++e) {
        const std::int32_t* nodes = elements.nodes_of(e);
        for (const EdgeTable::Edge& edge : table.of_shape[elements.codes[e]]) f(edge, nodes[edge.one], nodes[edge.other]);
    }
}

inline EdgeList find_edges(const Elements& elements, const EdgeTable& table, std::int64_t n, int threads) {
    std::vector<std::int32_t> starts(n + 1, 0);
    const auto count = [&](const EdgeTable::Edge&, std::int32_t one, std::int32_t other) { ++starts[std::min(one, other) + 1]; };
    for_each_edge(elements, table, count);
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    std::vector<std::int32_t> next(starts.begin(), starts.end() - 1), all(starts.back());
    for_each_edge(elements, table, [&](const EdgeTable::Edge&, std::int32_t one, std::int32_t other) {
        all[next[std::min(one, other)]++] = std::max(one, other);
    });
    EdgeList edges;
    edges.offsets.assign(n + 1, 0);
    for_each_range(n, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t v = begin; v < end; ++v) {
            const auto first = all.begin() + starts[v], last = all.begin() + starts[v + 1];
            std::sort(first, last);
            edges.offsets[v + 1] = static_cast<std::int32_t>(std::unique(first, last) - first);
        }
    });
    std::partial_sum(edges.offsets.begin(), edges.offsets.end(), edges.offsets.begin());
    edges.ends.reserve(edges.offsets.back());
    for (std::int64_t v = 0; v < n; ++v) {
        const auto first = all.begin() + starts[v];
        edges.ends.insert(edges.ends.end(), first, first + (edges.offsets[v + 1] - edges.offsets[v]));
    }
    return edges;
}

// The row (e) of each edge; edges that are parallel in an element are of one.
inline std::vector<std::int32_t> rows_of_edges(const Elements& elements, const EdgeTable& table, EdgesView edges,
                                               std::int64_t count) {
    Union rows(count);
    std::int32_t first = -1;
    int group = -1;
    for_each_edge(elements, table, [&](const EdgeTable::Edge& edge, std::int32_t one, std::int32_t other) {
        const std::int32_t here = edges.find(one, other);
        if (edge.group == group)
            rows.join(first, here, false);
        else
            first = here;
        group = edge.group;
    });
    return std::move(rows).result().component;
}

}  // namespace meshfix
