// The linear programme of section 2: the position that maximises the smallest measure in a star.
//
//     max t  subject to  t <= c_i + n_i . x  for every face i,   |x_k| <= box            (2.4)
//
// c_i (n) and n_i (n, D): determinant at the origin and its gradient, equations (2.2) and (2.3) times d!. Divided
// by |n_i| they are the heights over the faces, which make better shapes where the star can be made valid.
// Solved as the paper does, by the simplex method on its dual in standard form (2.5)-(2.6),
//
//     min c.y  subject to  A y = b, y >= 0,   A_i = (-n_i, 1),   b = (0, .., 0, 1),
//
// with multipliers pi = (x, t). The box adds the columns (+-e_k, 0) of cost `box`; one face and D of them are
// feasible at once, which replaces the phase one of section 2.2 and ends open stars on the box. The revised
// simplex method keeps the inverse of the (D+1) x (D+1) basis. Coordinates are those of `frame`, axes that the star
// itself sets: neither the box nor the order of pivots depends on the axes of the mesh.
#pragma once

#include <vector>

#include "mesh/star.hpp"

namespace meshfix {

enum class LpStatus { optimal, degenerate, failed };

// A function of the position: value + gradient . x.
template <int D>
struct Affine {
    double value;
    Vec<D> gradient;
};

// The determinants of the faces of a star.
template <int D>
void take_faces(const Star<D>& star, std::vector<Affine<D>>& functions) {
    functions.clear();
    for (int i = 0; i < star.faces_count; ++i) {
        const Edges<D> e = star.edges(i, Vec<D>{});
        functions.push_back({determinant(e), determinant_slope(e)});
    }
}

// Columns are numbered: the faces, in the blocks of the star (its last face may stand there twice, which changes
// nothing), then +e_0, -e_0, +e_1, ...
template <int D>
struct LinearProgram {
    using Column = std::array<double, D + 1>;

    Edges<D> frame{};                   // rows: orthonormal axes
    std::vector<Vec<D, Pack>> normals;  // -n_i
    std::vector<Pack> costs;            // c_i
    double box = 0.0;
    int faces_count = 0;                // columns that are faces
    int stand_in = -1;                  // the face that took the place of those of co-located neighbours, or -1
    double largest_cost = 0.0;

    std::array<int, D + 1> basis{};
    std::array<Column, D + 1> inverse{};  // rows
    Column pi{};                          // (x, t)
    int faces = 0;  // without those that fill up the last block
    int pivots = 0;

    // Takes the columns from a star; `heights`: divided by |n_i|.
    void set(const Star<D>& star, bool heights) {
        resize(star.neighbours, star.radius, star.faces_count);
        for (std::size_t b = 0; b < star.blocks.size(); ++b) {
            const auto& p = star.blocks[b];
            costs[b] = determinant(p);
            if constexpr (D == 2) {
                normals[b] = turned({p[1][1] - p[0][1], p[0][0] - p[1][0]});
            } else {
                normals[b] = turned(cross(p[1] - p[0], p[2] - p[0]));
            }
        }
        settle(heights);
    }

    // Takes other affine functions of the position, values at the origin and their gradients; the neighbours set axes.
    void set(const std::vector<Vec<D>>& neighbours, double radius, const std::vector<Affine<D>>& functions, bool heights) {
        const int count = static_cast<int>(functions.size());
        resize(neighbours, radius, count);
        for (int i = 0; i < faces_count; ++i) {
            const Affine<D>& f = functions[std::min(i, count - 1)];
            costs[i / LANES][i % LANES] = f.value;
            for (int k = 0; k < D; ++k) normals[i / LANES][k][i % LANES] = -dot(frame[k], f.gradient);
        }
        settle(heights);
    }

    // The smallest determinant or height is pi[D].
    LpStatus solve() {
        pivots = 0;
        start();
        const int limit = LP_MAX_PIVOTS + 10 * faces;
        for (; pivots < limit; ++pivots) {
            const bool bland = pivots >= LP_BLAND_AFTER + faces;
            price();
            const int entering = choose_entering(LP_PRICING * largest_cost, bland);
            if (entering < 0) return finish();
            if (!exchange(entering, bland)) return LpStatus::failed;
        }
        return LpStatus::failed;
    }

    Vec<D> position() const {
        Vec<D> x{};
        for (int k = 0; k < D; ++k) x = x + pi[k] * frame[k];
        return x;
    }

    Column column(int j) const {
        Column a{};
        if (j < faces_count) {
            for (int k = 0; k < D; ++k) a[k] = normals[j / LANES][k][j % LANES];
            a[D] = 1.0;
        } else {
            a[(j - faces_count) / 2] = (j - faces_count) % 2 == 0 ? 1.0 : -1.0;
        }
        return a;
    }

