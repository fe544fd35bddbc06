// The shape that a boundary keeps: surfaces of triangles and curves of segments. Each has a tree of boxes of its own, so that
// a vertex never jumps to the wall across.
//
// corners, ways (p, D, D)   of each piece the positions of its corners, and unit normals (curves: tangents) there; a segment
//                           in space has two, and the last again
// first (s+1)               where the pieces of each shape begin
// directions (s)            2: a surface, 1: a curve
// in_order                  the pieces of a shape that are near in memory are so in space: trees halve their rows as they are
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "common/tolerances.hpp"
#include "mesh/beside.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

// A point of a shape: the one of its pieces that is nearest to some position.
template <int D>
struct Foot {
    Vec<D> point;
    double distance2;
    std::int64_t piece;
    std::array<double, 3> weights;  // of the corners
};

class Reference {
   public:
    static constexpr std::int64_t ANY = -1;  // piece

    // The corners and ways are somebody else's, who keeps them.
    Reference(int dimension, const double* corners, const double* ways, const std::vector<std::int32_t>& first,
              std::vector<std::uint8_t> directions, bool in_order = false)
        : dimension_(dimension), corners_(corners), ways_(ways), directions_(std::move(directions)), first_(first) {
        order_.resize(first.back());
        std::iota(order_.begin(), order_.end(), 0);
        if (!in_order) find_centres();
        find_boxes();
        for (std::size_t s = 0; s + 1 < first.size(); ++s) {
            roots_.push_back(static_cast<std::int32_t>(nodes_.size()));
            if (dimension_ == 2)
                build<2>(first[s], first[s + 1]);
            else
                build<3>(first[s], first[s + 1]);
        }
        std::vector<double>().swap(centres_);
        std::vector<Box>().swap(boxes_);
    }

    // The same shapes with their corners elsewhere: the boxes of its trees are other ones.
    Reference at_corners(const double* corners) const {
        Reference moved(*this);
        moved.corners_ = corners;
        moved.find_boxes();
        if (!beside_.empty()) moved.find_slopes();
        for (std::size_t i = nodes_.size(); i-- > 0;) {
            Node& node = moved.nodes_[i];
            node.box = Box();
            if (node.right != 0) {
                node.box.include(moved.nodes_[i + 1].box);
                node.box.include(moved.nodes_[node.right].box);
            } else {
                for (std::int32_t k = node.begin; k < node.end; ++k) node.box.include(moved.boxes_[order_[k]]);
            }
        }
        std::vector<Box>().swap(moved.boxes_);
        return moved;
    }

    // Lets searches go from piece to piece, where they begin at one. vertices (p, 3): numbers that tell which corners are one.
    void let_walk(const std::int32_t* vertices) {
        Beside found(vertices, first_, directions_);
        beside_ = std::move(found.pieces);
        is_again_ = std::move(found.is_again);
        find_slopes();
    }

    int dimension() const { return dimension_; }
    std::size_t size() const { return order_.size() * dimension_ * dimension_; }  // numbers of the corners
    std::size_t shapes() const { return roots_.size(); }
    int directions(std::int32_t shape) const { return directions_[shape]; }

    // `near`: a piece of the shape from which the search begins, or `ANY`; of pieces that are equally near the first is taken.
    // Where searches walk, and come to a place in a piece that is nearer than this is large, that is it, unless the nearest
    // is wanted: what slides never jumps to where the shape comes near to itself.
    template <int D>
    Foot<D> foot(std::int32_t shape, const Vec<D>& p, std::int64_t near = ANY, bool nearest = false) const {
        Foot<D> best = any_foot<D>(shape);
        if (near != ANY) {
            const bool inside = walk_from<D>(shape, near, p, best);
            if (inside && !nearest && best.distance2 <= size2<D>(best.piece)) return best;
        }
        search<D>(shape, p, best, 0.0);
        return best;
    }

