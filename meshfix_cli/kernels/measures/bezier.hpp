// What decides whether an element of any type is valid: the Bezier coefficients of det J, the determinant of its
// isoparametric map, which stays between the smallest and the largest of them.
//
// An element is given by its code and its nodes, in the order of shapes.hpp. The coefficients of simplices, quads and
// pyramids (but for a factor (1 - z)^2 of theirs) are the determinants of their corner simplices. Those of a wedge are,
// at each edge q_i between its triangles, the ones of a quadratic, n_k . q_i: n_0 and n_2 are twice the areas of the
// triangles, n_1 what mixes them. A hexahedron has 27, of degree 2 in each direction, each the mean of some
// determinants of one edge of each direction.
//
// Each is affine in the position of each node: the columns of a linear programme.
#pragma once

#include "mesh/shapes.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

constexpr int MOST_COEFFICIENTS = 27;

// The edges from the first node of a corner simplex, and all its nodes.
template <std::size_t D>
inline Edges<D> corner_edges(const std::array<double, D>* nodes, const std::array<std::int8_t, 4>& row) {
    Edges<D> e;
    for (std::size_t k = 0; k < D; ++k) e[k] = nodes[row[k + 1]] - nodes[row[0]];
    return e;
}
template <std::size_t D>
inline Corners<D> corner_points(const std::array<double, D>* nodes, const std::array<std::int8_t, 4>& row) {
    Corners<D> p;
    for (std::size_t k = 0; k <= D; ++k) p[k] = nodes[row[k]];
    return p;
}

// Two edges of each of a wedge's triangles, the normals that they span, and the edges between the triangles.
struct WedgeParts {
    Vec<3> a0, c0, a1, c1;
    std::array<Vec<3>, 3> n, q;

    explicit WedgeParts(const Vec<3>* p)
        : a0(p[1] - p[0]), c0(p[2] - p[0]), a1(p[4] - p[3]), c1(p[5] - p[3]),
          n{cross(a0, c0), 0.5 * (cross(a0, c1) + cross(a1, c0)), cross(a1, c1)},
          q{p[3] - p[0], p[4] - p[1], p[5] - p[2]} {}
};

// The corner of a hexahedron at (i, j, k) is its node HEX_NODE[i + 2 j + 4 k].
constexpr std::array<std::int8_t, 8> HEX_NODE{0, 1, 3, 2, 4, 5, 7, 6};

// The edges in the three directions, or something of them: x[j + 2 k] is of the one from corner (0, j, k) to (1, j, k),
// y[i + 2 k] and z[i + 2 j] likewise.
template <class T>
struct HexParts {
    std::array<T, 4> x, y, z;
};

inline HexParts<Vec<3>> hex_edges(const Vec<3>* p) {
    return {{p[1] - p[0], p[2] - p[3], p[5] - p[4], p[6] - p[7]},
            {p[3] - p[0], p[2] - p[1], p[7] - p[4], p[6] - p[5]},
            {p[4] - p[0], p[5] - p[1], p[7] - p[3], p[6] - p[2]}};
}

// The coefficients of a hexahedron, (I, J, K) at I + 3 J + 9 K.
using HexBox = std::array<double, 27>;

// One over the number of ways to make I of two numbers that are 0 or 1.
constexpr std::array<double, 3> SHARE{1.0, 0.5, 1.0};

inline HexBox hex_box(const HexParts<Vec<3>>& e) {
    HexBox b{};
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) {
            const Vec<3>&x0 = e.x[j], &x1 = e.x[j + 2], &y0 = e.y[i], &y1 = e.y[i + 2];
            const Vec<3> normals[3]{cross(x0, y0), 0.5 * (cross(x0, y1) + cross(x1, y0)), cross(x1, y1)};
            for (int K = 0; K < 3; ++K)
                for (int k = 0; k < 4; ++k) b[i + k % 2 + 3 * (j + k / 2) + 9 * K] += dot(normals[K], e.z[k]);
        }
    for (int c = 0; c < 27; ++c) b[c] *= SHARE[c % 3] * SHARE[c / 3 % 3];
    return b;
}

// Where `coefficients` finds those of a hexahedron: the corners in the order of the nodes, then the others.
constexpr std::array<std::int8_t, 27> HEX_ORDER{0,  2,  8,  6,  18, 20, 26, 24, 1,  3,  4,  5,  7, 9,
                                                10, 11, 12, 13, 14, 15, 16, 17, 19, 21, 22, 23, 25};

