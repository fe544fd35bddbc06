// Where vertices may go: anywhere, or from where they came along one or two axes, in a line or a plane, or on the curves and
// surfaces of a reference.
//
// frame (n)               the line or plane of each, and behind these its curve or surface; -1: it may go anywhere
// directions (f)          how many directions each of these has, 1 or 2
// axes (f, D, D)          orthonormal rows, of which those directions are the first; of lines and planes alone
// offsets (n+1), neighbours   of those that do not go anywhere: their neighbours in what they slide in; or none
// reference               null: there are only lines and planes
// around_offsets (n+1), around (r, 4)   of those on a reference: the other end of an edge and -1, or the other corners of a
//                         triangle, the shape from which these may not go far, and their own piece of it; the last is of the
//                         shape on which the vertex is
// bound2                  the square of how far that is
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/reference.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

struct Freedom {
    std::vector<std::int32_t> frame;
    std::vector<std::uint8_t> directions;
    std::vector<double> axes;
    std::vector<std::int32_t> offsets, neighbours;
    const Reference* reference = nullptr;
    const std::int32_t *around_offsets = nullptr, *around = nullptr;  // somebody else's; null: none
    double bound2 = 0.0;

    bool anywhere(std::int64_t v) const { return frame[v] < 0; }

    // The piece of the reference that v itself had there.
    std::int64_t piece(std::int64_t v) const {
        if (around == nullptr || around_offsets[v] == around_offsets[v + 1]) return Reference::ANY;
        return around[4 * static_cast<std::size_t>(around_offsets[v + 1]) - 1];
    }

    // That of a vertex on the reference; negative: it is not on one.
    std::int32_t shape(std::int64_t v) const {
        return reference == nullptr ? -1 : frame[v] - static_cast<std::int32_t>(directions.size() - reference->shapes());
    }
};

// The directions of one vertex.
template <int D>
struct Directions {
    int count = D;
    Edges<D> axes{};
    Vec<D> anchor{};
    std::array<bool, D> kept{};  // coordinates that no axis changes: they keep their bits
    bool aligned = false;        // the axes are those of the coordinates
    const Reference* reference = nullptr;  // null: it is on none
    std::int32_t shape = -1;
    mutable std::int64_t piece = Reference::ANY;  // on which the last foot was: the next one is near it

    bool anywhere() const { return count == D; }
    bool curved() const { return reference != nullptr; }

    void set_anywhere() {
        count = D;
        reference = nullptr;
    }

    // `start`: a position in its line or plane; `here`: where it is.
    void set(const Freedom& freedom, std::int64_t v, const Vec<D>& start, const Vec<D>& here) {
        shape = freedom.shape(v);
        if (shape < 0) return set(freedom, v, start);
        count = freedom.directions[freedom.frame[v]];
        reference = freedom.reference;
        const Foot<D> foot = reference->foot<D>(shape, here, freedom.piece(v));
        piece = foot.piece;
        axes = reference->axes<D>(shape, foot);
        kept.fill(false);
    }

    void set(const Freedom& freedom, std::int64_t v, const Vec<D>& at) {
        count = freedom.directions[freedom.frame[v]];
        reference = nullptr;
        anchor = at;
        const double* rows = freedom.axes.data() + static_cast<std::int64_t>(freedom.frame[v]) * D * D;
        kept.fill(true);
        int changed = 0;
        for (int i = 0; i < count; ++i) {
            axes[i] = load<D>(rows + i * D);
            for (int k = 0; k < D; ++k) kept[k] = kept[k] && axes[i][k] == 0.0;
        }
        for (int k = 0; k < D; ++k) changed += !kept[k];
        aligned = changed == count;
    }

    // The part of a vector along the axes.
    Vec<D> along(const Vec<D>& v) const {
        if (anywhere()) return v;
        Vec<D> sum{};
        for (int i = 0; i < count; ++i) sum = sum + dot(axes[i], v) * axes[i];
        return sum;
    }

    // The nearest position, from the anchor: a step from the last one would leave the plane bit by bit.
    Vec<D> onto(const Vec<D>& p) const {
        if (curved()) return on_reference(p);
        return anywhere() ? p : with_kept(aligned ? p : anchor + along(p - anchor));
    }

    Vec<D> on_reference(const Vec<D>& p) const {
        const Foot<D> foot = reference->foot<D>(shape, p, piece);
        piece = foot.piece;
        return reference->rounded<D>(shape, foot);
    }

    Vec<D> with_kept(Vec<D> p) const {
        if (anywhere()) return p;
        for (int k = 0; k < D; ++k)
            if (kept[k]) p[k] = anchor[k];
        return p;
    }
};

}  // namespace meshfix