    // Whether the shape is within the root of `bound2`; most often it is the piece `near` that is.
    template <int D>
    bool is_within(double bound2, std::int32_t shape, const Vec<D>& p, std::int64_t near) const {
        Foot<D> best = any_foot<D>(shape);
        if (near != ANY) {
            auto piece = static_cast<std::int32_t>(near);
            if constexpr (D == 3) {
                std::array<double, 3> weights;
                if (walk(shape, piece, p, weights)) {
                    const double off = dot(p - slopes_[piece].origin, slopes_[piece].normal);
                    if (off * off <= bound2) return true;
                }
            }
            look<D>(shape, piece, p, best);
            if (best.distance2 <= bound2) return true;
        }
        best.distance2 = std::nextafter(bound2, INFINITY);
        search<D>(shape, p, best, bound2);
        return best.distance2 <= bound2;
    }

    // The squared distance from the shape, if it is more than `least2`, else anything that is not.
    template <int D>
    double distance2_beyond(double least2, std::int32_t shape, const Vec<D>& p, std::int64_t near) const {
        Foot<D> best = any_foot<D>(shape);
        walk_from<D>(shape, near, p, best);
        search<D>(shape, p, best, least2);
        return best.distance2;
    }

    // The largest squared distance from it of its pieces, if their corners (as `corners_`) were elsewhere, in a range of
    // pieces, beyond `most2`: of corners, or of the middles of pieces and their sides.
    template <int D>
    double farthest2(const double* corners, bool of_corners, std::int64_t begin, std::int64_t end, double most2) const {
        std::int32_t shape = 0;
        const auto look = [&](std::int64_t piece, const Vec<D>& p) {
            if (is_within<D>(most2, shape, p, piece)) return;
            const double here2 = distance2_beyond<D>(most2, shape, p, piece);
            if (here2 > most2) most2 = here2;
        };
        for (std::int64_t piece = begin; piece < end; ++piece) {
            while (piece >= first_[shape + 1]) ++shape;
            const int count = directions_[shape] + 1;  // of corners
            std::array<Vec<D>, D> at;
            for (int i = 0; i < D; ++i) at[i] = load<D>(corners + (piece * D + i) * D);
            if (of_corners) {
                for (int i = 0; i < count; ++i)
                    if (count == 2 || is_again_.empty() || !is_again_[piece * 3 + i]) look(piece, at[i]);
                continue;
            }
            for (int i = 0; i < (count == 2 ? 1 : D); ++i) {
                const std::int64_t other = beside_.empty() || count == 2 ? -1 : beside_[piece * 3 + i];
                if (other < begin || other > piece) look(piece, 0.5 * (at[(i + 1) % D] + at[i]));  // else it was looked at
            }
            if constexpr (D == 3) {
                if (count == 3) {
                    Vec<3> middle = (at[0] + at[1]) + at[2];
                    for (double& x : middle) x /= 3.0;
                    look(piece, middle);
                }
            }
        }
        return most2;
    }

    // The foot, drawn half of the way to its projections to the planes (lines) at the corners of its piece, by its weights:
    // exact for quadratic surfaces to leading order. Source: T. Boubekeur and M. Alexa, "Phong tessellation", ACM
    // Transactions on Graphics 27 (2008), with 1/2 for their 3/4.
    template <int D>
    Vec<D> rounded(std::int32_t shape, const Foot<D>& foot) const {
        Vec<D> sum{};
        for (int i = 0; i <= directions_[shape]; ++i) {
            const Vec<D> corner = at<D>(corners_, foot.piece, i), way = at<D>(ways_, foot.piece, i);
            const Vec<D> off = dot(way, foot.point - corner) * way;
            sum = sum + foot.weights[i] * (directions_[shape] == 2 ? foot.point - off : corner + off);
        }
        return 0.5 * (foot.point + sum);
    }

