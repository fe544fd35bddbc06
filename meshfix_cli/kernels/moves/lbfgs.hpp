// Minimisation by L-BFGS: J. Nocedal, "Updating quasi-Newton matrices with limited storage", Mathematics of Computation
// 35 (1980). Steps satisfy the weak conditions of Wolfe.
//
// A function has
//     Numbers start() const                                  where to start
//     double operator()(const double* x, double* gradient)   its value
//     bool enough() const                                    whether what it saw last ends the minimisation
//     double least_gain() const                              by which an iteration must lower the value, to go on
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "common/numbers.hpp"
#include "common/tolerances.hpp"

namespace meshfix {

template <class Function>
class Lbfgs {
 public:
    Lbfgs(Function f, std::int64_t size, int threads)
        : f_(std::move(f)), calculator_(size, threads), x_(f_.start()), gradient_(size), trial_(size),
          trial_gradient_(size), direction_(size) {
        for (int i = 0; i < LBFGS_PAIRS; ++i) pairs_.push_back({Numbers(size), Numbers(size), 0.0, 0.0});
    }

    Function& function() { return f_; }
    const double* x() const { return x_.data(); }

    // Forgets what is known of a function that has changed; returns its value where the last minimisation ended.
    double start() {
        known_ = 0;
        return value_ = f_(x_.data(), gradient_.data());
    }

    // Returns the last value.
    double minimise(int iterations) {
        for (int i = 0; i < iterations && !f_.enough(); ++i) {
            const double before = value_, slope = descend();
            if (!(slope < 0.0) || !search(slope)) {
                const bool steepest = known_ == 0;
                start();  // once more, with the steepest descent; what the function saw last is x
                if (steepest) break;
                continue;
            }
            // The first iterations know little of the function, and gain little.
            if (i >= LBFGS_PAIRS && before - value_ <= f_.least_gain()) break;
        }
        return value_;
    }

 private:
    struct Pair {
        Numbers step, change;  // of x and of the gradient
        double product, weight;
    };
    struct Trial {
        double step, value, slope;
    };

    // Sets the direction; returns the slope of the function along it.
    double descend() {
        const double steepest = calculator_.add(direction_, gradient_, -2.0, gradient_, gradient_);  // - gradient
        if (known_ == 0) return steepest;
        double along = calculator_.dot(direction_, pair(0).step);
        for (std::int64_t i = 0; i < known_; ++i) {
            Pair& p = pair(i);
            p.weight = along / p.product;
            const Numbers& next = i + 1 < known_ ? pair(i + 1).step : pair(i).change;
            along = calculator_.add(direction_, direction_, -p.weight, p.change, next);
        }
        const double scale = pair(0).product / calculator_.dot(pair(0).change, pair(0).change);
        along *= scale;
        calculator_.add(direction_, direction_, scale - 1.0, direction_, gradient_);
        for (std::int64_t i = known_ - 1; i >= 0; --i) {
            const Pair& p = pair(i);
            const Numbers& next = i > 0 ? pair(i - 1).change : gradient_;
            along = calculator_.add(direction_, direction_, p.weight - along / p.product, p.step, next);
        }
        return along;
    }

    // Goes to a point along the direction that satisfies Wolfe's conditions; false: found none, and stays.
    bool search(double slope) {
        const Trial here{0.0, value_, slope};
        Trial low = here, high{INFINITY, INFINITY, INFINITY};
        double step = known_ > 0 ? 1.0 : smaller(1.0, 1.0 / std::sqrt(-slope));
        for (int i = 0; i < LBFGS_TRIALS; ++i) {
            calculator_.add(trial_, x_, step, direction_, direction_);
            const double value = f_(trial_.data(), trial_gradient_.data());
            const Trial there{step, value, calculator_.dot(trial_gradient_, direction_)};
            const bool lower = value <= value_ + WOLFE_VALUE * step * slope;
            if (f_.enough() || (lower && there.slope >= WOLFE_SLOPE * slope)) {
                accept(there);
                return true;
            }
            (lower ? low : high) = there;
            step = between(low, high);
        }
        return false;
    }

    // The next trial: the minimum of a cubic between two, but not too near to either; farther out, where only one is
    // known.
    static double between(const Trial& low, const Trial& high) {
        if (high.step == INFINITY) return LBFGS_FARTHER * larger(low.step, 0.25);
        const double width = high.step - low.step;
        const double a = low.slope + high.slope - 3.0 * (high.value - low.value) / width;
        const double root = std::sqrt(larger(0.0, a * a - low.slope * high.slope));
        double share = 1.0 - (high.slope + root - a) / (high.slope - low.slope + 2.0 * root);
        if (!(share > 0.1)) share = 0.1;
        return low.step + width * smaller(share, 0.9);
    }

    void accept(const Trial& there) {
        newest_ = (newest_ + LBFGS_PAIRS - 1) % LBFGS_PAIRS;
        Pair& p = pair(0);
        calculator_.add(p.step, trial_, -1.0, x_, x_);
        p.product = calculator_.add(p.change, trial_gradient_, -1.0, gradient_, p.step);
        known_ = smaller<std::int64_t>(known_ + 1, LBFGS_PAIRS);
        if (!(p.product > 0.0)) known_ = 0;
        x_.swap(trial_);
        gradient_.swap(trial_gradient_);
        value_ = there.value;
    }

    Pair& pair(std::int64_t age) { return pairs_[(newest_ + age) % LBFGS_PAIRS]; }

    Function f_;
    Calculator calculator_;
    Numbers x_, gradient_, trial_, trial_gradient_, direction_;
    std::vector<Pair> pairs_;
    std::int64_t newest_ = 0, known_ = 0;
    double value_ = INFINITY;
};

}  // namespace meshfix
