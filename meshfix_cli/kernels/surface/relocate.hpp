// The moves of vertices on a surface: each in its tangent plane, where the star is one of a plane mesh, and from there back to
// what it slides on. On a line or curve the fans of elements beside it are turned into one plane about its tangent.
//
// What is taken is judged in space: each element in the plane of its own area, seen from the side of its normal.
#pragma once

#include "moves/nearness.hpp"
#include "moves/relocate.hpp"
#include "surface/faces.hpp"
#include "surface/unfold.hpp"

namespace meshfix {

struct SurfaceRelocation {
    StarsView stars;
    double* points;         // (n, 3), moved in place
    std::uint8_t* states;   // (n) HELD, DONE or DUE
    const double* normals;  // (elements, 3) of the side from which each is seen
    Parameters parameters;
    const double* ahead = nullptr;  // (n, 3) where vertices go, as far as that is good; null: where their moves take them

    Star<2> star{};
    Programme<2> program{};
    ActiveSet<2> active_set{};
    Directions<3> directions{};
    Plane plane{{}, {}};
    Vec<3> base{};  // the origin of the star
    SpaceFaces faces{};  // of the star
    Vec<3> up{};         // the sum of their normals
    std::vector<std::uint16_t> beside{};

    void gather(std::int64_t v) {
        const Vec<3> here = at(v);
        directions.set(*parameters.freedom, v, load<3>(parameters.start + v * 3), here);
        star.faces_count = stars.offsets[v + 1] - stars.offsets[v];
        faces.resize(star.faces_count);
        up = {};
        const std::int32_t* neighbours = stars.neighbours + stars.neighbour_offsets[v];
        const std::uint16_t* face = stars.faces + static_cast<std::int64_t>(stars.offsets[v]) * 2;
        for (int i = 0; i < star.faces_count; ++i) {
            const Vec<3> normal = normal_of(stars.corners[stars.offsets[v] + i]);
            faces.set(i, {at(neighbours[face[2 * i]]), at(neighbours[face[2 * i + 1]]), normal});
            up = up + normal;
        }
        star.origin = {};
        star.centre = {};
        if (directions.count == 2)
            lay_flat(v, here, face);
        else
            turn_about(v, here);
        star.set_roles(stars, v);
    }

    Vec<3> at(std::int64_t v) const { return load<3>(points + v * 3); }

    Vec<3> normal_of(std::int32_t corner) const {
        const std::int64_t simplex = corner / 3;
        return load<3>(normals + (stars.elements == nullptr ? simplex : stars.elements->owners[simplex]) * 3);
    }

    void lay_flat(std::int64_t v, const Vec<3>& here, const std::uint16_t* face) {
        base = centroid<3>(stars, points, v);
        plane = Plane(directions.axes[0], directions.axes[1]);
        if (dot(cross(plane.along, plane.across), up) < 0.0) plane.across = -1.0 * plane.across;
        star.directions.set_anywhere();
        star.faces = face;
        star.neighbours.clear();
        double size2 = 0.0;
        for (std::int32_t i = stars.neighbour_offsets[v]; i < stars.neighbour_offsets[v + 1]; ++i)
            size2 = add(plane, at(stars.neighbours[i]), size2);
        star.position = plane.coordinates(here - base);
        star.take_unit(size2);
    }

    // The free vertex stays at the origin's height: each fan lies on its own side of the line.
    void turn_about(std::int64_t v, const Vec<3>& here) {
        const Vec<3> way = directions.axes[0];
        base = here;
        plane = Plane(way, {});
        star.directions.count = 1;
        star.directions.axes = {Vec<2>{1.0, 0.0}, Vec<2>{0.0, 1.0}};
        star.directions.anchor = {};
        star.directions.kept = {false, true};
        star.directions.aligned = true;
        star.directions.reference = nullptr;
        star.neighbours.clear();
        beside.clear();
        double size2 = 0.0;
        for (int i = 0; i < faces.count(); ++i) {
            const Face one = faces[i];
            Vec<3> side = cross(one.normal, way);
            const double length = std::sqrt(norm2(side));
            if (length > 0.0) side = (1.0 / length) * side;
            for (const Vec<3>& p : {one.from, one.to}) {
                beside.push_back(static_cast<std::uint16_t>(beside.size()));
                size2 = add(Plane(way, side), p, size2);
            }
        }
        star.faces = beside.data();
        star.position = {};
        star.take_unit(size2);
        star.centre = {dot(way, centroid<3>(*parameters.freedom, directions, points, v) - here) / star.unit, 0.0};
    }

