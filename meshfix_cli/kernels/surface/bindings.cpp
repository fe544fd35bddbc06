// Bindings of what is done with surfaces.
#include <nanobind/stl/optional.h>

#include <optional>

#include "mesh/python.hpp"
#include "surface/around.hpp"
#include "surface/joints.hpp"
#include "surface/refit.hpp"
#include "surface/relocate.hpp"

namespace meshfix {

namespace {

using Int32s = Vector<const std::int32_t>;

// Triangles and quadrilaterals, whose numbers of nodes tell their types.
ElementsView flat_elements(const Int32s& offsets, const Int32s& nodes) {
    return {nullptr, offsets.data(), nodes.data(), static_cast<std::int64_t>(offsets.shape(0)) - 1};
}

template <class F>
auto unlocked(const F& f) {
    const nb::gil_scoped_release release;
    return f();
}

auto unfold_py(const Matrix<const double>& points, const Int32s& offsets, const Int32s& nodes,
               const Matrix<const double>& normals, int threads) {
    const ElementsView elements = flat_elements(offsets, nodes);
    return to_numpy(unlocked([&] { return unfold(points.data(), elements, normals.data(), threads); }), 2);
}

auto check_unfolded_py(const Matrix<const double>& points, const Int32s& offsets, const Int32s& nodes,
                       const Matrix<const double>& normals, int threads) {
    const ElementsView elements = flat_elements(offsets, nodes);
    if (nodes.shape(0) != 3 * static_cast<std::size_t>(elements.count)) throw nb::value_error("these are no triangles");
    Validity total = unlocked([&] { return check_unfolded(points.data(), elements, normals.data(), threads); });
    return std::make_pair(to_numpy(std::move(total.inverted)), total.min_measure);
}

auto area_vectors_py(const Matrix<const double>& points, const Int32s& offsets, const Int32s& nodes, int threads) {
    const ElementsView elements = flat_elements(offsets, nodes);
    return to_numpy(unlocked([&] { return area_vectors(points.data(), elements, threads); }), 3);
}

auto normals_around_py(const Matrix<const double>& points, const Int32s& offsets, const Int32s& nodes, const PyConnectivity& self,
                       const Vector<const bool>& edges, int threads) {
    const std::int64_t n = self.mesh.n();
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    if (static_cast<std::int64_t>(points.shape(0)) != n || points.shape(1) != 3 || static_cast<std::int64_t>(edges.shape(0)) != n)
        throw nb::value_error("the points are of another mesh");
    const ElementsView elements = flat_elements(offsets, nodes);
    AroundNormals found = unlocked([&] {
        return normals_around(points.data(), elements, stars_of(self.mesh), n, reinterpret_cast<const std::uint8_t*>(edges.data()), threads);
    });
    return std::make_pair(to_numpy(std::move(found.of_vertices), 3), to_numpy(std::move(found.of_elements), 3));
}

auto relocate_on_surface_py(int move, const Matrix<double>& points, const Vector<std::uint8_t>& states,
                            const PyConnectivity& self, const Int32s& blocks, double threshold_sine2, double min_measure,
                            const Matrix<const double>& start, double max_move, int threads, const Freedom& freedom,
                            const Matrix<const double>& normals, const std::optional<Matrix<const double>>& ahead) {
    const Connectivity& mesh = self.mesh;
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    for (const auto& some : {points.shape(0), start.shape(0), states.shape(0)})
        if (static_cast<std::int64_t>(some) != mesh.n()) throw nb::value_error("the points are of another mesh");
    if (points.shape(1) != 3 || start.shape(1) != 3 || self.dimension != 2) throw nb::value_error("this is no surface");
    if (static_cast<std::int64_t>(normals.shape(0)) != mesh.m() || normals.shape(1) != 3)
        throw nb::value_error("the normals are of another mesh");
    if (ahead && (static_cast<std::int64_t>(ahead->shape(0)) != mesh.n() || ahead->shape(1) != 3))
        throw nb::value_error("the places ahead are of another mesh");
    check_freedom(&freedom, mesh.n());
    const Sweep sweep{stars_of(mesh), points.data(), states.data(), mesh.n(),
                      Parameters{threshold_sine2, 2.0 * min_measure, start.data(), max_move, &freedom}};
    const Counts counts = unlocked([&] {
        return relocate<SurfaceRelocation>(static_cast<Move>(move), sweep, blocks.data(),
                                           static_cast<std::int64_t>(blocks.shape(0)), threads,
                                           [&](SurfaceRelocation& work) {
                                               work.normals = normals.data();
                                               work.ahead = ahead ? ahead->data() : nullptr;
                                           });
    });
    return std::make_pair(counts.visited, counts.moved);
}

void check_vectors(std::size_t numbers, std::size_t vectors) {
    if (numbers != vectors) throw nb::value_error("the numbers are of other vectors");
}

auto unit_vectors_py(const Matrix<const double>& vectors) {
    const std::size_t d = vectors.shape(1);
    const auto count = static_cast<std::int64_t>(vectors.shape(0));
    return to_numpy(with_dimension(d, [&](auto dimension) { return unit_vectors<dimension>(vectors.data(), count); }), d);
}

auto summed_py(const Int32s& group, const Matrix<const double>& vectors, std::int64_t groups, const std::optional<Int32s>& rows) {
    check_vectors(group.shape(0), rows ? rows->shape(0) : vectors.shape(0));
    const std::size_t d = vectors.shape(1);
    const auto count = static_cast<std::int64_t>(group.shape(0));
    const std::int32_t* which = rows ? rows->data() : nullptr;
    return to_numpy(with_dimension(d, [&](auto dimension) { return summed<dimension>(group.data(), vectors.data(), which, count, groups); }), d);
}

auto dots_between_py(const Matrix<const double>& vectors, const Matrix<const std::int32_t>& pairs) {
    const auto count = static_cast<std::int64_t>(pairs.shape(0));
    return to_numpy(with_dimension(vectors.shape(1), [&](auto dimension) { return dots<dimension>(vectors.data(), pairs.data(), count); }));
}

auto sines_between_py(const Matrix<const double>& vectors, const Matrix<const std::int32_t>& pairs) {
    const auto count = static_cast<std::int64_t>(pairs.shape(0));
    return to_numpy(with_dimension(vectors.shape(1), [&](auto dimension) { return sines<dimension>(vectors.data(), pairs.data(), count); }));
}

FacetsView facets_view(const Matrix<const std::int32_t>& facets) {
    if (facets.shape(1) != 3 && facets.shape(1) != 4) throw nb::value_error("facets have three or four corners");
    return {facets.data(), static_cast<std::int64_t>(facets.shape(0)), static_cast<int>(facets.shape(1))};
}

auto joints_py(const Matrix<const std::int32_t>& facets, const Matrix<const std::int32_t>& lines, std::int64_t vertices) {
    const FacetsView view = facets_view(facets);
    Joints found = unlocked([&] { return Joints(view, lines.data(), static_cast<std::int64_t>(lines.shape(0)), vertices); });
    return std::make_tuple(to_numpy(std::move(found.ends), 2), to_numpy(std::move(found.owners)),
                           to_numpy(std::move(found.edges), 2), to_numpy(std::move(found.order)),
                           to_numpy(std::move(found.count)), to_numpy(std::move(found.is_line)));
}

auto fan_normals_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& facets,
                    const Matrix<const double>& normals, const Int32s& fan) {
    const FacetsView view = facets_view(facets);
    const auto corners = static_cast<std::int64_t>(fan.shape(0));
    return to_numpy(unlocked([&] { return fan_normals(points.data(), view, normals.data(), fan.data(), corners); }), 3);
}

auto around_pieces_py(const Matrix<const std::int32_t>& triangles, const Matrix<const std::int32_t>& segments,
                      const Int32s& shape, const Int32s& place, const Vector<const bool>& bounded) {
    if (triangles.shape(1) != 3 || segments.shape(1) < 2) throw nb::value_error("these are no triangles and segments");
    check_vectors(shape.shape(0), triangles.shape(0) + segments.shape(0));
    check_vectors(place.shape(0), shape.shape(0));
    const Around::Pieces pieces{triangles.data(), segments.data(), static_cast<std::int64_t>(triangles.shape(0)),
                                static_cast<std::int64_t>(segments.shape(0)), static_cast<int>(segments.shape(1)),
                                shape.data(), place.data()};
    const auto vertices = static_cast<std::int64_t>(bounded.shape(0));
    Around found = unlocked([&] { return Around(pieces, reinterpret_cast<const std::uint8_t*>(bounded.data()), vertices); });
    return std::make_pair(to_numpy(std::move(found.offsets)), to_numpy(std::move(found.rows), 4));
}

// Positions in the order of small numbers, equal ones as they come, and where those of each number begin.
auto counted_order_py(const Int32s& numbers, std::int64_t most) {
    std::vector<std::int32_t> offsets;
    auto order = unlocked([&] {
        return counted_order(static_cast<std::int64_t>(numbers.shape(0)), most, offsets, [&](std::int64_t i) { return numbers.data()[i]; });
    });
    return std::make_pair(to_numpy(std::move(order)), to_numpy(std::move(offsets)));
}

auto rows_of_pairs_py(const Matrix<const std::int32_t>& pairs, std::int64_t n) {
    PairRows rows = unlocked([&] { return PairRows(pairs.data(), static_cast<std::int64_t>(pairs.shape(0)), n); });
    return std::make_pair(to_numpy(std::move(rows.offsets)), to_numpy(std::move(rows.second)));
}

auto pairs_from_py(const Matrix<const std::int32_t>& edges, const Vector<const bool>& marks) {
    return to_numpy(unlocked([&] {
        return pairs_from(edges.data(), static_cast<std::int64_t>(edges.shape(0)), reinterpret_cast<const std::uint8_t*>(marks.data()));
    }), 2);
}

// Those between a vertex and its neighbours of higher numbers.
auto edge_lengths_py(const Matrix<const double>& points, const PyConnectivity& self) {
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    if (static_cast<std::int64_t>(points.shape(0)) != self.mesh.n()) throw nb::value_error("the points are of another mesh");
    const StarsView stars = stars_of(self.mesh);
    return to_numpy(with_dimension(points.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        std::vector<double> lengths;
        lengths.reserve(static_cast<std::size_t>(stars.neighbour_offsets[self.mesh.n()]) / 2);
        for (std::int32_t v = 0; v < self.mesh.n(); ++v)
            for (std::int32_t i = stars.neighbour_offsets[v]; i < stars.neighbour_offsets[v + 1]; ++i)
                if (const std::int64_t other = stars.neighbours[i]; v < other)
                    lengths.push_back(std::sqrt(norm2(load<D>(points.data() + other * D) - load<D>(points.data() + std::int64_t{v} * D))));
        return lengths;
    }));
}

