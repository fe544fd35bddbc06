// Bindings of the moves of vertices, of what each of them computes, and of the foldover-free energy.
#include <type_traits>
#include <variant>

#include "measures/python.hpp"
#include "mesh/python.hpp"
#include "moves/embedding.hpp"
#include "moves/exclusive.hpp"
#include "moves/foldover_problem.hpp"
#include "moves/relocate.hpp"
#include "moves/scaled.hpp"
#include "moves/shape.hpp"

namespace meshfix {

namespace {

auto mean_ratio_py(const Matrix<const double>& neighbours, const Matrix<const std::uint16_t>& faces,
                   const Vector<const double>& x) {
    const std::size_t d = neighbours.shape(1);
    auto [value, again, gradient, hessian] = with_dimension(d, [&](auto dimension) {
        constexpr int D = dimension;
        const Star<D> star = make_star<D>(neighbours, faces, x.data());
        const MeanRatio<D> ratio(star, star.position);
        std::vector<double> rows;
        for (int i = 0; i < D; ++i)
            for (int j = 0; j < D; ++j) rows.push_back(ratio.hessian[std::max(i, j)][std::min(i, j)]);
        return std::make_tuple(ratio.value, MeanRatio<D>::at(star, star.position),
                               std::vector<double>(ratio.gradient.begin(), ratio.gradient.end()), rows);
    });
    return std::make_tuple(value, again, to_numpy(std::move(gradient)), to_numpy(std::move(hessian), d));
}

auto relocate_py(int move, const Matrix<double>& points, const Vector<std::uint8_t>& states, const PyConnectivity& self,
                 const Vector<const std::int32_t>& blocks, double threshold_sine2, double min_measure,
                 const Matrix<const double>& start, double max_move, int threads, const Freedom* freedom) {
    const Connectivity& mesh = self.mesh;
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    check_points(points, self);
    check_points(start, self);
    if (static_cast<std::int64_t>(states.shape(0)) != mesh.n()) throw nb::value_error("the states are of another mesh");
    check_freedom(freedom, mesh.n());
    const Counts counts = with_dimension(points.shape(1), [&](auto d) {
        const Sweep sweep{stars_of(mesh), points.data(), states.data(), mesh.n(),
                          Parameters{threshold_sine2, factorial(d) * min_measure, start.data(), max_move, freedom}};
        return relocate<Relocation<d>>(static_cast<Move>(move), sweep, blocks.data(),
                                       static_cast<std::int64_t>(blocks.shape(0)), threads, [](Relocation<d>&) {});
    });
    return std::make_pair(counts.visited, counts.moved);
}

auto exclusive_py(const Matrix<const double>& points, const PyConnectivity& self, const Vector<const bool>& movable,
                  const Vector<const bool>& hopeless, const Vector<const std::int32_t>& vertices, int threads, const Freedom* freedom) {
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    check_points(points, self);
    check_freedom(freedom, self.mesh.n());
    const std::uint8_t* mask = bytes_of(movable, self.mesh.n());
    const auto simplices = static_cast<std::int64_t>(self.mesh.simplices.size()) / (self.dimension + 1);
    const std::uint8_t* lost = bytes_of(hopeless, simplices);
    Excluded found = with_dimension(self.dimension, [&](auto d) {
        return exclusive_simplices<d>(self.mesh, stars_of(self.mesh), freedom, points.data(), mask, lost, vertices.data(),
                                      static_cast<std::int64_t>(vertices.shape(0)), threads);
    });
    return std::make_pair(to_numpy(std::move(found.together)), to_numpy(std::move(found.alone)));
}

// Vertices that others moved: where one is elsewhere, its neighbours are due again.
void receive_py(const Matrix<double>& points, const Vector<std::uint8_t>& states, const PyConnectivity& self,
                const Vector<const std::int32_t>& vertices, const Matrix<const double>& positions) {
    const Connectivity& mesh = self.mesh;
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    check_points(points, self);
    const std::size_t d = points.shape(1);
    for (std::size_t i = 0; i < vertices.shape(0); ++i) {
        double* here = points.data() + static_cast<std::size_t>(vertices(i)) * d;
        const double* there = positions.data() + i * d;
        const bool moved = !std::equal(here, here + d, there);
        std::copy(there, there + d, here);  // also 0 over -0
        if (moved) make_neighbours_due(stars_of(mesh), states.data(), vertices(i));
    }
}

template <int D>
auto solve_star(const Star<D>& star, bool heights) {
    LinearProgram<D> program;
    program.set(star, heights);
    const LpStatus status = program.solve();
    std::vector<double> weights(star.faces_count + 2 * D, 0.0);
    if (status != LpStatus::degenerate)
        for (int row = 0; row <= D; ++row) {
            const int j = program.basis[row], side = j - program.faces_count;
            int face = std::min(j, star.faces_count - 1);
            if (program.stand_in >= 0 && program.column(j) == program.column(program.stand_in)) face = program.stand_in;
            weights[side < 0 ? face : star.faces_count + side] += program.weight(row);
        }
    const Vec<D> x = program.position();
    std::vector<double> solution(x.begin(), x.end()), frame;
    solution.push_back(program.pi[D]);
    for (const auto& axis : program.frame) frame.insert(frame.end(), axis.begin(), axis.end());
    return std::make_tuple(static_cast<int>(status), std::move(solution), std::move(weights), std::move(frame),
                           program.pivots);
}

auto linear_program_py(const Matrix<const double>& neighbours, const Matrix<const std::uint16_t>& faces,
                       bool heights) {
    const std::size_t dimension = neighbours.shape(1);
    auto [status, solution, weights, frame, pivots] = with_dimension(dimension, [&](auto d) {
        return solve_star<d>(make_star<d>(neighbours, faces, std::array<double, 3>{}.data()), heights);
    });
    return std::make_tuple(status, to_numpy(std::move(solution)), to_numpy(std::move(weights)),
                           to_numpy(std::move(frame), dimension), pivots);
}

auto min_norm_point_py(const Matrix<const double>& vectors) {
    const std::size_t d = vectors.shape(1);
    return to_numpy(with_dimension(d, [&](auto dimension) {
        constexpr int D = dimension;
        std::vector<Vec<D>> rows;
        for (std::size_t i = 0; i < vectors.shape(0); ++i) rows.push_back(load<D>(vectors.data() + i * D));
        const Vec<D> point = min_norm_point<D>(rows);
        return std::vector<double>(point.begin(), point.end());
    }));
}

// The points, the free ones at the mean of their neighbours, by weights where there are any; with a `freedom` of those in
// their line or plane.
auto embedding_py(const Matrix<const double>& points, const PyConnectivity& self, const Vector<const bool>& free,
                  const PyEdges& edges, const Vector<const double>& weights, int threads,
                  const Freedom* freedom) {
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    check_points(points, self);
    check_freedom(freedom, self.mesh.n());
    const std::uint8_t* mask = bytes_of(free, self.mesh.n());
    std::vector<double> embedded(points.data(), points.data() + points.size());
    with_dimension(points.shape(1), [&](auto d) {
        const double* by = self.mesh.elements.empty() || freedom != nullptr ? nullptr : weights.data();
        StarsView stars = stars_of(self.mesh);
        if (freedom != nullptr) {
            stars.neighbour_offsets = freedom->offsets.data();
            stars.neighbours = freedom->neighbours.data();
        }
        Embedding<d>(stars, points.data(), mask, edges_view(edges), by, self.mesh.n(), threads)
            .move(embedded.data());
        return 0;
    });
    return to_numpy(std::move(embedded), points.shape(1));
}

// Targets (m,) are the sizes of regular ones, those (m, D, D) the inverses of the matrices of any.
using Sizes = Vector<const double>;
using Inverses = Matrices<const double>;
template <int D, class Targets>
using TargetOf = std::conditional_t<std::is_same_v<Targets, Sizes>, RegularTarget<D>, ShapedTarget<D>>;

template <class Targets>
auto foldover_energy_py(const Matrix<const std::int32_t>& simplices, const Matrix<const double>& points,
                        const Targets& targets, double eps, double weight, std::int64_t free, int threads) {
    const std::size_t d = points.shape(1);
    std::vector<double> gradient(static_cast<std::size_t>(free) * d);
    const EnergyValue value = with_dimension(d, [&](auto dimension) {
        Foldover<dimension, TargetOf<dimension, Targets>> energy(
            simplices.data(), static_cast<std::int64_t>(simplices.shape(0)), static_cast<std::int64_t>(points.shape(0)));
        return energy.evaluate(points.data(), targets.data(), {eps, weight}, free, gradient.data(), threads);
    });
    return std::make_tuple(value.energy, to_numpy(std::move(gradient), d), value.min_det);
}

// What of `Shape` is the same for all dimensions; owners (m,) the elements of the simplices.
struct ShapeArguments {
    const Matrix<const double>& points;
    const Matrix<const std::int32_t>& simplices;
    const Vector<const double>& corners;
    const Vector<const std::int32_t>& owners;
    const Matrix<const std::int32_t>& hexahedra;
    std::int64_t free;
    ShapeGoal goal;
    const Freedom* freedom;
    int threads;

