// The faces of a star in space, and the elements that they make with a vertex: each in the plane of its own area, seen from
// the side of its normal.
//
// blocks   LANES faces side by side; the last block is filled up with its last face, which changes no minimum
#pragma once

#include <vector>

#include "measures/sines.hpp"

namespace meshfix {

struct Face {
    Vec<3> from, to, normal;
};

class SpaceFaces {
   public:
    void resize(int count) {
        count_ = count;
        blocks_.resize((count + LANES - 1) / LANES);
    }
    int count() const { return count_; }

    void set(int i, const Face& face) {
        put(i, face);
        if (i + 1 == count_)
            for (int rest = count_; rest < static_cast<int>(blocks_.size()) * LANES; ++rest) put(rest, face);
    }

    Face operator[](int i) const {
        const Block& block = blocks_[i / LANES];
        Face face;
        for (int k = 0; k < 3; ++k) {
            face.from[k] = block.from[k][i % LANES];
            face.to[k] = block.to[k][i % LANES];
            face.normal[k] = block.normal[k][i % LANES];
        }
        return face;
    }

    // The edges from p to a face, in the plane of the three.
    static Edges<2> unfolded(const Face& face, const Vec<3>& p) {
        const Vec<3> a = face.from - p, b = face.to - p, area = cross(a, b);
        const double length = std::sqrt(norm2(a)), height = std::sqrt(norm2(area));
        if (!(length > 0.0)) return {};
        return {Vec<2>{length, 0.0}, Vec<2>{dot(a, b) / length, (dot(area, face.normal) < 0.0 ? -height : height) / length}};
    }

    // The smallest area around p, twice; negative of what is turned over.
    double smallest_area(const Vec<3>& p) const {
        Pack smallest = constant<Pack>(INFINITY);
        for (const Block& block : blocks_) {
            const Around here(block, p);
            smallest = smaller(smallest, select(here.turned, -here.area2, here.area2));
        }
        const double area2 = least(smallest);
        return std::copysign(std::sqrt(std::fabs(area2)), area2);
    }

    // The square of the smallest sine around p, or of the scaled Jacobian where there are roles; -1 where an element is not valid.
    double quality(const Vec<3>& p, const std::vector<Roles<2>>& roles) const {
        Pack smallest = constant<Pack>(INFINITY);
        for (std::size_t b = 0; b < blocks_.size(); ++b) {
            const Around here(blocks_[b], p);
            const PackMask plain = here.is_plainly_valid();
            const Pack edges2 = larger(larger(here.a2 * here.b2, here.a2 * blocks_[b].length2), here.b2 * blocks_[b].length2);
            Pack sine2 = here.area2 / edges2;
            if (!roles.empty() || !all(plain))
                for (int i = 0; i < LANES; ++i) {
                    const Edges<2> e = unfolded((*this)[static_cast<int>(b) * LANES + i], p);
                    if (!plain[i] && !is_valid<2>(e, determinant(e), [&] { return Corners<2>{Vec<2>{}, e[0], e[1]}; })) return -1.0;
                    sine2[i] = roles.empty() ? min_sine2(e, false) : sine2_of(roles[b], i, e);
                }
            smallest = smaller(smallest, sine2);
        }
        return least(smallest);
    }

   private:
    struct Block {
        Vec<3, Pack> from, to, normal;
        Pack length2;  // of the faces
    };

    // What LANES faces are seen from p.
    struct Around {
        Pack a2, b2, area2;  // of the edges to both ends, and of twice the area
        PackMask turned;

        Around(const Block& block, const Vec<3>& p) {
            Vec<3, Pack> a, b;
            for (int k = 0; k < 3; ++k) {
                a[k] = block.from[k] - constant<Pack>(p[k]);
                b[k] = block.to[k] - constant<Pack>(p[k]);
            }
            const Vec<3, Pack> area = cross(a, b);
            a2 = norm2(a);
            b2 = norm2(b);
            area2 = norm2(area);
            turned = dot(area, block.normal) < constant<Pack>(0.0);
        }

        // As `is_valid_at_a_glance`, of squares.
        PackMask is_plainly_valid() const {
            const Pack longest2 = constant<Pack>(4.0 * VALID) * larger(a2, b2), zero = constant<Pack>(0.0);
            return (area2 > longest2 * longest2) & (select(turned, -area2, area2) > zero);
        }
    };

    static double sine2_of(const Roles<2>& roles, int lane, const Edges<2>& e) {
        const double corner = roles.corner[lane];
        return corner > 0.5 ? corner_sine2<2>(e, corner, roles.weight[lane], false) : min_sine2(e, false);
    }

    static double least(const Pack& lanes) {
        double smallest = lanes[0];
        for (int i = 1; i < LANES; ++i) smallest = std::min<double>(smallest, lanes[i]);
        return smallest;
    }

    void put(int i, const Face& face) {
        Block& block = blocks_[i / LANES];
        const int lane = i % LANES;
        for (int k = 0; k < 3; ++k) {
            block.from[k][lane] = face.from[k];
            block.to[k][lane] = face.to[k];
            block.normal[k][lane] = face.normal[k];
        }
        block.length2[lane] = norm2(face.to - face.from);
    }

    int count_ = 0;
    std::vector<Block> blocks_{};
};

}  // namespace meshfix
