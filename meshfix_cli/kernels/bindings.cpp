// The one binding file. Python checks shapes, indices and finiteness before it calls; nothing here throws because
// of data, but for a star too large to number. d = 2 or 3 is read off the arrays.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <numeric>
#include <variant>

#include "crossings.hpp"
#include "foldover.hpp"
#include "measures.hpp"
#include "relocate.hpp"
#include "stars.hpp"
#include "text.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace meshfix;

namespace {

template <class T>
using Matrix = nb::ndarray<T, nb::numpy, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
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

// Calls f with the dimension as a compile-time constant, without the interpreter lock.
template <class F>
auto with_dimension(std::size_t d, const F& f) {
    if (d != 2 && d != 3) throw nb::value_error("the dimension must be 2 or 3");
    const nb::gil_scoped_release release;
    return d == 2 ? f(std::integral_constant<int, 2>{}) : f(std::integral_constant<int, 3>{});
}

struct PyConnectivity {
    int dimension = 0;
    Connectivity mesh{};
    std::mutex building{};  // of the stars, which come later
    std::atomic<bool> has_stars{false};
};

template <auto Member>
auto view(PyConnectivity& self) {
    auto& values = self.mesh.*Member;
    using T = typename std::remove_reference_t<decltype(values)>::value_type;
    return Vector<const T>(values.data(), {values.size()}, nb::find(self));
}

template <auto Member>
auto rows_view(PyConnectivity& self) {
    auto& values = self.mesh.*Member;
    using T = typename std::remove_reference_t<decltype(values)>::value_type;
    const std::size_t columns = static_cast<std::size_t>(self.dimension) + 1;
    return Matrix<const T>(values.data(), {values.size() / columns, columns}, nb::find(self));
}

const std::uint8_t* bytes_of(const Vector<const bool>& mask, std::int64_t expected) {
    if (static_cast<std::int64_t>(mask.shape(0)) != expected) throw nb::value_error("the mask is of another mesh");
    return reinterpret_cast<const std::uint8_t*>(mask.data());
}

template <class T>
void check_points(const Matrix<T>& points, const PyConnectivity& self) {
    if (static_cast<int>(points.shape(1)) != self.dimension || static_cast<std::int64_t>(points.shape(0)) != self.mesh.n())
        throw nb::value_error("the points are of another mesh");
}

// A star given by itself, in its local frame.
template <int D>
Star<D> make_star(const Matrix<const double>& neighbours, const Matrix<const std::uint16_t>& faces, const double* x) {
    Star<D> star;
    for (std::size_t j = 0; j < neighbours.shape(0); ++j) {
        star.neighbours.push_back(load<D>(neighbours.data() + j * D));
        star.radius = std::max(star.radius, std::sqrt(norm2(star.neighbours.back())));
    }
    star.faces = faces.data();
    star.faces_count = static_cast<int>(faces.shape(0));
    star.position = load<D>(x);
    star.fill_blocks();
    return star;
}

void init_connectivity(PyConnectivity* self, const Matrix<const double>& points,
                       const Matrix<const std::int32_t>& simplices, const Vector<const std::int32_t>& used, int threads) {
    if (simplices.shape(1) != points.shape(1) + 1) throw nb::value_error("the simplices are of another dimension");
    new (self) PyConnectivity();
    self->dimension = static_cast<int>(points.shape(1));
    self->mesh = with_dimension(points.shape(1), [&](auto d) {
        return connect<d>(points.data(), static_cast<std::int64_t>(points.shape(0)), simplices.data(),
                          static_cast<std::int64_t>(simplices.shape(0)),
                          std::vector<std::int32_t>(used.data(), used.data() + used.shape(0)), threads);
    });
}

PyConnectivity* part_py(const Matrix<const std::int32_t>& simplices, std::int64_t n, int threads) {
    auto self = std::make_unique<PyConnectivity>();
    self->dimension = static_cast<int>(simplices.shape(1)) - 1;
    self->mesh = with_dimension(simplices.shape(1) - 1, [&](auto d) {
        return part_of_mesh<d>(simplices.data(), static_cast<std::int64_t>(simplices.shape(0)), n, threads);
    });
    return self.release();
}

void flip_py(PyConnectivity& self, const Vector<const bool>& flipped, int threads) {
    const std::uint8_t* mask = bytes_of(flipped, self.mesh.m());
    with_dimension(self.dimension, [&](auto d) { flip<d>(self.mesh, mask, threads); });
}

void build_stars_py(PyConnectivity& self, int threads) {
    with_dimension(self.dimension, [&](auto d) {  // the interpreter lock is released first: nobody waits for both
        const std::lock_guard<std::mutex> lock(self.building);
        if (self.has_stars) return;
        build_stars<d>(self.mesh, threads);
        self.has_stars = true;
    });
}

// All but the stars, which are built again.
nb::tuple state_of(PyConnectivity& self) {
    return nb::make_tuple(self.dimension, self.mesh.orientable, rows_view<&Connectivity::simplices>(self),
                          rows_view<&Connectivity::mates>(self), view<&Connectivity::vertices>(self),
                          view<&Connectivity::rows>(self), view<&Connectivity::offsets>(self),
                          view<&Connectivity::corners>(self), view<&Connectivity::component>(self),
                          view<&Connectivity::against>(self));
}

template <class Array>
auto copied(const Array& array) {
    return std::vector<std::remove_const_t<typename Array::Scalar>>(array.data(), array.data() + array.size());
}

using Int32s = Vector<const std::int32_t>;
using Int32Rows = Matrix<const std::int32_t>;
using State = std::tuple<int, bool, Int32Rows, Int32Rows, Int32s, Int32s, Int32s, Int32s, Int32s, Vector<const std::uint8_t>>;

void restore(PyConnectivity& self, const State& state) {
    new (&self) PyConnectivity();
    Connectivity& mesh = self.mesh;
    self.dimension = std::get<0>(state);
    mesh.orientable = std::get<1>(state);
    mesh.simplices = copied(std::get<2>(state));
    mesh.mates = copied(std::get<3>(state));
    mesh.vertices = copied(std::get<4>(state));
    mesh.rows = copied(std::get<5>(state));
    mesh.offsets = copied(std::get<6>(state));
    mesh.corners = copied(std::get<7>(state));
    mesh.component = copied(std::get<8>(state));
    mesh.against = copied(std::get<9>(state));
}

auto grown_py(const PyConnectivity& self, const Vector<const bool>& mask, int rings) {
    const std::uint8_t* bytes = bytes_of(mask, self.mesh.n());
    std::vector<std::uint8_t> marked(bytes, bytes + self.mesh.n());
    with_dimension(self.dimension, [&](auto d) {
        for (int ring = 0; ring < rings; ++ring) grow<d>(self.mesh, marked);
    });
    return to_numpy(std::move(marked));
}

auto stuck_py(const PyConnectivity& self, const Vector<const bool>& movable, int threads) {
    const std::uint8_t* mask = bytes_of(movable, self.mesh.n());
    return to_numpy(with_dimension(self.dimension, [&](auto d) {
        return stuck_simplices<d>(self.mesh.simplices.data(), self.mesh.m(), mask, threads);
    }));
}

auto fixed_facets_py(const PyConnectivity& self, const Vector<const bool>& movable, int threads) {
    const std::uint8_t* mask = bytes_of(movable, self.mesh.n());
    FixedFacets found = with_dimension(self.dimension, [&](auto d) {
        return fixed_facets<d>(self.mesh.simplices.data(), self.mesh.mates.data(), self.mesh.m(), mask, threads);
    });
    return std::make_pair(to_numpy(std::move(found.vertices), static_cast<std::size_t>(self.dimension)),
                          to_numpy(std::move(found.owners)));
}

auto summarise_py(const PyConnectivity& self, const Matrix<const double>& points, int bins, double width, int threads) {
    check_points(points, self);
    Summary total = with_dimension(self.dimension, [&](auto d) {
        return summarise<d>(points.data(), self.mesh.simplices.data(), self.mesh.mates.data(), self.mesh.m(), bins, width,
                            threads);
    });
    return std::make_tuple(to_numpy(std::move(total.smallest)), to_numpy(std::move(total.histogram)), total.sum,
                           to_numpy(std::move(total.inverted)), total.folded, total.min_measure, total.largest);
}

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

auto mean_angle_py(const Matrix<const double>& neighbours, const Matrix<const std::uint16_t>& faces,
                   const Vector<const double>& x) {
    return with_dimension(neighbours.shape(1), [&](auto dimension) {
        constexpr int D = dimension;
        const Star<D> star = make_star<D>(neighbours, faces, x.data());
        MeanAngle<D> angle;
        angle.allowed.assign(star.blocks.size(), constant<Pack>(1.0));
        const Vec<D> slope = MeanAngle<D>::slope(star, star.position);
        return std::make_pair(angle.at(star, star.position), std::vector<double>(slope.begin(), slope.end()));
    });
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

auto used_vertices_py(const Matrix<const std::int32_t>& simplices, std::int64_t n) {
    return to_numpy(used_vertices(simplices.data(), static_cast<std::int64_t>(simplices.size()), n));
}

auto check_simplices_py(const Matrix<const std::int32_t>& simplices, std::int64_t n, int threads) {
    const auto m = static_cast<std::int64_t>(simplices.shape(0));
    const auto columns = static_cast<std::int64_t>(simplices.shape(1));
    struct Bad {
        std::int64_t outside = -1, repeated = -1;
    };
    std::vector<Bad> parts(m / PER_ITEM + 1);
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        for (std::int64_t s = end; s-- > begin;) {
            const std::int32_t* row = simplices.data() + s * columns;
            for (std::int64_t i = 0; i < columns; ++i) {
                if (row[i] < 0 || row[i] >= n) parts[item].outside = s;
                for (std::int64_t j = 0; j < i; ++j)
                    if (row[i] == row[j]) parts[item].repeated = s;
            }
        }
    });
    Bad first;
    for (const auto& part : parts) {
        if (first.outside < 0) first.outside = part.outside;
        if (first.repeated < 0) first.repeated = part.repeated;
    }
    return std::make_pair(first.outside, first.repeated);
}