    double add(const Plane& in, const Vec<3>& p, double size2) {
        star.neighbours.push_back(in.coordinates(p - base));
        return std::max(size2, norm2(star.neighbours.back()));
    }

    // Where the vertex comes to be that goes to x, and where a position in space is in the star.
    Vec<3> landing(const Vec<2>& x) const { return directions.onto(base + star.unit * plane.position(x)); }
    Vec<2> local(const Vec<3>& p) const { return (1.0 / star.unit) * plane.coordinates(p - base); }

    double smallest_area(const Vec<3>& p) const { return faces.smallest_area(p); }
    double quality(const Vec<3>& p) const { return faces.quality(p, star.roles); }
    bool valid(const Vec<3>& p) const { return quality(p) > 0.0; }

    bool is_near(std::int64_t v, const Vec<3>& p) const {
        Nearness<3> nearness(points, parameters);
        if (directions.curved()) nearness.begin_at(directions.shape, directions.piece);
        return nearness.is_bounded(v) ? nearness.is_near(v, p) : nearness.is_in_reach(v, p);
    }

    bool is_in_reach(std::int64_t v, const Vec<3>& p) const { return Nearness<3>(points, parameters).is_in_reach(v, p); }

    bool makes_smaller(const Vec<3>& here, const Vec<3>& p) const {
        if (parameters.min_det == -INFINITY) return false;
        const double after = smallest_area(p);
        return after < parameters.min_det && after < smallest_area(here);
    }

    bool store(std::int64_t v, const Vec<3>& p) {
        bool changed = false;
        for (int k = 0; k < 3; ++k) {
            changed |= points[v * 3 + k] != p[k];
            points[v * 3 + k] = p[k];
        }
        if (!changed) return false;
        if (states[v] != HELD) states[v] = DUE;
        make_neighbours_due(stars, states, v);
        return true;
    }

    // The last place on the way to x, halved a few times, that is good.
    template <class F>
    bool go(std::int64_t v, Vec<2> x, const F& good) {
        const Vec<2> from = star.position;
        for (int halvings = 0; halvings < GUARD_TRIALS; ++halvings) {
            const Vec<3> p = landing(x);
            if (good(p)) return store(v, p);
            x = from + 0.5 * (x - from);
        }
        return false;
    }

    // To where the smallest area is larger; heights where these make the star valid.
    bool untangle(std::int64_t v, bool heights) {
        if (!program.solve(star, heights)) return heights && untangle(v, false);
        if (heights && !(program.smallest > 0.0)) return untangle(v, false);
        const double least = smallest_area(at(v));
        const bool was_valid = valid(at(v));
        return go(v, program.position, [&](const Vec<3>& p) {
            return smallest_area(p) >= least && (was_valid ? is_near(v, p) : is_in_reach(v, p));
        });
    }

    bool to_centre(std::int64_t v) {
        const bool was_valid = valid(at(v));
        return go(v, star.centre, [&](const Vec<3>& p) { return was_valid ? is_near(v, p) : is_in_reach(v, p); });
    }

    bool combined_untangle(std::int64_t v) {
        const bool moved = to_centre(v);
        star.position = local(at(v));
        return (valid(at(v)) ? false : untangle(v, false)) || moved;
    }

    // Section 3.3: smart Laplacian first, the active-set method where the star stays below the threshold; what is pinched
    // almost flat the linear programme frees.
    bool smooth(std::int64_t v, bool optimise) {
        const Vec<3> here = at(v);
        double best = quality(here);
        if (!(best > 0.0)) return false;
        const auto better = [&](const Vec<3>& p) {
            const double there = quality(p);
            if (!(there > best) || !is_near(v, p) || makes_smaller(here, p)) return false;
            best = there;
            return true;
        };
        bool moved = take(v, star.centre, 1, better);
        if (optimise && best < LP_PINCHED_SINE2 && program.solve(star, true)) moved |= take(v, program.position, 1, better);
        if (!optimise || !(best < parameters.threshold_sine2)) return moved;
        double flat = min_sine2<2>(star, star.position, 0.0);
        if (!(flat > 0.0)) return moved;
        const Vec<2> x = active_set.improve(star, star.position, flat);
        return (x != star.position && take(v, x, GUARD_TRIALS, better)) || moved;
    }

