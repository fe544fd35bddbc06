// Bezier coefficients of the Jacobian determinant of curved elements: their values, the slope of a function of them,
// and their gradients by one node; whether an element is valid.
//
// det J is D1 . (D2 x D3): the products of the last two are added up first, which takes a tenth of the time of all triples.
#pragma once

#include <cmath>

#include "common/tolerances.hpp"
#include "common/vec.hpp"
#include "quadratic/types.hpp"
#include "measures/bezier.hpp"

namespace meshfix {

// The scalar T is double, or Pack: elements of one type side by side.
template <int D, class R, class T = double>
using QuadraticNodes = std::array<Vec<D, T>, R::NODES>;
template <int D, class R, class T = double>
using QuadraticDifferences = std::array<std::array<Vec<D, T>, R::DIFFERENCES>, 3>;

// Sets as many of the values to zero as are needed.
template <class T, std::size_t N>
void clear(std::array<T, N>& values, int count) {
    std::fill_n(values.begin(), count, T{});
}

template <int D, class R, class T = double>
struct QuadraticParts {
    const QuadraticType* type;
    QuadraticNodes<D, R, T> control;
    QuadraticDifferences<D, R, T> difference;
    std::array<Vec<D, T>, R::NORMALS> normal;  // 3-D
    std::array<T, R::COEFFICIENTS> coefficient;

    QuadraticParts(const QuadraticType& of, const QuadraticNodes<D, R, T>& nodes) : type(&of) {
        for (int c = 0; c < of.controls; ++c) control[c] = weighted(of.control_of_nodes[c], nodes);
        find();
    }

    // Those of a part of an element, by its control points.
    static QuadraticParts of_controls(const QuadraticType& of, const QuadraticNodes<D, R>& points) { return {of, points, 0}; }

    // The smallest coefficient; NaN where one is.
    double smallest() const {
        double least = INFINITY, sum = 0.0;
        for (int i = 0; i < type->coefficients; ++i) {
            least = std::min(least, coefficient[i]);
            sum += coefficient[i];
        }
        return sum == sum ? least : NAN;
    }

    // What rounding leaves in doubt of the coefficients.
    double doubt() const {
        double product = type->doubt;
        for (int j = 0; j < D; ++j) {
            double longest = 0.0;
            for (std::size_t p = 0; p < type->difference[j].size(); ++p) longest = std::max(longest, type->share2[j][p] * norm2(difference[j][p]));
            product *= std::sqrt(longest);
        }
        return product;
    }

    // The derivatives along all directions at a node.
    Edges<D, T> at_node(int node) const {
        Edges<D, T> e;
        for (int j = 0; j < D; ++j) e[j] = weighted(type->at_node[node][j], difference[j]);
        return e;
    }

    // The derivative by the nodes of a function whose derivatives by the coefficients are given.
    QuadraticNodes<D, R, T> slopes(const std::array<T, R::COEFFICIENTS>& by_coefficient) const {
        QuadraticDifferences<D, R, T> by_difference;
        for (int j = 0; j < D; ++j) clear(by_difference[j], size(j));
        std::array<T, R::COEFFICIENTS> g;
        for (int i = 0; i < type->coefficients; ++i) g[i] = type->unscaled[i] * by_coefficient[i];
        pull_back(g.data(), by_difference);
        QuadraticNodes<D, R, T> found;
        clear(found, type->nodes);
        add_to_nodes(by_difference, found);
        return found;
    }

    // Adds to the slopes of nodes what the slopes by differences make of them.
    void add_to_nodes(const QuadraticDifferences<D, R, T>& by_difference, QuadraticNodes<D, R, T>& found) const {
        QuadraticNodes<D, R, T> by_control;
        clear(by_control, type->controls);
        for (int j = 0; j < D; ++j)
            for (std::size_t p = 0; p < type->difference[j].size(); ++p)
                for (const Share& one : type->difference[j][p])
                    by_control[one.of] = by_control[one.of] + one.weight * by_difference[j][p];
        for (int c = 0; c < type->controls; ++c)
            for (const Share& one : type->control_of_nodes[c]) found[one.of] = found[one.of] + one.weight * by_control[c];
    }

