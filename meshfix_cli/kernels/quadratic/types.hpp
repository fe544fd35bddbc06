// Curved elements as products of simplices: their control points, the differences of these, and where products
// of differences go among the Bezier coefficients of the Jacobian determinant.
//
// A type is a product of simplices (factors): a hexahedron of three lines, a wedge of a triangle and a line. The position is a
// polynomial of degree p in each factor, its derivative along a factor of degree p - 1 in that, so det J is one of degree D p - n
// in a factor of dimension n where D is that of the element. Basis functions are scaled, so that products only add up: a
// coefficient times the multinomial of its index is that of a monomial in barycentric coordinates.
//
// Source: A. Johnen, J.-F. Remacle, C. Geuzaine, "Geometrical validity of curvilinear finite elements", Journal of
// Computational Physics 233 (2013).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <numeric>
#include <vector>

#include "common/tolerances.hpp"
#include "quadratic/inverse.hpp"
#include "quadratic/shapes.hpp"

namespace meshfix {

// A weighted sum of things by their numbers.
struct Share {
    int of;
    double weight;
};
using Sum = std::vector<Share>;

// Everything about one type that does not depend on positions.
class QuadraticType {
   public:
    using Index = std::vector<int>;  // exponents of the barycentric coordinates of all factors, one factor behind the other

    int dimension, order, nodes, corners = 1, controls, coefficients, normals = 0;
    double weight;                               // of scaled Jacobians
    double integral = 1.0;                       // of a polynomial whose coefficients are 1
    double doubt = VALID;                        // what rounding leaves in doubt of coefficients
    std::vector<int> factors;                    // their dimensions
    std::vector<Sum> control_of_nodes;          // each control point as a sum of nodes
    std::array<std::vector<Sum>, 3> difference;  // along each direction: sums of control points, scaled
    std::array<std::vector<double>, 3> share2;   // for each what its squared length counts: of more than second order that unscaled
    std::vector<Sum> between;                    // where each node is in the straight element
    std::vector<std::vector<std::vector<int>>> edges_at;  // for each corner its edges: the nodes from the nearest to the other end
    std::vector<int> normal_of;                  // of differences along the second and third direction, 3-D
    std::vector<int> coefficient_of;             // of a difference along the first direction and a normal, or a second difference
    std::vector<double> unscaled;                // what a scaled coefficient is multiplied by
    std::vector<int> corner_coefficient;         // the coefficient that is det J at each corner
    std::vector<NodeSet> depends;                // for each coefficient the nodes that it depends on
    std::vector<std::array<Sum, 3>> at_node;     // for each node the derivative along each direction: sums of differences
    std::vector<NodeSet> node_depends;           // and the nodes that these depend on
    std::vector<std::array<std::vector<Sum>, 2>> halves;   // the control points of both halves, for each way to halve
    std::vector<std::array<int, 2>> cut;                   // the barycentric coordinates of both ends of the edge that is halved so

    explicit QuadraticType(const QuadraticShape& shape)
        : dimension(shape.dimension), order(shape.order), nodes(static_cast<int>(std::max(shape.between.size(), shape.places.size()))),
          weight(shape.weight), factors(shape.factors) {
        for (const int n : factors) {
            corners *= n + 1;
            integral /= factorial(n);
        }
        find_corners();
        find_places(shape);
        find_edges();
        find_controls(shape);
        find_differences();
        find_products();
        find_dependence();
        find_at_nodes();
        find_halves();
    }

    // A place in an element: det J there as a sum of coefficients, and the nodes that it depends on.
    struct Place {
        Sum value;
        NodeSet depends{};
    };

