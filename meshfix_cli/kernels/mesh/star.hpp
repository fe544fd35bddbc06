// One star in its local frame: origin at the centroid of the neighbours, unit a power of two near its size, so
// that scaling is exact and the kernels do not depend on the unit of length or on the offset of the mesh.
//
// neighbours[j]   position of neighbour j
// faces           faces_count rows of D positions in `neighbours`, each in positive order seen from inside
// blocks          the coordinates of the faces' vertices, LANES faces side by side for the vector units; the last
//                 block is filled up with its last face, which changes no minimum
// position        the free vertex
// radius          the distance of the farthest neighbour; 0: all neighbours are in one point
// directions      in which the vertex may go
// centre          where the mean of the neighbours draws it: the origin, or the place for it in what the vertex slides in
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "mesh/elements.hpp"
#include "mesh/freedom.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

// Views of the arrays of stars.hpp; no elements: all are simplices.
struct StarsView {
    const std::int32_t* offsets;
    const std::uint16_t* faces;
    const std::int32_t* neighbour_offsets;
    const std::int32_t* neighbours;
    const std::int32_t* corners;
    const Elements* elements;

    std::int32_t element_of(std::int32_t corner, int corners_per_simplex) const {
        return elements->owners[corner / corners_per_simplex];
    }
};

// Mean of some vertices, summed as differences: at a far offset the sum itself would lose digits.
template <int D>
inline Vec<D> mean_of(const std::int32_t* vertices, std::int32_t count, const double* points) {
    const Vec<D> first = load<D>(points + static_cast<std::int64_t>(vertices[0]) * D);
    Vec<D> sum{};
    for (std::int32_t i = 1; i < count; ++i)
        sum = sum + (load<D>(points + static_cast<std::int64_t>(vertices[i]) * D) - first);
    return first + (1.0 / count) * sum;
}

// Of the neighbours of v.
template <int D>
inline Vec<D> centroid(const StarsView& stars, const double* points, std::int64_t v) {
    const std::int32_t begin = stars.neighbour_offsets[v], end = stars.neighbour_offsets[v + 1];
    return mean_of<D>(stars.neighbours + begin, end - begin, points);
}

// Of those in what v slides in, there.
template <int D>
inline Vec<D> centroid(const Freedom& freedom, const Directions<D>& directions, const double* points, std::int64_t v) {
    const std::int32_t begin = freedom.offsets[v], end = freedom.offsets[v + 1];
    return directions.onto(mean_of<D>(freedom.neighbours.data() + begin, end - begin, points));
}

// LANES faces: coordinate c of vertex k is [k][c].
template <int D>
using FaceBlock = Edges<D, Pack>;

// What LANES faces are where the elements are not all simplices: a whole simplex, or the corner of an element.
template <int D>
struct Roles {
    Pack corner;  // where it is: 0: nowhere, the simplex is an element; 1: the free vertex; 2 + k: vertex k
    Pack weight;  // of the scaled Jacobian
};

template <int D>
struct Star {
    std::vector<Vec<D>> neighbours;
    std::vector<FaceBlock<D>> blocks;
    std::vector<Roles<D>> roles;  // of the blocks; empty: all are simplices
    const std::uint16_t* faces = nullptr;
    int faces_count = 0;
    Vec<D> origin{}, position{}, centre{};
    double unit = 1.0, radius = 0.0;
    Directions<D> directions{};

    // `freedom`: null: v may go anywhere.
    void gather(const StarsView& stars, const Freedom* freedom, const double* anchors, const double* points,
                std::int64_t v) {
        gather(stars, points, v);
        directions.set_anywhere();
        centre = {};
        if (freedom == nullptr || freedom->anywhere(v)) return;
        directions.set(*freedom, v, load<D>(anchors + v * D), load<D>(points + v * D));
        centre = to_local(centroid<D>(*freedom, directions, points, v));
    }

    void gather(const StarsView& stars, const double* points, std::int64_t v) {
        const std::int32_t begin = stars.neighbour_offsets[v], end = stars.neighbour_offsets[v + 1];
        faces = stars.faces + static_cast<std::int64_t>(stars.offsets[v]) * D;
        faces_count = stars.offsets[v + 1] - stars.offsets[v];
        origin = centroid<D>(stars, points, v);
        neighbours.resize(end - begin);
        double size2 = 0.0;
        for (std::int32_t i = begin; i < end; ++i) {
            const Vec<D> p = load<D>(points + static_cast<std::int64_t>(stars.neighbours[i]) * D) - origin;
            neighbours[i - begin] = p;
            size2 = std::max(size2, norm2(p));
        }
        position = load<D>(points + v * D) - origin;
        take_unit(size2);
        set_roles(stars, v);
    }