    template <int D>
    Shape<D> make() const {
        return {points.data(), static_cast<std::int64_t>(points.shape(0)), free, simplices.data(),
                static_cast<std::int64_t>(simplices.shape(0)),
                {{corners.data(), corners.data() + corners.size()}, {owners.data(), owners.data() + owners.size()},
                 {hexahedra.data(), hexahedra.data() + hexahedra.size()}},
                goal, freedom, threads};
    }
};

auto shape_energy_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& simplices,
                     const Vector<const double>& corners, const Vector<const std::int32_t>& owners,
                     const Matrix<const std::int32_t>& hexahedra, std::int64_t free, double goal, double floor, double measure,
                     double weight, double sharpness, double evenness, int threads, const Freedom* freedom, double angle) {
    check_freedom(freedom, free);
    const std::size_t d = points.shape(1);
    const ShapeGoal aims{goal, floor, measure, weight, sharpness, evenness, angle};
    const ShapeArguments arguments{points, simplices, corners, owners, hexahedra, free, aims, freedom, threads};
    std::vector<double> gradient(static_cast<std::size_t>(free) * d);
    const double value = with_dimension(d, [&](auto dimension) {
        auto shape = arguments.make<dimension>();
        const Numbers x = shape.start();
        return shape(x.data(), gradient.data());
    });
    return std::make_tuple(value, to_numpy(std::move(gradient), d));
}

template <class Function>
std::vector<double> minimised(Function function, int iterations, int threads) {
    const std::int64_t size = function.size();
    Lbfgs<Function> lbfgs(std::move(function), size, threads);
    lbfgs.start();
    lbfgs.minimise(iterations);
    return lbfgs.function().free_points(lbfgs.x());
}

// The free points where so many iterations end.
auto shaped_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& simplices,
               const Vector<const double>& corners, const Vector<const std::int32_t>& owners,
               const Matrix<const std::int32_t>& hexahedra, std::int64_t free, double goal, double floor, double measure,
               double weight, double sharpness, double evenness, int iterations, int threads, const Freedom* freedom,
               double angle) {
    check_freedom(freedom, free);
    const std::size_t d = points.shape(1);
    const ShapeGoal aims{goal, floor, measure, weight, sharpness, evenness, angle};
    const ShapeArguments arguments{points, simplices, corners, owners, hexahedra, free, aims, freedom, threads};
    return to_numpy(with_dimension(d, [&](auto dimension) {
        auto shape = arguments.make<dimension>();
        return sharpness > 0.0 ? minimised(Scaled<Shape<dimension>>(std::move(shape)), iterations, threads)
                               : minimised(std::move(shape), iterations, threads);
    }), d);
}

