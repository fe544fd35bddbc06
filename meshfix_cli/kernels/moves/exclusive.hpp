// Simplices that exclude each other: they have one and the same free vertex, and no position of it makes all of them
// positive. The dual of the linear programme of section 2 certifies that: weights y >= 0 of these simplices with
// sum y_i n_i = 0 and sum y_i c_i <= 0, to rounding: what is positive by less could not be told to be valid.
#pragma once

#include <vector>

#include "common/parallel.hpp"
#include "mesh/stars.hpp"
#include "moves/linear_program.hpp"

namespace meshfix {

// Appends the simplices of a vertex that exclude each other, none where they do not.
template <int D>
void find_exclusive(const Connectivity& mesh, const StarsView& stars, const double* points, const std::uint8_t* movable,
                    std::int32_t v, std::vector<std::int32_t>& found) {
    Star<D> star;
    star.gather(stars, points, v);
    const std::int32_t* neighbours = stars.neighbours + stars.neighbour_offsets[v];
    std::vector<std::uint16_t> faces;
    std::vector<std::int32_t> owners;
    for (int i = 0; i < star.faces_count; ++i) {
        const std::uint16_t* face = star.faces + i * D;
        bool alone = true;
        for (int k = 0; k < D; ++k) alone &= movable[neighbours[face[k]]] == 0;
        if (!alone) continue;
        faces.insert(faces.end(), face, face + D);
        owners.push_back(mesh.corners[mesh.offsets[v] + i] / (D + 1));
    }
    star.faces = faces.data();
    star.faces_count = static_cast<int>(owners.size());
    if (star.faces_count == 0) return;
    star.fill_blocks();
    LinearProgram<D> program;
    program.set(star, false);
    if (program.solve() != LpStatus::optimal) return;
    std::vector<std::int32_t> certificate;
    double largest = 0.0;
    for (int row = 0; row <= D; ++row) {
        if (!(program.weight(row) > LP_PIVOT)) continue;
        if (program.basis[row] >= program.faces_count) return;  // a side of the box: farther away it may be possible
        certificate.push_back(owners[std::min(program.basis[row], star.faces_count - 1)]);
        largest = std::max(largest, std::fabs(program.cost(program.basis[row])));
    }
    if (program.pi[D] > LP_IMPOSSIBLE * largest) return;
    found.insert(found.end(), certificate.begin(), certificate.end());
}

// Of some vertices, in their order.
template <int D>
std::vector<std::int32_t> exclusive_simplices(const Connectivity& mesh, const StarsView& stars, const double* points,
                                              const std::uint8_t* movable, const std::int32_t* vertices,
                                              std::int64_t count, int threads) {
    std::vector<std::vector<std::int32_t>> parts(count / PER_ITEM + 1);
    for_each_range(count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        for (std::int64_t i = begin; i < end; ++i)
            find_exclusive<D>(mesh, stars, points, movable, vertices[i], parts[item]);
    });
    std::vector<std::int32_t> found;
    for (const auto& part : parts) found.insert(found.end(), part.begin(), part.end());
    return found;
}

}  // namespace meshfix
