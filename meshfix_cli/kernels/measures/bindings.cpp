// Bindings of the passes that measure a mesh, and of the sines of a star.
#include "measures/elements.hpp"
#include "measures/measures.hpp"
#include "measures/python.hpp"
#include "mesh/python.hpp"

namespace meshfix {

namespace {

auto summarise_py(const Matrix<const double>& points, const PyConnectivity& self, int bins, double width, int threads) {
    check_points(points, self);
    Summary total = with_dimension(self.dimension, [&](auto d) {
        return summarise<d>(points.data(), self.mesh.simplices.data(), self.mesh.mates.empty() ? nullptr : self.mesh.mates.data(), self.mesh.m(), bins, width,
                            threads);
    });
    return std::make_tuple(to_numpy(std::move(total.smallest)), to_numpy(std::move(total.histogram)), total.sum,
                           to_numpy(std::move(total.validity.inverted)), total.folded, total.validity.min_measure,
                           total.largest);
}

auto check_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& simplices, int threads) {
    Validity total = with_dimension(points.shape(1), [&](auto d) {
        return check<d>(points.data(), simplices.data(), static_cast<std::int64_t>(simplices.shape(0)), threads);
    });
    return std::make_pair(to_numpy(std::move(total.inverted)), total.min_measure);
}

double min_sine2_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& simplices, int threads) {
    return with_dimension(points.shape(1), [&](auto d) {
        return min_sine2<d>(points.data(), simplices.data(), static_cast<std::int64_t>(simplices.shape(0)), threads);
    });
}

auto below_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& simplices, double least, int threads) {
    return to_numpy(with_dimension(points.shape(1), [&](auto d) {
        return below<d>(points.data(), simplices.data(), static_cast<std::int64_t>(simplices.shape(0)), least, threads);
    }));
}

auto measure_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& simplices, int threads) {
    const auto m = static_cast<std::int64_t>(simplices.shape(0));
    std::vector<double> measure(m);
    std::vector<std::uint8_t> valid(m);
    with_dimension(points.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t s = begin; s < end; ++s) {
                const Edges<D> e = edges_of<D>(points.data(), simplices.data() + s * (D + 1));
                const double det = determinant(e);
                measure[s] = det / factorial(D);
                valid[s] = is_valid<D>(e, det, [&] { return corners_of<D>(points.data(), simplices.data() + s * (D + 1)); });
            }
        });
    });
    return std::make_pair(to_numpy(std::move(measure)), to_numpy(std::move(valid)));
}

auto angles_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& simplices, int threads) {
    const std::size_t m = simplices.shape(0);
    std::vector<double> smallest(m), largest(m);
    with_dimension(points.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        for_each_range(static_cast<std::int64_t>(m), PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for_each_angles<D>(points.data(), simplices.data(), begin, end,
                               [&](std::int64_t s, AngleRange range) {
                                   smallest[s] = range.smallest;
                                   largest[s] = range.largest;
                               });
        });
    });
    return std::make_pair(to_numpy(std::move(smallest)), to_numpy(std::move(largest)));
}

auto sines_py(const Matrix<const double>& neighbours, const Matrix<const std::uint16_t>& faces,
              const Vector<const double>& x) {
    const std::size_t d = neighbours.shape(1);
    auto [values, gradients, smallest] = with_dimension(d, [&](auto dimension) {
        constexpr int D = dimension;
        const Star<D> star = make_star<D>(neighbours, faces, x.data());
        std::vector<double> values, gradients;
        for (int i = 0; i < star.faces_count; ++i) {
            std::array<Sine<D>, functions_per_simplex(D)> functions;
            sines(star.edges(i, star.position), functions.data());
            for (const auto& f : functions) {
                values.push_back(f.value);
                gradients.insert(gradients.end(), f.gradient.begin(), f.gradient.end());
            }
        }
        return std::make_tuple(values, gradients, min_sine2<D>(star, star.position, 0.0));
    });
    return std::make_tuple(to_numpy(std::move(values)), to_numpy(std::move(gradients), d), smallest);
}

