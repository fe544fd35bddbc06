// What the kernels are told of the types of curved elements: the table of those of second order, and what describes others.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace meshfix {

// How much room there is for elements of second order, and for those of any order that are judged.
struct SecondOrder {
    static constexpr int NODES = 27, COEFFICIENTS = 216, DIFFERENCES = 18, NORMALS = 80;
};
struct AnyOrder {
    static constexpr int NODES = 128, COEFFICIENTS = 1728, DIFFERENCES = 128, NORMALS = 576;
};

// Some of the nodes of an element.
struct NodeSet {
    std::array<std::uint64_t, AnyOrder::NODES / 64> bits{};

    void add(int node) { bits[node / 64] |= std::uint64_t{1} << (node % 64); }
    bool any() const { return (bits[0] | bits[1]) != 0; }
    NodeSet without(const NodeSet& others) const { return {{bits[0] & ~others.bits[0], bits[1] & ~others.bits[1]}}; }
    friend NodeSet operator|(const NodeSet& a, const NodeSet& b) { return {{a.bits[0] | b.bits[0], a.bits[1] | b.bits[1]}}; }
    friend NodeSet operator&(const NodeSet& a, const NodeSet& b) { return {{a.bits[0] & b.bits[0], a.bits[1] & b.bits[1]}}; }
};

// A type: its nodes as means of corners, in VTK's order, corners first.
struct QuadraticShape {
    int dimension;
    std::vector<int> factors;               // their dimensions
    std::vector<std::vector<int>> between;  // the corners whose mean each node is in the straight element
    double weight;                          // of scaled Jacobians
    int order = 2;
    std::vector<std::vector<double>> places{};  // of more than second order, instead: barycentric coordinates of all factors
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
        {2, {2}, joined(3, {{0, 1}, {1, 2}, {2, 0}}), triangle},
        {2, {1, 1}, joined(4, quad), 1.0},
        {2, {1, 1}, joined(4, with(quad, {{0, 1, 2, 3}})), 1.0},
        {3, {3}, joined(4, {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}), tetrahedron},
        {3, {2, 1}, joined(6, wedge), triangle},
        {3, {2, 1}, joined(6, with(wedge, {{0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}})), triangle},
        {3, {1, 1, 1}, joined(8, hexahedron), 1.0},
        {3, {1, 1, 1},
         joined(8, with(hexahedron, {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7},
                                     {0, 1, 2, 3, 4, 5, 6, 7}})),
         1.0},
    };
    return shapes;
}

}  // namespace meshfix
