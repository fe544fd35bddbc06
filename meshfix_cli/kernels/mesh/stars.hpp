// What the kernels know of a mesh: its simplices in their own order, the facets between them, and the stars around
// its vertices in blocks, which are the unit of parallel work.
//
// vertices, rows, simplices        see order.hpp; all other numbers are those of this order
// offsets (n+1), corners           the corners at each vertex; a corner is simplex * (D+1) + position
// mates, component, against        see facets.hpp
// elements                         see elements.hpp; empty where all are simplices. Where it is not, `rows`, `component`,
//                                  `against` and `mates` are of the elements and their facets, and `simplices`,
//                                  `offsets` and `corners` of their corner simplices, once they are taken apart
// neighbour_offsets (n+1), neighbours
// faces (m*(D+1), D)               for each of `corners` the opposite face, as positions in the vertex's neighbours
// colour_offsets, colour_blocks    blocks of one colour share no edge; block b holds the vertices from b * BLOCK_SIZE
#pragma once

#include <cstdint>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "mesh/elements.hpp"
#include "mesh/facets.hpp"
#include "mesh/order.hpp"

namespace meshfix {

struct Connectivity {
    std::vector<std::int32_t> vertices, rows, simplices, offsets, corners, mates, component;
    std::vector<std::uint8_t> against;
    std::int64_t crowded = -1;
    bool orientable = true;
    std::vector<std::int32_t> neighbour_offsets, neighbours, colour_offsets, colour_blocks;
    std::vector<std::uint16_t> faces;
    Elements elements;

