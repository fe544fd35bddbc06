// A function of vertices, by variables of which one is about as much everywhere: the distance that a vertex goes by the
// size of what is around it. Where sizes differ, a minimiser that knows little of a function needs that.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "common/numbers.hpp"

namespace meshfix {

// A function that `Lbfgs` takes, and that has
//     std::int64_t size() const            of its vectors
//     std::vector<double> sizes() const    of what is around each vertex
template <class Function>
class Scaled {
 public:
    explicit Scaled(Function f)
        : f_(std::move(f)), sizes_(f_.sizes()), each_(sizes_.empty() ? 1 : f_.size() / static_cast<std::int64_t>(sizes_.size())),
          places_(f_.size()) {}

    std::int64_t size() const { return f_.size(); }

    Numbers start() const {
        Numbers x = f_.start();
        for (std::int64_t i = 0; i < size(); ++i) x.data()[i] /= at(i);
        return x;
    }

    double operator()(const double* x, double* gradient) {
        place(x);
        const double value = f_(places_.data(), gradient);
        for (std::int64_t i = 0; i < size(); ++i) gradient[i] *= at(i);
        return value;
    }

    bool enough() const { return f_.enough(); }
    double least_gain() const { return f_.least_gain(); }

    std::vector<double> free_points(const double* x) {
        place(x);
        return f_.free_points(places_.data());
    }

 private:
    double at(std::int64_t i) const { return sizes_[i / each_]; }
    void place(const double* x) {
        for (std::int64_t i = 0; i < size(); ++i) places_.data()[i] = at(i) * x[i];
    }

    Function f_;
    std::vector<double> sizes_;
    std::int64_t each_;  // variables of a vertex
    Numbers places_;
};

}  // namespace meshfix
