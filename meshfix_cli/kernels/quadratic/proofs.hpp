// What cannot be valid as long as the fixed nodes of curved elements stay, wherever the others go.
//
// det J at a place of an element depends on some of its nodes. Where all of these are fixed and it is not positive, that is
// a proof. It is affine in each node, and at a corner in the tangent of each edge: where the elements around one free node,
// or around one edge whose tangent at an end is free, have places at which det J depends on nothing else that is free, a
// linear programme finds the position, or tangent, that makes the smallest of these largest. If that is not positive, the
// multipliers of its optimum are a proof that whatever is done, one of these elements is not valid.
#pragma once

#include <vector>

#include "quadratic/mesh.hpp"
#include "moves/linear_program.hpp"

namespace meshfix {

template <int D, class R>
class QuadraticProofs {
   public:
    // free (n).
    QuadraticProofs(const QuadraticMesh& mesh, const double* points, const std::uint8_t* free)
        : mesh_(&mesh), points_(points), free_(free), found_(mesh.size(), 0) {}

    // Marks the elements (m): 1, by themselves, 2, together with others.
    std::vector<std::uint8_t> find() {
        std::vector<std::uint8_t> seen(mesh_->n, 0);
        std::vector<std::int32_t> nodes;
        std::vector<Edge> edges;
        for (std::int32_t e = 0; e < mesh_->size(); ++e) {
            const QuadraticParts<D, R> parts(mesh_->type(e), mesh_->local<D, R>(points_, e));
            if (judge(parts) == Verdict::valid) continue;
            if (cannot_be_valid(e, parts)) found_[e] = 1;
            if (parts.type->order > QUADRATIC_PROVED) continue;
            for (int k = 0; k < parts.type->nodes; ++k) {
                const std::int32_t v = mesh_->nodes_of(e)[k];
                if (free_[v] && !seen[v]) nodes.push_back(v);
                seen[v] = 1;
            }
            for (int c = 0; c < parts.type->corners; ++c)
                if (const int k = open_at(e, c); k > 0) edges.push_back({mesh_->nodes_of(e)[c], mesh_->nodes_of(e)[k]});
        }
        for (const std::int32_t v : nodes) look_at_node(v);
        std::sort(edges.begin(), edges.end());
        edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
        for (const auto& [corner, nearest] : edges) look_at_tangent(corner, nearest);
        return found_;
    }

   private:
    using Edge = std::array<std::int32_t, 2>;  // a corner and the node nearest to it

    // Whether det J of an element that is not valid is so at a place that no free node changes; of one without free nodes always.
    bool cannot_be_valid(std::int32_t e, const QuadraticParts<D, R>& parts) const {
        const NodeSet free = mesh_->marked(free_, e);
        if (!free.any()) return true;
        if (parts.type->order > QUADRATIC_PROVED) return false;
        for (const auto& [place, depends] : mesh_->type(e).places())
            if (!(depends & free).any() && !(value(place, parts) > bound(place, parts))) return true;
        return false;
    }

    // At a corner what rounding leaves in doubt of a coefficient is, as in verdicts, not positive.
    static double bound(const Sum& place, const QuadraticParts<D, R>& parts) { return place.size() == 1 ? parts.doubt() : 0.0; }

    static double value(const Sum& place, const QuadraticParts<D, R>& parts) {
        double sum = 0.0;
        for (const Share& one : place) sum += one.weight * parts.coefficient[one.of];
        return sum;
    }

    // The nearest node of the one edge at a fixed corner whose tangent is free; 0: there is none, or are several.
    int open_at(std::int32_t e, int corner) const {
        const std::int32_t* nodes = mesh_->nodes_of(e);
        int open = 0;
        if (free_[nodes[corner]]) return 0;
        for (const auto& edge : mesh_->type(e).edges_at[corner]) {
            if (std::none_of(edge.begin(), edge.end(), [&](int k) { return free_[nodes[k]] != 0; })) continue;
            if (open > 0) return 0;
            open = edge[0];
        }
        return open;
    }

