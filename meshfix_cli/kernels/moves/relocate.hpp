// One call relocates the vertices of one colour class of blocks, in order inside a block (Gauss-Seidel), the
// blocks over threads. Blocks of one colour share no edge, so the result does not depend on the threads.
#pragma once

#include "common/parallel.hpp"
#include "measures/bezier.hpp"
#include "mesh/order.hpp"
#include "moves/active_set.hpp"
#include "moves/come_back.hpp"
#include "moves/laplacian.hpp"
#include "moves/mean_ratio.hpp"
#include "moves/most.hpp"
#include "moves/nearness.hpp"
#include "moves/programme.hpp"

namespace meshfix {

enum class Move : int {
    laplacian, untangle, combined_untangle, smart_laplacian, combined_smooth, untangle_heights, mean_ratio, raise_smallest,
    come_back, untangle_coefficients, draw_back, untangle_most
};

// What a sweep knows of each vertex. One is due until it has been visited, and again when it or a neighbour moves:
// elsewhere a visit would find what the last one did.
constexpr std::uint8_t HELD = 0, DONE = 1, DUE = 2;

// Blocks of one colour may have neighbours in common, but read none of their states.
inline void make_neighbours_due(const StarsView& stars, std::uint8_t* states, std::int64_t v) {
    for (std::int32_t i = stars.neighbour_offsets[v]; i < stars.neighbour_offsets[v + 1]; ++i) {
        std::uint8_t& state = states[stars.neighbours[i]];
        if (load_relaxed(state) == DONE) store_relaxed(state, DUE);
    }
}

struct Counts {
    std::int64_t visited = 0, moved = 0;
};

template <int D>
struct Relocation {
    StarsView stars;
    double* points;        // (n, D), moved in place
    std::uint8_t* states;  // (n) HELD, DONE or DUE
    Parameters parameters;

    Star<D> star{};
    Programme<D> program{};
    MostOfStar<D> most{};
    ActiveSet<D> active_set{};
    std::vector<Affine<D>> functions{};

    // Calls f(code, nodes, position of v) for each element of v whose corners do not say all, its nodes in the local frame.
    template <class F>
    void for_each_curved(std::int64_t v, const F& f) const {
        std::int32_t last = -1;
        for (std::int32_t i = stars.offsets[v]; i < stars.offsets[v + 1]; ++i) {  // elements lie one behind the other
            const std::int32_t e = stars.element_of(stars.corners[i], D + 1);
            if (std::exchange(last, e) == e || stars.elements->codes[e] < WEDGE) continue;
            std::array<Vec<D>, MOST_NODES> nodes;
            int here = 0;
            for (int k = 0; k < stars.elements->shape(e).nodes; ++k) {
                const std::int64_t node = stars.elements->nodes_of(e)[k];
                nodes[k] = star.to_local(load<D>(points + node * D));
                if (node == v) here = k;
            }
            f(stars.elements->codes[e], nodes, here);
        }
    }

    // The last point on the way from the position to x, halved a few times, where no element is lost that was valid inside,
    // and facets stay near the reference.
    Vec<D> guarded(std::int64_t v, const Vec<D>& x) const {
        const bool curved = star.directions.curved(), has_inside = D == 3 && stars.elements != nullptr;
        if (!curved && !has_inside) return x;
        // On a surface a place half-way is not as good as both ends for being between them.
        const double least = curved ? std::min(min_sine2<D>(star, x, 0.0), min_sine2<D>(star, star.position, 0.0)) : 0.0;
        Vec<D> trial = x;
        for (int halvings = 0; halvings < GUARD_TRIALS; ++halvings) {
            const bool good = !curved || (min_sine2<D>(star, trial, least * (1.0 - SAME_SINE2)) > 0.0 && nearness().is_near(v, star.to_global(trial)));
            if (good && (!has_inside || loses_nothing(v, trial))) return trial;
            trial = star.snap(star.position + 0.5 * (trial - star.position));
        }
        return star.position;
    }

    // Where a vertex comes to be that is drawn to x: on a reference, halved a few times, where the smallest determinant is no
    // smaller than `least`; and while the star is valid, facets stay near the reference.
    Vec<D> reached(std::int64_t v, const Vec<D>& x, double least) const {
        if (!star.directions.curved()) return star.landing(x);
        const bool valid = star.valid(star.position);
        Vec<D> trial = star.snap(x);
        for (int halvings = 0; halvings < GUARD_TRIALS; ++halvings) {
            const bool good = !(min_det(trial) < least);
            const Vec<D> there = star.to_global(trial);
            if (good && (valid ? nearness().is_near(v, there) : nearness().is_in_reach(v, there))) return there;
            trial = star.snap(star.position + 0.5 * (trial - star.position));
        }
        return load<D>(points + v * D);
    }

