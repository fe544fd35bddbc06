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

struct FacesView {
    const std::int64_t *offsets, *vertices, *owner, *neighbour;  // neighbour: -1 where there is no cell
    std::int64_t count;
};

struct CellsOfFaces {
    static constexpr int NODES = 8;
    std::vector<std::int64_t> starts;  // of the sides of each cell, and of all
    std::vector<std::int64_t> faces;   // on which they are
    std::vector<std::int8_t> corners;  // of each cell: 4, 5, 6 or 8, by which it is known; 0: it is none of the elements
    std::vector<std::int64_t> nodes;   // NODES of each cell
};

// The loops of a cell's faces, seen from outside.
class CellLoops {
  public:
    void add(const FacesView& mesh, std::int64_t face, bool inner) {
        const std::int64_t first = mesh.offsets[face], size = mesh.offsets[face + 1] - first;
        whole_ &= count_ < 6 && (size == 3 || size == 4);
        if (!whole_) return;
        quads_ += size == 4;
        sizes_[count_] = static_cast<int>(size);
        for (std::int64_t i = 0; i < size; ++i) loops_[count_][i] = mesh.vertices[first + (inner ? size - 1 - i : i)];
        ++count_;
    }

    // The number of nodes of the element that it is, which are written; 0: it is none.
    int order(std::int64_t* nodes) const {
        if (!whole_) return 0;
        if (count_ == 4 && quads_ == 0) return cone(3, nodes);
        if (count_ == 5 && quads_ == 1) return cone(4, nodes);
        if (count_ == 5 && quads_ == 3) return prism(3, nodes);
        return count_ == 6 && quads_ == 6 ? prism(4, nodes) : 0;
    }

  private:
    std::array<std::array<std::int64_t, 4>, 6> loops_{};
    std::array<int, 6> sizes_{};
    int count_ = 0, quads_ = 0;
    bool whole_ = true;

    int base_of(int size) const { return static_cast<int>(std::find(sizes_.begin(), sizes_.end(), size) - sizes_.begin()); }

    void bottom(int base, std::int64_t* nodes) const {
        const int size = sizes_[base];
        nodes[0] = loops_[base][0];
        for (int i = 1; i < size; ++i) nodes[i] = loops_[base][size - i];
    }

    static bool among(const std::int64_t* nodes, int count, std::int64_t vertex) {
        return std::find(nodes, nodes + count, vertex) != nodes + count;
    }

    // Whether these nodes differ, and the faces have no others.
    bool has_all(const std::int64_t* nodes, int count) const {
        for (int i = 0; i < count; ++i)
            if (among(nodes, i, nodes[i])) return false;
        for (int f = 0; f < count_; ++f)
            for (int i = 0; i < sizes_[f]; ++i)
                if (!among(nodes, count, loops_[f][i])) return false;
        return true;
    }

    int cone(int size, std::int64_t* nodes) const {
        const int base = base_of(size), side = base == 0 ? 1 : 0;
        bottom(base, nodes);
        nodes[size] = -1;
        for (int i = 0; i < sizes_[side]; ++i)
            if (!among(nodes, size, loops_[side][i])) nodes[size] = loops_[side][i];
        return nodes[size] >= 0 && has_all(nodes, size + 1) ? size + 1 : 0;
    }

    int prism(int size, std::int64_t* nodes) const {
        const int base = base_of(size);
        bottom(base, nodes);
        std::fill(nodes + size, nodes + 2 * size, std::int64_t{-1});
        for (int f = 0; f < count_; ++f) {
            for (int i = 0; f != base && i < sizes_[f]; ++i) {
                const std::int64_t above = loops_[f][(i + 1) % sizes_[f]];
                const auto under = std::find(nodes, nodes + size, loops_[f][i]) - nodes;
                if (under == size || among(nodes, size, above)) continue;
                if (nodes[size + under] >= 0) return 0;
                nodes[size + under] = above;
            }
        }
        return !among(nodes + size, size, -1) && has_all(nodes, 2 * size) ? 2 * size : 0;
    }
};

// `cells` is more than any number of a cell.
inline CellsOfFaces cells_of_faces(const FacesView& mesh, std::int64_t cells, int threads) {
    CellsOfFaces found;
    found.starts.assign(cells + 1, 0);
    const auto each_side = [&](const auto& f) {
        for (std::int64_t face = 0; face < mesh.count; ++face) {
            f(mesh.owner[face], face);
            if (mesh.neighbour[face] >= 0) f(mesh.neighbour[face], face);
        }
    };
    each_side([&](std::int64_t cell, std::int64_t) { ++found.starts[cell + 1]; });
    std::partial_sum(found.starts.begin(), found.starts.end(), found.starts.begin());
    found.faces.resize(found.starts.back());
    std::vector<std::int64_t> next(found.starts.begin(), found.starts.end() - 1);
    each_side([&](std::int64_t cell, std::int64_t face) { found.faces[next[cell]++] = face; });
    found.corners.resize(cells);
    found.nodes.resize(CellsOfFaces::NODES * cells);
    for_each_range(cells, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t cell = begin; cell < end; ++cell) {
            CellLoops loops;
            for (std::int64_t i = found.starts[cell]; i < found.starts[cell + 1]; ++i)
                loops.add(mesh, found.faces[i], mesh.owner[found.faces[i]] != cell);
            std::int64_t* const nodes = found.nodes.data() + CellsOfFaces::NODES * cell;
            found.corners[cell] = static_cast<std::int8_t>(loops.order(nodes));
        }
    });
    return found;
}

}  // namespace meshfix
