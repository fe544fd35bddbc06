// Smoothing of the mean ratio: Newton's method for the sum of its inverse over a star, raised to the power D so that bad
// simplices count more, without lowering the smallest sine below a floor.
//
// The inverse mean ratio of a simplex is S / det^(2/D) but for a constant, S the sum of its squared edges; it is
// smallest where the simplex is regular and goes to infinity where it is flat. Its power D, S^D / det^2, takes no roots.
// Source: P. Knupp, "Algebraic mesh quality metrics", SIAM J. Sci. Comput. 23 (2001).
#pragma once

#include "common/cholesky.hpp"
#include "measures/sines.hpp"

namespace meshfix {

template <int D, class T>
inline T powered_ratio(T edges2, T det) {
    T power = edges2;
    for (int k = 1; k < D; ++k) power = power * edges2;
    return power / (det * det);
}

// A sum over a star as a function of the position of the free vertex.
template <int D>
struct StarSum {
    double value = 0.0;
    Vec<D> gradient{};
    std::array<Vec<D>, D> hessian{};  // its lower triangle

    // Newton's step by Cholesky's factors; steepest descent over a tenth of the star where the sum is not convex.
    Vec<D> step(double radius) const {
        std::array<Vec<D>, D> rows = hessian;
        Vec<D> x = -1.0 * gradient;
        if (!solve_positive<D>(rows, x, NEWTON_PIVOT)) return (-0.1 * radius / std::sqrt(norm2(gradient))) * gradient;
        return x;
    }
};

// The step of a vertex, in the directions that it has.
template <int D, int K>
Vec<D> step_along(const StarSum<D>& sum, const Directions<D>& directions, double radius) {
    StarSum<K> part;
    for (int i = 0; i < K; ++i) {
        part.gradient[i] = dot(directions.axes[i], sum.gradient);
        for (int j = 0; j <= i; ++j)
            for (int k = 0; k < D; ++k)
                for (int l = 0; l < D; ++l)
                    part.hessian[i][j] += directions.axes[i][k] * sum.hessian[std::max(k, l)][std::min(k, l)] * directions.axes[j][l];
    }
    const Vec<K> step = part.step(radius);
    Vec<D> way{};
    for (int i = 0; i < K; ++i) way = way + step[i] * directions.axes[i];
    return way;
}

template <int D>
Vec<D> newton_step(const StarSum<D>& sum, const Star<D>& star) {
    if (star.directions.anywhere()) return sum.step(star.radius);
    if (D == 3 && star.directions.count == 2) return step_along<D, 2>(sum, star.directions, star.radius);
    return step_along<D, 1>(sum, star.directions, star.radius);
}

template <int D>
struct MeanRatio : StarSum<D> {
    // The sum over a star at x; infinite where a determinant is not positive.
    static double at(const Star<D>& star, const Vec<D>& x) {
        LaneSum sum;
        Pack smallest = constant<Pack>(1.0);
        for (std::size_t b = 0; b < star.blocks.size(); ++b) {
            const auto e = star.edges(star.blocks[b], x);
            const Pack det = determinant(e);
            smallest = smaller(smallest, det);
            sum.add(b, star.weights(b) * powered_ratio<D>(sum_of_squared_edges<D>(e), det));
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
            const Pack edges2 = sum_of_squared_edges<D>(e), det = determinant(e);
            const Pack f = star.weights(b) * powered_ratio<D>(edges2, det), pf = p * f;
            Vec<D, Pack> outward = e[0];
            for (int k = 1; k < D; ++k) outward = outward + e[k];
            const Vec<D, Pack> s = (constant<Pack>(-2.0) / edges2) * outward;
            const Vec<D, Pack> n = (constant<Pack>(1.0) / det) * determinant_slope(e);
            const Vec<D, Pack> u = s - constant<Pack>(2.0 / D) * n;
            sum.add(b, f);
            for (int i = 0; i < D; ++i) {
                slope[i].add(b, pf * u[i]);
                curvature[i][i].add(b, pf * (constant<Pack>(2.0 * D) / edges2));
                for (int j = 0; j <= i; ++j)
                    curvature[i][j].add(b, pf * (p * u[i] * u[j] - s[i] * s[j] + 2.0 / D * n[i] * n[j]));
            }
        }
        this->value = sum.total();
        for (int i = 0; i < D; ++i) {
            this->gradient[i] = slope[i].total();
            for (int j = 0; j <= i; ++j) this->hessian[i][j] = curvature[i][j].total();
        }
    }
};

// The same where elements are not all simplices. Of a corner f is the inverse square of its scaled Jacobian, since ideal
// corners say nothing of the lengths of their edges: log f = sum log |e|^2 - 2 log det. Of a simplex it is scaled so that
// it is 1 where that is regular, as of corners.
template <int D>
struct ElementRatio : StarSum<D> {
    static double at(const Star<D>& star, const Vec<D>& x) {
        double sum = 0.0;
        for (int i = 0; i < star.faces_count; ++i) {
            const Edges<D> e = star.edges(i, x);
            if (!(determinant(e) > 0.0)) return INFINITY;
            sum += of_face(star, i, e);
        }
        return sum;
    }