// Points (n, 3) of a surface, and unit normals there, which are kept.
class PySample {
   public:
    PySample(const Matrix<const double>& points, const Matrix<const double>& seen)
        : points_(points), seen_(seen), tree_(unlocked([&] {
              check(points);
              check(seen);
              check_vectors(points.shape(0), seen.shape(0));
              if (points.shape(0) == 0) throw nb::value_error("there is no sample");
              return Sample(points.data(), static_cast<std::int64_t>(points.shape(0)));
          })) {}

    void refit(const Matrix<double>& points, const Int32s& rows, const Matrix<const double>& normals, double smooth, int threads) const {
        check(points);
        check(normals);
        check_vectors(points.shape(0), normals.shape(0));
        unlocked([&] {
            meshfix::refit(points.data(), rows.data(), static_cast<std::int64_t>(rows.shape(0)), normals.data(), tree_, points_.data(),
                           seen_.data(), smooth, threads);
            return 0;
        });
    }

    auto left(const Matrix<const double>& places, const Matrix<const double>& normals, int threads) const {
        check(places);
        check(normals);
        check_vectors(places.shape(0), normals.shape(0));
        const auto count = static_cast<std::int64_t>(places.shape(0));
        return to_numpy(unlocked([&] {
            return left_by_quadrics(tree_, points_.data(), seen_.data(), places.data(), normals.data(), count, threads);
        }), 2);
    }

