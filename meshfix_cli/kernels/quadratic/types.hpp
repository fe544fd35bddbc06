// Elements of second order as products of simplices: their control points, the differences of these, and where products
// of differences go among the Bezier coefficients of the Jacobian determinant.
//
// A type is a product of simplices (factors): a hexahedron of three lines, a wedge of a triangle and a line. The position is a
// polynomial of degree 2 in each factor, its derivative along a factor of degree 1 in that, so det J is one of degree D n - 1
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
#include <map>
#include <vector>

namespace meshfix {

constexpr int MOST_QUADRATIC_NODES = 27, MOST_QUADRATIC_COEFFICIENTS = 216, MOST_DIFFERENCES = 18, MOST_NORMALS = 80;

// What the kernels are told of a type: the nodes as means of corners, in VTK's order, corners first.
struct QuadraticShape {
    int dimension;
    std::vector<int> factors;               // their dimensions
    std::vector<std::vector<int>> between;  // the corners whose mean each node is in the straight element
    double weight;                          // of scaled Jacobians
    double integral;                        // of a polynomial whose coefficients are 1
};

// The order of mesh/elements.py, SECOND_ORDER; a test compares the two.
inline const std::vector<QuadraticShape>& quadratic_shapes() {
    using Rows = std::vector<std::vector<int>>;
    static const auto joined = [](int corners, const Rows& more) {
        Rows rows;
        for (int i = 0; i < corners; ++i) rows.push_back({i});
        rows.insert(rows.end(), more.begin(), more.end());
        return rows;
    };
    static const Rows quad{{0, 1}, {1, 2}, {2, 3}, {3, 0}};
    static const Rows wedge{{0, 1}, {1, 2}, {2, 0}, {3, 4}, {4, 5}, {5, 3}, {0, 3}, {1, 4}, {2, 5}};
    static const Rows hexahedron{{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
    static const auto with = [](Rows rows, const Rows& more) {
        rows.insert(rows.end(), more.begin(), more.end());
        return rows;
    };
    static const double triangle = 1.1547005383792517, tetrahedron = 1.4142135623730951;
    static const std::vector<QuadraticShape> shapes{
        {2, {2}, joined(3, {{0, 1}, {1, 2}, {2, 0}}), triangle, 1.0 / 2},
        {2, {1, 1}, joined(4, quad), 1.0, 1.0},
        {2, {1, 1}, joined(4, with(quad, {{0, 1, 2, 3}})), 1.0, 1.0},
        {3, {3}, joined(4, {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}), tetrahedron, 1.0 / 6},
        {3, {2, 1}, joined(6, wedge), triangle, 1.0 / 2},
        {3, {2, 1}, joined(6, with(wedge, {{0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}})), triangle, 1.0 / 2},
        {3, {1, 1, 1}, joined(8, hexahedron), 1.0, 1.0},
        {3, {1, 1, 1},
         joined(8, with(hexahedron, {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7},
                                     {0, 1, 2, 3, 4, 5, 6, 7}})),
         1.0, 1.0},
    };
    return shapes;
}

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

    int dimension, nodes, corners = 0, controls, coefficients, normals = 0;
    double weight, integral;
    std::vector<int> factors;                    // their dimensions
    std::vector<Sum> control_of_nodes;          // each control point as a sum of nodes
    std::array<std::vector<Sum>, 3> difference;  // along each direction: sums of control points, scaled
    std::vector<std::vector<int>> between;
    std::vector<int> normal_of;                  // of differences along the second and third direction, 3-D
    std::vector<int> coefficient_of;             // of a difference along the first direction and a normal, or a second difference
    std::vector<double> unscaled;                // what a scaled coefficient is multiplied by
    std::vector<int> corner_coefficient;         // the coefficient that is det J at each corner
    std::vector<std::uint32_t> depends;          // for each coefficient the nodes that it depends on, as bits
    std::vector<std::array<Sum, 3>> at_node;     // for each node the derivative along each direction: sums of differences
    std::vector<std::array<std::vector<Sum>, 2>> halves;   // the control points of both halves, for each way to halve
    std::vector<std::array<int, 2>> cut;                   // the barycentric coordinates of both ends of the edge that is halved so

    explicit QuadraticType(const QuadraticShape& shape)
        : dimension(shape.dimension), nodes(static_cast<int>(shape.between.size())), weight(shape.weight),
          integral(shape.integral), factors(shape.factors), between(shape.between) {
        for (const auto& corner : between) corners += corner.size() == 1;
        find_controls();
        find_differences();
        find_products();
        find_dependence();
        find_at_nodes();
        find_halves();
    }

    // A place in an element: det J there as a sum of coefficients, and the nodes that it depends on, as bits.
    struct Place {
        Sum value;
        std::uint32_t depends = 0;
    };

    // The places of a lattice with so many steps along each edge.
    std::vector<Place> lattice(int steps) const {
        std::vector<Place> found;
        for (const Index& at : indices(std::vector<int>(factors.size(), steps))) {
            Place place;
            for (const auto& [index, i] : coefficient_)
                if (const double weight = monomial(index, at, steps); weight != 0.0) place.value.push_back({i, multinomial(index) * weight});
            for (int direction = 0; direction < dimension; ++direction) place.depends |= nodes_of(derivative(direction, at, steps), direction);
            found.push_back(place);
        }
        return found;
    }

   private:
    std::map<Index, int> control_, coefficient_;
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

    void find_controls() {
        find_corners();
        for (const Index& index : indices(std::vector<int>(factors.size(), 2))) control_.emplace(index, static_cast<int>(control_.size()));
        controls = static_cast<int>(control_.size());
        std::map<Index, int> node_at;
        for (int i = 0; i < nodes; ++i) node_at[index_of(between[i])] = i;
        // The position at each index: a node, or what those that there are make of it (serendipity).
        std::map<Index, Sum> position;
        for (const auto& [index, number] : control_) {
            const auto here = node_at.find(index);
            position[index] = here != node_at.end() ? Sum{{here->second, 1.0}} : in_the_middle(index, node_at);
        }
        control_of_nodes.resize(controls);
        for (const auto& [index, number] : control_) control_of_nodes[number] = control_from(index, position);
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
            if (is_around(between[node][0]) && is_around(between[node][1])) found.push_back({node, of_edges});
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

    // The derivative of degree 2 is twice the difference of two control points, scaled by its multinomial.
    void find_differences() {
        std::size_t at = 0;
        int direction = 0;
        for (std::size_t f = 0; f < factors.size(); ++f) {
            std::vector<int> degrees(factors.size(), 2);
            degrees[f] = 1;
            for (int j = 1; j <= factors[f]; ++j, ++direction) {
                for (const Index& index : indices(degrees)) {
                    const double scale = 2.0 * multinomial(index);
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

    std::uint32_t nodes_of(const Sum& controls_sum) const {
        std::uint32_t bits = 0;
        for (const Share& control : controls_sum)
            for (const Share& node : control_of_nodes[control.of]) bits |= 1u << node.of;
        return bits;
    }

    void find_dependence() {
        depends.assign(coefficients, 0);
        std::vector<std::uint32_t> rest;
        if (dimension == 3) {
            rest.assign(normals, 0);
            for (std::size_t q = 0; q < difference[1].size(); ++q)
                for (std::size_t r = 0; r < difference[2].size(); ++r)
                    rest[normal_of[q * difference[2].size() + r]] |= nodes_of(difference[1][q]) | nodes_of(difference[2][r]);
        } else {
            for (const Sum& q : difference[1]) rest.push_back(nodes_of(q));
        }
        for (std::size_t p = 0; p < difference[0].size(); ++p)
            for (std::size_t k = 0; k < rest.size(); ++k)
                depends[coefficient_of[p * rest.size() + k]] |= nodes_of(difference[0][p]) | rest[k];
    }

    // Of the barycentric coordinates at / steps.
    static double monomial(const Index& exponent, const Index& at, int steps) {
        double value = 1.0;
        for (std::size_t k = 0; k < at.size(); ++k)
            for (int e = 0; e < exponent[k]; ++e) value *= static_cast<double>(at[k]) / steps;
        return value;
    }

    // A derivative of the position as a sum of differences.
    Sum derivative(int direction, const Index& at, int steps) const {
        Sum found;
        for (std::size_t p = 0; p < difference[direction].size(); ++p)
            if (const double value = monomial(difference_index_[direction][p], at, steps); value != 0.0)
                found.push_back({static_cast<int>(p), value});
        return found;
    }

    // The nodes that a sum of differences depends on: those of control points may cancel each other.
    std::uint32_t nodes_of(const Sum& differences, int direction) const {
        constexpr double ROUNDING = 1e-12;
        std::map<int, double> weights;
        for (const Share& p : differences)
            for (const Share& control : difference[direction][p.of])
                for (const Share& node : control_of_nodes[control.of]) weights[node.of] += p.weight * control.weight * node.weight;
        std::uint32_t bits = 0;
        for (const auto& [node, weight] : weights)
            if (std::fabs(weight) > ROUNDING) bits |= 1u << node;
        return bits;
    }

    void find_at_nodes() {
        at_node.resize(nodes);
        for (int i = 0; i < nodes; ++i)
            for (int direction = 0; direction < dimension; ++direction)
                at_node[i][direction] = derivative(direction, index_of(between[i]), 2);
    }

    // The half beside the first end of an edge: there the other end is the middle. Blossoms of degree 2.
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
            const Index without = plus(index, moved, -index[moved]);
            Sum& here = found[number];
            if (index[moved] == 0) here = {{number, 1.0}};
            if (index[moved] == 1) here = {{number, 0.5}, {control_.at(plus(without, kept)), 0.5}};
            if (index[moved] == 2)
                here = {{number, 0.25}, {control_.at(plus(plus(without, kept), moved)), 0.5}, {control_.at(plus(without, kept, 2)), 0.25}};
        }
        return found;
    }
};

inline const QuadraticType& quadratic_type(std::uint8_t code) {
    static const std::vector<QuadraticType> types(quadratic_shapes().begin(), quadratic_shapes().end());
    return types[code];
}

}  // namespace meshfix