// Minimises the energy for one eps after the other, each time from where the last one ended.
struct PyFoldover {
    template <int D, class Targets>
    using Minimiser = Lbfgs<FoldoverProblem<D, TargetOf<D, Targets>>>;

    std::variant<Minimiser<2, Sizes>, Minimiser<3, Sizes>, Minimiser<2, Inverses>, Minimiser<3, Inverses>> lbfgs;

    template <class F>
    auto with_problem(const F& f) {
        return std::visit([&](auto& minimiser) { return f(minimiser.function()); }, lbfgs);
    }
};

template <class Targets>
void init_foldover(PyFoldover* self, const Matrix<const double>& points, const Matrix<const std::int32_t>& simplices,
                   const Targets& targets, const Matrix<const double>& centres, double radius, bool drawn,
                   int threads, const Freedom* freedom) {
    check_freedom(freedom, static_cast<std::int64_t>(centres.shape(0)));
    new (self) PyFoldover(with_dimension(points.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        const FoldoverRegion<D> region{points.data(), static_cast<std::int64_t>(points.shape(0)), simplices.data(),
                                       targets.data(), static_cast<std::int64_t>(simplices.shape(0)), centres.data(),
                                       static_cast<std::int64_t>(centres.shape(0)), radius, drawn, freedom};
        PyFoldover::Minimiser<D, Targets> lbfgs({region, threads}, region.free * D, threads);
        lbfgs.start();
        return PyFoldover{std::move(lbfgs)};
    }));
}

auto minimise_py(PyFoldover& self, double eps, double weight, int iterations, double gain, double pull,
                 bool until_valid) {
    const nb::gil_scoped_release release;
    return std::visit(
        [&](auto& lbfgs) {
            lbfgs.function().regularisation = {eps, weight};
            lbfgs.function().gain = gain;
            lbfgs.function().pull = pull;
            lbfgs.function().until_valid = until_valid;
            const double before = lbfgs.start(), after = lbfgs.minimise(iterations);
            return std::make_pair(before, after);
        },
        self.lbfgs);
}

