// A mesh of curved elements: which elements each node is of, and passes over them.
#pragma once

#include <numeric>
#include <vector>

#include "common/parallel.hpp"
#include "quadratic/coefficients.hpp"

namespace meshfix {

constexpr std::int64_t QUADRATIC_PER_ITEM = 64;

// codes (m), offsets (m+1), nodes: as in mesh/elements.hpp, of the types of quadratic/shapes.hpp and behind these of others that are
// given. n: number of points.
struct QuadraticMesh {
    std::vector<const QuadraticType*> types;
    std::vector<std::uint8_t> codes;
    std::vector<std::int32_t> offsets, nodes;
    std::int64_t n;
    std::vector<std::int32_t> at_offsets, at;  // for each point the places in `nodes` where it is named
    std::vector<std::int32_t> owners;          // the element of each place

    QuadraticMesh(const std::uint8_t* of, std::int64_t m, const std::int32_t* named, std::int64_t count, std::int64_t points,
                  const std::vector<const QuadraticType*>& others)
        : codes(of, of + m), offsets(m + 1, 0), nodes(named, named + count), n(points), at_offsets(points + 1, 0), at(count),
          owners(count) {
        for (std::size_t i = 0; i < quadratic_shapes().size(); ++i) types.push_back(&quadratic_type(i));
        types.insert(types.end(), others.begin(), others.end());
        for (std::int64_t e = 0; e < m; ++e) {
            offsets[e + 1] = offsets[e] + type(e).nodes;
            std::fill(owners.begin() + offsets[e], owners.begin() + offsets[e + 1], static_cast<std::int32_t>(e));
        }
        for (const std::int32_t v : nodes) ++at_offsets[v + 1];
        std::partial_sum(at_offsets.begin(), at_offsets.end(), at_offsets.begin());
        std::vector<std::int32_t> next(at_offsets.begin(), at_offsets.end() - 1);
        for (std::int32_t i = 0; i < static_cast<std::int32_t>(count); ++i) at[next[nodes[i]]++] = i;
    }

    std::int64_t size() const { return static_cast<std::int64_t>(codes.size()); }
    const QuadraticType& type(std::int64_t e) const { return *types[codes[e]]; }
    bool is_of_second_order() const { return types.size() == quadratic_shapes().size(); }
    const std::int32_t* nodes_of(std::int64_t e) const { return nodes.data() + offsets[e]; }

    // The nodes of an element, from its first on: what rounding does depends on the size of the element alone.
    template <int D, class R>
    QuadraticNodes<D, R> local(const double* points, std::int64_t e) const {
        QuadraticNodes<D, R> found;
        const Vec<D> origin = load<D>(points + static_cast<std::int64_t>(nodes_of(e)[0]) * D);
        for (int i = 0; i < type(e).nodes; ++i) found[i] = load<D>(points + static_cast<std::int64_t>(nodes_of(e)[i]) * D) - origin;
        return found;
    }

    // The nodes of an element that are marked.
    NodeSet marked(const std::uint8_t* mask, std::int64_t e) const {
        NodeSet found;
        for (int i = 0; i < type(e).nodes; ++i)
            if (mask[nodes_of(e)[i]] != 0) found.add(i);
        return found;
    }
};

// How far nodes may go from where they were: a ball around each; an infinite radius: anywhere.
struct QuadraticReach {
    const double* centres;  // (n, D)
    double radius;
};

// Of each element that is looked at: where it is not valid, its smallest coefficient relative to the straight element, its measure and its
// smallest scaled Jacobian at the nodes.
struct QuadraticJudgement {
    std::vector<std::uint8_t> verdict;
    std::vector<double> smallest, measure, quality;
};

template <int D, class R>
QuadraticJudgement judge(const QuadraticMesh& mesh, const double* points, const std::vector<std::int32_t>& elements, int threads) {
    QuadraticJudgement found;
    const auto count = static_cast<std::int64_t>(elements.size());
    found.verdict.resize(count);
    for (auto* values : {&found.smallest, &found.measure, &found.quality}) values->resize(count);
    for_each_range(count, QUADRATIC_PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t i = begin; i < end; ++i) {
            const std::int32_t e = elements[i];
            const QuadraticType& type = mesh.type(e);
            const QuadraticNodes<D, R> nodes = mesh.local<D, R>(points, e);
            const QuadraticParts<D, R> parts(type, nodes);
            const auto finite = [](double x) { return std::isfinite(x) ? x : 0.0; };
            double sum = 0.0;
            for (int k = 0; k < type.coefficients; ++k) sum += parts.coefficient[k];
            found.verdict[i] = static_cast<std::uint8_t>(judge(parts));
            found.smallest[i] = finite(parts.smallest() / straight_size<D, R>(type, nodes));
            found.measure[i] = sum / type.coefficients * type.integral;
            found.quality[i] = finite(scaled_jacobian(parts));
        }
    });
    return found;
}

}  // namespace meshfix
