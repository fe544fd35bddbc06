// The cards of Nastran: lines of fields, free between commas or in columns of 8 or 16, that other lines may continue.
//
// A line has its name in the first field, or what tells that it continues another: a blank, a plus or a star; then eight
// fields of data, or four where a star makes them large; then a name for what continues it. A $ begins a comment, # and
// // a line of it.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <vector>

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

    // A line in small or large columns, of whose name that is known.
    CardLine(std::int64_t begin, std::int64_t end, std::int64_t next, bool large)
        : begin(begin), end(end), next(next), data(begin + 8), tabs(false), blank(false), free(false), large(large) {}

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

// Integers in fields: what stands there where there is none.
constexpr std::int64_t BLANK_FIELD = std::numeric_limits<std::int64_t>::min(), OTHER_FIELD = BLANK_FIELD + 1;

// Reads the integer that is all of a field but for blanks.
inline std::int64_t read_integer_field(std::string_view text, Span field) {
    const Span word = without_blanks(text, field);
    std::int64_t value = OTHER_FIELD;
    if (word.begin == word.end) return BLANK_FIELD;
    return read_integer(text.substr(word.begin, word.end - word.begin), value, false) ? value : OTHER_FIELD;
}

// Does the same for eight columns, of which none is looked at by itself.
inline std::int64_t read_integer_columns(std::string_view text, std::int64_t at) {
#if MESHFIX_GNU && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    constexpr std::uint64_t ONES = 0x0101010101010101;
    std::uint64_t bytes;
    std::memcpy(&bytes, text.data() + at, sizeof bytes);
    const std::uint64_t others = bytes ^ 0x20 * ONES;  // blanks are zeros now
    const std::uint64_t filled = (((others & 0x7f * ONES) + 0x7f * ONES) | others) & 0x80 * ONES;
    if (filled == 0) return BLANK_FIELD;
    const int front = __builtin_ctzll(filled) / 8, behind = __builtin_clzll(filled) / 8, missing = 8 * (front + behind);
    bytes = (bytes >> 8 * front << missing) ^ (0x30 * ONES << missing);  // digits, and zeros in front of them
    if (((bytes | (bytes + 0x76 * ONES)) & 0x80 * ONES) == 0) return digits_of_bytes(bytes);
#endif
    return read_integer_field(text, {at, at + 8});
}

// All cards of a text.
struct Cards {
    static constexpr int HEAD = 6;
    std::vector<std::uint8_t> names;   // eight characters of each that there is: in capitals, behind them zeros
    std::vector<std::int64_t> kinds;   // which of the names each card has
    std::vector<std::int64_t> begin;   // where its first line begins
    std::vector<std::int64_t> fields;  // how many there are, up to the last that is not blank; -1: torn apart
    std::vector<std::int64_t> heads;   // the integers in the first fields of its first line

    void add(std::string_view name, std::int64_t at) {
        std::uint64_t code = 0;
        for (std::size_t i = 0; i < std::min<std::size_t>(8, name.size()); ++i) {
            const auto c = static_cast<std::uint8_t>(name[i]);
            code |= std::uint64_t(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c) << 8 * i;
        }
        const auto [place, is_new] = numbers_.try_emplace(code, static_cast<std::int64_t>(numbers_.size()));
        for (int i = 0; i < 8 && is_new; ++i) names.push_back(static_cast<std::uint8_t>(code >> 8 * i));
        add(place->second, at);
    }
    void add(std::int64_t kind, std::int64_t at) {
        kinds.push_back(kind);
        begin.push_back(at);
        fields.push_back(0);
        const std::array<std::int64_t, HEAD> none{BLANK_FIELD, BLANK_FIELD, BLANK_FIELD, BLANK_FIELD, BLANK_FIELD, BLANK_FIELD};
        heads.insert(heads.end(), none.begin(), none.end());
    }
    // Room for a text of so many bytes; what is not used of it is never touched.
    explicit Cards(std::int64_t size) {
        const auto count = static_cast<std::size_t>(size / 32 + 1);
        for (auto* values : {&kinds, &begin, &fields}) values->reserve(count);
        heads.reserve(HEAD * count);
    }

  private:
    std::unordered_map<std::uint64_t, std::int64_t> numbers_;
};

inline bool is_other_name(std::string_view text, Span said, Span found) {
    const auto word = [text](Span name) {
        while (name.begin < name.end && (text[name.begin] == '+' || text[name.begin] == '*' || is_blank(text[name.begin])))
            ++name.begin;
        return text.substr(name.begin, name.end - name.begin);
    };
    return !word(said).empty() && !word(found).empty() && word(said) != word(found);
}

