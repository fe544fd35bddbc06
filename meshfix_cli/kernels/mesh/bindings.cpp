// Bindings of what a mesh is: its order, facets, stars and crossings.
#include <atomic>
#include <memory>

#include "mesh/crossings.hpp"
#include "mesh/faces.hpp"
#include "mesh/feet.hpp"
#include "mesh/folds.hpp"
#include "mesh/python.hpp"

namespace meshfix {

namespace {

template <class T>
auto view_of(PyConnectivity& self, const std::vector<T>& values) {
    return Vector<const T>(values.data(), {values.size()}, nb::find(self));
}

template <auto Member>
auto view(PyConnectivity& self) {
    return view_of(self, self.mesh.*Member);
}

template <auto Member>
auto rows_view(PyConnectivity& self) {
    auto& values = self.mesh.*Member;
    using T = typename std::remove_reference_t<decltype(values)>::value_type;
    const std::size_t columns = static_cast<std::size_t>(self.dimension) + 1;
    return Matrix<const T>(values.data(), {values.size() / columns, columns}, nb::find(self));
}

void init_connectivity(PyConnectivity* self, const Matrix<const double>& points,
                       const Matrix<const std::int32_t>& simplices, const Vector<const std::int32_t>& used, int threads) {
    const std::size_t d = simplices.shape(1) - 1;
    if (points.shape(1) != d && points.shape(1) != 3) throw nb::value_error("the simplices are of another dimension");
    new (self) PyConnectivity();
    self->dimension = static_cast<int>(d);
    self->mesh = with_space(d, points.shape(1), [&](auto dimension, auto space) {
        return connect<dimension, space>(points.data(), static_cast<std::int64_t>(points.shape(0)), simplices.data(),
                                         static_cast<std::int64_t>(simplices.shape(0)),
                                         std::vector<std::int32_t>(used.data(), used.data() + used.shape(0)), threads);
    });
}

void init_elements(PyConnectivity* self, const Matrix<const double>& points, const Vector<const std::uint8_t>& codes,
                   const Vector<const std::int32_t>& nodes, const Vector<const std::int32_t>& used, int threads) {
    new (self) PyConnectivity();
    self->dimension = codes.shape(0) > 0 ? SHAPES.at(codes(0)).dimension : static_cast<int>(points.shape(1));
    self->mesh = with_space(static_cast<std::size_t>(self->dimension), points.shape(1), [&](auto dimension, auto space) {
        return connect_elements<dimension, space>(
            points.data(), static_cast<std::int64_t>(points.shape(0)), codes.data(), nodes.data(),
            static_cast<std::int64_t>(codes.shape(0)),
            std::vector<std::int32_t>(used.data(), used.data() + used.shape(0)), threads);
    });
}

void take_apart_py(PyConnectivity& self, const Vector<const bool>& flipped, int threads) {
    const std::uint8_t* mask = bytes_of(flipped, self.mesh.m());
    with_dimension(self.dimension, [&](auto d) { take_apart<d>(self.mesh, mask, threads); });
}

template <auto Member>
auto element_view(PyConnectivity& self) {
    return view_of(self, self.mesh.elements.*Member);
}

template <class Array>
auto copied(const Array& array) {
    return std::vector<std::remove_const_t<typename Array::Scalar>>(array.data(), array.data() + array.size());
}

PyConnectivity* part_py(const Matrix<const std::int32_t>& simplices, std::int64_t n, int threads) {
    auto self = std::make_unique<PyConnectivity>();
    self->dimension = static_cast<int>(simplices.shape(1)) - 1;
    self->mesh = with_dimension(simplices.shape(1) - 1, [&](auto d) {
        return part_of_mesh<d>({simplices.data(), simplices.data() + simplices.size()}, {},
                               static_cast<std::int64_t>(simplices.shape(0)), n, threads);
    });
    return self.release();
}

PyConnectivity* part_of_elements_py(const Vector<const std::uint8_t>& codes, const Vector<const std::int32_t>& nodes,
                                    std::int64_t n, int dimension, int threads) {
    auto self = std::make_unique<PyConnectivity>();
    self->dimension = dimension;
    self->mesh = with_dimension(static_cast<std::size_t>(dimension), [&](auto d) {
        Elements elements = elements_of(copied(codes), copied(nodes));
        std::vector<std::int32_t> simplices = corner_simplices<d>(elements, threads);
        return part_of_mesh<d>(std::move(simplices), std::move(elements), static_cast<std::int64_t>(codes.size()), n,
                               threads);
    });
    return self.release();
}

void flip_py(PyConnectivity& self, const Vector<const bool>& flipped, int threads) {
    const std::uint8_t* mask = bytes_of(flipped, self.mesh.m());
    with_dimension(self.dimension, [&](auto d) { flip<d>(self.mesh, mask, threads); });
}

auto signed_sizes_py(const PyConnectivity& self, const Matrix<const double>& points) {
    return to_numpy(with_dimension(self.dimension, [&](auto d) { return signed_sizes<d>(self.mesh, points.data()); }));
}

void build_stars_py(PyConnectivity& self, int threads) {
    with_dimension(self.dimension, [&](auto d) {  // the interpreter lock is released first: nobody waits for both
        const std::lock_guard<std::mutex> lock(self.building);
        if (self.has_stars) return;
        build_stars<d>(self.mesh, threads);
        self.has_stars = true;
    });
}

// All but the stars, which are built again, and what follows from the shapes of elements.
nb::tuple state_of(PyConnectivity& self) {
    return nb::make_tuple(self.dimension, self.mesh.orientable, self.mesh.elements.empty(),
                          element_view<&Elements::codes>(self), element_view<&Elements::nodes>(self),
                          view<&Connectivity::simplices>(self), view<&Connectivity::mates>(self), view<&Connectivity::vertices>(self),
                          view<&Connectivity::rows>(self), view<&Connectivity::offsets>(self),
                          view<&Connectivity::corners>(self), view<&Connectivity::component>(self),
                          view<&Connectivity::against>(self));
}

using Int32s = Vector<const std::int32_t>;
using Uint8s = Vector<const std::uint8_t>;
using State = std::tuple<int, bool, bool, Uint8s, Int32s, Int32s, Int32s, Int32s, Int32s, Int32s, Int32s, Int32s, Uint8s>;

void restore(PyConnectivity& self, const State& state) {
    new (&self) PyConnectivity();
    Connectivity& mesh = self.mesh;
    self.dimension = std::get<0>(state);
    mesh.orientable = std::get<1>(state);
    if (!std::get<2>(state)) mesh.elements = elements_of(copied(std::get<3>(state)), copied(std::get<4>(state)));
    mesh.simplices = copied(std::get<5>(state));
    mesh.mates = copied(std::get<6>(state));
    mesh.vertices = copied(std::get<7>(state));
    mesh.rows = copied(std::get<8>(state));
    mesh.offsets = copied(std::get<9>(state));
    mesh.corners = copied(std::get<10>(state));
    mesh.component = copied(std::get<11>(state));
    mesh.against = copied(std::get<12>(state));
}

auto grown_py(const PyConnectivity& self, const Vector<const bool>& mask, int rings) {
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    const std::uint8_t* bytes = bytes_of(mask, self.mesh.n());
    std::vector<std::uint8_t> marked(bytes, bytes + self.mesh.n());
    with_dimension(self.dimension, [&](auto) { grow(self.mesh, marked, rings); });
    return to_numpy(std::move(marked));
}

auto stuck_py(const PyConnectivity& self, const Vector<const bool>& movable, int threads) {
    const std::uint8_t* mask = bytes_of(movable, self.mesh.n());
    return to_numpy(with_dimension(self.dimension, [&](auto d) {
        if (!self.mesh.elements.empty()) return stuck_elements(self.mesh.elements, mask);
        return stuck_simplices<d>(self.mesh.simplices.data(), self.mesh.m(), mask, threads);
    }));
}

// Vertices of facets that belong to one simplex.
auto boundary_py(const PyConnectivity& self) {
    return to_numpy(with_dimension(self.dimension, [&](auto d) { return boundary_vertices<d>(self.mesh); }));
}

auto fixed_facets_py(const PyConnectivity& self, const Vector<const bool>& movable, int threads, bool other_diagonal) {
    const std::uint8_t* mask = bytes_of(movable, self.mesh.n());
    FixedFacets found = with_dimension(self.dimension, [&](auto d) {
        if (!self.mesh.elements.empty())
            return fixed_facets<d>(self.mesh.elements, self.mesh.mates, mask, other_diagonal);
        return fixed_facets<d>(self.mesh.simplices.data(), self.mesh.mates.data(), self.mesh.m(), mask, threads);
    });
    return std::make_tuple(to_numpy(std::move(found.vertices), static_cast<std::size_t>(self.dimension)),
                           to_numpy(std::move(found.owners)), to_numpy(std::move(found.shared)));
}

template <class Index>
nb::tuple cells_of_faces_py(const Vector<const Index>& offsets, const Vector<const Index>& vertices,
                            const Vector<const Index>& owner, const Vector<const Index>& neighbour, std::int64_t cells,
                            int threads) {
    const FacesView<Index> faces{offsets.data(), vertices.data(), owner.data(), neighbour.data(),
                                 static_cast<std::int64_t>(owner.shape(0))};
    CellsOfFaces<Index> found = cells_of_faces(faces, cells, threads);
    return nb::make_tuple(to_numpy(std::move(found.starts)), to_numpy(std::move(found.faces)),
                          to_numpy(std::move(found.corners)), to_numpy(std::move(found.nodes), found.width));
}

template <class Index>
void bind_cells_of_faces(nb::module_& m) {
    m.def("cells_of_faces", &cells_of_faces_py<Index>, "offsets"_a.noconvert(), "vertices"_a.noconvert(),
          "owner"_a.noconvert(), "neighbour"_a.noconvert(), "cells"_a, "threads"_a);
}

// Rows of a shape's code, the group of parallel edges, which is another than that of the row before, and two nodes.
EdgeTable table_of(const Matrix<const std::int8_t>& rows) {
    EdgeTable table;
    for (std::size_t i = 0; i < rows.shape(0); ++i)
        table.of_shape.at(rows(i, 0)).push_back({rows(i, 1), rows(i, 2), rows(i, 3)});
    return table;
}

auto edges_py(const PyConnectivity& self, const Matrix<const std::int8_t>& table, int threads) {
    EdgeList edges = with_dimension(
        self.dimension, [&](auto) { return find_edges(self.mesh.elements, table_of(table), self.mesh.n(), threads); });
    return std::make_pair(to_numpy(std::move(edges.offsets)), to_numpy(std::move(edges.ends)));
}

auto rows_of_edges_py(const PyConnectivity& self, const Matrix<const std::int8_t>& table, const PyEdges& edges) {
    return to_numpy(with_dimension(self.dimension, [&](auto) {
        return rows_of_edges(self.mesh.elements, table_of(table), edges_view(edges),
                             static_cast<std::int64_t>(edges.second.size()));
    }));
}

auto used_vertices_py(const Matrix<const std::int32_t>& simplices, std::int64_t n) {
    return to_numpy(used_vertices(simplices.data(), static_cast<std::int64_t>(simplices.size()), n));
}

auto check_simplices_py(const Matrix<const std::int32_t>& simplices, std::int64_t n, int threads) {
    const auto m = static_cast<std::int64_t>(simplices.shape(0));
    struct Bad {
        std::int64_t outside = -1, repeated = -1;
    };
    std::vector<Bad> parts(m / PER_ITEM + 1);
    with_dimension(simplices.shape(1) - 1, [&](auto dimension) {
        constexpr std::int64_t corners = dimension + 1;
        for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
            for (std::int64_t s = end; s-- > begin;) {
                const std::int32_t* row = simplices.data() + s * corners;
                bool outside = false, repeated = false;
                for (std::int64_t i = 0; i < corners; ++i) {
                    outside |= (row[i] < 0) | (row[i] >= n);
                    for (std::int64_t j = 0; j < i; ++j) repeated |= row[i] == row[j];
                }
                if (outside) parts[item].outside = s;
                if (repeated) parts[item].repeated = s;
            }
        });
    });
    Bad first;
    for (const auto& part : parts) {
        if (first.outside < 0) first.outside = part.outside;
        if (first.repeated < 0) first.repeated = part.repeated;
    }
    return std::make_pair(first.outside, first.repeated);
}