    double cost(int j) const { return j < faces_count ? costs[j / LANES][j % LANES] : box; }

    // The dual certificate: weight of basic column `row`; c.y = t by construction, feasible where y >= 0.
    double weight(int row) const { return inverse[row][D]; }

   private:
    void resize(const std::vector<Vec<D>>& neighbours, double radius, int count) {
        faces = count;
        const int blocks = (count + LANES - 1) / LANES;
        faces_count = blocks * LANES;
        normals.resize(blocks);
        costs.resize(blocks);
        box = LP_BOX * radius;
        set_frame(neighbours);
    }

    void settle(bool heights) {
        Pack shortest = constant<Pack>(INFINITY), longest = constant<Pack>(0.0);
        for (const auto& normal : normals) {
            shortest = smaller(shortest, norm2(normal));
            longest = larger(longest, norm2(normal));
        }
        double shortest2 = INFINITY, longest2 = 0.0;
        for (int i = 0; i < LANES; ++i) {
            shortest2 = std::min(shortest2, shortest[i]);
            longest2 = std::max(longest2, longest[i]);
        }
        stand_in = -1;
        if (!(shortest2 > LP_DROPPED_FACE2 * longest2)) drop_faces(LP_DROPPED_FACE2 * longest2);
        if (heights && longest2 > 0.0) divide_by_areas();
        Pack cost = constant<Pack>(box);
        for (const Pack& c : costs) cost = larger(cost, larger(c, c * constant<Pack>(-1.0)));
        largest_cost = box;
        for (int i = 0; i < LANES; ++i) largest_cost = std::max(largest_cost, cost[i]);
    }

    // The first neighbour that is far from the centroid, the first that is far from that line.
    void set_frame(const std::vector<Vec<D>>& neighbours) {
        frame[0] = first_far(neighbours, Vec<D>{});
        if constexpr (D == 2) {
            frame[1] = {-frame[0][1], frame[0][0]};
        } else if constexpr (D == 3) {
            frame[1] = first_far(neighbours, frame[0]);
            frame[2] = cross(frame[0], frame[1]);
        }
    }

    // Unit vector; all that is left of neighbours after `axis`. Zero where nothing is.
    static Vec<D> first_far(const std::vector<Vec<D>>& neighbours, const Vec<D>& axis) {
        double largest2 = 0.0;
        for (const auto& p : neighbours) largest2 = std::max(largest2, norm2(p - dot(p, axis) * axis));
        for (const auto& p : neighbours) {
            const Vec<D> rest = p - dot(p, axis) * axis;
            if (norm2(rest) > LP_AXIS2 * largest2) return (1.0 / std::sqrt(norm2(rest))) * rest;
        }
        return Vec<D>{};
    }

    Vec<D, Pack> turned(const Vec<D, Pack>& v) const {
        Vec<D, Pack> w;
        for (int k = 0; k < D; ++k) {
            w[k] = frame[k][0] * v[0];
            for (int c = 1; c < D; ++c) w[k] += frame[k][c] * v[c];
        }
        return w;
    }

    void divide_by_areas() {
        for (std::size_t b = 0; b < costs.size(); ++b) {
            const Pack scale = constant<Pack>(1.0) / square_root(norm2(normals[b]));
            costs[b] = costs[b] * scale;
            normals[b] = scale * normals[b];
        }
    }

    Vec<D> normal(int j) const {
        Vec<D> n;
        for (int k = 0; k < D; ++k) n[k] = normals[j / LANES][k][j % LANES];
        return n;
    }

    // The face of co-located neighbours says nothing: the largest face takes its place.
    void drop_faces(double smallest) {
        stand_in = 0;
        for (int j = 1; j < faces_count; ++j)
            if (norm2(normal(j)) > norm2(normal(stand_in))) stand_in = j;
        for (int j = 0; j < faces_count; ++j) {
            if (norm2(normal(j)) > smallest) continue;
            for (int k = 0; k < D; ++k) normals[j / LANES][k][j % LANES] = normal(stand_in)[k];
            costs[j / LANES][j % LANES] = cost(stand_in);
        }
    }

    // Normals that span R^d: Gram-Schmidt with the largest residual as pivot.
    bool normals_span_space() const {
        std::array<Vec<D>, D> found;
        double largest = 0.0;
        for (int rank = 0; rank < D; ++rank) {
            Vec<D> best{};
            for (int j = 0; j < faces_count; ++j) {
                Vec<D> residual = normal(j);
                for (int r = 0; r < rank; ++r) residual = residual - dot(residual, found[r]) * found[r];
                if (norm2(residual) > norm2(best)) best = residual;
            }
            if (rank == 0) largest = norm2(best);
            if (!(norm2(best) > LP_RANK * LP_RANK * largest)) return false;
            found[rank] = (1.0 / std::sqrt(norm2(best))) * best;
        }
        return true;
    }

