// The regularised energy of Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov, "Foldover-free maps in 50 lines
// of code", ACM Transactions on Graphics 40 (2021), and its gradient:
//
//     sum over simplices of  tr(J^T J) / chi(det J)^(2/D) + weight (1 + det(J)^2) / chi(det J),
//     chi(t) = (t + sqrt(eps^2 + t^2)) / 2,
//
// J maps a regular simplex of determinant size^D to the simplex; then tr(J^T J) is a multiple of the sum of the
// squared edges.
//
// simplices (m, D+1) vertex numbers, the `free` vertices that move before the others
// sizes (m)          target of each simplex, in the unit of the points
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "measures/measures.hpp"
#include "mesh/facets.hpp"

namespace meshfix {

struct Regularisation {
    double eps, weight;
};

// chi and its derivative, without cancellation for t < 0.
struct Chi {
    double value, derivative;

    Chi(double t, double eps) {
        const double root = std::sqrt(eps * eps + t * t);
        value = t > 0.0 ? (t + root) / 2.0 : eps * eps / (2.0 * (root - t));
        derivative = value / root;
    }
};

struct EnergyValue {
    double energy = 0.0, min_det = INFINITY;
};

template <int D>
class Foldover {
   public:
    Foldover(const std::int32_t* simplices, std::int64_t m, std::int64_t n)
        : simplices_(simplices, simplices + m * (D + 1)), incidence_(incidence<D>(simplices, m, n, 1)), shares_(m) {}

    // gradient (free, D). Sums run in a fixed order: over the simplices of an item, over the items, over a star.
    EnergyValue evaluate(const double* points, const double* sizes, Regularisation r, std::int64_t free,
                         double* gradient, int threads) {
        const auto m = static_cast<std::int64_t>(shares_.size());
        const auto look = [&](EnergyValue& part, std::int64_t s, const Edges<D>& e) {
            part.energy += add(s, e, sizes[s], r, part.min_det);
        };
        EnergyValue total;
        for (const auto& part : for_each_simplex<EnergyValue, D>(points, simplices_.data(), m, threads, look)) {
            total.energy += part.energy;
            total.min_det = part.min_det < total.min_det ? part.min_det : total.min_det;
        }
        for_each_range(free, VERTICES_PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t v = begin; v < end; ++v) {
                const Vec<D> g = gradient_at(points, v);
                for (int k = 0; k < D; ++k) gradient[v * D + k] = g[k];
            }
        });
        return total;
    }

   private:
    static constexpr std::int64_t VERTICES_PER_ITEM = 4096;

    // Squared edge of the regular simplex of determinant 1.
    static double unit_edge2() { return D == 2 ? 2.0 / std::sqrt(3.0) : std::cbrt(2.0); }

    // Derivatives of a simplex's energy by its sum of squared edges and by its determinant.
    struct Shares {
        double by_edges2, by_det;
    };

    double add(std::int64_t s, const Edges<D>& e, double size, Regularisation r, double& min_det) {
        const double edges2 = sum_of_squared_edges<D>(e);
        const double to_det = 1.0 / (D == 2 ? size * size : size * size * size);
        const double to_trace = 2.0 / ((D + 1) * unit_edge2() * size * size);
        const double det = determinant(e) * to_det;
        const Chi chi(det, r.eps);
        const double power = D == 2 ? chi.value : std::cbrt(chi.value * chi.value);
        const double shape = to_trace * edges2 / power, measure = (1.0 + det * det) / chi.value;
        const double decay = chi.derivative / chi.value;
        shares_[s].by_edges2 = to_trace / power;
        shares_[s].by_det = to_det * (r.weight * (2.0 * det / chi.value - measure * decay) - 2.0 / D * shape * decay);
        if (!(det >= min_det)) min_det = det;
        return shape + r.weight * measure;
    }

    Vec<D> gradient_at(const double* points, std::int64_t v) const {
        Vec<D> sum{};
        const Vec<D> x = load<D>(points + v * D);
        for (std::int32_t i = incidence_.offsets[v]; i < incidence_.offsets[v + 1]; ++i) {
            const std::int32_t corner = incidence_.corners[i], s = corner / (D + 1);
            const auto& face = opposite_face<D>(corner % (D + 1));
            Edges<D> p;
            Vec<D> edges{};
            for (int k = 0; k < D; ++k) {
                p[k] = load<D>(points + static_cast<std::int64_t>(simplices_[s * (D + 1) + face[k]]) * D) - x;
                edges = edges - p[k];
            }
            sum = sum + (2.0 * shares_[s].by_edges2) * edges + shares_[s].by_det * determinant_slope(p);
        }
        return sum;
    }

    std::vector<std::int32_t> simplices_;
    Incidence incidence_;
    std::vector<Shares> shares_;
};

}  // namespace meshfix
