// Simplices that exclude each other: they have one and the same free vertex, and no position of it makes all of them
// positive. The dual of the linear programme of section 2 certifies that: weights y >= 0 of these simplices with
// sum y_i n_i = 0 and sum y_i c_i <= 0, to rounding: what is positive by less could not be told to be valid. Of a vertex that
// slides in a line or plane it is the programme in that; a curve or surface is searched, see on_reference.hpp. There one
// simplex can be excluded by itself.
#pragma once

#include <vector>

#include "common/parallel.hpp"
#include "mesh/stars.hpp"
#include "moves/linear_program.hpp"
#include "moves/on_reference.hpp"

namespace meshfix {

// Simplices that exclude each other, and such that are excluded one by one: only where vertices slide there are any.
struct Excluded {
    std::vector<std::int32_t> together, alone;
};

// Simplices of which one vertex is the only free one: their faces in its star, and what they are called. Hopeless ones are
// left out: with what is inverted wherever anything goes, nothing else has to agree.
struct Ring {
    std::vector<std::uint16_t> faces;
    std::vector<std::int32_t> owners;
};

template <int D>
Ring ring_of(const Connectivity& mesh, const StarsView& stars, const std::uint8_t* movable, const std::uint8_t* hopeless,
             std::int32_t v) {
    const std::int32_t* neighbours = stars.neighbours + stars.neighbour_offsets[v];
    Ring found;
    for (std::int32_t i = stars.offsets[v]; i < stars.offsets[v + 1]; ++i) {
        const std::uint16_t* face = stars.faces + static_cast<std::int64_t>(i) * D;
        const std::int32_t owner = mesh.corners[i] / (D + 1);
        bool alone = hopeless[owner] == 0;
        for (int k = 0; k < D; ++k) alone &= movable[neighbours[face[k]]] == 0;
        if (!alone) continue;
        found.faces.insert(found.faces.end(), face, face + D);
        found.owners.push_back(owner);
    }
    return found;
}

// Appends the certificate that a programme of some simplices has, if it has one.
template <int K>
void take_certificate(LinearProgram<K>& program, const std::vector<std::int32_t>& owners, Excluded& found) {
    if (program.solve() != LpStatus::optimal) return;
    const int last = static_cast<int>(owners.size()) - 1;
    std::vector<std::int32_t> certificate;
    double largest = 0.0;
    for (int row = 0; row <= K; ++row) {
        if (!(program.weight(row) > LP_PIVOT)) continue;
        if (program.basis[row] >= program.faces_count) return;  // a side of the box: farther away it may be possible
        certificate.push_back(owners[std::min(program.basis[row], last)]);
        largest = std::max(largest, std::fabs(program.cost(program.basis[row])));
    }
    if (program.pi[K] > LP_IMPOSSIBLE * largest) return;
    found.together.insert(found.together.end(), certificate.begin(), certificate.end());
}

// The same in a line (K = 1) or plane: what does not depend on where the vertex goes there decides alone.
template <int D, int K>
void exclude_along(const Star<D>& star, const std::vector<Affine<D>>& functions, const Ring& ring, Excluded& found) {
    const auto coordinates = [&](const Vec<D>& v) {
        Vec<K> y;
        for (int k = 0; k < K; ++k) y[k] = dot(star.directions.axes[k], v);
        return y;
    };
    std::vector<Vec<K>> neighbours;
    for (const Vec<D>& p : star.neighbours) neighbours.push_back(coordinates(p - star.centre));
    std::vector<Affine<K>> along;
    std::vector<std::int32_t> owners;
    for (std::size_t i = 0; i < functions.size(); ++i) {
        const Affine<D>& f = functions[i];
        const Vec<K> slope = coordinates(f.gradient);
        const double value = f.value + dot(f.gradient, star.centre);
        if (norm2(slope) > LP_PINNED2 * norm2(f.gradient)) {
            along.push_back({value, slope});
            owners.push_back(ring.owners[i]);
            continue;
        }
        const double most = value + HELD_FAR * star.radius * std::sqrt(norm2(slope));
        if (most <= HELD_IMPOSSIBLE * star.radius * std::sqrt(norm2(f.gradient))) found.alone.push_back(ring.owners[i]);
    }
    if (along.empty()) return;
    LinearProgram<K> program;
    program.set(neighbours, star.radius, along, false);
    program.box = HELD_FAR * star.radius;
    program.largest_cost = std::max(program.largest_cost, program.box);
    take_certificate(program, owners, found);
}

// The same on a curve or surface: each function for itself, and then all of them.
template <int D>
void exclude_on_reference(const Star<D>& star, const std::vector<Affine<D>>& functions, const Ring& ring, Excluded& found) {
    bool alone = false;
    for (std::size_t i = 0; i < functions.size(); ++i) {
        OnReference<D> search(star, {functions[i]});
        if (!search.is_excluded()) continue;
        found.alone.push_back(ring.owners[i]);
        alone = true;
    }
    OnReference<D> search(star, functions);
    if (alone || functions.size() == 1 || !search.is_excluded()) return;
    for (std::size_t i = 0; i < functions.size(); ++i)
        if (search.blamed[i]) found.together.push_back(ring.owners[i]);
}

// Appends the simplices of a vertex that are excluded, none where they are not.
template <int D>
void find_exclusive(const Connectivity& mesh, const StarsView& stars, const Freedom* freedom, const double* points,
                    const std::uint8_t* movable, const std::uint8_t* hopeless, std::int32_t v, Excluded& found) {
    const Ring ring = ring_of<D>(mesh, stars, movable, hopeless, v);
    if (ring.owners.empty()) return;
    Star<D> star;
    star.gather(stars, freedom, points, points, v);
    star.faces = ring.faces.data();
    star.faces_count = static_cast<int>(ring.owners.size());
    if (star.directions.anywhere()) {
        star.fill_blocks();
        LinearProgram<D> program;
        program.set(star, false);
        return take_certificate(program, ring.owners, found);
    }
    std::vector<Affine<D>> functions;
    take_faces(star, functions);
    if (star.directions.curved())
        exclude_on_reference(star, functions, ring, found);
    else if (D == 3 && star.directions.count == 2)
        exclude_along<D, 2>(star, functions, ring, found);
    else
        exclude_along<D, 1>(star, functions, ring, found);
}

// Of some vertices, in their order.
template <int D>
Excluded exclusive_simplices(const Connectivity& mesh, const StarsView& stars, const Freedom* freedom, const double* points,
                             const std::uint8_t* movable, const std::uint8_t* hopeless, const std::int32_t* vertices,
                             std::int64_t count, int threads) {
    std::vector<Excluded> parts(count / PER_ITEM + 1);
    for_each_range(count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        for (std::int64_t i = begin; i < end; ++i)
            find_exclusive<D>(mesh, stars, freedom, points, movable, hopeless, vertices[i], parts[item]);
    });
    Excluded found;
    for (const auto& part : parts) {
        found.together.insert(found.together.end(), part.together.begin(), part.together.end());
        found.alone.insert(found.alone.end(), part.alone.begin(), part.alone.end());
    }
    return found;
}

}  // namespace meshfix
