// Long vectors whose sums have one order, for any number of threads and in every build: over the lanes of an item, then
// over the items. Zeros fill a vector up to whole packs.
#pragma once

#include <cstdint>
#include <vector>

#include "common/pack.hpp"
#include "common/parallel.hpp"

namespace meshfix {

class Numbers {
 public:
    explicit Numbers(std::int64_t size) : values_((size + MOST_LANES - 1) / MOST_LANES * MOST_LANES, 0.0) {}

    double* data() { return values_.data(); }
    const double* data() const { return values_.data(); }
    std::int64_t padded() const { return static_cast<std::int64_t>(values_.size()); }
    void swap(Numbers& other) { values_.swap(other.values_); }

 private:
    std::vector<double> values_;
};

// Calculates with vectors of one size.
class Calculator {
 public:
    Calculator(std::int64_t size, int threads)
        : parts_(Numbers(size).padded() / PER_ITEM + 1), threads_(threads) {}

    double dot(const Numbers& a, const Numbers& b) {
        return sum(a.padded(), [&](std::int64_t i) { return pack_at(a.data() + i) * pack_at(b.data() + i); });
    }

    // to = a + factor b; returns the dot product of that with c. `to` may be one of the others.
    double add(Numbers& to, const Numbers& a, double factor, const Numbers& b, const Numbers& c) {
        const Pack times = constant<Pack>(factor);
        return sum(a.padded(), [&](std::int64_t i) {
            const Pack value = pack_at(a.data() + i) + times * pack_at(b.data() + i);
            const Pack product = value * pack_at(c.data() + i);
            put(value, to.data() + i);
            return product;
        });
    }

 private:
    template <class F>
    double sum(std::int64_t size, const F& f) {
        for_each_range(size, PER_ITEM, threads_, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
            LaneSum part;
            for (std::int64_t i = begin; i < end; i += LANES) part.add(static_cast<std::size_t>(i / LANES), f(i));
            parts_[item] = part.total();
        });
        double total = 0.0;
        for (std::int64_t item = 0; item < (size + PER_ITEM - 1) / PER_ITEM; ++item) total += parts_[item];
        return total;
    }

    std::vector<double> parts_;
    int threads_;
};

}  // namespace meshfix