    Nearness<D> nearness() const { return {points, parameters}; }

    bool loses_nothing(std::int64_t v, const Vec<D>& x) const {
        bool lost = false;
        for_each_curved(v, [&](std::uint8_t code, std::array<Vec<D>, MOST_NODES>& nodes, int here) {
            if constexpr (D == 3) {
                if (lost) return;
                const Vec<D> before = std::exchange(nodes[here], x);
                if (is_certified(code, nodes.data())) return;
                nodes[here] = before;
                lost = is_certified(code, nodes.data());
            }
        });
        return !lost;
    }

    // The programme of the paper with the Bezier coefficients of the elements as its columns: where its optimum is
    // positive, all elements of the star are valid, at their corners and inside. Where corners say all, they are these.
    bool untangle_coefficients(std::int64_t v) {
        if (D == 2 || stars.elements == nullptr) return untangle_heights(v);
        if constexpr (D == 3) {
            functions.clear();
            for_each_affine(v, [&](double value, const Vec<D>& gradient) { functions.push_back({value, gradient}); });
            for (const bool heights : {true, false}) {
                const bool solved = program.solve(star, functions, heights);
                if (solved && (program.smallest > 0.0 || !heights)) return store(v, optimum(v));
            }
        }
        return false;
    }

    // All coefficients that depend on v, of elements of any shape.
    template <class F>
    void for_each_affine(std::int64_t v, const F& f) const {
        for (int i = 0; i < star.faces_count; ++i) {
            if (stars.elements->codes[stars.element_of(stars.corners[stars.offsets[v] + i], D + 1)] >= WEDGE) continue;
            const Edges<D> e = star.edges(i, Vec<D>{});
            f(determinant(e), determinant_slope(e));
        }
        for_each_curved(v, [&](std::uint8_t code, const std::array<Vec<D>, MOST_NODES>& nodes, int here) {
            for_each_dependent_coefficient(code, nodes.data(), here, f);
        });
    }

    bool store(std::int64_t v, const Vec<D>& x) {
        const bool changed = place(v, x);
        if (changed) make_due(v);
        return changed;
    }

    Vec<D> mean_of_neighbours(std::int64_t v) {
        star.directions.set_anywhere();
        if (parameters.freedom == nullptr || parameters.freedom->anywhere(v)) return centroid<D>(stars, points, v);
        star.directions.set(*parameters.freedom, v, load<D>(parameters.start + v * D));
        return centroid<D>(*parameters.freedom, star.directions, points, v);
    }

    bool place(std::int64_t v, Vec<D> x) {
        if (parameters.max_move < INFINITY) x = within_reach(v, x);
        x = star.directions.with_kept(x);
        bool changed = false;
        for (int k = 0; k < D; ++k) {
            changed |= points[v * D + k] != x[k];
            points[v * D + k] = x[k];
        }
        return changed;
    }

    void make_due(std::int64_t v) const {
        if (states[v] != HELD) states[v] = DUE;
        make_neighbours_due(stars, states, v);
    }

    // The last point in reach on the way to x. The smallest measure is concave (theorem 2.1) and the level sets of
    // the smallest sine are convex (3.2): on the way to a better position every point is no worse than the first.
    Vec<D> within_reach(std::int64_t v, const Vec<D>& x) const {
        const Vec<D> start = load<D>(parameters.start + v * D), from = load<D>(points + v * D), way = x - from;
        const double reach2 = parameters.max_move * parameters.max_move;
        if (norm2(x - start) <= reach2) return x;
        const Vec<D> off = from - start;
        const double b = dot(off, way), a = norm2(way), c = std::min(0.0, norm2(off) - reach2);
        double share = (std::sqrt(b * b - a * c) - b) / a;
        for (int trial = 0; trial < 60; ++trial, share *= 1.0 - std::ldexp(1e-15, trial)) {
            const Vec<D> last = from + share * way;
            if (norm2(last - start) <= reach2) return last;
        }
        return from;
    }

    // To the optimum of the linear programme. Also where the smallest measure stays the same: of many optima the
    // move to another is what frees collapsed clusters in a later sweep.
    bool untangle(std::int64_t v) {
        return program.solve(star, false) && store(v, optimum(v));
    }