// Finds the fields of a line of a card whose first has the number `first`.
inline Span scan_line(std::string_view text, const CardLine& line, std::int64_t& first, Cards& cards) {
    std::int64_t* const head = cards.heads.data() + cards.heads.size() - Cards::HEAD;
    const bool begins = first == 0;
    std::int64_t count = line.fields(), filled = 0;
    Span named;
    for (std::int64_t i = count; begins && i < Cards::HEAD; ++i) head[i] = OTHER_FIELD;
    if (line.free || line.tabs) {
        named = line.each_field(text, [&](std::int64_t i, Span field) {
            count = std::max(count, i + 1);
            if (without_blanks(text, field).begin < field.end) filled = i + 1;
            if (begins && i < Cards::HEAD && head[i] == BLANK_FIELD) head[i] = read_integer_field(text, field);
            return true;
        });
    } else {
        const std::int64_t width = line.width(), behind = std::min(line.end, line.data + width * count);
        filled = (without_blanks(text, {line.data, behind}).end - line.data + width - 1) / width;
        for (std::int64_t i = 0, at = line.data; begins && i < std::min<std::int64_t>(filled, Cards::HEAD); ++i, at += width) {
            const bool quick = width == 8 && at + width <= behind;
            head[i] = quick ? read_integer_columns(text, at) : read_integer_field(text, {at, std::min(at + width, behind)});
            if (head[i] == OTHER_FIELD) std::fill(head + i, head + Cards::HEAD, OTHER_FIELD), i = filled;
        }
        named = behind < line.end ? without_blanks(text, {behind, std::min(line.end, behind + 8)}) : Span{behind, behind};
    }
    if (cards.fields.back() >= 0 && filled > 0) cards.fields.back() = first + filled;
    first += count;
    return named;
}

// Adds the card of a free line, of whose name that is known and at whose first comma `at` is, in one pass, and goes to the
// next line; false: it has more fields than a line of columns, or what only `CardLine` knows, and nothing was done.
inline bool add_free_line(std::string_view text, std::int64_t begin, std::int64_t& at, Cards& cards) {
    constexpr int FIELDS = 8;
    const char *const start = text.data(), *const end = start + text.size(), *p = start + at;
    std::array<std::int64_t, Cards::HEAD> head;
    head.fill(BLANK_FIELD);
    std::int64_t filled = 0;
    for (int i = 0; p < end && *p == ','; ++i) {
        if (i == FIELDS) return false;
        while (++p < end && *p == ' ') {}
        std::int64_t value = OTHER_FIELD;
        const char* behind = p + read_few_digits(p, end, value);
        if (behind == p || behind == end || (*behind != ',' && *behind != '\n')) {
            for (behind = p; behind < end && *behind != ',' && *behind != '\n'; ++behind)
                if (*behind == '$' || *behind == '\r' || *behind == '\t') return false;
            value = read_integer_field(text, {p - start, behind - start});
        }
        if (value != BLANK_FIELD) filled = i + 1;
        if (i < Cards::HEAD) head[i] = value;
        p = behind;
    }
    cards.add(cards.kinds.back(), begin);
    std::copy(head.begin(), head.end(), cards.heads.end() - Cards::HEAD);
    cards.fields.back() = filled;
    at = p - start + 1;
    return true;
}

inline Cards find_cards(const CardText& deck) {
    const std::string_view text = deck.text;
    const bool plain = !deck.commas && !deck.tabs && !deck.returns;
    Cards cards(deck.size());
    Span named{0, 0};
    std::int64_t first = 0;        // the number of the first field of a line
    std::string_view name;         // the first columns of the last card, in a text of columns alone, if there are eight
    std::string_view free_name;    // what the last card begins with, in a free line: the comma is the last of it
    bool large = false;
    for (std::int64_t at = 0; at < deck.size();) {
        if (!free_name.empty() && text.compare(at, free_name.size(), free_name) == 0) {
            std::int64_t next = at + static_cast<std::int64_t>(free_name.size()) - 1;
            if (add_free_line(text, at, next, cards)) {
                named = Span{next - 1, next - 1};
                first = 8;
                at = next;
                continue;
            }
        }
        if (plain && !name.empty() && text.compare(at, 8, name) == 0) {  // as nearly always
            const std::int64_t last = find_byte(text, '\n', at, deck.size());
            const CardLine line(at, deck.comments ? find_byte(text, '$', at, last) : last, last + 1, large);
            cards.add(cards.kinds.back(), at);
            first = 0;
            named = scan_line(text, line, first, cards);
            at = line.next;
            continue;
        }
        const CardLine line(deck, at);
        at = line.next;
        if (line.blank) continue;
        if (!line.continues(text)) {
            cards.add(line.name(text), line.begin);
            first = 0;
            name = line.end >= line.begin + 8 ? text.substr(line.begin, 8) : std::string_view();
            large = line.large;
            const bool close = line.free && !large && line.first.begin == line.begin && line.first.end == line.data;
            free_name = close ? text.substr(line.begin, line.data + 1 - line.begin) : std::string_view();
        } else if (cards.begin.empty()) {
            continue;
        } else if (is_other_name(text, named, line.first)) {
            cards.fields.back() = -1;
        }
        named = scan_line(text, line, first, cards);
    }
    return cards;
}

