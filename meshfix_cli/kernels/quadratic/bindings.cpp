// Bindings of what is known of curved elements.
#include <nanobind/stl/optional.h>

#include <numeric>
#include <optional>
#include <variant>

#include "arrays.hpp"
#include "quadratic/energy.hpp"
#include "quadratic/proofs.hpp"
#include "quadratic/sweep.hpp"
#include "moves/lbfgs.hpp"

namespace meshfix {

namespace {

// Calls f with the dimension and the room that the elements of a mesh need.
template <class F>
auto with_room(const QuadraticMesh& mesh, std::size_t d, const F& f) {
    return with_dimension(d, [&](auto dimension) {
        return mesh.is_of_second_order() ? f(dimension, SecondOrder{}) : f(dimension, AnyOrder{});
    });
}

// places (nodes, coordinates): see quadratic/shapes.hpp.
void init_type(QuadraticType* self, const std::vector<int>& factors, int order, const Matrix<const double>& places, double weight) {
    QuadraticShape shape{std::accumulate(factors.begin(), factors.end(), 0), factors, {}, weight, order, {}};
    for (std::size_t i = 0; i < places.shape(0); ++i)
        shape.places.emplace_back(places.data() + i * places.shape(1), places.data() + (i + 1) * places.shape(1));
    if (places.shape(0) > AnyOrder::NODES) throw nb::value_error("the type has too many nodes");
    std::size_t controls = 1;
    for (const int factor : factors)
        for (int k = 1; k <= factor; ++k) controls = controls * static_cast<std::size_t>(order + k) / static_cast<std::size_t>(k);
    if (order > 2 && places.shape(0) != controls) throw nb::value_error("the type has not as many nodes as control points");
    new (self) QuadraticType(shape);
    const auto differences = [self](int j) { return static_cast<int>(self->difference[j].size()); };
    if (self->coefficients > AnyOrder::COEFFICIENTS || self->normals > AnyOrder::NORMALS ||
        std::max({differences(0), differences(1), differences(2)}) > AnyOrder::DIFFERENCES) {
        self->~QuadraticType();
        throw nb::value_error("the order of the type is too high");
    }
}

void init_mesh(QuadraticMesh* self, const Vector<const std::uint8_t>& codes, const Vector<const std::int32_t>& nodes, std::int64_t n,
               const std::vector<const QuadraticType*>& types) {
    new (self) QuadraticMesh(codes.data(), static_cast<std::int64_t>(codes.shape(0)), nodes.data(),
                             static_cast<std::int64_t>(nodes.shape(0)), n, types);
}

auto judge_py(const QuadraticMesh& self, const Matrix<const double>& points, int threads,
              const std::optional<Vector<const std::int32_t>>& some) {
    std::vector<std::int32_t> elements(some ? some->shape(0) : self.size());
    if (some)
        std::copy_n(some->data(), elements.size(), elements.begin());
    else
        std::iota(elements.begin(), elements.end(), 0);
    QuadraticJudgement found = with_room(self, points.shape(1), [&](auto dimension, auto room) {
        constexpr int D = dimension;
        return judge<D, decltype(room)>(self, points.data(), elements, threads);
    });
    return std::make_tuple(to_numpy(std::move(found.verdict)), to_numpy(std::move(found.smallest)),
                           to_numpy(std::move(found.measure)), to_numpy(std::move(found.quality)));
}

// A number (m) of each element: f(its dimension, its room, which it is).
template <class F>
auto of_elements(const QuadraticMesh& self, const Matrix<const double>& points, int threads, const F& f) {
    std::vector<double> found(self.size());
    with_room(self, points.shape(1), [&](auto dimension, auto room) {
        for_each_range(self.size(), QUADRATIC_PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t e = begin; e < end; ++e) found[e] = f(dimension, room, e);
        });
    });
    return to_numpy(std::move(found));
}

auto sizes_py(const QuadraticMesh& self, const Matrix<const double>& points, int threads) {
    return of_elements(self, points, threads, [&](auto dimension, auto room, std::int64_t e) {
        constexpr int D = dimension;
        using R = decltype(room);
        return straight_size<D, R>(self.type(e), self.local<D, R>(points.data(), e));
    });
}