    // The rounded piece as a quadratic polynomial of the weights w of its corners: the sum of w_i w_j P_ij, of which these are
    // the P, symmetric. `place` gives positions in the coordinates that are wanted, axes and all but for a factor the same.
    template <int D, class F>
    std::array<std::array<Vec<D>, 3>, 3> products(std::int32_t shape, std::int64_t piece, const F& place) const {
        std::array<std::array<Vec<D>, 3>, 3> half{}, whole{};
        for (int i = 0; i <= directions_[shape]; ++i)
            for (int j = 0; j <= directions_[shape]; ++j) {
                const Vec<D> from = place(at<D>(corners_, piece, i)), to = place(at<D>(corners_, piece, j));
                const Vec<D> way = at<D>(ways_, piece, i);
                const Vec<D> part = (0.5 * dot(way, to - from)) * way;
                half[i][j] = directions_[shape] == 2 ? to - part : 0.5 * (to + from) + part;
            }
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) whole[i][j] = 0.5 * (half[i][j] + half[j][i]);
        return whole;
    }

    // Whether look(piece) is true of all pieces of a shape, those near p first, but for such in boxes that skip(low, high) is
    // true of.
    template <int D, class Skip, class F>
    bool for_each_piece(std::int32_t shape, const Vec<D>& p, const Skip& skip, const F& look) const {
        std::array<std::int32_t, 64> waiting;
        int count = 0;
        waiting[count++] = roots_[shape];
        while (count > 0) {
            const Node& node = nodes_[waiting[--count]];
            if (skip(load<D>(node.box.low.data()), load<D>(node.box.high.data()))) continue;
            if (node.right == 0) {
                for (std::int32_t i = node.begin; i < node.end; ++i)
                    if (!look(order_[i])) return false;
                continue;
            }
            std::int32_t near = static_cast<std::int32_t>(&node - nodes_.data()) + 1, far = node.right;
            if (distance2<D>(nodes_[far], p) < distance2<D>(nodes_[near], p)) std::swap(near, far);
            waiting[count++] = far;
            waiting[count++] = near;
        }
        return true;
    }

    // The directions of a shape at a foot, orthonormal; one in a curve, two in a surface.
    template <int D>
    Edges<D> axes(std::int32_t shape, const Foot<D>& here) const {
        Vec<D> way{};
        for (int i = 0; i <= directions_[shape]; ++i) way = way + here.weights[i] * at<D>(ways_, here.piece, i);
        const double length = std::sqrt(norm2(way));
        if (length > 0.0)
            way = (1.0 / length) * way;
        else
            way[0] = 1.0;
        Edges<D> axes{};
        axes[0] = way;
        if constexpr (D == 3) {
            if (directions_[shape] == 2) {
                int least = 0;
                for (int k = 1; k < 3; ++k)
                    if (std::fabs(way[k]) < std::fabs(way[least])) least = k;
                Vec<3> across{};
                across[least] = 1.0;
                across = across - way[least] * way;
                axes[0] = (1.0 / std::sqrt(norm2(across))) * across;
                axes[1] = cross(way, axes[0]);
            }
        }
        return axes;
    }

   private:
    static constexpr std::int32_t LEAF = 4;
    static constexpr int STEPS = 16;

    struct Box {
        std::array<double, 3> low{INFINITY, INFINITY, INFINITY}, high{-INFINITY, -INFINITY, -INFINITY};

        void include(const Box& other) {
            for (int k = 0; k < 3; ++k) {
                low[k] = std::min(low[k], other.low[k]);
                high[k] = std::max(high[k], other.high[k]);
            }
        }
    };

    // The left child is the next node; no right child: a leaf.
    struct Node {
        Box box;
        std::int32_t begin, end, right;
    };

    // Those of the pieces, while trees are built.
    void find_boxes() {
        boxes_.assign(order_.size(), Box());
        const double* corner = corners_;
        for (Box& box : boxes_)
            for (int i = 0; i < dimension_; ++i, corner += dimension_)
                for (int k = 0; k < dimension_; ++k) {
                    box.low[k] = std::min(box.low[k], corner[k]);
                    box.high[k] = std::max(box.high[k], corner[k]);
                }
    }

    void find_centres() {
        centres_.resize(order_.size() * dimension_);
        for (std::size_t i = 0; i < size(); ++i)
            centres_[i / (dimension_ * dimension_) * dimension_ + i % dimension_] += corners_[i];
    }

    template <int D>
    Vec<D> at(const double* values, std::int64_t piece, int corner) const {
        return load<D>(values + (piece * D + corner) * D);
    }

    // For what is nearer than the best so far, until that is near enough.
    template <int D>
    void search(std::int32_t shape, const Vec<D>& p, Foot<D>& best, double enough2) const {
        std::array<std::int32_t, 64> waiting;
        int count = 0;
        waiting[count++] = roots_[shape];
        while (count > 0 && best.distance2 > enough2) {
            const Node& node = nodes_[waiting[--count]];
            if (!(distance2<D>(node, p) < best.distance2)) continue;
            if (node.right == 0) {
                for (std::int32_t i = node.begin; i < node.end; ++i) look<D>(shape, order_[i], p, best);
                continue;
            }
            std::int32_t near = static_cast<std::int32_t>(&node - nodes_.data()) + 1, far = node.right;
            if (distance2<D>(nodes_[far], p) < distance2<D>(nodes_[near], p)) std::swap(near, far);
            waiting[count++] = far;
            waiting[count++] = near;
        }
    }

    // How the weights of the second and third corner of a triangle grow in its plane, from its first one, and its unit normal;
    // NaN: it has no area.
    struct Slopes {
        Vec<3> origin, second, third, normal;
    };

    void find_slopes() {
        slopes_.resize(order_.size());
        for (std::size_t piece = 0; piece < slopes_.size(); ++piece) {
            const Vec<3> a = at<3>(corners_, piece, 0), b = at<3>(corners_, piece, 1) - a, c = at<3>(corners_, piece, 2) - a;
            const Vec<3> normal = cross(b, c);
            const double area2 = norm2(normal), scale = area2 > 0.0 ? 1.0 / area2 : NAN;
            slopes_[piece] = {a, scale * cross(c, normal), scale * cross(normal, b), std::sqrt(scale) * normal};
        }
    }

    // From piece to piece across the side that is between it and a position; the last one, and the weights of its corners
    // there. Whether it is over that.
    bool walk(std::int32_t shape, std::int32_t& piece, const Vec<3>& p, std::array<double, 3>& weights) const {
        if (beside_.empty() || directions_[shape] != 2) return false;
        for (int step = 0; step < STEPS; ++step) {
            const Slopes& here = slopes_[piece];
            const Vec<3> off = p - here.origin;
            const double second = dot(off, here.second), third = dot(off, here.third), first = 1.0 - second - third;
            if (first >= ON_PIECE && second >= ON_PIECE && third >= ON_PIECE) {
                weights = {first, second, third};
                return true;
            }
            if (!(second == second)) return false;
            const int side = first < std::min(second, third) ? 1 : second <= third ? 2 : 0;  // opposite the least
            const std::int32_t next = beside_[piece * 3 + side];
            if (next < 0) return false;
            piece = next;
        }
        return false;
    }

    // The foot that is found from a piece on, in that where a walk ends; whether that is over it.
    template <int D>
    bool walk_from(std::int32_t shape, std::int64_t near, const Vec<D>& p, Foot<D>& best) const {
        auto piece = static_cast<std::int32_t>(near);
        if constexpr (D == 3) {
            std::array<double, 3> weights;
            if (walk(shape, piece, p, weights)) {
                take<3>(piece, weights, p, best);
                return true;
            }
        }
        look<D>(shape, piece, p, best);
        return false;
    }

    // The weights of the corners of a triangle at the nearest point of its plane; false: it has no area.
    bool weigh(std::int32_t piece, const Vec<3>& p, std::array<double, 3>& weights) const {
        const Vec<3> a = at<3>(corners_, piece, 0), b = at<3>(corners_, piece, 1) - a, c = at<3>(corners_, piece, 2) - a;
        const Vec<3> normal = cross(b, c), off = p - a;
        const double area2 = norm2(normal);
        if (!(area2 > 0.0)) return false;
        weights[1] = dot(cross(off, c), normal) / area2;
        weights[2] = dot(cross(b, off), normal) / area2;
        weights[0] = 1.0 - weights[1] - weights[2];
        return true;
    }

    template <int D>
    double size2(std::int64_t piece) const {
        return std::max(norm2(at<D>(corners_, piece, 1) - at<D>(corners_, piece, 0)), norm2(at<D>(corners_, piece, D - 1) - at<D>(corners_, piece, 0)));
    }

    // Of a position that is at no distance from anything, for it is no number.
    template <int D>
    Foot<D> any_foot(std::int32_t shape) const {
        const std::int32_t piece = order_[nodes_[roots_[shape]].begin];
        return {at<D>(corners_, piece, 0), INFINITY, piece, {1.0, 0.0, 0.0}};
    }

    template <int D>
    static double distance2(const Node& node, const Vec<D>& p) {
        double sum = 0.0;
        for (int k = 0; k < D; ++k) {
            const double off = std::max({node.box.low[k] - p[k], p[k] - node.box.high[k], 0.0});
            sum += off * off;
        }
        return sum;
    }

    template <int D>
    std::int32_t build(std::int32_t begin, std::int32_t end) {
        const auto number = static_cast<std::int32_t>(nodes_.size());
        const bool is_leaf = end - begin <= LEAF, in_order = centres_.empty();
        nodes_.push_back({Box(), begin, end, 0});
        if (is_leaf || !in_order)
            for (std::int32_t i = begin; i < end; ++i) nodes_[number].box.include(boxes_[order_[i]]);
        if (is_leaf) return number;
        const std::int32_t middle = begin + (end - begin) / 2;
        if (!in_order) divide<D>(nodes_[number].box, begin, middle, end);
        build<D>(begin, middle);
        const std::int32_t right = build<D>(middle, end);
        Node& node = nodes_[number];
        node.right = right;
        if (in_order) {
            node.box.include(nodes_[number + 1].box);
            node.box.include(nodes_[right].box);
        }
        return number;
    }

    // Brings those to the front whose centres are lower along the longest side of their box.
    template <int D>
    void divide(const Box& box, std::int32_t begin, std::int32_t middle, std::int32_t end) {
        int axis = 0;
        for (int k = 1; k < D; ++k)
            if (box.high[k] - box.low[k] > box.high[axis] - box.low[axis]) axis = k;
        const auto centre = [&](std::int32_t piece) { return centres_[static_cast<std::size_t>(piece) * D + axis]; };
        std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                         [&](std::int32_t a, std::int32_t b) {
                             const double x = centre(a), y = centre(b);
                             return x < y || (x == y && a < b);
                         });
    }

    template <int D>
    void look(std::int32_t shape, std::int32_t piece, const Vec<D>& p, Foot<D>& best) const {
        if constexpr (D == 3) {
            if (directions_[shape] == 2 && look_inside(piece, p, best)) return;
        }
        const int sides = directions_[shape] == 2 ? 3 : 1;
        for (int i = 0; i < sides; ++i) look_along<D>(piece, i, (i + 1) % 3, p, best);
    }

    // Whether the nearest point of the plane of a triangle is in it.
    bool look_inside(std::int32_t piece, const Vec<3>& p, Foot<3>& best) const {
        std::array<double, 3> weights;
        if (!weigh(piece, p, weights)) return false;
        if (!(weights[0] >= 0.0 && weights[1] >= 0.0 && weights[2] >= 0.0)) return false;
        take<3>(piece, weights, p, best);
        return true;
    }

    template <int D>
    void look_along(std::int32_t piece, int from, int to, const Vec<D>& p, Foot<D>& best) const {
        const Vec<D> a = at<D>(corners_, piece, from), way = at<D>(corners_, piece, to) - a;
        const double length2 = norm2(way);
        const double share = length2 > 0.0 ? std::clamp(dot(p - a, way) / length2, 0.0, 1.0) : 0.0;
        std::array<double, 3> weights{};
        weights[from] = 1.0 - share;
        weights[to] = share;
        take<D>(piece, weights, p, best);
    }

    template <int D>
    void take(std::int32_t piece, const std::array<double, 3>& weights, const Vec<D>& p, Foot<D>& best) const {
        Vec<D> point{};
        for (int i = 0; i < D; ++i) point = point + weights[i] * at<D>(corners_, piece, i);
        const double distance2 = norm2(p - point);
        if (distance2 < best.distance2) best = {point, distance2, piece, weights};
    }

    int dimension_;
    const double *corners_, *ways_;
    std::vector<double> centres_{};  // sums of corners, while trees are built, or none
    std::vector<std::uint8_t> directions_;
    std::vector<std::int32_t> first_, beside_{};  // beside_ (p, 3): the pieces at the sides, -1: none; or empty
    std::vector<bool> is_again_{};  // (p, 3): a corner that another piece of the shape has had before; or empty
    std::vector<std::int32_t> order_, roots_;
    std::vector<Node> nodes_{};
    std::vector<Box> boxes_{};
    std::vector<Slopes> slopes_{};  // of the pieces, where searches walk
};

}  // namespace meshfix
