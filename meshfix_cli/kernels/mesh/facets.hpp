// Facets: which simplex lies on the other side of each, and which simplices are joined through them.
//
// simplices (m, D+1) vertex numbers; a corner is simplex * (D+1) + position and also names the facet opposite it.
// mates (m, D+1): the corner on the other side of the facet opposite each corner, -1 where there is none.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "common/parallel.hpp"
#include "common/small_map.hpp"
#include "mesh/simplex.hpp"

namespace meshfix {

// Compressed rows: the corners at each vertex, ascending.
struct Incidence {
    std::vector<std::int32_t> offsets, corners;
};

// Corners are put into bins of vertices first, then in order inside each: both passes stay in the cache, and each of
// their items works by itself.
template <int D>
Incidence incidence(const std::int32_t* simplices, std::int64_t m, std::int64_t n, int threads) {
    constexpr std::int64_t BIN = 4096;
    const std::int64_t corners = m * (D + 1), bins = n / BIN + 1, parts = 64;
    const std::int64_t size = std::max(PER_ITEM, corners / parts + 1);
    std::vector<std::int64_t> next(parts * bins, 0);  // where in `binned` a part's next corner of a bin goes
    for_each_range(corners, size, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t part) {
        std::vector<std::int64_t> counts(bins, 0);  // of its own: threads that write side by side wait for one another
        for (std::int64_t c = begin; c < end; ++c) ++counts[simplices[c] / BIN];
        std::copy(counts.begin(), counts.end(), next.begin() + part * bins);
    });
    std::vector<std::int64_t> starts(bins + 1, 0);
    for (std::int64_t b = 0; b < bins; ++b) {
        std::int64_t at = starts[b];
        for (std::int64_t part = 0; part < parts; ++part) at += std::exchange(next[part * bins + b], at);
        starts[b + 1] = at;
    }
    std::vector<std::int32_t> binned(corners);
    for_each_range(corners, size, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t part) {
        std::vector<std::int64_t> to(next.begin() + part * bins, next.begin() + (part + 1) * bins);
        for (std::int64_t c = begin; c < end; ++c) binned[to[simplices[c] / BIN]++] = static_cast<std::int32_t>(c);
    });
    Incidence csr;
    csr.offsets.resize(n + 1);
    csr.corners.resize(corners);
    for_each_range(n, BIN, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t bin) {
        std::array<std::int32_t, BIN> place{};
        for (std::int64_t i = starts[bin]; i < starts[bin + 1]; ++i) ++place[simplices[binned[i]] - begin];
        auto at = static_cast<std::int32_t>(starts[bin]);
        for (std::int64_t v = begin; v < end; ++v) {
            csr.offsets[v] = at;
            at += std::exchange(place[v - begin], at);
        }
        for (std::int64_t i = starts[bin]; i < starts[bin + 1]; ++i)
            csr.corners[place[simplices[binned[i]] - begin]++] = binned[i];
    });
    csr.offsets[n] = static_cast<std::int32_t>(corners);
    return csr;
}

struct Facets {
    std::vector<std::int32_t> mates;
    std::vector<std::uint8_t> against;  // (m, D+1) 1: the two simplices at the facet are numbered against each other
    std::int64_t crowded = -1;          // a corner whose facet has three simplices, unless such have no mates, or two that are the same; -1: none
};

// Calls f(key, position, odd) for the facets of a simplex whose smallest vertex is the one at `here`: the key holds the
// other vertices, the facet is opposite a position; odd: sorting it, as its simplex sees it, takes an odd number of
// swaps. Two simplices that are numbered consistently see their facet from opposite sides: one odd, one even.
template <class F>
void for_each_facet_at(const std::int32_t* simplex, int here, std::integral_constant<int, 2>, const F& f) {
    const auto& [a, b] = opposite_face<2>(here);  // (here, a, b) is an even permutation
    if (simplex[a] > simplex[here]) f(static_cast<std::uint64_t>(simplex[a]), b, false);
    if (simplex[b] > simplex[here]) f(static_cast<std::uint64_t>(simplex[b]), a, true);
}
template <class F>
void for_each_facet_at(const std::int32_t* simplex, int here, std::integral_constant<int, 3>, const F& f) {
    const auto& face = opposite_face<3>(here);
    const std::array<std::int32_t, 3> u{simplex[face[0]], simplex[face[1]], simplex[face[2]]};
    const std::array<int, 3> above{u[0] > simplex[here], u[1] > simplex[here], u[2] > simplex[here]};
    const auto add = [&](int k) {
        const std::int32_t x = u[(k + 1) % 3], y = u[(k + 2) % 3];
        f(static_cast<std::uint64_t>(std::min(x, y)) << 32 | static_cast<std::uint64_t>(std::max(x, y)), face[k], x > y);
    };
    const int count = above[0] + above[1] + above[2];
    if (count < 2) return;
    if (count == 2) return add(2 - 2 * !above[0] - !above[1]);
    for (int k = 0; k < 3; ++k) add(k);
}

