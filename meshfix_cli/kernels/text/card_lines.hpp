// The lines of Nastran's cards: fields, free between commas or in columns of 8 or 16, and the integers in these.
//
// A line has its name in the first field, or what tells that it continues another: a blank, a plus or a star; then eight
// fields of data, or four where a star makes them large; then a name for what continues it. A $ begins a comment, # and
// // a line of it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>

#include "common/compiler.hpp"
#include "text/text.hpp"

namespace meshfix {

inline bool is_blank(char c) { return static_cast<unsigned char>(c) <= ' '; }

inline Span without_blanks(std::string_view text, Span field) {
    while (field.begin < field.end && is_blank(text[field.begin])) ++field.begin;
    while (field.end > field.begin && is_blank(text[field.end - 1])) --field.end;
    return field;
}

// The offset of a byte in a part of a text; the end of that part, where there is none.
inline std::int64_t find_byte(std::string_view text, char byte, std::int64_t begin, std::int64_t end) {
    const void* found = begin < end ? std::memchr(text.data() + begin, byte, static_cast<std::size_t>(end - begin)) : nullptr;
    return found == nullptr ? end : static_cast<const char*>(found) - text.data();
}

// Where a line that begins at an offset ends, without looking far for a line feed where there are carriage returns.
inline std::int64_t line_end(std::string_view text, std::int64_t at) {
    const auto size = static_cast<std::int64_t>(text.size());
    for (std::int64_t window = 128; at < size; at += window, window *= 2) {
        const std::int64_t last = std::min(size, at + window);
        const std::int64_t end = find_byte(text, '\r', at, find_byte(text, '\n', at, last));
        if (end < last) return end;
    }
    return size;
}

// A text, and which bytes it may have: what it has not need not be looked for in each line.
struct CardText {
    std::string_view text;
    bool comments = true, commas = true, returns = true, tabs = true;

    explicit CardText(std::string_view data) : text(data) {}
    std::int64_t size() const { return static_cast<std::int64_t>(text.size()); }

    // What a look at all of it is worth where all of it is read.
    static CardText searched(std::string_view data) {
        unsigned char comments = 0, commas = 0, returns = 0, tabs = 0;
        for (const char c : data) {
            comments |= c == '$';
            commas |= c == ',';
            returns |= c == '\r';
            tabs |= c == '\t';
        }
        CardText deck(data);
        deck.comments = comments, deck.commas = commas, deck.returns = returns, deck.tabs = tabs;
        return deck;
    }

    // A text of which cards that lie between two others are read, as that is known of the lines there.
    static CardText between(std::string_view data, std::int64_t first, std::int64_t last) {
        const std::int64_t end = find_byte(data, '\n', last, static_cast<std::int64_t>(data.size()));
        CardText deck = searched(data.substr(first, end - first));
        deck.text = data;
        return deck;
    }
};

// A line of a card.
struct CardLine {
    std::int64_t begin, end, next;  // the text without comment, and where the next line begins
    Span first;                     // the name, without a star
    std::int64_t data;              // where the fields of data begin
    bool tabs, blank, free, large;

    CardLine(const CardText& deck, std::int64_t at) : begin(at) {
        const std::string_view text = deck.text;
        const std::int64_t last = deck.returns ? line_end(text, at) : find_byte(text, '\n', at, deck.size());
        next = last + 1;
        end = deck.comments ? find_byte(text, '$', at, last) : last;
        tabs = deck.tabs && find_byte(text, '\t', begin, end) < end;
        const std::int64_t comma = deck.commas ? find_byte(text, ',', begin, end) : end;
        free = comma < end;
        data = free ? comma : behind_columns(text, begin, 8);
        first = without_blanks(text, {begin, data});
        const std::string_view start = text.substr(first.begin, 2);
        blank = start == "//" || start.substr(0, 1) == "#";
        if (first.begin == first.end) {
            blank = !free && without_blanks(text, {begin, end}).begin == end;
            large = false;
            return;
        }
        large = text[first.begin] == '*' || text[first.end - 1] == '*';
        if (large && text[first.begin] != '*') first = without_blanks(text, {first.begin, first.end - 1});
    }

    // A line in small or large columns, of whose name that is known; none of the text has tabs or carriage returns.
    CardLine(const CardText& deck, std::int64_t at, bool is_large)
        : begin(at), data(at + 8), tabs(false), blank(false), free(false), large(is_large) {
        const std::int64_t last = find_byte(deck.text, '\n', at, deck.size());
        next = last + 1;
        end = deck.comments ? find_byte(deck.text, '$', at, last) : last;
    }

    // The name may be followed by other words, as in BEGIN BULK.
    std::string_view name(std::string_view text) const {
        Span word = first;
        for (word.end = word.begin; word.end < first.end && !is_blank(text[word.end]);) ++word.end;
        return text.substr(word.begin, word.end - word.begin);
    }

    bool continues(std::string_view text) const {
        return first.begin == first.end || text[first.begin] == '+' || text[first.begin] == '*';
    }

