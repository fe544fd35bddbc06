// The surface that points sample, whatever joins them: around a place a quadric of least squares through the nearest of
// them, over the plane of its normal.
//
// sample, seen (n, 3)   points, and unit normals of the surface there
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "common/cholesky.hpp"
#include "common/parallel.hpp"
#include "common/tolerances.hpp"
#include "surface/unfold.hpp"

namespace meshfix {

class Sample {
   public:
    static constexpr int NEAREST = 16;  // points to which a quadric with its 6 coefficients is fitted
    using Near = std::array<std::pair<double, std::int32_t>, NEAREST>;  // distances^2 and rows, ascending

    Sample(const double* points, std::int64_t count) {
        points_.resize(count);
        for (std::int64_t i = 0; i < count; ++i) points_[i] = {load<3>(points + i * 3), static_cast<std::int32_t>(i)};
        nodes_.reserve(static_cast<std::size_t>(4 * count / LEAF + 1));
        build(0, static_cast<std::int32_t>(count));
    }

    // The nearest points to p; how many, where there are fewer.
    int nearest(const Vec<3>& p, Near& found) const {
        std::array<std::pair<double, std::int32_t>, 64> waiting;
        int known = 0, count = 0;
        const auto most2 = [&] { return known < NEAREST ? INFINITY : found[NEAREST - 1].first; };
        waiting[count++] = {distance2(nodes_[0], p), 0};
        while (count > 0) {
            const auto [least2, number] = waiting[--count];
            if (!(least2 < most2())) continue;
            const Node& node = nodes_[number];
            if (node.right == 0) {
                for (std::int32_t i = node.begin; i < node.end; ++i) {
                    const double here2 = norm2(points_[i].at - p);
                    if (!(here2 < most2())) continue;
                    known = std::min(known + 1, NEAREST);
                    int place = known - 1;
                    for (; place > 0 && here2 < found[place - 1].first; --place) found[place] = found[place - 1];
                    found[place] = {here2, points_[i].row};
                }
                continue;
            }
            std::pair<double, std::int32_t> near{distance2(nodes_[number + 1], p), number + 1};
            std::pair<double, std::int32_t> far{distance2(nodes_[node.right], p), node.right};
            if (far.first < near.first) std::swap(near, far);
            waiting[count++] = far;
            waiting[count++] = near;
        }
        return known;
    }

   private:
    static constexpr std::int32_t LEAF = 8;

    struct Point {
        Vec<3> at;
        std::int32_t row;
    };

    // The left child is the next node; no right child: a leaf.
    struct Node {
        Vec<3> low, high;
        std::int32_t begin, end, right;
    };

    // Halves them along the longest side of their box.
    std::int32_t build(std::int32_t begin, std::int32_t end) {
        const auto number = static_cast<std::int32_t>(nodes_.size());
        Node node{points_[begin].at, points_[begin].at, begin, end, 0};
        for (std::int32_t i = begin; i < end; ++i)
            for (int k = 0; k < 3; ++k) {
                node.low[k] = std::min(node.low[k], points_[i].at[k]);
                node.high[k] = std::max(node.high[k], points_[i].at[k]);
            }
        nodes_.push_back(node);
        if (end - begin <= LEAF) return number;
        const Vec<3> sides = node.high - node.low;
        const auto axis = std::max_element(sides.begin(), sides.end()) - sides.begin();
        const std::int32_t middle = begin + (end - begin) / 2;
        std::nth_element(points_.begin() + begin, points_.begin() + middle, points_.begin() + end, [&](const Point& a, const Point& b) {
            return a.at[axis] < b.at[axis] || (a.at[axis] == b.at[axis] && a.row < b.row);
        });
        build(begin, middle);
        const std::int32_t right = build(middle, end);
        nodes_[number].right = right;
        return number;
    }

    static double distance2(const Node& node, const Vec<3>& p) {
        double sum = 0.0;
        for (int k = 0; k < 3; ++k) {
            const double off = std::max({node.low[k] - p[k], p[k] - node.high[k], 0.0});
            sum += off * off;
        }
        return sum;
    }

