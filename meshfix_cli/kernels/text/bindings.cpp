// Bindings of what finds, reads and replaces numbers in texts.
#include <numeric>

#include "arrays.hpp"
#include "text/cards.hpp"
#include "text/lists.hpp"
#include "text/text.hpp"

namespace meshfix {

namespace {

std::string_view view_of(const nb::bytes& data) { return {data.c_str(), data.size()}; }

std::string_view word_at(std::string_view text, const std::int64_t* span) {
    const auto size = static_cast<std::int64_t>(text.size());
    if (span[0] < 0 || span[1] < span[0] || span[1] > size) return {};
    return text.substr(static_cast<std::size_t>(span[0]), static_cast<std::size_t>(span[1] - span[0]));
}

auto find_words_py(const nb::bytes& data, std::int64_t at, std::int64_t count, bool brackets) {
    return to_numpy((brackets ? find_words<true> : find_words<false>)(view_of(data), at, count, text_threads), 2);
}

auto line_words_py(const nb::bytes& data, const Vector<const std::int64_t>& offsets, std::int64_t count) {
    const std::string_view text = view_of(data);
    std::vector<std::int64_t> spans;
    for (std::size_t i = 0; i < offsets.shape(0); ++i) {
        Span word{offsets(i), offsets(i)};
        for (std::int64_t j = 0; j < count; ++j) {
            if (word.end >= 0) word = next_word(text, word.end, true);
            spans.insert(spans.end(), {word.begin, word.end});
        }
    }
    return to_numpy(std::move(spans), 2);
}

nb::tuple find_lines_py(const nb::bytes& data, std::int64_t at, std::int64_t count) {
    Lines lines = find_lines(view_of(data), at, count);
    return nb::make_tuple(to_numpy(std::move(lines.spans), 2), to_numpy(std::move(lines.starts)), lines.end);
}

nb::tuple read_lines_py(const nb::bytes& data, std::int64_t at, std::int64_t count) {
    LineIntegers lines = read_lines(view_of(data), at, count);
    return nb::make_tuple(to_numpy(std::move(lines.values)), to_numpy(std::move(lines.starts)), lines.end);
}

nb::tuple find_cards_py(const nb::bytes& data) {
    Cards cards = find_cards(CardText::searched(view_of(data)));
    return nb::make_tuple(to_numpy(std::move(cards.names), 8), to_numpy(std::move(cards.kinds)),
                          to_numpy(std::move(cards.begin)), to_numpy(std::move(cards.fields)),
                          to_numpy(std::move(cards.labels)), to_numpy(std::move(cards.nodes)));
}

nb::tuple card_fields_py(const nb::bytes& data, const Vector<const std::int64_t>& offsets, std::int64_t most, bool whole) {
    constexpr std::int64_t FEW = 256;  // bytes of the text to a card: then they are most of it
    const CardText any(view_of(data));
    const auto count = static_cast<std::int64_t>(offsets.shape(0));
    const bool close = count > 1 && std::is_sorted(offsets.data(), offsets.data() + count) && offsets(0) >= 0 &&
                       offsets(count - 1) < any.size() && (offsets(count - 1) - offsets(0)) / FEW < count;
    const CardText deck = close ? CardText::between(any.text, offsets(0), offsets(count - 1)) : any;
    CardFields cards(count);
    for (std::int64_t i = 0; i < count; ++i) add_card(i + 1 < count ? deck : any, offsets(i), most, whole, cards);
    return nb::make_tuple(to_numpy(std::move(cards.spans)), to_numpy(std::move(cards.starts)), to_numpy(std::move(cards.widths)));
}

auto card_integers_py(const nb::bytes& data, const Vector<const std::int64_t>& offsets, std::int64_t first, std::int64_t last,
                      bool texts) {
    const CardText deck(view_of(data));
    const auto count = static_cast<std::int64_t>(offsets.shape(0)), columns = last - first;
    std::vector<std::int64_t> values(count * columns, BLANK_FIELD);
    std::vector<std::int64_t> bad(count / PER_ITEM + 1, -1);
    for_each_range(count, PER_ITEM, text_threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        for (std::int64_t i = begin; i < end && bad[item] < 0; ++i)
            bad[item] = read_card(deck, offsets(i), first, last, texts, values.data() + i * columns);
    });
    const auto found = std::find_if(bad.begin(), bad.end(), [](std::int64_t at) { return at >= 0; });
    return std::make_pair(to_numpy(std::move(values), columns), found == bad.end() ? -1 : *found);
}

std::int64_t behind_words_py(const nb::bytes& data, std::int64_t at, std::int64_t count) {
    return behind_words(view_of(data), at, count, text_threads);
}

template <class T>
nb::tuple integers_of(Integers<T>&& read) {
    return nb::make_tuple(to_numpy(std::move(read.values)), read.end, read.bad);
}

// In 32 bits where that is enough.
template <bool BRACKETS>
nb::tuple scan_integers_in(std::string_view text, std::int64_t at, std::int64_t count) {
    auto read = read_integers<std::int32_t, BRACKETS>(text, at, count, text_threads);
    if (read.fit) return integers_of(std::move(read));
    return integers_of(read_integers<std::int64_t, BRACKETS>(text, at, count, text_threads));
}

nb::tuple scan_integers_py(const nb::bytes& data, std::int64_t at, std::int64_t count, bool brackets) {
    return (brackets ? scan_integers_in<true> : scan_integers_in<false>)(view_of(data), at, count);
}

template <class T>
nb::tuple integer_lists_of(IntegerLists<T>&& read) {
    return nb::make_tuple(to_numpy(std::move(read.offsets)), to_numpy(std::move(read.values)), read.end, read.good);
}

nb::tuple read_integer_lists_py(const nb::bytes& data, std::int64_t at, std::int64_t count) {
    auto read = read_integer_lists<std::int32_t>(view_of(data), at, count);
    if (read.fit) return integer_lists_of(std::move(read));
    return integer_lists_of(read_integer_lists<std::int64_t>(view_of(data), at, count));
}

template <class Real, class Value, class Read>
auto read_words(const nb::bytes& data, const Matrix<const std::int64_t>& spans, const Read& read) {
    const std::string_view text = view_of(data);
    const auto count = static_cast<std::int64_t>(spans.shape(0));
    std::vector<Value> values(spans.shape(0));
    std::vector<std::int64_t> bad(count / PER_ITEM + 1, -1);
    for_each_range(count, PER_ITEM, text_threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        for (std::int64_t i = begin; i < end && bad[item] < 0; ++i) {
            Real value{};
            if (!read(word_at(text, spans.data() + 2 * i), value)) bad[item] = i;
            values[i] = static_cast<Value>(value);
        }
    });
    const auto first = std::find_if(bad.begin(), bad.end(), [](std::int64_t row) { return row >= 0; });
    return std::make_pair(to_numpy(std::move(values)), first == bad.end() ? -1 : *first);
}