StarsView stars_of(const Connectivity& mesh) {
    return {mesh.offsets.data(), mesh.faces.data(), mesh.neighbour_offsets.data(), mesh.neighbours.data()};
}

auto relocate_py(int move, const Matrix<double>& points, const Vector<std::uint8_t>& states, const PyConnectivity& self,
                 const Vector<const std::int32_t>& blocks, double threshold_sine2, double min_measure,
                 const Matrix<const double>& start, double max_move, int threads) {
    const Connectivity& mesh = self.mesh;
    if (!self.has_stars) throw nb::value_error("the stars are not built");
    check_points(points, self);
    check_points(start, self);
    if (static_cast<std::int64_t>(states.shape(0)) != mesh.n()) throw nb::value_error("the states are of another mesh");
    const Counts counts = with_dimension(points.shape(1), [&](auto d) {
        return relocate<d>(static_cast<Move>(move), stars_of(mesh), points.data(), states.data(), mesh.n(), blocks.data(),
                           static_cast<std::int64_t>(blocks.shape(0)),
                           Parameters{threshold_sine2, factorial(d) * min_measure, start.data(), max_move}, threads);
    });
    return std::make_pair(counts.visited, counts.moved);
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
                valid[s] = is_valid<D>(e, det);
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
                               [&](std::int64_t s, const Edges<D>&, AngleRange range) {
                                   smallest[s] = range.smallest;
                                   largest[s] = range.largest;
                               });
        });
    });
    return std::make_pair(to_numpy(std::move(smallest)), to_numpy(std::move(largest)));
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

