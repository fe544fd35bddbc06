// Numbers in text files: where they are, what they say, and the shortest text for one.
//
// A word is a run of bytes that are neither blanks, control characters nor commas. A span is the offset of its first
// byte and the offset behind its last. Nothing here allocates by what a file announces.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>

namespace meshfix {

struct Span {
    std::int64_t begin = -1, end = -1;
};

inline bool separates(char c) { return static_cast<unsigned char>(c) <= ' ' || c == ','; }
inline bool ends_line(char c) { return c == '\n' || c == '\r'; }

// The first word at or behind `at`; none in the rest of the text, or of the line: begin = -1.
inline Span next_word(std::string_view text, std::int64_t at, bool one_line) {
    const auto size = static_cast<std::int64_t>(text.size());
    for (; at < size && separates(text[at]); ++at)
        if (one_line && ends_line(text[at])) return {};
    if (at >= size) return {};
    Span word{at, at};
    while (word.end < size && !separates(text[word.end])) ++word.end;
    return word;
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
#if defined(__cpp_lib_to_chars) && !defined(MESHFIX_NO_CHARCONV)
    const std::string_view digits = without_plus(word);
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc() && end == digits.data() + digits.size()) return true;
#endif
    return read_number_slowly(word, value);
}

template <class Real>
std::string with_digits(Real value, int digits) {
    char buffer[40];
    return {buffer, static_cast<std::size_t>(std::snprintf(buffer, sizeof buffer, "%.*g", digits, double(value)))};
}

// The shortest text that reads back to the value; where that is longer than `longest` (0: no limit), the most digits
// that fit.
template <class Real>
std::string shortest(Real value, int longest) {
    std::string text;
#if defined(__cpp_lib_to_chars) && !defined(MESHFIX_NO_CHARCONV)
    char buffer[64];
    text.assign(buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr);
#else
    Real back{};
    for (int digits = 1; digits <= 17; ++digits) {
        text = with_digits(value, digits);
        if (read_number_slowly(text, back) && back == value) break;
    }
#endif
    for (int digits = 17; longest > 0 && static_cast<int>(text.size()) > longest && digits > 0; --digits)
        text = with_digits(value, digits);
    return text;
}

}  // namespace meshfix