    template <class F>
    bool take(std::int64_t v, Vec<2> x, int trials, const F& better) {
        for (int trial = 0; trial < trials; ++trial) {
            const Vec<3> p = landing(x);
            if (better(p)) {
                store(v, p);
                star.position = local(p);
                return true;
            }
            x = star.position + 0.5 * (x - star.position);
        }
        return false;
    }

    bool smooth_mean(std::int64_t v) {
        const Vec<3> here = at(v);
        const double before = quality(here), floor = parameters.threshold_sine2;
        const double flat = min_sine2<2>(star, star.position, 0.0);
        if (!(before > 0.0 && flat > 0.0)) return false;
        const auto reachable = [&](const Vec<2>& x) { return local(landing(x)); };
        const Vec<2> x = star.roles.empty() ? improve_mean<2, MeanRatio<2>>(star, flat, floor, reachable)
                                            : improve_mean<2, ElementRatio<2>>(star, flat, floor, reachable);
        if (x == star.position) return false;
        const double least = std::min(before, floor) * (1.0 - SAME_SINE2);
        return go(v, x, [&](const Vec<3>& p) { return quality(p) >= least && is_near(v, p) && !makes_smaller(here, p); });
    }

    // On the way to a given place; the worst element gets no worse, unless it is still above the threshold.
    bool go_ahead(std::int64_t v) {
        const Vec<3> here = at(v);
        const double before = quality(here), least = std::min(before, parameters.threshold_sine2) * (1.0 - SAME_SINE2);
        const Vec<2> x = local(load<3>(ahead + v * 3));
        if (!(before > 0.0) || x == star.position) return false;
        return go(v, x, [&](const Vec<3>& p) { return quality(p) >= least && is_near(v, p) && !makes_smaller(here, p); });
    }

    // To where elements that are too far from their shapes are least so, of some places on the way to the start and to the
    // mean of the neighbours; in a valid star, which stays valid.
    bool draw_back(std::int64_t v) {
        const Nearness<3> near(points, parameters);
        if (!near.is_bounded(v) || near.is_within(parameters.freedom->bound2, v, at(v)) || !valid(at(v))) return false;
        bool moved = false;
        for (const Vec<2>& target : {local(load<3>(parameters.start + v * 3)), star.centre}) {
            Vec<2> x = target;
            for (int halvings = 0; halvings < GUARD_TRIALS; ++halvings) {
                const Vec<3> p = landing(x);
                if (valid(p) && near.is_in_reach(v, p) && near.is_within(DRAWN_BACK * near.deviation2_at(v, at(v)), v, p))
                    moved |= store(v, p);
                x = star.position + 0.5 * (x - star.position);
            }
        }
        return moved;
    }

    bool raise_smallest(std::int64_t v) {
        const double before = quality(at(v));
        return before > 0.0 && before < parameters.threshold_sine2 && smooth(v, true);
    }

    bool relocated(Move move, std::int64_t v) {
        switch (move) {
            case Move::laplacian: return to_centre(v);
            case Move::untangle: return untangle(v, false);
            case Move::untangle_heights:
            case Move::untangle_coefficients: return untangle(v, true);
            case Move::combined_untangle: return combined_untangle(v);
            case Move::smart_laplacian: return smooth(v, false);
            case Move::combined_smooth: return smooth(v, true);
            case Move::mean_ratio: return smooth_mean(v);
            case Move::raise_smallest: return raise_smallest(v);
            case Move::draw_back: return draw_back(v);
            case Move::come_back:
            case Move::untangle_most: return false;
        }
        return false;
    }

    void relocate(Move move, std::int64_t v, Counts& counts) {
        ++counts.visited;
        if (parameters.freedom->anywhere(v)) return;
        states[v] = DONE;
        gather(v);
        counts.moved += ahead == nullptr ? relocated(move, v) : go_ahead(v);
        if (move == Move::laplacian) states[v] = DUE;
    }
};

}  // namespace meshfix