auto crossings_py(const Matrix<const double>& points, const Matrix<const std::int32_t>& facets, int threads) {
    const auto count = static_cast<std::int64_t>(facets.shape(0));
    std::vector<std::int32_t> pairs = with_dimension(
        points.shape(1), [&](auto d) { return Crossings<d>(points.data(), facets.data(), count, threads).find(threads); });
    return to_numpy(std::move(pairs), 2);
}

// Holds the connectivity of one minimisation.
struct PyFoldover {
    std::variant<Foldover<2>, Foldover<3>> energy;
};

void init_foldover(PyFoldover* self, const Matrix<const std::int32_t>& simplices, std::int64_t n) {
    const auto m = static_cast<std::int64_t>(simplices.shape(0));
    if (simplices.shape(1) == 3) {
        new (self) PyFoldover{Foldover<2>(simplices.data(), m, n)};
    } else {
        new (self) PyFoldover{Foldover<3>(simplices.data(), m, n)};
    }
}

auto evaluate_py(PyFoldover& self, const Matrix<const double>& points, const Vector<const double>& sizes, double eps,
                 double weight, std::int64_t free, int threads) {
    const std::size_t d = points.shape(1);
    std::vector<double> gradient(static_cast<std::size_t>(free) * d);
    EnergyValue value;
    {
        const nb::gil_scoped_release release;
        value = std::visit(
            [&](auto& energy) {
                return energy.evaluate(points.data(), sizes.data(), Regularisation{eps, weight}, free,
                                       gradient.data(), threads);
            },
            self.energy);
    }
    return std::make_tuple(value.energy, to_numpy(std::move(gradient), d), value.min_det);
}

