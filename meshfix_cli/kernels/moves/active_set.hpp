// The active-set method of section 3.2: steepest ascent for the smallest sine of a star, a nonsmooth function.
#pragma once

#include "measures/sines.hpp"
#include "moves/min_norm.hpp"

namespace meshfix {

template <int D>
struct ActiveSet {
    std::vector<Sine<D, Pack>> functions;
    std::vector<Vec<D>> gradients;  // of the active functions

    // From a valid position x of quality `quality` (min_sine2, in and out) to one that is no worse.
    Vec<D> improve(const Star<D>& star, Vec<D> x, double& quality) {
        for (int step = 0; step < ACTIVE_MAX_STEPS; ++step) {  // rule 2
            const double value = std::sqrt(quality);
            sines<D>(star, x, functions);
            const Vec<D> ascent = ascent_direction(star, value);
            const double slope = std::sqrt(norm2(ascent));
            if (!(slope > ACTIVE_KKT)) break;  // rule 4
            const Vec<D> direction = (1.0 / slope) * ascent;
            const double first = first_change(value, direction, slope, star.radius);
            if (!search(star, x, quality, direction, slope, first)) break;  // rule 1
            if (std::sqrt(quality) - value < ACTIVE_MIN_GAIN) break;        // rule 3
        }
        return x;
    }

   private:
    // The smallest convex combination of the active gradients: every active function rises along it.
    Vec<D> ascent_direction(const Star<D>& star, double value) {
        gradients.clear();
        constexpr int PER_FACE = functions_per_simplex(D);
        for (int face = 0; face < star.faces_count; ++face) {  // in their order, however they are packed
            for (int k = 0; k < PER_FACE; ++k) {
                const auto& f = functions[face / LANES * PER_FACE + k];
                const int lane = face % LANES;
                if (f.value[lane] > value + ACTIVE) continue;
                Vec<D> gradient;
                for (int c = 0; c < D; ++c) gradient[c] = f.gradient[c][lane];
                gradients.push_back(star.directions.along(gradient));
            }
        }
        return min_norm_point<D>(gradients);
    }

    // Where, to first order, another function becomes the smallest.
    double first_change(double value, const Vec<D>& direction, double slope, double longest) const {
        const Pack none = constant<Pack>(longest);
        Pack first = none;
        for (const auto& f : functions) {
            Pack closing = constant<Pack>(slope);
            for (int k = 0; k < D; ++k) closing = closing - direction[k] * f.gradient[k];
            const Pack step = (f.value - value) / closing;
            const auto counts = (f.value > constant<Pack>(value + ACTIVE)) & (closing > constant<Pack>(0.0));
            first = smaller(first, select(counts, step, none));
        }
        double smallest = longest;
        for (int i = 0; i < LANES; ++i) smallest = std::min(smallest, first[i]);
        return smallest;
    }

    // Halves the step until it gains 90 percent of what was predicted or the next halving does worse.
    // Moves x and raises quality where something was gained; false: nothing was.
    bool search(const Star<D>& star, Vec<D>& x, double& quality, const Vec<D>& direction, double slope,
                double step) const {
        const double start = std::sqrt(quality);
        Vec<D> best = x;
        double best_quality = quality;
        for (; step >= ACTIVE_MIN_STEP; step *= 0.5) {
            const Vec<D> trial = star.snap(x + step * direction);
            const double trial_quality = min_sine2<D>(star, trial, best_quality);
            if (!(trial_quality > best_quality)) {
                if (best_quality > quality) break;
                continue;
            }
            best = trial;
            best_quality = trial_quality;
            if (std::sqrt(trial_quality) - start >= ACTIVE_ACCEPT * step * slope) break;
        }
        const bool gained = best_quality > quality;
        x = best;
        quality = best_quality;
        return gained;
    }
};

}  // namespace meshfix
