// The shapes of elements: their corner simplices, facets and ideal corners. The same as the table of mesh/elements.py,
// whose comments say what they are; a test compares the two.
#pragma once

#include <array>
#include <cstdint>

namespace meshfix {

constexpr std::uint8_t TRIANGLE = 0, QUAD = 1, TETRA = 2, PYRAMID = 3, WEDGE = 4, HEXAHEDRON = 5;
constexpr int MOST_NODES = 8, MOST_SIMPLICES = 8, MOST_FACETS = 6;

struct ElementShape {
    int dimension, nodes, simplices, facets;
    std::array<std::array<std::int8_t, 4>, MOST_SIMPLICES> simplex;  // each a node and its neighbours, positively oriented
    std::array<std::array<std::int8_t, 4>, MOST_FACETS> facet;       // seen from outside; -1 behind a triangle's last
    std::array<std::int8_t, MOST_NODES> mirrored;  // the order of nodes that has the other orientation
    double weight;                                 // of scaled Jacobians

    int facet_size(int k) const { return dimension == 2 ? 2 : facet[k][3] < 0 ? 3 : 4; }
};

inline const std::array<ElementShape, 6> SHAPES{{
    {2, 3, 1, 3, {{{0, 1, 2}}}, {{{1, 2, -1, -1}, {2, 0, -1, -1}, {0, 1, -1, -1}}}, {1, 0, 2}, 1.1547005383792517},
    {2, 4, 4, 4, {{{0, 1, 3}, {1, 2, 0}, {2, 3, 1}, {3, 0, 2}}},
     {{{0, 1, -1, -1}, {1, 2, -1, -1}, {2, 3, -1, -1}, {3, 0, -1, -1}}}, {1, 0, 3, 2}, 1.0},
    {3, 4, 1, 4, {{{0, 1, 2, 3}}}, {{{1, 2, 3, -1}, {0, 3, 2, -1}, {0, 1, 3, -1}, {0, 2, 1, -1}}}, {1, 0, 2, 3},
     1.4142135623730951},
    {3, 5, 4, 5, {{{0, 1, 3, 4}, {1, 2, 0, 4}, {2, 3, 1, 4}, {3, 0, 2, 4}}},
     {{{0, 3, 2, 1}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}}}, {1, 0, 3, 2, 4}, 1.4142135623730951},
    {3, 6, 6, 5,
     {{{0, 1, 2, 3}, {1, 2, 0, 4}, {2, 0, 1, 5}, {3, 5, 4, 0}, {4, 3, 5, 1}, {5, 4, 3, 2}}},
     {{{0, 2, 1, -1}, {3, 4, 5, -1}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}}, {1, 0, 2, 4, 3, 5}, 1.1547005383792517},
    {3, 8, 8, 6,
     {{{0, 1, 3, 4}, {1, 2, 0, 5}, {2, 3, 1, 6}, {3, 0, 2, 7}, {4, 7, 5, 0}, {5, 4, 6, 1}, {6, 5, 7, 2}, {7, 6, 4, 3}}},
     {{{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}}}, {1, 0, 3, 2, 5, 4, 7, 6}, 1.0},
}};

}  // namespace meshfix
