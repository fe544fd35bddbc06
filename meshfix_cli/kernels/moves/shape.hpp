// The shape of a valid mesh as one function of all its free vertices, and its gradient:
//
//     sum over simplices of
//         - RATIO mean ratio - angle t + weight (max(0, goal - t)^2 + FLOOR max(0, floor - t)^2)
//         + MEASURE max(0, 1 + MARGIN - det / least)^2,
//
// t the smallest angle in degrees; the goal lifts the few that are worse than the others, the floor holds the worst, and
// the last term the smallest determinant, where `least` is positive.
// Where elements are not all simplices, of their corners
//         - RATIO (q + evenness r) + weight (...), q the scaled Jacobian, t its arc sine in degrees, r the mean ratio
// of the corner to one whose edges are as long and whose scaled Jacobian is 1;
// where the sharpness k is not 0, the q of an element's n corners have their place taken by n times what lies between
// their mean and their smallest, -1/k log (1/n sum exp(-k q)): elements are judged by their worst corners.
// Scaled Jacobians do not mind edges that shrink to nothing, which stop the minimiser; the mean ratio does.
// A hexahedron's centre, of which its scaled Jacobian takes account, counts as one more corner of it then, but for the
// evenness: good corners do not keep opposite faces from turning against each other.
//
// It is infinite where a simplex has no positive determinant, so that a minimiser that starts from a valid mesh never
// leaves those. The mean ratio is that of P. Knupp, "Algebraic mesh quality metrics", SIAM J. Sci. Comput. 23 (2001).
#pragma once

#include "measures/angles.hpp"
#include "moves/assembly.hpp"
#include "moves/lbfgs.hpp"

