// Where a vertex that slides on a reference may be: in reach of where it came from, and so that facets around it stay near
// their shapes.
#pragma once

#include "mesh/freedom.hpp"

namespace meshfix {

struct Parameters {
    double threshold_sine2;  // the active-set method runs on stars below it; for the mean ratio: the floor
    double min_det;          // smoothing makes no determinant smaller than this, or than the star's smallest
    const double* start;     // (n, D): where the vertices came from
    double max_move;         // how far from there they may be; infinity: anywhere
    const Freedom* freedom = nullptr;  // where they may go; null: anywhere
};

template <int D>
class Nearness {
   public:
    Nearness(const double* points, const Parameters& parameters) : points_(points), parameters_(parameters) {}

    // The piece of a shape on which the vertex is at x: where it is none of its own, searches for what is around it begin there.
    void begin_at(std::int32_t shape, std::int64_t piece) {
        shape_ = shape;
        piece_ = piece;
    }

    // Whether there are facets around a vertex that must stay near a shape.
    bool is_bounded(std::int64_t v) const {
        const std::int32_t* offsets = parameters_.freedom->around_offsets;
        return offsets != nullptr && offsets[v] != offsets[v + 1];
    }

    bool is_in_reach(std::int64_t v, const Vec<D>& x) const {
        const double reach = parameters_.max_move;
        return !(reach < INFINITY) || norm2(x - load<D>(parameters_.start + v * D)) <= reach * reach;
    }

    // Whether a vertex on the reference may be at x: in reach, with the facets around it near their shapes, or nearer than
    // they are.
    bool is_near(std::int64_t v, const Vec<D>& x) const {
        const Vec<D> here = load<D>(points_ + v * D);
        const double bound2 = parameters_.freedom->bound2;
        if (!is_in_reach(v, x)) return false;
        if (is_within(bound2, v, x)) return true;
        return !is_within(bound2, v, here) && is_within(deviation2_at(v, here), v, x);
    }

    // The largest distance^2, with v at x, of the middles around it from their shapes.
    double deviation2_at(std::int64_t v, const Vec<D>& x) const {
        double largest = 0.0;
        for_each_middle(v, x, [&](const Vec<D>& p, std::int32_t shape, std::int32_t piece) {
            largest = std::max(largest, parameters_.freedom->reference->template foot<D>(shape, p, piece).distance2);
            return true;
        });
        return largest;
    }

    // Whether none is farther away: most of them are found to be near by their own pieces alone.
    bool is_within(double bound2, std::int64_t v, const Vec<D>& x) const {
        return for_each_middle(v, x, [&](const Vec<D>& p, std::int32_t shape, std::int32_t piece) {
            return parameters_.freedom->reference->template is_within<D>(bound2, shape, p, piece);
        });
    }

   private:
    // Calls look(p, shape, piece) for the middles of edges and triangles around v, if it is at x, while that returns true.
    template <class F>
    bool for_each_middle(std::int64_t v, const Vec<D>& x, const F& look) const {
        const Freedom& freedom = *parameters_.freedom;
        const std::int32_t begin = freedom.around_offsets[v], end = freedom.around_offsets[v + 1];
        const auto row_at = [&](std::int32_t i) { return freedom.around + 4 * static_cast<std::int64_t>(i); };
        bool has_left = shape_ >= 0;
        for (std::int32_t i = begin; i < end && has_left; ++i) has_left = row_at(i)[3] != piece_;
        for (std::int32_t i = begin; i < end; ++i) {
            const std::int32_t* row = row_at(i);
            const auto piece = static_cast<std::int32_t>(has_left && row[2] == shape_ ? piece_ : row[3]);
            const Vec<D> a = load<D>(points_ + static_cast<std::int64_t>(row[0]) * D);
            if (!look(0.5 * (x + a), row[2], piece)) return false;
            if (row[1] < 0) continue;
            const Vec<D> b = load<D>(points_ + static_cast<std::int64_t>(row[1]) * D);
            if (!look((1.0 / 3.0) * (x + a + b), row[2], piece)) return false;
        }
        return true;
    }

    const double* points_;
    const Parameters& parameters_;
    std::int32_t shape_ = -1;  // none
    std::int64_t piece_ = Reference::ANY;
};

}  // namespace meshfix
