// Whether a vertex that slides on a curve or surface can make some affine functions of its position positive there. Over a
// rounded piece they are quadratic polynomials, between the least and the largest of their Bezier coefficients: what these
// do not decide is halved. Source: G. Farin, "Curves and surfaces for CAGD", the convex hull property.
#pragma once

#include <algorithm>
#include <vector>

#include "mesh/star.hpp"
#include "moves/linear_program.hpp"

namespace meshfix {

template <int D>
class OnReference {
   public:
    std::vector<bool> blamed;  // the functions by which places were excluded: these alone exclude all of them

    OnReference(const Star<D>& star, std::vector<Affine<D>> functions)
        : blamed(functions.size(), false), star_(star), functions_(std::move(functions)) {
        for (const Affine<D>& f : functions_) {
            const double length = std::sqrt(norm2(f.gradient));
            lengths_.push_back(length);
            least_.push_back(HELD_IMPOSSIBLE * star.radius * length);
        }
    }

    // Whether at each place of the shape one of the functions is not positive; false also where that stays undecided.
    bool is_excluded() {
        const Directions<D>& here = star_.directions;
        const auto to_local = [&](const Vec<D>& p) { return star_.to_local(p); };
        const auto skip = [&](const Vec<D>& low, const Vec<D>& high) { return is_box_excluded(low, high); };
        const auto look = [&](std::int64_t piece) {
            products_ = here.reference->template products<D>(here.shape, piece, to_local);
            const Weights one{1.0, 0.0, 0.0}, other{0.0, 1.0, 0.0}, third{0.0, 0.0, 1.0};
            if (here.count == 2) return is_part_excluded<3>({one, other, third}, HELD_DEPTH);
            return is_part_excluded<2>({one, other}, HELD_DEPTH);
        };
        const Vec<D> from = star_.to_global(star_.position);
        return here.reference->template for_each_piece<D>(here.shape, from, skip, look);
    }

   private:
    using Weights = std::array<double, 3>;

    static Weights middle(const Weights& a, const Weights& b) {
        return {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])};
    }

    double value(std::size_t i, const Vec<D>& x) const { return functions_[i].value + dot(functions_[i].gradient, x); }

    // The polar form of the piece: twice the same weights give a point of it.
    Vec<D> polar(const Weights& a, const Weights& b) const {
        Vec<D> sum{};
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                if (a[i] * b[j] != 0.0) sum = sum + (a[i] * b[j]) * products_[i][j];
        return sum;
    }

    template <class F>
    bool blame(const F& is_not_positive) {
        for (std::size_t k = 0; k < functions_.size(); ++k) {
            const std::size_t i = (last_ + k) % functions_.size();  // one that says it of all is enough
            if (!is_not_positive(i)) continue;
            blamed[i] = true;
            last_ = i;
            return true;
        }
        return false;
    }

    // What is rounded is no farther from its piece than half the size of this.
    bool is_box_excluded(const Vec<D>& low, const Vec<D>& high) {
        const double scale = 1.0 / star_.unit;
        const Vec<D> centre = star_.to_local(0.5 * (low + high)), half = (0.5 * scale) * (high - low);
        const double more = std::sqrt(norm2(half));
        return blame([&](std::size_t i) {
            double most = value(i, centre) + more * lengths_[i];
            for (int k = 0; k < D; ++k) most += std::fabs(functions_[i].gradient[k]) * half[k];
            return most <= least_[i];
        });
    }

    // The part of a piece between places that N weights of its corners tell.
    template <int N>
    bool is_part_excluded(const std::array<Weights, N>& w, int depth) {
        std::array<Vec<D>, N*(N + 1) / 2> controls;
        int count = 0;
        for (int i = 0; i < N; ++i) controls[count++] = polar(w[i], w[i]);
        for (int i = 0; i < N; ++i)
            for (int j = 0; j < i; ++j) controls[count++] = polar(w[i], w[j]);
        const bool excluded = blame([&](std::size_t i) {
            return std::all_of(controls.begin(), controls.end(), [&](const Vec<D>& x) { return value(i, x) <= least_[i]; });
        });
        if (excluded) return true;
        for (int corner = 0; corner < N; ++corner) {
            bool good = true;
            for (std::size_t i = 0; i < functions_.size(); ++i) good = good && value(i, controls[corner]) > least_[i];
            if (good) return false;
        }
        if (depth == 0) return false;
        if constexpr (N == 2) {
            const Weights m = middle(w[0], w[1]);
            return is_part_excluded<2>({w[0], m}, depth - 1) && is_part_excluded<2>({m, w[1]}, depth - 1);
        } else {
            const Weights a = middle(w[1], w[2]), b = middle(w[2], w[0]), c = middle(w[0], w[1]);
            return is_part_excluded<3>({w[0], c, b}, depth - 1) && is_part_excluded<3>({w[1], a, c}, depth - 1) &&
                   is_part_excluded<3>({w[2], b, a}, depth - 1) && is_part_excluded<3>({a, b, c}, depth - 1);
        }
    }

    const Star<D>& star_;
    std::vector<Affine<D>> functions_;
    std::vector<double> lengths_{}, least_{};
    std::size_t last_ = 0;
    std::array<std::array<Vec<D>, 3>, 3> products_{};
};

}  // namespace meshfix