// The smallest scaled Jacobian of each element at nodes where it depends on no free node: infinite where there are none.
auto ceilings_py(const QuadraticMesh& self, const Matrix<const double>& points, const Vector<const std::uint8_t>& free, int threads) {
    return of_elements(self, points, threads, [&](auto dimension, auto room, std::int64_t e) {
        constexpr int D = dimension;
        using R = decltype(room);
        const QuadraticParts<D, R> parts(self.type(e), self.local<D, R>(points.data(), e));
        return scaled_jacobian(parts, self.marked(free.data(), e));
    });
}

// The smallest coefficient of each element, relative to sizes, of those that depend on a free node or of those that do not.
auto smallest_py(const QuadraticMesh& self, const Matrix<const double>& points, const Vector<const double>& sizes,
                 const Vector<const std::uint8_t>& free, bool of_free, int threads) {
    return of_elements(self, points, threads, [&](auto dimension, auto room, std::int64_t e) {
        constexpr int D = dimension;
        using R = decltype(room);
        const QuadraticParts<D, R> parts(self.type(e), self.local<D, R>(points.data(), e));
        const NodeSet here = self.marked(free.data(), e);
        double smallest = INFINITY;
        for (int i = 0; i < parts.type->coefficients; ++i)
            if ((parts.type->depends[i] & here).any() == of_free) smallest = std::min(smallest, parts.coefficient[i] / sizes.data()[e]);
        return smallest;
    });
}

auto relocate_py(const QuadraticMesh& self, const Matrix<const double>& points, const Vector<const double>& sizes,
                 const Vector<const std::uint8_t>& free, const Vector<const std::int32_t>& nodes, const Matrix<const double>& start, double reach,
                 double goal, bool tied, int halvings) {
    std::vector<double> moved(points.data(), points.data() + points.size());
    const std::int64_t count = with_room(self, points.shape(1), [&](auto dimension, auto room) {
        constexpr int D = dimension;
        QuadraticSweep<D, decltype(room)> sweep(self, moved.data(), sizes.data(), free.data(), {start.data(), reach}, goal, tied, halvings);
        return sweep.visit(nodes.data(), static_cast<std::int64_t>(nodes.shape(0)));
    });
    return std::make_pair(to_numpy(std::move(moved), points.shape(1)), count);
}

auto impossible_py(const QuadraticMesh& self, const Matrix<const double>& points, const Vector<const std::uint8_t>& free) {
    return to_numpy(with_room(self, points.shape(1), [&](auto dimension, auto room) {
        constexpr int D = dimension;
        return QuadraticProofs<D, decltype(room)>(self, points.data(), free.data()).find();
    }));
}

template <int D>
using OneElement = QuadraticParts<D, AnyOrder>;

template <int D>
OneElement<D> parts_of(const QuadraticMesh& mesh, const Matrix<const double>& rows) {
    return OneElement<D>(mesh.type(0), mesh.local<D, AnyOrder>(rows.data(), 0));
}

auto coefficients_py(const QuadraticMesh& self, const Matrix<const double>& points) {
    return to_numpy(with_dimension(points.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        const auto parts = parts_of<D>(self, points);
        return std::vector<double>(parts.coefficient.begin(), parts.coefficient.begin() + parts.type->coefficients);
    }));
}

auto columns_py(const QuadraticMesh& self, const Matrix<const double>& points, const Vector<const double>& shares) {
    return to_numpy(with_dimension(points.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        const auto parts = parts_of<D>(self, points);
        std::array<double, AnyOrder::NODES> share{};
        std::copy_n(shares.data(), std::min<std::size_t>(shares.shape(0), AnyOrder::NODES), share.begin());
        std::vector<double> found;
        for (const Vec<D>& gradient : parts.gradients(share)) found.insert(found.end(), gradient.begin(), gradient.end());
        found.resize(parts.type->coefficients * D);
        return found;
    }), points.shape(1));
}

// For each type its dimension, the corners of whose mean each node is in the straight element, and the weight.
auto shapes_py() {
    std::vector<std::tuple<int, std::vector<std::vector<int>>, double>> table;
    for (const QuadraticShape& shape : quadratic_shapes()) table.emplace_back(shape.dimension, shape.between, shape.weight);
    return table;
}

struct PyQuadraticEnergy {
    template <int D, class R>
    using Minimiser = Lbfgs<QuadraticEnergy<D, R>>;
    std::variant<Minimiser<2, SecondOrder>, Minimiser<3, SecondOrder>, Minimiser<2, AnyOrder>, Minimiser<3, AnyOrder>> minimiser;
};