    int fields() const { return large ? 4 : 8; }
    int width() const { return free ? 0 : large ? 16 : 8; }

    // The offset behind so many columns; a tab reaches to the next multiple of eight.
    std::int64_t behind_columns(std::string_view text, std::int64_t at, int columns) const {
        if (!tabs) return std::min(end, at + columns);
        for (int column = 0; at < end && column < columns; ++at) column = text[at] == '\t' ? column / 8 * 8 + 8 : column + 1;
        return at;
    }

    // Calls f(number, span) for each field of data that the line reaches, as long as it returns true, and returns that
    // behind them, which names what continues it. Of a free line with more fields than that, a number there is data.
    template <class F>
    Span each_field(std::string_view text, const F& f) const {
        if (free) return each_free_field(text, f);
        std::int64_t at = data;
        for (int i = 0; i < fields(); ++i) {
            if (i > 0 && at >= end) return {end, end};
            const std::int64_t behind = behind_columns(text, at, width());
            if (!f(i, Span{at, behind})) return {end, end};
            at = behind;
        }
        return without_blanks(text, {at, behind_columns(text, at, 8)});
    }

  private:
    template <class F>
    Span each_free_field(std::string_view text, const F& f) const {
        Span named{end, end};
        int number = 0;
        for (std::int64_t at = data, i = 1; at < end; ++i) {
            const std::int64_t comma = find_byte(text, ',', at + 1, end);
            const Span field = without_blanks(text, {at + 1, comma});
            at = comma;
            if (i % (fields() + 1) == 0 && !is_data(text, field, comma < end)) {
                named = field;
            } else if (!f(number++, field)) {
                break;
            }
        }
        return named;
    }

    static bool is_data(std::string_view text, Span field, bool more) {
        const std::string_view word = text.substr(field.begin, field.end - field.begin);
        const bool number = !word.empty() && std::string_view("0123456789.-").find(word[0]) != std::string_view::npos;
        return number && (more || word.find('.') != std::string_view::npos);
    }
};

// Integers in fields: what stands there where there is none, or something else. No file means these by numbers.
constexpr std::int64_t BLANK_FIELD = std::numeric_limits<std::int32_t>::min(), OTHER_FIELD = BLANK_FIELD + 1;

// Reads the integer that is all of a field but for blanks.
inline std::int64_t read_integer_field(std::string_view text, Span field) {
    const Span word = without_blanks(text, field);
    std::int64_t value = OTHER_FIELD;
    if (word.begin == word.end) return BLANK_FIELD;
    const bool read = read_integer(text.substr(word.begin, word.end - word.begin), value, false);
    return read && value != BLANK_FIELD ? value : OTHER_FIELD;
}

constexpr std::uint64_t EACH_BYTE = 0x0101010101010101, TOP_BITS = 0x80 * EACH_BYTE;

inline std::uint64_t eight_bytes(const char* p) {
    std::uint64_t bytes;
    std::memcpy(&bytes, p, sizeof bytes);
    return bytes;
}

// Reads the integer of eight columns, of which none is looked at by itself: blanks, digits, blanks; -1: something else.
inline std::int64_t read_digits_of_columns(std::uint64_t bytes) {
#if MESHFIX_GNU && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    const std::uint64_t others = bytes ^ 0x20 * EACH_BYTE;  // blanks are zeros now
    const std::uint64_t filled = (((others & ~TOP_BITS) + 0x7f * EACH_BYTE) | others) & TOP_BITS;
    if (filled == 0) return BLANK_FIELD;
    const int front = __builtin_ctzll(filled) / 8, behind = __builtin_clzll(filled) / 8, missing = 8 * (front + behind);
    bytes = (bytes >> 8 * front << missing) ^ (0x30 * EACH_BYTE << missing);  // digits, and zeros in front of them
    if (((bytes | (bytes + 0x76 * EACH_BYTE)) & TOP_BITS) == 0) return digits_of_bytes(bytes);
#else
    static_cast<void>(bytes);
#endif
    return -1;
}

// Reads the integer of 8 or 16 columns.
inline std::int64_t read_integer_columns(std::string_view text, std::int64_t at, std::int64_t width) {
    const char* const p = text.data() + at;
    const std::int64_t value = read_digits_of_columns(eight_bytes(p));
    const std::int64_t more = width == 8 ? BLANK_FIELD : read_digits_of_columns(eight_bytes(p + 8));
    if (value != -1 && more == BLANK_FIELD) return value;
    if (value == BLANK_FIELD && more != -1) return more;
    return read_integer_field(text, {at, at + width});
}

// How many of eight bytes stand in front of a line feed; 8: there is none among them.
inline int columns_of_line(std::uint64_t bytes) {
#if MESHFIX_GNU && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    const std::uint64_t others = bytes ^ '\n' * EACH_BYTE;
    const std::uint64_t feeds = (others - EACH_BYTE) & ~others & TOP_BITS;
    return feeds == 0 ? 8 : __builtin_ctzll(feeds) / 8;
#else
    static_cast<void>(bytes);
    return 8;
#endif
}

}  // namespace meshfix