auto crossings_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& facets, int threads) {
    const auto count = static_cast<std::int64_t>(facets.shape(0));
    std::vector<std::int32_t> pairs = with_dimension(
        points.shape(1), [&](auto d) { return Crossings<d>(points.data(), facets.data(), count, threads).find(threads); });
    return to_numpy(std::move(pairs), 2);
}

auto crossings_and_folds_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& facets,
                            const Vector<const std::uint8_t>& shared, int threads) {
    const auto count = static_cast<std::int64_t>(facets.shape(0));
    auto [crossings, folds] = with_dimension(points.shape(1), [&](auto d) {
        const Crossings<d> tree(points.data(), facets.data(), count, threads);
        return std::make_pair(tree.find(threads), find_folds(tree, shared.data(), count, threads));
    });
    return std::make_pair(to_numpy(std::move(crossings), 2), to_numpy(std::move(folds), 2));
}

auto enclosing_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& facets,
                  const Vector<const std::int32_t>& parts, const Matrix<const double>& places,
                  const Vector<const std::int32_t>& own, int threads) {
    const auto count = static_cast<std::int64_t>(facets.shape(0)), asked = static_cast<std::int64_t>(places.shape(0));
    std::vector<std::int32_t> found(static_cast<std::size_t>(asked));
    with_dimension(points.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        const Crossings<D> tree(points.data(), facets.data(), count, threads);
        for_each_range(asked, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t i = begin; i < end; ++i)
                found[i] = tree.enclosing(load<D>(places.data() + i * D), own(i), parts.data());
        });
    });
    return to_numpy(std::move(found));
}

