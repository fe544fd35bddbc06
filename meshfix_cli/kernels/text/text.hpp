// Numbers in text files: where they are, what they say, and the shortest text for one.
//
// A word is a run of bytes that are neither blanks, control characters nor commas nor, where these are `BRACKETS` of
// lists, round ones. A span is the offset of its first byte and the offset behind its last. Nothing here allocates by
// what a file announces.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "common/compiler.hpp"
#include "common/parallel.hpp"

namespace meshfix {

struct Span {
    std::int64_t begin = -1, end = -1;
};

template <bool BRACKETS = false>
bool separates(char c) {
    return static_cast<unsigned char>(c) <= ' ' || c == ',' || (BRACKETS && (c == '(' || c == ')'));
}
inline bool ends_line(char c) { return c == '\n' || c == '\r'; }

// The first word at or behind `at`; none in the rest of the text, or of the line: begin = -1.
template <bool BRACKETS = false>
Span next_word(std::string_view text, std::int64_t at, bool one_line) {
    const auto size = static_cast<std::int64_t>(text.size());
    for (; at < size && separates<BRACKETS>(text[at]); ++at)
        if (one_line && ends_line(text[at])) return {};
    if (at >= size) return {};
    Span word{at, at};
    while (word.end < size && !separates<BRACKETS>(text[word.end])) ++word.end;
    return word;
}

// The words from an offset on, in pieces for threads.
struct Pieces {
    std::vector<std::int64_t> begin, first;  // of each piece and of the end: its offset, and the number of its first word

