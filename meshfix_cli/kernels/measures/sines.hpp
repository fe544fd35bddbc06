// The quality of a simplex: the sines of its angles (2-D) or dihedral angles (3-D), equation (3.2).
//
// A simplex is a face of a star (its vertices a, b and c in positive order) and the free vertex x; A, B, C are the
// edges from x to them. In 2-D sin = det / (product of the two edges at the angle); in 3-D
// sin = det * (edge) / (product of the normals of the two triangles at the edge).
#pragma once

#include "mesh/star.hpp"

namespace meshfix {

constexpr int functions_per_simplex(int d) { return d == 2 ? 3 : 6; }

// (smallest sine)^2 without square roots; with `plain` -1 or NaN where the simplex is not plainly valid.
template <class T>
inline T min_sine2(const Edges<2, T>& e, bool plain) {
    const T det = determinant(e), a = norm2(e[0]), b = norm2(e[1]), ab = norm2(e[1] - e[0]);
    const T sine2 = det * det / larger(larger(a * b, a * ab), b * ab);
    return plain ? select(is_plainly_valid<2>(det, larger(larger(a, b), ab)), sine2, constant<T>(-1.0)) : sine2;
}

template <class T>
inline T min_sine2(const Edges<3, T>& e, bool plain) {
    const Vec<3, T>&A = e[0], &B = e[1], &C = e[2];
    const Vec<3, T> AB = B - A, BC = C - B, CA = A - C;
    const Vec<3, T> normal_a = cross(B, C), normal_b = cross(C, A), normal_c = cross(A, B);
    const T det = dot(A, normal_a);
    const T a = norm2(A), b = norm2(B), c = norm2(C), ab = norm2(AB), bc = norm2(BC), ca = norm2(CA);
    const T nx = norm2(cross(AB, BC)), na = norm2(normal_a), nb = norm2(normal_b), nc = norm2(normal_c);
    // Each edge^2 over the normals^2 beside it, on the common denominator nx na nb nc: one division for six sines.
    const T at_x = nx * smaller(smaller(a * na, b * nb), c * nc);
    const T opposite = smaller(smaller(ab * na * nb, bc * nb * nc), ca * nc * na);
    const T sine2 = det * det * smaller(at_x, opposite) / (nx * na * nb * nc);
    const T longest = larger(larger(larger(a, b), larger(c, ab)), larger(bc, ca));
    return plain ? select(is_plainly_valid<3>(det, longest), sine2, constant<T>(-1.0)) : sine2;
}

// The same of a simplex that a quick look does not tell to be valid; -1 where it is not. `unit` is that of `is_valid`.
template <int D>
inline double barely_min_sine2(const Corners<D>& p, double unit) {
    double product = 0.0;
    return is_barely_valid<D>(p, unit) ? min_sine2(sharpest_edges<D>(p, product), false) : -1.0;
}

// The square of the scaled Jacobian at the corner of an element; with `plain` -1 or NaN as above. Edges lead from the free
// vertex, `corner` tells where the corner is: see `Roles`.
template <int D, class T>
inline T corner_sine2(const Edges<D, T>& e, T corner, T weight, bool plain) {
    const T det = determinant(e);
    T longest = norm2(e[0]), product = norm2(e[0]);
    for (int k = 1; k < D; ++k) {
        product = product * norm2(e[k]);
        longest = larger(longest, norm2(e[k]));
    }
    for (int k = 0; k < D; ++k) {
        T there = norm2(e[k]);
        for (int l = 0; l < D; ++l)
            if (l != k) there = there * norm2(e[l] - e[k]);
        product = select(corner > constant<T>(1.5 + k), there, product);
    }
    const T sine2 = weight * weight * det * det / product;
    return plain ? select(is_plainly_valid<D>(det, constant<T>(4.0) * longest), sine2, constant<T>(-1.0)) : sine2;
}

// Of a corner that a quick look does not tell to be valid.
template <int D>
inline double barely_corner_sine2(const Star<D>& star, std::size_t block, int lane, const Vec<D>& x) {
    const Edges<D> e = star.edges(star.face_of(block, lane), x);
    const Roles<D>& roles = star.roles[block];
    return corner_sine2<D>(e, roles.corner[lane], roles.weight[lane], false);
}

// (smallest sine)^2 of the lanes of a block, or that of the scaled Jacobian where they are corners of elements.
template <int D>
inline Pack min_sine2_of(const Star<D>& star, std::size_t b, const Edges<D, Pack>& e) {
    if (star.roles.empty()) return min_sine2(e, true);
    const Roles<D>& roles = star.roles[b];
    const Pack corner = corner_sine2<D>(e, roles.corner, roles.weight, true);
    const auto is_corner = roles.corner > constant<Pack>(0.5);
    return all(is_corner) ? corner : select(is_corner, corner, min_sine2(e, true));
}

// The smallest over the star at x; as soon as it is not above `floor` the rest is not looked at and -1 returned.
template <int D>
double min_sine2(const Star<D>& star, const Vec<D>& x, double floor) {
    double smallest = INFINITY;
    for (std::size_t b = 0; b < star.blocks.size(); ++b) {
        const Pack lanes = min_sine2_of<D>(star, b, star.edges(star.blocks[b], x));
        for (int i = 0; i < LANES; ++i) {
            double lane = lanes[i];
            if (!(lane > 0.0) && star.valid_face(b, i, x)) {
                const bool is_corner = !star.roles.empty() && star.roles[b].corner[i] > 0.5;
                lane = is_corner ? barely_corner_sine2<D>(star, b, i, x)
                                 : barely_min_sine2<D>(star.corners(star.face_of(b, i), x), 1.0);
            }
            if (!(lane > floor)) return -1.0;
            smallest = std::min(smallest, lane);
        }
    }
    return smallest;
}

// A sine and its gradient with respect to x.
template <int D, class T = double>
struct Sine {
    T value;
    Vec<D, T> gradient;
};

// d(sine) = sine * d(log sine); each factor below comes with half the gradient of the log of its square.
template <int D, class T>
struct Factor {
    T length;
    Vec<D, T> log_gradient;
};

// The edge from x to p, E = p - x:  d log|E| = -E / |E|^2.
template <int D, class T>
inline Factor<D, T> edge_factor(const Vec<D, T>& E) {
    const T length2 = norm2(E);
    return {square_root(length2), (constant<T>(-1.0) / length2) * E};
}

// The triangle x, p, q with normal N = P x Q:  d log|N| = (P - Q) x N / |N|^2.
template <class T>
inline Factor<3, T> triangle_factor(const Vec<3, T>& P, const Vec<3, T>& Q) {
    const Vec<3, T> normal = cross(P, Q);
    const T length2 = norm2(normal);
    return {square_root(length2), (constant<T>(1.0) / length2) * cross(P - Q, normal)};
}

template <class T>
inline void sines(const Edges<2, T>& e, Sine<2, T>* out) {
    const T det = determinant(e), ab = square_root(norm2(e[1] - e[0]));
    const Vec<2, T> log_det = (constant<T>(1.0) / det) * Vec<2, T>{e[0][1] - e[1][1], e[1][0] - e[0][0]};
    const auto a = edge_factor<2>(e[0]), b = edge_factor<2>(e[1]);
    const auto emit = [&](T value, const Vec<2, T>& log_gradient) { *out++ = {value, value * log_gradient}; };
    emit(det / (a.length * b.length), log_det - a.log_gradient - b.log_gradient);
    emit(det / (a.length * ab), log_det - a.log_gradient);
    emit(det / (b.length * ab), log_det - b.log_gradient);
}

template <class T>
inline void sines(const Edges<3, T>& e, Sine<3, T>* out) {
    const Vec<3, T>&A = e[0], &B = e[1], &C = e[2];
    const Vec<3, T> base = cross(B - A, C - A);
    const T det = determinant(e), nx = square_root(norm2(base));
    const Vec<3, T> log_det = (constant<T>(-1.0) / det) * base;
    const auto a = edge_factor<3>(A), b = edge_factor<3>(B), c = edge_factor<3>(C);
    const auto na = triangle_factor(B, C), nb = triangle_factor(C, A), nc = triangle_factor(A, B);
    // The edge from x between two of the moving triangles, and the edge of the face below the third.
    const auto pair = [&](const Factor<3, T>& edge, T fixed_edge, const Factor<3, T>& p, const Factor<3, T>& q,
                          const Factor<3, T>& below) {
        const T sine = det * edge.length / (p.length * q.length);
        *out++ = {sine, sine * (log_det + edge.log_gradient - p.log_gradient - q.log_gradient)};
        const T fixed_sine = det * fixed_edge / (below.length * nx);
        *out++ = {fixed_sine, fixed_sine * (log_det - below.log_gradient)};
    };
    pair(a, square_root(norm2(C - B)), nb, nc, na);
    pair(b, square_root(norm2(A - C)), nc, na, nb);
    pair(c, square_root(norm2(B - A)), na, nb, nc);
}

// The scaled Jacobian at the corner of an element: sine = weight det / (product of the edges there).
template <int D>
inline Sine<D, Pack> corner_sine(const Edges<D, Pack>& e, const Roles<D>& roles) {
    const Pack det = determinant(e);
    Pack product2 = norm2(e[0]);
    Vec<D, Pack> log_gradient = (constant<Pack>(1.0) / det) * determinant_slope(e), there{};
    for (int k = 1; k < D; ++k) product2 = product2 * norm2(e[k]);
    for (int k = 0; k < D; ++k) there = there + (constant<Pack>(1.0) / norm2(e[k])) * e[k];
    for (int k = 0; k < D; ++k) {
        const auto is_here = roles.corner > constant<Pack>(1.5 + k);
        const Pack length2 = norm2(e[k]);
        Pack those = length2;
        for (int l = 0; l < D; ++l)
            if (l != k) those = those * norm2(e[l] - e[k]);
        product2 = select(is_here, those, product2);
        for (int c = 0; c < D; ++c) there[c] = select(is_here, e[k][c] / length2, there[c]);
    }
    log_gradient = log_gradient + there;
    const Pack value = roles.weight * det / square_root(product2);
    return {value, value * log_gradient};
}

// All sines of the star at x: functions_per_simplex(D) for each block of faces. Of corners the first is the scaled
// Jacobian, and the others are never the smallest.
template <int D>
void sines(const Star<D>& star, const Vec<D>& x, std::vector<Sine<D, Pack>>& out) {
    constexpr int COUNT = functions_per_simplex(D);
    out.resize(star.blocks.size() * COUNT);
    for (std::size_t b = 0; b < star.blocks.size(); ++b) {
        const Edges<D, Pack> e = star.edges(star.blocks[b], x);
        Sine<D, Pack>* const here = &out[b * COUNT];
        sines(e, here);
        if (star.roles.empty()) continue;
        const auto is_corner = star.roles[b].corner > constant<Pack>(0.5);
        const Sine<D, Pack> corner = corner_sine<D>(e, star.roles[b]);
        const Pack none = constant<Pack>(0.0);
        for (int i = 0; i < COUNT; ++i) {
            here[i].value = select(is_corner, i == 0 ? corner.value : constant<Pack>(INFINITY), here[i].value);
            for (int c = 0; c < D; ++c)
                here[i].gradient[c] = select(is_corner, i == 0 ? corner.gradient[c] : none, here[i].gradient[c]);
        }
    }
}

}  // namespace meshfix