// Takes the mates from a facet and its mate.
inline void part(std::vector<std::int32_t>& mates, std::int32_t facet) {
    if (mates[facet] >= 0) mates[mates[facet]] = -1;
    mates[facet] = -1;
}

// Each facet is matched at its smallest vertex; `parted`: not where there are more than two.
template <int D>
Facets match_facets(const std::int32_t* simplices, std::int64_t m, const Incidence& csr, bool parted, int threads) {
    constexpr std::int64_t VERTICES = 1024;
    struct Seen {
        std::int32_t corner;
        bool odd;
        int count;
    };
    const auto n = static_cast<std::int64_t>(csr.offsets.size()) - 1;
    Facets facets;
    facets.mates.assign(m * (D + 1), -1);
    facets.against.resize(m * (D + 1));
    std::vector<std::int64_t> crowded(n / VERTICES + 1, -1);
    for_each_range(n, VERTICES, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        SmallMap<Seen> at_vertex;
        for (std::int64_t v = begin; v < end; ++v) {
            at_vertex.clear(static_cast<std::size_t>(D) * (csr.offsets[v + 1] - csr.offsets[v]));
            for (std::int32_t i = csr.offsets[v]; i < csr.offsets[v + 1]; ++i) {
                const int here = csr.corners[i] % (D + 1);
                const std::int32_t first = csr.corners[i] - here;
                for_each_facet_at(simplices + first, here, std::integral_constant<int, D>{},
                                  [&](std::uint64_t key, int position, bool odd) {
                    const std::int32_t corner = first + position;
                    bool is_new = false;
                    Seen& other = at_vertex.find(key, is_new);
                    if (is_new) {
                        other = {corner, odd, 1};
                        return;
                    }
                    if (simplices[other.corner] == simplices[corner] || (++other.count > 2 && !parted)) {
                        crowded[item] = corner;
                        return;
                    }
                    if (other.count > 2) return part(facets.mates, other.corner);
                    facets.mates[other.corner] = corner;
                    facets.mates[corner] = other.corner;
                    facets.against[other.corner] = facets.against[corner] = odd == other.odd;
                });
            }
        }
    });
    for (std::int64_t corner : crowded)
        if (facets.crowded < 0) facets.crowded = corner;
    return facets;
}

// Simplices all of whose vertices are fixed.
template <int D>
std::vector<std::int32_t> stuck_simplices(const std::int32_t* simplices, std::int64_t m, const std::uint8_t* movable,
                                          int threads) {
    std::vector<std::vector<std::int32_t>> parts(m / PER_ITEM + 1);
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        std::vector<std::int32_t> part;
        for (std::int64_t s = begin; s < end; ++s) {
            int free = 0;
            for (int k = 0; k <= D; ++k) free += movable[simplices[s * (D + 1) + k]];
            if (free == 0) part.push_back(static_cast<std::int32_t>(s));
        }
        parts[item] = std::move(part);
    });
    std::vector<std::int32_t> found;
    for (const auto& part : parts) found.insert(found.end(), part.begin(), part.end());
    return found;
}

// Facets all of whose vertices are fixed, each once, with the simplex that has it, or the first of two.
struct FixedFacets {
    std::vector<std::int32_t> vertices, owners;  // (f, D), (f,)
    std::vector<std::uint8_t> shared;            // (f,) 1: by two
};

