// Facets: which simplex lies on the other side of each, and whether the two are numbered consistently.
//
// simplices (m, D+1) vertex numbers; a corner is simplex * (D+1) + position and also names the facet opposite it.
// mates (m, D+1): the corner on the other side of the facet opposite each corner, -1 where there is none.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "simplex.hpp"

namespace meshfix {

// Compressed rows: the corners at each vertex, ascending.
struct Incidence {
    std::vector<std::int32_t> offsets, corners;
};

template <int D>
Incidence incidence(const std::int32_t* simplices, std::int64_t m, std::int64_t n) {
    Incidence csr;
    csr.offsets.assign(n + 1, 0);
    csr.corners.resize(m * (D + 1));
    for (std::int64_t c = 0; c < m * (D + 1); ++c) ++csr.offsets[simplices[c] + 1];
    for (std::int64_t v = 0; v < n; ++v) csr.offsets[v + 1] += csr.offsets[v];
    std::vector<std::int32_t> next(csr.offsets.begin(), csr.offsets.end() - 1);
    for (std::int64_t c = 0; c < m * (D + 1); ++c) csr.corners[next[simplices[c]]++] = static_cast<std::int32_t>(c);
    return csr;
}

// Whether sorting the vertices of the facet opposite `corner` takes an odd number of swaps.
// Two consistently numbered simplices see their common facet from opposite sides: one odd, one even.
template <int D>
bool is_odd(const std::int32_t* simplices, std::int64_t corner) {
    const std::int32_t* simplex = simplices + corner / (D + 1) * (D + 1);
    const auto& face = opposite_face<D>(static_cast<int>(corner % (D + 1)));
    int inversions = 0;
    for (int i = 0; i < D; ++i)
        for (int j = i + 1; j < D; ++j) inversions += simplex[face[i]] > simplex[face[j]];
    return inversions % 2 == 1;
}

struct Facets {
    std::vector<std::int32_t> mates;
    std::int64_t crowded = -1;  // a corner whose facet has three simplices, or two that are the same; -1: none
};

template <int D>
Facets match_facets(const std::int32_t* simplices, std::int64_t m, std::int64_t n) {
    const Incidence csr = incidence<D>(simplices, m, n);
    Facets facets;
    facets.mates.assign(m * (D + 1), -1);
    std::vector<std::pair<std::uint64_t, std::int32_t>> at_vertex;  // the facets whose smallest vertex is v
    for (std::int64_t v = 0; v < n; ++v) {
        at_vertex.clear();
        for (std::int32_t i = csr.offsets[v]; i < csr.offsets[v + 1]; ++i) {
            const std::int32_t first = csr.corners[i] / (D + 1) * (D + 1);
            for (int j = 0; j <= D; ++j) {
                std::uint64_t others[2] = {0, 0};
                int count = 0;
                for (int k = 0; k <= D; ++k) {
                    const std::int32_t u = simplices[first + k];
                    if (k != j && u > v) others[count++ & 1] = static_cast<std::uint64_t>(u);
                }
                if (first + j == csr.corners[i] || count != D - 1) continue;
                if (D == 3 && others[0] > others[1]) std::swap(others[0], others[1]);
                at_vertex.emplace_back(others[0] << 32 | others[1], first + j);
            }
        }
        std::sort(at_vertex.begin(), at_vertex.end());
        for (std::size_t i = 0; i + 1 < at_vertex.size(); ++i) {
            if (at_vertex[i].first != at_vertex[i + 1].first) continue;
            const std::int32_t a = at_vertex[i].second, b = at_vertex[i + 1].second;
            const bool third = i + 2 < at_vertex.size() && at_vertex[i + 2].first == at_vertex[i].first;
            if (third || simplices[a] == simplices[b]) {
                facets.crowded = a;
                return facets;
            }
            facets.mates[a] = b;
            facets.mates[b] = a;
        }
    }
    return facets;
}

struct Orientation {
    std::vector<std::int32_t> component;  // (m,) simplices joined through facets have the same number
    std::vector<std::uint8_t> against;    // (m,) 1: numbered against the first simplex of its component
    std::int64_t components = 0;
    bool orientable = true;
};

// Breadth first through the facets.
template <int D>
Orientation orient(const std::int32_t* simplices, const std::int32_t* mates, std::int64_t m) {
    Orientation result;
    result.component.assign(m, -1);
    result.against.assign(m, 0);
    std::vector<std::int32_t> queue;
    queue.reserve(m);
    for (std::int64_t seed = 0; seed < m; ++seed) {
        if (result.component[seed] >= 0) continue;
        result.component[seed] = static_cast<std::int32_t>(result.components);
        queue.assign(1, static_cast<std::int32_t>(seed));
        for (std::size_t head = 0; head < queue.size(); ++head) {
            const std::int64_t s = queue[head];
            for (std::int64_t corner = s * (D + 1); corner < (s + 1) * (D + 1); ++corner) {
                const std::int64_t mate = mates[corner];
                if (mate < 0) continue;
                const std::int64_t t = mate / (D + 1);
                const bool consistent = is_odd<D>(simplices, corner) != is_odd<D>(simplices, mate);
                const std::uint8_t against = result.against[s] ^ static_cast<std::uint8_t>(!consistent);
                if (result.component[t] < 0) {
                    result.component[t] = static_cast<std::int32_t>(result.components);
                    result.against[t] = against;
                    queue.push_back(static_cast<std::int32_t>(t));
                } else if (result.against[t] != against) {
                    result.orientable = false;
                }
            }
        }
        ++result.components;
    }
    return result;
}

}  // namespace meshfix