    std::int64_t n() const { return static_cast<std::int64_t>(vertices.size()); }
    std::int64_t m() const { return static_cast<std::int64_t>(rows.size()); }
    std::int64_t blocks() const { return (n() + BLOCK_SIZE - 1) / BLOCK_SIZE; }
};

// 1 for the vertices (n) of facets that belong to one simplex.
template <int D>
std::vector<std::uint8_t> boundary_vertices(const Connectivity& mesh) {
    std::vector<std::uint8_t> marked(static_cast<std::size_t>(mesh.n()), 0);
    if (!mesh.elements.empty()) {
        for_each_facet(mesh.elements, [&](std::int32_t f) { return mesh.mates[f] < 0; },
                       [&](std::int32_t, std::int32_t, const std::array<std::int32_t, 4>& v, int size) {
                           for (int i = 0; i < size; ++i) marked[v[i]] = 1;
                       });
        return marked;
    }
    for (std::size_t corner = 0; corner < mesh.mates.size(); ++corner) {
        if (mesh.mates[corner] >= 0) continue;
        const std::int32_t* simplex = mesh.simplices.data() + corner / (D + 1) * (D + 1);
        for (const int position : opposite_face<D>(static_cast<int>(corner % (D + 1)))) marked[simplex[position]] = 1;
    }
    return marked;
}

inline void take_orientation(Connectivity& mesh, Orientation&& orientation) {
    mesh.component = std::move(orientation.component);
    mesh.against = std::move(orientation.against);
    mesh.orientable = orientation.orientable;
}

// points (n, S): S is D or, for surfaces, 3. Where more than two elements of a surface meet, it ends.
template <int D, int S = D>
Connectivity connect(const double* points, std::int64_t n, const std::int32_t* simplices, std::int64_t m,
                     std::vector<std::int32_t> used, int threads) {
    Connectivity mesh;
    Order order = order_mesh<D, S>(points, n, simplices, m, std::move(used), threads);
    mesh.vertices = std::move(order.vertices);
    mesh.rows = std::move(order.rows);
    mesh.simplices = std::move(order.simplices);
    Incidence csr = incidence<D>(mesh.simplices.data(), m, mesh.n(), threads);
    Facets facets = match_facets<D>(mesh.simplices.data(), m, csr, S > D, threads);
    mesh.crowded = facets.crowded;
    if (mesh.crowded >= 0) return mesh;
    mesh.offsets = std::move(csr.offsets);
    mesh.corners = std::move(csr.corners);
    take_orientation(mesh, orient<D>(facets, m, threads));
    mesh.mates = std::move(facets.mates);
    return mesh;
}

// Elements of any shapes: all but their corner simplices.
template <int D, int S = D>
Connectivity connect_elements(const double* points, std::int64_t n, const std::uint8_t* codes, const std::int32_t* nodes,
                              std::int64_t m, std::vector<std::int32_t> used, int threads) {
    Connectivity mesh;
    mesh.vertices = std::move(used);
    sort_along_curve<S>(mesh.vertices, points, threads);
    std::vector<std::int32_t> number(n);
    for (std::size_t i = 0; i < mesh.vertices.size(); ++i) number[mesh.vertices[i]] = static_cast<std::int32_t>(i);
    mesh.elements = ordered_elements(codes, nodes, m, number, mesh.n(), mesh.rows);
    Facets facets = match_facets(mesh.elements, mesh.n(), S > D, threads);
    mesh.crowded = facets.crowded;
    if (mesh.crowded >= 0) return mesh;
    take_orientation(mesh, orient(mesh.elements, facets));
    mesh.mates = std::move(facets.mates);
    return mesh;
}

// Finds the corners at each vertex.
template <int D>
void find_corners(Connectivity& mesh, int threads) {
    const auto count = static_cast<std::int64_t>(mesh.simplices.size()) / (D + 1);
    Incidence csr = incidence<D>(mesh.simplices.data(), count, mesh.n(), threads);
    mesh.offsets = std::move(csr.offsets);
    mesh.corners = std::move(csr.corners);
}

// Gives some elements (m) the other orientation, and takes all apart into their corner simplices.
template <int D>
void take_apart(Connectivity& mesh, const std::uint8_t* flipped, int threads) {
    mirror(mesh.elements, mesh.mates, flipped);
    mesh.simplices = corner_simplices<D>(mesh.elements, threads);
    find_corners<D>(mesh, threads);
}

// A part of a mesh that has an order already: its n vertices and its simplices or elements (m), as they come.
template <int D>
Connectivity part_of_mesh(std::vector<std::int32_t> simplices, Elements elements, std::int64_t m, std::int64_t n,
                          int threads) {
    Connectivity part;
    part.simplices = std::move(simplices);
    part.elements = std::move(elements);
    part.vertices.resize(n);
    part.rows.resize(m);
    std::iota(part.vertices.begin(), part.vertices.end(), 0);
    std::iota(part.rows.begin(), part.rows.end(), 0);
    find_corners<D>(part, threads);
    return part;
}

// Signed sizes, times d!, of the components as their elements are numbered together; see below. What is inside of a
// quadrilateral that is not flat is the mean of what is inside of its triangles by either diagonal.
template <int D>
std::vector<double> signed_sizes_of_elements(const Connectivity& mesh, const double* points) {
    const auto at = [&](std::int32_t v) { return load<D>(points + static_cast<std::int64_t>(mesh.vertices[v]) * D); };
    const auto components = static_cast<std::size_t>(*std::max_element(mesh.component.begin(), mesh.component.end())) + 1;
    std::vector<double> sizes(components, 0.0);
    std::vector<std::int32_t> origins(components, -1);
    const auto add = [&](std::int32_t e, std::int32_t, const std::array<std::int32_t, 4>& v, int size) {
        const std::int32_t component = mesh.component[e];
        if (origins[component] < 0) origins[component] = v[0];
        const Vec<D> origin = at(origins[component]);
        const double share = mesh.against[e] ? -0.5 : 0.5;
        for (const bool other : {false, true})
            for_each_part_of_facet<D>(v, size, other, [&](const std::array<std::int32_t, D>& part) {
                Edges<D> edges;
                for (int k = 0; k < D; ++k) edges[k] = at(part[k]) - origin;
                sizes[component] += share * determinant(edges);
            });
    };
    for_each_facet(mesh.elements, [&](std::int32_t f) { return mesh.mates[f] < 0; }, add);
    return sizes;
}

// Signed sizes, times d!, of the components as their simplices are numbered together: those of the boundary facets seen
// from one of its vertices. Where inner vertices are does not matter: one that is far away would drown a sum over the
// simplices in rounding. points (n, D) in the user's order
template <int D>
std::vector<double> signed_sizes(const Connectivity& mesh, const double* points) {
    if (!mesh.elements.empty()) return signed_sizes_of_elements<D>(mesh, points);
    const auto at = [&](std::int32_t v) { return load<D>(points + static_cast<std::int64_t>(mesh.vertices[v]) * D); };
    std::vector<double> sizes;
    std::vector<Vec<D>> origins;
    std::vector<bool> known;
    for (std::size_t corner = 0; corner < mesh.mates.size(); ++corner) {
        const std::size_t s = corner / (D + 1), component = static_cast<std::size_t>(mesh.component[s]);
        if (component >= sizes.size()) {
            sizes.resize(component + 1, 0.0);
            origins.resize(component + 1);
            known.resize(component + 1, false);
        }
        if (mesh.mates[corner] >= 0) continue;
        const auto& face = opposite_face<D>(static_cast<int>(corner % (D + 1)));
        if (!known[component]) origins[component] = at(mesh.simplices[s * (D + 1) + face[0]]);
        known[component] = true;
        Edges<D> e;
        for (int k = 0; k < D; ++k) e[k] = at(mesh.simplices[s * (D + 1) + face[k]]) - origins[component];
        sizes[component] += mesh.against[s] ? -determinant(e) : determinant(e);
    }
    return sizes;
}

// Exchanges the first two vertices of some simplices: the other orientation. Before the stars are built.
template <int D>
void flip(Connectivity& mesh, const std::uint8_t* flipped, int threads) {
    const auto moved = [&](std::int32_t corner) {
        const std::int32_t position = corner % (D + 1);
        return position < 2 && flipped[corner / (D + 1)] ? corner + 1 - 2 * position : corner;
    };
    for_each_range(mesh.m(), PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t s = begin; s < end; ++s) {
            if (flipped[s]) {
                std::swap(mesh.simplices[s * (D + 1)], mesh.simplices[s * (D + 1) + 1]);
                std::swap(mesh.mates[s * (D + 1)], mesh.mates[s * (D + 1) + 1]);
            }
            for (int k = 0; k <= D; ++k) {
                std::int32_t& mate = mesh.mates[s * (D + 1) + k];
                if (mate >= 0) mate = moved(mate);
                mesh.corners[s * (D + 1) + k] = moved(mesh.corners[s * (D + 1) + k]);
            }
        }
    });
}

