// Which of the triangles of surfaces are side by side.
#pragma once

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "mesh/counting.hpp"

namespace meshfix {

// vertices (p, 3)   numbers that tell which corners of pieces are one
// first (s+1)       where the pieces of each shape begin
// directions (s)    2: a surface; others have nothing beside
struct Beside {
    std::vector<std::int32_t> pieces{};  // (p, 3): those of the same shape at the sides, -1: none
    std::vector<bool> is_again{};        // (p, 3): a corner that another piece of the shape has had before

    Beside(const std::int32_t* vertices, const std::vector<std::int32_t>& first, const std::vector<std::uint8_t>& directions) {
        struct Side {
            std::int32_t low, high, place, shape;  // place: 3 * piece + side
        };
        std::vector<Side> sides;
        sides.reserve(static_cast<std::size_t>(first.back()) * 3);
        std::int32_t most = -1;
        for (std::size_t shape = 0; shape < directions.size(); ++shape)
            for (std::int32_t piece = first[shape]; directions[shape] == 2 && piece < first[shape + 1]; ++piece)
                for (int i = 0; i < 3; ++i) {
                    const std::int32_t a = vertices[piece * 3 + i], b = vertices[piece * 3 + (i + 1) % 3];
                    sides.push_back({std::min(a, b), std::max(a, b), piece * 3 + i, static_cast<std::int32_t>(shape)});
                    most = std::max({most, a, b});
                }
        pieces.assign(static_cast<std::size_t>(first.back()) * 3, -1);
        is_again.assign(pieces.size(), false);
        std::vector<std::int32_t> last(static_cast<std::size_t>(most) + 1, -1);  // the shape that a vertex was last a corner of
        for (const Side& side : sides) is_again[side.place] = std::exchange(last[vertices[side.place]], side.shape) == side.shape;
        std::vector<std::int32_t> offsets;
        const auto count = static_cast<std::int64_t>(sides.size());
        std::vector<std::int32_t> order = counted_order(count, most + 1, offsets, [&](std::int64_t i) { return sides[i].low; });
        for (std::int32_t v = 0; v <= most; ++v)
            std::sort(order.begin() + offsets[v], order.begin() + offsets[v + 1], [&](std::int32_t a, std::int32_t b) {
                return std::tie(sides[a].shape, sides[a].high, a) < std::tie(sides[b].shape, sides[b].high, b);
            });
        for (std::int64_t i = 0; i + 1 < count; ++i) {
            const Side &one = sides[order[i]], &other = sides[order[i + 1]];
            if (one.shape != other.shape || one.low != other.low || one.high != other.high) continue;
            pieces[one.place] = other.place / 3;
            pieces[other.place] = one.place / 3;
        }
    }
};

}  // namespace meshfix
