// Lists of lists of integers, each behind the number of its own: 3(0 4 7).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "text/text.hpp"

namespace meshfix {

template <class T>
struct IntegerLists {
    std::vector<T> offsets{0};  // list i has the values from the i-th on, up to the next
    std::vector<T> values;
    std::int64_t end;           // behind the last list
    bool good = true, fit = true;  // all are there; all are numbers of the type
};

inline std::int64_t behind_blanks(std::string_view text, std::int64_t at) {
    while (at < static_cast<std::int64_t>(text.size()) && separates(text[at])) ++at;
    return at;
}

// Whether the next byte that is no blank is this one; then `at` is behind it.
inline bool passes(std::string_view text, std::int64_t& at, char byte) {
    const std::int64_t next = behind_blanks(text, at);
    if (next >= static_cast<std::int64_t>(text.size()) || text[next] != byte) return false;
    at = next + 1;
    return true;
}

// Reads the next list where it has a few numbers of few digits each with one byte between them, as nearly all have, and
// nothing else; false: it is another, and `at` stays.
template <class T>
bool read_short_list(std::string_view text, std::int64_t& at, std::vector<T>& values) {
    constexpr int MOST = 9, DIGITS = 8;
    const char* p = text.data() + at;
    const char* const end = text.data() + text.size();
    while (p < end && separates(*p)) ++p;
    const int size = end - p > 2 + MOST * (DIGITS + 1) && p[1] == '(' ? *p - '0' : 0;
    if (size < 1 || size > MOST) return false;
    std::array<std::int64_t, MOST> found;
    p += 2;
    for (int i = 0; i < size; ++i, ++p) {
        const int few = read_few_digits(p, end, found[i]);
        p += few;
        if (few == 0 || *p != (i + 1 < size ? ' ' : ')')) return false;
    }
    for (int i = 0; i < size; ++i) values.push_back(static_cast<T>(found[i]));
    at = p - text.data();
    return true;
}

// Reads `count` lists; where they end, or something else stands there, `end` is behind the last that is whole.
template <class T>
IntegerLists<T> read_integer_lists(std::string_view text, std::int64_t at, std::int64_t count) {
    IntegerLists<T> lists;
    const auto left = static_cast<std::int64_t>(text.size()) - at;
    lists.offsets.reserve(std::clamp<std::int64_t>(count, 0, left / 4) + 1);
    lists.values.reserve(std::clamp<std::int64_t>(count, 0, left / 8) * 4);
    const auto read = [&](std::int64_t& value) {
        at = behind_blanks(text, at);
        return read_digits<true>(text, at, value);
    };
    for (lists.end = at; count > 0; --count, lists.end = at) {
        if (!read_short_list(text, at, lists.values)) {
            std::int64_t size = 0, value = 0;
            lists.good = read(size) && passes(text, at, '(');
            for (std::int64_t i = 0; lists.good && i < size; ++i) {
                lists.good = read(value);
                lists.values.push_back(static_cast<T>(value));
                lists.fit &= lists.values.back() == value;
            }
            lists.good = lists.good && passes(text, at, ')');
            if (!lists.good) return lists;
        }
        lists.offsets.push_back(static_cast<T>(lists.values.size()));
        lists.fit &= static_cast<std::size_t>(lists.offsets.back()) == lists.values.size();
    }
    return lists;
}

}  // namespace meshfix