// Where each vertex (n) stands among the neighbours that were found last: less than `next` was before, it does not.
struct Places {
    std::vector<std::uint32_t> of_vertex;
    std::uint32_t next = 1;
};

// The neighbours and faces of the vertices of a block.
template <int D>
void find_neighbours(Connectivity& mesh, std::int64_t begin, std::int64_t end, Places& places,
                     std::vector<std::int32_t>& neighbours) {
    std::uint32_t* const place = places.of_vertex.data();
    std::uint16_t* face_out = mesh.faces.data() + static_cast<std::size_t>(mesh.offsets[begin]) * D;
    std::vector<std::int32_t> row;
    for (std::int64_t v = begin; v < end; ++v) {
        const std::int64_t corners = mesh.offsets[v + 1] - mesh.offsets[v];
        if (static_cast<std::int64_t>(row.size()) < corners * D) row.resize(corners * D);
        const std::uint32_t first = places.next;
        std::uint32_t next = first;
        for (std::int32_t i = mesh.offsets[v]; i < mesh.offsets[v + 1]; ++i) {
            const std::int32_t here = mesh.corners[i] % (D + 1);
            const std::int32_t* simplex = &mesh.simplices[mesh.corners[i] - here];
            for (const int position : opposite_face<D>(here)) {
                const std::int32_t u = simplex[position];
                std::uint32_t at = place[u];
                if (at < first) {
                    at = place[u] = next++;
                    row[at - first] = u;
                }
                *face_out++ = static_cast<std::uint16_t>(at - first);
            }
        }
        if (next - first > std::numeric_limits<std::uint16_t>::max())
            throw std::length_error("a vertex has more than 65,535 neighbours");
        neighbours.insert(neighbours.end(), row.begin(), row.begin() + (next - first));
        mesh.neighbour_offsets[v + 1] = static_cast<std::int32_t>(next - first);
        places.next = next;
    }
}