// Rows of an array.
auto rows_py(const Matrix<const double>& values, const Vector<const std::int32_t>& which) {
    const std::size_t count = which.shape(0), columns = values.shape(1);
    std::vector<double> rows(count * columns);
    with_dimension(columns, [&](auto dimension) {
        constexpr int D = dimension;
        for (std::size_t i = 0; i < count; ++i)
            for (int k = 0; k < D; ++k) rows[i * D + k] = values.data()[static_cast<std::int64_t>(which(i)) * D + k];
    });
    return to_numpy(std::move(rows), columns);
}

// Where two arrays of points differ.
auto moved_py(const Matrix<const double>& before, const Matrix<const double>& after, int threads) {
    if (before.size() != after.size()) throw nb::value_error("the points are of two meshes");
    const std::size_t n = before.shape(0), d = before.shape(1);
    std::vector<std::uint8_t> moved(n, 0);
    for_each_range(static_cast<std::int64_t>(n), PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (auto i = static_cast<std::size_t>(begin); i < static_cast<std::size_t>(end); ++i)
            for (std::size_t k = i * d; k < (i + 1) * d; ++k) moved[i] |= before.data()[k] != after.data()[k];
    });
    return to_numpy(std::move(moved));
}

template <class T>
std::vector<T> copied(const Vector<const T>& values) {
    return {values.data(), values.data() + values.size()};
}

