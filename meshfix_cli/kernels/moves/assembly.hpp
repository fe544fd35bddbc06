// Sums over simplices, and their gradient by the vertices, in a fixed order for any number of threads: over the lanes of
// an item, over the items, over a star.
//
// simplices (m, D+1) vertex numbers, the `free` vertices that move before the others
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/pack.hpp"
#include "common/parallel.hpp"
#include "mesh/freedom.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

template <int D>
class Assembly {
   public:
    Assembly(const std::int32_t* simplices, std::int64_t m, std::int64_t n)
        : simplices_(simplices, simplices + m * (D + 1)) {
        number_shares(n);
    }

    // The gradient by vertices that go along their axes is that part of it: steps along sums of gradients keep to these.
    void constrain(const Freedom& freedom) { freedom_ = freedom; }

    const std::vector<std::int32_t>& simplices() const { return simplices_; }
    std::int64_t size() const { return static_cast<std::int64_t>(simplices_.size()) / (D + 1); }
    std::int64_t items() const { return (size() + SIMPLICES_PER_ITEM - 1) / SIMPLICES_PER_ITEM; }

    // Calls look(begin, end, item) for the simplices of each item, which adds to the gradient (free, D).
    template <class F>
    void evaluate(std::int64_t free, double* gradient, int threads, const F& look) {
        for_each_range(size(), SIMPLICES_PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
            std::fill(shares_.begin() + first_shares_[item], shares_.begin() + first_shares_[item + 1], Vec<D>{});
            look(begin, end, item);
        });
        for_each_range(free, VERTICES_PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t v = begin; v < end; ++v) {
                Vec<D> sum{};
                for (std::int32_t i = offsets_[v]; i < offsets_[v + 1]; ++i) sum = sum + shares_[of_vertices_[i]];
                if (!freedom_.frame.empty() && !freedom_.anywhere(v)) sum = along(v, sum);
                for (int k = 0; k < D; ++k) gradient[v * D + k] = sum[k];
            }
        });
    }

    // The edges of the simplices from s on; where there are no more before `end`, the last one's.
    Edges<D, Pack> edges(const double* points, std::int64_t s, std::int64_t end) const {
        Edges<D, Pack> e;
        for (int i = 0; i < LANES; ++i) {
            const std::int32_t* simplex = simplices_.data() + std::min(s + i, end - 1) * (D + 1);
            const double* first = points + static_cast<std::int64_t>(simplex[0]) * D;
            for (int k = 0; k < D; ++k) {
                const double* other = points + static_cast<std::int64_t>(simplex[k + 1]) * D;
                for (int x = 0; x < D; ++x) e[k][x][i] = other[x] - first[x];
            }
        }
        return e;
    }

    // Adds the slopes at the corners of `count` simplices from s on.
    void add(const Corners<D, Pack>& slopes, std::int64_t s, int count) {
        for (int i = 0; i < count; ++i) {
            for (int k = 0; k <= D; ++k) {
                Vec<D>& share = shares_[share_of_[(s + i) * (D + 1) + k]];
                for (int x = 0; x < D; ++x) share[x] += slopes[k][x][i];
            }
        }
    }

   private:
    static constexpr std::int64_t SIMPLICES_PER_ITEM = 4096, VERTICES_PER_ITEM = 4096;

    // Each item has a share of the gradient for each of its vertices; a vertex has few, one after the other.
    void number_shares(std::int64_t n) {
        constexpr std::size_t CORNERS_PER_ITEM = SIMPLICES_PER_ITEM * (D + 1);
        std::vector<std::int32_t> vertices, newest(n, -1);
        share_of_.reserve(simplices_.size());
        const auto count = [&] { return static_cast<std::int32_t>(vertices.size()); };
        for (std::int32_t v : simplices_) {
            if (share_of_.size() % CORNERS_PER_ITEM == 0) first_shares_.push_back(count());
            if (newest[v] < first_shares_.back()) {
                newest[v] = count();
                vertices.push_back(v);
            }
            share_of_.push_back(newest[v]);
        }
        shares_.resize(vertices.size());
        first_shares_.push_back(count());
        offsets_.assign(n + 1, 0);
        for (std::int32_t v : vertices) ++offsets_[v + 1];
        for (std::int64_t v = 0; v < n; ++v) offsets_[v + 1] += offsets_[v];
        of_vertices_.resize(vertices.size());
        std::vector<std::int32_t> next(offsets_.begin(), offsets_.end() - 1);
        for (std::int32_t i = 0; i < count(); ++i) of_vertices_[next[vertices[i]]++] = i;
    }

    Vec<D> along(std::int64_t v, const Vec<D>& slope) const {
        Directions<D> directions;
        directions.set(freedom_, v, Vec<D>{});
        return directions.along(slope);
    }

    Freedom freedom_{};  // of the free vertices, or none
    std::vector<std::int32_t> simplices_;
    std::vector<std::int32_t> share_of_;               // (m, D+1): the share of each corner
    std::vector<std::int32_t> first_shares_;           // (items + 1)
    std::vector<std::int32_t> offsets_, of_vertices_;  // compressed rows: the shares of each vertex, ascending
    std::vector<Vec<D>> shares_;
};

}  // namespace meshfix