auto integers_py(const nb::bytes& data, const Matrix<const std::int64_t>& spans, bool slash) {
    return read_words<std::int64_t, std::int64_t>(
        data, spans, [slash](std::string_view word, std::int64_t& value) { return read_integer(word, value, slash); });
}

auto numbers_py(const nb::bytes& data, const Matrix<const std::int64_t>& spans, bool single) {
    return single ? read_words<float, double>(data, spans, read_number<float>)
                  : read_words<double, double>(data, spans, read_number<double>);
}

auto read_fields_py(const nb::bytes& data, const Matrix<const std::int64_t>& spans) {
    return read_words<double, double>(data, spans, read_field<double>);
}

// Writes the texts of values (n,) by put(text, value), one behind the other.
template <class Put>
auto write_words(const Vector<const double>& values, const Put& put) {
    const auto count = static_cast<std::int64_t>(values.shape(0));
    std::vector<std::string> parts(count / PER_ITEM + 1);
    std::vector<std::int64_t> spans(2 * count);
    for_each_range(count, PER_ITEM, text_threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        std::string& part = parts[item];
        for (std::int64_t i = begin; i < end; ++i) {
            spans[2 * i] = static_cast<std::int64_t>(part.size());
            put(part, values(i));
            spans[2 * i + 1] = static_cast<std::int64_t>(part.size());
        }
    });
    std::int64_t size = 0;
    for (std::size_t item = 0; item < parts.size(); ++item) {
        const std::int64_t end = std::min<std::int64_t>(count, (item + 1) * PER_ITEM);
        for (std::int64_t i = 2 * item * PER_ITEM; i < 2 * end; ++i) spans[i] += size;
        size += static_cast<std::int64_t>(parts[item].size());
    }
    auto words = nb::steal<nb::bytes>(PyBytes_FromStringAndSize(nullptr, static_cast<Py_ssize_t>(size)));
    if (!words.is_valid()) nb::raise_python_error();
    char* to = PyBytes_AsString(words.ptr());
    for (const auto& part : parts) to = std::copy(part.begin(), part.end(), to);
    return std::make_pair(words, to_numpy(std::move(spans), 2));
}

