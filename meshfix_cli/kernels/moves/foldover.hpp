// The regularised energy of Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov, "Foldover-free maps in 50 lines
// of code", ACM Transactions on Graphics 40 (2021), and its gradient:
//
//     sum over simplices of  tr(J^T J) / chi(det J)^(2/D) + weight (1 + det(J)^2) / chi(det J),
//     chi(t) = (t + sqrt(eps^2 + t^2)) / 2,
//
// J maps the target of a simplex to the simplex: see targets.hpp.
//
// simplices (m, D+1) vertex numbers, the `free` vertices that move before the others
// targets            the numbers of each simplex's target, in the unit of the points
#pragma once

#include "moves/assembly.hpp"
#include "moves/targets.hpp"

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

template <int D, class Target>
class Foldover {
   public:
    Foldover(const std::int32_t* simplices, std::int64_t m, std::int64_t n)
        : assembly_(simplices, m, n), parts_(assembly_.items()) {}

    void constrain(const Freedom& freedom) { assembly_.constrain(freedom); }
    const std::vector<std::int32_t>& simplices() const { return assembly_.simplices(); }
    std::int64_t size() const { return assembly_.size(); }

    // gradient (free, D).
    EnergyValue evaluate(const double* points, const double* targets, Regularisation r, std::int64_t free,
                         double* gradient, int threads) {
        assembly_.evaluate(free, gradient, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
            parts_[item] = look_at(points, targets, r, begin, end);
        });
        EnergyValue total;
        for (const auto& part : parts_) {
            total.energy += part.energy;
            total.of_inverted += part.of_inverted;
            total.min_det = part.min_det < total.min_det ? part.min_det : total.min_det;
        }
        return total;
    }

   private:
    // The energy of some simplices; what they add to the gradient goes to the shares of their item.
    EnergyValue look_at(const double* points, const double* targets, Regularisation r, std::int64_t begin,
                        std::int64_t end) {
        LaneSum energy, of_inverted;
        double min_det = INFINITY;
        for (std::int64_t s = begin; s < end; s += LANES) {
            const Edges<D, Pack> e = assembly_.edges(points, s, end);
            const Target target(targets, s, end);
            Corners<D, Pack> slopes;
            Pack det;
            Pack value = energy_of(e, target, r, slopes, det);
            const int count = static_cast<int>(std::min<std::int64_t>(LANES, end - s));
            assembly_.add(slopes, s, count);
            for (int i = 0; i < count; ++i)
                if (!(det[i] >= min_det)) min_det = det[i];
            for (int i = count; i < LANES; ++i) value[i] = 0.0;
            const auto block = static_cast<std::size_t>((s - begin) / LANES);
            energy.add(block, value);
            of_inverted.add(block, select(det > constant<Pack>(0.0), constant<Pack>(0.0), value));
        }
        return {energy.total(), of_inverted.total(), min_det};
    }

    // The energy, the determinant of J and the slope of the energy at every corner.
    static Pack energy_of(const Edges<D, Pack>& e, const Target& target, Regularisation r, Corners<D, Pack>& slopes,
                          Pack& det) {
        const Pack one = constant<Pack>(1.0), weight = constant<Pack>(r.weight), to_det = target.to_det();
        det = determinant(e) * to_det;
        const Chi<Pack> chi(det, r.eps);
        const Pack root = D == 2 ? chi.inverse : cube_root(chi.inverse);
        const Pack shape = target.trace(e, D == 2 ? root : root * root, slopes);
        const Pack measure = (one + det * det) * chi.inverse;
        const Pack by_det = to_det * (weight * (constant<Pack>(2.0) * det * chi.inverse - measure * chi.decay) -
                                      constant<Pack>(2.0 / D) * shape * chi.decay);
        const Edges<D, Pack> normals = determinant_slopes(e);
        for (int k = 0; k < D; ++k) {
            slopes[k + 1] = slopes[k + 1] + by_det * normals[k];
            slopes[0] = slopes[0] - by_det * normals[k];
        }
        return shape + weight * measure;
    }

    Assembly<D> assembly_;
    std::vector<EnergyValue> parts_;
};

}  // namespace meshfix