// The Bezier coefficients of det J, those at the corner simplices first; returns how many.
template <std::size_t D>
int coefficients(std::uint8_t code, const std::array<double, D>* nodes, double* out) {
    if constexpr (D == 3) {
        if (code == HEXAHEDRON) {
            const HexBox b = hex_box(hex_edges(nodes));
            for (int i = 0; i < 27; ++i) out[i] = b[HEX_ORDER[i]];
            return 27;
        }
        if (code == WEDGE) {
            const WedgeParts w(nodes);
            for (int i = 0; i < 3; ++i) {
                out[i] = dot(w.n[0], w.q[i]);
                out[i + 3] = dot(w.n[2], w.q[i]);
                out[i + 6] = dot(w.n[1], w.q[i]);
            }
            return 9;
        }
    }
    const ElementShape& shape = SHAPES[code];
    for (int c = 0; c < shape.simplices; ++c) out[c] = determinant(corner_edges(nodes, shape.simplex[c]));
    return shape.simplices;
}

// What rounding leaves in doubt of the determinant of three edges of these lengths, whose ends have errors of the size
// of `unit`: the bound of `is_barely_valid`.
inline double doubt(double x, double y, double z, double unit) {
    return VALID * (x * y * z + unit * (x * y + y * z + z * x));
}

template <std::size_t N>
inline double longest(const std::array<Vec<3>, N>& edges) {
    double most = 0.0;
    for (const auto& edge : edges) most = std::max(most, norm2(edge));
    return std::sqrt(most);
}

// Whether the coefficients of a wedge or hexahedron leave no doubt that it is valid, at its corners too: most are seen
// to be so.
inline bool is_valid_at_once(const WedgeParts& w, double unit) {
    const double base = longest(std::array<Vec<3>, 6>{w.a0, w.c0, w.c0 - w.a0, w.a1, w.c1, w.c1 - w.a1});
    const double bound = BEZIER_PLAIN * doubt(base, base, longest(w.q), unit);
    for (const auto& n : w.n)
        for (const auto& q : w.q)
            if (!(dot(n, q) > bound)) return false;
    return true;
}
inline bool is_valid_at_once(const HexParts<Vec<3>>& e, double unit) {
    const double bound = BEZIER_PLAIN * doubt(longest(e.x), longest(e.y), longest(e.z), unit);
    const HexBox box = hex_box(e);
    return std::all_of(box.begin(), box.end(), [bound](double b) { return b > bound; });
}
inline bool is_valid_at_once(std::uint8_t code, const Vec<3>* nodes, double unit) {
    if (code == WEDGE) return is_valid_at_once(WedgeParts(nodes), unit);
    return code == HEXAHEDRON && is_valid_at_once(hex_edges(nodes), unit);
}

// Whether det J of a wedge with positive corners is positive inside: b0, b1, b2 of each edge are those of a quadratic.
inline bool is_positive(const WedgeParts& w, double unit) {
    const auto length = [](const Vec<3>& v) { return std::sqrt(norm2(v)); };
    const double a0 = length(w.a0), c0 = length(w.c0), a1 = length(w.a1), c1 = length(w.c1);
    for (const auto& q : w.q) {
        const double height = length(q);
        const double b0 = std::max(0.0, dot(w.n[0], q) - doubt(a0, c0, height, unit));
        const double b1 = dot(w.n[1], q) - 0.5 * (doubt(a0, c1, height, unit) + doubt(a1, c0, height, unit));
        const double b2 = std::max(0.0, dot(w.n[2], q) - doubt(a1, c1, height, unit));
        if (!(b1 > -std::sqrt(b0) * std::sqrt(b2))) return false;
    }
    return true;
}

// The coefficients of a hexahedron without what is in doubt of them.
inline HexBox surely(const HexParts<Vec<3>>& e, double unit) {
    HexParts<double> length;
    for (int i = 0; i < 4; ++i) {
        length.x[i] = std::sqrt(norm2(e.x[i]));
        length.y[i] = std::sqrt(norm2(e.y[i]));
        length.z[i] = std::sqrt(norm2(e.z[i]));
    }
    HexBox b = hex_box(e);
    for (int x = 0; x < 4; ++x)
        for (int y = 0; y < 4; ++y)
            for (int z = 0; z < 4; ++z) {
                const int I = y % 2 + z % 2, J = x % 2 + z / 2, K = x / 2 + y / 2;
                const double share = SHARE[I] * SHARE[J] * SHARE[K];
                b[I + 3 * J + 9 * K] -= share * doubt(length.x[x], length.y[y], length.z[z], unit);
            }
    return b;
}

