// The order in which the kernels hold a mesh: vertices along a Morton curve, simplices by their first vertex. What
// is near in space is then near in memory, whatever the order of the file.
//
// points (n, S), simplices (m, D+1) in the numbers of the user; S is D, or 3 for surfaces
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "common/parallel.hpp"
#include "common/tolerances.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

// The vertices of a block are consecutive. Large enough for a block to be mostly interior, small enough to stay in
// the first-level cache.
constexpr std::int64_t BLOCK_SIZE = 1024;

// A frame that turns with the mesh, so that the order does not depend on axes, offset and unit: the first axis goes to
// the first vertex that is nearly as far from the centroid as any, the second to one that is nearly as far from the first.
template <int D>
struct Frame {
    Vec<D> origin{};
    std::array<Vec<D>, D> axes{};

    Frame(const double* points, const std::vector<std::int32_t>& vertices) {
        const auto at = [&](std::int32_t v) { return load<D>(points + static_cast<std::int64_t>(v) * D); };
        const Vec<D> first = at(vertices.front());
        for (std::int32_t v : vertices) origin = origin + (at(v) - first);
        origin = first + (1.0 / static_cast<double>(vertices.size())) * origin;
        for (int k = 0; k < D - 1; ++k) axes[k] = farthest(vertices, k, [&](std::int32_t v) { return at(v) - origin; });
        if constexpr (D == 2) {
            axes[1] = {-axes[0][1], axes[0][0]};
        } else {
            axes[2] = cross(axes[0], axes[1]);
        }
    }

    Vec<D> coordinates(const double* p) const {
        const Vec<D> x = load<D>(p) - origin;
        Vec<D> u;
        for (int k = 0; k < D; ++k) u[k] = dot(x, axes[k]);
        return u;
    }

 private:
    // The direction, orthogonal to the first `known` axes, of the first vertex that is nearly as far out as any.
    template <class From>
    Vec<D> farthest(const std::vector<std::int32_t>& vertices, int known, const From& from) const {
        const auto across = [&](std::int32_t v) {
            Vec<D> x = from(v);
            for (int k = 0; k < known; ++k) x = x - dot(x, axes[k]) * axes[k];
            return x;
        };
        double largest2 = 0.0;
        for (std::int32_t v : vertices) largest2 = std::max(largest2, norm2(across(v)));
        for (std::int32_t v : vertices) {
            const Vec<D> x = across(v);
            if (norm2(x) >= ORDER_AXIS2 * largest2 && largest2 > 0.0) return (1.0 / std::sqrt(norm2(x))) * x;
        }
        return any_across(known);
    }

    // All vertices are on one line: any direction across will do.
    Vec<D> any_across(int known) const {
        for (int c = 0; c < D; ++c) {
            Vec<D> x{};
            x[c] = 1.0;
            for (int k = 0; k < known; ++k) x = x - dot(x, axes[k]) * axes[k];
            if (norm2(x) >= 1.0 / D - 0.1) return (1.0 / std::sqrt(norm2(x))) * x;
        }
        return {};
    }
};

// Bits of x (16 in 3-D, 24 in 2-D), D - 1 zeros between any two.
template <int D>
std::uint64_t spread_bits(std::uint64_t x) {
    if constexpr (D == 3) {
        x = (x | x << 16) & 0x0000'FF00'00FF;
        x = (x | x << 8) & 0x00F0'0F00'F00F;
        x = (x | x << 4) & 0x0C30'C30C'30C3;
        x = (x | x << 2) & 0x2492'4924'9249;
    } else {
        x = (x | x << 16) & 0xFFFF'0000'FFFF;
        x = (x | x << 8) & 0x00FF'00FF'00FF'00FF;
        x = (x | x << 4) & 0x0F0F'0F0F'0F0F'0F0F;
        x = (x | x << 2) & 0x3333'3333'3333'3333;
        x = (x | x << 1) & 0x5555'5555'5555'5555;
    }
    return x;
}

struct Keyed {
    std::uint64_t key;  // of KEY_BITS bits
    std::int32_t vertex;
};
constexpr int KEY_BITS = 48, DIGIT_BITS = 12;

// Stable, by the digits of the keys from the last to the first.
inline void sort_by_key(std::vector<Keyed>& items) {
    std::vector<Keyed> other(items.size());
    for (int shift = 0; shift < KEY_BITS; shift += DIGIT_BITS) {
        const auto digit = [&](const Keyed& item) { return item.key >> shift & ((1 << DIGIT_BITS) - 1); };
        std::vector<std::int64_t> next((1 << DIGIT_BITS) + 1, 0);
        for (const auto& item : items) ++next[digit(item) + 1];
        for (std::size_t d = 1; d < next.size(); ++d) next[d] += next[d - 1];
        for (const auto& item : items) other[next[digit(item)]++] = item;
        items.swap(other);
    }
}

