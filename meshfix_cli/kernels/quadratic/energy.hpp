// An energy of curved elements that is small where no Bezier coefficient of det J is small:
//
//     sum over elements of  mean over coefficients of (1 + t^2) / chi(t)
//                           + STRAIGHT sum over directions of mean |D - D0|^2 / mean |D0|^2,
//     t = (b / size - floor) / (1 - floor),   chi(t) = (t + sqrt(eps^2 + t^2)) / 2,
//
// D are the differences of control points, D0 those of the straight element at rest, and `size` its det J: t is 1 where the
// element is straight. Where nodes are bound to balls, their variables are points w of all of space: the position is
// centre + radius w / sqrt(1 + w^2). The first term is that of foldover.hpp for the measure; the second keeps the shape. Where all t are
// positive every coefficient is larger than floor * size.
#pragma once

#include <vector>

#include "common/numbers.hpp"
#include "quadratic/mesh.hpp"
#include "moves/foldover.hpp"

namespace meshfix {

struct QuadraticGoal {
    double eps = 1.0, floor = 0.0;
};

// What is minimised over: the elements that have a free node. Variables are the steps of these from where they are, each in a
// unit of its own.
template <int D, class R>
class QuadraticEnergy {
   public:
    QuadraticGoal goal{};

    // rest (n, D): the corners of the straight elements; sizes (m): det J there; free (n).
    QuadraticEnergy(const QuadraticMesh& mesh, const double* points, const double* rest, const double* sizes, const std::uint8_t* free,
                    QuadraticReach reach, int threads)
        : mesh_(&mesh), points_(points, points + mesh.n * D), threads_(threads) {
        for (std::int64_t v = 0; v < mesh.n; ++v)
            if (free[v] && mesh.at_offsets[v] < mesh.at_offsets[v + 1]) moving_.push_back(static_cast<std::int32_t>(v));
        for (std::int64_t e = 0; e < mesh.size(); ++e) {
            const NodeSet here = mesh.marked(free, e);
            if (!here.any()) continue;
            elements_.push_back(static_cast<std::int32_t>(e));
            free_.push_back(here);
            sizes_.push_back(sizes[e]);
            at_rest(e, rest);
            slopes_at_.push_back(slopes_at_.back() + mesh.type(e).nodes);
        }
        start_ = points_;
        radius_ = reach.radius;
        centre_in(reach);
        parts_.resize(items());
        slopes_.resize(slopes_at_.back());
        place_of_.assign(mesh.size(), -1);
        for (std::size_t i = 0; i < elements_.size(); ++i) place_of_[elements_[i]] = static_cast<std::int32_t>(i);
        find_units();
    }

    std::int64_t size() const { return static_cast<std::int64_t>(moving_.size()) * D; }
    Numbers start() const { return Numbers(size()); }
    double smallest() const { return smallest_; }
    const std::vector<double>& points() const { return points_; }

    // Whether all coefficients that depend on a free node are above the floor.
    bool enough() const { return smallest_ > goal.floor; }
    double least_gain() const { return QUADRATIC_EXACT * last_; }

    double operator()(const double* u, double* gradient) {
        for (std::size_t i = 0; i < moving_.size(); ++i) place(i, unit_[i] * load<D>(u + i * D));
        for_each_range(static_cast<std::int64_t>(elements_.size()), QUADRATIC_PER_ITEM, threads_,
                       [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
                           Part part;
                           for (std::int64_t i = begin; i < end; ++i) look_at(i, part);
                           parts_[item] = part;
                       });
        for_each_range(static_cast<std::int64_t>(moving_.size()), PER_ITEM, threads_,
                       [&](std::int64_t begin, std::int64_t end, std::int64_t) {
                           for (std::int64_t i = begin; i < end; ++i) gather(i, gradient);
                       });
        last_ = 0.0;
        smallest_ = INFINITY;
        for (const Part& part : parts_) {
            last_ += part.energy;
            if (!(part.smallest >= smallest_)) smallest_ = part.smallest;
        }
        return last_;
    }

   private:
    struct Part {
        double energy = 0.0, smallest = INFINITY;
    };
    std::int64_t items() const { return (static_cast<std::int64_t>(elements_.size()) + QUADRATIC_PER_ITEM - 1) / QUADRATIC_PER_ITEM; }

    void at_rest(std::int64_t e, const double* rest) {
        const QuadraticType& type = mesh_->type(e);
        const QuadraticParts<D, R> parts(type, straightened<D, R>(type, mesh_->local<D, R>(rest, e)));
        std::array<double, 3> stiffness{};
        rest_at_.push_back(rest_.size());
        for (int j = 0; j < D; ++j) {
            rest_.insert(rest_.end(), parts.difference[j].begin(), parts.difference[j].begin() + type.difference[j].size());
            double sum = 0.0;
            for (std::size_t p = 0; p < type.difference[j].size(); ++p) sum += type.share2[j][p] * norm2(parts.difference[j][p]);
            stiffness[j] = sum > 0.0 ? QUADRATIC_STRAIGHT / sum : 0.0;
        }
        stiffness_.push_back(stiffness);
    }

    // The variables at the start, in balls, by nodes; those that are on the rim are drawn inside.
    void centre_in(QuadraticReach reach) {
        constexpr double INSIDE = 0.99;
        if (!(radius_ < INFINITY)) return;
        for (const std::int32_t v : moving_) {
            centre_.push_back(load<D>(reach.centres + static_cast<std::int64_t>(v) * D));
            Vec<D> w = (1.0 / radius_) * (load<D>(start_.data() + static_cast<std::int64_t>(v) * D) - centre_.back());
            w = smaller(1.0, INSIDE / larger(std::sqrt(norm2(w)), INSIDE)) * w;
            inside_.push_back((1.0 / std::sqrt(1.0 - norm2(w))) * w);
        }
    }

