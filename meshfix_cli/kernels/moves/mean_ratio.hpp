// Smoothing of the mean ratio: Newton's method for the sum of its inverse over a star, raised to the power D so that bad
// simplices count more, without lowering the smallest sine below a floor.
//
// The inverse mean ratio of a simplex is S / det^(2/D) but for a constant, S the sum of its squared edges; it is
// smallest where the simplex is regular and goes to infinity where it is flat. Its power D, S^D / det^2, takes no roots.
// Source: P. Knupp, "Algebraic mesh quality metrics", SIAM J. Sci. Comput. 23 (2001).
#pragma once

#include "measures/sines.hpp"

namespace meshfix {

template <int D, class T>
inline T powered_ratio(T edges2, T det) {
    T power = edges2;
    for (int k = 1; k < D; ++k) power = power * edges2;
    return power / (det * det);
}

template <int D>
struct MeanRatio {
    double value = 0.0;
    Vec<D> gradient{};
    std::array<Vec<D>, D> hessian{};  // its lower triangle

    // What a lane counts: those of different shapes are comparable, since that of the ideal one is 1.
    static Pack weights(const Star<D>& star, std::size_t b) {
        if (star.roles.empty()) return star.weights(b);
        const Pack det = star.roles[b].weight;
        return star.weights(b) * (constant<Pack>(D == 2 ? 1.0 / 4 : 1.0 / 27) / (det * det));
    }

    // The sum over a star at x; infinite where a determinant is not positive.
    static double at(const Star<D>& star, const Vec<D>& x) {
        LaneSum sum;
        Pack smallest = constant<Pack>(1.0);
        for (std::size_t b = 0; b < star.blocks.size(); ++b) {
            const auto e = star.edges(star.blocks[b], x);
            const Pack det = determinant(e);
            smallest = smaller(smallest, det);
            sum.add(b, weights(star, b) * powered_ratio<D>(star.squared_edges(b, e), det));
        }
        for (int i = 0; i < LANES; ++i)
            if (!(smallest[i] > 0.0)) return INFINITY;
        return sum.total();
    }

    // With derivatives: f = r^D, log r = log S - 2/D log det.
    MeanRatio(const Star<D>& star, const Vec<D>& x) {
        constexpr double p = D;
        LaneSum sum;
        std::array<LaneSum, D> slope;
        std::array<std::array<LaneSum, D>, D> curvature;
        for (std::size_t b = 0; b < star.blocks.size(); ++b) {
            const auto e = star.edges(star.blocks[b], x);
            const Pack edges2 = star.squared_edges(b, e), det = determinant(e);
            const Pack f = weights(star, b) * powered_ratio<D>(edges2, det), pf = p * f;
            Vec<D, Pack> outward = e[0];
            Pack pulls = constant<Pack>(D);
            if (star.roles.empty()) {
                for (int k = 1; k < D; ++k) outward = outward + e[k];
            } else {
                const Vec<D, Pack>& pull = star.roles[b].pull;
                outward = pull[0] * e[0];
                pulls = pull[0];
                for (int k = 1; k < D; ++k) {
                    outward = outward + pull[k] * e[k];
                    pulls += pull[k];
                }
            }
            const Vec<D, Pack> s = (constant<Pack>(-2.0) / edges2) * outward;
            const Vec<D, Pack> n = (constant<Pack>(1.0) / det) * determinant_slope(e);
            const Vec<D, Pack> u = s - constant<Pack>(2.0 / D) * n;
            sum.add(b, f);
            for (int i = 0; i < D; ++i) {
                slope[i].add(b, pf * u[i]);
                curvature[i][i].add(b, pf * (2.0 * pulls / edges2));
                for (int j = 0; j <= i; ++j)
                    curvature[i][j].add(b, pf * (p * u[i] * u[j] - s[i] * s[j] + 2.0 / D * n[i] * n[j]));
            }
        }
        value = sum.total();
        for (int i = 0; i < D; ++i) {
            gradient[i] = slope[i].total();
            for (int j = 0; j <= i; ++j) hessian[i][j] = curvature[i][j].total();
        }
    }

    // Newton's step by Cholesky's factors; steepest descent over a tenth of the star where the sum is not convex.
    Vec<D> step(double radius) const {
        std::array<Vec<D>, D> l = hessian;
        for (int i = 0; i < D; ++i)
            for (int j = 0; j <= i; ++j) {
                for (int k = 0; k < j; ++k) l[i][j] -= l[i][k] * l[j][k];
                if (j < i) {
                    l[i][j] /= l[j][j];
                } else if (l[i][i] > NEWTON_PIVOT * hessian[i][i]) {
                    l[i][i] = std::sqrt(l[i][i]);
                } else {
                    return (-0.1 * radius / std::sqrt(norm2(gradient))) * gradient;
                }
            }
        Vec<D> x;
        for (int i = 0; i < D; ++i) {
            x[i] = -gradient[i];
            for (int k = 0; k < i; ++k) x[i] -= l[i][k] * x[k];
            x[i] /= l[i][i];
        }
        for (int i = D; i-- > 0;) {
            for (int k = i + 1; k < D; ++k) x[i] -= l[k][i] * x[k];
            x[i] /= l[i][i];
        }
        return x;
    }
};

// From a valid position to one of a smaller sum whose smallest sine^2 is not below the floor, nor, where that of the
// star is below it, smaller than it was. `reachable` gives the position to which a step can go.
template <int D, class F>
Vec<D> improve_mean_ratio(const Star<D>& star, double quality, double floor, const F& reachable) {
    const MeanRatio<D> here(star, star.position);
    const double least = std::min(quality, floor) * (1.0 - SAME_SINE2);  // `min_sine2` wants more than its floor
    Vec<D> step = here.step(star.radius);
    for (int trial = 0; trial < NEWTON_TRIALS; ++trial, step = 0.5 * step) {
        const Vec<D> x = reachable(star.position + step);
        if (MeanRatio<D>::at(star, x) < here.value && min_sine2<D>(star, x, least) > 0.0) return x;
    }
    return star.position;
}

}  // namespace meshfix
