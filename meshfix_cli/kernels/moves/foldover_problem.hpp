// The foldover-free energy as a function of the free vertices of a region, each of which may be bound to a ball.
//
// Its variables are the positions, in the unit of the region from its origin; where there are balls, points u of all of
// space: the position is centre + radius u / sqrt(1 + u^2). Or vertices begin outside of the balls and are drawn in:
// then the variables are the positions, and to the energy comes
//
//     pull * sum over free vertices of  max(0, |x - centre| / (FOLDOVER_INNER radius) - 1)^2.
//
// Where targets differ much, each vertex has a unit of its own, in which the energy is about as stiff as for any other.
#pragma once

#include <numeric>
#include <vector>

#include "measures/measures.hpp"
#include "moves/foldover.hpp"
#include "moves/lbfgs.hpp"

namespace meshfix {

// What a region is given as, in model units: points (n, D), the `free` ones first; simplices (m, D+1) and the numbers of
// their targets; a ball for each free vertex; an infinite radius: none. Where vertices are `drawn`, they may be outside.
// `freedom`: where the free ones may go, from where they are; null: anywhere.
template <int D>
struct FoldoverRegion {
    const double* points;
    std::int64_t n;
    const std::int32_t* simplices;
    const double* targets;
    std::int64_t m;
    const double* centres;
    std::int64_t free;
    double radius;
    bool drawn;
    const Freedom* freedom;
};

template <int D, class Target>
class FoldoverProblem {
 public:
    static constexpr int DIMENSION = D;
    Regularisation regularisation{1.0, 1.0};
    double gain = 0.0;  // share of the energy of the inverted simplices by which an iteration must lower it, to go on
    double pull = 0.0;  // with which vertices are drawn into their balls
    bool until_valid = true;  // whether the first valid points are enough

    FoldoverProblem(const FoldoverRegion<D>& region, int threads)
        : energy_(region.simplices, region.m, region.n),
          free_(region.free),
          threads_(threads),
          points_(region.points, region.points + region.n * D),
          local_(region.n * D),
          targets_(region.targets, region.targets + region.m * Target::NUMBERS),
          centres_(region.centres, region.centres + region.free * D),
          reach_(region.radius),
          drawn_(region.drawn),
          parts_(region.free / PER_ITEM + 1) {
        for (std::int64_t s = 0; s < region.m; ++s) unit_ += Target::size(target(s)) / static_cast<double>(region.m);
        for (std::int64_t s = 0; s < region.m; ++s) Target::divide(target(s), unit_);
        if constexpr (Target::SCALED) find_scales();
        if (region.freedom != nullptr) energy_.constrain(*region.freedom);
        for (std::int64_t i = 0; i < region.n * D; ++i) origin_[i % D] += points_[i] / static_cast<double>(region.n);
        for (std::int64_t v = 0; v < region.n; ++v) save(to_local(load<D>(points_.data() + v * D)), local_.data(), v);
        radius_ = reach_ / unit_;
    }

    // The variables at the points of the region. Those on the rim of a ball would be infinite: they are drawn inside.
    Numbers start() const {
        constexpr double INSIDE = 0.99;
        Numbers u(free_ * D);
        for_each_free([&](std::int64_t v) {
            Vec<D> x = load<D>(local_.data() + v * D);
            if (bound()) {
                x = (1.0 / radius_) * (x - centre(v));
                const double length = std::sqrt(norm2(x)), drawn = smaller(1.0, INSIDE / larger(length, INSIDE));
                x = drawn * x;
                x = (1.0 / std::sqrt(1.0 - norm2(x))) * x;
            }
            if constexpr (Target::SCALED) x = (1.0 / scales_[v]) * x;
            save(x, u.data(), v);
        });
        return u;
    }

    double operator()(const double* u, double* gradient) {
        for_each_free([&](std::int64_t v) { save(position(v, variable(u, v)), local_.data(), v); });
        last_ = energy_.evaluate(local_.data(), targets_.data(), regularisation, free_, gradient, threads_);
        if (bound()) {
            for_each_free(
                [&](std::int64_t v) { save(pulled_back(variable(u, v), load<D>(gradient + v * D)), gradient, v); });
        }
        if (drawn_) last_.energy += draw(gradient);
        if constexpr (Target::SCALED)
            for_each_free([&](std::int64_t v) { save(scales_[v] * load<D>(gradient + v * D), gradient, v); });
        valid_ = until_valid && last_.min_det > 0.0 && is_valid();
        ++evaluations_;
        return last_.energy;
    }

