// One call relocates the vertices of one colour class of blocks, in order inside a block (Gauss-Seidel), the
// blocks over threads. Blocks of one colour share no edge, so the result does not depend on the threads.
#pragma once

#include "active_set.hpp"
#include "laplacian.hpp"
#include "linear_program.hpp"
#include "parallel.hpp"

namespace meshfix {

enum class Move : int { laplacian, untangle, combined_untangle, smart_laplacian, combined_smooth };

struct Parameters {
    double threshold_sine2;  // combined smoothing: the active-set method runs on stars below it
    bool only_invalid;       // visit only stars with an invalid simplex
};

struct Counts {
    std::int64_t visited = 0, moved = 0;
};

template <int D>
struct Relocation {
    StarsView stars;
    double* points;  // (n, D), moved in place
    Parameters parameters;

    Star<D> star{};
    LinearProgram<D> program{};
    ActiveSet<D> active_set{};

    bool store(std::int64_t v, const Vec<D>& x) {
        bool changed = false;
        for (int k = 0; k < D; ++k) {
            changed |= points[v * D + k] != x[k];
            points[v * D + k] = x[k];
        }
        return changed;
    }

    // To the optimum of the linear programme. Also where the smallest measure stays the same: of many optima the
    // move to another is what frees collapsed clusters in a later sweep.
    bool untangle(std::int64_t v) {
        program.set(star);
        if (program.solve() != LpStatus::optimal) return false;
        Vec<D> x;
        for (int k = 0; k < D; ++k) x[k] = program.pi[k];
        return store(v, star.to_global(x));
    }

    // Section 4, CS: Laplacian smoothing, then untangling where the star is still invalid.
    bool combined_untangle(std::int64_t v) {
        const bool moved = store(v, star.origin);
        star.position = Vec<D>{};
        return (star.valid(star.position) ? false : untangle(v)) || moved;
    }

    // Section 3.3: smart Laplacian first, the active-set method where the star stays below the threshold.
    bool smooth(std::int64_t v, bool optimise) {
        double quality = min_sine2<D>(star, star.position, 0.0);
        if (!(quality > 0.0)) return false;  // only valid stars are smoothed
        Vec<D> x = smart_laplacian(star, quality);
        if (optimise && quality < parameters.threshold_sine2) x = active_set.improve(star, x, quality);
        return x == star.position ? false : store(v, star.to_global(x));
    }

    void relocate(Move move, std::int64_t v, Counts& counts) {
        if (move == Move::laplacian && !parameters.only_invalid) {
            ++counts.visited;
            counts.moved += store(v, centroid<D>(stars, points, v));
            return;
        }
        star.gather(stars, points, v);
        if (parameters.only_invalid && star.valid(star.position)) return;
        ++counts.visited;
        switch (move) {
            case Move::laplacian: counts.moved += store(v, star.origin); break;
            case Move::untangle: counts.moved += untangle(v); break;
            case Move::combined_untangle: counts.moved += combined_untangle(v); break;
            case Move::smart_laplacian: counts.moved += smooth(v, false); break;
            case Move::combined_smooth: counts.moved += smooth(v, true); break;
        }
    }
};

// blocks (blocks_count): numbers of the blocks to visit, of one colour.
template <int D>
Counts relocate(Move move, const StarsView& stars, double* points, const std::uint8_t* movable,
                const std::int32_t* block_offsets, const std::int32_t* block_vertices, const std::int32_t* blocks,
                std::int64_t blocks_count, const Parameters& parameters, int threads) {
    std::vector<Counts> counts(blocks_count);
    for_each_item(blocks_count, threads, [&](std::int64_t item) {
        thread_local Relocation<D> work;
        work.stars = stars;
        work.points = points;
        work.parameters = parameters;
        const std::int32_t block = blocks[item];
        for (std::int32_t i = block_offsets[block]; i < block_offsets[block + 1]; ++i)
            if (movable[block_vertices[i]]) work.relocate(move, block_vertices[i], counts[item]);
    });
    Counts total;
    for (const auto& c : counts) {
        total.visited += c.visited;
        total.moved += c.moved;
    }
    return total;
}

}  // namespace meshfix