template <class T>
std::vector<T> copied(const Matrices<const T>& values) {
    return {values.data(), values.data() + values.size()};
}

void init_freedom(Freedom* self, const Vector<const std::int32_t>& frame, const Vector<const std::uint8_t>& directions,
                  const Matrices<const double>& axes, const Vector<const std::int32_t>& offsets,
                  const Vector<const std::int32_t>& neighbours, const Reference* reference) {
    new (self) Freedom{copied(frame), copied(directions), copied(axes), copied(offsets), copied(neighbours), reference};
}

void keep_near(Freedom& self, const Vector<const std::int32_t>& offsets, const Matrix<const std::int32_t>& around,
               double bound) {
    if (offsets.shape(0) != self.frame.size() + 1) throw nb::value_error("the offsets are of another mesh");
    self.around_offsets = offsets.data();
    self.around = around.data();
    self.bound2 = bound * bound;
}

void init_reference(Reference* self, const Matrices<const double>& corners, const Matrices<const double>& ways,
                    const Vector<const std::int32_t>& first, const Vector<const std::uint8_t>& directions, bool in_order) {
    new (self) Reference(static_cast<int>(corners.shape(2)), corners.data(), ways.data(), copied(first),
                         copied(directions), in_order);
}

void let_walk(Reference& self, const Matrix<const std::int32_t>& vertices) {
    if (self.dimension() != 3 || vertices.shape(1) != 3) throw nb::value_error("only surfaces are walked on");
    self.let_walk(vertices.data());
}

