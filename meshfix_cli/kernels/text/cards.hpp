// The cards of Nastran: lines of fields that other lines may continue.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "text/card_lines.hpp"

namespace meshfix {

// All cards of a text.
struct Cards {
    static constexpr int HEAD = 6, LABELS = 2;
    using Head = std::array<std::int32_t, HEAD>;
    std::vector<std::uint8_t> names;   // eight characters of each that there is: in capitals, behind them zeros
    std::vector<std::int32_t> kinds;   // which of the names each card has
    std::vector<std::int64_t> begin;   // where its first line begins
    std::vector<std::int64_t> fields;  // how many there are, up to the last that is not blank; -1: torn apart
    // The integers in the first fields of its first line, apart: numbers of the card itself, and of points that it names.
    std::vector<std::array<std::int32_t, LABELS>> labels;
    std::vector<std::array<std::int32_t, HEAD - LABELS>> nodes;

    void add(std::string_view name, std::int64_t at) {
        std::uint64_t code = 0;
        for (std::size_t i = 0; i < std::min<std::size_t>(8, name.size()); ++i) {
            const auto c = static_cast<std::uint8_t>(name[i]);
            code |= std::uint64_t(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c) << 8 * i;
        }
        const auto [place, is_new] = numbers_.try_emplace(code, static_cast<std::int32_t>(numbers_.size()));
        for (int i = 0; i < 8 && is_new; ++i) names.push_back(static_cast<std::uint8_t>(code >> 8 * i));
        add(place->second, at);
    }
    void add(std::int32_t kind, std::int64_t at, std::int64_t filled = 0, const Head& head = blank()) {
        kinds.push_back(kind);
        begin.push_back(at);
        fields.push_back(filled);
        labels.emplace_back();
        nodes.emplace_back();
        put(head);
    }
    void put(const Head& head) {
        labels.back() = {head[0], head[1]};
        nodes.back() = {head[2], head[3], head[4], head[5]};
    }
    static Head blank() {
        Head head;
        head.fill(static_cast<std::int32_t>(BLANK_FIELD));
        return head;
    }
    // What a head says of a field: numbers that have no room there are read when they are asked for.
    static std::int32_t of_head(std::int64_t value) {
        return static_cast<std::int32_t>(value == static_cast<std::int32_t>(value) ? value : OTHER_FIELD);
    }
    // Room for a text of so many bytes; what is not used of it is never touched.
    explicit Cards(std::int64_t size) {
        const auto count = static_cast<std::size_t>(size / 32 + 1);
        kinds.reserve(count);
        begin.reserve(count);
        fields.reserve(count);
        labels.reserve(count);
        nodes.reserve(count);
    }

  private:
    std::unordered_map<std::uint64_t, std::int32_t> numbers_;
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
    Cards::Head head = Cards::blank();
    const bool begins = first == 0;
    std::int64_t count = line.fields(), filled = 0;
    Span named;
    for (std::int64_t i = count; begins && i < Cards::HEAD; ++i) head[i] = Cards::of_head(OTHER_FIELD);
    if (line.free || line.tabs) {
        named = line.each_field(text, [&](std::int64_t i, Span field) {
            count = std::max(count, i + 1);
            if (without_blanks(text, field).begin < field.end) filled = i + 1;
            if (begins && i < Cards::HEAD && head[i] == BLANK_FIELD) head[i] = Cards::of_head(read_integer_field(text, field));
            return true;
        });
    } else {
        const std::int64_t width = line.width(), behind = std::min(line.end, line.data + width * count);
        const Span words = without_blanks(text, {line.data, behind});
        filled = words.begin < words.end ? (words.end - line.data + width - 1) / width : 0;
        for (std::int64_t i = 0, at = line.data; begins && i < std::min<std::int64_t>(filled, Cards::HEAD); ++i, at += width) {
            const bool whole = at + width <= behind;
            const std::int64_t value = whole ? read_integer_columns(text, at, width) : read_integer_field(text, {at, behind});
            head[i] = Cards::of_head(value);
            if (head[i] == OTHER_FIELD) std::fill(head.begin() + i, head.end(), head[i]), i = filled;
        }
        named = behind < line.end ? without_blanks(text, {behind, std::min(line.end, behind + 8)}) : Span{behind, behind};
    }
    if (begins) cards.put(head);
    if (cards.fields.back() >= 0 && filled > 0) cards.fields.back() = first + filled;
    first += count;
    return named;
}

// Adds the card of a free line, of whose name that is known and at whose first comma `at` is, in one pass, and goes to the
// next line; false: it has more fields than a line of columns, or what only `CardLine` knows, and nothing was done.
inline bool add_free_line(std::string_view text, std::int64_t begin, std::int64_t& at, Cards& cards) {
    constexpr int FIELDS = 8;
    const char *const start = text.data(), *const end = start + text.size(), *p = start + at;
    Cards::Head head = Cards::blank();
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
        if (i < Cards::HEAD) head[i] = Cards::of_head(value);
        p = behind;
    }
    cards.add(cards.kinds.back(), begin, filled, head);
    at = p - start + 1;
    return true;
}