// The first coefficient of one of the 9 lines along a direction, in which neighbours are `stride` apart.
inline int line_start(int line, int stride) { return line / stride * 3 * stride + line % stride; }

// The stride of the direction in which a box is farthest from being linear: where it is linear, its coefficients are
// bounds that cannot be improved.
inline int most_bent(const HexBox& b) {
    int best = 1;
    double most = -1.0;
    for (const int stride : {1, 3, 9})
        for (int line = 0; line < 9; ++line) {
            const double* p = &b[line_start(line, stride)];
            const double bent = std::fabs(p[0] - 2.0 * p[stride] + p[2 * stride]);
            if (bent > most) {
                most = bent;
                best = stride;
            }
        }
    return best;
}

// Halves a box by de Casteljau's algorithm.
inline void halve(HexBox& first, HexBox& second) {
    const int stride = most_bent(first);
    second = first;
    for (int line = 0; line < 9; ++line) {
        double *p = &first[line_start(line, stride)], *q = &second[line_start(line, stride)];
        const double left = 0.5 * (p[0] + p[stride]), right = 0.5 * (p[stride] + p[2 * stride]);
        p[stride] = left;
        q[stride] = right;
        p[2 * stride] = q[0] = 0.5 * (left + right);
    }
}

// Whether a box is positive everywhere; false as well where that is not found out.
inline bool is_positive(const HexBox& whole) {
    std::array<HexBox, BEZIER_DEPTH + 1> waiting;  // at most one of each depth, and the last
    std::array<int, BEZIER_DEPTH + 1> depth;
    waiting[0] = whole;
    depth[0] = 0;
    int count = 1;
    for (int seen = 0; count > 0; ++seen) {
        HexBox& box = waiting[count - 1];
        for (int i = 0; i < 8; ++i)
            if (!(box[HEX_ORDER[i]] > 0.0)) return false;
        if (std::all_of(box.begin(), box.end(), [](double b) { return b > 0.0; })) {
            --count;
            continue;
        }
        if (depth[count - 1] == BEZIER_DEPTH || seen == BEZIER_PARTS) return false;
        halve(box, waiting[count]);
        depth[count] = ++depth[count - 1];
        ++count;
    }
    return true;
}

// Whether an element whose corners are positive is valid everywhere, and that is proved.
inline bool is_certified(std::uint8_t code, const Vec<3>* nodes, double unit = 0.0) {
    if (is_valid_at_once(code, nodes, unit)) return true;
    if (code == WEDGE) return is_positive(WedgeParts(nodes), unit);
    return code != HEXAHEDRON || is_positive(surely(hex_edges(nodes), unit));
}

enum class Verdict : std::uint8_t { valid, inside, corner };  // where it is not valid; at a corner goes before inside

// The one judge of elements. `unit` is that of `is_barely_valid`. Never valid for NaN.
template <std::size_t D>
Verdict judge(std::uint8_t code, const std::array<double, D>* nodes, double unit = 0.0) {
    if constexpr (D == 3)
        if (is_valid_at_once(code, nodes, unit)) return Verdict::valid;
    const ElementShape& shape = SHAPES[code];
    for (int c = 0; c < shape.simplices; ++c) {
        const Edges<D> e = corner_edges(nodes, shape.simplex[c]);
        const auto corners = [&] { return corner_points(nodes, shape.simplex[c]); };
        if (!is_valid<D>(e, determinant(e), corners, unit)) return Verdict::corner;
    }
    if constexpr (D == 3)
        if (!is_certified(code, nodes, unit)) return Verdict::inside;
    return Verdict::valid;
}

// The signed area or volume: the mean of the coefficients, times the integral of what they are multiplied by.
template <std::size_t D>
double measure(std::uint8_t code, const std::array<double, D>* nodes) {
    static constexpr std::array<double, 6> INTEGRAL{1.0 / 2, 1.0, 1.0 / 6, 1.0 / 3, 1.0 / 2, 1.0};
    std::array<double, MOST_COEFFICIENTS> b;
    const int count = coefficients(code, nodes, b.data());
    double sum = 0.0;
    for (int i = 0; i < count; ++i) sum += b[i];
    return sum / count * INTEGRAL[code];
}