    // That of the programme, as near as the vertex may go.
    Vec<D> optimum(std::int64_t v) const {
        return reached(v, program.position, star.directions.curved() ? min_det(star.position) : 0.0);
    }

    // The largest smallest height where that makes the star valid, else the largest smallest measure: heights alone
    // diverge on hard tangles.
    bool untangle_heights(std::int64_t v) {
        if (!program.solve(star, true) || !(program.smallest > 0.0)) return untangle(v);
        return store(v, optimum(v));
    }

    // Where not all elements of the star can be right, to where fewer of them are wrong.
    bool untangle_most(std::int64_t v) {
        if (star.valid(star.position)) return false;
        most.set(star, stars, v);
        const int wrong = most.wrong_at(star.position);
        if (!most.solve(star, program, wrong)) return false;
        Vec<D> there = reached(v, program.position, -INFINITY);
        if (parameters.max_move < INFINITY) there = within_reach(v, there);
        return most.wrong_at(star.to_local(there)) < wrong && store(v, there);
    }

    // Section 4, CS: Laplacian smoothing, then untangling where the star is still invalid.
    bool combined_untangle(std::int64_t v) {
        const bool moved = store(v, star.directions.anywhere() ? star.origin : reached(v, star.centre, -INFINITY));
        star.position = star.to_local(load<D>(points + v * D));
        return (star.valid(star.position) ? false : untangle(v)) || moved;
    }

    // Section 3.3: smart Laplacian first, the active-set method where the star stays below the threshold. A cluster
    // pinched almost flat holds that up; the linear programme frees it.
    bool smooth(std::int64_t v, bool optimise) {
        double quality = min_sine2<D>(star, star.position, 0.0);
        if (!(quality > 0.0)) return false;  // only valid stars are smoothed
        return take(v, smoothed(quality, optimise));
    }

    // The active-set method where the star is below the threshold, nothing elsewhere.
    bool raise_smallest(std::int64_t v) {
        double quality = min_sine2<D>(star, star.position, 0.0);
        if (!(quality > 0.0 && quality < parameters.threshold_sine2)) return false;
        return take(v, smoothed(quality, true));
    }

    bool smooth_mean(std::int64_t v) {
        const double quality = min_sine2<D>(star, star.position, 0.0), floor = parameters.threshold_sine2;
        if (!(quality > 0.0)) return false;
        const auto reachable = [&](const Vec<D>& x) {
            const Vec<D> there = star.landing(x);
            const bool cut = parameters.max_move < INFINITY && !star.directions.curved();
            return star.to_local(cut ? within_reach(v, there) : there);
        };
        return take(v, star.roles.empty() ? improve_mean<D, MeanRatio<D>>(star, quality, floor, reachable)
                                          : improve_mean<D, ElementRatio<D>>(star, quality, floor, reachable));
    }

    // As far back to the start as makes no determinant smaller than `min_det`; all the way to its very bits.
    bool come_back(std::int64_t v) {
        const Vec<D> start = load<D>(parameters.start + v * D), target = star.to_local(start);
        if (target == star.position || !star.valid(star.position)) return false;
        const double scale = D == 2 ? star.unit * star.unit : star.unit * star.unit * star.unit;
        const double share = share_of_way<D>(star, target, parameters.min_det / scale);
        if (share < LEAST_SHARE) return false;
        const Vec<D> x = share == 1.0 ? target : star.snap(star.position + share * (target - star.position));
        if (stars.elements != nullptr && !loses_nothing(v, x)) return false;
        if (star.directions.curved() && !nearness().is_near(v, star.to_global(x))) return false;
        return star.valid(x) && store(v, share == 1.0 ? start : star.to_global(x));
    }

    // To where facets that are too far from their shapes are least so, of some places on the way to the start and to the mean
    // of the neighbours; in a valid star, which stays valid.
    bool draw_back(std::int64_t v) {
        const Vec<D> here = load<D>(points + v * D);
        const Nearness<D> near = nearness();
        if (near.is_within(parameters.freedom->bound2, v, here) || !star.valid(star.position)) return false;
        Vec<D> best = here;
        double least = near.deviation2_at(v, here);
        for (const Vec<D>& target : {star.to_local(load<D>(parameters.start + v * D)), star.centre}) {
            Vec<D> trial = star.snap(target);
            for (int halvings = 0; halvings < GUARD_TRIALS; ++halvings) {
                const Vec<D> there = star.to_global(trial);
                const bool good = star.valid(trial) && near.is_in_reach(v, there) && near.is_within(DRAWN_BACK * least, v, there);
                if (good && (D == 2 || stars.elements == nullptr || loses_nothing(v, trial))) {
                    best = there;
                    least = near.deviation2_at(v, there);
                }
                trial = star.snap(star.position + 0.5 * (trial - star.position));
            }
        }
        return best != here && store(v, best);
    }