    bool enough() const { return valid_; }
    double least_gain() const { return larger(FOLDOVER_EXACT * last_.energy, gain * last_.of_inverted); }
    double min_det() const { return last_.min_det; }
    std::int64_t evaluations() const { return evaluations_; }

    // The free points (free, D) as they were seen last, in model units.
    std::vector<double> free_points() {
        place();
        return {points_.begin(), points_.begin() + free_ * D};
    }

 private:
    double* target(std::int64_t s) { return targets_.data() + s * Target::NUMBERS; }

    void find_scales() {
        std::vector<double> stiffness(free_, 0.0);
        const auto& corners = energy_.simplices();
        for (std::size_t i = 0; i < corners.size(); ++i)
            if (corners[i] < free_) stiffness[corners[i]] += Target::stiffness(target(i / (D + 1)), i % (D + 1));
        for (double each : stiffness) scales_.push_back(1.0 / std::sqrt(each));
    }

    // The vertex's variable without its unit.
    Vec<D> variable(const double* u, std::int64_t v) const {
        if constexpr (Target::SCALED) return scales_[v] * load<D>(u + v * D);
        return load<D>(u + v * D);
    }

    void place() {
        for_each_free([&](std::int64_t v) {
            Vec<D> x = load<D>(local_.data() + v * D);
            for (int k = 0; k < D; ++k) x[k] = origin_[k] + unit_ * x[k];
            const Vec<D> centre = load<D>(centres_.data() + v * D);
            const bool outside = bound() && std::sqrt(norm2(x - centre)) > reach_;  // by rounding
            save(outside ? centre : x, points_.data(), v);
        });
    }

    template <class F>
    void for_each_free(const F& f) const {
        for_each_range(free_, PER_ITEM, threads_, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t v = begin; v < end; ++v) f(v);
        });
    }

    static void save(const Vec<D>& x, double* to, std::int64_t v) { std::copy(x.begin(), x.end(), to + v * D); }

    bool bound() const { return reach_ < INFINITY && !drawn_; }

    Vec<D> to_local(const Vec<D>& x) const { return (1.0 / unit_) * (x - origin_); }
    Vec<D> centre(std::int64_t v) const { return to_local(load<D>(centres_.data() + v * D)); }

    Vec<D> position(std::int64_t v, const Vec<D>& u) const {
        return bound() ? centre(v) + (radius_ / std::sqrt(1.0 + norm2(u))) * u : u;
    }

    // The gradient by u of a function whose gradient by the position is given.
    Vec<D> pulled_back(const Vec<D>& u, const Vec<D>& slope) const {
        const double square = 1.0 + norm2(u);
        return (radius_ / std::sqrt(square)) * (slope - (dot(u, slope) / square) * u);
    }

    // What draws vertices into the balls; its gradient is added.
    double draw(double* gradient) {
        const double inner = FOLDOVER_INNER * radius_;
        for_each_range(free_, PER_ITEM, threads_, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
            parts_[item] = 0.0;
            for (std::int64_t v = begin; v < end; ++v) {
                const Vec<D> way = load<D>(local_.data() + v * D) - centre(v);
                const double length = std::sqrt(norm2(way)), excess = length / inner - 1.0;
                if (!(excess > 0.0)) continue;
                parts_[item] += pull * excess * excess;
                save(load<D>(gradient + v * D) + (2.0 * pull * excess / (inner * length)) * way, gradient, v);
            }
        });
        return std::accumulate(parts_.begin(), parts_.end(), 0.0);
    }

    bool is_inside() const {
        for (std::int64_t v = 0; v < free_; ++v)
            if (std::sqrt(norm2(load<D>(points_.data() + v * D) - load<D>(centres_.data() + v * D))) > reach_) return false;
        return true;
    }

    // By the predicate of the whole package, where the points will be stored.
    bool is_valid() {
        place();
        return (!drawn_ || is_inside()) && check<D>(points_.data(), energy_.simplices().data(), energy_.size(), threads_).inverted.empty();
    }

    Foldover<D, Target> energy_;
    std::int64_t free_, evaluations_ = 0;
    int threads_;
    std::vector<double> points_, local_, targets_, centres_, scales_;
    double reach_, unit_ = 0.0, radius_ = INFINITY;
    bool drawn_;
    std::vector<double> parts_;  // of what draws, for each item
    Vec<D> origin_{};
    EnergyValue last_;
    bool valid_ = false;
};

}  // namespace meshfix
