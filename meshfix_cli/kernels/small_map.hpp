// A hash table for the few things around one vertex, emptied in no time for the next.
#pragma once

#include <cstdint>
#include <vector>

namespace meshfix {

template <class Key>
class SmallMap {
 public:
    // Empties the table, and makes room for `most` keys.
    void clear(std::size_t most) {
        std::size_t capacity = 64;
        while (capacity < 2 * most) capacity *= 2;
        if (capacity > slots_.size()) slots_.assign(capacity, Slot{}), round_ = 0;
        mask_ = capacity - 1;
        if (++round_ == 0) slots_.assign(slots_.size(), Slot{}), round_ = 1;
    }

    // The value of a key; where it is new, `value` with is_new = true.
    std::int32_t& find(Key key, std::int32_t value, bool& is_new) {
        std::size_t at = hash(key) & mask_;
        while (slots_[at].round == round_ && slots_[at].key != key) at = (at + 1) & mask_;
        is_new = slots_[at].round != round_;
        if (is_new) slots_[at] = {key, value, round_};
        return slots_[at].value;
    }

 private:
    struct Slot {
        Key key = 0;
        std::int32_t value = 0;
        std::uint32_t round = 0;
    };

    static std::size_t hash(Key key) {
        const std::uint64_t mixed = static_cast<std::uint64_t>(key) * 0x9E3779B97F4A7C15u;
        return static_cast<std::size_t>(mixed >> 40);
    }

    std::vector<Slot> slots_;
    std::size_t mask_ = 0;
    std::uint32_t round_ = 0;
};

}  // namespace meshfix