    // The places of a lattice with so many steps along each edge.
    std::vector<Place> lattice(int steps) const {
        std::vector<Place> found;
        for (const Index& step : indices(std::vector<int>(factors.size(), steps))) {
            const Point at = shares(step, steps);
            Place place;
            for (const auto& [index, i] : coefficient_)
                if (const double weight = monomial(index, at); weight != 0.0) place.value.push_back({i, multinomial(index) * weight});
            for (int direction = 0; direction < dimension; ++direction)
                place.depends = place.depends | nodes_of(derivative(direction, at), direction);
            found.push_back(place);
        }
        return found;
    }

    // The same of one that has nodes, and places between them, where proofs are looked for.
    const std::vector<Place>& places() const {
        std::call_once(placed_, [this] { places_ = lattice(2 * order); });
        return places_;
    }

   private:
    using Point = std::vector<double>;  // barycentric coordinates in all factors, one factor behind the other

    std::map<Index, int> control_, coefficient_;
    std::vector<Point> place_;  // of each node
    mutable std::once_flag placed_;
    mutable std::vector<Place> places_;
    std::array<std::vector<Index>, 3> difference_index_;
    std::vector<Index> corner_index_;

    static double factorial(int k) { return k < 2 ? 1.0 : k * factorial(k - 1); }

    // The multinomials of an index, one for each factor.
    double multinomial(const Index& index) const {
        double product = 1.0;
        std::size_t at = 0;
        for (const int n : factors) {
            int degree = 0;
            for (int i = 0; i <= n; ++i) {
                degree += index[at + i];
                product /= factorial(index[at + i]);
            }
            product *= factorial(degree);
            at += n + 1;
        }
        return product;
    }

    // All indices of given degrees in the factors.
    std::vector<Index> indices(const std::vector<int>& degrees) const {
        std::vector<Index> found{{}};
        for (std::size_t f = 0; f < factors.size(); ++f) {
            std::vector<Index> more;
            for (const Index& index : found) {
                const auto extend = [&](const auto& self, const Index& so_far, int places, int left) -> void {
                    for (int e = places == 1 ? left : 0; e <= left; ++e) {
                        Index next = so_far;
                        next.push_back(e);
                        if (places == 1)
                            more.push_back(next);
                        else
                            self(self, next, places - 1, left - e);
                    }
                };
                extend(extend, index, factors[f] + 1, degrees[f]);
            }
            found = std::move(more);
        }
        return found;
    }

    static Index sum(Index a, const Index& b) {
        for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
        return a;
    }
    static Index plus(Index a, int at, int more = 1) {
        a[at] += more;
        return a;
    }

    // The index of degree 1 in each factor of each corner, in VTK's order: a quadrilateral's go around.
    void find_corners() {
        const auto unit = [](int size, int at) {
            Index index(size, 0);
            index[at] = 1;
            return index;
        };
        const auto joined = [](Index a, const Index& b) {
            a.insert(a.end(), b.begin(), b.end());
            return a;
        };
        std::vector<Index> found;
        if (factors.size() == 1 || factors[0] == 2) {
            for (int i = 0; i <= factors[0]; ++i) found.push_back(unit(factors[0] + 1, i));
        } else {
            for (const auto& [x, y] : {std::array<int, 2>{0, 0}, {1, 0}, {1, 1}, {0, 1}})
                found.push_back(joined(unit(2, x), unit(2, y)));
        }
        if (static_cast<int>(found.size()) == corners) {
            corner_index_ = found;
            return;
        }
        for (int z = 0; z < 2; ++z)
            for (const Index& base : found) corner_index_.push_back(joined(base, unit(2, z)));
    }

    Index index_of(const std::vector<int>& mean_of) const {
        Index index(corner_index_[0].size(), 0);
        for (const int corner : mean_of) index = sum(index, corner_index_[corner]);
        for (int& e : index) e = 2 * e / static_cast<int>(mean_of.size());
        return index;
    }

    static Point shares(const Index& step, int steps) {
        Point at;
        for (const int one : step) at.push_back(static_cast<double>(one) / steps);
        return at;
    }

