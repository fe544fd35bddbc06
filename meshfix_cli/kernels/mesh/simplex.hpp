// One simplex: its determinant, its longest edge and whether it is valid.
//
// A simplex is given by the edges that leave one of its vertices, e[0..D-1], in positive order.
#pragma once

#include "common/tolerances.hpp"
#include "common/vec.hpp"

namespace meshfix {

template <int D, class T = double>
using Edges = std::array<Vec<D, T>, D>;

// d! times the signed measure, equations (2.2) and (2.3).
template <class T>
inline T determinant(const Edges<2, T>& e) {
    return cross(e[0], e[1]);
}
template <class T>
inline T determinant(const Edges<3, T>& e) {
    return dot(e[0], cross(e[1], e[2]));
}

constexpr double factorial(int d) { return d == 2 ? 2.0 : 6.0; }

// Squared length of the longest edge.
template <int D, class T>
inline T longest_edge2(const Edges<D, T>& e) {
    T longest = norm2(e[0]);
    for (int i = 0; i < D; ++i) {
        longest = larger(longest, norm2(e[i]));
        for (int j = i + 1; j < D; ++j) longest = larger(longest, norm2(e[j] - e[i]));
    }
    return longest;
}

template <int D, class T>
inline T sum_of_squared_edges(const Edges<D, T>& e) {
    T sum = constant<T>(0.0);
    for (int i = 0; i < D; ++i) {
        sum += norm2(e[i]);
        for (int j = i + 1; j < D; ++j) sum += norm2(e[j] - e[i]);
    }
    return sum;
}

// The gradient of the determinant by the vertex that the edges leave.
template <class T>
inline Vec<2, T> determinant_slope(const Edges<2, T>& e) {
    return {e[0][1] - e[1][1], e[1][0] - e[0][0]};
}
template <class T>
inline Vec<3, T> determinant_slope(const Edges<3, T>& e) {
    return cross(e[2] - e[0], e[1] - e[0]);
}

// The gradients of the determinant by the edges.
template <class T>
inline Edges<2, T> determinant_slopes(const Edges<2, T>& e) {
    return {Vec<2, T>{e[1][1], -e[1][0]}, Vec<2, T>{-e[0][1], e[0][0]}};
}
template <class T>
inline Edges<3, T> determinant_slopes(const Edges<3, T>& e) {
    return {cross(e[1], e[2]), cross(e[2], e[0]), cross(e[0], e[1])};
}

// Positions in a simplex of the face opposite corner k, ordered so that (k, face) is an even permutation:
// det(face - x) is then the determinant of the simplex with x at corner k.
template <int D>
inline const std::array<int, D>& opposite_face(int k) {
    if constexpr (D == 2) {
        static constexpr std::array<std::array<int, 2>, 3> faces{{{1, 2}, {2, 0}, {0, 1}}};
        return faces[k];
    } else {
        static constexpr std::array<std::array<int, 3>, 4> faces{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
        return faces[k];
    }
}

// Whether rounding leaves no doubt that a simplex is valid, from whichever vertex its determinant was taken.
template <int D, class T>
inline auto is_plainly_valid(T det, T longest2) {
    const T measure2 = D == 2 ? longest2 * longest2 : longest2 * longest2 * longest2;
    return (det > constant<T>(0.0)) & (det * det > constant<T>(VALID * VALID) * measure2);
}

template <int D, class T = double>
using Corners = std::array<Vec<D, T>, D + 1>;

// The edges from the corner where the determinant is most exact: its rounding error is of the size of their product.
template <int D>
inline Edges<D> sharpest_edges(const Corners<D>& p, double& product) {
    Edges<D> best{};
    product = INFINITY;
    for (int k = 0; k <= D; ++k) {
        Edges<D> e;
        double here = 1.0;
        for (int i = 0; i < D; ++i) {
            e[i] = p[opposite_face<D>(k)[i]] - p[k];
            here *= std::sqrt(norm2(e[i]));
        }
        if (here < product) {
            product = here;
            best = e;
        }
    }
    return best;
}

// Whether a simplex is valid of which a quick look does not tell. Its corners have rounding errors of the size of
// `unit`: 0 for those of the mesh, whose differences are exact to the last bit.
template <int D>
inline bool is_barely_valid(const Corners<D>& p, double unit) {
    double product = 0.0;
    const Edges<D> e = sharpest_edges<D>(p, product);
    double error = product;
    for (const auto& edge : e) error += unit * product / std::sqrt(norm2(edge));
    return determinant(e) > VALID * error;
}

// Whether the edges from one vertex tell that a simplex is valid: the others are at most twice as long.
template <int D, class T>
inline auto is_valid_at_a_glance(const Edges<D, T>& e, T det) {
    T longest2 = norm2(e[0]);
    for (int k = 1; k < D; ++k) longest2 = larger(longest2, norm2(e[k]));
    return is_plainly_valid<D>(det, constant<T>(4.0) * longest2);
}

// The one validity predicate, for a star in its local frame and for the whole mesh. False for NaN. `corners` gives the
// corners, where the edges from one do not tell.
template <int D, class F>
inline bool is_valid(const Edges<D>& e, double det, const F& corners, double unit = 0.0) {
    if (is_valid_at_a_glance<D>(e, det)) return true;
    return !is_valid_at_a_glance<D>(e, -det) && is_barely_valid<D>(corners(), unit);
}

}  // namespace meshfix