// The first fields of cards, at most `most` of each.
struct CardFields {
    std::vector<std::int64_t> spans;
    std::vector<std::int64_t> starts{0};  // the number of the first field of each card, and of all
    std::vector<std::uint8_t> widths;     // the columns of each; 0: it is free

    explicit CardFields(std::int64_t count) {  // what is not used of the room is never touched
        spans.reserve(16 * count);
        starts.reserve(count + 1);
        widths.reserve(8 * count);
    }
    void add(Span field, int width) {
        spans.insert(spans.end(), {field.begin, field.end});
        widths.push_back(static_cast<std::uint8_t>(width));
    }
    bool last_is_blank() const { return spans.back() <= spans[spans.size() - 2]; }
    void remove_last() {
        spans.resize(spans.size() - 2);
        widths.pop_back();
    }
};

// The line that continues a card, of which another begins at an offset; nothing: there is none.
inline std::optional<CardLine> continuation(const CardText& deck, std::int64_t at) {
    while (at < deck.size()) {
        const CardLine line(deck, at);
        if (!line.blank) return line.continues(deck.text) ? std::optional<CardLine>(line) : std::nullopt;
        at = line.next;
    }
    return std::nullopt;
}

// Calls f(number, span, columns) for the first fields of a card, at most `most`; what a line does not reach, and another
// continues, has no span.
template <class F>
void each_field_of(const CardText& deck, std::int64_t at, std::int64_t most, const F& f) {
    if (most <= 0) return;
    std::int64_t count = 0;
    for (std::optional<CardLine> line(std::in_place, deck, at); line;) {
        const std::int64_t first = count;
        line->each_field(deck.text, [&](std::int64_t, Span field) {
            f(count++, field, line->width());
            return count < most;
        });
        const std::optional<CardLine> next = count < most ? continuation(deck, line->next) : std::nullopt;
        while (next && count < std::min(most, first + line->fields())) f(count++, Span{}, line->width());
        line = count < most ? next : std::nullopt;
    }
}

// Of a field that is not `whole` there is what is not blank, and none behind the last that has something; of those that
// are, all columns.
inline void add_card(const CardText& deck, std::int64_t at, std::int64_t most, bool whole, CardFields& cards) {
    const std::int64_t before = cards.starts.back();
    each_field_of(deck, at, most, [&](std::int64_t, Span field, int width) {
        cards.add(whole || field.begin < 0 ? field : without_blanks(deck.text, field), width);
    });
    while (!whole && static_cast<std::int64_t>(cards.widths.size()) > before && cards.last_is_blank()) cards.remove_last();
    cards.starts.push_back(static_cast<std::int64_t>(cards.widths.size()));
}

inline bool begins_with_letter(std::string_view text, Span field) {
    const Span word = without_blanks(text, field);
    const char c = word.begin < word.end ? text[word.begin] : ' ';
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

// Reads the integers of some fields of a card; returns where there is none, else -1. Blank fields, and with `texts` those
// from a text on, stay as they are.
inline std::int64_t read_card(const CardText& deck, std::int64_t at, std::int64_t from, std::int64_t to, bool texts, std::int64_t* values) {
    std::int64_t bad = -1;
    bool ended = false;
    each_field_of(deck, at, to, [&](std::int64_t i, Span field, int width) {
        if (i < from || field.begin < 0 || ended) return;
        const bool columns = width == 8 && field.end - field.begin == 8;
        const std::int64_t value = columns ? read_integer_columns(deck.text, field.begin) : read_integer_field(deck.text, field);
        if (value == OTHER_FIELD) {
            ended = texts && begins_with_letter(deck.text, field);
            if (!ended && bad < 0) bad = without_blanks(deck.text, field).begin;
        } else {
            values[i - from] = value;
        }
    });
    return bad;
}

}  // namespace meshfix
