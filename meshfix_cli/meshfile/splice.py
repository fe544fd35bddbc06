"""Writing by splicing: only the numbers that changed are replaced in the original bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.text import Spans, fields_at, numbers_at

Points = NDArray[np.floating[Any]]
SLAB = 65536  # points whose coordinates are written at once


class Turned(NamedTuple):
    """Cells of a run that get the other orientation.

    Attributes
    ----------
    rows : (k,) int64
    order : sequence of int
        Which of its vertices stands in each place of a cell afterwards.
    """

    rows: NDArray[np.int64]
    order: Sequence[int]

    @property
    def places(self) -> NDArray[np.int64]:
        """(2, c) int64: the places in which another vertex will stand, and where each of these stands now."""
        order = np.array(self.order, dtype=np.int64)
        changed = np.flatnonzero(order != np.arange(len(order)))
        return np.stack([changed, order[changed]])


@dataclass(frozen=True, eq=False)
class Edits:
    """Words that take the place of others.

    Attributes
    ----------
    spans : (k, 2) int64
        What is replaced.
    words : bytes
    word_spans : (k, 2) int64
        What replaces it, in `words`.
    """

    spans: Spans
    words: bytes
    word_spans: Spans


@dataclass(frozen=True, eq=False)
class Places:
    """Where a file holds rows of numbers.

    Attributes
    ----------
    begin : (n, k) int64
        Offset of the first byte of each number.
    end : (n, k) int64 or None
        Offset behind the text of each number; None for binary numbers.
    dtype : numpy dtype
        Type of the numbers, with its byte order where they are binary.
    longest : int
        Characters that the format allows for a number; 0: any number of them.
    fields : {"", "free", "padded"}
        Numbers are those of Fortran's and Nastran's fields of `longest` columns, which are to be filled or not.
    widths : (n, k) int or None
        How many columns each field has that is to be filled, where these differ; 0: it is free.
    """

    begin: NDArray[np.int64]
    end: NDArray[np.int64] | None
    dtype: np.dtype[Any]
    longest: int = 0
    fields: str = ""
    widths: NDArray[np.integer[Any]] | None = None

    @classmethod
    def of_text(cls, spans: Spans, dtype: str = "f8", longest: int = 0, fields: str = "") -> Places:
        """Places of the words at spans (n, k, 2)."""
        return cls(spans[..., 0], spans[..., 1], np.dtype(dtype), longest, fields)

    @classmethod
    def of_rows(cls, first: NDArray[np.int64], columns: int, dtype: str) -> Places:
        """Places of binary rows of `columns` numbers without gaps, from the offset of each row (n,)."""
        kind = np.dtype(dtype)
        return cls(first[:, None] + kind.itemsize * np.arange(columns), None, kind)

    @property
    def spans(self) -> Spans:
        """(n, k, 2) int64."""
        end = self.begin + self.dtype.itemsize if self.end is None else self.end
        return np.stack([self.begin, end], axis=-1)

    def at(self, index: Any) -> Places:
        """Places of some of the numbers."""
        end, widths = (None if values is None else values[index] for values in (self.end, self.widths))
        return replace(self, begin=self.begin[index], end=end, widths=widths)

    def read(self, data: bytes) -> Any:
        """Return the numbers (n, k) in the machine's byte order; ReadError where there are none."""
        if self.end is not None:
            return self._decode(data, self.spans)
        size, native = self.dtype.itemsize, self.dtype.newbyteorder("=")
        if not self.begin.size:
            return np.empty(self.begin.shape, native)
        if not 0 <= self.begin.min() <= self.begin.max() <= len(data) - size:
            raise ReadError("is truncated: its numbers reach behind its end")
        windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(data, np.uint8), size)
        return windows[self.begin].view(self.dtype)[..., 0].astype(native)

    def holds(self, kind: np.dtype[Any]) -> bool:
        """Whether all numbers of a type are held as they are."""
        return not self.longest and self.dtype.newbyteorder("=") == kind

    def rounded(self, values: Points) -> Points:
        """Return numbers (n, k) as the file can hold them."""
        values = values.astype(self.dtype.newbyteorder("="), copy=False)
        if self.longest:
            words, spans = self._encode(values.ravel())
            values = self._decode(words, spans).reshape(values.shape)
        return values

    def replace(self, which: NDArray[np.bool_], values: Points) -> Edits:
        """Write numbers (n, k) where `which` (n, k) is True."""
        places, words = self.at(which), self._encode(values[which])
        if places.widths is None:
            return Edits(places.spans, *words)
        return places._filled([words[0][first:last] for first, last in words[1].tolist()])

    def turn(self, data: bytes, cells: Turned) -> Edits:
        """Put the numbers of some rows into another order."""
        there, here = cells.places
        return self.at((cells.rows[:, None], there)).copied(data, self.at((cells.rows[:, None], here)))

    def copied(self, data: bytes, others: Places) -> Edits:
        """Write the numbers that stand in as many other places, as they are."""
        words = [data[first:last] for first, last in others.spans.reshape(-1, 2).tolist()]
        if self.fields == "padded":  # the last field of a line may be short, and tabs reach from column to column
            words = [word.expandtabs(8).ljust(self.longest) for word in words]
        return self._put(words)

    def _filled(self, words: list[bytes]) -> Edits:
        """Write words behind blanks that fill their fields."""
        widths = [] if self.widths is None else self.widths.ravel().tolist()
        return self._put([word.rjust(width) for word, width in zip(words, widths, strict=True)])

    def _put(self, words: list[bytes]) -> Edits:
        ends = np.cumsum([0, *map(len, words)])
        return Edits(np.ascontiguousarray(self.spans.reshape(-1, 2)), b"".join(words), pairs(ends))

    def _decode(self, data: bytes, spans: Spans) -> Points:
        return fields_at(data, spans) if self.fields else numbers_at(data, spans, self.dtype)

    def _encode(self, values: Points) -> tuple[bytes, Spans]:
        if self.end is None:
            return values.astype(self.dtype).tobytes(), pairs(np.arange(len(values) + 1) * self.dtype.itemsize)
        numbers = values.astype(np.float64, copy=False)
        if self.fields:
            return kernels.write_fields(numbers, self.longest, self.fields == "padded")
        return kernels.shortest(numbers, self.dtype.itemsize == 4, self.longest)