namespace meshfix {

struct ShapeGoal {
    double degrees, floor, measure, weight, sharpness;
    double evenness;
    double angle;  // what a degree of a smallest angle is worth
};

// Of the simplices that are corners of elements: their weights of scaled Jacobians, 0 for others, and their elements,
// one behind the other; or none. And for each of these elements its nodes (8), if it is a hexahedron whose centre counts,
// else numbers below 0; or none.
struct ShapeCorners {
    std::vector<double> weights;
    std::vector<std::int32_t> owners, hexahedra;
};

// Where a hexahedron's nodes lie along its axes: at the ends, or at the beginnings.
constexpr double HEXAHEDRON_SIDES[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                                           {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};

// Adds `factor` times the gradient of the k-th angle by the corners, in radians: a corner that moves away from the
// plane, or line, of a face turns that by the inverse of its distance from the edge that both faces share.
inline void add_slopes_of_angle(const Edges<2>& e, std::size_t k, double factor, Corners<2>& slopes) {
    const auto n = normals(e);
    const auto [i, j] = FACES_AT<2>[k];
    const Vec<2> at_i = (factor / norm2(n[j])) * n[j], at_j = (factor / norm2(n[i])) * n[i];
    slopes[i] = slopes[i] + at_i;
    slopes[j] = slopes[j] + at_j;
    slopes[3 - i - j] = slopes[3 - i - j] - at_i - at_j;
}
inline void add_slopes_of_angle(const Edges<3>& e, std::size_t k, double factor, Corners<3>& slopes) {
    static constexpr std::array<std::array<int, 2>, 6> SHARED = {{{2, 3}, {1, 3}, {1, 2}, {0, 3}, {0, 2}, {0, 1}}};
    const Corners<3> p{Vec<3>{}, e[0], e[1], e[2]};
    const auto n = normals(e);
    const auto [i, j] = FACES_AT<3>[k];
    const auto [a, b] = SHARED[k];
    const Vec<3> along = p[b] - p[a];
    const double length2 = norm2(along), scale = factor * std::sqrt(length2);
    const Vec<3> at_i = (scale / norm2(n[j])) * n[j], at_j = (scale / norm2(n[i])) * n[i];
    const double share_i = dot(p[i] - p[a], along) / length2, share_j = dot(p[j] - p[a], along) / length2;
    slopes[i] = slopes[i] + at_i;
    slopes[j] = slopes[j] + at_j;
    slopes[a] = slopes[a] - (1.0 - share_i) * at_i - (1.0 - share_j) * at_j;
    slopes[b] = slopes[b] - share_i * at_i - share_j * at_j;
}

template <int D>
class Shape {
   public:
    // points (n, D), the `free` ones first; simplices (m, D+1), the first vertex of each that is a corner is there;
    // `freedom`: where the free ones may go, null: anywhere.
    Shape(const double* points, std::int64_t n, std::int64_t free, const std::int32_t* simplices, std::int64_t m,
          ShapeCorners corners, ShapeGoal goal, const Freedom* freedom, int threads)
        : assembly_(simplices, m, n), corners_(std::move(corners.weights)), parts_(assembly_.items()), free_(free),
          threads_(threads), goal_(goal), points_(points, points + n * D) {
        if (freedom != nullptr) assembly_.constrain(*freedom);
        if (goal_.sharpness > 0.0 && !corners_.empty()) find_elements(corners.owners, std::move(corners.hexahedra));
        for (std::int64_t i = 0; i < n * D; ++i) origin_[i % D] += points_[i] / static_cast<double>(n);
        double size2 = 0.0;
        for (std::int64_t v = 0; v < n; ++v) size2 = larger(size2, norm2(load<D>(points + v * D) - origin_));
        // About an edge.
        unit_ = std::sqrt(size2) / (D == 2 ? std::sqrt(static_cast<double>(n)) : std::cbrt(static_cast<double>(n)));
        for (std::int64_t i = 0; i < n * D; ++i) points_[i] = (points_[i] - origin_[i % D]) / unit_;
        enough_ = std::sin(larger(goal.degrees, goal.floor) / DEGREE) * (1.0 + 1e-9);
        least_ = factorial(D) * goal.measure / (D == 2 ? unit_ * unit_ : unit_ * unit_ * unit_);
    }

    std::int64_t size() const { return free_ * D; }

    Numbers start() const {
        Numbers x(free_ * D);
        std::copy(points_.begin(), points_.begin() + free_ * D, x.data());
        return x;
    }

    double operator()(const double* x, double* gradient) {
        std::copy(x, x + free_ * D, points_.begin());
        weigh_corners();
        assembly_.evaluate(free_, gradient, threads_, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
            parts_[item] = look_at(begin, end);
        });
        double total = 0.0;
        for (double part : parts_) total += part;
        return total;
    }

    bool enough() const { return false; }
    double least_gain() const {
        return (elements_.empty() ? SHAPE_GAIN : SHAPE_SHARP_GAIN) * static_cast<double>(assembly_.size());
    }

    // Of each free vertex, between the shortest and the mean of the edges that corners have there.
    std::vector<double> sizes() const {
        const auto n = points_.size() / D;
        std::vector<double> shortest(n, INFINITY), sum(n), count(n), sizes(free_);
        const auto& simplices = assembly_.simplices();
        for (std::size_t s = 0; s < simplices.size(); s += D + 1) {
            for (int k = 1; k <= D; ++k) {
                const std::size_t ends[] = {static_cast<std::size_t>(simplices[s]), static_cast<std::size_t>(simplices[s + k])};
                const double length = std::sqrt(norm2(load<D>(&points_[ends[1] * D]) - load<D>(&points_[ends[0] * D])));
                for (std::size_t end : ends) {
                    shortest[end] = smaller(shortest[end], length);
                    sum[end] += length;
                    count[end] += 1.0;
                }
            }
        }
        for (std::int64_t v = 0; v < free_; ++v)
            sizes[v] = count[v] > 0.0 ? std::sqrt(shortest[v] * sum[v] / count[v]) : 1.0;
        return sizes;
    }

    // The free points (free, D) at a vector, in model units.
    std::vector<double> free_points(const double* x) const {
        std::vector<double> places(x, x + free_ * D);
        for (std::int64_t i = 0; i < free_ * D; ++i) places[i] = origin_[i % D] + unit_ * places[i];
        return places;
    }

   private:
    // What a corner adds to the energy but for its own goal and floor: its share of what its element does, the slope by q,
    // and that of what the centre does by the vertex there.
    struct Share {
        double value, slope;
        Vec<D> pull;
    };

    void find_elements(const std::vector<std::int32_t>& owners, std::vector<std::int32_t> hexahedra) {
        hexahedra_ = std::move(hexahedra);
        shares_.resize(owners.size());
        for (std::size_t s = 0; s < owners.size(); ++s)
            if (s == 0 || owners[s] != owners[s - 1]) elements_.push_back(static_cast<std::int64_t>(s));
        elements_.push_back(static_cast<std::int64_t>(owners.size()));
    }

    void weigh_corners() {
        if (elements_.empty()) return;
        const auto count = static_cast<std::int64_t>(elements_.size()) - 1;
        for_each_range(count, ELEMENTS_PER_ITEM, threads_, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
            for (std::int64_t e = begin; e < end; ++e)
                if (corners_[elements_[e]] > 0.0) weigh(elements_[e], elements_[e + 1], centre_of(e));
        });
    }