    // A basis of faces alone spans the space by itself; only one with a side of the box needs the test.
    LpStatus finish() const {
        if (!std::isfinite(pi[D])) return LpStatus::failed;
        const bool on_box = *std::max_element(basis.begin(), basis.end()) >= faces_count;
        return on_box && !normals_span_space() ? LpStatus::degenerate : LpStatus::optimal;
    }

    // Basis: the worst face at the origin, and in each direction the side of the box that balances its normal.
    void start() {
        int worst = 0;
        for (int j = 1; j < faces_count; ++j)
            if (cost(j) < cost(worst)) worst = j;
        basis[0] = worst;
        inverse = {};
        inverse[0][D] = 1.0;
        for (int k = 0; k < D; ++k) {
            const double a = normal(worst)[k], sign = a > 0.0 ? -1.0 : 1.0;
            basis[k + 1] = faces_count + 2 * k + (a > 0.0);
            inverse[k + 1][k] = sign;
            inverse[k + 1][D] = -sign * a;
        }
    }

    void price() {
        pi = {};
        for (int row = 0; row <= D; ++row) {
            const double c = cost(basis[row]);
            for (int k = 0; k <= D; ++k) pi[k] += c * inverse[row][k];
        }
    }

    bool is_basic(int j) const {
        bool basic = false;
        for (const int b : basis) basic |= b == j;
        return basic;
    }

    // Largest coefficient, or Bland's first index; -1: optimal. A basic column never enters again.
    int choose_entering(double tolerance, bool bland) const {
        if (!bland) {
            const int j = smallest_reduced_cost();
            if (!(reduced_cost(j) < -tolerance)) return -1;
            if (!is_basic(j)) return j;
        }
        for (int j = 0; j < faces_count + 2 * D; ++j)
            if (reduced_cost(j) < -tolerance && !is_basic(j)) return j;
        return -1;
    }

    double reduced_cost(int j) const { return cost(j) - dot(column(j), pi); }

    int smallest_reduced_cost() const {
        Pack best = constant<Pack>(INFINITY), at = constant<Pack>(0.0);
        for (std::size_t b = 0; b < costs.size(); ++b) {
            Pack reduced = costs[b] - pi[D];
            for (int k = 0; k < D; ++k) reduced = reduced - pi[k] * normals[b][k];
            const auto better = reduced < best;
            best = select(better, reduced, best);
            at = select(better, constant<Pack>(static_cast<double>(b)), at);
        }
        int entering = 0;
        double smallest = INFINITY;
        for (int i = 0; i < LANES; ++i) {
            const int j = static_cast<int>(at[i]) * LANES + i;
            if (!(best[i] < smallest || (best[i] == smallest && j < entering))) continue;  // however they are packed
            smallest = best[i];
            entering = j;
        }
        for (int k = 0; k < D; ++k) {
            const double reduced = box - std::fabs(pi[k]);
            if (!(reduced < smallest)) continue;
            smallest = reduced;
            entering = faces_count + 2 * k + (pi[k] < 0.0);
        }
        return entering;
    }

    // Ratio test and pivot; false: no row can leave, which the box rules out but for rounding.
    bool exchange(int entering, bool bland) {
        const Column a = column(entering);
        Column w;
        for (int row = 0; row <= D; ++row) w[row] = dot(inverse[row], a);
        const double tolerance = LP_PIVOT * largest_coordinate(w);
        Column ratios;
        for (int row = 0; row <= D; ++row) ratios[row] = w[row] > tolerance ? inverse[row][D] / w[row] : INFINITY;
        int leaving = 0;
        for (int row = 1; row <= D; ++row) {
            const bool first = bland ? basis[row] < basis[leaving] : w[row] > w[leaving];
            const bool sooner = (ratios[row] < ratios[leaving]) | ((ratios[row] == ratios[leaving]) & first);
            leaving = sooner ? row : leaving;
        }
        if (!(ratios[leaving] < INFINITY)) return false;
        const double pivot = 1.0 / w[leaving];
        for (int k = 0; k <= D; ++k) inverse[leaving][k] *= pivot;
        for (int row = 0; row <= D; ++row) {
            if (row == leaving) continue;
            for (int k = 0; k <= D; ++k) inverse[row][k] -= w[row] * inverse[leaving][k];
        }
        basis[leaving] = entering;
        return true;
    }
};

}  // namespace meshfix
