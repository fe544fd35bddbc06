// Angles of a simplex: planar ones in 2-D, dihedral ones in 3-D, from the edges that leave its first vertex.
#pragma once

#include <cmath>

#include "mesh/simplex.hpp"

namespace meshfix {

// Outward normals of the faces opposite the vertices, or all inward, as long as the faces are large; vertex 0 is the
// one that the edges leave.
template <class T>
std::array<Vec<2, T>, 3> normals(const Edges<2, T>& e) {
    const Vec<2, T>&A = e[0], &B = e[1];
    return {Vec<2, T>{B[1] - A[1], A[0] - B[0]}, Vec<2, T>{constant<T>(0.0) - B[1], B[0]}, Vec<2, T>{A[1], constant<T>(0.0) - A[0]}};
}
template <class T>
std::array<Vec<3, T>, 4> normals(const Edges<3, T>& e) {
    const Vec<3, T>&A = e[0], &B = e[1], &C = e[2];
    return {cross(B - A, C - A), cross(C, B), cross(A, C), cross(B, A)};
}

// The angles are those between two faces: which ones, and the edge between them, which joins the two other vertices.
template <int D>
inline constexpr std::array<std::array<int, 2>, D*(D + 1) / 2> FACES_AT = {};
template <>
inline constexpr std::array<std::array<int, 2>, 3> FACES_AT<2> = {{{0, 1}, {0, 2}, {1, 2}}};
template <>
inline constexpr std::array<std::array<int, 2>, 6> FACES_AT<3> = {{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

inline double length_between(const Edges<2>&, std::size_t) { return 1.0; }
inline double length_between(const Edges<3>& e, std::size_t k) {
    const std::array<Vec<3>, 6> along{e[2] - e[1], e[2] - e[0], e[1] - e[0], e[2], e[1], e[0]};
    return std::sqrt(norm2(along[k]));
}

// The cosines of the angles; NaN, or beyond 1, where a face has no size.
template <int D, class T>
auto cosines(const Edges<D, T>& e) {
    const auto n = normals(e);
    std::array<T, D + 1> inverse;
    for (int i = 0; i <= D; ++i) inverse[i] = constant<T>(1.0) / square_root(norm2(n[i]));
    std::array<T, D*(D + 1) / 2> result;
    for (std::size_t k = 0; k < result.size(); ++k) {
        const auto [i, j] = FACES_AT<D>[k];
        result[k] = constant<T>(-1.0) * dot(n[i], n[j]) * inverse[i] * inverse[j];
    }
    return result;
}

// The sine of one of these angles.
template <int D>
double sine_of(const Edges<D>& e, std::size_t k) {
    const auto n = normals(e);
    const auto [i, j] = FACES_AT<D>[k];
    return std::fabs(determinant(e)) * length_between(e, k) / (std::sqrt(norm2(n[i])) * std::sqrt(norm2(n[j])));
}

// Smallest and largest angle, with atan2 of sine and cosine: acos alone loses half the digits near 0 and 180 degrees.
struct AngleRange {
    double smallest, largest;
};

template <int D>
AngleRange angles(const Edges<D>& e) {
    const auto c = cosines<D>(e);
    for (double x : c)
        if (!(std::fabs(x) < 2.0)) return {0.0, std::acos(-1.0)};  // an edge or triangle of size zero
    const auto at = [&](auto found) {
        return std::atan2(sine_of<D>(e, static_cast<std::size_t>(found - c.begin())), *found);
    };
    return {at(std::max_element(c.begin(), c.end())), at(std::min_element(c.begin(), c.end()))};
}

}  // namespace meshfix