    // Where the nodes are, in barycentric coordinates and as means of corners.
    void find_places(const QuadraticShape& shape) {
        place_ = shape.places;
        for (const auto& mean_of : shape.between) {
            place_.push_back(shares(index_of(mean_of), 2));
            between.emplace_back();
            for (const int corner : mean_of) between.back().push_back({corner, 1.0 / static_cast<double>(mean_of.size())});
        }
        for (const Point& at : shape.places) {
            between.emplace_back();
            for (int c = 0; c < corners; ++c)
                if (const double share = monomial(corner_index_[c], at); share != 0.0) between.back().push_back({c, share});
        }
    }

    void find_edges() {
        const auto share_of = [&](int node, int corner) {
            for (const Share& one : between[node])
                if (one.of == corner) return one.weight;
            return 0.0;
        };
        edges_at.resize(corners);
        for (int c = 0; c < corners; ++c) {
            std::vector<int> ends;
            for (int k = corners; k < nodes; ++k) {
                if (between[k].size() != 2 || share_of(k, c) == 0.0) continue;
                const int end = between[k][between[k][0].of == c].of;
                const auto known = std::find(ends.begin(), ends.end(), end) - ends.begin();
                if (known == static_cast<std::ptrdiff_t>(ends.size())) {
                    ends.push_back(end);
                    edges_at[c].push_back({end});
                }
                edges_at[c][known].push_back(k);
            }
            for (auto& edge : edges_at[c])
                std::sort(edge.begin(), edge.end(), [&](int a, int b) { return share_of(a, c) > share_of(b, c); });
        }
    }

    void find_controls(const QuadraticShape& shape) {
        for (const Index& index : indices(std::vector<int>(factors.size(), order))) control_.emplace(index, static_cast<int>(control_.size()));
        controls = static_cast<int>(control_.size());
        control_of_nodes.resize(controls);
        if (order > 2) {
            interpolate();
            return;
        }
        std::map<Index, int> node_at;
        for (int i = 0; i < nodes; ++i) node_at[index_of(shape.between[i])] = i;
        // The position at each index: a node, or what those that there are make of it (serendipity).
        std::map<Index, Sum> position;
        for (const auto& [index, number] : control_) {
            const auto here = node_at.find(index);
            position[index] = here != node_at.end() ? Sum{{here->second, 1.0}} : in_the_middle(index, node_at);
        }
        for (const auto& [index, number] : control_) control_of_nodes[number] = control_from(index, position);
    }

    // The control points of the polynomial that is at each node where that is: the inverse of the values of the basis there.
    void interpolate() {
        std::vector<double> values(static_cast<std::size_t>(nodes) * nodes);
        for (int i = 0; i < nodes; ++i)
            for (const auto& [index, number] : control_) values[static_cast<std::size_t>(i) * nodes + number] = multinomial(index) * monomial(index, place_[i]);
        const std::vector<double> inverse = inverse_of(values, nodes);
        double largest = 1.0;
        for (int c = 0; c < nodes; ++c) {
            double row = 0.0;
            for (int i = 0; i < nodes; ++i) {
                const double weight = inverse[static_cast<std::size_t>(c) * nodes + i];
                if (std::fabs(weight) > ROUNDED) control_of_nodes[c].push_back({i, weight});
                row += std::fabs(weight);
            }
            largest = std::max(largest, row);
        }
        doubt = VALID * largest;  // as much as control points are farther off than nodes
    }

    // The middle of a face or of the whole whose nodes are those of its edges: the sum of their edges less that of the corners.
    Sum in_the_middle(const Index& index, const std::map<Index, int>& node_at) const {
        std::vector<int> around;  // the corners in whose middle it is
        for (int c = 0; c < corners; ++c) {
            bool inside = true;
            for (std::size_t i = 0; i < index.size(); ++i) inside &= corner_index_[c][i] <= index[i];
            if (inside) around.push_back(c);
        }
        Sum found;
        const double of_corners = -0.25, of_edges = around.size() == 4 ? 0.5 : 0.25;
        for (const int c : around) found.push_back({c, of_corners});
        for (const auto& [where, node] : node_at) {
            if (between[node].size() != 2) continue;
            const auto is_around = [&](int c) { return std::find(around.begin(), around.end(), c) != around.end(); };
            if (is_around(between[node][0].of) && is_around(between[node][1].of)) found.push_back({node, of_edges});
        }
        return found;
    }

