"""Numbers in text: Python's own float and int are the oracle."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.splice import Edits, Places, Turned, apply, divided, pairs
from meshfix_cli.meshfile.text import fields_at, integers, integers_at, line_words, numbers_at, words

DOUBLE, SINGLE = np.dtype("f8"), np.dtype("f4")


def spread(random: np.random.Generator, n: int) -> np.ndarray:
    """Doubles of every size, and those near which printing goes wrong."""
    bits = random.integers(0, 2**64, n, dtype=np.uint64).view(np.float64)
    some = [
        0.0,
        -0.0,
        1.0,
        0.1,
        1 / 3,
        1e5,
        1e22,
        1e23,
        2.0**-1074,
        2.0**-1022,
        1.7976931348623157e308,
        123456.0,
        9.5e-5,
    ]
    return np.concatenate([bits[np.isfinite(bits)], random.random(n), some])


def test_words_are_what_python_splits(random: np.random.Generator) -> None:
    alphabet = b"ab1. ,\n\t\r"
    for _ in range(200):
        data = bytes(random.choice(list(alphabet), random.integers(1, 60)).astype(np.uint8))
        expected = [match.span() for match in re.finditer(rb"[^\s,]+", data)]
        assert words(data, 0, len(expected)).tolist() == [list(span) for span in expected]
        with pytest.raises(ReadError, match="is truncated"):
            words(data, 0, len(expected) + 1)
        first = re.split(rb"[\r\n]", data)[0]
        found = line_words(data, [0], 4)[0]
        assert [data[a:b] for a, b in found.tolist() if a >= 0] == re.findall(rb"[^\s,]+", first)[:4]


def test_shortest_numbers_read_back_and_are_no_longer_than_pythons(random: np.random.Generator) -> None:
    values = spread(random, 5000)
    text, spans = kernels.shortest(values, False, 0)
    read = numbers_at(text, spans, DOUBLE)
    assert read.tobytes() == values.tobytes()
    for (first, last), value in zip(spans.tolist(), values.tolist(), strict=True):
        assert float(text[first:last]) == value
        assert last - first <= len(repr(value))


def test_shortest_floats_read_back(random: np.random.Generator) -> None:
    bits = random.integers(0, 2**32, 5000, dtype=np.uint32).view(np.float32)
    values = bits[np.isfinite(bits)]
    text, spans = kernels.shortest(values.astype(np.float64), True, 0)
    assert numbers_at(text, spans, SINGLE).tobytes() == values.tobytes()
    assert all(last - first <= len(str(value)) for (first, last), value in zip(spans.tolist(), values, strict=True))


def test_numbers_that_must_be_short_have_the_most_digits_that_fit(random: np.random.Generator) -> None:
    values = spread(random, 2000)
    text, spans = kernels.shortest(values, False, 20)
    assert (np.diff(spans, axis=1) <= 20).all()
    normal = np.abs(values) > 1e-300
    np.testing.assert_allclose(numbers_at(text, spans, DOUBLE)[normal], values[normal], 1e-12)
    places = Places.of_text(spans.reshape(-1, 1, 2), longest=20)
    rounded = places.rounded(values.reshape(-1, 1))
    np.testing.assert_array_equal(places.rounded(rounded), rounded)


@pytest.mark.parametrize(
    "text", ["1", "+1", "-1.5", ".5", "5.", "1e3", "1E+03", "1e-400", "1e999", "nan", "-inf", "0x1", "+-1", "1f"]
)
def test_numbers_are_pythons(text: str) -> None:
    data = text.encode()
    spans = np.array([[0, len(data)]])
    try:
        expected = float(text.replace("_", "x"))
    except ValueError:
        with pytest.raises(ReadError, match=re.escape(f"line 1: '{text}' is not a number")):
            numbers_at(data, spans, DOUBLE)
        return
    assert numbers_at(data, spans, DOUBLE).tobytes() == np.array([expected]).tobytes()


def test_exponents_of_fortran() -> None:
    data = b"1.5D+02 -2d-1"
    assert numbers_at(data, words(data, 0, 2), DOUBLE).tolist() == [150.0, -0.2]


def test_integers_end_at_a_slash_and_nothing_else() -> None:
    data = b"12/3/4 -5//6 +7"
    assert integers_at(data, words(data, 0, 3), slash=True).tolist() == [12, -5, 7]
    with pytest.raises(ReadError, match="'12/3/4' is not an integer"):
        integers_at(data, words(data, 0, 3))
    for bad in (b"1.5", b"x", b"99999999999999999999", b"1-", b"1/2"):
        with pytest.raises(ReadError, match=f"line 2: '{bad.decode()}' is not an integer"):
            integers(b"1\n" + bad, 0, 2)


def test_integers_stop_behind_the_last_and_tell_the_end() -> None:
    values, end = integers(b" 1 2,3\n4", 0, 3)
    assert (values.tolist(), end) == ([1, 2, 3], 6)
    with pytest.raises(ReadError, match="is truncated"):
        integers(b"1 2", 0, 10**15)


def test_edits_in_any_order_change_nothing_else() -> None:
    data = b"a 1 b 22 c"
    late = Edits(np.array([[6, 8]]), b"333", np.array([[0, 3]]))
    early = Edits(np.array([[2, 3]]), b"", np.array([[0, 0]]))
    assert apply(data, [late, early]) == b"a  b 333 c"
    for bounds in ([], [0], [2, 5], [5, 5, len(data)]):
        assert b"|".join(divided(data, [late, early], bounds)).replace(b"|", b"") == b"a  b 333 c"
    with pytest.raises(ValueError, match="overlap"):
        apply(data, [early, early])


def test_corners_change_places() -> None:
    data = b"3 10/1 2 30\n3 4 5 6"
    places = Places.of_text(line_words(data, [2, 14], 3), "i8")
    assert apply(data, [places.turn(data, Turned(np.array([0]), (1, 0, 2)))]) == b"3 2 10/1 30\n3 4 5 6"
    rows = np.arange(6, dtype=">i4").tobytes()
    binary = Places.of_rows(np.array([0, 12]), 3, ">i4")
    after = np.frombuffer(apply(rows, [binary.turn(rows, Turned(np.array([1]), (0, 2, 1)))]), dtype=">i4")
    assert after.tolist() == [0, 1, 2, 3, 5, 4]


@pytest.fixture(params=[1, 2, 3])
def threads(request: pytest.FixtureRequest) -> Iterator[int]:
    """How many threads the passes over text may take; one again at the end."""
    kernels.use_threads(request.param)
    yield request.param
    kernels.use_threads(1)


@pytest.mark.parametrize("gap", [" ", "\n", ", \r\n", " " * 3000])
def test_long_texts_are_read_in_pieces(threads: int, gap: str, random: np.random.Generator) -> None:
    """Pieces end anywhere: in words, between them, and in gaps that are longer than they are."""
    expected = random.integers(-(10 ** random.integers(1, 9, 300_000 if len(gap) < 9 else 400)), 10**9)
    data = (gap + gap.join(map(str, expected.tolist()))).encode()
    for count in (1, 2, 77, len(expected) - 1, len(expected)):
        values, end, bad = kernels.scan_integers(data, 0, count)
        assert (values.dtype.name, bad) == ("int32", -1)
        np.testing.assert_array_equal(values, expected[:count])
        spans = words(data, 0, count)
        assert end == spans[-1, 1] == kernels.behind_words(data, 0, count)
        np.testing.assert_array_equal(integers_at(data, spans), expected[:count])
        np.testing.assert_array_equal(numbers_at(data, spans, DOUBLE), expected[:count])
    assert kernels.behind_words(data, 0, len(expected) + 1) == -1
    values, _, bad = kernels.scan_integers(data, 0, len(expected) + 1)
    assert (len(values), bad) == (len(expected), len(data))


def test_the_first_bad_word_of_a_long_text_is_named(threads: int) -> None:
    data = bytearray(b"123456 " * 200_000)
    for at in (7 * 150_000, 7 * 90_001):
        data[at : at + 3] = b"1.5"
        values, end, bad = kernels.scan_integers(bytes(data), 0, 200_000)
        assert (len(values), end, bad) == (at // 7, at - 1, at)
        _, row = kernels.integers(bytes(data), words(bytes(data), 0, 200_000), False)
        assert row == at // 7


def test_integers_take_64_bits_where_they_need_them(threads: int) -> None:
    for largest, dtype in ((2**31 - 1, "int32"), (2**31 + 1, "int64"), (2**62, "int64")):
        values, _, bad = kernels.scan_integers(b"1 " * 100_000 + str(-largest).encode(), 0, 100_001)
        assert (values.dtype.name, int(values[-1]), bad) == (dtype, -largest, -1)


def test_brackets_separate_words_of_lists(threads: int) -> None:
    data = b"(1 -2)(+3\n(" * 50_000
    values, end, bad = kernels.scan_integers(data, 0, 150_000, brackets=True)
    assert (values.tolist(), end, bad) == ([1, -2, 3] * 50_000, len(data) - 2, -1)
    spans = words(data, 0, 150_000, brackets=True)
    np.testing.assert_array_equal(integers_at(data, spans), values)
    assert kernels.scan_integers(data, 0, 1)[2] == 0


def test_lists_of_integers_are_read(random: np.random.Generator) -> None:
    expected = [random.integers(-9, 10**9, size).tolist() for size in random.integers(0, 6, 1000)]
    data = ("\n ".join(f"{len(one)} ( {' '.join(map(str, one))})" for one in expected) + ")").encode()
    offsets, values, end, good = kernels.read_integer_lists(data, 0, len(expected))
    assert (values.dtype.name, end, good) == ("int32", len(data) - 1, True)
    assert [part.tolist() for part in np.split(values, offsets[1:-1])] == expected
    assert kernels.read_integer_lists(b"2(1 -3000000000)", 0, 1)[1].tolist() == [1, -3_000_000_000]


@pytest.mark.parametrize(
    "data", [b"", b"1", b"1(", b"1(2", b"1()", b"1(2 3)", b"-1(2)", b"1((2))", b"2(1)(2)", b"1(x)", b"1 2"]
)
def test_what_is_no_list_of_integers_ends_them(data: bytes) -> None:
    offsets, _, end, good = kernels.read_integer_lists(b"1(0)" + data, 0, 2)
    assert (offsets.tolist(), end, good) == ([0, 1], 4, False)


def test_long_texts_are_written_in_pieces(threads: int, random: np.random.Generator) -> None:
    values = random.random(100_000)
    text, spans = kernels.shortest(values, False, 0)
    assert [text[a:b] for a, b in spans[:: len(spans) // 99].tolist()] == [
        repr(value).encode() for value in values[:: len(spans) // 99].tolist()
    ]
    data = b"(x) " * len(values)
    at = 4 * np.arange(len(values)) + 1
    expected = b"".join(b"(" + text[a:b] + b") " for a, b in spans.tolist())
    places = np.stack([at, at + 1], axis=1)
    assert kernels.replace(data, 0, len(data), places, text, spans) == expected
    begin, end = int(at[0]), int(at[-1]) + 1
    assert kernels.replace(data, begin, end, places, text, spans) == expected[1:-2]
    assert (
        kernels.replace(b"abc", 0, 3, np.empty((0, 2), dtype=np.int64), b"", np.empty((0, 2), dtype=np.int64)) == b"abc"
    )


def test_lines_are_those_that_have_words(random: np.random.Generator) -> None:
    text = b"  1 2,3\r\n\n\r\n a\r b b \n\t\n"
    spans, starts, end = kernels.find_lines(text, 0, 9)
    assert [text[a:b] for a, b in spans.tolist()] == [b"1", b"2", b"3", b"a", b"b", b"b"]
    assert (starts.tolist(), text[end:]) == ([0, 3, 4, 6], b" \n\t\n")
    assert kernels.find_lines(text, 0, 2)[1].tolist() == [0, 3, 4]
    assert kernels.find_lines(text, end, 1)[1].tolist() == [0]
    assert kernels.find_lines(b"", 0, 1)[1].tolist() == [0]


@pytest.mark.parametrize("columns", [8, 16, 21])
def test_fields_hold_the_most_digits_that_fit(columns: int, random: np.random.Generator) -> None:
    values = random.standard_normal(2000) * 10.0 ** random.integers(-30, 30, 2000)
    values[:9] = [0, 1, -1, 0.1, -0.1, 123456789, 1e-300, -1e300, 0.5]
    text, spans = kernels.write_fields(values, columns, True)
    assert (spans[:, 1] - spans[:, 0] == columns).all()
    words = [text[a:b].decode().strip() for a, b in spans.tolist()]
    assert all("." in word for word in words)  # else Nastran takes them for integers
    back = fields_at(text, spans)
    for value, word, read in zip(values.tolist(), words, back.tolist(), strict=True):
        with_letter = word if "e" in word else re.sub(r"(?<=[\d.])(?=[-+])", "e", word)
        assert float(with_letter) == read
        digits = re.sub(r"e.*|[-.]", "", with_letter).strip("0")
        assert read == value or read == float(f"{value:.{max(len(digits), 1) - 1}e}") or len(word) >= columns - 1
        assert abs(read - value) <= 10.0 ** (6 - columns + (columns > 10)) * abs(value)
    free, free_spans = kernels.write_fields(values, columns, False)
    assert [free[a:b].decode() for a, b in free_spans.tolist()] == words


def test_fields_are_read_as_fortran_and_nastran_do() -> None:
    fields = {
        b"  1.5-3 ": 1.5e-3,
        b"-2.+10": -2e10,
        b"      ": 0.0,
        b"1.D2": 100.0,
        b".5": 0.5,
        b"-7": -7.0,
        b"1.e-3": 1e-3,
    }
    text, spans = b"".join(fields), np.cumsum([0, *map(len, fields)])
    assert fields_at(text, pairs(spans)).tolist() == list(fields.values())
    for wrong in (b"1.5 -3", b"-", b"1-", b"a-3", b"1.5--3", b"1e5-3"):
        with pytest.raises(ReadError, match="is not a number"):
            fields_at(wrong, np.array([[0, len(wrong)]]))


def test_a_short_card_does_not_lend_its_kind_to_the_next() -> None:
    solid = "CTETRA  " + "".join(f"{value:8}" for value in (1, 1, 1, 2, 3, 4)) + "\n"
    deck = (solid + "SPC\n" + solid).encode()
    names, kinds, *_ = kernels.find_cards(deck)
    assert bytes(names.ravel()[:6]) == b"CTETRA" and kinds.tolist() == [0, 1, 0]


def test_a_line_that_continues_a_card_does_not_reach_beyond_the_fields_that_are_asked_for() -> None:
    short, blank = b"CTETRA         1       1       7\n+              9\n", b"CTETRA\n"
    deck, at = short + blank, np.array([0, len(short)])
    none = np.iinfo(np.int32).min
    values, bad = kernels.card_integers(deck, at, 0, 6, False)
    assert bad == -1
    assert values.tolist() == [[1, 1, 7, none, none, none], [none] * 6]
    assert kernels.card_integers(deck, at, 8, 9, False)[0].tolist() == [[9], [none]]
    _, starts, _ = kernels.card_fields(deck, at, 6, True)
    assert starts.tolist() == [0, 6, 7]


def test_blank_lines_are_no_cards() -> None:
    for deck in (b"\n", b"\n\n", b"ENDDATA\n\n", b"ENDDATA\n\n\n\n\n\n\n\n\n\n\n", b"A,1\n\n\n"):
        assert len(kernels.find_cards(deck)[1]) == len(deck.split())


def free_lines(random: np.random.Generator) -> list[bytes]:
    """Fields as decks have them, and as they should not."""
    words = [
        b"1",
        b"23",
        b" 7 ",
        b"",
        b" ",
        b"12345678",
        b"123456789012",
        b"-4",
        b"+5",
        b"1.5",
        b"-1.-3",
        b"THRU",
        b"7$8",
    ]
    words += [b"1\t", b"9\r", b"0", b"12 3"]
    lines = []
    for _ in range(400):
        count = int(random.integers(0, 11))
        name = [b"GRID", b"CTETRA", b"GRID ", b"GRID*", b" GRID", b"+", b""][
            random.choice(7, p=[0.4, 0.3, *[0.06] * 5])
        ]
        lines.append(b",".join([name, *(words[i] for i in random.integers(0, len(words), count))]))
    return lines


def test_free_lines_are_read_alike_in_one_pass_and_by_their_fields(random: np.random.Generator) -> None:
    """A comment of no words behind a line makes it one that is not read in one pass."""
    for _ in range(20):
        lines = free_lines(random)
        quick, slow = (kernels.find_cards(b"\n".join([*some, b""])) for some in (lines, [one + b"$" for one in lines]))
        assert bytes(quick[0]) == bytes(slow[0])
        for i in (1, 3, 4, 5):
            np.testing.assert_array_equal(quick[i], slow[i])


def column_lines(random: np.random.Generator) -> list[bytes]:
    """Fields in columns of 8 and 16: numbers at either side, cut at the last or not, and what is none."""
    words = [b"", b"", *b"1 23 1234567 12345678 0 007 -4 +5 1.5 THRU 7$8".split(), b"1 2"]
    names = b"CTETRA CTETRA CTETRA CTETRA GRID GRID* * + +A CT".split()
    lines = []
    for _ in range(400):
        name = names[random.integers(0, len(names))]
        count, width = int(random.integers(0, 11)), 16 if name.endswith(b"*") else 8
        plain = random.random() < 0.6
        fields = [words[i] for i in random.integers(0, 8 if plain else len(words), count)]
        sides = [bytes.ljust if plain or random.random() < 0.5 else bytes.rjust for _ in fields]
        line = name.ljust(8) + b"".join(side(word, width) for side, word in zip(sides, fields, strict=True))
        lines.append(line.rstrip() if random.random() < 0.5 else line)
    return lines


def test_lines_of_columns_are_read_alike_in_one_pass_and_by_their_fields(random: np.random.Generator) -> None:
    """A tab in another card of the text makes all of its lines be looked at for tabs, and none be read in one pass."""
    for _ in range(20):
        lines = column_lines(random)
        quick, slow = (kernels.find_cards(b"\n".join([*lines, last])) for last in (b"ENDDATA \n", b"ENDDATA\t\n"))
        for one, other in zip(quick, slow, strict=True):
            np.testing.assert_array_equal(one, other)


def test_integers_of_columns_are_those_that_stand_there() -> None:
    numbers = [7, 1234567, 12345678, 123456789, 2147483647, 2147483648, 1234567890123456]
    for number in numbers:
        for field in (f"{number:<16}", f"{number:>16}", f"{number:^16}"):
            deck = f"GRID*   {field}\nENDDATA\n".encode()
            assert kernels.card_integers(deck, np.array([0]), 0, 1, False)[0].tolist() == [[number]]
            found = kernels.find_cards(deck)[4][0, 0]
            assert found == (number if number < 2**31 else np.iinfo(np.int32).min + 1)


def test_short_lists_are_read_as_others_are(random: np.random.Generator) -> None:
    for _ in range(50):
        lists = [random.integers(0, 10 ** random.integers(1, 10), random.integers(1, 11)).tolist() for _ in range(30)]
        text = "\n".join(f"{len(one)}({' '.join(map(str, one))})" for one in lists) + "\n" * int(random.integers(0, 99))
        offsets, values, end, good = kernels.read_integer_lists(text.encode(), 0, len(lists))
        assert good and end == len(text.rstrip())
        assert [values[a:b].tolist() for a, b in pairwise(offsets)] == lists