Reference at_corners(const Reference& self, const Matrices<const double>& corners) {
    if (static_cast<int>(corners.shape(2)) != self.dimension() || corners.size() != self.size())
        throw nb::value_error("the corners are of another reference");
    return self.at_corners(corners.data());
}

OnShapes on_shapes(const Reference& self, const Matrix<const double>& points, const Vector<const std::int32_t>& shapes,
                   const std::int32_t* near = nullptr) {
    if (static_cast<int>(points.shape(1)) != self.dimension() || shapes.shape(0) != points.shape(0))
        throw nb::value_error("the points are of another reference");
    return {points.data(), shapes.data(), static_cast<std::int64_t>(points.shape(0)), near};
}

auto nearest_py(const Reference& self, const OnShapes& on, int threads) {
    const int d = self.dimension();
    std::vector<double> there(on.count * d), distances(on.count);
    with_dimension(d, [&](auto dimension) {
        find_nearest<dimension>(self, on, threads, there.data(), distances.data());
        return 0;
    });
    return std::make_pair(to_numpy(std::move(there), d), to_numpy(std::move(distances)));
}

auto axes_py(const Reference& self, const Matrix<const double>& points, const Vector<const std::int32_t>& shapes, int threads) {
    const OnShapes on = on_shapes(self, points, shapes);
    std::vector<double> found(points.size() * points.shape(1));
    with_dimension(points.shape(1), [&](auto dimension) {
        find_axes<dimension>(self, on, threads, found.data());
        return 0;
    });
    return to_numpy(std::move(found), points.shape(1));
}

// How far the pieces are from it at most, with their corners elsewhere (p, D, D): these, or middles.
double farthest_py(const Reference& self, const Matrices<const double>& corners, bool of_corners, int threads) {
    if (static_cast<int>(corners.shape(2)) != self.dimension() || corners.size() != self.size())
        throw nb::value_error("the corners are of another reference");
    std::atomic<double> most2{0.0};
    with_dimension(self.dimension(), [&](auto dimension) {
        for_each_range(static_cast<std::int64_t>(corners.shape(0)), 1024, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            double least2 = most2.load();
            const double here2 = self.farthest2<dimension>(corners.data(), of_corners, begin, end, least2);
            while (here2 > least2 && !most2.compare_exchange_weak(least2, here2)) {}
        });
        return 0;
    });
    return std::sqrt(most2.load());
}

