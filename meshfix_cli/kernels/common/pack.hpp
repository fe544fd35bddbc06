// LANES doubles side by side. The formulas of the kernels are written once, for a scalar T that is double or Pack;
// the operations are those of IEEE double in each lane, so both give the same bits. So do packs of 2 and of 4: minima do
// not depend on how lanes are packed, and sums are made by `LaneSum`, whose order does not either.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "common/compiler.hpp"

namespace meshfix {

#if defined(__AVX2__)
constexpr int LANES = 4;
#else
constexpr int LANES = 2;  // what every x86-64 and every 64-bit ARM has
#endif
constexpr int MOST_LANES = 4;

#if MESHFIX_GNU

typedef double Pack __attribute__((vector_size(LANES * sizeof(double))));
typedef std::int64_t PackMask __attribute__((vector_size(LANES * sizeof(double))));

inline Pack select(PackMask mask, Pack a, Pack b) { return mask ? a : b; }
inline bool any(PackMask mask) {
    std::int64_t either = mask[0];
    for (int i = 1; i < LANES; ++i) either |= mask[i];
    return either != 0;
}
inline bool all(PackMask mask) {
    std::int64_t both = mask[0];
    for (int i = 1; i < LANES; ++i) both &= mask[i];
    return both != 0;
}

#else

struct PackMask {
    bool lane[LANES];
    bool operator[](int i) const { return lane[i]; }
};

struct Pack {
    double lane[LANES];
    double& operator[](int i) { return lane[i]; }
    double operator[](int i) const { return lane[i]; }
};

template <class F>
inline Pack lanewise(const F& f) {
    Pack result;
    for (int i = 0; i < LANES; ++i) result.lane[i] = f(i);
    return result;
}
template <class F>
inline PackMask masked(const F& f) {
    PackMask result;
    for (int i = 0; i < LANES; ++i) result.lane[i] = f(i);
    return result;
}
inline Pack operator+(Pack a, Pack b) { return lanewise([&](int i) { return a[i] + b[i]; }); }
inline Pack operator-(Pack a, Pack b) { return lanewise([&](int i) { return a[i] - b[i]; }); }
inline Pack operator*(Pack a, Pack b) { return lanewise([&](int i) { return a[i] * b[i]; }); }
inline Pack operator/(Pack a, Pack b) { return lanewise([&](int i) { return a[i] / b[i]; }); }
inline Pack operator-(Pack a) { return lanewise([&](int i) { return -a[i]; }); }
inline Pack operator-(Pack a, double b) { return lanewise([&](int i) { return a[i] - b; }); }
inline Pack operator*(double a, Pack b) { return lanewise([&](int i) { return a * b[i]; }); }
inline Pack& operator+=(Pack& a, Pack b) { return a = a + b; }
inline PackMask operator>(Pack a, Pack b) { return masked([&](int i) { return a[i] > b[i]; }); }
inline PackMask operator<(Pack a, Pack b) { return masked([&](int i) { return a[i] < b[i]; }); }
inline PackMask operator>(Pack a, double b) { return masked([&](int i) { return a[i] > b; }); }
inline PackMask operator>=(Pack a, Pack b) { return masked([&](int i) { return a[i] >= b[i]; }); }
inline PackMask operator&(PackMask a, PackMask b) { return masked([&](int i) { return a.lane[i] && b.lane[i]; }); }
inline Pack select(PackMask m, Pack a, Pack b) { return lanewise([&](int i) { return m.lane[i] ? a[i] : b[i]; }); }
inline bool any(PackMask mask) {
    bool either = false;
    for (bool here : mask.lane) either |= here;
    return either;
}
inline bool all(PackMask mask) {
    bool both = true;
    for (bool here : mask.lane) both &= here;
    return both;
}

#endif

// f(0), f(1), ... side by side.
template <class F>
inline Pack gathered(const F& f) {
#if MESHFIX_GNU && defined(__AVX2__)
    return Pack{f(0), f(1), f(2), f(3)};
#elif MESHFIX_GNU
    return Pack{f(0), f(1)};
#else
    return lanewise(f);
#endif
}

inline Pack load_pack(const double* from) {
    Pack p;
    std::memcpy(&p, from, sizeof p);
    return p;
}

inline Pack broadcast(double x, const Pack*) {
    Pack p;
    for (int i = 0; i < LANES; ++i) p[i] = x;
    return p;
}

inline double broadcast(double x, const double*) { return x; }
inline double select(bool mask, double a, double b) { return mask ? a : b; }

// The constant x as a scalar of type T.
template <class T>
inline T constant(double x) {
    return broadcast(x, static_cast<const T*>(nullptr));
}

inline double square_root(double x) { return std::sqrt(x); }
inline Pack square_root(Pack p) {
    for (int i = 0; i < LANES; ++i) p[i] = std::sqrt(p[i]);
    return p;
}

// Of normal positive numbers, to the last bit or two: three steps of Halley from the exponent's third. All processors
// and libraries give the same bits.
inline Pack cube_root(Pack p) {
    Pack root;
    for (int i = 0; i < LANES; ++i) {
        const double number = p[i];
        std::uint64_t bits;
        std::memcpy(&bits, &number, sizeof bits);
        bits = bits / 3 + 0x2A9F7893782DA1CE;
        double guess;
        std::memcpy(&guess, &bits, sizeof guess);
        root[i] = guess;
    }
    for (int step = 0; step < 3; ++step) {
        const Pack cube = root * root * root;
        root = root * (cube + p + p) / (cube + cube + p);
    }
    return root;
}

// LANES numbers that lie side by side in memory.
inline Pack pack_at(const double* numbers) {
    Pack p;
    std::memcpy(&p, numbers, sizeof p);
    return p;
}
inline void put(Pack p, double* numbers) { std::memcpy(numbers, &p, sizeof p); }

// A sum over blocks of LANES numbers, in MOST_LANES parts.
class LaneSum {
 public:
    LaneSum() {
        for (Pack& part : parts_) part = constant<Pack>(0.0);
    }
    void add(std::size_t block, Pack p) { parts_[block % PARTS] += p; }
    double total() const {
        double sum = 0.0;
        for (const Pack& part : parts_)
            for (int i = 0; i < LANES; ++i) sum += part[i];
        return sum;
    }

 private:
    static constexpr std::size_t PARTS = MOST_LANES / LANES;
    Pack parts_[PARTS];
};

template <class T>
inline T smaller(T a, T b) {
    return select(a < b, a, b);
}

template <class T>
inline T larger(T a, T b) {
    return select(a > b, a, b);
}

}  // namespace meshfix
