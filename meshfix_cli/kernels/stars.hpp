// Stars: around each vertex its neighbours and the faces opposite it; and the blocks of vertices that are the
// unit of parallel work.
//
// simplices (m, D+1)        vertex numbers, positively oriented
// offsets (n+1)             rows of incident and faces
// incident (m*(D+1))        the simplices at each vertex
// faces (m*(D+1), D)        for each of them the opposite face, as positions in the vertex's row of neighbours
// neighbour_offsets (n+1), neighbours
// block_offsets, block_vertices    every vertex that has a star, in blocks
// colour_offsets, colour_blocks    blocks of one colour share no edge
#pragma once

#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include "facets.hpp"

namespace meshfix {

// Large enough for a block to be mostly interior, small enough to stay in the first-level cache.
constexpr std::size_t BLOCK_SIZE = 1024;

struct Stars {
    std::vector<std::int32_t> offsets, incident, neighbour_offsets, neighbours;
    std::vector<std::uint16_t> faces;
    std::vector<std::int32_t> block_offsets, block_vertices, colour_offsets, colour_blocks;
};

template <int D>
void build_neighbours(Stars& stars, const std::int32_t* simplices, std::int64_t n) {
    std::vector<std::int32_t> seen_at(n, -1), position(n);
    stars.neighbour_offsets.assign(1, 0);
    stars.faces.resize(stars.incident.size() * D);
    for (std::int64_t v = 0; v < n; ++v) {
        const std::size_t row = stars.neighbours.size();
        for (std::int32_t i = stars.offsets[v]; i < stars.offsets[v + 1]; ++i) {
            const std::int32_t corner = stars.incident[i], first = corner / (D + 1) * (D + 1);
            const auto& face = opposite_face<D>(corner - first);
            for (int k = 0; k < D; ++k) {
                const std::int32_t u = simplices[first + face[k]];
                if (seen_at[u] != v) {
                    seen_at[u] = static_cast<std::int32_t>(v);
                    position[u] = static_cast<std::int32_t>(stars.neighbours.size() - row);
                    stars.neighbours.push_back(u);
                }
                stars.faces[static_cast<std::size_t>(i) * D + k] = static_cast<std::uint16_t>(position[u]);
            }
            stars.incident[i] = corner / (D + 1);
        }
        if (stars.neighbours.size() - row > std::numeric_limits<std::uint16_t>::max())
            throw std::length_error("a vertex has more than 65,535 neighbours");
        if (stars.neighbours.size() > std::numeric_limits<std::int32_t>::max())
            throw std::length_error("the mesh has more than a billion edges");
        stars.neighbour_offsets.push_back(static_cast<std::int32_t>(stars.neighbours.size()));
    }
}

// Blocks grow breadth first from the rim of those before, so they are compact whatever the points are: the order
// of work, and with it the result, does not depend on the unit of length or on the axes.
inline void build_blocks(Stars& stars, std::int64_t n) {
    std::vector<std::uint8_t> taken(n, 0);
    std::vector<std::int32_t> queued_in(n, -1);  // the last block whose queue the vertex joined
    std::vector<std::int32_t> queue, rim;        // rim: every vertex in the order in which it was first queued
    std::size_t queue_head = 0, rim_head = 0;
    std::int32_t unseen = 0;
    const auto first_free = [&](const std::vector<std::int32_t>& list, std::size_t& head) {
        while (head < list.size())
            if (!taken[list[head++]]) return list[head - 1];
        return std::int32_t{-1};
    };
    const auto next_vertex = [&] {
        std::int32_t v = first_free(queue, queue_head);
        if (v < 0) v = first_free(rim, rim_head);
        if (v >= 0) return v;
        while (unseen < n && (taken[unseen] || stars.offsets[unseen] == stars.offsets[unseen + 1])) ++unseen;
        return unseen;
    };

    std::int32_t block = 0;
    std::size_t start = 0;
    auto& vertices = stars.block_vertices;
    const auto close_block = [&] {
        std::sort(vertices.begin() + static_cast<std::ptrdiff_t>(start), vertices.end());
        start = vertices.size();
        stars.block_offsets.push_back(static_cast<std::int32_t>(start));
        queue.clear();
        queue_head = 0;
        ++block;
    };
    stars.block_offsets.assign(1, 0);
    for (std::int32_t v = next_vertex(); v < n; v = next_vertex()) {
        taken[v] = 1;
        vertices.push_back(v);
        for (std::int32_t i = stars.neighbour_offsets[v]; i < stars.neighbour_offsets[v + 1]; ++i) {
            const std::int32_t u = stars.neighbours[i];
            if (taken[u] || queued_in[u] == block) continue;
            if (queued_in[u] < 0) rim.push_back(u);
            queued_in[u] = block;
            queue.push_back(u);
        }
        if (vertices.size() - start == BLOCK_SIZE) close_block();
    }
    if (vertices.size() > start) close_block();
}

// Greedy, in the order of the blocks.
inline void colour_blocks(Stars& stars, std::int64_t n) {
    const std::size_t blocks = stars.block_offsets.size() - 1;
    std::vector<std::int32_t> block_of(n, -1), colour(blocks, -1), forbidden_by;
    for (std::size_t b = 0; b < blocks; ++b)
        for (std::int32_t i = stars.block_offsets[b]; i < stars.block_offsets[b + 1]; ++i)
            block_of[stars.block_vertices[i]] = static_cast<std::int32_t>(b);
    for (std::size_t b = 0; b < blocks; ++b) {
        for (std::int32_t i = stars.block_offsets[b]; i < stars.block_offsets[b + 1]; ++i) {
            const std::int32_t v = stars.block_vertices[i];
            for (std::int32_t j = stars.neighbour_offsets[v]; j < stars.neighbour_offsets[v + 1]; ++j) {
                const std::int32_t c = colour[block_of[stars.neighbours[j]]];
                if (c >= 0) forbidden_by[c] = static_cast<std::int32_t>(b);
            }
        }
        std::size_t c = 0;
        while (c < forbidden_by.size() && forbidden_by[c] == static_cast<std::int32_t>(b)) ++c;
        if (c == forbidden_by.size()) forbidden_by.push_back(-1);
        colour[b] = static_cast<std::int32_t>(c);
    }
    stars.colour_offsets.assign(1, 0);
    for (std::size_t c = 0; c < forbidden_by.size(); ++c) {
        for (std::size_t b = 0; b < blocks; ++b)
            if (colour[b] == static_cast<std::int32_t>(c)) stars.colour_blocks.push_back(static_cast<std::int32_t>(b));
        stars.colour_offsets.push_back(static_cast<std::int32_t>(stars.colour_blocks.size()));
    }
}

template <int D>
Stars build_stars(const std::int32_t* simplices, std::int64_t m, std::int64_t n) {
    Stars stars;
    Incidence csr = incidence<D>(simplices, m, n);
    stars.offsets = std::move(csr.offsets);
    stars.incident = std::move(csr.corners);
    build_neighbours<D>(stars, simplices, n);
    build_blocks(stars, n);
    colour_blocks(stars, n);
    return stars;
}

}  // namespace meshfix
