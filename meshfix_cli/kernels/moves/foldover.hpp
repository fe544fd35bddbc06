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

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/pack.hpp"
#include "common/parallel.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

struct Regularisation {
    double eps, weight;
};

// 1 / chi, and the derivative of chi divided by chi, without cancellation for t < 0.
template <class T>
struct Chi {
    T inverse, decay;

    Chi(T t, double eps) {
        const T one = constant<T>(1.0), eps2 = constant<T>(eps * eps), root = square_root(eps2 + t * t);
        inverse = select(t > constant<T>(0.0), constant<T>(2.0) / (t + root), constant<T>(2.0) * (root - t) / eps2);
        decay = one / root;
    }
};

// `of_inverted` is the share of the simplices whose determinant is not positive.
struct EnergyValue {
    double energy = 0.0, of_inverted = 0.0, min_det = INFINITY;
};

template <int D>
class Foldover {
   public:
    Foldover(const std::int32_t* simplices, std::int64_t m, std::int64_t n)
        : simplices_(simplices, simplices + m * (D + 1)), parts_((m + SIMPLICES_PER_ITEM - 1) / SIMPLICES_PER_ITEM) {
        number_shares(n);
    }

    const std::vector<std::int32_t>& simplices() const { return simplices_; }
    std::int64_t size() const { return static_cast<std::int64_t>(simplices_.size()) / (D + 1); }

    // gradient (free, D). Sums run in a fixed order: over the lanes of an item, over the items, over a star.
    EnergyValue evaluate(const double* points, const double* sizes, Regularisation r, std::int64_t free,
                         double* gradient, int threads) {
        const auto look = [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
            std::fill(shares_.begin() + first_shares_[item], shares_.begin() + first_shares_[item + 1], Vec<D>{});
            parts_[item] = look_at(points, sizes, r, begin, end);
        };
        for_each_range(size(), SIMPLICES_PER_ITEM, threads, look);
        EnergyValue total;
        for (const auto& part : parts_) {
            total.energy += part.energy;
            total.of_inverted += part.of_inverted;
            total.min_det = part.min_det < total.min_det ? part.min_det : total.min_det;
        }
        for_each_range(free, VERTICES_PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t v = begin; v < end; ++v) {
                Vec<D> sum{};
                for (std::int32_t i = offsets_[v]; i < offsets_[v + 1]; ++i) sum = sum + shares_[of_vertices_[i]];
                for (int k = 0; k < D; ++k) gradient[v * D + k] = sum[k];
            }
        });
        return total;
    }

   private:
    static constexpr std::int64_t SIMPLICES_PER_ITEM = 4096, VERTICES_PER_ITEM = 4096;

    // Each item has a share of the gradient for each of its vertices; a vertex has few, one after the other.
    void number_shares(std::int64_t n) {
        constexpr std::size_t CORNERS_PER_ITEM = SIMPLICES_PER_ITEM * (D + 1);
        std::vector<std::int32_t> vertices, newest(n, -1);
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

    // Squared edge of the regular simplex of determinant 1.
    static double unit_edge2() { return D == 2 ? 2.0 / std::sqrt(3.0) : std::cbrt(2.0); }

    // The energy of some simplices; what they add to the gradient goes to the shares of their item.
    EnergyValue look_at(const double* points, const double* sizes, Regularisation r, std::int64_t begin,
                        std::int64_t end) {
        LaneSum energy, of_inverted;
        double min_det = INFINITY;
        for (std::int64_t s = begin; s < end; s += LANES) {
            Edges<D, Pack> e;
            Pack size;
            for (int i = 0; i < LANES; ++i) {
                const std::int64_t here = std::min(s + i, end - 1);
                const std::int32_t* simplex = simplices_.data() + here * (D + 1);
                const double* first = points + static_cast<std::int64_t>(simplex[0]) * D;
                for (int k = 0; k < D; ++k) {
                    const double* other = points + static_cast<std::int64_t>(simplex[k + 1]) * D;
                    for (int x = 0; x < D; ++x) e[k][x][i] = other[x] - first[x];
                }
                size[i] = sizes[here];
            }
            Corners<D, Pack> slopes;
            Pack det;
            Pack value = energy_of(e, size, r, slopes, det);
            const int count = static_cast<int>(std::min<std::int64_t>(LANES, end - s));
            for (int i = 0; i < count; ++i) {
                for (int k = 0; k <= D; ++k) {
                    Vec<D>& share = shares_[share_of_[(s + i) * (D + 1) + k]];
                    for (int x = 0; x < D; ++x) share[x] += slopes[k][x][i];
                }
                if (!(det[i] >= min_det)) min_det = det[i];
            }
            for (int i = count; i < LANES; ++i) value[i] = 0.0;
            const auto block = static_cast<std::size_t>((s - begin) / LANES);
            energy.add(block, value);
            of_inverted.add(block, select(det > constant<Pack>(0.0), constant<Pack>(0.0), value));
        }
        return {energy.total(), of_inverted.total(), min_det};
    }

    // The energy, the determinant of J and the slope of the energy at every corner.
    static Pack energy_of(const Edges<D, Pack>& e, Pack size, Regularisation r, Corners<D, Pack>& slopes, Pack& det) {
        const Pack one = constant<Pack>(1.0), weight = constant<Pack>(r.weight), to_size = one / size;
        const Pack to_trace = constant<Pack>(2.0 / ((D + 1) * unit_edge2())) * to_size * to_size;
        Pack to_det = to_size * to_size;
        if constexpr (D == 3) to_det = to_det * to_size;
        det = determinant(e) * to_det;
        const Chi<Pack> chi(det, r.eps);
        const Pack root = D == 2 ? chi.inverse : cube_root(chi.inverse);
        const Pack by_edges2 = to_trace * (D == 2 ? root : root * root);
        const Pack shape = by_edges2 * sum_of_squared_edges<D>(e), measure = (one + det * det) * chi.inverse;
        const Pack by_det = to_det * (weight * (constant<Pack>(2.0) * det * chi.inverse - measure * chi.decay) -
                                      constant<Pack>(2.0 / D) * shape * chi.decay);
        const Edges<D, Pack> normals = determinant_slopes(e);
        const Pack pull = constant<Pack>(2.0) * by_edges2;
        Vec<D, Pack> middle = e[0];
        for (int k = 1; k < D; ++k) middle = middle + e[k];
        slopes[0] = Vec<D, Pack>{} - pull * middle;
        for (int k = 0; k < D; ++k) {
            slopes[k + 1] = pull * (constant<Pack>(D + 1) * e[k] - middle) + by_det * normals[k];
            slopes[0] = slopes[0] - by_det * normals[k];
        }
        return shape + weight * measure;
    }

    std::vector<std::int32_t> simplices_;
    std::vector<std::int32_t> share_of_;               // (m, D+1): the share of each corner
    std::vector<std::int32_t> first_shares_;           // (items + 1)
    std::vector<std::int32_t> offsets_, of_vertices_;  // compressed rows: the shares of each vertex, ascending
    std::vector<Vec<D>> shares_;
    std::vector<EnergyValue> parts_;
};

}  // namespace meshfix