std::string_view view_of(const nb::bytes& data) { return {data.c_str(), data.size()}; }

std::string_view word_at(std::string_view text, const std::int64_t* span) {
    const auto size = static_cast<std::int64_t>(text.size());
    if (span[0] < 0 || span[1] < span[0] || span[1] > size) return {};
    return text.substr(static_cast<std::size_t>(span[0]), static_cast<std::size_t>(span[1] - span[0]));
}

auto find_words_py(const nb::bytes& data, std::int64_t at, std::int64_t count) {
    return to_numpy(find_words(view_of(data), at, count, text_threads), 2);
}

auto line_words_py(const nb::bytes& data, const Vector<const std::int64_t>& offsets, std::int64_t count) {
    const std::string_view text = view_of(data);
    std::vector<std::int64_t> spans;
    for (std::size_t i = 0; i < offsets.shape(0); ++i) {
        Span word{offsets(i), offsets(i)};
        for (std::int64_t j = 0; j < count; ++j) {
            if (word.end >= 0) word = next_word(text, word.end, true);
            spans.insert(spans.end(), {word.begin, word.end});
        }
    }
    return to_numpy(std::move(spans), 2);
}

std::int64_t behind_words_py(const nb::bytes& data, std::int64_t at, std::int64_t count) {
    return behind_words(view_of(data), at, count, text_threads);
}

template <class T>
nb::tuple integers_of(Integers<T>&& read) {
    return nb::make_tuple(to_numpy(std::move(read.values)), read.end, read.bad);
}

// In 32 bits where that is enough.
nb::tuple scan_integers_py(const nb::bytes& data, std::int64_t at, std::int64_t count) {
    auto read = read_integers<std::int32_t>(view_of(data), at, count, text_threads);
    if (read.fit) return integers_of(std::move(read));
    return integers_of(read_integers<std::int64_t>(view_of(data), at, count, text_threads));
}

template <class Real, class Value, class Read>
auto read_words(const nb::bytes& data, const Matrix<const std::int64_t>& spans, const Read& read) {
    const std::string_view text = view_of(data);
    const auto count = static_cast<std::int64_t>(spans.shape(0));
    std::vector<Value> values(spans.shape(0));
    std::vector<std::int64_t> bad(count / PER_ITEM + 1, -1);
    for_each_range(count, PER_ITEM, text_threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        for (std::int64_t i = begin; i < end && bad[item] < 0; ++i) {
            Real value{};
            if (!read(word_at(text, spans.data() + 2 * i), value)) bad[item] = i;
            values[i] = static_cast<Value>(value);
        }
    });
    const auto first = std::find_if(bad.begin(), bad.end(), [](std::int64_t row) { return row >= 0; });
    return std::make_pair(to_numpy(std::move(values)), first == bad.end() ? -1 : *first);
}

auto integers_py(const nb::bytes& data, const Matrix<const std::int64_t>& spans, bool slash) {
    return read_words<std::int64_t, std::int64_t>(
        data, spans, [slash](std::string_view word, std::int64_t& value) { return read_integer(word, value, slash); });
}