    Vec<D> smoothed(double quality, bool optimise) {
        Vec<D> x = smart_laplacian(star, quality);
        if (optimise && quality < LP_PINCHED_SINE2) x = smart_programme(x, quality);
        if (optimise && quality < parameters.threshold_sine2) x = active_set.improve(star, x, quality);
        return x;
    }

    bool take(std::int64_t v, const Vec<D>& wanted) {
        if (wanted == star.position) return false;
        const Vec<D> x = guarded(v, wanted);
        return x == star.position || makes_smaller(x) ? false : store(v, star.to_global(x));
    }

    // To the largest smallest height, where that raises the smallest sine.
    Vec<D> smart_programme(const Vec<D>& x, double& quality) {
        if (!program.solve(star, true)) return x;
        const Vec<D> trial = star.snap(program.position);
        const double there = min_sine2<D>(star, trial, quality);
        if (!(there > quality)) return x;
        quality = there;
        return trial;
    }

    bool makes_smaller(const Vec<D>& x) const {
        if (parameters.min_det == -INFINITY) return false;
        const double after = min_det(x), scale = D == 2 ? star.unit * star.unit : star.unit * star.unit * star.unit;
        return after * scale < parameters.min_det && after < min_det(star.position);
    }

    double min_det(const Vec<D>& x) const {
        double smallest = INFINITY;
        for (int i = 0; i < star.faces_count; ++i) smallest = std::min(smallest, determinant(star.edges(i, x)));
        return smallest;
    }

    void relocate(Move move, std::int64_t v, Counts& counts) {
        ++counts.visited;
        const bool curved = parameters.freedom != nullptr && parameters.freedom->shape(v) >= 0;
        if (move == Move::laplacian && !curved) {  // nearly all move: all stay due
            counts.moved += place(v, mean_of_neighbours(v));
            return;
        }
        if (move != Move::laplacian) states[v] = DONE;
        if (move == Move::draw_back && !curved) return;
        star.gather(stars, parameters.freedom, parameters.start, points, v);
        switch (move) {
            case Move::untangle: counts.moved += untangle(v); break;
            case Move::combined_untangle: counts.moved += combined_untangle(v); break;
            case Move::smart_laplacian: counts.moved += smooth(v, false); break;
            case Move::combined_smooth: counts.moved += smooth(v, true); break;
            case Move::untangle_heights: counts.moved += untangle_heights(v); break;
            case Move::mean_ratio: counts.moved += smooth_mean(v); break;
            case Move::raise_smallest: counts.moved += raise_smallest(v); break;
            case Move::come_back: counts.moved += come_back(v); break;
            case Move::untangle_coefficients: counts.moved += untangle_coefficients(v); break;
            case Move::draw_back: counts.moved += draw_back(v); break;
            case Move::untangle_most: counts.moved += untangle_most(v); break;
            case Move::laplacian: counts.moved += place(v, reached(v, star.centre, -INFINITY)); break;
        }
    }
};

// What a sweep works on.
struct Sweep {
    StarsView stars;
    double* points;
    std::uint8_t* states;
    std::int64_t n;
    Parameters parameters;
};

// blocks (count): numbers of the blocks to visit, of one colour. `prepare` gives a worker what else it needs.
template <class Work, class F>
Counts relocate(Move move, const Sweep& sweep, const std::int32_t* blocks, std::int64_t count, int threads, const F& prepare) {
    std::vector<Counts> counts(count);
    for_each_item(count, threads, [&](std::int64_t item) {
        thread_local Work work;
        work.stars = sweep.stars;
        work.points = sweep.points;
        work.states = sweep.states;
        work.parameters = sweep.parameters;
        prepare(work);
        Counts mine;  // of its own: threads that write side by side in memory wait for one another
        const std::int64_t begin = blocks[item] * BLOCK_SIZE;
        for (std::int64_t v = begin; v < std::min(sweep.n, begin + BLOCK_SIZE); ++v)
            if (sweep.states[v] == DUE) work.relocate(move, v, mine);
        counts[item] = mine;
    });
    Counts total;
    for (const auto& c : counts) {
        total.visited += c.visited;
        total.moved += c.moved;
    }
    return total;
}

}  // namespace meshfix