    // The nodes of a hexahedron whose centre counts, or null.
    const std::int32_t* centre_of(std::int64_t e) const {
        if (D == 2 || hexahedra_.empty() || hexahedra_[8 * e] < 0) return nullptr;
        return hexahedra_.data() + 8 * e;
    }

    // The corners of one element and the nodes around its centre, or null; exp(-k (q - 1)) is never larger than exp(2 k).
    void weigh(std::int64_t begin, std::int64_t end, const std::int32_t* nodes) {
        const double count = static_cast<double>(end - begin), k = goal_.sharpness;
        double sum = 0.0;
        for (std::int64_t s = begin; s < end; s += LANES) {
            const int lanes = static_cast<int>(std::min<std::int64_t>(LANES, end - s));
            const Pack q = scaled(assembly_.edges(points_.data(), s, end), constant<Pack>(corners_[begin]));
            for (int i = 0; i < lanes; ++i) {
                shares_[s + i].slope = std::exp(k * (1.0 - q[i]));
                sum += shares_[s + i].slope;
            }
        }
        const double values = count + (nodes != nullptr ? 1.0 : 0.0);
        const Edges<D> axes = nodes != nullptr ? axes_of(nodes) : Edges<D>{};
        const double centre = nodes != nullptr ? scaled(axes, 1.0) : 1.0;
        const double mine = nodes != nullptr ? std::exp(k * (1.0 - centre)) : 0.0;
        sum += mine;
        double value = SHAPE_RATIO * (std::log(sum / values) / k - 1.0);
        Edges<D> slopes{};
        if (nodes != nullptr) {
            const Missing missing = missing_at(centre);
            value += missing.value / count;
            slopes = slopes_of(axes, centre, missing.slope - SHAPE_RATIO * count * mine / sum);
        }
        for (std::int64_t s = begin; s < end; ++s) {
            shares_[s] = {value, -SHAPE_RATIO * count * shares_[s].slope / sum, Vec<D>{}};
            if (nodes == nullptr) continue;
            const auto node = std::find(nodes, nodes + 8, assembly_.simplices()[s * (D + 1)]) - nodes;
            for (int x = 0; x < D; ++x) shares_[s].pull = shares_[s].pull + HEXAHEDRON_SIDES[node][x] * slopes[x];
        }
    }

    Vec<D> at(std::int32_t vertex) const { return load<D>(points_.data() + static_cast<std::int64_t>(vertex) * D); }

    // Of a hexahedron, from the middles of its faces to those opposite, times 4.
    Edges<D> axes_of(const std::int32_t* nodes) const {
        Edges<D> axes{};
        for (int node = 0; node < 8; ++node)
            for (int k = 0; k < D; ++k) axes[k] = axes[k] + HEXAHEDRON_SIDES[node][k] * at(nodes[node]);
        return axes;
    }

    // `slope` times the gradient of the scaled Jacobian q of some edges by these; q may be of either sign.
    static Edges<D> slopes_of(const Edges<D>& e, double q, double slope) {
        double product2 = 1.0;
        for (int k = 0; k < D; ++k) product2 *= norm2(e[k]);
        const Edges<D> normals = determinant_slopes(e);
        Edges<D> slopes;
        for (int k = 0; k < D; ++k)
            slopes[k] = slope * ((1.0 / std::sqrt(product2)) * normals[k] - (q / norm2(e[k])) * e[k]);
        return slopes;
    }

    // What a scaled Jacobian lacks to goal and floor, and the slope of that.
    struct Missing {
        double value, slope;
    };
    Missing missing_at(double q) const {
        const double angle = DEGREE * std::asin(larger(-1.0, smaller(q, 1.0)));
        const double missing = larger(0.0, goal_.degrees - angle), below = SHAPE_FLOOR * larger(0.0, goal_.floor - angle);
        if (!(missing + below > 0.0)) return {0.0, 0.0};
        return {goal_.weight * (missing * missing + below * below / SHAPE_FLOOR),
                -2.0 * goal_.weight * (missing + below) * DEGREE / std::sqrt(larger(1.0 - q * q, 1e-6))};
    }