auto numbers_py(const nb::bytes& data, const Matrix<const std::int64_t>& spans, bool single) {
    return single ? read_words<float, double>(data, spans, read_number<float>)
                  : read_words<double, double>(data, spans, read_number<double>);
}

auto shortest_py(const Vector<const double>& values, bool single, int longest) {
    const auto count = static_cast<std::int64_t>(values.shape(0));
    std::vector<std::string> parts(count / PER_ITEM + 1);
    std::vector<std::int64_t> spans(2 * count);
    for_each_range(count, PER_ITEM, text_threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        for (std::int64_t i = begin; i < end; ++i) {
            spans[2 * i] = static_cast<std::int64_t>(parts[item].size());
            parts[item] += single ? shortest(static_cast<float>(values(i)), longest) : shortest(values(i), longest);
            spans[2 * i + 1] = static_cast<std::int64_t>(parts[item].size());
        }
    });
    std::string words;
    for (std::size_t item = 0; item < parts.size(); ++item) {
        const std::int64_t end = std::min<std::int64_t>(count, (item + 1) * PER_ITEM);
        for (std::int64_t i = 2 * item * PER_ITEM; i < 2 * end; ++i) spans[i] += static_cast<std::int64_t>(words.size());
        words += parts[item];
    }
    return std::make_pair(nb::bytes(words.data(), words.size()), to_numpy(std::move(spans), 2));
}

// A span that is not in the text counts as empty, and so where it is put.
nb::bytes replace_py(const nb::bytes& data, const Matrix<const std::int64_t>& spans, const nb::bytes& words,
                     const Matrix<const std::int64_t>& word_spans) {
    const std::string_view text = view_of(data), replacements = view_of(words);
    const auto count = static_cast<std::int64_t>(spans.shape(0));
    const auto word = [&](std::int64_t i) { return word_at(replacements, word_spans.data() + 2 * i); };
    const auto before = [&](std::int64_t i) {  // what stays in front of span i; of `count`, what is left
        const std::int64_t kept[2] = {i > 0 ? spans(i - 1, 1) : 0,
                                      i < count ? spans(i, 0) : static_cast<std::int64_t>(text.size())};
        return word_at(text, kept);
    };
    std::vector<std::int64_t> starts(count / PER_ITEM + 2, 0);  // where in the result each item begins
    for (std::int64_t i = 0; i < count; ++i) {
        if (spans(i, 0) < (i > 0 ? spans(i - 1, 1) : 0)) throw nb::value_error("the spans overlap or are not in order");
        starts[i / PER_ITEM + 1] += static_cast<std::int64_t>(before(i).size() + word(i).size());
    }
    starts.back() += static_cast<std::int64_t>(before(count).size());
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    auto result = nb::steal<nb::bytes>(PyBytes_FromStringAndSize(nullptr, static_cast<Py_ssize_t>(starts.back())));
    if (!result.is_valid()) nb::raise_python_error();
    char* out = PyBytes_AsString(result.ptr());
    for_each_range(count + 1, PER_ITEM, text_threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        char* to = out + starts[item];
        const auto put = [&to](std::string_view part) { to = std::copy(part.begin(), part.end(), to); };
        for (std::int64_t i = begin; i < end; ++i) {
            put(before(i));
            if (i < count) put(word(i));
        }
    });
    return result;
}

}  // namespace