    // The gradients of all coefficients by the displacement x of some nodes, each of which moves by `share` x.
    std::array<Vec<D>, R::COEFFICIENTS> gradients(const std::array<double, R::NODES>& share) const {
        std::array<double, R::NODES> of_control;
        for (int c = 0; c < type->controls; ++c) of_control[c] = weighted(type->control_of_nodes[c], share);
        return gradients_of_controls(of_control);
    }

    // The same where each control point moves by its share.
    std::array<Vec<D>, R::COEFFICIENTS> gradients_of_controls(const std::array<double, R::NODES>& of_control) const {
        std::array<std::array<double, R::DIFFERENCES>, 3> moves;
        for (int j = 0; j < D; ++j) clear(moves[j], size(j));
        for (int j = 0; j < D; ++j)
            for (std::size_t p = 0; p < type->difference[j].size(); ++p)
                for (const Share& one : type->difference[j][p]) moves[j][p] += one.weight * of_control[one.of];
        std::array<Vec<D>, R::COEFFICIENTS> found;
        clear(found, type->coefficients);
        const int *to = type->coefficient_of.data(), count0 = size(0), count1 = size(1);
        if constexpr (D == 2) {
            for (int p = 0; p < count0; ++p)
                for (int q = 0; q < count1; ++q) {  // cross(x, b) = (b1, -b0) . x
                    const Vec<2> b = moves[0][p] * difference[1][q] - moves[1][q] * difference[0][p];
                    const int i = *to++;
                    found[i] = found[i] + Vec<2>{b[1], -b[0]};
                }
        } else {
            std::array<Vec<3>, R::NORMALS> turned;
            clear(turned, type->normals);
            const int* at = type->normal_of.data();
            for (int q = 0; q < count1; ++q)
                for (int r = 0; r < size(2); ++r, ++at)
                    turned[*at] = turned[*at] + moves[1][q] * difference[2][r] - moves[2][r] * difference[1][q];
            for (int p = 0; p < count0; ++p)
                for (int k = 0; k < type->normals; ++k) {
                    const int i = *to++;
                    found[i] = found[i] + moves[0][p] * normal[k] + cross(turned[k], difference[0][p]);
                }
        }
        for (int i = 0; i < type->coefficients; ++i) found[i] = type->unscaled[i] * found[i];
        return found;
    }

    template <class V, std::size_t N>
    static V weighted(const Sum& sum, const std::array<V, N>& values) {
        V total{};
        for (const Share& one : sum) total = total + one.weight * values[one.of];
        return total;
    }

   private:
    QuadraticParts(const QuadraticType& of, const QuadraticNodes<D, R, T>& points, int) : type(&of) {
        std::copy_n(points.begin(), of.controls, control.begin());
        find();
    }

    int size(int direction) const { return static_cast<int>(type->difference[direction].size()); }

    void find() {
        for (int j = 0; j < D; ++j)
            for (int p = 0; p < size(j); ++p) {
                const Sum& d = type->difference[j][p];
                difference[j][p] = d[0].weight * (control[d[0].of] - control[d[1].of]);
            }
        clear(coefficient, type->coefficients);
        const int* to = type->coefficient_of.data();
        if constexpr (D == 2) {
            for (int p = 0; p < size(0); ++p)
                for (int q = 0; q < size(1); ++q) coefficient[*to++] += cross(difference[0][p], difference[1][q]);
        } else {
            clear(normal, type->normals);
            const int* at = type->normal_of.data();
            for (int q = 0; q < size(1); ++q)
                for (int r = 0; r < size(2); ++r, ++at) normal[*at] = normal[*at] + cross(difference[1][q], difference[2][r]);
            for (int p = 0; p < size(0); ++p)
                for (int k = 0; k < type->normals; ++k) coefficient[*to++] += dot(difference[0][p], normal[k]);
        }
        for (int i = 0; i < type->coefficients; ++i) coefficient[i] = type->unscaled[i] * coefficient[i];
    }

