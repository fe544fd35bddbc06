// The elements among cells that are given by their faces: what they are, and their nodes in the order of their types.
//
// A face's loop is positive seen from outside of the cell that owns it. The base of an element is seen backwards from
// inside; one node lies over it, or over each of its nodes one.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

#include "common/parallel.hpp"

namespace meshfix {

// `Index` has 32 bits where these are enough for all numbers.
template <class Index>
struct FacesView {
    const Index *offsets, *vertices, *owner, *neighbour;  // neighbour: -1 where there is no cell
    std::int64_t count;
};

template <class Index>
struct CellsOfFaces {
    std::vector<Index> starts;         // of the sides of each cell, and of all
    std::vector<Index> faces;          // on which they are
    std::vector<std::int8_t> corners;  // of each cell: 4, 5, 6 or 8, by which it is known; 0: it is none of the elements
    int width = 8;                     // as many nodes as any may have
    std::vector<Index> nodes;          // `width` of each cell
};

// Which it is has no order that a processor could foresee, and so all are looked at.
template <int COUNT, class Index>
bool among(const Index* nodes, Index vertex) {
    bool found = false;
    for (int i = 0; i < COUNT; ++i) found |= nodes[i] == vertex;
    return found;
}

// The loops of a cell's faces, seen from outside.
template <class Index>
class CellLoops {
  public:
    void add(const FacesView<Index>& mesh, Index face, bool inner) {
        const Index first = mesh.offsets[face], size = mesh.offsets[face + 1] - first;
        whole_ &= count_ < 6 && (size == 3 || size == 4);
        if (!whole_) return;
        quads_ += size == 4;
        sizes_[count_] = static_cast<int>(size);
        for (Index i = 0; i < size; ++i) loops_[count_][i] = mesh.vertices[first + (inner ? size - 1 - i : i)];
        ++count_;
    }

    // The number of nodes of the element that it is, which are written; 0: it is none.
    int order(Index* nodes) const {
        if (!whole_) return 0;
        if (count_ == 4 && quads_ == 0) return cone<3>(nodes);
        if (count_ == 5 && quads_ == 1) return cone<4>(nodes);
        if (count_ == 5 && quads_ == 3) return prism<3>(nodes);
        return count_ == 6 && quads_ == 6 ? prism<4>(nodes) : 0;
    }

  private:
    std::array<std::array<Index, 4>, 6> loops_;
    std::array<int, 6> sizes_{};
    int count_ = 0, quads_ = 0;
    bool whole_ = true;

    int base_of(int size) const { return static_cast<int>(std::find(sizes_.begin(), sizes_.end(), size) - sizes_.begin()); }

    template <int SIZE>
    void bottom(int base, Index* nodes) const {
        nodes[0] = loops_[base][0];
        for (int i = 1; i < SIZE; ++i) nodes[i] = loops_[base][SIZE - i];
    }

    // Whether these nodes differ, and the faces have no others.
    template <int COUNT>
    bool has_all(const Index* nodes) const {
        bool good = true;
        for (int i = 0; i < COUNT; ++i)
            for (int j = 0; j < i; ++j) good &= nodes[i] != nodes[j];
        for (int f = 0; f < count_; ++f)
            for (int i = 0; i < sizes_[f]; ++i) good &= among<COUNT>(nodes, loops_[f][i]);
        return good;
    }

    template <int SIZE>
    int cone(Index* nodes) const {
        const int base = base_of(SIZE), side = base == 0 ? 1 : 0;
        bottom<SIZE>(base, nodes);
        nodes[SIZE] = -1;
        for (int i = 0; i < sizes_[side]; ++i)
            if (!among<SIZE>(nodes, loops_[side][i])) nodes[SIZE] = loops_[side][i];
        return nodes[SIZE] >= 0 && has_all<SIZE + 1>(nodes) ? SIZE + 1 : 0;
    }

