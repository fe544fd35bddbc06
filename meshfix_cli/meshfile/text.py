"""Numbers in the text of a file; whatever is not what it should be is named with its line."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted

MARK = b"\xef\xbb\xbf"  # of UTF-8, which some programs put in front of any text
Spans = NDArray[np.int64]  # (..., 2): the offset of the first byte of a word, and the offset behind its last


def unmarked(data: bytes) -> bytes:
    """Return a text with a blank line, of as many bytes, in the place of the mark of UTF-8 in front of it."""
    return b"  \r" + data[len(MARK) :] if data.startswith(MARK) else data


def words(data: bytes, at: int, count: int, brackets: bool = False) -> Spans:
    """Return the spans (count, 2) of the next words; blanks, line ends and commas separate them.

    Parameters
    ----------
    brackets : bool
        Round ones separate them as well.

    Raises
    ------
    ReadError
        The file ends before.
    """
    spans = kernels.find_words(data, at, count, brackets)
    if len(spans) < count:
        announced = counted(count, "number is announced", "numbers are announced")
        raise in_line(data, at, f"{announced}, and the file is truncated")
    return spans


def line_words(data: bytes, offsets: ArrayLike, count: int) -> Spans:
    """Return the spans (k, count, 2) of the first words from each offset (k,) to the end of its line; -1: none."""
    at = np.ascontiguousarray(offsets, dtype=np.int64)
    return kernels.line_words(data, at, count).reshape(len(at), count, 2)


def first_words(data: bytes) -> tuple[NDArray[np.int64], NDArray[np.bytes_]]:
    """Return the offset behind the first word of each line that has one, and the words, cut after nine bytes."""
    raw = np.frombuffer(data, dtype=np.uint8)
    start = len(MARK) if data.startswith(MARK) else 0
    lines = np.concatenate([[start], np.flatnonzero((raw == ord("\n")) | (raw == ord("\r"))) + 1])
    spans = line_words(data, lines, 1)[:, 0]
    begin, end = spans[spans[:, 0] >= 0].T
    found = np.zeros((len(begin), 9), dtype=np.uint8)
    for i in range(9):
        inside = begin + i < end
        found[inside, i] = raw[begin[inside] + i]
    return end, found.view("S9")[:, 0]


def integers(data: bytes, at: int, count: int) -> tuple[NDArray[np.int64], int]:
    """Return the next integers (count,) and the offset behind them; ReadError where there are not as many."""
    values, end = short_integers(data, at, count)
    return values.astype(np.int64, copy=False), end


def short_integers(
    data: bytes, at: int, count: int, brackets: bool = False
) -> tuple[NDArray[np.int32] | NDArray[np.int64], int]:
    """Do the same, in 32 bits where these are enough; `brackets` as in `words`."""
    values, end, bad = kernels.scan_integers(data, at, count, brackets)
    if bad >= 0:
        raise not_a_number(data, bad, "an integer")
    return values, end


def behind_words(data: bytes, at: int, count: int) -> int:
    """Return the offset behind the next words; -1: there are fewer."""
    return kernels.behind_words(data, at, count)


def integers_at(data: bytes, spans: Spans, slash: bool = False) -> NDArray[np.int64]:
    """Return the integers (...) of words, if `slash` up to one; ReadError where one is not an integer."""
    flat = np.ascontiguousarray(spans.reshape(-1, 2))
    values, bad = kernels.integers(data, flat, slash)
    if bad >= 0:
        raise not_a_number(data, int(flat[bad, 0]), "an integer")
    return values.reshape(spans.shape[:-1])


def numbers_at(data: bytes, spans: Spans, dtype: np.dtype[Any]) -> NDArray[np.floating[Any]]:
    """Return the numbers (...) of words, in float32 or float64; ReadError where one is not a number."""
    flat = np.ascontiguousarray(spans.reshape(-1, 2))
    values, bad = kernels.numbers(data, flat, dtype.itemsize == 4)
    if bad >= 0:
        raise not_a_number(data, int(flat[bad, 0]), "a number")
    return values.reshape(spans.shape[:-1]).astype(dtype, copy=False)


def fields_at(data: bytes, spans: Spans) -> NDArray[np.float64]:
    """Return the numbers (...) of fields as Fortran and Nastran read them; ReadError where one is not a number."""
    flat = np.ascontiguousarray(spans.reshape(-1, 2))
    values, bad = kernels.read_fields(data, flat)
    if bad >= 0:
        field = data[flat[bad, 0] : flat[bad, 1]].decode("latin-1").strip()
        raise in_line(data, int(flat[bad, 0]), f"{field!r} is not a number")
    return values.reshape(spans.shape[:-1])


def in_line(data: bytes, at: int, what: str) -> ReadError:
    """Return the error that tells what is wrong at an offset."""
    number = data.count(b"\n", 0, at) + 1
    return ReadError(f"line {number}: {what}")


def not_a_number(data: bytes, at: int, what: str) -> ReadError:
    """Return the error that tells what a word at an offset is not."""
    if not 0 <= at < len(data):
        return ReadError("is truncated: a number is missing" + (" at its end" if at >= len(data) else ""))
    word = data[at : at + 40].replace(b",", b" ").split(maxsplit=1)[0].decode("latin-1")
    return in_line(data, at, f"{word!r} is not {what}")