void init_energy(PyQuadraticEnergy* self, const QuadraticMesh& mesh, const Matrix<const double>& points, const Matrix<const double>& rest,
                 const Vector<const double>& sizes, const Vector<const std::uint8_t>& free, const Matrix<const double>& start, double reach,
                 int threads) {
    new (self) PyQuadraticEnergy(with_room(mesh, points.shape(1), [&](auto dimension, auto room) {
        constexpr int D = dimension;
        using R = decltype(room);
        QuadraticEnergy<D, R> energy(mesh, points.data(), rest.data(), sizes.data(), free.data(), {start.data(), reach}, threads);
        const std::int64_t size = energy.size();
        return PyQuadraticEnergy{PyQuadraticEnergy::Minimiser<D, R>(std::move(energy), size, threads)};
    }));
}

auto minimise_py(PyQuadraticEnergy& self, double eps, double floor, int iterations, std::optional<double> kept) {
    const nb::gil_scoped_release release;
    return std::visit([&](auto& lbfgs) {
        lbfgs.function().goal = {eps, floor, kept};
        const double before = lbfgs.start(), after = lbfgs.minimise(iterations);
        return std::make_tuple(before, after, lbfgs.function().smallest());
    }, self.minimiser);
}

auto points_py(PyQuadraticEnergy& self, std::size_t dimension) {
    return std::visit([&](auto& lbfgs) { return to_numpy(std::vector<double>(lbfgs.function().points()), dimension); }, self.minimiser);
}

// The energy and its gradient at displacements of the free nodes, each in its own unit.
auto evaluate_py(PyQuadraticEnergy& self, const Vector<const double>& variables, double eps, double floor, std::optional<double> kept) {
    std::vector<double> gradient(variables.shape(0));
    const double value = std::visit([&](auto& lbfgs) {
        auto& energy = lbfgs.function();
        if (static_cast<std::int64_t>(variables.shape(0)) != energy.size()) throw nb::value_error("the variables are of another mesh");
        energy.goal = {eps, floor, kept};
        return energy(variables.data(), gradient.data());
    }, self.minimiser);
    return std::make_pair(value, to_numpy(std::move(gradient)));
}

}  // namespace

void bind_quadratic(nb::module_& m) {
    m.attr("QUADRATIC_SHAPES") = nb::cast(shapes_py());
    m.attr("QUADRATIC_PROVED") = QUADRATIC_PROVED;
    nb::class_<QuadraticType>(m, "QuadraticType")
        .def("__init__", &init_type, "factors"_a, "order"_a, "places"_a.noconvert(), "weight"_a);
    nb::class_<QuadraticMesh>(m, "QuadraticMesh")
        .def("__init__", &init_mesh, "codes"_a.noconvert(), "nodes"_a.noconvert(), "n"_a, "types"_a = std::vector<const QuadraticType*>(),
             nb::keep_alive<1, 5>())
        .def("coefficients", &coefficients_py, "points"_a.noconvert())
        .def("columns", &columns_py, "points"_a.noconvert(), "shares"_a.noconvert())
        .def("judge", &judge_py, "points"_a.noconvert(), "threads"_a, "elements"_a = nb::none())
        .def("ceilings", &ceilings_py, "points"_a.noconvert(), "free"_a.noconvert(), "threads"_a)
        .def("sizes", &sizes_py, "points"_a.noconvert(), "threads"_a)
        .def("smallest", &smallest_py, "points"_a.noconvert(), "sizes"_a.noconvert(), "free"_a.noconvert(), "of_free"_a, "threads"_a)
        .def("relocate", &relocate_py, "points"_a.noconvert(), "sizes"_a.noconvert(), "free"_a.noconvert(), "nodes"_a.noconvert(),
             "start"_a.noconvert(), "reach"_a, "goal"_a, "tied"_a, "halvings"_a = 0)
        .def("impossible", &impossible_py, "points"_a.noconvert(), "free"_a.noconvert());
    nb::class_<PyQuadraticEnergy>(m, "QuadraticEnergy")
        .def("__init__", &init_energy, "mesh"_a, "points"_a.noconvert(), "rest"_a.noconvert(), "sizes"_a.noconvert(),
             "free"_a.noconvert(), "start"_a.noconvert(), "reach"_a, "threads"_a, nb::keep_alive<1, 2>())
        .def("minimise", &minimise_py, "eps"_a, "floor"_a, "iterations"_a, "kept"_a = nb::none())
        .def("evaluate", &evaluate_py, "variables"_a.noconvert(), "eps"_a, "floor"_a, "kept"_a = nb::none())
        .def("points", &points_py, "dimension"_a);
}

}  // namespace meshfix
