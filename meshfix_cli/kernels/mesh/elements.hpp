// Elements of several shapes: their facets, and the corner simplices into which the sweeps take them apart.
//
// codes (m), offsets (m+1), nodes              the shape and the vertices of each element, in the order of shapes.hpp
// facet_offsets (m+1), facet_owners, mates     facets are numbered one element behind the other; the mate is the facet
//                                              on the other side, -1 where there is none
// simplex_offsets (m+1), owners                likewise the corner simplices, of which each tells its element
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "mesh/facets.hpp"
#include "mesh/shapes.hpp"

namespace meshfix {

struct Elements {
    std::vector<std::uint8_t> codes;
    std::vector<std::int32_t> offsets, nodes, facet_offsets, facet_owners, simplex_offsets, owners;

    // All elements are simplices of one type. A part of a mesh of others may have none, and is not empty.
    bool empty() const { return offsets.empty(); }
    std::int64_t size() const { return static_cast<std::int64_t>(codes.size()); }
    const ElementShape& shape(std::int64_t e) const { return SHAPES[codes[e]]; }
    const std::int32_t* nodes_of(std::int64_t e) const { return nodes.data() + offsets[e]; }

    // The vertices of a facet, seen from outside; returns how many there are.
    int facet(std::int64_t e, int k, std::array<std::int32_t, 4>& vertices) const {
        const int size = shape(e).facet_size(k);
        for (int i = 0; i < size; ++i) vertices[i] = nodes_of(e)[shape(e).facet[k][i]];
        return size;
    }
};

// Where the things of each element begin, by their number for each shape; what is behind the last comes last.
inline std::vector<std::int32_t> offsets_by_shape(const std::vector<std::uint8_t>& codes, int ElementShape::*count) {
    std::vector<std::int32_t> offsets(codes.size() + 1, 0);
    for (std::size_t e = 0; e < codes.size(); ++e) offsets[e + 1] = offsets[e] + SHAPES[codes[e]].*count;
    return offsets;
}

inline std::vector<std::int32_t> owners_of(const std::vector<std::int32_t>& offsets) {
    std::vector<std::int32_t> owners(offsets.back());
    for (std::size_t e = 0; e + 1 < offsets.size(); ++e)
        std::fill(owners.begin() + offsets[e], owners.begin() + offsets[e + 1], static_cast<std::int32_t>(e));
    return owners;
}

// The elements as they come; what follows from their shapes is found.
inline Elements elements_of(std::vector<std::uint8_t> codes, std::vector<std::int32_t> nodes) {
    Elements elements;
    elements.offsets = offsets_by_shape(codes, &ElementShape::nodes);
    elements.facet_offsets = offsets_by_shape(codes, &ElementShape::facets);
    elements.facet_owners = owners_of(elements.facet_offsets);
    elements.simplex_offsets = offsets_by_shape(codes, &ElementShape::simplices);
    elements.owners = owners_of(elements.simplex_offsets);
    elements.codes = std::move(codes);
    elements.nodes = std::move(nodes);
    return elements;
}

// The elements as they come, with nodes in the numbers `number`, by their first vertices; `rows`: where each came from.
inline Elements ordered_elements(const std::uint8_t* codes, const std::int32_t* nodes, std::int64_t m,
                                 const std::vector<std::int32_t>& number, std::int64_t n,
                                 std::vector<std::int32_t>& rows) {
    const std::vector<std::int32_t> from = offsets_by_shape({codes, codes + m}, &ElementShape::nodes);
    std::vector<std::int32_t> first(m), next(n + 1, 0);
    for (std::int64_t e = 0; e < m; ++e) {
        first[e] = number[nodes[from[e]]];
        for (std::int32_t i = from[e]; i < from[e + 1]; ++i) first[e] = std::min(first[e], number[nodes[i]]);
        ++next[first[e] + 1];
    }
    std::partial_sum(next.begin(), next.end(), next.begin());
    rows.resize(m);
    for (std::int64_t e = 0; e < m; ++e) rows[next[first[e]]++] = static_cast<std::int32_t>(e);
    std::vector<std::uint8_t> ordered_codes(m);
    std::vector<std::int32_t> ordered_nodes;
    ordered_nodes.reserve(from.back());
    for (std::int64_t e = 0; e < m; ++e) {
        ordered_codes[e] = codes[rows[e]];
        for (std::int32_t i = from[rows[e]]; i < from[rows[e] + 1]; ++i) ordered_nodes.push_back(number[nodes[i]]);
    }
    return elements_of(std::move(ordered_codes), std::move(ordered_nodes));
}

// A facet from its smallest vertex on. Two elements that are numbered consistently pass it in opposite directions.
struct FacetKey {
    std::uint64_t sides;       // the vertices beside the smallest, smaller first; of an edge the other one
    std::int32_t smallest, opposite;  // opposite: of a quadrilateral, else -1
    bool odd;

