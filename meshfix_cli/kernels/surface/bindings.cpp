// Bindings of what is done with surfaces.
#include "mesh/python.hpp"
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

auto area_vectors_py(const Matrix<const double>& points, const Int32s& offsets, const Int32s& nodes, int threads) {
    const ElementsView elements = flat_elements(offsets, nodes);
    return to_numpy(unlocked([&] { return area_vectors(points.data(), elements, threads); }), 3);
}

auto relocate_on_surface_py(int move, const Matrix<double>& points, const Vector<std::uint8_t>& states,
                            const PyConnectivity& self, const Int32s& blocks, double threshold_sine2, double min_measure,
                            const Matrix<const double>& start, double max_move, int threads, const Freedom& freedom,
                            const Matrix<const double>& normals) {
    const Connectivity& mesh = self.mesh;
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    for (const auto& some : {points.shape(0), start.shape(0), states.shape(0)})
        if (static_cast<std::int64_t>(some) != mesh.n()) throw nb::value_error("the points are of another mesh");
    if (points.shape(1) != 3 || start.shape(1) != 3 || self.dimension != 2) throw nb::value_error("this is no surface");
    if (static_cast<std::int64_t>(normals.shape(0)) != mesh.m() || normals.shape(1) != 3)
        throw nb::value_error("the normals are of another mesh");
    check_freedom(&freedom, mesh.n());
    const Sweep sweep{stars_of(mesh), points.data(), states.data(), mesh.n(),
                      Parameters{threshold_sine2, 2.0 * min_measure, start.data(), max_move, &freedom}};
    const Counts counts = unlocked([&] {
        return relocate<SurfaceRelocation>(static_cast<Move>(move), sweep, blocks.data(),
                                           static_cast<std::int64_t>(blocks.shape(0)), threads,
                                           [&](SurfaceRelocation& work) { work.normals = normals.data(); });
    });
    return std::make_pair(counts.visited, counts.moved);
}

}  // namespace

void bind_surface(nb::module_& m) {
    m.def("unfold", &unfold_py, "points"_a.noconvert(), "offsets"_a.noconvert(), "nodes"_a.noconvert(),
          "normals"_a.noconvert(), "threads"_a);
    m.def("area_vectors", &area_vectors_py, "points"_a.noconvert(), "offsets"_a.noconvert(), "nodes"_a.noconvert(),
          "threads"_a);
    m.def("relocate_on_surface", &relocate_on_surface_py, "move"_a, "points"_a.noconvert(), "states"_a.noconvert(),
          "mesh"_a, "blocks"_a.noconvert(), "threshold_sine2"_a, "min_measure"_a, "start"_a.noconvert(), "max_move"_a,
          "threads"_a, "freedom"_a, "normals"_a.noconvert());
}

}  // namespace meshfix
