// Where vertices may go: anywhere, or from where they came along one or two axes, in a line or a plane.
//
// frame (n)               the line or plane of each; -1: it may go anywhere
// directions (f)          how many directions each of these has, 1 or 2
// axes (f, D, D)          orthonormal rows, of which those directions are the first
// offsets (n+1), neighbours   of those that do not go anywhere: their neighbours in their line or plane; or none
#pragma once

#include <cstdint>
#include <vector>

#include "mesh/simplex.hpp"

namespace meshfix {

struct Freedom {
    std::vector<std::int32_t> frame;
    std::vector<std::uint8_t> directions;
    std::vector<double> axes;
    std::vector<std::int32_t> offsets, neighbours;

    bool anywhere(std::int64_t v) const { return frame[v] < 0; }
};

// The directions of one vertex.
template <int D>
struct Directions {
    int count = D;
    Edges<D> axes{};
    Vec<D> anchor{};
    std::array<bool, D> kept{};  // coordinates that no axis changes: they keep their bits
    bool aligned = false;        // the axes are those of the coordinates

    bool anywhere() const { return count == D; }

    // `at`: a position in its line or plane.
    void set(const Freedom& freedom, std::int64_t v, const Vec<D>& at) {
        count = freedom.directions[freedom.frame[v]];
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
        return anywhere() ? p : with_kept(aligned ? p : anchor + along(p - anchor));
    }

    Vec<D> with_kept(Vec<D> p) const {
        if (anywhere()) return p;
        for (int k = 0; k < D; ++k)
            if (kept[k]) p[k] = anchor[k];
        return p;
    }
};

}  // namespace meshfix