    // Chooses the unit by the square of the star's size, and gives neighbours and position in it; the origin is theirs already.
    void take_unit(double size2) {
        int exponent = 0;
        radius = std::frexp(std::sqrt(size2), &exponent);
        unit = std::ldexp(1.0, exponent);
        const double scale = 1.0 / unit;
        for (auto& p : neighbours) p = scale * p;
        position = scale * position;
        fill_blocks();
    }

    void set_roles(const StarsView& stars, std::int64_t v) {
        roles.clear();  // the star before may have been of another mesh
        if (stars.elements == nullptr) return;
        roles.resize(blocks.size());
        for (int i = 0; i < static_cast<int>(roles.size()) * LANES; ++i) {
            const std::int32_t corner = stars.corners[stars.offsets[v] + std::min(i, faces_count - 1)];
            const int position_of_free = corner % (D + 1);
            const ElementShape& shape = stars.elements->shape(stars.element_of(corner, D + 1));
            Roles<D>& role = roles[i / LANES];
            const int lane = i % LANES;
            const auto& face = opposite_face<D>(position_of_free);
            role.weight[lane] = shape.weight;
            role.corner[lane] = shape.simplices > 1 && position_of_free == 0 ? 1.0 : 0.0;
            for (int k = 0; k < D; ++k)
                if (shape.simplices > 1 && face[k] == 0) role.corner[lane] = 2.0 + k;
        }
    }

    void fill_blocks() {
        blocks.resize((faces_count + LANES - 1) / LANES);
        for (int i = 0; i < static_cast<int>(blocks.size()) * LANES; ++i) {
            const std::uint16_t* face = faces + face_at(i);
            for (int k = 0; k < D; ++k)
                for (int c = 0; c < D; ++c) blocks[i / LANES][k][c][i % LANES] = neighbours[face[k]][c];
        }
    }

    // Where in `faces` that of a lane begins; behind the end, the last one.
    int face_at(int i) const { return std::min(i, faces_count - 1) * D; }

    // 1 for the faces of a block, 0 for what fills up the last one.
    Pack weights(std::size_t block) const {
        Pack w = constant<Pack>(1.0);
        for (int i = 0; i < LANES; ++i)
            if (static_cast<int>(block) * LANES + i >= faces_count) w[i] = 0.0;
        return w;
    }

    Vec<D> to_global(const Vec<D>& x) const { return origin + unit * x; }
    Vec<D> to_local(const Vec<D>& p) const { return (1.0 / unit) * (p - origin); }

    // Where in the global coordinates the vertex comes to be, if it goes to x.
    Vec<D> landing(const Vec<D>& x) const { return directions.onto(to_global(x)); }

    // The nearest position that the global coordinates can hold: what is judged is what will be stored.
    Vec<D> snap(const Vec<D>& x) const { return to_local(landing(x)); }

    // Edges from x to the vertices of face i, and of all faces of a block.
    Edges<D> edges(int i, const Vec<D>& x) const {
        Edges<D> e;
        for (int k = 0; k < D; ++k) e[k] = neighbours[faces[i * D + k]] - x;
        return e;
    }
    static Edges<D, Pack> edges(const FaceBlock<D>& block, const Vec<D>& x) {
        Edges<D, Pack> e;
        for (int k = 0; k < D; ++k)
            for (int c = 0; c < D; ++c) e[k][c] = block[k][c] - x[c];
        return e;
    }

    bool valid(const Vec<D>& x) const {
        for (std::size_t b = 0; b < blocks.size(); ++b) {
            const auto e = edges(blocks[b], x);
            const Pack ones = constant<Pack>(1.0);
            const Pack plain = select(is_plainly_valid<D>(determinant(e), longest_edge2<D>(e)), ones, ones - 1.0);
            for (int i = 0; i < LANES; ++i)
                if (plain[i] == 0.0 && !valid_face(b, i, x)) return false;
        }
        return true;
    }

    // Whether the simplex in a lane of a block is valid.
    bool valid_face(std::size_t block, int lane, const Vec<D>& x) const {
        const int i = face_of(block, lane);
        const Edges<D> e = edges(i, x);
        return is_valid<D>(e, determinant(e), [&] { return corners(i, x); }, 1.0);
    }
    int face_of(std::size_t block, int lane) const {
        return std::min(static_cast<int>(block) * LANES + lane, faces_count - 1);
    }

    // The simplex of face i: x, then the face.
    Corners<D> corners(int i, const Vec<D>& x) const {
        Corners<D> p{x};
        for (int k = 0; k < D; ++k) p[k + 1] = neighbours[faces[i * D + k]];
        return p;
    }
};

}  // namespace meshfix