    std::int64_t pieces() const { return static_cast<std::int64_t>(begin.size()) - 1; }
    std::int64_t words() const { return first.back(); }
    // Where to look for the first word of a piece: behind one that began in the piece before.
    template <bool BRACKETS = false>
    std::int64_t first_word(std::string_view text, std::int64_t piece) const {
        std::int64_t at = begin[piece];
        if (piece > 0 && !separates<BRACKETS>(text[at - 1]))
            while (at < begin[piece + 1] && !separates<BRACKETS>(text[at])) ++at;
        return at;
    }
};

// How many words begin in a part of the text; `at` is where all of them begin.
template <bool BRACKETS>
std::int64_t count_words(std::string_view text, std::int64_t at, std::int64_t begin, std::int64_t end) {
    const auto separate = separates<BRACKETS>;
    std::int64_t count = begin < end && !separate(text[begin]) && (begin == at || separate(text[begin - 1]));
    for (std::int64_t i = begin + 1; i < end; ++i) count += separate(text[i - 1]) & !separate(text[i]);
    return count;
}

// As many pieces as it takes to have `count` words, or all there are.
template <bool BRACKETS = false>
Pieces cut(std::string_view text, std::int64_t at, std::int64_t count, int threads) {
    constexpr std::int64_t LARGE = 1 << 18;
    const auto size = static_cast<std::int64_t>(text.size());
    const std::int64_t piece = std::clamp<std::int64_t>(8 * std::clamp<std::int64_t>(count, 0, size), 64, LARGE);
    if (piece < LARGE) threads = 1;  // it is not worth the while
    Pieces pieces{{at}, {0}};
    while (pieces.words() < count && pieces.begin.back() < size) {
        const std::int64_t begin = pieces.begin.back(), left = (size - begin + piece - 1) / piece;
        const std::int64_t batch = std::min<std::int64_t>(left, 4 * threads);
        std::vector<std::int64_t> counts(batch);
        for_each_item(batch, threads, [&](std::int64_t i) {
            counts[i] = count_words<BRACKETS>(text, at, begin + i * piece, std::min(size, begin + (i + 1) * piece));
        });
        for (std::int64_t i = 0; i < batch && pieces.words() < count; ++i) {
            pieces.begin.push_back(std::min(size, begin + (i + 1) * piece));
            pieces.first.push_back(pieces.words() + counts[i]);
        }
    }
    return pieces;
}

// Calls f(piece, at, first, last) for each piece: where its own words begin, and their numbers, below `count`.
template <bool BRACKETS, class F>
void for_each_piece(std::string_view text, const Pieces& pieces, std::int64_t count, int threads, const F& f) {
    for_each_item(pieces.pieces(), threads, [&](std::int64_t p) {
        f(p, pieces.first_word<BRACKETS>(text, p), pieces.first[p], std::min(count, pieces.first[p + 1]));
    });
}

// The spans of the words from an offset on, as many as there are, at most `count`.
template <bool BRACKETS>
std::vector<std::int64_t> find_words(std::string_view text, std::int64_t at, std::int64_t count, int threads) {
    const Pieces pieces = cut<BRACKETS>(text, at, count, threads);
    std::vector<std::int64_t> spans(2 * std::clamp<std::int64_t>(count, 0, pieces.words()));
    const auto find = [&](std::int64_t, std::int64_t at, std::int64_t first, std::int64_t last) {
        for (std::int64_t i = first; i < last; ++i) {
            const Span word = next_word<BRACKETS>(text, at, false);
            spans[2 * i] = word.begin;
            spans[2 * i + 1] = at = word.end;
        }
    };
    for_each_piece<BRACKETS>(text, pieces, count, threads, find);
    return spans;
}

// The words of the next lines that have some, from an offset on: as many lines as there are, at most `count`.
struct Lines {
    std::vector<std::int64_t> spans;
    std::vector<std::int64_t> starts{0};  // the number of the first word of each line, and of all words
    std::int64_t end;                     // behind the last word
};

inline Lines find_lines(std::string_view text, std::int64_t at, std::int64_t count) {
    Lines lines;
    lines.end = at;
    for (Span word = next_word(text, at, false); count > 0 && word.begin >= 0; --count) {
        for (; word.begin >= 0; word = next_word(text, word.end, true)) {
            lines.spans.insert(lines.spans.end(), {word.begin, word.end});
            lines.end = word.end;
        }
        lines.starts.push_back(static_cast<std::int64_t>(lines.spans.size() / 2));
        word = next_word(text, lines.end, false);
    }
    return lines;
}

// The offset behind the next `count` words; -1: there are fewer.
inline std::int64_t behind_words(std::string_view text, std::int64_t at, std::int64_t count, int threads) {
    const Pieces pieces = cut(text, at, count, threads);
    if (pieces.words() < count) return -1;
    if (count <= 0) return at;
    const std::int64_t last = pieces.pieces() - 1;
    at = pieces.first_word(text, last);
    for (std::int64_t i = pieces.first[last]; i < count; ++i) at = next_word(text, at, false).end;
    return at;
}

// A number may begin with a plus, of which from_chars does not know.
inline std::string_view without_plus(std::string_view word) {
    return word.size() > 1 && word[0] == '+' && word[1] != '-' ? word.substr(1) : word;
}

// Reads an integer that is the word or, with `slash`, what stands before its first slash (the corners of .obj).
inline bool read_integer(std::string_view word, std::int64_t& value, bool slash) {
    word = without_plus(word);
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    return error == std::errc() && (end == word.data() + word.size() || (slash && *end == '/'));
}

// The number of eight digits, of which the first is the lowest byte.
inline std::int64_t digits_of_bytes(std::uint64_t bytes) {
    bytes = bytes * 10 + (bytes >> 8);  // pairs of digits, then pairs of pairs
    constexpr std::uint64_t PAIRS = 0x000000FF000000FF;
    return static_cast<std::int64_t>(((bytes & PAIRS) * 0x000F424000000064 + (bytes >> 16 & PAIRS) * 0x0000271000000001) >> 32);
}

// Reads an integer of at most seven digits, of which none is looked at by itself: how many they are has no order that a
// processor could foresee. Returns how many they are; 0: it is something else, or near the end.
inline int read_few_digits(const char* p, const char* end, std::int64_t& value) {
#if MESHFIX_GNU && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    if (end - p < 8) return 0;
    std::uint64_t bytes;
    std::memcpy(&bytes, p, sizeof bytes);
    bytes ^= 0x3030303030303030;  // digits are 0 to 9 now, and nothing else is
    const std::uint64_t others = (bytes | (bytes + 0x7676767676767676)) & 0x8080808080808080;
    if (others == 0 || (others & 0x80) != 0) return 0;
    const int digits = __builtin_ctzll(others) / 8;
    value = digits_of_bytes(bytes << (64 - 8 * digits));  // zeros in front of them
    return digits;
#else
    static_cast<void>(p), static_cast<void>(end), static_cast<void>(value);
    return 0;
#endif
}

// Reads the plain integer of at most 18 digits that begins at an offset, in one pass; false: there is none, and `at`
// stays.
template <bool BRACKETS>
bool read_digits(std::string_view text, std::int64_t& at, std::int64_t& value) {
    const char *p = text.data() + at, *const end = text.data() + text.size();
    const int few = read_few_digits(p, end, value);
    if (few > 0 && separates<BRACKETS>(p[few])) {
        at += few;
        return true;
    }
    const bool minus = p < end && *p == '-';
    p += minus;
    const char* const digits = p;
    value = 0;
    for (; p < end && p - digits < 18; ++p) {
        const unsigned digit = static_cast<unsigned char>(*p) - unsigned{'0'};
        if (digit > 9) break;
        value = 10 * value + digit;
    }
    if (p == digits || (p < end && !separates<BRACKETS>(*p))) return false;
    if (minus) value = -value;
    at = p - text.data();
    return true;
}

// Does the same with the next word.
template <bool BRACKETS = false>
bool read_plain_integer(std::string_view text, std::int64_t& at, std::int64_t& value) {
    const auto size = static_cast<std::int64_t>(text.size());
    std::int64_t begin = at;
    while (begin < size && separates<BRACKETS>(text[begin])) ++begin;
    if (!read_digits<BRACKETS>(text, begin, value)) return false;
    at = begin;
    return true;
}

// What stands for a word that is not an integer: its first seven bytes, beside a sign that no number of a mesh has.
inline std::int64_t code_of(std::string_view word) {
    auto code = std::uint64_t{1} << 63;
    for (std::size_t i = 0; i < std::min<std::size_t>(7, word.size()); ++i)
        code |= std::uint64_t{static_cast<std::uint8_t>(word[i])} << 8 * i;
    return static_cast<std::int64_t>(code);
}

// The integers of the next lines that have words, as `find_lines` finds them.
struct LineIntegers {
    std::vector<std::int64_t> values, starts{0};
    std::int64_t end;
};

inline LineIntegers read_lines(std::string_view text, std::int64_t at, std::int64_t count) {
    const auto size = static_cast<std::int64_t>(text.size());
    LineIntegers lines;
    lines.end = at;
    lines.values.reserve(std::clamp<std::int64_t>(8 * std::min(count, size), 0, (size - at) / 2 + 1));
    for (; count > 0; --count) {
        while (at < size && separates(text[at])) ++at;
        if (at >= size) break;
        while (at < size && !ends_line(text[at])) {
            std::int64_t value = 0;
            if (!read_plain_integer(text, at, value)) {
                const Span word = next_word(text, at, true);
                const std::string_view bytes = text.substr(word.begin, word.end - word.begin);
                if (!read_integer(bytes, value, false)) value = code_of(bytes);
                at = word.end;
            }
            lines.values.push_back(value);
            lines.end = at;
            while (at < size && separates(text[at]) && !ends_line(text[at])) ++at;
        }
        lines.starts.push_back(static_cast<std::int64_t>(lines.values.size()));
    }
    return lines;
}

// Integers of the words from an offset on, in the type T: as many as there are in a row, at most `count`.
template <class T>
struct Integers {
    std::vector<T> values;
    std::int64_t end;      // behind the last
    std::int64_t bad = -1; // the offset of what is not an integer, or the size of the text where words are missing
    bool fit = true;       // all are numbers of the type
};

template <class T, bool BRACKETS>
Integers<T> read_integers(std::string_view text, std::int64_t at, std::int64_t count, int threads) {
    struct Part {
        std::int64_t bad = -1, end = -1, read = 0;
        bool fit = true;
    };
    const Pieces pieces = cut<BRACKETS>(text, at, count, threads);
    Integers<T> result{{}, at};
    result.values.resize(std::clamp<std::int64_t>(count, 0, pieces.words()));
    std::vector<Part> parts(pieces.pieces());
    const auto read_piece = [&](std::int64_t p, std::int64_t at, std::int64_t first, std::int64_t last) {
        Part part;
        for (std::int64_t i = first; i < last; ++i, ++part.read) {
            std::int64_t value = 0;
            if (!read_plain_integer<BRACKETS>(text, at, value)) {
                const Span word = next_word<BRACKETS>(text, at, false);
                if (!read_integer(text.substr(word.begin, word.end - word.begin), value, false)) {
                    part.bad = word.begin;
                    break;
                }
                at = word.end;
            }
            result.values[i] = static_cast<T>(value);
            part.fit &= result.values[i] == value;
            part.end = at;
        }
        parts[p] = part;
    };
    for_each_piece<BRACKETS>(text, pieces, count, threads, read_piece);
    std::int64_t read = 0;
    for (const Part& part : parts) {
        read += part.read;
        result.fit &= part.fit;
        if (part.end >= 0) result.end = part.end;
        if (part.bad >= 0) {
            result.bad = part.bad;
            break;
        }
    }
    if (result.bad < 0 && read < count) result.bad = static_cast<std::int64_t>(text.size());
    result.values.resize(read);
    return result;
}

// The slow way: Fortran's exponents, numbers too large or too small, and libraries without from_chars.
template <class Real>
bool read_number_slowly(std::string_view word, Real& value) {
    std::string copy(word);
    for (char& c : copy)
        if (c == 'd' || c == 'D') c = 'e';
    if (copy.empty() || copy.find_first_not_of("+-.0123456789eEinfatyINFATY") != std::string::npos) return false;
    char* end = nullptr;
    value = sizeof(Real) == 4 ? static_cast<Real>(std::strtof(copy.c_str(), &end))
                              : static_cast<Real>(std::strtod(copy.c_str(), &end));
    return end == copy.c_str() + copy.size();
}

// Reads the nearest number of the type.
template <class Real>
bool read_number(std::string_view word, Real& value) {
#if defined(__cpp_lib_to_chars) && !defined(MESHFIX_PLAIN)
    const std::string_view digits = without_plus(word);
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc() && end == digits.data() + digits.size()) return true;
#endif
    return read_number_slowly(word, value);
}