    void pull_back(const T* g, QuadraticDifferences<D, R, T>& by_difference) const {
        const int* to = type->coefficient_of.data();
        if constexpr (D == 2) {
            for (int p = 0; p < size(0); ++p)
                for (int q = 0; q < size(1); ++q) {
                    const T here = g[*to++];
                    const Vec<2, T>&a = difference[0][p], &b = difference[1][q];
                    by_difference[0][p] = by_difference[0][p] + here * Vec<2, T>{b[1], -b[0]};
                    by_difference[1][q] = by_difference[1][q] + here * Vec<2, T>{-a[1], a[0]};
                }
        } else {
            std::array<Vec<3, T>, R::NORMALS> by_normal;
            clear(by_normal, type->normals);
            for (int p = 0; p < size(0); ++p)
                for (int k = 0; k < type->normals; ++k) {
                    const T here = g[*to++];
                    by_difference[0][p] = by_difference[0][p] + here * normal[k];
                    by_normal[k] = by_normal[k] + here * difference[0][p];
                }
            const int* at = type->normal_of.data();
            for (int q = 0; q < size(1); ++q)
                for (int r = 0; r < size(2); ++r, ++at) {
                    by_difference[1][q] = by_difference[1][q] + cross(difference[2][r], by_normal[*at]);
                    by_difference[2][r] = by_difference[2][r] + cross(by_normal[*at], difference[1][q]);
                }
        }
    }
};

// A part of an element: its control points, and how long its edges are in the parameters, where those of the whole have the
// length 1.
template <int D, class R>
struct QuadraticPart {
    QuadraticNodes<D, R> control;
    std::array<double, 6> length2;  // for each way to halve

    // The way that halves the longest edge.
    std::size_t longest(const QuadraticType& type) const {
        return static_cast<std::size_t>(std::max_element(length2.begin(), length2.begin() + type.cut.size()) - length2.begin());
    }