    template <int SIZE>
    int prism(Index* nodes) const {
        const int base = base_of(SIZE);
        bottom<SIZE>(base, nodes);
        std::fill(nodes + SIZE, nodes + 2 * SIZE, Index{-1});
        for (int f = 0; f < count_; ++f) {
            for (int i = 0; f != base && i < sizes_[f]; ++i) {
                const Index above = loops_[f][(i + 1) % sizes_[f]];
                const auto under = std::find(nodes, nodes + SIZE, loops_[f][i]) - nodes;
                if (under == SIZE || among<SIZE>(nodes, above)) continue;
                if (nodes[SIZE + under] >= 0) return 0;
                nodes[SIZE + under] = above;
            }
        }
        return !among<SIZE>(nodes + SIZE, Index{-1}) && has_all<2 * SIZE>(nodes) ? 2 * SIZE : 0;
    }
};

// Tetrahedra that get their faces one after the other, in which order `CellLoops` has them.
template <class Index>
class Tetrahedra {
  public:
    std::vector<std::int8_t> counts;  // of the faces of each
    std::vector<Index> nodes;         // four of each

    explicit Tetrahedra(std::int64_t cells) : counts(cells, 0), nodes(4 * cells, -1) {}

    // False: the cell is none. The loop is that of the face, and `inner` that it is seen from inside.
    bool add(Index cell, const Index* loop, bool inner) {
        Index* const mine = nodes.data() + 4 * cell;
        const int before = counts[cell]++;
        if (before == 0) {
            mine[0] = loop[inner ? 2 : 0], mine[1] = loop[inner ? 0 : 2], mine[2] = loop[1];
            return mine[0] != mine[1] && mine[1] != mine[2] && mine[2] != mine[0];
        }
        for (int i = 0; i < 3; ++i) {
            if (among<3>(mine, loop[i])) continue;
            if (mine[3] < 0) mine[3] = loop[i];
            if (mine[3] != loop[i]) return false;
        }
        return before < 4 && mine[3] >= 0;
    }
};

// Finds the elements where all are tetrahedra, as nearly always where all faces are triangles; false: they are not.
template <class Index>
bool find_tetrahedra(const FacesView<Index>& mesh, std::int64_t cells, CellsOfFaces<Index>& found) {
    Tetrahedra<Index> tets(cells);
    for (Index face = 0; face < mesh.count; ++face) {
        if (mesh.offsets[face + 1] - mesh.offsets[face] != 3) return false;
        const Index *const loop = mesh.vertices + mesh.offsets[face], other = mesh.neighbour[face];
        if (!tets.add(mesh.owner[face], loop, false) || (other >= 0 && !tets.add(other, loop, true))) return false;
    }
    if (std::any_of(tets.counts.begin(), tets.counts.end(), [](std::int8_t count) { return count != 4; })) return false;
    found.width = 4;
    found.corners = std::move(tets.counts);
    found.nodes = std::move(tets.nodes);
    return true;
}

// `cells` is more than any number of a cell. Where all are tetrahedra nobody asks for their sides.
template <class Index>
CellsOfFaces<Index> cells_of_faces(const FacesView<Index>& mesh, std::int64_t cells, int threads) {
    CellsOfFaces<Index> found;
    if (find_tetrahedra(mesh, cells, found)) return found;
    found.starts.assign(cells + 1, 0);
    const auto each_side = [&](const auto& f) {  // ~face: seen from its neighbour
        for (Index face = 0; face < mesh.count; ++face) {
            f(mesh.owner[face], face);
            if (mesh.neighbour[face] >= 0) f(mesh.neighbour[face], ~face);
        }
    };
    each_side([&](Index cell, Index) { ++found.starts[cell + 1]; });
    const Index most = *std::max_element(found.starts.begin(), found.starts.end());
    found.width = most <= 4 ? 4 : most == 5 ? 6 : 8;
    std::partial_sum(found.starts.begin(), found.starts.end(), found.starts.begin());
    found.faces.resize(found.starts.back());
    std::vector<Index> next(found.starts.begin(), found.starts.end() - 1);
    each_side([&](Index cell, Index side) { found.faces[next[cell]++] = side; });
    found.corners.resize(cells);
    found.nodes.resize(found.width * cells);
    for_each_range(cells, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t cell = begin; cell < end; ++cell) {
            CellLoops<Index> loops;
            for (Index i = found.starts[cell]; i < found.starts[cell + 1]; ++i) {
                const bool inner = found.faces[i] < 0;
                if (inner) found.faces[i] = ~found.faces[i];
                loops.add(mesh, found.faces[i], inner);
            }
            Index* const nodes = found.nodes.data() + found.width * cell;
            found.corners[cell] = static_cast<std::int8_t>(loops.order(nodes));
        }
    });
    return found;
}

}  // namespace meshfix