// Reads what a field of Fortran or Nastran holds: blanks around it, or nothing else, which is 0, and exponents without a
// letter, as in 1.5-3.
template <class Real>
bool read_field(std::string_view field, Real& value) {
    const auto blank = [](char c) { return static_cast<unsigned char>(c) <= ' '; };
    while (!field.empty() && blank(field.front())) field.remove_prefix(1);
    while (!field.empty() && blank(field.back())) field.remove_suffix(1);
    if (field.empty() || read_number(field, value)) return true;
    const std::size_t sign = field.find_last_of("+-");
    if (sign == std::string_view::npos || sign == 0) return false;
    const char before = field[sign - 1];
    if (before != '.' && (before < '0' || before > '9')) return false;
    return read_number_slowly(std::string(field.substr(0, sign)) + "e" + std::string(field.substr(sign)), value);
}

template <class Real>
std::string with_digits(Real value, int digits) {
    char buffer[40];
    return {buffer, static_cast<std::size_t>(std::snprintf(buffer, sizeof buffer, "%.*g", digits, double(value)))};
}

// Appends the shortest text that reads back to the value; where that is longer than `longest` (0: no limit), the most
// digits that fit.
template <class Real>
void append_shortest(std::string& text, Real value, int longest) {
    const std::size_t begin = text.size();
#if defined(__cpp_lib_to_chars) && !defined(MESHFIX_PLAIN)
    char buffer[64];
    text.append(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
#else
    Real back{};
    for (int digits = 1; digits <= 17; ++digits) {
        text.resize(begin);
        text += with_digits(value, digits);
        if (read_number_slowly(std::string_view(text).substr(begin), back) && back == value) break;
    }
#endif
    for (int digits = 17; longest > 0 && static_cast<int>(text.size() - begin) > longest && digits > 0; --digits) {
        text.resize(begin);
        text += with_digits(value, digits);
    }
}

// Writes a number as "-d.ddde+xx", with so many digits, or as few as read back to it (0); returns what is written.
inline std::string_view write_scientific(char (&buffer)[40], double value, int digits) {
#if defined(__cpp_lib_to_chars) && !defined(MESHFIX_PLAIN)
    constexpr auto form = std::chars_format::scientific;
    const char* const end = digits > 0 ? std::to_chars(buffer, buffer + sizeof buffer, value, form, digits - 1).ptr
                                       : std::to_chars(buffer, buffer + sizeof buffer, value, form).ptr;
    return {buffer, static_cast<std::size_t>(end - buffer)};
#else
    double back{};
    for (int some = digits > 0 ? digits : 1;; ++some) {
        const auto size = std::snprintf(buffer, sizeof buffer, "%.*e", some - 1, value);
        const std::string_view text(buffer, static_cast<std::size_t>(size));
        if (digits > 0 || some == 17 || (read_number_slowly(text, back) && back == value)) return text;
    }
#endif
}

// A number as a field shows it: ".ddd", "dd.dd" or "d.dde-xx", always with a point, as Fortran and Nastran tell reals by.
struct Decimal {
    bool minus = false;
    int count = 0;  // of its digits; the last is no 0, but where it is the only one
    int exponent = 0;
    char digits[20] = {};

    explicit Decimal(std::string_view scientific) : minus(scientific[0] == '-') {
        const std::size_t e = scientific.find('e');
        for (const char c : scientific.substr(0, e))
            if (c >= '0' && c <= '9') digits[count++] = c;
        while (count > 1 && digits[count - 1] == '0') --count;
        const std::string_view power = without_plus(scientific.substr(e + 1));
        std::from_chars(power.data(), power.data() + power.size(), exponent);
    }

    int size(bool letter) const { return minus + (plainly(letter) ? plain_size() : size_with_power(letter)); }

    void append(std::string& text, bool letter) const {
        if (minus) text += '-';
        if (!plainly(letter)) {
            text += digits[0];
            text += '.';
            text.append(digits + 1, count - 1);
            if (letter) text += 'e';
            if (exponent < 0 || !letter) text += exponent < 0 ? '-' : '+';
            text += std::to_string(std::abs(exponent));
        } else if (exponent < 0) {
            text += '.';
            text.append(-exponent - 1, '0');
            text.append(digits, count);
        } else {
            const int whole = std::min(exponent + 1, count);
            text.append(digits, whole);
            text.append(exponent + 1 - whole, '0');
            text += '.';
            text.append(digits + whole, count - whole);
        }
    }

  private:
    bool plainly(bool letter) const {
        return exponent >= -20 && exponent <= 20 && plain_size() <= size_with_power(letter);
    }
    int plain_size() const { return exponent < 0 ? count - exponent : std::max(count, exponent + 1) + 1; }
    int size_with_power(bool letter) const {
        const int power = std::abs(exponent);
        return count + 1 + letter + (exponent < 0 || !letter) + 1 + (power > 9) + (power > 99);
    }
};

// Appends the number with as many digits as a field of so many columns holds, at most those that it takes to read back,
// if `padded` behind blanks that fill it. In few columns the exponent has no letter, which Nastran knows as well.
inline void append_field(std::string& text, double value, int columns, bool padded) {
    const bool letter = columns > 10;
    char buffer[40];
    Decimal field(write_scientific(buffer, value, 0));
    while (field.size(letter) > columns && field.count > 1) {  // a digit less is a character less, or none
        const int digits = field.count - std::min(field.size(letter) - columns, field.count - 1);
        field = Decimal(write_scientific(buffer, value, digits));
    }
    if (padded) text.append(std::max(columns - field.size(letter), 0), ' ');
    field.append(text, letter);
}

}  // namespace meshfix