    // In each factor c_ii = v_i and c_ij = 2 m_ij - (v_i + v_j) / 2.
    Sum control_from(const Index& index, const std::map<Index, Sum>& position) const {
        std::vector<std::pair<Index, double>> terms{{index, 1.0}};
        std::size_t at = 0;
        for (const int n : factors) {
            std::vector<std::pair<Index, double>> more;
            for (const auto& [where, share] : terms) {
                std::vector<int> ends;
                for (int i = 0; i <= n; ++i)
                    if (where[at + i] == 1) ends.push_back(static_cast<int>(at) + i);
                if (ends.empty()) {
                    more.emplace_back(where, share);
                    continue;
                }
                more.emplace_back(where, 2.0 * share);
                more.emplace_back(plus(plus(where, ends[0]), ends[1], -1), -0.5 * share);
                more.emplace_back(plus(plus(where, ends[1]), ends[0], -1), -0.5 * share);
            }
            terms = std::move(more);
            at += n + 1;
        }
        std::map<int, double> sums;
        for (const auto& [where, share] : terms)
            for (const Share& one : position.at(where)) sums[one.of] += share * one.weight;
        return compact(sums);
    }

    static Sum compact(const std::map<int, double>& sums) {
        Sum found;
        for (const auto& [of, weight] : sums)
            if (weight != 0.0) found.push_back({of, weight});
        return found;
    }

    // The derivative of degree p is p times the difference of two control points, scaled by its multinomial.
    void find_differences() {
        std::size_t at = 0;
        int direction = 0;
        for (std::size_t f = 0; f < factors.size(); ++f) {
            std::vector<int> degrees(factors.size(), order);
            degrees[f] = order - 1;
            for (int j = 1; j <= factors[f]; ++j, ++direction) {
                for (const Index& index : indices(degrees)) {
                    const double scale = order * multinomial(index);
                    share2[direction].push_back(order > 2 ? 1.0 / (multinomial(index) * multinomial(index)) : 1.0);
                    const int first = static_cast<int>(at);
                    difference[direction].push_back({{control_.at(plus(index, first + j)), scale}, {control_.at(plus(index, first)), -scale}});
                    difference_index_[direction].push_back(index);
                }
            }
            at += factors[f] + 1;
        }
    }

    void find_products() {
        std::map<Index, int> normal;
        const auto number = [](std::map<Index, int>& known, const Index& index) {
            return known.emplace(index, static_cast<int>(known.size())).first->second;
        };
        const auto& [first, second, third] = difference_index_;
        std::vector<Index> rest;  // what is multiplied with the first differences
        if (dimension == 3) {
            for (const Index& q : second)
                for (const Index& r : third) {
                    normal_of.push_back(number(normal, sum(q, r)));
                    if (normal_of.back() == static_cast<int>(rest.size())) rest.push_back(sum(q, r));
                }
            normals = static_cast<int>(rest.size());
        } else {
            rest = second;
        }
        for (const Index& p : first)
            for (const Index& k : rest) coefficient_of.push_back(number(coefficient_, sum(p, k)));
        coefficients = static_cast<int>(coefficient_.size());
        unscaled.resize(coefficients);
        for (const auto& [index, at] : coefficient_) unscaled[at] = 1.0 / multinomial(index);
        for (int c = 0; c < corners; ++c)  // all of the degree in one corner of each factor
            for (const auto& [index, at] : coefficient_) {
                bool there = true;
                for (std::size_t i = 0; i < index.size(); ++i) there &= (index[i] > 0) == (corner_index_[c][i] > 0);
                if (there) corner_coefficient.push_back(at);
            }
    }