    FacetKey(const std::array<std::int32_t, 4>& v, int size) {
        const int at = static_cast<int>(std::min_element(v.begin(), v.begin() + size) - v.begin());
        const std::int32_t after = v[(at + 1) % size], before = v[(at + size - 1) % size];
        smallest = v[at];
        opposite = size == 4 ? v[(at + 2) % 4] : -1;
        odd = size == 2 ? at == 0 : after > before;
        sides = static_cast<std::uint64_t>(std::min(after, before)) << 32 | static_cast<std::uint64_t>(std::max(after, before));
        if (size == 4) sides |= std::uint64_t{1} << 63;
    }
};

// Each facet is matched at its smallest vertex; `parted`: not where there are more than two. A quadrilateral and two
// triangles in its place are no mates.
inline Facets match_facets(const Elements& elements, std::int64_t n, bool parted, int threads) {
    constexpr std::int64_t VERTICES = 1024;
    struct Seen {
        std::int32_t facet, opposite;
        bool odd;
        int count;
    };
    const std::int64_t count = elements.facet_offsets.back();
    std::vector<std::int32_t> starts(n + 1, 0), at_vertex(count);
    std::vector<std::int32_t> smallest(count);
    const auto key_of = [&](std::int64_t f) {
        const std::int32_t e = elements.facet_owners[f];
        std::array<std::int32_t, 4> vertices;
        const int size = elements.facet(e, static_cast<int>(f - elements.facet_offsets[e]), vertices);
        return FacetKey(vertices, size);
    };
    for_each_range(count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t f = begin; f < end; ++f) smallest[f] = key_of(f).smallest;
    });
    for (std::int32_t v : smallest) ++starts[v + 1];
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    std::vector<std::int32_t> next(starts.begin(), starts.end() - 1);
    for (std::int64_t f = 0; f < count; ++f) at_vertex[next[smallest[f]]++] = static_cast<std::int32_t>(f);
    Facets facets;
    facets.mates.assign(count, -1);
    facets.against.assign(count, 0);
    std::vector<std::int64_t> crowded(n / VERTICES + 1, -1);
    for_each_range(n, VERTICES, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        SmallMap<Seen> seen;
        for (std::int64_t v = begin; v < end; ++v) {
            seen.clear(static_cast<std::size_t>(starts[v + 1] - starts[v]));
            for (std::int32_t i = starts[v]; i < starts[v + 1]; ++i) {
                const std::int32_t f = at_vertex[i];
                const FacetKey key = key_of(f);
                bool is_new = false;
                Seen& other = seen.find(key.sides, is_new);
                if (is_new) {
                    other = {f, key.opposite, key.odd, 1};
                } else if (elements.facet_owners[other.facet] == elements.facet_owners[f] || (other.count > 1 && !parted)) {
                    crowded[item] = f;
                } else if (other.count > 1) {
                    part(facets.mates, other.facet);
                } else if (other.opposite == key.opposite) {
                    facets.mates[f] = other.facet;
                    facets.mates[other.facet] = f;
                    facets.against[f] = facets.against[other.facet] = key.odd == other.odd;
                    other.count = 2;
                }
            }
        }
    });
    for (std::int64_t f : crowded)
        if (facets.crowded < 0) facets.crowded = f;
    return facets;
}

inline Orientation orient(const Elements& elements, const Facets& facets) {
    Union sets(elements.size());
    bool orientable = true;
    for (std::int64_t f = 0; f < elements.facet_offsets.back(); ++f) {
        if (facets.mates[f] < 0 || facets.mates[f] > f) continue;
        const std::int32_t e = elements.facet_owners[f], other = elements.facet_owners[facets.mates[f]];
        orientable &= sets.join(e, other, facets.against[f] != 0);
    }
    Orientation result = std::move(sets).result();
    result.orientable = orientable;
    return result;
}

// Which facet of a shape is which once its nodes have the other orientation.
inline std::array<int, MOST_FACETS> mirrored_facets(const ElementShape& shape) {
    const auto set_of = [&](int k, bool mirrored) {
        unsigned set = 0;
        for (int i = 0; i < shape.facet_size(k); ++i) {
            const int node = shape.facet[k][i];
            set |= 1u << (mirrored ? shape.mirrored[node] : node);
        }
        return set;
    };
    std::array<int, MOST_FACETS> to{};
    for (int k = 0; k < shape.facets; ++k)
        for (int j = 0; j < shape.facets; ++j)
            if (set_of(j, true) == set_of(k, false)) to[k] = j;
    return to;
}

