// Things in the order of small numbers that they have.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace meshfix {

// Positions (count) in the ascending order of key(position), from 0 to keys - 1, equal ones as they come; `offsets` (keys + 1):
// where those of each key begin.
template <class Key>
std::vector<std::int32_t> counted_order(std::int64_t count, std::int64_t keys, std::vector<std::int32_t>& offsets, const Key& key) {
    offsets.assign(static_cast<std::size_t>(keys) + 1, 0);
    for (std::int64_t i = 0; i < count; ++i) ++offsets[key(i) + 1];
    for (std::int64_t k = 0; k < keys; ++k) offsets[k + 1] += offsets[k];
    std::vector<std::int32_t> order(static_cast<std::size_t>(count)), next(offsets.begin(), offsets.end() - 1);
    for (std::int64_t i = 0; i < count; ++i) order[next[key(i)]++] = static_cast<std::int32_t>(i);
    return order;
}

// Compressed rows of pairs (count, 2): where the second ones of each first one begin, and these, ascending.
struct PairRows {
    std::vector<std::int32_t> offsets{}, second{};

    PairRows(const std::int32_t* pairs, std::int64_t count, std::int64_t keys) {
        second = counted_order(count, keys, offsets, [&](std::int64_t i) { return pairs[2 * i]; });
        for (std::int32_t& one : second) one = pairs[2 * static_cast<std::int64_t>(one) + 1];
        for (std::int64_t k = 0; k < keys; ++k) std::sort(second.begin() + offsets[k], second.begin() + offsets[k + 1]);
    }
};

// Of edges (count, 2) the pairs of a vertex that is marked and the other end.
inline std::vector<std::int32_t> pairs_from(const std::int32_t* edges, std::int64_t count, const std::uint8_t* marks) {
    std::vector<std::int32_t> pairs;
    pairs.reserve(static_cast<std::size_t>(4 * count));
    for (std::int64_t i = 0; i < count; ++i) {
        const std::int32_t a = edges[2 * i], b = edges[2 * i + 1];
        if (marks[a] != 0) pairs.insert(pairs.end(), {a, b});
        if (marks[b] != 0) pairs.insert(pairs.end(), {b, a});
    }
    return pairs;
}

}  // namespace meshfix
