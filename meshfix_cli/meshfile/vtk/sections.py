"""The sections of legacy .vtk files: which there are, and where their numbers stand.

Source: "VTK File Formats", section Simple Legacy Formats; what that leaves open, as VTK's own reader has it.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple
from urllib.parse import unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.source import REGIONS
from meshfix_cli.meshfile.splice import Places
from meshfix_cli.meshfile.text import Spans, behind_words, numbers_at, short_integers, words
from meshfix_cli.meshfile.vtk.cells import no_points

_HEAD = re.compile(
    rb"(?:\xef\xbb\xbf)?\s*# vtk DataFile Version\s+(\d{1,9})[^\n]*\n[^\n]*\n\s*(ascii|binary)\s+dataset\s+(\w+)\s",
    re.I,
)
_WORD = re.compile(rb"\s*(\S{1,256})")
# numpy's types; "bit" is packed and "string" has no fixed size. VTK writes its vtkIdType in 32 bits, whatever it is.
_KINDS = {
    b"bit": "bit", b"char": "i1", b"signed_char": "i1", b"unsigned_char": "u1", b"short": "i2", b"unsigned_short": "u2",
    b"int": "i4", b"unsigned_int": "u4", b"long": "i8", b"unsigned_long": "u8", b"float": "f4", b"double": "f8",
    b"vtktypeint32": "i4", b"vtktypeuint32": "u4", b"vtktypeint64": "i8", b"vtktypeuint64": "u8", b"vtkidtype": "i4",
    b"string": "string", b"utf8_string": "string", b"variant": "variant",
}  # fmt: skip
_COMPONENTS = {
    b"vectors": 3, b"normals": 3, b"tensors": 9, b"tensors6": 6, b"global_ids": 1, b"pedigree_ids": 1, b"edge_flags": 1
}  # fmt: skip
_ATTRIBUTES = (b"scalars", b"color_scalars", b"lookup_table", b"texture_coordinates", *_COMPONENTS)
_SHAPE = (b"dimensions", b"extent")
_CELLS = (b"cells", b"vertices", b"lines", b"polygons", b"triangle_strips")


class Odd(ReadError):
    """Something that cannot be walked over; what stands before it is good."""


@dataclass(frozen=True, eq=False)
class Array:
    """Where an array stands.

    Attributes
    ----------
    data : bytes
        The file.
    binary : bool
    name : str
    kind : str
        A numpy type, or "bit", "string", "variant".
    tuples, components : int
    begin, end : int
        Offsets of its first byte, and behind its last.
    """

    data: bytes
    binary: bool
    name: str
    kind: str
    tuples: int
    components: int
    begin: int
    end: int

    @property
    def size(self) -> int:
        """How many numbers it has."""
        return self.tuples * self.components

    def rows(self) -> Places:
        """Return where its numbers (tuples, components) stand."""
        if not self.binary:
            return Places.of_text(self._spans.reshape(self.tuples, self.components, 2), self.kind)
        dtype = np.dtype(f">{self.kind}")
        first = self.begin + self.components * dtype.itemsize * np.arange(self.tuples)
        return Places.of_rows(first, self.components, dtype.str)

    def values(self) -> NDArray[Any]:
        """Return the numbers (tuples,), or (tuples, components) where there are several; Odd where there are none."""
        flat = self._binary() if self.binary else self._text()
        return flat if self.components == 1 else flat.reshape(self.tuples, self.components)

    def places(self, which: NDArray[np.int64]) -> Places:
        """Return where the numbers `which` (m, k) stand."""
        if not self.binary:
            return Places.of_text(self._spans[which], self.kind)
        dtype = np.dtype(f">{self.kind}")
        return Places(self.begin + dtype.itemsize * which, None, dtype)

    def _binary(self) -> NDArray[Any]:
        if self.kind == "bit":
            return np.unpackbits(np.frombuffer(self.data[self.begin : self.end], np.uint8), count=self.size)
        dtype = self._dtype()
        return np.frombuffer(self.data, dtype.newbyteorder(">"), self.size, self.begin).astype(dtype)

    def _text(self) -> NDArray[Any]:
        dtype = self._dtype()
        if dtype.kind == "f":
            return numbers_at(self.data, self._spans, dtype)
        read, _ = short_integers(self.data, self.begin, self.size)
        values = read.astype(dtype, copy=False)
        if (values != read).any():
            raise Odd(f"has numbers in its array {self.name!r} that are too large for their type")
        return values

    @cached_property
    def _spans(self) -> Spans:
        return words(self.data, self.begin, self.size)

    def _dtype(self) -> np.dtype[Any]:
        if self.kind in ("string", "variant"):
            raise Odd(f"has an array {self.name!r} that is not of numbers")
        return np.dtype("u1" if self.kind == "bit" else self.kind)


class CellArray(NamedTuple):
    """A section of cells.

    Attributes
    ----------
    cells : int
        How many there are.
    offsets : Array or None
        None: before the vertices of each cell stands how many they are.
    numbers : Array
    """

    cells: int
    offsets: Array | None
    numbers: Array


@dataclass(eq=False)
class Sections:
    """The sections of a file; `walk` fills them in.

    Attributes
    ----------
    data : bytes
    binary : bool
    dataset : bytes
        In small letters.
    at : int
        Offset of what is to be read next.
    points, types : Array or None
    points_kind : int
        Offset of the word that tells the type of the points.
    shape : list of int
        How many points stand along each index.
    cells : dict
        By the keywords of their sections, in small letters.
    arrays : dict
        A list for each of b"point_data", b"cell_data" and b"dataset".
    untold : list of str
        See `Source`.
    """

    data: bytes
    binary: bool
    dataset: bytes
    at: int
    points: Array | None = None
    points_kind: int = 0
    types: Array | None = None
    shape: list[int] = field(default_factory=list)
    cells: dict[bytes, CellArray] = field(default_factory=dict)
    arrays: dict[bytes, list[Array]] = field(default_factory=lambda: defaultdict(list))
    untold: list[str] = field(default_factory=list)

    def walk(self) -> None:
        """Find all sections up to the end of the file, or to what is odd among the data of points and cells."""
        place: bytes = b"dataset"
        tuples: int | None = None
        while keyword := self._peek():
            start = self.at
            self._word()
            try:
                if keyword in (b"point_data", b"cell_data"):
                    place, tuples = keyword, self._count()
                elif not self._geometry(keyword):
                    self.arrays[place] += self._field() if keyword == b"field" else self._attribute(keyword, tuples)
            except Odd:
                if place == b"dataset":
                    raise
                if not self.data[self.at :].strip():
                    raise ReadError("is truncated: it ends within its data") from None
                if any(name.encode() in self.data[start:] for name in REGIONS):
                    raise
                self.untold.append("data that cannot be read")
                return

    def _geometry(self, keyword: bytes) -> bool:
        """Whether a section is one of points or cells; then it is walked over."""
        if keyword in self.cells or (keyword == b"points" and self.points) or (keyword == b"cell_types" and self.types):
            raise ReadError(f"is not a readable vtk file: it has two sections {keyword.decode().upper()}")
        if keyword == b"points":
            count, kind = self._count(), self._word()
            self.points_kind = self.at - len(kind)
            self.points = self._array(b"points", kind, 3, count)
        elif keyword == b"cell_types":
            self.types = self._array(keyword, b"int", 1, self._count())
        elif keyword in _SHAPE and self.dataset == b"structured_grid":
            self.shape = self._shape(keyword == b"extent")
            return True
        elif keyword in _CELLS:
            self.cells[keyword] = self._cells(self._count(), self._count())
        return keyword in (b"points", b"cell_types", *_CELLS)

    def _shape(self, ends: bool) -> list[int]:
        """How many points there are along each index, or from which to which of these."""
        words = [self._word() for _ in range(6 if ends else 3)]
        if not all(re.fullmatch(rb"-?\d{1,9}", word) for word in words):
            raise ReadError("is not a readable vtk file: it does not tell how many points stand along each index")
        numbers = [int(word) for word in words]
        return [last - first + 1 for first, last in zip(numbers[::2], numbers[1::2], strict=True)] if ends else numbers

    def _cells(self, count: int, size: int) -> CellArray:
        if self._peek() != b"offsets":
            return CellArray(count, None, self._array(b"cells", b"int", 1, size))
        self._word()
        offsets = self._array(b"offsets", self._word(), 1, count)
        if self._word().lower() != b"connectivity" or not count:
            raise Odd("is not a readable vtk file: its offsets of cells are not followed by their vertices")
        return CellArray(count - 1, offsets, self._array(b"connectivity", self._word(), 1, size))

    def _attribute(self, keyword: bytes, tuples: int | None) -> list[Array]:
        if tuples is None or keyword not in _ATTRIBUTES:
            error = ReadError if keyword[:1] in b"+-.0123456789" else Odd  # more numbers than were announced
            raise error(f"is not a readable vtk file: {_shown(keyword)} stands where a keyword is expected")
        name = self._word()
        if keyword == b"lookup_table":
            self.untold.append("lookup tables")
            self._array(name, b"unsigned_char" if self.binary else b"float", 4, self._count())
            return []
        if keyword == b"color_scalars":
            return [self._array(name, b"unsigned_char" if self.binary else b"float", self._count(), tuples)]
        components = self._count() if keyword == b"texture_coordinates" else _COMPONENTS.get(keyword, 1)
        kind = self._word()
        if keyword == b"scalars":
            components = 1 if self._peek() == b"lookup_table" else self._count()
            if self._word().lower() != b"lookup_table":
                raise Odd("is not a readable vtk file: SCALARS are not followed by LOOKUP_TABLE")
            self._word()
        return [self._array(name, kind, components, tuples)]

    def _field(self) -> list[Array]:
        self._word()
        found = []
        for _ in range(self._count()):
            name = self._word()
            if name != b"NULL_ARRAY":
                components, tuples = self._count(), self._count()
                found.append(self._array(name, self._word(), components, tuples))
        return found

    def _array(self, name: bytes, word: bytes, components: int, tuples: int) -> Array:
        kind = _KINDS.get(word.lower())
        if kind is None:
            raise Odd(f"is not a readable vtk file: {_shown(word)} is not a type of numbers")
        count = components * tuples
        begin = self._line_end() if count and (self.binary or kind in ("string", "variant")) else self.at
        if kind in ("string", "variant"):
            self.untold.append("arrays of strings")
            self.at = self._behind_strings(begin, count, self.binary and kind == "string")
        elif self.binary:
            self.at = begin + (-(-count // 8) if kind == "bit" else count * np.dtype(kind).itemsize)
        else:
            self.at = self._behind_words(begin, count)
        if self.at > len(self.data):
            raise ReadError(f"is truncated: it ends within {counted(count, 'number', 'numbers')} that it announces")
        text = unquote_to_bytes(name).decode("utf-8", "replace")
        array = Array(self.data, self.binary, text, kind, tuples, components, begin, self.at)
        self._skip_metadata(components)
        return array

    def _behind_words(self, at: int, count: int) -> int:
        end = behind_words(self.data, at, count) if 2 * count <= len(self.data) - at + 1 else -1
        if end < 0:
            raise ReadError(f"is truncated: it ends within {counted(count, 'number', 'numbers')} that it announces")
        return end

    def _behind_strings(self, at: int, count: int, prefixed: bool) -> int:
        """Strings stand in lines or behind their lengths; the first two bits of a length tell its size."""
        for _ in range(count):
            if at >= len(self.data):
                raise ReadError(f"is truncated: it ends within {counted(count, 'string', 'strings')} that it announces")
            if prefixed:
                size = (8, 4, 2, 1)[self.data[at] >> 6]
                length = int.from_bytes(self.data[at : at + size], "big")
                at += size + (length & (1 << 8 * size - 2) - 1 if size < 8 else length)
            else:
                at = self.data.find(b"\n", at) + 1 or len(self.data)
        return at

    def _skip_metadata(self, components: int) -> None:
        """METADATA may follow an array, up to an empty line; at the end of the file, editors take that line away."""
        if self._peek() != b"metadata":
            return
        self._word()
        self.at = self._line_end()
        while self.at < len(self.data):
            start, self.at = self.at, self.data.find(b"\n", self.at) + 1 or len(self.data)
            line = self.data[start : self.at].strip().lower()
            if not line:
                return
            if line.startswith(b"component_names"):
                self.untold.append("names of components")
                self.at = self._behind_strings(self.at, components, False)  # of which some may be empty

    def _line_end(self) -> int:
        """Offset of the next line, where only blanks stand before it."""
        end = self.data.find(b"\n", self.at) + 1
        if not end:
            raise ReadError("is truncated: it ends where numbers should begin")
        if self.data[self.at : end].strip():
            raise Odd("is not a readable vtk file: numbers do not begin in a line of their own")
        return end

    def _count(self) -> int:
        word = self._word()
        if not word.isdigit() or len(word) > 18:
            raise Odd(f"is not a readable vtk file: {_shown(word)} is not a count")
        return int(word)

    def _word(self) -> bytes:
        match = _WORD.match(self.data, self.at)
        if match is None:
            raise ReadError("is truncated: it ends within a section")
        self.at = match.end()
        return match[1]

    def _peek(self) -> bytes:
        """The next word in small letters; empty at the end."""
        match = _WORD.match(self.data, self.at)
        return match[1].lower() if match else b""


def find_sections(data: bytes) -> Sections | None:
    """Find the sections of a file; None: it is newer than version 5, or of another kind of data set.

    Raises
    ------
    ReadError
        The file is malformed or truncated.
    """
    head = _HEAD.match(data)
    if head is None:
        raise ReadError("is not a readable vtk file: it does not begin with a version, a title, a coding and a dataset")
    dataset = head[3].lower()
    if dataset in (b"structured_points", b"rectilinear_grid"):
        raise no_points(dataset.decode().upper())
    if int(head[1]) > 5 or dataset not in (b"unstructured_grid", b"polydata", b"structured_grid"):
        return None
    found = Sections(data, head[2].lower() == b"binary", dataset, head.end())
    found.walk()
    return found


def _shown(word: bytes) -> str:
    return repr(word[:40].decode("latin-1"))