    template <class T>
    static T scaled(const Edges<D, T>& e, T weight) {
        T product2 = norm2(e[0]);
        for (int k = 1; k < D; ++k) product2 = product2 * norm2(e[k]);
        return weight * determinant(e) / square_root(product2);
    }

    double look_at(std::int64_t begin, std::int64_t end) {
        LaneSum energy;
        for (std::int64_t s = begin; s < end; s += LANES) {
            const Edges<D, Pack> e = assembly_.edges(points_.data(), s, end);
            const int count = static_cast<int>(std::min<std::int64_t>(LANES, end - s));
            Corners<D, Pack> slopes;
            Pack value{};
            const auto is_corner = [&](int i) { return !corners_.empty() && corners_[s + i] > 0.0; };
            int simplices = 0;
            for (int i = 0; i < count; ++i) simplices += !is_corner(i);
            if (simplices > 0) {
                value = of_ratio(e, slopes);
                const auto cosine = cosines<D>(e);
                for (int i = 0; i < count; ++i) {
                    if (is_corner(i)) continue;
                    std::size_t k = 0;
                    for (std::size_t other = 1; other < cosine.size(); ++other)
                        if (cosine[other][i] > cosine[k][i]) k = other;
                    value[i] += of_angle(e, i, k, cosine[k][i], slopes);
                }
            }
            if (simplices == 0) {
                value = of_corners(e, s, count, slopes);
            } else if (simplices < count) {
                Corners<D, Pack> others;
                const Pack theirs = of_corners(e, s, count, others);
                for (int i = 0; i < count; ++i) {
                    if (!is_corner(i)) continue;
                    value[i] = theirs[i];
                    for (int k = 0; k <= D; ++k)
                        for (int x = 0; x < D; ++x) slopes[k][x][i] = others[k][x][i];
                }
            }
            for (int i = count; i < LANES; ++i) value[i] = 0.0;
            assembly_.add(slopes, s, count);
            energy.add(static_cast<std::size_t>((s - begin) / LANES), value);
        }
        return energy.total();
    }

    Pack of_ratio(const Edges<D, Pack>& e, Corners<D, Pack>& slopes) const {
        const Pack zero = constant<Pack>(0.0), one = constant<Pack>(1.0);
        const Pack det = determinant(e), edges2 = sum_of_squared_edges<D>(e);
        Pack power = det;
        if constexpr (D == 3) {
            const Pack root = cube_root(constant<Pack>(0.5) * larger(det, constant<Pack>(1e-300)));
            power = root * root;
        }
        Pack value = constant<Pack>(-SHAPE_RATIO * (D == 2 ? 2.0 * std::sqrt(3.0) : 12.0)) * power / edges2;
        Pack by_det = constant<Pack>(2.0 / D) * value / det;
        const Pack by_edges2 = zero - value / edges2;
        if (least_ > 0.0) {
            const Pack missing = larger(zero, constant<Pack>(1.0 + SHAPE_MARGIN) - det * constant<Pack>(1.0 / least_));
            value = value + constant<Pack>(SHAPE_MEASURE) * missing * missing;
            by_det = by_det - constant<Pack>(2.0 * SHAPE_MEASURE / least_) * missing;
        }
        const Edges<D, Pack> normals = determinant_slopes(e);
        const Pack pull = constant<Pack>(2.0) * by_edges2;
        Vec<D, Pack> middle = e[0];
        for (int k = 1; k < D; ++k) middle = middle + e[k];
        slopes[0] = Vec<D, Pack>{} - pull * middle;
        for (int k = 0; k < D; ++k) {
            slopes[k + 1] = pull * (constant<Pack>(D + 1) * e[k] - middle) + by_det * normals[k];
            slopes[0] = slopes[0] - by_det * normals[k];
        }
        return select(det > zero, value, one / zero);
    }