// Built once for any processor and, where the compiler can, once for those with wider vectors; see _kernels.py.
#define MODULE(name, variable) NB_MODULE(name, variable)
MODULE(MESHFIX_MODULE, m) {
#if defined(__x86_64__) && defined(__GNUC__)
    m.def("has_avx2", [] { return __builtin_cpu_supports("avx2") != 0; });
#else
    m.def("has_avx2", [] { return false; });
#endif
    m.attr("LANES") = LANES;
    m.def("check_simplices", &check_simplices_py, "simplices"_a.noconvert(), "n"_a, "threads"_a);
    m.def("used_vertices", &used_vertices_py, "simplices"_a.noconvert(), "n"_a);
    m.def("check", &check_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "threads"_a);
    m.def("moved", &moved_py, "before"_a.noconvert(), "after"_a.noconvert(), "threads"_a);
    m.def("min_sine2", &min_sine2_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "threads"_a);
    m.def("measure", &measure_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "threads"_a);
    m.def("angles", &angles_py, "points"_a.noconvert(), "simplices"_a.noconvert(), "threads"_a);
    m.def("relocate", &relocate_py, "move"_a, "points"_a.noconvert(), "states"_a.noconvert(), "mesh"_a,
          "blocks"_a.noconvert(), "threshold_sine2"_a, "min_measure"_a, "start"_a.noconvert(), "max_move"_a,
          "threads"_a);
    m.def("receive", &receive_py, "points"_a.noconvert(), "states"_a.noconvert(), "mesh"_a, "vertices"_a.noconvert(),
          "positions"_a.noconvert());
    m.def("linear_program", &linear_program_py, "neighbours"_a.noconvert(), "faces"_a.noconvert(), "heights"_a);
    m.def("crossings", &crossings_py, "points"_a.noconvert(), "facets"_a.noconvert(), "threads"_a);
    m.def("min_norm_point", &min_norm_point_py, "vectors"_a.noconvert());
    m.def("sines", &sines_py, "neighbours"_a.noconvert(), "faces"_a.noconvert(), "x"_a.noconvert());
    m.def("mean_angle", &mean_angle_py, "neighbours"_a.noconvert(), "faces"_a.noconvert(), "x"_a.noconvert());
    m.def("mean_ratio", &mean_ratio_py, "neighbours"_a.noconvert(), "faces"_a.noconvert(), "x"_a.noconvert());
    m.def("find_words", &find_words_py, "data"_a, "at"_a, "count"_a);
    m.def("line_words", &line_words_py, "data"_a, "offsets"_a.noconvert(), "count"_a);
    m.def("behind_words", &behind_words_py, "data"_a, "at"_a, "count"_a);
    m.def("use_threads", [](int threads) { text_threads = threads; }, "threads"_a);
    m.def("scan_integers", &scan_integers_py, "data"_a, "at"_a, "count"_a);
    m.def("integers", &integers_py, "data"_a, "spans"_a.noconvert(), "slash"_a);
    m.def("numbers", &numbers_py, "data"_a, "spans"_a.noconvert(), "single"_a);
    m.def("shortest", &shortest_py, "values"_a.noconvert(), "single"_a, "longest"_a);
    m.def("replace", &replace_py, "data"_a, "spans"_a.noconvert(), "words"_a, "word_spans"_a.noconvert());

    nb::class_<PyFoldover>(m, "Foldover")
        .def("__init__", &init_foldover, "simplices"_a.noconvert(), "n"_a)
        .def("evaluate", &evaluate_py, "points"_a.noconvert(), "sizes"_a.noconvert(), "eps"_a, "weight"_a, "free"_a,
             "threads"_a);

    nb::class_<PyConnectivity>(m, "Connectivity")
        .def("__init__", &init_connectivity, "points"_a.noconvert(), "simplices"_a.noconvert(), "used"_a.noconvert(),
             "threads"_a)
        .def("__getstate__", &state_of)
        .def("__setstate__", &restore)
        .def_static("part", &part_py, "simplices"_a.noconvert(), "n"_a, "threads"_a)
        .def("flip", &flip_py, "flipped"_a.noconvert(), "threads"_a)
        .def("build_stars", &build_stars_py, "threads"_a)
        .def("grown", &grown_py, "mask"_a.noconvert(), "rings"_a)
        .def("stuck", &stuck_py, "movable"_a.noconvert(), "threads"_a)
        .def("fixed_facets", &fixed_facets_py, "movable"_a.noconvert(), "threads"_a)
        .def("summarise", &summarise_py, "points"_a.noconvert(), "bins"_a, "width"_a, "threads"_a)
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
    m.attr("BLOCK_SIZE") = BLOCK_SIZE;
    m.attr("DUE") = DUE;

    static_assert(static_cast<int>(Move::mean_angle) == 8, "the codes of untangle.Move");
}
