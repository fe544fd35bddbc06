// An energy of curved elements that is small where no Bezier coefficient of det J is small:
//
//     sum over elements of  mean over coefficients of (1 + t^2) / chi(t)
//                           + STRAIGHT sum over directions of mean |D - D0|^2 / mean |D0|^2,
//     t = (b / size - floor) / (1 - floor),   chi(t) = (t + sqrt(eps^2 + t^2)) / 2,
//
// D are the differences of control points, D0 those of the straight element at rest, and `size` its det J: t is 1 where the
// element is straight. Where nodes are bound to balls, their variables are points w of all of space: the position is
// centre + radius w / sqrt(1 + w^2). The first term is that of foldover.hpp for the measure; the second keeps the shape. Where all t are
// positive every coefficient is larger than floor * size. For shapes the floor is that of the scaled Jacobians at the nodes: another
// mean of such terms, over these, beside that of the coefficients with a floor of their own.
//
// LANES elements of a type are looked at side by side; sums are over the elements, one behind the other.
#pragma once

#include <optional>
#include <vector>

#include "common/numbers.hpp"
#include "quadratic/mesh.hpp"
#include "moves/foldover.hpp"
#include "quadratic/jacobians.hpp"

namespace meshfix {

struct QuadraticGoal {
    double eps = 1.0, floor = 0.0;
    std::optional<double> kept{};  // for shapes, the floor of the coefficients
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
            if (groups_.empty() || groups_.back().count == LANES || mesh.codes[elements_.back()] != mesh.codes[e])
                groups_.push_back({static_cast<std::int32_t>(elements_.size())});
            ++groups_.back().count;
            elements_.push_back(static_cast<std::int32_t>(e));
            free_.push_back(here);
            sizes_.push_back(sizes[e]);
            slopes_at_.push_back(slopes_at_.back() + mesh.type(e).nodes);
        }
        for (Group& group : groups_) prepare(group, rest);
        start_ = points_;
        radius_ = reach.radius;
        centre_in(reach);
        parts_.resize(elements_.size());
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
        for_each_range(static_cast<std::int64_t>(groups_.size()), QUADRATIC_PER_ITEM / LANES, threads_,
                       [&](std::int64_t begin, std::int64_t end, std::int64_t) {
                           for (std::int64_t i = begin; i < end; ++i) look_at(groups_[i]);
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
    using Parts = QuadraticParts<D, R, Pack>;
    using Nodes = QuadraticNodes<D, R, Pack>;

    // Up to LANES elements of a type side by side; the last one fills what is left.
    struct Group {
        std::int32_t first;
        int count = 0;
        std::size_t rest = 0, on = 0, nodes_on = 0;  // where its differences at rest begin, and its lanes of coefficients and nodes
        Pack to_b{};
        std::array<Pack, 3> stiffness{};  // for each direction what |D - D0|^2 is multiplied by
    };

    std::int32_t element(const Group& group, int lane) const { return group.first + std::min(lane, group.count - 1); }
    const QuadraticType& type_of(const Group& group) const { return mesh_->type(elements_[group.first]); }

    Nodes local(const Group& group, const double* points) const {
        Nodes found;
        std::array<const std::int32_t*, LANES> nodes;
        std::array<Vec<D>, LANES> origin;
        for (int lane = 0; lane < LANES; ++lane) {
            nodes[lane] = mesh_->nodes_of(elements_[element(group, lane)]);
            origin[lane] = load<D>(points + static_cast<std::int64_t>(nodes[lane][0]) * D);
        }
        for (int i = 0; i < type_of(group).nodes; ++i)
            for (int k = 0; k < D; ++k)
                found[i][k] = gathered([&](int lane) { return points[static_cast<std::int64_t>(nodes[lane][i]) * D + k] - origin[lane][k]; });
        return found;
    }

    void prepare(Group& group, const double* rest) {
        const QuadraticType& type = type_of(group);
        const Parts parts(type, straightened<D, R>(type, local(group, rest)));
        group.rest = rest_.size();
        for (int j = 0; j < D; ++j) {
            const auto count = type.difference[j].size();
            rest_.insert(rest_.end(), parts.difference[j].begin(), parts.difference[j].begin() + count);
            Pack sum = constant<Pack>(0.0);
            for (std::size_t p = 0; p < count; ++p) sum += type.share2[j][p] * norm2(parts.difference[j][p]);
            const Pack zero = constant<Pack>(0.0);
            group.stiffness[j] = select(sum > zero, constant<Pack>(QUADRATIC_STRAIGHT) / sum, zero);
        }
        group.to_b = gathered([&](int lane) { return 1.0 / sizes_[element(group, lane)]; });
        group.on = on_.size();
        for (const NodeSet& nodes : type.depends) on_.push_back(lanes(group, nodes));
        group.nodes_on = on_.size();
        for (const NodeSet& nodes : type.node_depends) on_.push_back(lanes(group, nodes));
    }

    // The lanes, as bits, in which one of some nodes is free.
    std::uint8_t lanes(const Group& group, const NodeSet& nodes) const {
        unsigned found = 0;
        for (int lane = 0; lane < LANES; ++lane)
            found |= static_cast<unsigned>((nodes & free_[element(group, lane)]).any()) << lane;
        return static_cast<std::uint8_t>(found);
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

    void look_at(const Group& group) {
        const QuadraticType& type = type_of(group);
        const Parts parts(type, local(group, points_.data()));
        Term of_coefficients(goal.eps, goal.kept.value_or(goal.floor), type.coefficients);
        std::array<Pack, R::COEFFICIENTS> slope;
        for (int k = 0; k < type.coefficients; ++k)
            slope[k] = group.to_b * of_coefficients.slope(group.to_b * parts.coefficient[k], on_[group.on + k]);
        Nodes slopes = parts.slopes(slope);
        Pack energy = of_coefficients.mean() + straightness(group, parts, slopes), smallest = of_coefficients.smallest;
        if (goal.kept) {
            const Pack zero = constant<Pack>(0.0);
            Term of_jacobians(goal.eps, goal.floor, type.nodes);
            add_shapes(group, parts, of_jacobians, slopes);
            energy += of_jacobians.mean();
            smallest = select(smallest > *goal.kept, of_jacobians.smallest, smaller(zero, of_jacobians.smallest));
        }
        for (int lane = 0; lane < group.count; ++lane) {
            const std::int32_t i = group.first + lane;
            parts_[i] = {energy[lane], smallest[lane]};
            Vec<D>* to = slopes_.data() + slopes_at_[i];
            for (int node = 0; node < type.nodes; ++node)
                for (int k = 0; k < D; ++k) to[node][k] = slopes[node][k][lane];
        }
    }

    // The mean of (1 + t^2) / chi(t) over values that should be above a floor, and the smallest of them.
    struct Term {
        double eps, floor, to_t, share;
        Pack sum = constant<Pack>(0.0), smallest = constant<Pack>(INFINITY);

        Term(double eps_, double floor_, int count) : eps(eps_), floor(floor_), to_t(1.0 / (1.0 - floor_)), share(1.0 / count) {}

        Pack mean() const { return share * sum; }

        // Takes in a value in lanes where something can be done about it; returns the slope of the mean by it.
        Pack slope(Pack b, unsigned lanes) {
            const Pack zero = constant<Pack>(0.0);
            if (lanes == 0) return zero;
            const Pack t = to_t * (b - floor);
            const Chi<Pack> chi(t, eps);
            Pack value = (constant<Pack>(1.0) + t * t) * chi.inverse;
            Pack slope = (share * to_t) * (2.0 * t * chi.inverse - value * chi.decay);
            if (lanes != (1U << LANES) - 1) {
                const PackMask on = gathered([&](int lane) { return static_cast<double>(lanes >> lane & 1U); }) > zero;
                value = select(on, value, zero);
                slope = select(on, slope, zero);
                b = select(on, b, constant<Pack>(INFINITY));
            }
            sum += value;
            smallest = select(b >= smallest, smallest, b);
            return slope;
        }
    };

    void add_shapes(const Group& group, const Parts& parts, Term& term, Nodes& slopes) const {
        QuadraticDifferences<D, R, Pack> pull;
        for (int j = 0; j < D; ++j) clear(pull[j], static_cast<int>(parts.type->difference[j].size()));
        for (int node = 0; node < parts.type->nodes; ++node) {
            const unsigned lanes = on_[group.nodes_on + node];
            if (lanes == 0) continue;
            const SmoothJacobian<D, Pack> here(*parts.type, parts.at_node(node));
            const Pack by = term.slope(here.value, lanes);
            for (int j = 0; j < D; ++j)
                for (const Share& one : parts.type->at_node[node][j]) pull[j][one.of] = pull[j][one.of] + (one.weight * by) * here.slope[j];
        }
        parts.add_to_nodes(pull, slopes);
    }

    Pack straightness(const Group& group, const Parts& parts, Nodes& slopes) const {
        const Vec<D, Pack>* rest = rest_.data() + group.rest;
        QuadraticDifferences<D, R, Pack> pull;
        Pack sum = constant<Pack>(0.0);
        for (int j = 0; j < D; ++j)
            for (std::size_t p = 0; p < parts.type->difference[j].size(); ++p) {
                const Vec<D, Pack> off = parts.difference[j][p] - *rest++;
                const Pack stiffness = parts.type->share2[j][p] * group.stiffness[j];
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
    std::vector<Group> groups_;
    std::vector<Vec<D, Pack>> rest_;   // differences at rest, of one group behind the other
    std::vector<std::uint8_t> on_;
    std::vector<Vec<D>> slopes_;       // of nodes, of one element behind the other
    std::vector<std::size_t> slopes_at_{0};
    std::vector<Part> parts_;
    std::vector<Vec<D>> centre_, inside_;  // of the balls, and the variables of these at the start
    double radius_ = INFINITY;
    double last_ = 0.0, smallest_ = INFINITY;
};

}  // namespace meshfix
