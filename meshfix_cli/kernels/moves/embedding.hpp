// Each free vertex at the mean of its neighbours, by weights: the solution of the graph's Laplace equation.
//
// Source: W. T. Tutte, "How to draw a graph", Proceedings of the London Mathematical Society 13 (1963); conjugate
// gradients, preconditioned by the numbers of neighbours.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "common/numbers.hpp"
#include "common/vec.hpp"
#include "mesh/edges.hpp"
#include "mesh/star.hpp"

namespace meshfix {

template <int D>
class Embedding {
 public:
    // weights: of the edges, neighbours that have none do not count; null: all neighbours have the weight 1.
    Embedding(StarsView stars, const double* points, const std::uint8_t* free, EdgesView edges, const double* weights,
              std::int64_t n, int threads)
        : threads_(threads) {
        std::vector<std::int32_t> number(n, -1);
        for (std::int64_t v = 0; v < n; ++v) {
            if (!free[v]) continue;
            number[v] = static_cast<std::int32_t>(vertices_.size());
            vertices_.push_back(static_cast<std::int32_t>(v));
        }
        set_middle(stars, points, number);
        for (std::int32_t v : vertices_) {
            Vec<D> held{};
            double count = 0.0;
            for (std::int32_t i = stars.neighbour_offsets[v]; i < stars.neighbour_offsets[v + 1]; ++i) {
                const std::int32_t other = stars.neighbours[i];
                double weight = 1.0;
                if (weights != nullptr) {
                    const std::int32_t edge = edges.find(v, other);
                    if (edge < 0) continue;
                    weight = weights[edge];
                }
                count += weight;
                if (number[other] >= 0) {
                    neighbours_.push_back(number[other]);
                    weights_.push_back(weight);
                } else {
                    held = held + weight * (load<D>(points + static_cast<std::int64_t>(other) * D) - middle_);
                }
            }
            held_.push_back(held);
            offsets_.push_back(static_cast<std::int32_t>(neighbours_.size()));
            counts_.push_back(count);
        }
    }

    void move(double* points) const {
        const auto size = static_cast<std::int64_t>(vertices_.size()) * D;
        Calculator calculator(size, threads_);
        Numbers x(size), residual(size), scaled(size), direction(size), image(size);
        for_each([&](std::int64_t v) { put_at(held_[v], residual, v); });
        divide(residual, scaled);
        double length2 = calculator.add(direction, scaled, 0.0, scaled, residual);
        const double enough = EMBEDDING_EXACT * EMBEDDING_EXACT * length2;
        for (int i = 0; i < EMBEDDING_ITERATIONS && length2 > enough; ++i) {
            apply(direction, image);
            const double step = length2 / calculator.dot(direction, image);
            calculator.add(x, x, step, direction, direction);
            calculator.add(residual, residual, -step, image, image);
            divide(residual, scaled);
            const double before = length2;
            length2 = calculator.dot(residual, scaled);
            calculator.add(direction, scaled, length2 / before, direction, direction);
        }
        for_each([&](std::int64_t v) {
            const Vec<D> place = middle_ + load<D>(x.data() + v * D);
            std::copy(place.begin(), place.end(), points + static_cast<std::int64_t>(vertices_[v]) * D);
        });
    }

 private:
    template <class F>
    void for_each(const F& f) const {
        for_each_range(static_cast<std::int64_t>(vertices_.size()), PER_ITEM, threads_,
                       [&](std::int64_t begin, std::int64_t end, std::int64_t) {
                           for (std::int64_t v = begin; v < end; ++v) f(v);
                       });
    }

    // The origin is among the held neighbours, as the solution is, wherever the free vertices come from.
    void set_middle(StarsView stars, const double* points, const std::vector<std::int32_t>& number) {
        std::int64_t count = 0;
        for (std::int32_t v : vertices_) {
            for (std::int32_t i = stars.neighbour_offsets[v]; i < stars.neighbour_offsets[v + 1]; ++i) {
                const std::int32_t other = stars.neighbours[i];
                if (number[other] >= 0) continue;
                middle_ = middle_ + load<D>(points + static_cast<std::int64_t>(other) * D);
                ++count;
            }
        }
        middle_ = (1.0 / static_cast<double>(std::max<std::int64_t>(count, 1))) * middle_;
    }

    static void put_at(const Vec<D>& x, Numbers& to, std::int64_t v) {
        std::copy(x.begin(), x.end(), to.data() + v * D);
    }

    // Times the graph's Laplacian.
    void apply(const Numbers& from, Numbers& to) const {
        for_each([&](std::int64_t v) {
            Vec<D> sum = counts_[v] * load<D>(from.data() + v * D);
            for (std::int32_t i = offsets_[v]; i < offsets_[v + 1]; ++i)
                sum = sum - weights_[i] * load<D>(from.data() + static_cast<std::int64_t>(neighbours_[i]) * D);
            put_at(sum, to, v);
        });
    }

    void divide(const Numbers& from, Numbers& to) const {
        for_each([&](std::int64_t v) {
            put_at((1.0 / counts_[v]) * load<D>(from.data() + v * D), to, v);
        });
    }

    std::vector<std::int32_t> vertices_, offsets_{0}, neighbours_;  // rows: of free neighbours
    std::vector<double> weights_, counts_;                          // of these, and the sum over all
    std::vector<Vec<D>> held_;                                      // the sum of the others
    Vec<D> middle_{};
    int threads_;
};

}  // namespace meshfix