auto judge_py(const Matrix<const double>& points, const Vector<const std::uint8_t>& codes,
              const Vector<const std::int32_t>& offsets, const Vector<const std::int32_t>& nodes, int threads) {
    const ElementsView elements{codes.data(), offsets.data(), nodes.data(), static_cast<std::int64_t>(codes.shape(0))};
    Judgement found = with_dimension(points.shape(1), [&](auto d) {
        return judge<d>(points.data(), elements, threads);
    });
    return std::make_tuple(to_numpy(std::move(found.verdict)), to_numpy(std::move(found.measure)),
                           to_numpy(std::move(found.quality)));
}

// Functions of the C library, element by element: numpy's own have other last bits where a processor has wider vectors.
template <double (*F)(double)>
auto of_each_py(const Vector<const double>& values) {
    std::vector<double> found(values.shape(0));
    std::transform(values.data(), values.data() + found.size(), found.begin(), F);
    return to_numpy(std::move(found));
}

// The nodes of one element.
template <int D>
std::array<Vec<D>, MOST_NODES> nodes_of(const Matrix<const double>& rows) {
    std::array<Vec<D>, MOST_NODES> nodes{};
    const auto count = std::min<std::size_t>(rows.shape(0), MOST_NODES);
    for (std::size_t i = 0; i < count; ++i) nodes[i] = load<D>(rows.data() + i * D);
    return nodes;
}

auto coefficients_py(const Matrix<const double>& rows, std::uint8_t code) {
    std::vector<double> values(MOST_COEFFICIENTS);
    values.resize(with_dimension(rows.shape(1), [&](auto dimension) {
        return coefficients(code, nodes_of<dimension>(rows).data(), values.data());
    }));
    return to_numpy(std::move(values));
}

auto coefficient_columns_py(const Matrix<const double>& rows, std::uint8_t code, int node) {
    std::vector<double> values, gradients;
    with_dimension(rows.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        const auto nodes = nodes_of<D>(rows);
        for_each_dependent_coefficient(code, nodes.data(), node, [&](double value, const Vec<D>& gradient) {
            values.push_back(value);
            gradients.insert(gradients.end(), gradient.begin(), gradient.end());
        });
    });
    return std::make_pair(to_numpy(std::move(values)), to_numpy(std::move(gradients), rows.shape(1)));
}

// The table of shapes.hpp: dimension, nodes, simplices, facets, the mirrored order and the weight.
auto shapes_py() {
    using Rows = std::vector<std::vector<int>>;
    std::vector<std::tuple<int, int, Rows, Rows, std::vector<int>, double>> table;
    for (const ElementShape& shape : SHAPES) {
        Rows simplices, facets;
        for (int c = 0; c < shape.simplices; ++c)
            simplices.emplace_back(shape.simplex[c].begin(), shape.simplex[c].begin() + shape.dimension + 1);
        for (int k = 0; k < shape.facets; ++k)
            facets.emplace_back(shape.facet[k].begin(), shape.facet[k].begin() + shape.facet_size(k));
        const std::vector<int> mirrored(shape.mirrored.begin(), shape.mirrored.begin() + shape.nodes);
        table.emplace_back(shape.dimension, shape.nodes, simplices, facets, mirrored, shape.weight);
    }
    return table;
}

}  // namespace

void bind_measures(nb::module_& m) {
    m.def("summarise", &summarise_py, "points"_a.noconvert(), "mesh"_a, "bins"_a, "width"_a, "threads"_a);
    m.def("check", &check_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "threads"_a);
    m.def("min_sine2", &min_sine2_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "threads"_a);
    m.def("below", &below_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "least"_a, "threads"_a);
    m.def("measure", &measure_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "threads"_a);
    m.def("angles", &angles_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "threads"_a);
    m.def("judge", &judge_py, "points"_a.noconvert(), "codes"_a.noconvert(), "offsets"_a.noconvert(),
          "nodes"_a.noconvert(), "threads"_a);
    m.def("coefficients", &coefficients_py, "nodes"_a.noconvert(), "code"_a);
    m.def("coefficient_columns", &coefficient_columns_py, "nodes"_a.noconvert(), "code"_a, "node"_a);
    m.attr("SHAPES") = nb::cast(shapes_py());
    m.def("arcsin", &of_each_py<std::asin>, "values"_a.noconvert());
    m.def("arccos", &of_each_py<std::acos>, "values"_a.noconvert());
    m.def("sin", &of_each_py<std::sin>, "values"_a.noconvert());
    m.def("sines", &sines_py, "neighbours"_a.noconvert(), "faces"_a.noconvert(), "x"_a.noconvert());
}

}  // namespace meshfix
