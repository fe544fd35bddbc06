// The shape that a boundary keeps: surfaces of triangles and curves of segments. Each has a tree of boxes of its own, so that
// a vertex never jumps to the wall across.
//
// corners, ways (p, D, D)   of each piece the positions of its corners, and unit normals (curves: tangents) there; a segment
//                           in space has two, and the last again
// first (s+1)               where the pieces of each shape begin
// directions (s)            2: a surface, 1: a curve
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

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

    Reference(int dimension, std::vector<double> corners, std::vector<double> ways, const std::vector<std::int32_t>& first,
              std::vector<std::uint8_t> directions)
        : dimension_(dimension), corners_(std::move(corners)), ways_(std::move(ways)), directions_(std::move(directions)) {
        order_.resize(first.back());
        std::iota(order_.begin(), order_.end(), 0);
        for (std::size_t s = 0; s + 1 < first.size(); ++s) {
            roots_.push_back(static_cast<std::int32_t>(nodes_.size()));
            if (dimension_ == 2)
                build<2>(first[s], first[s + 1]);
            else
                build<3>(first[s], first[s + 1]);
        }
    }

    int dimension() const { return dimension_; }
    std::size_t shapes() const { return roots_.size(); }
    int directions(std::int32_t shape) const { return directions_[shape]; }

    // `near`: a piece of the shape from which the search begins, or `ANY`; of pieces that are equally near the first is taken.
    template <int D>
    Foot<D> foot(std::int32_t shape, const Vec<D>& p, std::int64_t near = ANY) const {
        Foot<D> best = any_foot<D>(shape);
        if (near != ANY) look<D>(shape, static_cast<std::int32_t>(near), p, best);
        search<D>(shape, p, best, 0.0);
        return best;
    }

    // Whether the shape is within the root of `bound2`; most often it is the piece `near` that is.
    template <int D>
    bool is_within(double bound2, std::int32_t shape, const Vec<D>& p, std::int64_t near) const {
        Foot<D> best = any_foot<D>(shape);
        look<D>(shape, static_cast<std::int32_t>(near), p, best);
        if (best.distance2 <= bound2) return true;
        best.distance2 = std::nextafter(bound2, INFINITY);
        search<D>(shape, p, best, bound2);
        return best.distance2 <= bound2;
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

    // The left child is the next node; no right child: a leaf.
    struct Node {
        std::array<double, 3> low, high;
        std::int32_t begin, end, right;
    };

    template <int D>
    Vec<D> at(const std::vector<double>& values, std::int64_t piece, int corner) const {
        return load<D>(values.data() + (piece * D + corner) * D);
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
            const double off = std::max({node.low[k] - p[k], p[k] - node.high[k], 0.0});
            sum += off * off;
        }
        return sum;
    }

    template <int D>
    std::int32_t build(std::int32_t begin, std::int32_t end) {
        const auto number = static_cast<std::int32_t>(nodes_.size());
        Node node{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, begin, end, 0};
        for (std::int32_t i = begin; i < end; ++i)
            for (int c = 0; c < D; ++c)
                for (int k = 0; k < D; ++k) {
                    const double x = at<D>(corners_, order_[i], c)[k];
                    node.low[k] = std::min(node.low[k], x);
                    node.high[k] = std::max(node.high[k], x);
                }
        nodes_.push_back(node);
        if (end - begin <= LEAF) return number;
        int axis = 0;
        for (int k = 1; k < D; ++k)
            if (node.high[k] - node.low[k] > node.high[axis] - node.low[axis]) axis = k;
        const auto centre = [&](std::int32_t piece) {
            double sum = 0.0;
            for (int c = 0; c < D; ++c) sum += at<D>(corners_, piece, c)[axis];
            return sum;
        };
        const std::int32_t middle = begin + (end - begin) / 2;
        std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                         [&](std::int32_t a, std::int32_t b) {
                             const double x = centre(a), y = centre(b);
                             return x < y || (x == y && a < b);
                         });
        build<D>(begin, middle);
        const std::int32_t right = build<D>(middle, end);
        nodes_[number].right = right;
        return number;
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
        const Vec<3> a = at<3>(corners_, piece, 0), b = at<3>(corners_, piece, 1) - a, c = at<3>(corners_, piece, 2) - a;
        const Vec<3> normal = cross(b, c), off = p - a;
        const double area2 = norm2(normal);
        if (!(area2 > 0.0)) return false;
        const double v = dot(cross(off, c), normal) / area2, w = dot(cross(b, off), normal) / area2, u = 1.0 - v - w;
        if (!(u >= 0.0 && v >= 0.0 && w >= 0.0)) return false;
        take<3>(piece, {u, v, w}, p, best);
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
    std::vector<double> corners_, ways_;
    std::vector<std::uint8_t> directions_;
    std::vector<std::int32_t> order_, roots_;
    std::vector<Node> nodes_{};
};

}  // namespace meshfix
