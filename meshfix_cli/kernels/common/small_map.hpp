// A hash table for the few things around one vertex, emptied in no time for the next.
#pragma once

#include <cstdint>
#include <vector>

namespace meshfix {

template <class Value>
class SmallMap {
 public:
    // Empties the table, and makes room for `most` keys.
    void clear(std::size_t most) {
        std::size_t capacity = 256;  // so many that most keys have a slot to themselves
        while (capacity < 2 * most) capacity *= 2;
        if (capacity > slots_.size()) slots_.assign(capacity, Slot{}), round_ = 0;
        mask_ = capacity - 1;
        if (++round_ == 0) slots_.assign(slots_.size(), Slot{}), round_ = 1;
    }

    // The value of a key; where it is new, is_new = true, and the value is anything.
    Value& find(std::uint64_t key, bool& is_new) {
        // What is around one vertex has numbers that are near each other: their last digits tell them apart.
        std::size_t at = static_cast<std::size_t>(key ^ key >> 29) & mask_;
        while (slots_[at].round == round_ && slots_[at].key != key) at = (at + 1) & mask_;
        is_new = slots_[at].round != round_;
        slots_[at].key = key;
        slots_[at].round = round_;
        return slots_[at].value;
    }

 private:
    struct Slot {
        std::uint64_t key = 0;
        std::uint32_t round = 0;
        Value value{};
    };

    std::vector<Slot> slots_;
    std::size_t mask_ = 0;
    std::uint32_t round_ = 0;
};

}  // namespace meshfix