   private:
    template <class M>
    static void check(const M& some) {
        if (some.shape(1) != 3) throw nb::value_error("these are no points in space");
    }

    Matrix<const double> points_, seen_;
    Sample tree_;
};

// Marks the vertices on the reference that are farther from it than a bound.
auto off_reference_py(const Freedom& self, const Matrix<const double>& points, double bound, int threads) {
    if (points.shape(0) != self.frame.size()) throw nb::value_error("the points are of another mesh");
    std::vector<std::uint8_t> marks(points.shape(0));
    with_dimension(points.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        for_each_range(static_cast<std::int64_t>(marks.size()), 1024, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t v = begin; v < end; ++v) {
                const std::int32_t shape = self.frame[v] < 0 ? -1 : self.shape(v);
                if (shape >= 0)
                    marks[v] = !self.reference->is_within<D>(bound * bound, shape, load<D>(points.data() + v * D), self.piece(v));
            }
        });
        return 0;
    });
    return to_numpy(std::move(marks));
}

}  // namespace

void bind_surface(nb::module_& m) {
    m.def("unfold", &unfold_py, "points"_a.noconvert(), "offsets"_a.noconvert(), "nodes"_a.noconvert(),
          "normals"_a.noconvert(), "threads"_a);
    m.def("check_unfolded", &check_unfolded_py, "points"_a.noconvert(), "offsets"_a.noconvert(), "nodes"_a.noconvert(),
          "normals"_a.noconvert(), "threads"_a);
    m.def("area_vectors", &area_vectors_py, "points"_a.noconvert(), "offsets"_a.noconvert(), "nodes"_a.noconvert(),
          "threads"_a);
    m.def("normals_around", &normals_around_py, "points"_a.noconvert(), "offsets"_a.noconvert(), "nodes"_a.noconvert(), "mesh"_a,
          "edges"_a.noconvert(), "threads"_a);
    m.def("relocate_on_surface", &relocate_on_surface_py, "move"_a, "points"_a.noconvert(), "states"_a.noconvert(),
          "mesh"_a, "blocks"_a.noconvert(), "threshold_sine2"_a, "min_measure"_a, "start"_a.noconvert(), "max_move"_a,
          "threads"_a, "freedom"_a, "normals"_a.noconvert(), "ahead"_a.noconvert() = nb::none());
    m.def("unit_vectors", &unit_vectors_py, "vectors"_a.noconvert());
    m.def("summed", &summed_py, "group"_a.noconvert(), "vectors"_a.noconvert(), "groups"_a, "rows"_a.noconvert() = nb::none());
    m.def("dots_between", &dots_between_py, "vectors"_a.noconvert(), "pairs"_a.noconvert());
    m.def("sines_between", &sines_between_py, "vectors"_a.noconvert(), "pairs"_a.noconvert());
    m.def("joints", &joints_py, "facets"_a.noconvert(), "lines"_a.noconvert(), "vertices"_a);
    m.def("fan_normals", &fan_normals_py, "points"_a.noconvert(), "facets"_a.noconvert(), "normals"_a.noconvert(), "fan"_a.noconvert());
    m.def("around_pieces", &around_pieces_py, "triangles"_a.noconvert(), "segments"_a.noconvert(), "shape"_a.noconvert(),
          "place"_a.noconvert(), "bounded"_a.noconvert());
    m.def("counted_order", &counted_order_py, "numbers"_a.noconvert(), "most"_a);
    m.def("rows_of_pairs", &rows_of_pairs_py, "pairs"_a.noconvert(), "n"_a);
    m.def("pairs_from", &pairs_from_py, "edges"_a.noconvert(), "marks"_a.noconvert());
    m.def("edge_lengths", &edge_lengths_py, "points"_a.noconvert(), "mesh"_a);
    nb::class_<PySample>(m, "Sample")
        .def(nb::init<const Matrix<const double>&, const Matrix<const double>&>(), "points"_a.noconvert(), "seen"_a.noconvert())
        .def("refit", &PySample::refit, "points"_a.noconvert(), "rows"_a.noconvert(), "normals"_a.noconvert(), "smooth"_a, "threads"_a)
        .def("left", &PySample::left, "places"_a.noconvert(), "normals"_a.noconvert(), "threads"_a);
    m.def("off_reference", &off_reference_py, "freedom"_a, "points"_a.noconvert(), "bound"_a, "threads"_a);
}

}  // namespace meshfix