// The value and its gradient (free, D) at other variables; the next minimisation goes on from where the last one ended.
auto evaluate_py(PyFoldover& self, const Matrix<const double>& variables, double eps, double weight, double pull) {
    std::vector<double> gradient(variables.size());
    const double value = self.with_problem([&](auto& problem) {
        problem.regularisation = {eps, weight};
        problem.pull = pull;
        return problem(variables.data(), gradient.data());
    });
    return std::make_pair(value, to_numpy(std::move(gradient), variables.shape(1)));
}

template <class Targets>
void bind_foldover(nb::module_& m, nb::class_<PyFoldover>& foldover) {
    m.def("foldover_energy", &foldover_energy_py<Targets>, "simplices"_a.noconvert(), "points"_a.noconvert(),
          "targets"_a.noconvert(), "eps"_a, "weight"_a, "free"_a, "threads"_a);
    foldover.def("__init__", &init_foldover<Targets>, "points"_a.noconvert(), "simplices"_a.noconvert(),
                 "targets"_a.noconvert(), "centres"_a.noconvert(), "radius"_a, "drawn"_a, "threads"_a,
          "freedom"_a = nb::none());
}

}  // namespace

void bind_moves(nb::module_& m) {
    m.def("relocate", &relocate_py, "move"_a, "points"_a.noconvert(), "states"_a.noconvert(), "mesh"_a,
          "blocks"_a.noconvert(), "threshold_sine2"_a, "min_measure"_a, "start"_a.noconvert(), "max_move"_a,
          "threads"_a,
          "freedom"_a = nb::none());
    m.def("receive", &receive_py, "points"_a.noconvert(), "states"_a.noconvert(), "mesh"_a, "vertices"_a.noconvert(),
          "positions"_a.noconvert());
    m.def("exclusive", &exclusive_py, "points"_a.noconvert(), "mesh"_a, "movable"_a.noconvert(), "hopeless"_a.noconvert(),
          "vertices"_a.noconvert(), "threads"_a, "freedom"_a = nb::none());
    m.def("linear_program", &linear_program_py, "neighbours"_a.noconvert(), "faces"_a.noconvert(), "heights"_a);
    m.def("min_norm_point", &min_norm_point_py, "vectors"_a.noconvert());
    m.def("shape_energy", &shape_energy_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "corners"_a.noconvert(),
          "owners"_a.noconvert(), "hexahedra"_a.noconvert(), "free"_a, "goal"_a, "floor"_a, "measure"_a, "weight"_a,
          "sharpness"_a, "evenness"_a, "threads"_a, "freedom"_a = nb::none(), "angle"_a = SHAPE_ANGLE);
    m.def("shaped", &shaped_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "corners"_a.noconvert(),
          "owners"_a.noconvert(), "hexahedra"_a.noconvert(), "free"_a, "goal"_a, "floor"_a, "measure"_a, "weight"_a,
          "sharpness"_a, "evenness"_a, "iterations"_a, "threads"_a, "freedom"_a = nb::none(), "angle"_a = SHAPE_ANGLE);
    m.def("mean_ratio", &mean_ratio_py, "neighbours"_a.noconvert(), "faces"_a.noconvert(), "x"_a.noconvert());
    m.attr("DONE") = DONE;
    m.attr("DUE") = DUE;

    m.def("embedding", &embedding_py, "points"_a.noconvert(), "mesh"_a, "free"_a.noconvert(), "edges"_a,
          "weights"_a.noconvert(), "threads"_a,
          "freedom"_a = nb::none());
    nb::class_<PyFoldover> foldover(m, "Foldover");
    bind_foldover<Sizes>(m, foldover);
    bind_foldover<Inverses>(m, foldover);
    foldover.def("minimise", &minimise_py, "eps"_a, "weight"_a, "iterations"_a, "gain"_a, "pull"_a = 0.0,
                 "until_valid"_a = true)
        .def("evaluate", &evaluate_py, "variables"_a.noconvert(), "eps"_a, "weight"_a, "pull"_a)
        .def("points", [](PyFoldover& self) {
            return self.with_problem(
                [](auto& p) { return to_numpy(p.free_points(), static_cast<std::size_t>(p.DIMENSION)); });
        })
        .def_prop_ro("min_det", [](PyFoldover& self) { return self.with_problem([](auto& p) { return p.min_det(); }); })
        .def_prop_ro("evaluations",
                     [](PyFoldover& self) { return self.with_problem([](auto& p) { return p.evaluations(); }); });

    static_assert(static_cast<int>(Move::untangle_most) == 11, "the codes of strategies.Move");
}

}  // namespace meshfix