// The smallest scaled Jacobian at the corners of anything but a simplex, 1 for an ideal element; 0 where an edge has no
// length.
template <std::size_t D>
double scaled_jacobian(std::uint8_t code, const std::array<double, D>* nodes) {
    const ElementShape& shape = SHAPES[code];
    double smallest = INFINITY;
    for (int c = 0; c < shape.simplices; ++c) {
        const Edges<D> e = corner_edges(nodes, shape.simplex[c]);
        double product2 = 1.0;
        for (const auto& edge : e) product2 *= norm2(edge);
        smallest = std::min(smallest, product2 > 0.0 ? determinant(e) / std::sqrt(product2) : 0.0);
    }
    return shape.weight * smallest;
}

// Calls f(value, gradient) for what depends on one node of the corner determinants: the value with that node at 0.
template <std::size_t D, class F>
void for_each_dependent_corner(std::uint8_t code, const std::array<double, D>* nodes, int node, const F& f) {
    const ElementShape& shape = SHAPES[code];
    for (int c = 0; c < shape.simplices; ++c)
        for (int k = 0; k <= static_cast<int>(D); ++k) {
            if (shape.simplex[c][k] != node) continue;
            Edges<D> e;
            for (std::size_t i = 0; i < D; ++i) e[i] = nodes[shape.simplex[c][opposite_face<D>(k)[i]]];
            f(determinant(e), determinant_slope(e));
        }
}

// The same of the three coefficients of a wedge between its triangles. A rotation makes the node its first.
template <class F>
void for_each_middle_of_wedge(const Vec<3>* nodes, int node, const F& f) {
    static constexpr std::int8_t TURNED[6][6]{{0, 1, 2, 3, 4, 5}, {1, 2, 0, 4, 5, 3}, {2, 0, 1, 5, 3, 4},
                                              {3, 5, 4, 0, 2, 1}, {4, 3, 5, 1, 0, 2}, {5, 4, 3, 2, 1, 0}};
    std::array<Vec<3>, 6> p{};
    for (int i = 1; i < 6; ++i) p[i] = nodes[TURNED[node][i]];
    const WedgeParts w(p.data());
    for (int i = 0; i < 3; ++i) {
        Vec<3> gradient = 0.5 * cross(w.a1 - w.c1, w.q[i]);
        if (i == 0) gradient = gradient - w.n[1];
        f(dot(w.n[1], w.q[i]), gradient);
    }
}

// The same of the 20 coefficients of a hexahedron. A rotation makes the node its first. With that at 0, a gradient is
// minus the mean of the crosses of two edges where the third of the determinant leaves the node.
template <class F>
void for_each_dependent_of_hex(const Vec<3>* nodes, int node, const F& f) {
    const int place = HEX_NODE[node];  // an involution
    const bool odd = (place ^ place >> 1 ^ place >> 2) & 1;
    std::array<Vec<3>, 8> p{};
    for (int c = 1; c < 8; ++c) {
        const int turned = odd ? (c & 4) | (c & 1) << 1 | (c & 2) >> 1 : c;
        p[HEX_NODE[c]] = nodes[HEX_NODE[turned ^ place]];
    }
    const HexParts<Vec<3>> e = hex_edges(p.data());
    const HexBox b = hex_box(e);
    std::array<Vec<3>, 27> g{};
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < 4; ++j) {
            const auto add = [&](int I, int J, int K, const Vec<3>& normal) {
                g[I + 3 * J + 9 * K] = g[I + 3 * J + 9 * K] - normal;
            };
            add(i % 2 + j % 2, j / 2, i / 2, cross(e.y[i], e.z[j]));
            add(i % 2, i / 2 + j % 2, j / 2, cross(e.z[i], e.x[j]));
            add(j % 2, i % 2, i / 2 + j / 2, cross(e.x[i], e.y[j]));
        }
    for (int c = 0; c < 27; ++c) {
        const int I = c % 3, J = c / 3 % 3, K = c / 9;
        if ((I == 2) + (J == 2) + (K == 2) < 2) f(b[c], SHARE[I] * SHARE[J] * SHARE[K] * g[c]);
    }
}

// Calls f(value, gradient) for each coefficient that depends on the position x of a node: it is value + gradient . x.
template <std::size_t D, class F>
void for_each_dependent_coefficient(std::uint8_t code, const std::array<double, D>* nodes, int node, const F& f) {
    if constexpr (D == 3)
        if (code == HEXAHEDRON) return for_each_dependent_of_hex(nodes, node, f);
    for_each_dependent_corner(code, nodes, node, f);
    if constexpr (D == 3)
        if (code == WEDGE) for_each_middle_of_wedge(nodes, node, f);
}

}  // namespace meshfix
