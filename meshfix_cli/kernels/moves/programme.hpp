// The linear programme of one star in the directions that its vertex has: with x = base + B y the functions are affine in
// y as well, and have the gradients B^T n. Those that hardly depend on y leave the programme, which they would pin.
#pragma once

#include <vector>

#include "moves/linear_program.hpp"

namespace meshfix {

template <int D>
class Programme {
   public:
    Vec<D> position{};      // of the optimum, in the local frame of the star
    double smallest = 0.0;  // of the functions there: determinants or, with `heights`, heights

    // Whether there is an optimum; of the determinants of the star's faces.
    bool solve(const Star<D>& star, bool heights) {
        if (star.directions.anywhere()) {
            anywhere_.set(star, heights);
            return take(anywhere_);
        }
        take_faces(star, faces_);
        return solve(star, faces_, heights);
    }

    // Of other affine functions, values at the origin and gradients.
    bool solve(const Star<D>& star, const std::vector<Affine<D>>& functions, bool heights) {
        if (star.directions.anywhere()) {
            anywhere_.set(star.neighbours, star.radius, functions, heights);
            return take(anywhere_);
        }
        if (D == 3 && star.directions.count == 2) return solve_along(plane_, in_plane_, star, functions, heights);
        return solve_along(line_, in_line_, star, functions, heights);
    }

   private:
    template <int K>
    struct Along {
        std::vector<Vec<K>> neighbours;
        std::vector<Affine<K>> functions;
    };

    bool take(LinearProgram<D>& program) {
        if (program.solve() != LpStatus::optimal) return false;
        position = program.position();
        smallest = program.pi[D];
        return true;
    }

    template <int K>
    bool solve_along(LinearProgram<K>& program, Along<K>& along, const Star<D>& star,
                     const std::vector<Affine<D>>& functions, bool heights) {
        const Directions<D>& directions = star.directions;
        const auto coordinates = [&](const Vec<D>& v) {
            Vec<K> y;
            for (int k = 0; k < K; ++k) y[k] = dot(directions.axes[k], v);
            return y;
        };
        along.neighbours.clear();
        for (const Vec<D>& p : star.neighbours) along.neighbours.push_back(coordinates(p - star.centre));
        along.functions.clear();
        for (const Affine<D>& f : functions) {
            const Vec<K> slope = coordinates(f.gradient);
            if (norm2(slope) > LP_PINNED2 * norm2(f.gradient))
                along.functions.push_back({f.value + dot(f.gradient, star.centre), slope});
        }
        if (along.functions.empty()) return false;
        program.set(along.neighbours, star.radius, along.functions, heights);
        if (program.solve() != LpStatus::optimal) return false;
        const Vec<K> y = program.position();
        position = star.centre;
        for (int k = 0; k < K; ++k) position = position + y[k] * directions.axes[k];
        smallest = program.pi[K];
        return true;
    }

    LinearProgram<D> anywhere_{};
    LinearProgram<2> plane_{};
    LinearProgram<1> line_{};
    Along<2> in_plane_{};
    Along<1> in_line_{};
    std::vector<Affine<D>> faces_{};
};

}  // namespace meshfix
