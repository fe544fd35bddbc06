"""Tables of numbers in a text: where their rows stand, which points they name, and which cells are of one kind.

What a format adds is where its tables begin and what their columns are.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.source import Arrays, Cells
from meshfix_cli.meshfile.splice import Places
from meshfix_cli.meshfile.text import Spans, in_line, integers_at, unmarked, words

Int64 = NDArray[np.int64]

CODES = -(2**62)  # below, integers stand for words
_MOST_RUNS = 1000  # above, cells of a kind are gathered from all over the file


def without(data: bytes, pattern: re.Pattern[bytes], mark: bytes = b"") -> bytes:
    """Return the data with blanks in the place of what fits, comments say, so that all else stands where it stood.

    The mark of UTF-8 is blank as well.

    Parameters
    ----------
    mark : bytes
        Where it is not in the data, nothing fits.
    """
    data = unmarked(data)
    return pattern.sub(lambda found: b" " * len(found[0]), data) if mark in data else data


class Lines(NamedTuple):
    """The words of some lines.

    Attributes
    ----------
    text : bytes
    spans : (k, 2) int64
    starts : (n+1,) int64
        The number of the first word of each line, and of all words.
    end : int
        The offset behind the last word.
    """

    text: bytes
    spans: Spans
    starts: Int64
    end: int

    @property
    def counts(self) -> Int64:
        """(n,) int64: how many words a line has."""
        return np.diff(self.starts)

    def columns(self, first: int, last: int, rows: NDArray[Any] | slice = slice(None)) -> Spans:
        """Return the spans (k, last - first, 2) of some words of some lines; ReadError where a line has fewer."""
        starts = self.starts[:-1][rows]
        short = np.flatnonzero(self.starts[1:][rows] - starts < last)
        if len(short):
            at = int(self.spans[starts[short[0]], 0])
            raise in_line(self.text, at, f"there are not {counted(last, 'number', 'numbers')}")
        if len(starts) and (np.diff(starts) == starts[0:1] + last).all() and not first:
            return self.spans[starts[0] : starts[-1] + last].reshape(len(starts), last, 2)
        return self.spans[starts[:, None] + np.arange(first, last)]

    def integers(self, first: int, last: int) -> Int64:
        """Return the integers (n, last - first) that stand there."""
        return integers_at(self.text, self.columns(first, last))


def lines(text: bytes, at: int, count: int, what: str = "line") -> Lines:
    """Find the words of the next lines that have some.

    Raises
    ------
    ReadError
        There are not as many as a file announces.
    """
    found = kernels.find_lines(text, at, count)
    if not 0 <= count == len(found[1]) - 1:
        raise ReadError(f"is truncated: {counted(count, what, what + 's')} announced, and not all are there")
    return Lines(text, *found)


class IntegerLines(NamedTuple):
    """The integers of some lines, which may have other words among them; their places are found when asked for.

    Attributes
    ----------
    text : bytes
    begin, end : int
        Where to look for the first word, and the offset behind the last.
    values : (k,) int64
        What stands for other words is below all integers of files: see `word_of`.
    starts : (n+1,) int64
        The number of the first value of each line, and of all values.
    """

    text: bytes
    begin: int
    values: Int64
    starts: Int64
    end: int

    @property
    def counts(self) -> Int64:
        """(n,) int64: how many words a line has."""
        return np.diff(self.starts)

    def columns(self, first: int, last: int, rows: NDArray[Any] | slice = slice(None)) -> Spans:
        """Return the spans (k, last - first, 2) of some words of some lines."""
        return self._places().columns(first, last, rows)

    def words(self, first: int, last: int, rows: NDArray[Any] | slice = slice(None)) -> Int64:
        """Return what stands for some words (k, last - first) of some lines; ReadError where a line has fewer."""
        starts, ends = self.starts[:-1][rows], self.starts[1:][rows]
        if (ends - starts < last).any():
            self.columns(first, last, rows)  # which says where
        each = int(ends[0] - starts[0]) if len(starts) else 0
        if each and (np.diff(starts) == each).all() and ends[-1] - starts[-1] == each:
            return self.values[starts[0] : ends[-1]].reshape(-1, each)[:, first:last]
        return self.values[starts[:, None] + np.arange(first, last)]

    def integers(self, first: int, last: int, rows: NDArray[Any] | slice = slice(None)) -> Int64:
        """Return the integers (k, last - first) that stand there; ReadError where there is something else."""
        found = self.words(first, last, rows)
        if (found < CODES).any():
            integers_at(self.text, self.columns(first, last, rows))  # which says what
        return found

    def place(self, row: int) -> int:
        """Return where a line begins."""
        places = self._places()
        return int(places.spans[places.starts[row], 0])

    def _places(self) -> Lines:
        return Lines(self.text, *kernels.find_lines(self.text, self.begin, len(self.starts) - 1))


def integer_lines(text: bytes, at: int, count: int, what: str) -> IntegerLines:
    """Read the next lines that have some words; ReadError where there are not as many as a file announces."""
    values, starts, end = kernels.read_lines(text, at, count)
    if not 0 <= count == len(starts) - 1:
        raise ReadError(f"is truncated: {counted(count, what, what + 's')} announced, and not all are there")
    return IntegerLines(text, at, values, starts, end)


def check_blank(text: bytes, begin: int, end: int | None = None) -> None:
    """Raise ReadError where something stands behind the lines that a file announces, up to an offset or the end."""
    end = len(text) if end is None else end
    if left := text[begin:end].lstrip():
        raise in_line(text, end - len(left), "there are more lines than announced")


def word_of(code: int) -> str:
    """Return the first seven characters of the word for which an integer stands."""
    return (code - np.iinfo(np.int64).min).to_bytes(8, "little").rstrip(b"\0").decode("latin-1")


def rows(text: bytes, at: int, count: int, columns: int, brackets: bool = False) -> tuple[Spans, int]:
    """Find the words (count, columns, 2) of rows of equally many, wherever lines end, and the offset behind them.

    Parameters
    ----------
    brackets : bool
        See `text.words`.
    """
    if not 0 <= count * columns <= len(text) - at:
        raise ReadError(f"is truncated: {counted(count, 'row is', 'rows are')} announced")
    spans = words(text, at, count * columns, brackets)
    return spans.reshape(count, columns, 2), int(spans[-1, 1]) if len(spans) else at


def within(text: bytes, begin: int, end: int) -> Spans:
    """Find all words (k, 2) that stand between two offsets."""
    return kernels.find_words(text[begin:end], 0, max(end - begin, 0)) + begin


def in_columns(text: bytes, spans: Spans, width: int) -> Spans | None:
    """Return the spans (..., 2) of fields of so many columns at whose right ends words stand; None: not all do so."""
    begin, raw = spans[..., 1] - width, np.frombuffer(text, dtype=np.uint8)
    if not spans.size or begin.min() < 0 or (begin > spans[..., 0]).any():
        return None
    for i in range(width):
        if (raw[begin + i][begin + i < spans[..., 0]] != ord(" ")).any():
            return None
    return np.stack([begin, spans[..., 1]], axis=-1)


def right_aligned(text: bytes, spans: Spans) -> Places:
    """Return the places of coordinates (n, d, 2), which are fields of one width where all of them stand so.

    A blank is left in front of each, and an exponent may stand behind a D.
    """
    width = int(spans[0, 1, 1] - spans[0, 0, 1]) - 1 if spans.size else 0
    columns = in_columns(text, spans, width)
    if columns is None or not are_blank(text, columns[..., 0] - 1).all():
        return Places.of_text(spans, "f8", 25, "free")
    return Places.of_text(columns, "f8", width, "padded")


def are_blank(text: bytes, at: Int64) -> NDArray[np.bool_]:
    """Return at which offsets (...) no word stands; before the text there is none."""
    raw = np.frombuffer(text, dtype=np.uint8)
    return np.isin(raw[np.maximum(at, 0)], list(b" \t\r\n,")) | (at < 0)


class Numbering:
    """The numbers that a file gives to its points or cells, in the order of their rows.

    Parameters
    ----------
    numbers : (n,) int64
    """

    def __init__(self, numbers: Int64) -> None:
        self.numbers = numbers
        self.order: Int64 | None = None
        if not (numbers[1:] > numbers[:-1]).all():
            self.order = np.argsort(numbers, kind="stable")
            numbers = numbers[self.order]
        self.sorted = numbers
        self._gapless = bool((np.diff(numbers) == 1).all())

    def rows_of(self, numbers: Int64) -> Int64:
        """Return the rows (...) of numbers (...); -1: there is none. Of a number given twice, the first."""
        if not len(self.sorted):
            return np.full(numbers.shape, -1)
        if self._gapless and self.order is None:
            at = numbers - self.sorted[0]
            if not at.size or (at.min() >= 0 and at.max() < len(self.sorted)):
                return at
        at = numbers - self.sorted[0] if self._gapless else np.searchsorted(self.sorted, numbers)
        at = np.clip(at, 0, len(self.sorted) - 1)
        return np.where(self.sorted[at] == numbers, at if self.order is None else self.order[at], -1)

    def between(self, first: int, last: int) -> Int64:
        """Return the rows of all numbers in a range, by ascending numbers."""
        here = slice(*np.searchsorted(self.sorted, [first, last + 1]).tolist())
        return np.arange(len(self.sorted))[here] if self.order is None else self.order[here]

    def twice(self) -> int | None:
        """Return a number that is given twice."""
        repeated = self.sorted[1:][self.sorted[1:] == self.sorted[:-1]]
        return int(repeated[0]) if len(repeated) else None

    def points_of(self, numbers: Int64, cells: Int64 | None = None) -> Int64:
        """Return the rows (m, k) of the points that cells name.

        Parameters
        ----------
        numbers : (m, k) int64
        cells : (m,) int64, optional
            The numbers of the cells; default: their positions.

        Raises
        ------
        ReadError
            There is no such point, or two.
        """
        if (number := self.twice()) is not None:
            raise ReadError(f"the point {number} is defined twice")
        found = self.rows_of(numbers)
        if found.size and found.min() < 0:
            unknown = np.argwhere(found < 0)
            cell = unknown[0][0] if cells is None else cells[unknown[0][0]]
            named = numbers[tuple(unknown[0])]
            raise ReadError(f"is truncated or not readable: the cell {cell} names the point {named}, and there is none")
        return found


def alike(*kinds: NDArray[Any]) -> Sequence[Int64]:
    """Divide rows into runs of one kind, in their order where these are not too many.

    Parameters
    ----------
    *kinds : (n,) int
        Rows are of one kind where all of these are equal.
    """
    order = np.arange(len(kinds[0]))
    starts = _changes(kinds)
    if len(starts) >= _MOST_RUNS:
        order = np.lexsort(kinds[::-1])
        starts = _changes([kind[order] for kind in kinds])
    return np.split(order, starts) if len(order) else []


def chain(numbers: NDArray[np.integer[Any]], count: int, wrong: str, more: int = 1) -> Int64:
    """Return where (count,) rows begin that each begin with a number, of what follows but for what all rows have.

    Parameters
    ----------
    numbers : (k,) int
    count : int
    wrong : str
        What is said where there are not as many numbers.
    more : int
        How many numbers all rows have, that in front included.

    Raises
    ------
    ReadError
    """
    starts, at, view = [], 0, numbers.data
    for _ in range(count):
        if at >= len(view) or view[at] < 0:
            break
        starts.append(at)
        at += view[at] + more
    if len(starts) != count or at != len(view):
        raise ReadError(f"is not a readable file: {wrong}")
    return np.array(starts, dtype=np.int64)


@dataclass(eq=False)
class Runs:
    """Runs of cells, with what belongs to each, as a format finds them one by one.

    Attributes
    ----------
    cells : list of Cells
    corners : list of callables
        See `splice.InPlace`.
    """

    cells: list[Cells] = field(default_factory=list)
    corners: list[Callable[[], Places]] = field(default_factory=list)
    _labels: dict[str, dict[int, NDArray[Any]]] = field(default_factory=dict)
    _sets: dict[str, dict[int, Int64]] = field(default_factory=dict)

    def add(
        self,
        cells: Cells,
        corners: Callable[[], Places],
        labels: Mapping[str, Any] = MappingProxyType({}),
        sets: Iterable[str] = (),
    ) -> None:
        """Take a run of m cells with labels, each (m,) int or one for all, which is in some sets of cells."""
        i, m = len(self.cells), len(cells.vertices)
        self.cells.append(cells)
        self.corners.append(corners)
        for name, values in labels.items():
            self._labels.setdefault(name, {})[i] = np.broadcast_to(values, m)
        for name in sets:
            self.put(name, i, np.arange(m))

    def put(self, name: str, run: int, rows: Int64) -> None:
        """Put some cells of a run into a set."""
        self._sets.setdefault(name, {})[run] = rows

    def arrays(self, point_sets: Mapping[str, Int64] = MappingProxyType({})) -> Arrays:
        """Return the labels, 0 where a run has none, and the sets."""
        sizes, none = [len(run.vertices) for run in self.cells], np.empty(0, dtype=np.int64)
        return Arrays(
            cell={
                name: [runs.get(i, np.zeros(size, dtype=np.int64)) for i, size in enumerate(sizes)]
                for name, runs in self._labels.items()
            },
            cell_sets={name: [runs.get(i, none) for i in range(len(sizes))] for name, runs in self._sets.items()},
            point_sets=point_sets,
        )


def _changes(kinds: Sequence[NDArray[Any]]) -> Int64:
    return np.flatnonzero(np.any([np.diff(kind) != 0 for kind in kinds], axis=0)) + 1