// The same for a line of small columns, where whole numbers alone stand in these, and nothing behind.
inline bool add_integer_line(std::string_view text, std::int64_t begin, std::int64_t& at, Cards& cards) {
    constexpr int FIELDS = 8, WIDTH = 8;
    const char *p = text.data() + begin + WIDTH, *const last = text.data() + text.size() - WIDTH;
    Cards::Head head = Cards::blank();
    std::int64_t filled = 0;
    for (int i = 0, columns = WIDTH; columns == WIDTH; ++i, p += columns) {
        if (p > last) return false;
        std::uint64_t bytes = eight_bytes(p);
        std::int64_t value = read_digits_of_columns(bytes);
        if (value == -1) {  // the line's end is among them, or something else
            columns = columns_of_line(bytes);
            const std::uint64_t behind = columns < WIDTH ? ~std::uint64_t(0) << 8 * columns : 0;
            value = read_digits_of_columns((bytes & ~behind) | (0x20 * EACH_BYTE & behind));
            if (value == -1) return false;
        }
        if (value != BLANK_FIELD) filled = i + 1;
        if (filled > FIELDS) return false;
        if (i < Cards::HEAD) head[i] = Cards::of_head(value);
        if (i >= FIELDS && columns == WIDTH) return false;
    }
    cards.add(cards.kinds.back(), begin, filled, head);
    at = p - text.data() + 1;
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
        const bool again = plain && !name.empty() && text.compare(at, 8, name) == 0;  // as nearly always
        const bool star = plain && !name.empty() && text.compare(at, 8, "*       ") == 0;
        if (again && !large && add_integer_line(text, at, at, cards)) {
            named = Span{at - 1, at - 1};
            first = 8;
            continue;
        }
        if (again || star) {
            const CardLine line(deck, at, large || star);
            if (again) {
                cards.add(cards.kinds.back(), at);
                first = 0;
            }
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
    std::vector<std::array<std::int64_t, 2>> spans;
    std::vector<std::int64_t> starts{0};  // the number of the first field of each card, and of all
    std::vector<std::uint8_t> widths;     // the columns of each; 0: it is free

    explicit CardFields(std::int64_t count) {  // what is not used of the room is never touched
        spans.reserve(8 * count);
        starts.reserve(count + 1);
        widths.reserve(8 * count);
    }
    void add(Span field, int width) {
        spans.push_back({field.begin, field.end});
        widths.push_back(static_cast<std::uint8_t>(width));
    }
    bool last_is_blank() const { return spans.back()[1] <= spans.back()[0]; }
    void remove_last() {
        spans.pop_back();
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
        const bool columns = width > 0 && field.end - field.begin == width;
        const std::int64_t value =
            columns ? read_integer_columns(deck.text, field.begin, width) : read_integer_field(deck.text, field);
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