template <int D>
FixedFacets fixed_facets(const std::int32_t* simplices, const std::int32_t* mates, std::int64_t m,
                         const std::uint8_t* movable, int threads) {
    std::vector<FixedFacets> parts(m / PER_ITEM + 1);
    for_each_range(m, PER_ITEM, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        FixedFacets part;
        for (auto s = static_cast<std::int32_t>(begin); s < end; ++s) {
            const std::int32_t* simplex = simplices + static_cast<std::int64_t>(s) * (D + 1);
            int free = 0;
            for (int k = 0; k <= D; ++k) free += movable[simplex[k]] != 0;
            for (int k = 0; k <= D; ++k) {
                const std::int64_t corner = static_cast<std::int64_t>(s) * (D + 1) + k;
                if (free != (movable[simplex[k]] != 0) || (mates[corner] >= 0 && mates[corner] < corner)) continue;
                for (int position : opposite_face<D>(k)) part.vertices.push_back(simplex[position]);
                part.owners.push_back(s);
                part.shared.push_back(mates[corner] >= 0);
            }
        }
        parts[item] = std::move(part);
    });
    FixedFacets found;
    for (const auto& part : parts) {
        found.vertices.insert(found.vertices.end(), part.vertices.begin(), part.vertices.end());
        found.owners.insert(found.owners.end(), part.owners.begin(), part.owners.end());
        found.shared.insert(found.shared.end(), part.shared.begin(), part.shared.end());
    }
    return found;
}

struct Orientation {
    std::vector<std::int32_t> component;  // (m,) simplices joined through facets have the same number
    std::vector<std::uint8_t> against;    // (m,) 1: numbered against the first simplex of its component
    bool orientable = true;
};

// Disjoint sets of simplices. Each points to one before it of its set, and knows whether the two are numbered
// against each other.
class Union {
 public:
    explicit Union(std::int64_t m) : parent_(m), against_(m, 0) {
        for (std::int64_t s = 0; s < m; ++s) parent_[s] = static_cast<std::int32_t>(s);
    }

    // Joins two simplices; false: they are in one set, and that says otherwise.
    bool join(std::int32_t s, std::int32_t t, bool against) {
        against ^= climb(s);
        against ^= climb(t);
        if (s == t) return !against;
        if (s < t) std::swap(s, t);
        parent_[s] = t;
        against_[s] = static_cast<std::uint8_t>(against);
        return true;
    }

    // Sets are numbered by their first simplices.
    Orientation result() && {
        std::int32_t sets = 0;
        Orientation result;
        result.component.resize(parent_.size());
        for (std::size_t s = 0; s < parent_.size(); ++s) {
            const std::int32_t p = parent_[s];
            if (p == static_cast<std::int32_t>(s)) {
                result.component[s] = sets++;
            } else {
                result.component[s] = result.component[p];
                against_[s] ^= against_[p];
            }
        }
        result.against = std::move(against_);
        return result;
    }

 private:
    // Goes up to the first of the set, halving the way for the next who comes.
    bool climb(std::int32_t& s) {
        bool against = false;
        while (parent_[s] != s) {
            const std::int32_t p = parent_[s];
            if (parent_[p] != p) {
                against_[s] ^= against_[p];
                parent_[s] = parent_[p];
            }
            against ^= against_[s] != 0;
            s = parent_[s];
        }
        return against;
    }

    std::vector<std::int32_t> parent_;
    std::vector<std::uint8_t> against_;
};

// Each item joins the simplices of a range to those before them in it, of which none has to climb far; what joins ranges
// comes last.
template <int D>
Orientation orient(const Facets& facets, std::int64_t m, int threads) {
    constexpr std::int64_t RANGE = 65536;
    Union sets(m);
    std::atomic<bool> orientable{true};
    std::vector<std::vector<std::int32_t>> later(m / RANGE + 1);  // corners whose mates are in a range before
    const std::int32_t* const mates = facets.mates.data();
    const auto join = [&](std::int32_t corner) {
        return sets.join(corner / (D + 1), mates[corner] / (D + 1), facets.against[corner] != 0);
    };
    for_each_range(m, RANGE, threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        const auto start = static_cast<std::int32_t>(begin * (D + 1));
        bool agree = true;
        for (auto s = static_cast<std::int32_t>(begin); s < end; ++s) {
            std::array<std::int32_t, D + 2> before;  // corners with mates before them, in the range
            int count = 0;
            for (std::int32_t c = s * (D + 1); c <= s * (D + 1) + D; ++c) {
                before[count] = c;
                count += (mates[c] >= start) & (mates[c] < c);
                if (mates[c] < start && mates[c] >= 0) later[item].push_back(c);
            }
            for (int i = 0; i < count; ++i) agree &= join(before[i]);
        }
        if (!agree) orientable = false;
    });
    for (const auto& corners : later)
        for (std::int32_t c : corners)
            if (!join(c)) orientable = false;
    Orientation result = std::move(sets).result();
    result.orientable = orientable;
    return result;
}

}  // namespace meshfix