    // Of lanes that are corners of elements, from the s-th simplex on, and any of others; q = weight det / (product of the
    // edges).
    Pack of_corners(const Edges<D, Pack>& e, std::int64_t s, int count, Corners<D, Pack>& slopes) const {
        const Pack zero = constant<Pack>(0.0), one = constant<Pack>(1.0), det = determinant(e);
        const auto here = [&](int i) { return s + std::min(i, count - 1); };
        const Pack weights = gathered([&](int i) { return corners_[here(i)]; });
        const Pack q = scaled(e, weights);
        Pack value = constant<Pack>(-SHAPE_RATIO) * q, slope = constant<Pack>(-SHAPE_RATIO);
        Vec<D, Pack> first{};
        if (!shares_.empty()) {
            value = gathered([&](int i) { return shares_[here(i)].value; });
            slope = gathered([&](int i) { return shares_[here(i)].slope; });
            for (int x = 0; x < D; ++x) first[x] = gathered([&](int i) { return shares_[here(i)].pull[x]; });
        }
        for (int i = 0; i < count; ++i) {
            if (q[i] > enough_) continue;
            const Missing missing = missing_at(q[i]);
            value[i] = missing.value + value[i];
            slope[i] = slope[i] + missing.slope;
        }
        const Edges<D, Pack> normals = determinant_slopes(e);
        for (int k = 0; k < D; ++k)
            slopes[k + 1] = (slope * q) * ((one / det) * normals[k] - (one / norm2(e[k])) * e[k]);
        if (goal_.evenness > 0.0) value = value - add_evenness(e, weights * det, normals, slopes);
        for (int k = 0; k < D; ++k) first = first - slopes[k + 1];
        slopes[0] = first;
        return select(det > zero, value, one / zero);
    }

    // Of corners with these determinants; returns what is to be taken from the value.
    Pack add_evenness(const Edges<D, Pack>& e, Pack det, const Edges<D, Pack>& normals, Corners<D, Pack>& slopes) const {
        const Pack one = constant<Pack>(1.0);
        Pack edges2 = norm2(e[0]), power = det;
        for (int k = 1; k < D; ++k) edges2 = edges2 + norm2(e[k]);
        if constexpr (D == 3) {
            const Pack root = cube_root(larger(det, constant<Pack>(1e-300)));
            power = root * root;
        }
        const Pack even = constant<Pack>(SHAPE_RATIO * goal_.evenness * D) * power / edges2, twice = even + even;
        // Whatever their weights: what counts is the logarithm's slope.
        const Pack by_det = constant<Pack>(1.0 / D) / determinant(e);
        for (int k = 0; k < D; ++k) slopes[k + 1] = slopes[k + 1] - twice * (by_det * normals[k] - (one / edges2) * e[k]);
        return even;
    }

    static Edges<D> lane(const Edges<D, Pack>& edges, int i) {
        Edges<D> e;
        for (int edge = 0; edge < D; ++edge)
            for (int x = 0; x < D; ++x) e[edge][x] = edges[edge][x][i];
        return e;
    }

    // Of lane i, whose smallest angle is the k-th.
    double of_angle(const Edges<D, Pack>& edges, int i, std::size_t k, double cosine, Corners<D, Pack>& slopes) const {
        if (!(std::fabs(cosine) < 1.0)) return INFINITY;
        const double angle = DEGREE * std::acos(cosine), missing = larger(0.0, goal_.degrees - angle);
        const double below = SHAPE_FLOOR * larger(0.0, goal_.floor - angle);
        const Edges<D> e = lane(edges, i);
        Corners<D> mine{};
        add_slopes_of_angle(e, k, -DEGREE * (goal_.angle + 2.0 * goal_.weight * (missing + below)), mine);
        for (int corner = 0; corner <= D; ++corner)
            for (int x = 0; x < D; ++x) slopes[corner][x][i] += mine[corner][x];
        return goal_.weight * (missing * missing + below * below / SHAPE_FLOOR) - goal_.angle * angle;
    }

    static constexpr double DEGREE = 57.29577951308232;
    static constexpr std::int64_t ELEMENTS_PER_ITEM = 512;

    Assembly<D> assembly_;
    std::vector<double> corners_, parts_;
    std::vector<std::int64_t> elements_;  // where the corners of each begin, and the end; or none
    std::vector<std::int32_t> hexahedra_; // (8,) of each, see `ShapeCorners`; or none
    std::vector<Share> shares_;           // (m,) or none
    std::int64_t free_;
    int threads_;
    ShapeGoal goal_;
    std::vector<double> points_;
    Vec<D> origin_{};
    double unit_ = 1.0, least_ = 0.0;
    double enough_ = 0.0;  // scaled Jacobians that are larger lack nothing
};

}  // namespace meshfix