// Gives some elements the other orientation.
inline void mirror(Elements& elements, std::vector<std::int32_t>& mates, const std::uint8_t* flipped) {
    std::array<std::array<int, MOST_FACETS>, 6> to;
    for (std::size_t code = 0; code < SHAPES.size(); ++code) to[code] = mirrored_facets(SHAPES[code]);
    const auto moved = [&](std::int32_t f) {
        const std::int32_t e = elements.facet_owners[f], first = elements.facet_offsets[e];
        return flipped[e] ? first + to[elements.codes[e]][f - first] : f;
    };
    std::vector<std::int32_t> before = mates;
    for (std::size_t f = 0; f < before.size(); ++f)
        mates[moved(static_cast<std::int32_t>(f))] = before[f] < 0 ? -1 : moved(before[f]);
    for (std::int64_t e = 0; e < elements.size(); ++e) {
        if (!flipped[e]) continue;
        std::array<std::int32_t, MOST_NODES> nodes;
        std::copy_n(elements.nodes_of(e), elements.shape(e).nodes, nodes.begin());
        for (int i = 0; i < elements.shape(e).nodes; ++i)
            elements.nodes[elements.offsets[e] + i] = nodes[elements.shape(e).mirrored[i]];
    }
}

// The corner simplices (s, D+1).
template <int D>
std::vector<std::int32_t> corner_simplices(const Elements& elements, int threads) {
    std::vector<std::int32_t> simplices(static_cast<std::size_t>(elements.simplex_offsets.back()) * (D + 1));
    for_each_range(elements.size(), PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t e = begin; e < end; ++e) {
            std::int32_t* to = simplices.data() + static_cast<std::int64_t>(elements.simplex_offsets[e]) * (D + 1);
            for (int s = 0; s < elements.shape(e).simplices; ++s)
                for (int k = 0; k <= D; ++k) *to++ = elements.nodes_of(e)[elements.shape(e).simplex[s][k]];
        }
    });
    return simplices;
}

// Calls f(e, facet, vertices, size) for the facets that `wanted(facet)` chooses.
template <class Wanted, class F>
void for_each_facet(const Elements& elements, const Wanted& wanted, const F& f) {
    std::array<std::int32_t, 4> vertices;
    for (std::int64_t e = 0; e < elements.size(); ++e)
        for (int k = 0; k < elements.shape(e).facets; ++k) {
            const std::int32_t facet = elements.facet_offsets[e] + k;
            if (wanted(facet)) f(static_cast<std::int32_t>(e), facet, vertices, elements.facet(e, k, vertices));
        }
}

// A facet as triangles, or itself in 2-D, by one or the other diagonal of a quadrilateral.
template <int D, class F>
void for_each_part_of_facet(const std::array<std::int32_t, 4>& v, int size, bool other_diagonal, const F& f) {
    if constexpr (D == 2) {
        f(std::array<std::int32_t, 2>{v[0], v[1]});
    } else if (size == 3) {
        f(std::array<std::int32_t, 3>{v[0], v[1], v[2]});
    } else {
        const int a = other_diagonal;
        f(std::array<std::int32_t, 3>{v[a], v[a + 1], v[a + 2]});
        f(std::array<std::int32_t, 3>{v[a], v[a + 2], v[(a + 3) % 4]});
    }
}

// As `fixed_facets` of simplices, quadrilaterals as two triangles.
template <int D>
FixedFacets fixed_facets(const Elements& elements, const std::vector<std::int32_t>& mates, const std::uint8_t* movable,
                         bool other_diagonal) {
    FixedFacets found;
    const auto first = [&](std::int32_t f) { return mates[f] < 0 || mates[f] > f; };
    for_each_facet(elements, first, [&](std::int32_t e, std::int32_t f, const std::array<std::int32_t, 4>& v, int size) {
        for (int i = 0; i < size; ++i)
            if (movable[v[i]]) return;
        for_each_part_of_facet<D>(v, size, other_diagonal, [&](const std::array<std::int32_t, D>& part) {
            found.vertices.insert(found.vertices.end(), part.begin(), part.end());
            found.owners.push_back(e);
            found.shared.push_back(mates[f] >= 0);
        });
    });
    return found;
}

// Elements all of whose vertices are fixed.
inline std::vector<std::int32_t> stuck_elements(const Elements& elements, const std::uint8_t* movable) {
    std::vector<std::int32_t> found;
    for (std::int64_t e = 0; e < elements.size(); ++e) {
        bool free = false;
        for (int i = 0; i < elements.shape(e).nodes; ++i) free |= movable[elements.nodes_of(e)[i]] != 0;
        if (!free) found.push_back(static_cast<std::int32_t>(e));
    }
    return found;
}

}  // namespace meshfix