template <int D>
void build_neighbours(Connectivity& mesh, int threads) {
    mesh.faces.resize(mesh.corners.size() * D);
    mesh.neighbour_offsets.assign(mesh.n() + 1, 0);
    std::vector<std::vector<std::int32_t>> found(mesh.blocks());
    Spares<Places> spares;
    for_each_range(mesh.n(), BLOCK_SIZE, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t block) {
        spares.with([&](Places& places) {
            if (places.of_vertex.empty() || places.next > std::numeric_limits<std::int32_t>::max()) {
                places.of_vertex.assign(mesh.n(), 0);
                places.next = 1;
            }
            find_neighbours<D>(mesh, begin, end, places, found[block]);
        });
    });
    std::int64_t total = 0;
    for (std::int64_t v = 0; v < mesh.n(); ++v) {
        total += mesh.neighbour_offsets[v + 1];
        if (total > std::numeric_limits<std::int32_t>::max())
            throw std::length_error("the mesh has more than a billion edges");
        mesh.neighbour_offsets[v + 1] = static_cast<std::int32_t>(total);
    }
    mesh.neighbours.resize(total);
    for_each_item(mesh.blocks(), threads, [&](std::int64_t block) {
        std::copy(found[block].begin(), found[block].end(),
                  mesh.neighbours.begin() + mesh.neighbour_offsets[block * BLOCK_SIZE]);
        std::vector<std::int32_t>().swap(found[block]);
    });
}

// Adds the blocks before each that have a vertex of one of its elements: not all of these are neighbours.
inline void add_blocks_of_elements(const Elements& elements, std::vector<std::vector<std::int32_t>>& touching) {
    for (std::int64_t e = 0; e < elements.size(); ++e) {
        const std::int32_t* nodes = elements.nodes_of(e);
        for (int i = 0; i < elements.shape(e).nodes; ++i)
            for (int j = 0; j < i; ++j) {
                const auto one = static_cast<std::int32_t>(nodes[i] / BLOCK_SIZE), other = static_cast<std::int32_t>(nodes[j] / BLOCK_SIZE);
                if (one == other) continue;
                auto& others = touching[std::max(one, other)];
                if (others.empty() || others.back() != std::min(one, other)) others.push_back(std::min(one, other));
            }
    }
}

// Greedy, in the order of the blocks.
inline void colour_blocks(Connectivity& mesh, int threads) {
    std::vector<std::vector<std::int32_t>> touching(mesh.blocks());  // the blocks before each that touch it
    for_each_range(mesh.n(), BLOCK_SIZE, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t block) {
        auto& others = touching[block];
        for (std::int32_t i = mesh.neighbour_offsets[begin]; i < mesh.neighbour_offsets[end]; ++i) {
            const auto other = static_cast<std::int32_t>(mesh.neighbours[i] / BLOCK_SIZE);
            if (other < block && (others.empty() || others.back() != other)) others.push_back(other);
        }
    });
    add_blocks_of_elements(mesh.elements, touching);
    std::vector<std::int32_t> colour(mesh.blocks()), forbidden_by;
    for (std::int32_t block = 0; block < mesh.blocks(); ++block) {
        for (std::int32_t other : touching[block]) forbidden_by[colour[other]] = block;
        std::size_t c = 0;
        while (c < forbidden_by.size() && forbidden_by[c] == block) ++c;
        if (c == forbidden_by.size()) forbidden_by.push_back(-1);
        colour[block] = static_cast<std::int32_t>(c);
    }
    mesh.colour_offsets.assign(1, 0);
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(forbidden_by.size()); ++c) {
        for (std::int32_t block = 0; block < mesh.blocks(); ++block)
            if (colour[block] == c) mesh.colour_blocks.push_back(block);
        mesh.colour_offsets.push_back(static_cast<std::int32_t>(mesh.colour_blocks.size()));
    }
}

template <int D>
void build_stars(Connectivity& mesh, int threads) {
    build_neighbours<D>(mesh, threads);
    colour_blocks(mesh, threads);
}

// Marks so many rings of neighbours around the marked vertices.
inline void grow(const Connectivity& mesh, std::vector<std::uint8_t>& marked, int rings) {
    std::vector<std::int32_t> rim, next;
    for (std::size_t v = 0; v < marked.size(); ++v)
        if (marked[v]) rim.push_back(static_cast<std::int32_t>(v));
    for (int ring = 0; ring < rings; ++ring) {
        next.clear();
        for (const std::int32_t v : rim)
            for (std::int32_t i = mesh.neighbour_offsets[v]; i < mesh.neighbour_offsets[v + 1]; ++i) {
                const std::int32_t other = mesh.neighbours[i];
                if (marked[other]) continue;
                marked[other] = 1;
                next.push_back(other);
            }
        rim.swap(next);
    }
}

}  // namespace meshfix
