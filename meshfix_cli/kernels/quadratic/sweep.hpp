// The linear programme of the paper for one node of curved elements: each Bezier coefficient of their Jacobian
// determinants is affine in it, also where nodes on the edges of a corner go along with that. Where its optimum is
// positive, that is a certificate for all of these elements.
#pragma once

#include <vector>

#include "quadratic/mesh.hpp"
#include "moves/linear_program.hpp"

namespace meshfix {

// What a sweep does: nodes whose elements have a coefficient below the goal, relative to the size, are visited one after the
// other. `tied`: nodes of edges and faces go along with the corners that they are means of.
template <int D, class R>
class QuadraticSweep {
   public:
    QuadraticSweep(const QuadraticMesh& mesh, double* points, const double* sizes, const std::uint8_t* free, QuadraticReach reach,
                   double goal, bool tied)
        : mesh_(&mesh), points_(points), sizes_(sizes), free_(free), reach_(reach), goal_(goal), tied_(tied) {}

    // Visits nodes (k), corners or others; returns how many moved.
    std::int64_t visit(const std::int32_t* nodes, std::int64_t count) {
        std::int64_t moved = 0;
        for (std::int64_t i = 0; i < count; ++i) moved += relocate(nodes[i]);
        return moved;
    }

   private:
    // The elements that change when a node moves by x, and by how much of that their nodes do.
    struct Touched {
        std::int32_t element;
        std::array<double, R::NODES> share;
    };

    bool relocate(std::int32_t v) {
        gather(v);
        const Vec<D> here = load<D>(points_ + static_cast<std::int64_t>(v) * D);
        functions_.clear();
        neighbours_.clear();
        double radius = 0.0, smallest = INFINITY;
        for (const Touched& one : touched_) {
            const QuadraticType& type = mesh_->type(one.element);
            QuadraticNodes<D, R> nodes;
            for (int k = 0; k < type.nodes; ++k) {
                nodes[k] = load<D>(points_ + static_cast<std::int64_t>(mesh_->nodes_of(one.element)[k]) * D) - here;
                neighbours_.push_back(nodes[k]);
                radius = std::max(radius, std::sqrt(norm2(nodes[k])));
            }
            const QuadraticParts<D, R> parts(type, nodes);
            const auto gradients = parts.gradients(one.share);
            const double scale = 1.0 / sizes_[one.element];
            double longest2 = 0.0;
            for (int i = 0; i < type.coefficients; ++i) longest2 = std::max(longest2, norm2(gradients[i]));
            for (int i = 0; i < type.coefficients; ++i) {
                if (!(norm2(gradients[i]) > LP_PINNED2 * longest2)) continue;
                functions_.push_back({scale * parts.coefficient[i], scale * gradients[i]});
                smallest = std::min(smallest, functions_.back().value);
            }
        }
        if (!(smallest < goal_) || functions_.empty()) return false;
        program_.set(neighbours_, radius, functions_, false);
        if (program_.solve() != LpStatus::optimal || !(program_.pi[D] > smallest + QUADRATIC_GAIN)) return false;
        return move(program_.position());
    }

    // The node, and those that are tied to it, in all of their elements.
    void gather(std::int32_t v) {
        touched_.clear();
        moving_.clear();
        moving_.push_back({v, 1.0});
        if (tied_) find_tied(v);
        for (const auto& [node, share] : moving_)
            for (std::int32_t i = mesh_->at_offsets[node]; i < mesh_->at_offsets[node + 1]; ++i) {
                const std::int32_t place = mesh_->at[i], e = mesh_->owners[place];
                auto found = std::find_if(touched_.begin(), touched_.end(), [e = e](const Touched& one) { return one.element == e; });
                if (found == touched_.end()) {
                    touched_.push_back({e, {}});
                    found = touched_.end() - 1;
                }
                found->share[place - mesh_->offsets[e]] = share;
            }
    }

    void find_tied(std::int32_t v) {
        for (std::int32_t i = mesh_->at_offsets[v]; i < mesh_->at_offsets[v + 1]; ++i) {
            const std::int32_t place = mesh_->at[i], e = mesh_->owners[place];
            const QuadraticType& type = mesh_->type(e);
            const int here = place - mesh_->offsets[e];
            for (int k = type.corners; k < type.nodes; ++k) {
                const auto& between = type.between[k];
                const std::int32_t node = mesh_->nodes_of(e)[k];
                const auto share = std::find_if(between.begin(), between.end(), [here](const Share& one) { return one.of == here; });
                if (!free_[node] || share == between.end()) continue;
                const bool known = std::any_of(moving_.begin(), moving_.end(), [node](const auto& one) { return one.first == node; });
                if (!known) moving_.emplace_back(node, share->weight);
            }
        }
    }

    // The smallest coefficient is concave along the way: a part of it is no worse than none.
    bool move(const Vec<D>& x) {
        double part = 1.0;
        for (const auto& [node, share] : moving_) part = std::min(part, within_reach(node, share * x));
        bool changed = false;
        for (const auto& [node, share] : moving_)
            for (int k = 0; k < D; ++k) {
                double& coordinate = points_[static_cast<std::int64_t>(node) * D + k];
                const double before = coordinate;
                coordinate += part * share * x[k];
                changed |= coordinate != before;
            }
        return changed;
    }

    // The share of a step that leads a node no farther than it may go.
    double within_reach(std::int32_t node, const Vec<D>& step) const {
        if (!(reach_.radius < INFINITY)) return 1.0;
        constexpr double INSIDE = 1.0 - 1e-9;
        const std::int64_t at = static_cast<std::int64_t>(node) * D;
        const Vec<D> off = load<D>(points_ + at) - load<D>(reach_.centres + at);
        const double reach2 = INSIDE * reach_.radius * reach_.radius;
        if (norm2(off + step) <= reach2) return 1.0;
        const double a = norm2(step), b = dot(off, step), c = std::min(0.0, norm2(off) - reach2);
        return std::max(0.0, (std::sqrt(b * b - a * c) - b) / a);
    }

    const QuadraticMesh* mesh_;
    double* points_;
    const double* sizes_;
    const std::uint8_t* free_;
    QuadraticReach reach_;
    double goal_;
    bool tied_;
    std::vector<Touched> touched_;
    std::vector<std::pair<std::int32_t, double>> moving_;
    std::vector<Vec<D>> neighbours_;
    std::vector<Affine<D>> functions_;
    LinearProgram<D> program_;
};

}  // namespace meshfix
