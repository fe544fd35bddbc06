"""The numbers of a .msh file one behind the other, as text or binary, read from a place that goes on with them."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.splice import Places
from meshfix_cli.meshfile.text import in_line, integers, integers_at, line_words, words

Int64 = NDArray[np.int64]

_COUNT = re.compile(rb"\s*(-?\d{1,18})(?!\S)[ \t\r]*\n?")
_LINE = re.compile(rb"([^\n]*)\n")


@dataclass
class Numbers:
    """What text and binary files have in common: headers are text in both.

    Attributes
    ----------
    data : bytes
    at : int
        Offset of what is read next.
    """

    data: bytes
    at: int

    def line(self) -> bytes:
        """Read a line."""
        match = _LINE.match(self.data, self.at)
        if match is None:
            raise ReadError("is truncated: a line is missing at its end")
        self.at = match.end()
        return match[1].strip()

    def count(self) -> int:
        """Read an integer in text and, if it is there, the end of its line."""
        match = _COUNT.match(self.data, self.at)
        if match is None:
            raise in_line(self.data, self.at, "there is no number of what follows")
        self.at = match.end()
        return int(match[1])

    def claim(self, count: int, size: int) -> None:
        """Check that numbers of so many bytes can be there, before anything is made for them."""
        left = len(self.data) - self.at
        if not 0 <= count * size <= left:
            announced = counted(count, "number is announced", "numbers are announced")
            raise ReadError(f"is truncated: {announced} and {counted(left, 'byte is left', 'bytes are left')}")


@dataclass
class Text(Numbers):
    """Numbers in text."""

    binary = False
    size = "i8"

    def ints(self, count: int) -> Int64:
        """Read integers (count,)."""
        self.claim(count, 2)
        values, self.at = integers(self.data, self.at, count)
        return values

    sizes = ints

    def all_integers(self) -> Int64:
        """Read integers up to the first word that is none."""
        values, self.at, _ = kernels.scan_integers(self.data, self.at, len(self.data))
        return values.astype(np.int64, copy=False)

    def coordinates(self, count: int, width: int) -> Places:
        """Go over rows of `width` numbers; the places of the first three of each."""
        return Places.of_text(self._words(count, width)[:, :3])

    def tagged(self, count: int, width: int) -> tuple[Int64, Places]:
        """Go over rows of an integer and `width` numbers: the integers, and the places of the numbers."""
        spans = self._words(count, 1 + width)
        return integers_at(self.data, spans[:, 0]), Places.of_text(spans[:, 1:])

    def parametric(self, count: int) -> tuple[Int64, Places]:
        """Go over lines of a tag, three coordinates and what comes behind: the tags, and the places of the three."""
        self.claim(count, 8)
        ends = self.at + np.flatnonzero(np.frombuffer(self.data, np.uint8, offset=self.at) == ord("\n"))[:count]
        starts = np.array([self.at, *(ends[:-1] + 1)])
        spans = line_words(self.data, starts, 4)
        if not 0 < count == len(ends) or (spans < 0).any():
            raise ReadError("is truncated or damaged: $ParametricNodes has not a line of numbers for each node")
        self.at = int(ends[-1])
        return integers_at(self.data, spans[:, 0]), Places.of_text(spans[:, 1:])

    def corners(self, base: int, first: Int64, count: int, kind: str) -> Places:
        """Places (m, count) of integers: how many others stand from the offset `base` to the `first` (m,) of a row."""
        spans = words(self.data, base, int(first.max()) + count)
        return Places.of_text(spans[first[:, None] + np.arange(count)], kind)

    def _words(self, count: int, width: int) -> Any:
        self.claim(count * width, 2)
        spans = words(self.data, self.at, count * width)
        if len(spans):
            self.at = int(spans[-1, 1])
        return spans.reshape(count, width, 2)


@dataclass
class Binary(Numbers):
    """Binary numbers.

    Attributes
    ----------
    order : str
        "<" or ">".
    size : str
        Type of the numbers that are of gmsh's type size_t.
    """

    order: str
    size: str

    binary = True

    def ints(self, count: int) -> Int64:
        """Read integers (count,) of four bytes."""
        return self._take("i4", count)

    def sizes(self, count: int) -> Int64:
        """Read integers (count,) of gmsh's type size_t."""
        return self._take(self.size, count)

    def all_integers(self) -> NDArray[np.int32]:
        """View all that follows as integers of four bytes; they are not read yet."""
        return np.frombuffer(self.data, self.order + "i4", (len(self.data) - self.at) // 4, self.at)

    def coordinates(self, count: int, width: int) -> Places:
        """Go over rows of `width` numbers; the places of the first three of each."""
        return Places.of_rows(self._rows(count, 8 * width), 3, self.order + "f8")

    def tagged(self, count: int, width: int) -> tuple[Int64, Places]:
        """Go over rows of an integer and `width` numbers: the integers, and the places of the numbers."""
        first = self._rows(count, 4 + 8 * width)
        tags = Places.of_rows(first, 1, self.order + "i4").read(self.data)[:, 0]
        return tags.astype(np.int64), Places.of_rows(first + 4, width, self.order + "f8")

    def parametric(self, count: int) -> tuple[Int64, Places]:
        """Go over a tag, three coordinates, dimension, entity, parameters: the tags, and the places of the three."""
        self.claim(count, 36)
        first, dimension = [], struct.Struct(self.order + "i")
        for _ in range(count):
            self.claim(1, 36)
            first.append(self.at)
            parameters = {1: 1, 2: 2}.get(dimension.unpack_from(self.data, self.at + 28)[0], 0)
            self.at += 36 + 8 * parameters
        at = np.array(first, dtype=np.int64)
        tags = Places.of_rows(at, 1, self.order + "i4").read(self.data)[:, 0]
        return tags.astype(np.int64), Places.of_rows(at + 4, 3, self.order + "f8")

    def corners(self, base: int, first: Int64, count: int, kind: str) -> Places:
        """Places (m, count) of integers: how many others stand from the offset `base` to the `first` (m,) of a row."""
        dtype = np.dtype(self.order + kind)
        return Places.of_rows(base + dtype.itemsize * first, count, dtype.str)

    def _take(self, kind: str, count: int) -> Int64:
        dtype = np.dtype(self.order + kind)
        self.claim(count, dtype.itemsize)
        values = np.frombuffer(self.data, dtype, count, self.at)
        self.at += values.nbytes
        return values.astype(np.int64)

    def _rows(self, count: int, size: int) -> Int64:
        """Go over rows of so many bytes: the offset of each."""
        self.claim(count, size)
        first = self.at + size * np.arange(count)
        self.at += size * count
        return first