    // The half by edge `k` in which the end `kept` stays and the other one is the middle.
    QuadraticPart half(const QuadraticType& type, std::size_t k, int kept) const {
        const auto& cut = type.cut;
        const std::vector<Sum>& of = type.halves[k][kept];
        QuadraticPart found;
        for (int c = 0; c < type.controls; ++c) found.control[c] = QuadraticParts<D, R>::weighted(of[c], control);
        found.length2 = length2;
        const int stays = cut[k][kept], moves = cut[k][1 - kept];
        for (std::size_t i = 0; i < cut.size(); ++i) {
            if (i == k || (cut[i][0] != moves && cut[i][1] != moves)) continue;
            const int third = cut[i][0] == moves ? cut[i][1] : cut[i][0];
            for (std::size_t j = 0; j < cut.size(); ++j)  // a median of the triangle of the three
                if ((cut[j][0] == stays && cut[j][1] == third) || (cut[j][0] == third && cut[j][1] == stays))
                    found.length2[i] = 0.5 * (length2[i] + length2[j]) - 0.25 * length2[k];
        }
        found.length2[k] = 0.25 * length2[k];
        return found;
    }
};

// Whether det J is positive everywhere, and that is proved: the coefficients of parts of the element, each a half of another,
// by the edge that is longest in the parameters.
template <int D, class R>
bool is_positive(const QuadraticParts<D, R>& whole) {
    const QuadraticType& type = *whole.type;
    std::vector<QuadraticPart<D, R>> waiting{{whole.control, {1.0, 1.0, 1.0, 1.0, 1.0, 1.0}}};
    for (int seen = 0; !waiting.empty(); ++seen) {
        const QuadraticPart<D, R> part = waiting.back();
        waiting.pop_back();
        const auto parts = QuadraticParts<D, R>::of_controls(type, part.control);
        if (parts.smallest() > parts.doubt()) continue;
        for (const int corner : type.corner_coefficient)
            if (!(parts.coefficient[corner] > 0.0)) return false;
        if (seen == QUADRATIC_PARTS) return false;
        const std::size_t longest = part.longest(type);
        for (int kept = 0; kept < 2; ++kept) waiting.push_back(part.half(type, longest, kept));
    }
    return true;
}

// Where an element is not valid; at a node goes before inside. Never valid for NaN.
template <int D, class R>
Verdict judge(const QuadraticParts<D, R>& parts) {
    const QuadraticType& type = *parts.type;
    const double bound = parts.doubt();
    if (parts.smallest() > bound) return Verdict::valid;
    for (int node = 0; node < type.nodes; ++node)
        if (!(determinant(parts.at_node(node)) > (node < type.corners ? bound : 0.0))) return Verdict::corner;
    return is_positive(parts) ? Verdict::valid : Verdict::inside;
}

// The straight element of the same corners.
template <int D, class R, class T>
QuadraticNodes<D, R, T> straightened(const QuadraticType& type, const QuadraticNodes<D, R, T>& nodes) {
    QuadraticNodes<D, R, T> straight;
    for (int i = 0; i < type.nodes; ++i) {
        straight[i] = Vec<D, T>{};
        for (const Share& one : type.between[i]) straight[i] = straight[i] + one.weight * nodes[one.of];
    }
    return straight;
}

// det J of the straight element in the mean, the size that coefficients are compared with; of a flat one, which may be well all
// the same where its nodes are not on its edges, a share of what its edges span.
template <int D, class R>
double straight_size(const QuadraticType& type, const QuadraticNodes<D, R>& nodes) {
    const QuadraticParts<D, R> parts(type, straightened<D, R>(type, nodes));
    double sum = 0.0, span = QUADRATIC_FLAT;
    for (int i = 0; i < type.coefficients; ++i) sum += parts.coefficient[i];
    for (int j = 0; j < D; ++j) {
        double length2 = 0.0;
        for (std::size_t p = 0; p < type.difference[j].size(); ++p) length2 += type.share2[j][p] * norm2(parts.difference[j][p]);
        span *= std::sqrt(length2 / static_cast<double>(type.difference[j].size()));
    }
    return std::max(sum / type.coefficients, span);
}

// What det J is divided by: the squared lengths of the derivatives along the edges of a corner, of that where these are longest.
// At a corner of a triangle or tetrahedron, as in all of a straight one, no corner is more than another.
template <int D>
double longest_edges2(const QuadraticType& type, const Edges<D>& derivatives) {
    double product2 = 1.0;
    int first = 0;
    for (const int n : type.factors) {
        const auto towards = [&](int corner) { return corner == 0 ? Vec<D>{} : derivatives[first + corner - 1]; };
        double most = 0.0;
        for (int from = 0; from <= n; ++from) {
            double lengths2 = 1.0;
            for (int to = 0; to <= n; ++to)
                if (to != from) lengths2 *= norm2(towards(to) - towards(from));
            most = std::max(most, lengths2);
        }
        product2 *= most;
        first += n;
    }
    return product2;
}

// The smallest scaled Jacobian at the nodes, but those where it depends on a free node; 0 where a derivative is none.
template <int D, class R>
double scaled_jacobian(const QuadraticParts<D, R>& parts, const NodeSet& free = {}) {
    double smallest = INFINITY;
    for (int node = 0; node < parts.type->nodes; ++node) {
        if ((parts.type->node_depends[node] & free).any()) continue;
        const Edges<D> e = parts.at_node(node);
        const double product2 = longest_edges2<D>(*parts.type, e);
        smallest = std::min(smallest, product2 > 0.0 ? determinant(e) / std::sqrt(product2) : 0.0);
    }
    return parts.type->weight * smallest;
}

}  // namespace meshfix