    std::vector<Point> points_{};  // in the order of the leaves
    std::vector<Node> nodes_{};
};

// A weight that falls nearly as exp(-4 r^2) does, of r^2 from 0 to 1.
inline double fall(double r2) {
    double power = 1.0 - 0.25 * r2;
    for (int doubling = 0; doubling < 4; ++doubling) power *= power;
    return power;
}

// The quadric near p over the plane of a unit vector, through the points that are seen from the same side. In units of the
// distance of the farthest: how far along the vector it is, what it leaves of the points in the mean, infinite where they form
// none; and how far p is from it, of what the farthest of the others is: on an edge as far, beside one less.
struct Quadric {
    double height = 0.0, left = INFINITY, share = 0.0, size = 0.0;
};

inline Quadric quadric_near(const Sample& sample, const double* points, const double* seen, const Vec<3>& p, const Vec<3>& up) {
    Sample::Near near;
    const int count = sample.nearest(p, near);
    if (count < QUADRIC_LEAST) return {};  // none, where p is not finite
    const double size = std::sqrt(near[count - 1].first), scale = 1.0 / size;
    if (!(norm2(up) > 0.0 && size > 0.0)) return {};
    const Plane plane(up);
    std::array<std::array<double, 6>, 6> left{};
    std::array<double, 6> right{};
    std::array<std::array<double, 6>, Sample::NEAREST> terms;
    std::array<double, Sample::NEAREST> weights, heights;
    int told = 0;
    for (int i = 0; i < count; ++i) {
        const std::int64_t row = static_cast<std::int64_t>(near[i].second) * 3;
        const Vec<3> off = scale * (load<3>(points + row) - p);
        const auto [x, y] = plane.coordinates(off);
        weights[i] = dot(load<3>(seen + row), up) > 0.0 ? fall(x * x + y * y) : 0.0;
        told += weights[i] > 0.0;
        heights[i] = dot(off, up);
        terms[i] = {1.0, x, y, x * x, x * y, y * y};
        for (int j = 0; j < 6; ++j) {
            const double weighed = weights[i] * terms[i][j];
            right[j] += weighed * heights[i];
            for (int k = 0; k <= j; ++k) left[j][k] += weighed * terms[i][k];
        }
    }
    for (int j = 0; j < 6; ++j) left[j][j] += QUADRIC_RIDGE;
    if (told < QUADRIC_LEAST || !solve_positive<6>(left, right, 0.0)) return {};
    double rest = 0.0, total = 0.0, most = 0.0;
    for (int i = 0; i < count; ++i) {
        double off = heights[i];
        for (int j = 0; j < 6; ++j) off -= terms[i][j] * right[j];
        rest += weights[i] * off * off;
        total += weights[i];
        if (near[i].first > QUADRIC_SAME2 * size * size) most = std::max(most, weights[i] * std::fabs(off));
    }
    return {right[0], std::sqrt(rest / total), most > 0.0 ? std::fabs(right[0]) / most : 0.0, size};
}

// Of some places (count, 3), with unit normals (count, 3): `left` and `share` of the quadrics near them (count, 2).
inline std::vector<double> left_by_quadrics(const Sample& tree, const double* sample, const double* seen, const double* places,
                                            const double* normals, std::int64_t count, int threads) {
    std::vector<double> found(static_cast<std::size_t>(count) * 2);
    for_each_range(count, 256, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t i = begin; i < end; ++i) {
            const Quadric here = quadric_near(tree, sample, seen, load<3>(places + i * 3), load<3>(normals + i * 3));
            found[2 * i] = here.left;
            found[2 * i + 1] = here.share;
        }
    });
    return found;
}

// Moves some points (n, 3), by their rows, along unit normals (n, 3) to the surface, where quadrics leave less than `smooth`.
inline void refit(double* points, const std::int32_t* rows, std::int64_t count, const double* normals, const Sample& tree,
                  const double* sample, const double* seen, double smooth, int threads) {
    for_each_range(count, 256, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t) {
        for (std::int64_t i = begin; i < end; ++i) {
            double* here = points + static_cast<std::int64_t>(rows[i]) * 3;
            const Vec<3> p = load<3>(here), up = load<3>(normals + static_cast<std::int64_t>(rows[i]) * 3);
            const Quadric found = quadric_near(tree, sample, seen, p, up);
            const double height = found.left < smooth && std::fabs(found.height) < 1.0 ? found.size * found.height : 0.0;
            for (int k = 0; k < 3; ++k) here[k] = p[k] + height * up[k];
        }
    });
}

}  // namespace meshfix
