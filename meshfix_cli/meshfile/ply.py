"""Stanford .ply files: a header declares elements and their properties, then come the rows of each, text or binary.

Source: G. Turk, "The PLY Polygon File Format", 1994.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import Edits, InPlace, Places, apply, pairs
from meshfix_cli.meshfile.text import in_line, integers_at, numbers_at

_BEGIN = re.compile(rb"(?:\xef\xbb\xbf)?ply[ \t]*(?=[\r\n])")
_SECOND = re.compile(rb"ply[\r\n]+format ")  # one more header behind the rows of the first
_END = re.compile(rb"[\r\n][ \t]*end_header[ \t]*(\r\n|\n|\r|\Z)")
_LINE = re.compile(rb"[^\r\n]+")
_ORDERS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
_TYPES = {
    name: np.dtype(kind)
    for kind, names in {
        "i1": (b"char", b"int8"), "u1": (b"uchar", b"uint8"), "i2": (b"short", b"int16"),
        "u2": (b"ushort", b"uint16"), "i4": (b"int", b"int32"), "u4": (b"uint", b"uint32"), "i8": (b"int64",),
        "u8": (b"uint64",), "f4": (b"float", b"float32"), "f8": (b"double", b"float64"),
    }.items()
    for name in names
}  # fmt: skip
_CELLS = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}
_INTEGERS = frozenset(name for name, kind in _TYPES.items() if kind.kind in "iu")
_CORNERS = {"face": ("vertex_indices", "vertex_index"), "edge": ("vertex1", "vertex2")}


@dataclass(frozen=True, eq=False)
class _Property:
    """A number in each row of an element, or a list of them."""

    name: str
    kind: np.dtype[Any]
    listed: bool
    length: np.dtype[Any]  # the type of the length of a list
    declared: tuple[int, int]  # the span of the word for `kind`


@dataclass(frozen=True, eq=False)
class _Element:
    name: str
    rows: int
    properties: list[_Property] = field(default_factory=list)

    def named(self, *names: str) -> list[_Property]:
        """Return the properties that have one of some names."""
        return [one for name in names for one in self.properties if one.name == name]

    def steps(self, width: Callable[[np.dtype[Any]], int]) -> tuple[list[tuple[int, _Property]], int]:
        """Return each list and the width of the numbers before it, and the width of those behind the last."""
        lists, gap = [], 0
        for one in self.properties:
            if not one.listed:
                gap += width(one.kind)
            else:
                lists.append((gap, one))
                gap = 0
        return lists, gap


class _Header(NamedTuple):
    order: str  # of the bytes of a number; "": text
    elements: dict[str, _Element]
    remarks: bool
    end: int


# The rows behind the header are gone over by one of two classes. To both a position is where a number stands: an offset
# in binary files, and the number of a word in text.


@dataclass(eq=False)
class _Binary:
    """Rows of binary numbers from an offset on."""

    data: bytes
    at: int
    order: str

    def width(self, kind: np.dtype[Any]) -> int:
        """Return how many positions a number takes."""
        return kind.itemsize

    def anchors(self, element: _Element) -> NDArray[np.int64]:
        """Go over an element; return the positions (rows, 1 + lists) where rows begin, and behind each list.

        All rows are supposed to be as long as the first; where they are not, a walk goes from row to row.
        """
        lists, tail = element.steps(self.width)
        found = self._walk(element, min(element.rows, 1))
        if not element.rows:
            return found
        size = int(found[0, -1]) + tail - self.at
        if element.rows * size <= len(self.data) - self.at:
            rows = found + size * np.arange(element.rows)[:, None]
            lengths = [self.integers(rows[:, i] + gap, one.length) for i, (gap, one) in enumerate(lists)]
            if all((length == length[0]).all() for length in lengths):
                self.at += element.rows * size
                return rows
        elif not lists:
            raise _truncated(element)
        found = self._walk(element, element.rows)
        self.at = int(found[-1, -1]) + tail
        return found

    def _walk(self, element: _Element, rows: int) -> NDArray[np.int64]:
        lists, tail = element.steps(self.width)
        plan = [(gap, one.length.itemsize, one.length.kind == "i", one.kind.itemsize) for gap, one in lists]
        found, at, order = array("q"), self.at, "big" if self.order == ">" else "little"
        for _ in range(rows):
            found.append(at)
            for gap, size, signed, item in plan:
                at += gap + size
                length = int.from_bytes(self.data[at - size : at], order, signed=signed)  # type: ignore[arg-type]
                at += length * item
                if length < 0 or at > len(self.data):
                    raise _truncated(element)
                found.append(at)
            at += tail
            if at > len(self.data):
                raise _truncated(element)
        return np.array(found, dtype=np.int64).reshape(rows, 1 + len(lists))

    def places(self, positions: NDArray[np.int64], kind: np.dtype[Any]) -> Places:
        return Places(positions, None, kind.newbyteorder(self.order))  # type: ignore[arg-type]

    def read(self, positions: NDArray[np.int64], kind: np.dtype[Any]) -> NDArray[Any]:
        return self.places(positions, kind).read(self.data)

    def integers(self, positions: NDArray[np.int64], kind: np.dtype[Any]) -> NDArray[np.int64]:
        return self.read(positions, kind).astype(np.int64)


class _Text:
    """Each row is a line."""

    def __init__(self, data: bytes, at: int) -> None:
        self.data = data
        self.spans = kernels.find_words(data, at, len(data))
        raw = np.frombuffer(data, dtype=np.uint8)
        breaks = np.flatnonzero((raw == ord("\n")) | (raw == ord("\r")))
        starts = np.searchsorted(self.spans[:, 0], breaks[np.searchsorted(breaks, at) :])
        words = np.concatenate([[0], starts, [len(self.spans)]])
        self.lines = words[np.diff(words, append=-1) != 0]  # the first word of each line, and their number

    def width(self, kind: np.dtype[Any]) -> int:
        return 1

    def anchors(self, element: _Element) -> NDArray[np.int64]:
        if element.rows >= len(self.lines):
            raise _truncated(element)
        begin, end = self.lines[: element.rows], self.lines[1 : element.rows + 1]
        lists, tail = element.steps(self.width)
        found = [begin]
        for gap, _ in lists:
            at = found[-1] + gap
            self._check(at < end, end, element)
            length = integers_at(self.data, self.spans[at])
            self._check((length >= 0) & (length < end - at), end, element)
            found.append(at + 1 + length)
        self._check(found[-1] + tail == end, end, element)
        self.lines = self.lines[element.rows :]
        return np.stack(found, axis=1)

    def _check(self, good: NDArray[np.bool_], end: NDArray[np.int64], element: _Element) -> None:
        """Complain of a line that has too few numbers, or too many."""
        if good.all():
            return
        last = int(end[good.argmin()])
        if last == len(self.spans):
            raise _truncated(element)
        at, what = int(self.spans[last - 1, 0]), f"not as many numbers as the element {element.name!r} declares"
        raise in_line(self.data, at, what)

    def places(self, positions: NDArray[np.int64], kind: np.dtype[Any]) -> Places:
        return Places.of_text(self.spans[positions], kind.str)

    def read(self, positions: NDArray[np.int64], kind: np.dtype[Any]) -> NDArray[Any]:
        values = numbers_at(self.data, self.spans[positions], kind if kind.kind == "f" else np.dtype("f8"))
        with np.errstate(invalid="ignore"):
            cast = values.astype(kind)
        return cast if kind.kind == "f" or (cast == values).all() else values

    def integers(self, positions: NDArray[np.int64], kind: np.dtype[Any]) -> NDArray[np.int64]:
        return integers_at(self.data, self.spans[positions])


@dataclass(frozen=True, eq=False)
class _Table:
    """The rows of an element in the body."""

    element: _Element
    body: _Binary | _Text
    anchors: NDArray[np.int64]

    def positions(self, wanted: _Property) -> NDArray[np.int64]:
        """Where a property begins (rows,): a number, or the length of a list."""
        column = offset = 0
        for one in self.element.properties[: self.element.properties.index(wanted)]:
            column, offset = (column, offset + self.body.width(one.kind)) if not one.listed else (column + 1, 0)
        return self.anchors[:, column] + offset

    def scalars(self, *without: str) -> dict[str, NDArray[Any]]:
        """Read the properties that are no lists, but for those that cannot be read."""
        found = {}
        for one in self.element.properties:
            if not one.listed and one.name not in without:
                with suppress(ReadError):
                    found[one.name] = self.body.read(self.positions(one), one.kind)
        return found

    def runs(self) -> Iterator[_Run]:
        """Group the rows by their number of vertices."""
        corners = self.element.named(*_CORNERS[self.element.name])
        if corners and corners[0].listed:
            one = corners[0]
            lengths = self.body.integers(self.positions(one), one.length)
            first = self.positions(one) + self.body.width(one.length)
            for count in np.unique(lengths[lengths > 0]).tolist():
                rows = np.flatnonzero(lengths == count)
                where = first[rows, None] + self.body.width(one.kind) * np.arange(count)
                yield _Run(self, _CELLS.get(count, "polygon"), rows, where, one.kind)
        elif len(corners) == 2 and corners[0].kind == corners[1].kind and not any(one.listed for one in corners):
            where = np.stack([self.positions(one) for one in corners], axis=1)
            yield _Run(self, "line", np.arange(len(where)), where, corners[0].kind)
        elif self.element.name == "face" and self.element.rows:
            raise ReadError(f"is not a readable ply file: its element {self.element.name!r} names no vertices")


class _Run(NamedTuple):
    """Cells with the same number of vertices, and the positions (m, k) of these."""

    table: _Table
    type: str
    rows: NDArray[np.int64]
    positions: NDArray[np.int64]
    kind: np.dtype[Any]

    @property
    def by_corner(self) -> bool:
        """Whether there are other lists, as those of texture coordinates are."""
        return sum(one.listed for one in self.table.element.properties) > 1


def _refuse() -> Places:
    raise ReadError("has data for the corners of faces, which would be those of others if faces were renumbered")


def parse(data: bytes) -> Source | None:
    """Read vertices, faces and edges; None where faces come as strips, or coordinates or corners are of odd types."""
    header = _header(data)
    if "tristrips" in header.elements:
        return None
    axes = _axes(header.elements["vertex"])
    tables = _tables(data, header)
    vertex = tables["vertex"]
    runs = [run for name in _CORNERS if name in tables for run in tables[name].runs()]
    if len({one.kind for one in axes}) != 1 or axes[0].kind.kind != "f" or any(run.kind.kind == "f" for run in runs):
        return None
    coordinates = _coordinates(vertex, axes)
    cells = [Cells(run.type, vertex.body.integers(run.positions, run.kind), run.rows) for run in runs]
    corners = [_refuse if run.by_corner else partial(vertex.body.places, run.positions, run.kind) for run in runs]
    layout = InPlace(data, coordinates, corners)
    return Source(coordinates.read(data), cells, layout, lambda: _arrays(vertex, runs), untold=_untold(header))


def promoted(data: bytes) -> bytes:
    """Return the file with coordinates in double: the type of the three properties, and in binary their numbers."""
    header = _header(data)
    axes = [one for one in _axes(header.elements["vertex"]) if one.kind == np.dtype("f4")]
    if not axes:
        return data
    vertex = _tables(data, header)["vertex"]
    words = [b"float64" if data[slice(*one.declared)] == b"float32" else b"double" for one in axes]
    ends = np.cumsum([0, *map(len, words)])
    edits = [Edits(np.array([one.declared for one in axes]), b"".join(words), pairs(ends))]
    if header.order:
        numbers = _coordinates(vertex, axes)
        with np.errstate(invalid="ignore"):  # signalling NaN
            wide = numbers.read(data).astype(f"{header.order}f8").tobytes()
        edits.append(Edits(numbers.spans.reshape(-1, 2), wide, pairs(np.arange(0, len(wide) + 1, 8))))
    return apply(data, edits)


def _header(data: bytes) -> _Header:
    begin = _BEGIN.match(data)
    if begin is None:
        raise ReadError("is not a readable ply file: its first line is not 'ply'")
    end = _END.search(data)
    if end is None:
        raise ReadError("is truncated: its header does not end")
    order, elements, remarks = None, dict[str, _Element](), False
    for line in _LINE.finditer(data, begin.end(), end.start()):
        match line[0].split():
            case []:
                pass
            case [b"comment" | b"obj_info", *_]:
                remarks = True
            case [b"format", name, b"1.0"] if name in _ORDERS:
                order = _ORDERS[name]
            case [b"element", name, rows] if rows.isdigit() and len(rows) < 19 and _text(name) not in elements:
                elements[_text(name)] = _Element(_text(name), int(rows))
            case [b"property", kind, name] if elements and kind in _TYPES:
                _declare(elements, line, name, kind)
            case [b"property", b"list", length, kind, name] if elements and length in _INTEGERS and kind in _TYPES:
                _declare(elements, line, name, kind, length)
            case _:
                what = f"{_text(line[0][:60])!r} does not belong into the header of a ply file"
                raise in_line(data, line.start(), what)
    if order is None or "vertex" not in elements:
        raise ReadError(f"is not a readable ply file: it declares no {'vertices' if order is not None else 'format'}")
    # Where lines end with \r, a \n is the first byte of the rows.
    body = end.end() - (end[1] == b"\r\n" and b"\n" not in data[: end.start(1)])
    return _Header(order, elements, remarks, body)


def _declare(
    elements: dict[str, _Element], line: re.Match[bytes], name: bytes, kind: bytes, length: bytes = b""
) -> None:
    """Add a property to the last element."""
    at = line.start() + line[0].rindex(kind, 0, line[0].rindex(name))
    one = _Property(_text(name), _TYPES[kind], bool(length), _TYPES[length or kind], (at, at + len(kind)))
    next(reversed(elements.values())).properties.append(one)


def _text(word: bytes) -> str:
    return word.decode("utf-8", "replace")


def _tables(data: bytes, header: _Header) -> dict[str, _Table]:
    if _SECOND.search(data, header.end):
        raise ReadError("holds several meshes, and one mesh is read: give each a file of its own")
    body = _Binary(data, header.end, header.order) if header.order else _Text(data, header.end)
    filled = [one for one in header.elements.values() if one.properties]
    return {one.name: _Table(one, body, body.anchors(one)) for one in filled}


def _axes(vertex: _Element) -> list[_Property]:
    axes = vertex.named("x", "y", "z")
    if [one.name for one in axes] not in (["x", "y"], ["x", "y", "z"]) or any(one.listed for one in axes):
        raise ReadError("is not a readable ply file: its vertices have no x, y and z")
    return axes


def _coordinates(vertex: _Table, axes: list[_Property]) -> Places:
    return vertex.body.places(np.stack([vertex.positions(one) for one in axes], axis=1), axes[0].kind)


def _arrays(vertex: _Table, runs: list[_Run]) -> Arrays:
    """Numbers of vertices and cells; where only some cells have them, the others have zeros."""
    tables = {id(run.table): run.table.scalars(*_CORNERS["edge"]) for run in runs}
    kinds = {name: values.dtype for table in tables.values() for name, values in table.items()}

    def of(run: _Run, name: str) -> NDArray[Any]:
        values: Mapping[str, NDArray[Any]] = tables[id(run.table)]
        return values[name][run.rows] if name in values else np.zeros(len(run.rows), dtype=kinds[name])

    return Arrays(point=vertex.scalars("x", "y", "z"), cell={name: [of(run, name) for run in runs] for name in kinds})


def _untold(header: _Header) -> tuple[str, ...]:
    known = [one for one in header.elements.values() if one.name in ("vertex", *_CORNERS)]
    lists = [one.name for element in known for one in element.properties if one.listed]
    remarks = ["comments"] if header.remarks else []
    others = [f"elements {name}" for name in header.elements if name not in ("vertex", *_CORNERS)]
    return (*remarks, *others, *(f"lists {name}" for name in lists if name not in _CORNERS["face"]))


def _truncated(element: _Element) -> ReadError:
    rows = counted(element.rows, "row", "rows")
    return ReadError(f"is truncated: it announces {rows} of the element {element.name!r}")
