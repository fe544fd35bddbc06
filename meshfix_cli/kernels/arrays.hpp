// What all bindings share: numpy's arrays and ours, and the dimension as a compile-time constant.
//
// Python checks shapes, indices and finiteness before it calls; nothing in the bindings throws because of data, but for a
// star too large to number.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <vector>

namespace meshfix {

namespace nb = nanobind;
using namespace nb::literals;

// One for each folder of kernels.
void bind_mesh(nb::module_& m);
void bind_measures(nb::module_& m);
void bind_moves(nb::module_& m);
void bind_quadratic(nb::module_& m);
void bind_surface(nb::module_& m);
void bind_text(nb::module_& m);

template <class T>
using Matrix = nb::ndarray<T, nb::numpy, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <class T>
using Matrices = nb::ndarray<T, nb::numpy, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
template <class T>
using Vector = nb::ndarray<T, nb::numpy, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Hands the memory of a vector to numpy.
template <class T>
nb::capsule keep(std::vector<T>&& values, T*& data) {
    auto* owned = new std::vector<T>(std::move(values));
    data = owned->data();
    return nb::capsule(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
}

template <class T>
Vector<T> to_numpy(std::vector<T>&& values) {
    const std::size_t size = values.size();
    T* data = nullptr;
    const nb::capsule owner = keep(std::move(values), data);
    return Vector<T>(data, {size}, owner);
}

template <class T>
Matrix<T> to_numpy(std::vector<T>&& values, std::size_t columns) {
    const std::size_t rows = values.size() / columns;
    T* data = nullptr;
    const nb::capsule owner = keep(std::move(values), data);
    return Matrix<T>(data, {rows, columns}, owner);
}

template <class T, std::size_t COLUMNS>
Matrix<T> to_numpy(std::vector<std::array<T, COLUMNS>>&& values) {
    const std::size_t rows = values.size();
    std::array<T, COLUMNS>* data = nullptr;
    const nb::capsule owner = keep(std::move(values), data);
    return Matrix<T>(rows == 0 ? nullptr : data->data(), {rows, COLUMNS}, owner);
}

// Calls f with the dimension as a compile-time constant, without the interpreter lock.
template <class F>
auto with_dimension(std::size_t d, const F& f) {
    if (d != 2 && d != 3) throw nb::value_error("the dimension must be 2 or 3");
    const nb::gil_scoped_release release;
    return d == 2 ? f(std::integral_constant<int, 2>{}) : f(std::integral_constant<int, 3>{});
}

// The same for elements and for the space that they lie in: 2 and 3 are surfaces.
template <class F>
auto with_space(std::size_t d, std::size_t space, const F& f) {
    if (d == space) return with_dimension(d, [&](auto dimension) { return f(dimension, dimension); });
    if (d != 2 || space != 3) throw nb::value_error("surfaces have 2 dimensions in a space of 3");
    const nb::gil_scoped_release release;
    return f(std::integral_constant<int, 2>{}, std::integral_constant<int, 3>{});
}

}  // namespace meshfix