@dataclass(frozen=True, eq=False)
class InPlace:
    """The layout of a file whose numbers stand in its bytes as they are.

    Attributes
    ----------
    data : bytes
    coordinates : Places
        A row for each point.
    corners : sequence of callables
        For each run of cells what gives the places of its vertices, a row for each cell.
    """

    data: bytes
    coordinates: Places
    corners: Sequence[Callable[[], Places]]

    @property
    def binary(self) -> bool:
        """Whether the coordinates are, so that each has its bytes whatever it is."""
        return self.coordinates.end is None

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the file can hold them."""
        return self.coordinates.rounded(points)

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the file with other points (n, d), and with some cells turned.

        Parameters
        ----------
        original : (n, d) float
            The points as they were read.
        reversed_cells : mapping
            Cells by the number of their run.
        """
        return self.divided(original, points, reversed_cells, ())[0]

    def divided(
        self, original: Points, points: Points, reversed_cells: Mapping[int, Turned], bounds: Sequence[int]
    ) -> list[bytes]:
        """Return the same in the parts into which ascending offsets divide the file."""
        changed = self._changes(original, points, slice(None))
        turned = (self.corners[run]().turn(self.data, cells) for run, cells in reversed_cells.items())
        return divided(self.data, [changed, *turned], bounds)

    def moved(self, original: Points, points: Points) -> Iterable[bytes | memoryview]:
        """Give the file with other points (n, d) in parts: never is much of it in memory once more."""
        first = self.coordinates.begin.ravel()
        if not (first[1:] > first[:-1]).all():
            return [self.rewritten(original, points, {})]
        slabs = range(0, len(points), SLAB)
        return spliced(self.data, (self._changes(original, points, slice(at, at + SLAB)) for at in slabs))

    def _changes(self, original: Points, points: Points, rows: slice) -> Edits:
        which = differing(original[rows], points[rows])
        return self.coordinates.at(rows).replace(which, points[rows])


def differing(original: Points, points: Points) -> NDArray[np.bool_]:
    """Return where coordinates differ; points that are not a number stay as they are."""
    return (points != original) & ~np.isnan(points)


def apply(data: bytes, edits: Sequence[Edits]) -> bytes:
    """Return the data with all edits made; they may come in any order."""
    return divided(data, edits, ())[0]


def divided(data: bytes, edits: Sequence[Edits], bounds: Sequence[int]) -> list[bytes]:
    """Return the data with all edits made, in the parts into which ascending offsets divide it."""
    starts = np.cumsum([0, *(len(edit.words) for edit in edits)])
    spans = np.concatenate([edit.spans for edit in edits])
    words = np.concatenate([edit.word_spans + start for edit, start in zip(edits, starts, strict=False)])
    if (np.diff(spans[:, 0]) < 0).any():
        order = np.argsort(spans[:, 0], kind="stable")
        spans, words = spans[order], words[order]
    text = b"".join(edit.words for edit in edits)
    numbers = [0, *np.searchsorted(spans[:, 0], bounds).tolist(), len(spans)]
    return [
        kernels.replace(data, begin, end, spans[first:last], text, words[first:last])
        for (begin, end), (first, last) in zip(pairwise([0, *bounds, len(data)]), pairwise(numbers), strict=True)
    ]


def spliced(data: bytes, edits: Iterable[Edits]) -> Iterator[bytes | memoryview]:
    """Give the data with edits made, in parts; the edits are in the order of the data."""
    at = 0
    for edit in edits:
        if len(edit.spans):
            if at == 0:
                at = max(int(edit.spans[0, 0]), 0)
                yield memoryview(data)[:at]
            end = int(edit.spans[-1, 1])
            yield kernels.replace(data, at, end, edit.spans, edit.words, edit.word_spans)
            at = end
    yield memoryview(data)[at:]


def pairs(offsets: NDArray[np.int64]) -> Spans:
    """Spans (k, 2) between consecutive offsets (k+1,)."""
    return np.stack([offsets[:-1], offsets[1:]], axis=1).astype(np.int64)