    // Puts a free node a step away from where it was; one that takes none keeps its bits.
    void place(std::size_t i, const Vec<D>& step) {
        const std::int64_t at = static_cast<std::int64_t>(moving_[i]) * D;
        const bool bound = !centre_.empty() && norm2(step) > 0.0;
        const Vec<D> w = bound ? inside_[i] + (1.0 / radius_) * step : step;
        const double shrink = bound ? radius_ / std::sqrt(1.0 + norm2(w)) : 1.0;
        for (int k = 0; k < D; ++k) points_[at + k] = (bound ? centre_[i][k] : start_[at + k]) + shrink * w[k];
    }

    // The gradient by a step of one by the position.
    Vec<D> by_step(std::int64_t i, const Vec<D>& slope) const {
        if (centre_.empty()) return slope;
        const Vec<D> x = (1.0 / radius_) * (load<D>(points_.data() + static_cast<std::int64_t>(moving_[i]) * D) - centre_[i]);
        const double left = std::sqrt(larger(1.0 - norm2(x), 0.0));  // 1 / sqrt(1 + w^2)
        return left * (slope - dot(x, slope) * x);
    }

    // The unit of each free node: the size of the smallest element that it is of.
    void find_units() {
        for (const std::int32_t v : moving_) {
            double least = INFINITY;
            for (std::int32_t i = mesh_->at_offsets[v]; i < mesh_->at_offsets[v + 1]; ++i) {
                const double size = sizes_[place_of_[mesh_->owners[mesh_->at[i]]]];
                least = std::min(least, D == 2 ? std::sqrt(size) : std::cbrt(size));
            }
            unit_.push_back(least);
        }
    }

    void look_at(std::int64_t i, Part& part) {
        const std::int32_t e = elements_[i];
        const QuadraticType& type = mesh_->type(e);
        const QuadraticParts<D, R> parts(type, mesh_->local<D, R>(points_.data(), e));
        std::array<double, R::COEFFICIENTS> slope;
        const double to_b = 1.0 / sizes_[i], to_t = 1.0 / (1.0 - goal.floor), share = 1.0 / type.coefficients;
        double sum = 0.0;
        for (int k = 0; k < type.coefficients; ++k) {
            const double b = parts.coefficient[k] * to_b, t = (b - goal.floor) * to_t;
            slope[k] = 0.0;
            if (!(type.depends[k] & free_[i]).any()) continue;  // nothing can be done about it
            const Chi<double> chi(t, goal.eps);
            const double value = (1.0 + t * t) * chi.inverse;
            sum += value;
            slope[k] = share * to_t * to_b * (2.0 * t * chi.inverse - value * chi.decay);
            if (!(b >= part.smallest)) part.smallest = b;
        }
        QuadraticNodes<D, R> slopes = parts.slopes(slope);
        part.energy += share * sum + straightness(i, parts, slopes);
        std::copy_n(slopes.begin(), type.nodes, slopes_.begin() + slopes_at_[i]);
    }

    double straightness(std::int64_t i, const QuadraticParts<D, R>& parts, QuadraticNodes<D, R>& slopes) const {
        const Vec<D>* rest = rest_.data() + rest_at_[i];
        std::array<std::array<Vec<D>, R::DIFFERENCES>, 3> pull;
        double sum = 0.0;
        for (int j = 0; j < D; ++j)
            for (std::size_t p = 0; p < parts.type->difference[j].size(); ++p) {
                const Vec<D> off = parts.difference[j][p] - *rest++;
                const double stiffness = parts.type->share2[j][p] * stiffness_[i][j];
                sum += stiffness * norm2(off);
                pull[j][p] = (2.0 * stiffness) * off;
            }
        parts.add_to_nodes(pull, slopes);
        return sum;
    }

    void gather(std::int64_t i, double* gradient) const {
        Vec<D> sum{};
        const std::int32_t v = moving_[i];
        for (std::int32_t k = mesh_->at_offsets[v]; k < mesh_->at_offsets[v + 1]; ++k) {
            const std::int32_t place = mesh_->at[k], e = mesh_->owners[place];
            sum = sum + slopes_[slopes_at_[place_of_[e]] + place - mesh_->offsets[e]];
        }
        sum = by_step(i, sum);
        for (int k = 0; k < D; ++k) gradient[i * D + k] = unit_[i] * sum[k];
    }

    const QuadraticMesh* mesh_;
    std::vector<double> points_, start_, sizes_, unit_;
    int threads_;
    std::vector<std::int32_t> moving_, elements_, place_of_;
    std::vector<NodeSet> free_;
    std::vector<Vec<D>> rest_, slopes_;                   // differences at rest, and slopes of nodes, of one element behind the other
    std::vector<std::size_t> rest_at_, slopes_at_{0};
    std::vector<std::array<double, 3>> stiffness_;        // for each direction what |D - D0|^2 is multiplied by
    std::vector<Part> parts_;
    std::vector<Vec<D>> centre_, inside_;  // of the balls, and the variables of these at the start
    double radius_ = INFINITY;
    double last_ = 0.0, smallest_ = INFINITY;
};

}  // namespace meshfix