// Numbers things (n,) so that those which pairs (p, 2) join have one number, by the first of each.
auto joined_py(const Matrix<const std::int32_t>& pairs, std::int32_t n) {
    std::vector<std::int32_t> first(n);
    std::iota(first.begin(), first.end(), 0);
    const auto root = [&](std::int32_t i) {
        while (first[i] != i) i = first[i] = first[first[i]];
        return i;
    };
    for (std::size_t i = 0; i < pairs.shape(0); ++i) {
        const std::int32_t a = root(pairs(i, 0)), b = root(pairs(i, 1));
        first[std::max(a, b)] = std::min(a, b);
    }
    for (std::int32_t i = 0; i < n; ++i) first[i] = first[first[i]];
    return to_numpy(std::move(first));
}

}  // namespace

void bind_mesh(nb::module_& m) {
    nb::class_<Freedom>(m, "Freedom")
        .def("__init__", &init_freedom, "frame"_a.noconvert(), "directions"_a.noconvert(), "axes"_a.noconvert(),
             "offsets"_a.noconvert(), "neighbours"_a.noconvert(), "reference"_a = nb::none(), nb::keep_alive<1, 7>())
        .def("keep_near", &keep_near, "offsets"_a.noconvert(), "around"_a.noconvert(), "bound"_a, nb::keep_alive<1, 2>(),
             nb::keep_alive<1, 3>());
    nb::class_<Reference>(m, "Reference")
        .def("__init__", &init_reference, "corners"_a.noconvert(), "ways"_a.noconvert(), "first"_a.noconvert(),
             "directions"_a.noconvert(), "in_order"_a = false, nb::keep_alive<1, 2>(), nb::keep_alive<1, 3>())
        .def("let_walk", &let_walk, "vertices"_a.noconvert())
        .def("at_corners", &at_corners, "corners"_a.noconvert(), nb::keep_alive<0, 1>(), nb::keep_alive<0, 2>())
        .def("nearest", [](const Reference& self, const Matrix<const double>& points, const Vector<const std::int32_t>& shapes,
                           int threads) { return nearest_py(self, on_shapes(self, points, shapes), threads); },
             "points"_a.noconvert(), "shapes"_a.noconvert(), "threads"_a)
        .def("axes", &axes_py, "points"_a.noconvert(), "shapes"_a.noconvert(), "threads"_a)
        .def("farthest", &farthest_py, "corners"_a.noconvert(), "of_corners"_a, "threads"_a)
        .def("nearest", [](const Reference& self, const Matrix<const double>& points, const Vector<const std::int32_t>& shapes,
                           int threads, const Vector<const std::int32_t>& near) {
            if (near.shape(0) != points.shape(0)) throw nb::value_error("the pieces are of other points");
            return nearest_py(self, on_shapes(self, points, shapes, near.data()), threads);
        }, "points"_a.noconvert(), "shapes"_a.noconvert(), "threads"_a, "near"_a.noconvert());
    m.def("joined", &joined_py, "pairs"_a.noconvert(), "n"_a);
    m.def("check_simplices", &check_simplices_py, "simplices"_a.noconvert(), "n"_a, "threads"_a);
    m.def("used_vertices", &used_vertices_py, "simplices"_a.noconvert(), "n"_a);
    m.def("rows", &rows_py, "values"_a.noconvert(), "which"_a.noconvert());
    m.def("moved", &moved_py, "before"_a.noconvert(), "after"_a.noconvert(), "threads"_a);
    m.def("crossings", &crossings_py, "points"_a.noconvert(), "facets"_a.noconvert(), "threads"_a);
    m.def("crossings_and_folds", &crossings_and_folds_py, "points"_a.noconvert(), "facets"_a.noconvert(),
          "shared"_a.noconvert(), "threads"_a);
    m.def("enclosing", &enclosing_py, "points"_a.noconvert(), "facets"_a.noconvert(), "parts"_a.noconvert(),
          "places"_a.noconvert(), "own"_a.noconvert(), "threads"_a);
    m.attr("BLOCK_SIZE") = BLOCK_SIZE;

    nb::class_<PyConnectivity>(m, "Connectivity")
        .def("__init__", &init_connectivity, "points"_a.noconvert(), "simplices"_a.noconvert(), "used"_a.noconvert(),
             "threads"_a)
        .def("__init__", &init_elements, "points"_a.noconvert(), "codes"_a.noconvert(), "nodes"_a.noconvert(),
             "used"_a.noconvert(), "threads"_a)
        .def("take_apart", &take_apart_py, "flipped"_a.noconvert(), "threads"_a)
        .def_prop_ro("simplicial", [](PyConnectivity& self) { return self.mesh.elements.empty(); })
        .def_prop_ro("codes", &element_view<&Elements::codes>)
        .def_prop_ro("node_offsets", &element_view<&Elements::offsets>)
        .def_prop_ro("nodes", &element_view<&Elements::nodes>)
        .def_prop_ro("facet_offsets", &element_view<&Elements::facet_offsets>)
        .def_prop_ro("facet_owners", &element_view<&Elements::facet_owners>)
        .def_prop_ro("simplex_offsets", &element_view<&Elements::simplex_offsets>)
        .def_prop_ro("owners", &element_view<&Elements::owners>)
        .def_prop_ro("facet_mates", &view<&Connectivity::mates>)
        .def("__getstate__", &state_of)
        .def("__setstate__", &restore)
        .def_static("part", &part_py, "simplices"_a.noconvert(), "n"_a, "threads"_a)
        .def_static("part", &part_of_elements_py, "codes"_a.noconvert(), "nodes"_a.noconvert(), "n"_a, "dimension"_a,
                    "threads"_a)
        .def("flip", &flip_py, "flipped"_a.noconvert(), "threads"_a)
        .def("signed_sizes", &signed_sizes_py, "points"_a.noconvert())
        .def("build_stars", &build_stars_py, "threads"_a)
        .def("grown", &grown_py, "mask"_a.noconvert(), "rings"_a)
        .def("stuck", &stuck_py, "movable"_a.noconvert(), "threads"_a)
        .def("boundary", &boundary_py)
        .def("edges", &edges_py, "table"_a.noconvert(), "threads"_a)
        .def("rows_of_edges", &rows_of_edges_py, "table"_a.noconvert(), "edges"_a)
        .def("fixed_facets", &fixed_facets_py, "movable"_a.noconvert(), "threads"_a, "other_diagonal"_a = false)
        .def_prop_ro("crowded", [](PyConnectivity& self) { return self.mesh.crowded; })
        .def_prop_ro("orientable", [](PyConnectivity& self) { return self.mesh.orientable; })
        .def_prop_ro("simplices", &rows_view<&Connectivity::simplices>)
        .def_prop_ro("mates", &rows_view<&Connectivity::mates>)
        .def_prop_ro("vertices", &view<&Connectivity::vertices>)
        .def_prop_ro("rows", &view<&Connectivity::rows>)
        .def_prop_ro("component", &view<&Connectivity::component>)
        .def_prop_ro("against", &view<&Connectivity::against>)
        .def_prop_ro("offsets", &view<&Connectivity::offsets>)
        .def_prop_ro("corners", &view<&Connectivity::corners>)
        .def_prop_ro("faces", &view<&Connectivity::faces>)
        .def_prop_ro("neighbour_offsets", &view<&Connectivity::neighbour_offsets>)
        .def_prop_ro("neighbours", &view<&Connectivity::neighbours>)
        .def_prop_ro("colour_offsets", &view<&Connectivity::colour_offsets>)
        .def_prop_ro("colour_blocks", &view<&Connectivity::colour_blocks>);
    bind_cells_of_faces<std::int32_t>(m);
    bind_cells_of_faces<std::int64_t>(m);
}

}  // namespace meshfix