    NodeSet nodes_of(const Sum& controls_sum) const {
        NodeSet found;
        for (const Share& control : controls_sum)
            for (const Share& node : control_of_nodes[control.of]) found.add(node.of);
        return found;
    }

    void find_dependence() {
        depends.resize(coefficients);
        std::array<std::vector<NodeSet>, 3> on;
        for (int direction = 0; direction < dimension; ++direction)
            for (const Sum& one : difference[direction]) on[direction].push_back(nodes_of(one));
        std::vector<NodeSet> rest = on[1];
        if (dimension == 3) {
            rest.assign(normals, {});
            const int* at = normal_of.data();
            for (const NodeSet& q : on[1])
                for (const NodeSet& r : on[2]) {
                    rest[*at] = rest[*at] | q | r;
                    ++at;
                }
        }
        const int* to = coefficient_of.data();
        for (const NodeSet& p : on[0])
            for (const NodeSet& k : rest) {
                depends[*to] = depends[*to] | p | k;
                ++to;
            }
    }

    static double monomial(const Index& exponent, const Point& at) {
        double value = 1.0;
        for (std::size_t k = 0; k < at.size(); ++k)
            for (int e = 0; e < exponent[k]; ++e) value *= at[k];
        return value;
    }

    // A derivative of the position as a sum of differences.
    Sum derivative(int direction, const Point& at) const {
        Sum found;
        for (std::size_t p = 0; p < difference[direction].size(); ++p)
            if (const double value = monomial(difference_index_[direction][p], at); value != 0.0)
                found.push_back({static_cast<int>(p), value});
        return found;
    }

    // The nodes that a sum of differences depends on: those of control points may cancel each other.
    NodeSet nodes_of(const Sum& differences, int direction) const {
        std::map<int, double> weights;
        for (const Share& p : differences)
            for (const Share& control : difference[direction][p.of])
                for (const Share& node : control_of_nodes[control.of]) weights[node.of] += p.weight * control.weight * node.weight;
        NodeSet found;
        for (const auto& [node, weight] : weights)
            if (std::fabs(weight) > ROUNDED) found.add(node);
        return found;
    }

    void find_at_nodes() {
        at_node.resize(nodes);
        node_depends.resize(nodes);
        for (int i = 0; i < nodes; ++i)
            for (int direction = 0; direction < dimension; ++direction) {
                at_node[i][direction] = derivative(direction, place_[i]);
                node_depends[i] = node_depends[i] | nodes_of(at_node[i][direction], direction);
            }
    }

    // The half beside the first end of an edge: there the other end is the middle. Blossoms.
    void find_halves() {
        std::size_t at = 0;
        for (const int n : factors) {
            for (int a = 0; a <= n; ++a)
                for (int b = a + 1; b <= n; ++b) {
                    const int one = static_cast<int>(at) + a, other = static_cast<int>(at) + b;
                    halves.push_back({half(one, other), half(other, one)});
                    cut.push_back({one, other});
                }
            at += n + 1;
        }
    }

    std::vector<Sum> half(int kept, int moved) const {
        std::vector<Sum> found(controls);
        for (const auto& [index, number] : control_) {
            const int all = index[moved];
            for (int left = all; left >= 0; --left)
                found[number].push_back({control_.at(plus(plus(index, moved, left - all), kept, all - left)),
                                         std::ldexp(factorial(all) / (factorial(left) * factorial(all - left)), -all)});
        }
        return found;
    }

    static constexpr double ROUNDED = 1e-9;  // weights below it are zero but for rounding
};

// Those of second order.
inline const QuadraticType& quadratic_type(std::size_t code) {
    static const std::deque<QuadraticType> types(quadratic_shapes().begin(), quadratic_shapes().end());
    return types[code];
}

}  // namespace meshfix