auto shortest_py(const Vector<const double>& values, bool single, int longest) {
    return write_words(values, [single, longest](std::string& text, double value) {
        if (single) {
            append_shortest(text, static_cast<float>(value), longest);
        } else {
            append_shortest(text, value, longest);
        }
    });
}

auto write_fields_py(const Vector<const double>& values, int columns, bool padded) {
    return write_words(values, [columns, padded](std::string& text, double value) {
        append_field(text, value, columns, padded);
    });
}

// The text between two offsets. A span that is not in it counts as empty, and so where it is put.
nb::bytes replace_py(const nb::bytes& data, std::int64_t first, std::int64_t last, const Matrix<const std::int64_t>& spans,
                     const nb::bytes& words, const Matrix<const std::int64_t>& word_spans) {
    const std::string_view text = view_of(data), replacements = view_of(words);
    const auto count = static_cast<std::int64_t>(spans.shape(0));
    const auto word = [&](std::int64_t i) { return word_at(replacements, word_spans.data() + 2 * i); };
    const auto before = [&](std::int64_t i) {  // what stays in front of span i; of `count`, what is left
        const std::int64_t kept[2] = {i > 0 ? spans(i - 1, 1) : first, i < count ? spans(i, 0) : last};
        return word_at(text, kept);
    };
    std::vector<std::int64_t> starts(count / PER_ITEM + 2, 0);  // where in the result each item begins
    for (std::int64_t i = 0; i < count; ++i) {
        if (spans(i, 0) < (i > 0 ? spans(i - 1, 1) : first)) throw nb::value_error("the spans overlap or are not in order");
        starts[i / PER_ITEM + 1] += static_cast<std::int64_t>(before(i).size() + word(i).size());
    }
    starts.back() += static_cast<std::int64_t>(before(count).size());
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    auto result = nb::steal<nb::bytes>(PyBytes_FromStringAndSize(nullptr, static_cast<Py_ssize_t>(starts.back())));
    if (!result.is_valid()) nb::raise_python_error();
    char* out = PyBytes_AsString(result.ptr());
    for_each_range(count + 1, PER_ITEM, text_threads, [&](std::int64_t begin, std::int64_t end, std::int64_t item) {
        char* to = out + starts[item];
        const auto put = [&to](std::string_view part) { to = std::copy(part.begin(), part.end(), to); };
        for (std::int64_t i = begin; i < end; ++i) {
            put(before(i));
            if (i < count) put(word(i));
        }
    });
    return result;
}

}  // namespace

void bind_text(nb::module_& m) {
    m.def("find_words", &find_words_py, "data"_a, "at"_a, "count"_a, "brackets"_a = false);
    m.def("line_words", &line_words_py, "data"_a, "offsets"_a.noconvert(), "count"_a);
    m.def("find_lines", &find_lines_py, "data"_a, "at"_a, "count"_a);
    m.def("read_lines", &read_lines_py, "data"_a, "at"_a, "count"_a);
    m.def("find_cards", &find_cards_py, "data"_a);
    m.def("card_fields", &card_fields_py, "data"_a, "offsets"_a.noconvert(), "most"_a, "whole"_a);
    m.def("card_integers", &card_integers_py, "data"_a, "offsets"_a.noconvert(), "first"_a, "last"_a, "texts"_a);
    m.def("behind_words", &behind_words_py, "data"_a, "at"_a, "count"_a);
    m.def("use_threads", [](int threads) { text_threads = threads; }, "threads"_a);
    m.def("scan_integers", &scan_integers_py, "data"_a, "at"_a, "count"_a, "brackets"_a = false);
    m.def("read_integer_lists", &read_integer_lists_py, "data"_a, "at"_a, "count"_a);
    m.def("integers", &integers_py, "data"_a, "spans"_a.noconvert(), "slash"_a);
    m.def("numbers", &numbers_py, "data"_a, "spans"_a.noconvert(), "single"_a);
    m.def("read_fields", &read_fields_py, "data"_a, "spans"_a.noconvert());
    m.def("shortest", &shortest_py, "values"_a.noconvert(), "single"_a, "longest"_a);
    m.def("write_fields", &write_fields_py, "values"_a.noconvert(), "columns"_a, "padded"_a);
    m.def("replace", &replace_py, "data"_a, "first"_a, "last"_a, "spans"_a.noconvert(), "words"_a, "word_spans"_a.noconvert());
}

}  // namespace meshfix
