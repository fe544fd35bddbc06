// The position of a vertex at which fewer elements of its star are wrong, where not all of them can be right: as long as the
// optimum of the linear programme is not positive, the element is left out without which that is largest.
#pragma once

#include <algorithm>
#include <vector>

#include "moves/programme.hpp"

namespace meshfix {

template <int D>
class MostOfStar {
 public:
    void set(const Star<D>& star, const StarsView& stars, std::int64_t v) {
        functions_.clear();
        owners_.clear();
        for (int i = 0; i < star.faces_count; ++i) {
            const Edges<D> e = star.edges(i, Vec<D>{});
            functions_.push_back({determinant(e), determinant_slope(e)});
            owners_.push_back(stars.elements == nullptr ? i : stars.element_of(stars.corners[stars.offsets[v] + i], D + 1));
        }
    }

    // How many elements have a corner that is not clearly positive.
    int wrong_at(const Vec<D>& x) { return static_cast<int>(find_wrong(x).size()); }

    // Whether there is an optimum, of determinants by areas, where fewer than so many elements are left out.
    bool solve(const Star<D>& star, Programme<D>& programme, int fewer_than) {
        left_out_.clear();
        while (static_cast<int>(left_out_.size()) < fewer_than && solve_without(NONE, star, programme)) {
            if (programme.smallest > LP_CLEAR) return true;
            double largest = -INFINITY;
            std::int32_t choice = NONE;
            for (const std::int32_t owner : find_wrong(programme.position))
                if (!is_left_out(owner) && solve_without(owner, star, programme) && programme.smallest > largest) {
                    largest = programme.smallest;
                    choice = owner;
                }
            if (choice == NONE) return false;
            left_out_.push_back(choice);
        }
        return false;
    }

 private:
    static constexpr std::int32_t NONE = -1;

    bool is_left_out(std::int32_t owner) const {
        return std::find(left_out_.begin(), left_out_.end(), owner) != left_out_.end();
    }

    // The corners of an element lie one behind the other.
    const std::vector<std::int32_t>& find_wrong(const Vec<D>& x) {
        wrong_.clear();
        for (std::size_t i = 0; i < functions_.size(); ++i) {
            const Affine<D>& f = functions_[i];
            const bool right = f.value + dot(f.gradient, x) > LP_CLEAR * std::sqrt(norm2(f.gradient));
            if (!right && (wrong_.empty() || wrong_.back() != owners_[i])) wrong_.push_back(owners_[i]);
        }
        return wrong_;
    }

    bool solve_without(std::int32_t owner, const Star<D>& star, Programme<D>& programme) {
        kept_.clear();
        for (std::size_t i = 0; i < functions_.size(); ++i)
            if (owners_[i] != owner && !is_left_out(owners_[i])) kept_.push_back(functions_[i]);
        return !kept_.empty() && programme.solve(star, kept_, true);
    }

    std::vector<Affine<D>> functions_{}, kept_{};  // of all corners, and of those that are not left out
    std::vector<std::int32_t> owners_{}, left_out_{}, wrong_{};
};

}  // namespace meshfix
