// Passes over elements of every type: whether each is valid, its size and its quality.
//
// points (n, D); element e has the type codes[e] and the vertices nodes[offsets[e]] .. nodes[offsets[e + 1] - 1].
#pragma once

#include <vector>

#include "common/parallel.hpp"
#include "measures/bezier.hpp"
#include "measures/sines.hpp"

namespace meshfix {

struct ElementsView {
    const std::uint8_t* codes;
    const std::int32_t *offsets, *nodes;
    std::int64_t count;
};

// Loads the nodes of an element, and returns how many there are. points (n, D)
template <int D, std::size_t MOST>
int load_nodes(const double* points, const ElementsView& elements, std::int64_t e, std::array<Vec<D>, MOST>& nodes) {
    const std::int32_t first = elements.offsets[e], count = elements.offsets[e + 1] - first;
    for (std::int32_t i = 0; i < count; ++i)
        nodes[i] = load<D>(points + static_cast<std::int64_t>(elements.nodes[first + i]) * D);
    return count;
}

// Of each element; nothing is NaN where no coordinate is.
struct Judgement {
    std::vector<std::uint8_t> verdict;
    std::vector<double> measure, quality;
};

// The smallest sine of a simplex, with the sign of its determinant.
template <std::size_t D>
double smallest_sine(const std::array<double, D>* nodes) {
    const Edges<D> e = corner_edges(nodes, {0, 1, 2, 3});
    const double sine = std::sqrt(min_sine2(e, false));
    return determinant(e) < 0.0 ? -sine : sine;
}

// What the smoothing raises: the smallest sine of a simplex, the smallest scaled Jacobian of anything else; 0 where it
// has none.
template <std::size_t D>
double quality(std::uint8_t code, const std::array<double, D>* nodes) {
    const double value = code == TRIANGLE || code == TETRA ? smallest_sine(nodes) : scaled_jacobian(code, nodes);
    return std::isfinite(value) ? value : 0.0;
}

template <int D>
Judgement judge(const double* points, const ElementsView& elements, int threads) {
    const auto count = static_cast<std::size_t>(elements.count);
    Judgement result{std::vector<std::uint8_t>(count), std::vector<double>(count), std::vector<double>(count)};
    for_each_range(elements.count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        std::array<Vec<D>, MOST_NODES> nodes{};
        for (std::int64_t e = begin; e < end; ++e) {
            load_nodes<D>(points, elements, e, nodes);
            const std::uint8_t code = elements.codes[e];
            result.verdict[e] = static_cast<std::uint8_t>(judge(code, nodes.data()));
            result.measure[e] = measure(code, nodes.data());
            result.quality[e] = quality(code, nodes.data());
        }
    });
    return result;
}

}  // namespace meshfix
