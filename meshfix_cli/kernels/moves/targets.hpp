// What the foldover-free energy compares a simplex with. J maps the target to the simplex. A target has
//
//     NUMBERS                                  how many numbers it is given as
//     SCALED                                   whether targets differ so much that each vertex needs a unit of its own
//     static double size(numbers)              the D-th root of its determinant
//     static void divide(numbers, unit)        the same in another unit
//     static double stiffness(numbers, k)      |derivative of J by corner k|^2
//     Target(all, s, end)                      those of the simplices from s on; after `end` the last one's
//     Pack to_det()                            det J of a simplex of determinant 1
//     Pack trace(edges, factor, slopes)        factor tr(J^T J), and its slopes at the corners
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/pack.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

// A regular simplex, given as its size; then tr(J^T J) is a multiple of the sum of the squared edges.
template <int D>
class RegularTarget {
   public:
    static constexpr int NUMBERS = 1;
    static constexpr bool SCALED = false;

    static double size(const double* target) { return *target; }
    static void divide(double* target, double unit) { *target /= unit; }

    RegularTarget(const double* sizes, std::int64_t s, std::int64_t end) {
        for (int i = 0; i < LANES; ++i) size_[i] = sizes[std::min(s + i, end - 1)];
        to_size_ = constant<Pack>(1.0) / size_;
    }

    Pack to_det() const {
        if constexpr (D == 3) return to_size_ * to_size_ * to_size_;
        return to_size_ * to_size_;
    }

    Pack trace(const Edges<D, Pack>& e, Pack factor, Corners<D, Pack>& slopes) const {
        const Pack to_trace = constant<Pack>(2.0 / ((D + 1) * unit_edge2())) * to_size_ * to_size_;
        const Pack by_edges2 = to_trace * factor, pull = constant<Pack>(2.0) * by_edges2;
        Vec<D, Pack> middle = e[0];
        for (int k = 1; k < D; ++k) middle = middle + e[k];
        slopes[0] = Vec<D, Pack>{} - pull * middle;
        for (int k = 0; k < D; ++k) slopes[k + 1] = pull * (constant<Pack>(D + 1) * e[k] - middle);
        return by_edges2 * sum_of_squared_edges<D>(e);
    }

   private:
    // Squared edge of the regular simplex of determinant 1. Compilers and libraries differ in the last bit of cbrt(2).
    static double unit_edge2() { return D == 2 ? 2.0 / std::sqrt(3.0) : 1.2599210498948731648; }

    Pack size_, to_size_;
};

// Any simplex, given as the inverse (D, D) of the matrix whose columns are its edges.
template <int D>
class ShapedTarget {
   public:
    static constexpr int NUMBERS = D * D;
    static constexpr bool SCALED = true;

    static double size(const double* target) {
        const double det = std::fabs(determinant(rows(target)));
        return 1.0 / (D == 2 ? std::sqrt(det) : std::cbrt(det));
    }
    static void divide(double* target, double unit) {
        for (int i = 0; i < NUMBERS; ++i) target[i] *= unit;
    }
    static double stiffness(const double* target, int corner) {
        const Edges<D> inverse = rows(target);
        if (corner > 0) return norm2(inverse[corner - 1]);
        Vec<D> sum = inverse[0];
        for (int k = 1; k < D; ++k) sum = sum + inverse[k];
        return norm2(sum);
    }

    ShapedTarget(const double* inverses, std::int64_t s, std::int64_t end) {
        for (int i = 0; i < LANES; ++i) {
            const double* target = inverses + std::min(s + i, end - 1) * NUMBERS;
            for (int k = 0; k < D; ++k)
                for (int x = 0; x < D; ++x) inverse_[k][x][i] = target[k * D + x];
        }
    }

    Pack to_det() const { return determinant(inverse_); }

    Pack trace(const Edges<D, Pack>& e, Pack factor, Corners<D, Pack>& slopes) const {
        Pack sum = constant<Pack>(0.0);
        for (auto& slope : slopes) slope = Vec<D, Pack>{};
        for (int c = 0; c < D; ++c) {
            Vec<D, Pack> column = inverse_[0][c] * e[0];  // of J
            for (int k = 1; k < D; ++k) column = column + inverse_[k][c] * e[k];
            sum = sum + norm2(column);
            for (int k = 0; k < D; ++k) slopes[k + 1] = slopes[k + 1] + inverse_[k][c] * column;
        }
        const Pack pull = constant<Pack>(2.0) * factor;
        for (int k = 0; k < D; ++k) {
            slopes[k + 1] = pull * slopes[k + 1];
            slopes[0] = slopes[0] - slopes[k + 1];
        }
        return factor * sum;
    }

   private:
    static Edges<D> rows(const double* target) {
        Edges<D> inverse;
        for (int k = 0; k < D; ++k)
            for (int x = 0; x < D; ++x) inverse[k][x] = target[k * D + x];
        return inverse;
    }

    Edges<D, Pack> inverse_;
};

}  // namespace meshfix