    ElementRatio(const Star<D>& star, const Vec<D>& x) {
        for (int i = 0; i < star.faces_count; ++i) {
            const Edges<D> e = star.edges(i, x);
            const double f = of_face(star, i, e);
            const Vec<D> n = (1.0 / determinant(e)) * determinant_slope(e);
            Vec<D> u = -2.0 * n;                 // the gradient of log f
            std::array<Vec<D>, D> bend{};        // the Hessian of log f
            for (int k = 0; k < D; ++k) add_outer(bend, 2.0 * n[k], n, k);
            const int corner = corner_of(star, i);
            if (corner == 0) {
                const double edges2 = sum_of_squared_edges<D>(e);
                Vec<D> s = e[0];
                for (int k = 1; k < D; ++k) s = s + e[k];
                s = (-2.0 / edges2) * s;
                u = u + static_cast<double>(D) * s;
                for (int k = 0; k < D; ++k) {
                    add_outer(bend, -D * s[k], s, k);
                    bend[k][k] += 2.0 * D * D / edges2;
                }
            }
            for (int k = 0; k < D; ++k) {
                if (corner != 1 && corner != 2 + k) continue;
                const double inverse2 = 1.0 / norm2(e[k]);
                u = u - (2.0 * inverse2) * e[k];
                for (int j = 0; j < D; ++j) {
                    add_outer(bend, -4.0 * inverse2 * inverse2 * e[k][j], e[k], j);
                    bend[j][j] += 2.0 * inverse2;
                }
            }
            this->value += f;
            this->gradient = this->gradient + f * u;
            for (int k = 0; k < D; ++k) {
                add_outer(this->hessian, f * u[k], u, k);
                this->hessian[k] = this->hessian[k] + f * bend[k];
            }
        }
    }

 private:
    static int corner_of(const Star<D>& star, int i) { return static_cast<int>(star.roles[i / LANES].corner[i % LANES]); }

    static double of_face(const Star<D>& star, int i, const Edges<D>& e) {
        const double corner = star.roles[i / LANES].corner[i % LANES], weight = star.roles[i / LANES].weight[i % LANES];
        if (corner > 0.0) return 1.0 / corner_sine2<D>(e, corner, weight, false);
        constexpr double REGULAR = D == 2 ? 1.0 / 9.0 : 1.0 / 216.0;
        return REGULAR * powered_ratio<D>(sum_of_squared_edges<D>(e), weight * determinant(e));
    }

    static void add_outer(std::array<Vec<D>, D>& matrix, double scale, const Vec<D>& v, int row) {
        matrix[row] = matrix[row] + scale * v;
    }
};

// From a valid position to one of a smaller sum whose smallest sine^2 is not below the floor, nor, where that of the
// star is below it, smaller than it was. `reachable` gives the position to which a step can go.
template <int D, class Sum, class F>
Vec<D> improve_mean(const Star<D>& star, double quality, double floor, const F& reachable) {
    const Sum here(star, star.position);
    const double least = std::min(quality, floor) * (1.0 - SAME_SINE2);  // `min_sine2` wants more than its floor
    Vec<D> step = newton_step<D>(here, star);
    for (int trial = 0; trial < NEWTON_TRIALS; ++trial, step = 0.5 * step) {
        const Vec<D> x = reachable(star.position + step);
        if (Sum::at(star, x) < here.value && min_sine2<D>(star, x, least) > 0.0) return x;
    }
    return star.position;
}

}  // namespace meshfix
