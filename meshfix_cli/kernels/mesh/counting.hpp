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

}  // namespace meshfix
