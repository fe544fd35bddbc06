// Scaled Jacobians at nodes of curved elements, as functions that are smooth.
#pragma once

#include "common/vec.hpp"
#include "mesh/simplex.hpp"
#include "quadratic/types.hpp"

namespace meshfix {

// A scaled Jacobian by the derivatives along all directions, and its slopes by these. Of the products of lengths at the corners of a
// factor that `longest_edges2` takes the largest of, it takes the norm of order 8: it is no larger then.
template <int D, class T>
struct SmoothJacobian {
    T value;
    Edges<D, T> slope;

    SmoothJacobian(const QuadraticType& type, const Edges<D, T>& derivatives) : e_(derivatives) {
        for (auto& one : half_) one = {};
        T product2 = constant<T>(1.0);
        int first = 0;
        for (const int n : type.factors) {
            product2 = product2 * (n == 1 ? along(first) : around(first, n));
            first += n;
        }
        const T scale = constant<T>(type.weight) / square_root(product2);
        value = scale * determinant(e_);
        const Edges<D, T> cofactors = determinant_slopes(e_);
        for (int j = 0; j < D; ++j) slope[j] = scale * cofactors[j] - value * half_[j];
    }

 private:
    Edges<D, T> e_, half_;  // the derivatives, and half of the slopes of the logarithm of the squared product by them

    T along(int j) {
        const T length2 = norm2(e_[j]);
        half_[j] = half_[j] + (constant<T>(1.0) / length2) * e_[j];
        return length2;
    }

    T around(int first, int n) {
        const auto towards = [&](int corner) { return corner == 0 ? Vec<D, T>{} : e_[first + corner - 1]; };
        std::array<T, 4> products;  // of the squared lengths of the edges at each corner, and then what these count
        std::array<std::array<T, 4>, 4> length2;
        products.fill(constant<T>(1.0));
        for (int a = 0; a < n; ++a)
            for (int b = a + 1; b <= n; ++b) {
                length2[a][b] = norm2(towards(b) - towards(a));
                for (const int end : {a, b}) products[end] = products[end] * length2[a][b];
            }
        T most = products[0], sum = constant<T>(0.0);
        for (int a = 1; a <= n; ++a) most = larger(most, products[a]);
        const T to_most = constant<T>(1.0) / most;
        for (int a = 0; a <= n; ++a) {
            products[a] = eighth_power(products[a] * to_most);
            sum = sum + products[a];
        }
        const T share = constant<T>(1.0) / sum;
        for (int a = 0; a < n; ++a)
            for (int b = a + 1; b <= n; ++b) {
                const Vec<D, T> pull = (share * (products[a] + products[b]) / length2[a][b]) * (towards(b) - towards(a));
                half_[first + b - 1] = half_[first + b - 1] + pull;
                if (a > 0) half_[first + a - 1] = half_[first + a - 1] - pull;
            }
        return most * square_root(square_root(square_root(sum)));
    }

    static T eighth_power(T x) {
        const T x2 = x * x, x4 = x2 * x2;
        return x4 * x4;
    }
};

}  // namespace meshfix
