// The point of smallest norm in the convex hull of some vectors: the quadratic programme of section 3.2,
// min |sum beta_i g_i|^2, sum beta_i = 1, beta_i >= 0.
// Source: P. Wolfe, "Finding the nearest point in a polytope", Mathematical Programming 11 (1976).
#pragma once

#include <vector>

#include "common/tolerances.hpp"
#include "common/vec.hpp"

namespace meshfix {

// Affinely independent vectors that carry the current point, with their weights.
template <int D>
struct Corral {
    std::array<Vec<D>, D + 1> vectors;
    std::array<double, D + 1> weights;
    int size = 0;

    Vec<D> point() const {
        Vec<D> p{};
        for (int i = 0; i < size; ++i) p = p + weights[i] * vectors[i];
        return p;
    }

    void drop(int i) {
        --size;
        vectors[i] = vectors[size];
        weights[i] = weights[size];
    }

    // Weights of the smallest point of the affine hull: (G + 1 1^T) u = 1, weights u / sum(u). False: dependent.
    bool affine_weights(std::array<double, D + 1>& u) const {
        std::array<std::array<double, D + 2>, D + 1> a;
        double scale = 0.0;
        for (int i = 0; i < size; ++i) scale = std::max(scale, norm2(vectors[i]));
        for (int i = 0; i < size; ++i) {
            for (int j = 0; j < size; ++j) a[i][j] = dot(vectors[i], vectors[j]) / scale + 1.0;
            a[i][size] = 1.0;
        }
        for (int k = 0; k < size; ++k) {
            int pivot = k;
            for (int i = k + 1; i < size; ++i)
                if (std::fabs(a[i][k]) > std::fabs(a[pivot][k])) pivot = i;
            std::swap(a[k], a[pivot]);
            if (!(std::fabs(a[k][k]) > MIN_NORM_GAP)) return false;
            for (int i = 0; i < size; ++i) {
                if (i == k) continue;
                const double factor = a[i][k] / a[k][k];
                for (int j = k; j <= size; ++j) a[i][j] -= factor * a[k][j];
            }
        }
        double sum = 0.0;
        for (int i = 0; i < size; ++i) sum += u[i] = a[i][size] / a[i][i];
        for (int i = 0; i < size; ++i) u[i] /= sum;
        return std::isfinite(sum) && sum > 0.0;
    }

    // Moves to the smallest point of the hull of the corral, dropping vectors on the way. False: dependent.
    bool minimise() {
        for (;;) {
            std::array<double, D + 1> target;
            if (!affine_weights(target)) return false;
            double step = 1.0;
            int blocking = -1;
            for (int i = 0; i < size; ++i) {
                if (target[i] > 0.0) continue;
                const double ratio = weights[i] / (weights[i] - target[i]);
                if (blocking < 0 || ratio < step) {
                    step = ratio;
                    blocking = i;
                }
            }
            for (int i = 0; i < size; ++i) weights[i] += step * (target[i] - weights[i]);
            if (blocking < 0) return true;
            drop(blocking);
        }
    }
};

// vectors (at least one). Exact to rounding; where rounding makes vectors dependent, the best point found.
template <int D>
Vec<D> min_norm_point(const std::vector<Vec<D>>& vectors) {
    Corral<D> corral;
    double largest = 0.0;
    std::size_t shortest = 0;
    for (std::size_t i = 0; i < vectors.size(); ++i) {
        largest = std::max(largest, norm2(vectors[i]));
        if (norm2(vectors[i]) < norm2(vectors[shortest])) shortest = i;
    }
    corral.vectors[0] = vectors[shortest];
    corral.weights[0] = 1.0;
    corral.size = 1;
    Vec<D> best = vectors[shortest];
    for (std::size_t step = 0; step <= 4 * vectors.size() + D; ++step) {
        std::size_t entering = 0;
        for (std::size_t i = 1; i < vectors.size(); ++i)
            if (dot(best, vectors[i]) < dot(best, vectors[entering])) entering = i;
        if (!(dot(best, vectors[entering]) < norm2(best) - MIN_NORM_GAP * largest)) break;
        if (corral.size == D + 1) break;
        corral.vectors[corral.size] = vectors[entering];
        corral.weights[corral.size++] = 0.0;
        if (!corral.minimise()) break;
        const Vec<D> point = corral.point();
        if (!(norm2(point) < norm2(best))) break;
        best = point;
    }
    return best;
}

}  // namespace meshfix
