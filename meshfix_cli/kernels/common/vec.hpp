// Small vectors of D coordinates; the scalar T is double or Pack.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "common/pack.hpp"

namespace meshfix {

template <int D, class T = double>
using Vec = std::array<T, D>;

template <int D>
inline Vec<D> load(const double* p) {
    Vec<D> v;
    for (int k = 0; k < D; ++k) v[k] = p[k];
    return v;
}

template <class T, std::size_t D>
inline std::array<T, D> operator-(const std::array<T, D>& a, const std::array<T, D>& b) {
    std::array<T, D> c;
    for (std::size_t k = 0; k < D; ++k) c[k] = a[k] - b[k];
    return c;
}

template <class T, std::size_t D>
inline std::array<T, D> operator+(const std::array<T, D>& a, const std::array<T, D>& b) {
    std::array<T, D> c;
    for (std::size_t k = 0; k < D; ++k) c[k] = a[k] + b[k];
    return c;
}

template <class T, std::size_t D>
inline std::array<T, D> operator*(T s, const std::array<T, D>& a) {
    std::array<T, D> c;
    for (std::size_t k = 0; k < D; ++k) c[k] = s * a[k];
    return c;
}

template <std::size_t D>
inline std::array<Pack, D> operator*(double s, const std::array<Pack, D>& a) {
    return constant<Pack>(s) * a;
}

template <class T, std::size_t D>
inline T dot(const std::array<T, D>& a, const std::array<T, D>& b) {
    T s = a[0] * b[0];
    for (std::size_t k = 1; k < D; ++k) s += a[k] * b[k];
    return s;
}

template <class T, std::size_t D>
inline T norm2(const std::array<T, D>& a) {
    return dot(a, a);
}

template <std::size_t D>
inline double largest_coordinate(const std::array<double, D>& a) {
    double m = 0.0;
    for (double x : a) m = std::max(m, std::fabs(x));
    return m;
}

template <class T>
inline T cross(const std::array<T, 2>& a, const std::array<T, 2>& b) {
    return a[0] * b[1] - a[1] * b[0];
}

template <class T>
inline std::array<T, 3> cross(const std::array<T, 3>& a, const std::array<T, 3>& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace meshfix