// Puts the vertices, ascending, in the order of the curve; in a block they ascend again.
template <int D>
void sort_along_curve(std::vector<std::int32_t>& vertices, const double* points, int threads) {
    const auto count = static_cast<std::int64_t>(vertices.size());
    if (count <= BLOCK_SIZE) return;
    const Frame<D> frame(points, vertices);
    std::vector<Vec<D>> u(vertices.size());
    for_each_range(count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t i = begin; i < end; ++i)
            u[i] = frame.coordinates(points + static_cast<std::int64_t>(vertices[i]) * D);
    });
    Vec<D> low = u[0];
    double size = 0.0;
    for (const auto& x : u)
        for (int k = 0; k < D; ++k) low[k] = std::min(low[k], x[k]);
    for (const auto& x : u) size = std::max(size, largest_coordinate(x - low));
    // The offset keeps the vertices of regular meshes away from where the cells of the curve meet: there rounding
    // would put them in one or the other.
    if (!(size > 0.0)) return;
    constexpr double CELLS = D == 3 ? 0xFFFE : 0xFFFFFE, OFFSET = 0.381966;
    std::vector<Keyed> items(vertices.size());
    for_each_range(count, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t i = begin; i < end; ++i) {
            std::uint64_t key = 0;
            for (int k = 0; k < D; ++k)
                key |= spread_bits<D>(static_cast<std::uint64_t>((u[i][k] - low[k]) / size * CELLS + OFFSET)) << k;
            items[i] = {key, vertices[i]};
        }
    });
    sort_by_key(items);
    for_each_range(count, BLOCK_SIZE, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t i = begin; i < end; ++i) vertices[i] = items[i].vertex;
        std::sort(vertices.begin() + begin, vertices.begin() + end);
    });
}

struct Order {
    std::vector<std::int32_t> vertices;   // the user's number of each vertex that belongs to a simplex
    std::vector<std::int32_t> rows;       // the user's row of each simplex
    std::vector<std::int32_t> simplices;  // (m, D+1) in the new numbers
};

// The vertices of simplices, ascending.
inline std::vector<std::int32_t> used_vertices(const std::int32_t* simplices, std::int64_t corners, std::int64_t n) {
    std::vector<std::uint8_t> is_used(n, 0);
    for (std::int64_t c = 0; c < corners; ++c) is_used[simplices[c]] = 1;
    std::vector<std::int32_t> used;
    for (std::int64_t v = 0; v < n; ++v)
        if (is_used[v]) used.push_back(static_cast<std::int32_t>(v));
    return used;
}

// `used` are the vertices of the simplices, ascending.
template <int D, int S>
Order order_mesh(const double* points, std::int64_t n, const std::int32_t* simplices, std::int64_t m,
                 std::vector<std::int32_t> used, int threads) {
    Order order;
    order.vertices = std::move(used);
    std::vector<std::int32_t> number(n);
    sort_along_curve<S>(order.vertices, points, threads);
    for (std::size_t i = 0; i < order.vertices.size(); ++i) number[order.vertices[i]] = static_cast<std::int32_t>(i);

    std::vector<std::int32_t> first(m), next(order.vertices.size() + 1, 0);  // first: the smallest vertex of each row
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t s = begin; s < end; ++s) {
            first[s] = number[simplices[s * (D + 1)]];
            for (int k = 1; k <= D; ++k) first[s] = std::min(first[s], number[simplices[s * (D + 1) + k]]);
        }
    });
    for (std::int32_t v : first) ++next[v + 1];
    for (std::size_t v = 1; v < next.size(); ++v) next[v] += next[v - 1];
    order.rows.resize(m);
    for (std::int64_t s = 0; s < m; ++s) order.rows[next[first[s]]++] = static_cast<std::int32_t>(s);
    order.simplices.resize(m * (D + 1));
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        constexpr std::int64_t AHEAD = 16;  // the rows are all over the file
        const auto row = [&](std::int64_t s) { return simplices + static_cast<std::int64_t>(order.rows[s]) * (D + 1); };
        for (std::int64_t s = begin; s < end; ++s) {
            if (s + AHEAD < end) prefetch(row(s + AHEAD));
            for (int k = 0; k <= D; ++k) order.simplices[s * (D + 1) + k] = number[row(s)[k]];
        }
    });
    return order;
}

}  // namespace meshfix
