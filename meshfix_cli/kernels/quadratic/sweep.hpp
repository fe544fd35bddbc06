// The linear programme of the paper for one node of curved elements: each Bezier coefficient of their Jacobian
// determinants is affine in it, also where nodes on the edges of a corner go along with that. Where its optimum is
// positive, that is a certificate for all of these elements.
#pragma once

#include <vector>

#include "quadratic/mesh.hpp"
#include "moves/linear_program.hpp"

namespace meshfix {

// What a sweep does: nodes whose elements have a coefficient below the goal, relative to the size, are visited one after the
// other. `tied`: nodes of edges and faces go along with the corners that they are means of. Elements with such a coefficient are
// halved so many times: those of their parts are nearer to det J.
template <int D, class R>
class QuadraticSweep {
   public:
    QuadraticSweep(const QuadraticMesh& mesh, double* points, const double* sizes, const std::uint8_t* free, QuadraticReach reach,
                   double goal, bool tied, int halvings)
        : mesh_(&mesh), points_(points), sizes_(sizes), free_(free), reach_(reach), goal_(goal), tied_(tied), halvings_(halvings) {}

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
        double radius = 0.0;
        for (const Touched& one : touched_) {
            const QuadraticType& type = mesh_->type(one.element);
            QuadraticNodes<D, R> nodes;
            for (int k = 0; k < type.nodes; ++k) {
                nodes[k] = load<D>(points_ + static_cast<std::int64_t>(mesh_->nodes_of(one.element)[k]) * D) - here;
                neighbours_.push_back(nodes[k]);
                radius = std::max(radius, std::sqrt(norm2(nodes[k])));
            }
            const QuadraticParts<D, R> parts(type, nodes);
            std::array<double, R::NODES> share;
            for (int c = 0; c < type.controls; ++c) share[c] = parts.weighted(type.control_of_nodes[c], one.share);
            const double scale = 1.0 / sizes_[one.element];
            if (halvings_ > 0 && scale * parts.smallest() < goal_)
                add_halves({parts.control, {1.0, 1.0, 1.0, 1.0, 1.0, 1.0}}, share, type, scale, halvings_);
            else
                add(parts, share, scale);
        }
        double smallest = INFINITY;
        for (const auto& function : functions_) smallest = std::min(smallest, function.value);
        if (!(smallest < goal_) || functions_.empty()) return false;
        program_.set(neighbours_, radius, functions_, false);
        if (program_.solve() != LpStatus::optimal || !(program_.pi[D] > smallest + QUADRATIC_GAIN)) return false;
        return move(program_.position());
    }

    // Adds the coefficients that depend on the node, where the control points move by their shares.
    void add(const QuadraticParts<D, R>& parts, const std::array<double, R::NODES>& share, double scale) {
        const auto gradients = parts.gradients_of_controls(share);
        const int count = parts.type->coefficients;
        double longest2 = 0.0;
        for (int i = 0; i < count; ++i) longest2 = std::max(longest2, norm2(gradients[i]));
        for (int i = 0; i < count; ++i)
            if (norm2(gradients[i]) > LP_PINNED2 * longest2) functions_.push_back({scale * parts.coefficient[i], scale * gradients[i]});
    }

    // Those of the halves of a part of an element, and of their halves; in the parameters each is half as large as the part.
    void add_halves(const QuadraticPart<D, R>& part, const std::array<double, R::NODES>& share, const QuadraticType& type, double scale,
                    int halvings) {
        if (halvings == 0) return add(QuadraticParts<D, R>::of_controls(type, part.control), share, scale);
        const std::size_t longest = part.longest(type);
        for (int kept = 0; kept < 2; ++kept) {
            std::array<double, R::NODES> of_half;
            for (int c = 0; c < type.controls; ++c) of_half[c] = QuadraticParts<D, R>::weighted(type.halves[longest][kept][c], share);
            add_halves(part.half(type, longest, kept), of_half, type, 2.0 * scale, halvings - 1);
        }
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
    int halvings_;
    std::vector<Touched> touched_;
    std::vector<std::pair<std::int32_t, double>> moving_;
    std::vector<Vec<D>> neighbours_;
    std::vector<Affine<D>> functions_;
    LinearProgram<D> program_;
};

}  // namespace meshfix
