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
        take_faces(star, functions_);
        owners_.clear();
        for (int i = 0; i < star.faces_count; ++i)
            owners_.push_back(stars.elements == nullptr ? i : stars.element_of(stars.corners[stars.offsets[v] + i], D + 1));
    }

    // How many elements have a corner that is not clearly positive.
    int wrong_at(const Vec<D>& x) { return static_cast<int>(find_wrong(x).size()); }

    // Whether there is an optimum, of determinants by areas, where fewer than so many elements are left out.
    bool solve(const Star<D>& star, Programme<D>& programme, int fewer_than) {
        const auto limit = static_cast<std::size_t>(std::min(fewer_than, LP_MOST_LEFT_OUT));
        left_out_.clear();
        while (left_out_.size() < limit && solve_without(NONE, star, programme)) {
            if (programme.smallest > LP_CLEAR) return true;
            double largest = -INFINITY;
            std::int32_t choice = NONE;
            for (const std::int32_t owner : find_lowest(star.directions, programme))
                if (solve_without(owner, star, programme) && programme.smallest > largest) {
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

    // Elements with such corners, which lie one behind the other.
    template <class F>
    const std::vector<std::int32_t>& find(const F& is_such) {
        found_.clear();
        for (std::size_t i = 0; i < functions_.size(); ++i)
            if ((found_.empty() || found_.back() != owners_[i]) && is_such(i)) found_.push_back(owners_[i]);
        return found_;
    }

    const std::vector<std::int32_t>& find_wrong(const Vec<D>& x) {
        return find([&](std::size_t i) { return !(at(i, x) > LP_CLEAR * std::sqrt(norm2(functions_[i].gradient))); });
    }

    // Those that hold the optimum down: without one of the others it is the same.
    const std::vector<std::int32_t>& find_lowest(const Directions<D>& directions, const Programme<D>& programme) {
        return find([&](std::size_t i) {
            const double slope = std::sqrt(norm2(directions.along(functions_[i].gradient)));
            return !is_left_out(owners_[i]) && at(i, programme.position) <= (programme.smallest + LP_CLEAR) * slope;
        });
    }

    double at(std::size_t i, const Vec<D>& x) const { return functions_[i].value + dot(functions_[i].gradient, x); }

    bool solve_without(std::int32_t owner, const Star<D>& star, Programme<D>& programme) {
        kept_.clear();
        for (std::size_t i = 0; i < functions_.size(); ++i)
            if (owners_[i] != owner && !is_left_out(owners_[i])) kept_.push_back(functions_[i]);
        return !kept_.empty() && programme.solve(star, kept_, true);
    }

    std::vector<Affine<D>> functions_{}, kept_{};  // of all corners, and of those that are not left out
    std::vector<std::int32_t> owners_{}, left_out_{}, found_{};
};

}  // namespace meshfix