    // All places at which det J depends on one node, and on nothing else that is free.
    void look_at_node(std::int32_t v) {
        begin(v);
        for (std::int32_t i = mesh_->at_offsets[v]; i < mesh_->at_offsets[v + 1]; ++i) {
            const std::int32_t e = mesh_->owners[mesh_->at[i]], here = mesh_->at[i] - mesh_->offsets[e];
            NodeSet one;
            one.add(here);
            const NodeSet others = mesh_->marked(free_, e).without(one);
            std::vector<const Sum*> open;
            for (const auto& [place, depends] : mesh_->type(e).places())
                if ((depends & one).any() && !(depends & others).any()) open.push_back(&place);
            add(e, here, open);
        }
        prove();
    }

    // The places at a corner of elements of which one edge, the same, has a free tangent there.
    void look_at_tangent(std::int32_t corner, std::int32_t nearest) {
        begin(corner);
        for (std::int32_t i = mesh_->at_offsets[corner]; i < mesh_->at_offsets[corner + 1]; ++i) {
            const std::int32_t e = mesh_->owners[mesh_->at[i]], here = mesh_->at[i] - mesh_->offsets[e];
            const int open = here < mesh_->type(e).corners ? open_at(e, here) : 0;
            if (open == 0 || mesh_->nodes_of(e)[open] != nearest) continue;
            const Sum value{{mesh_->type(e).corner_coefficient[here], 1.0}};
            add(e, open, {&value});
        }
        prove();
    }

    void begin(std::int32_t v) {
        origin_ = load<D>(points_ + static_cast<std::int64_t>(v) * D);
        functions_.clear();
        owners_.clear();
        neighbours_.clear();
        radius_ = 0.0;
        smallest_ = INFINITY;
    }

    // Adds det J at places of an element as functions of one of its nodes, by the lengths of its edges.
    void add(std::int32_t e, int node, const std::vector<const Sum*>& places) {
        const QuadraticType& type = mesh_->type(e);
        // With what is hopeless nothing else has to agree.
        if (places.empty() || found_[e] == 1 || type.order > QUADRATIC_PROVED) return;
        const QuadraticParts<D, R> parts(type, mesh_->local<D, R>(points_, e));
        const double scale = type.doubt / parts.doubt();
        if (!(scale < INFINITY)) return;
        for (int k = 0; k < type.nodes; ++k) {
            neighbours_.push_back(load<D>(points_ + static_cast<std::int64_t>(mesh_->nodes_of(e)[k]) * D) - origin_);
            radius_ = std::max(radius_, std::sqrt(norm2(neighbours_.back())));
        }
        std::array<double, R::NODES> share{};
        share[node] = 1.0;
        const auto gradients = parts.gradients(share);
        for (const Sum* place : places) {
            Vec<D> gradient{};
            for (const Share& one : *place) gradient = gradient + one.weight * gradients[one.of];
            functions_.push_back({scale * value(*place, parts), scale * gradient});
            smallest_ = std::min(smallest_, functions_.back().value);
            owners_.push_back(e);
        }
    }

    // The programme: its optimum is not positive, and the columns of its basis say so.
    void prove() {
        if (smallest_ > VALID || functions_.empty()) return;  // here all are positive
        double largest = 0.0;
        for (const auto& one : functions_) largest = std::max(largest, std::sqrt(norm2(one.gradient)) * radius_);
        program_.set(neighbours_, FAR * radius_, functions_, false);
        if (program_.solve() != LpStatus::optimal || program_.pi[D] > LP_IMPOSSIBLE * largest) return;
        std::vector<std::int32_t> proof;
        for (int row = 0; row <= D; ++row) {
            if (!(program_.weight(row) > LP_RANK)) continue;
            if (program_.basis[row] >= program_.faces_count) return;  // a side of the box has a part in it: no proof
            proof.push_back(owners_[std::min<std::size_t>(program_.basis[row], owners_.size() - 1)]);
        }
        const bool alone = std::all_of(proof.begin(), proof.end(), [&](std::int32_t e) { return e == proof[0]; });
        for (const std::int32_t e : proof)
            if (found_[e] != 1) found_[e] = alone ? 1 : 2;
    }

    static constexpr double FAR = 10.0;  // of the elements' size, how far a node or a tangent may lead

    const QuadraticMesh* mesh_;
    const double* points_;
    const std::uint8_t* free_;
    std::vector<std::uint8_t> found_;
    Vec<D> origin_;
    std::vector<Affine<D>> functions_;
    std::vector<std::int32_t> owners_;  // of the functions
    std::vector<Vec<D>> neighbours_;
    double radius_, smallest_;
    LinearProgram<D> program_;
};

}  // namespace meshfix
