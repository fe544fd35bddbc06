"""What VTK's XML files of grids that have points of their own share: their pieces, and how they are written back.

Arrays are text, base64 or raw, and the latter two plain or compressed; one in which nothing changes keeps its bytes.
The attributes RangeMin and RangeMax of the points, and the range among their information keys, stay as they were,
though they tell of the coordinates: VTK does not trust them either.

Source: VTK documentation, "VTK File Formats", section XML Formats.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import Arrays, Source, ghost_vertices, regions_among
from meshfix_cli.meshfile.splice import Points, Turned, differing
from meshfix_cli.meshfile.vtk.arrays import Payload
from meshfix_cli.meshfile.vtk.cells import (
    Run,
    groups_among,
    is_of_group,
    markings,
    runs,
    sets_among,
    sets_of_runs,
)
from meshfix_cli.meshfile.vtk.xml import Element, XmlFile

# What VTK and its readers call the numbers of points that are those of all pieces, where it is not declared.
GLOBAL_IDS = ("GlobalPointIds", "GlobalNodeId", "GlobalNodeIds", "vtkGlobalPointIds", "vtkGlobalIds")


class DataSet(NamedTuple):
    """A type of data sets.

    Attributes
    ----------
    tag : str
    counts : callable
        (piece, as an element) -> how many points and cells it has.
    cells : callable
        (file, pieces) -> the cells of all of them.
    oriented : bool
        See `source.Source`.
    """

    tag: str
    counts: Callable[[Element], tuple[int, int]]
    cells: Callable[[XmlFile, Sequence[Piece]], Cells]
    oriented: bool = True


def parse(data: bytes, kind: DataSet) -> Source:
    """Read points and cells of all pieces."""
    file = XmlFile.parse(data)
    pieces = _pieces(file, kind)
    shares = [Share(piece.only("Points"), 3 * piece.before, 3 * piece.points) for piece in pieces if piece.points]
    kinds = {(share.array.kind, share.array.attributes.get("NumberOfComponents")) for share in shares}
    if kinds not in (set(), {("f4", "3")}, {("f8", "3")}):
        raise ReadError("is not a readable VTK file: its points are not three Float32, or three Float64, each")
    numbers = [file.numbers(share.array, share.size).read() for share in shares]
    cells = kind.cells(file, pieces)
    if any(file.shares(share.array) for share in (*shares, *cells.shares)):
        raise ReadError("has points or vertices that share their bytes with another array, which meshfix does not read")
    points = np.concatenate(numbers or [np.empty(0)]).reshape(-1, 3)
    old = re.match(r"[01](?!\d)|2\.0", file.root.attributes.get("version", "0.1")) is not None
    found = runs(cells.types, cells.offsets, cells.connectivity, old)
    starts = [cells.offsets[run.rows] for run in found]
    layout = _Layout(file, points.dtype, shares, cells.shares, starts, [run.order for run in found])
    about = _about(file, kind.tag)
    load = cache(lambda: _arrays(file, pieces, found, cells.order, about))
    labels = {array.name for piece in pieces for array in piece.arrays("CellData")}
    damaged = "is not a readable VTK file: its cell data {} are damaged, or not those of all pieces"
    regions, marked = markings(labels, [run.cells for run in found], lambda: load().cell, damaged)
    held, untold = ghost_vertices(marked, len(points)), _untold(file, pieces, kind.tag, about)
    return Source(
        points, marked, layout, load, regions, held, untold, numbers=lambda: _global_ids(file, pieces),
        oriented=kind.oriented,
    )  # fmt: skip


def promoted(data: bytes, kind: DataSet) -> bytes:
    """Return the file with coordinates in float64."""
    file = XmlFile.parse(data)
    edits = []
    for piece in _pieces(file, kind):
        array = piece.only("Points") if piece.points else None
        if array is not None and array.kind == "f4":
            edits.append(file.attribute(array, "type", "Float64"))
            numbers = file.numbers(array, 3 * piece.points)
            if isinstance(numbers, Payload):
                edits.append(numbers.widened())
    return file.edited(edits)


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece, its number of points and cells, and the number of points before."""

    element: Element
    points: int
    cells: int
    before: int

    def arrays(self, section: str) -> list[Element]:
        """Return the arrays of a section."""
        return self.element.named(section, "DataArray")

    def only(self, section: str, name: str | None = None) -> Element:
        """Return the one array that a section has, or has of a name."""
        found = [array for array in self.arrays(section) if name in (None, array.name)]
        if len(found) != 1:
            what = f"{section} {name}" if name else section
            raise ReadError(f"is not a readable VTK file: a piece has {len(found)} arrays for its {what}")
        return found[0]


class Share(NamedTuple):
    """An array of a piece, as part of that of all pieces: where its numbers begin there, and how many they are."""

    array: Element
    first: int
    size: int


class Cells(NamedTuple):
    """The cells of all pieces as `cells.runs` takes them.

    Attributes
    ----------
    types, offsets, connectivity : (m,), (m+1,), (k,) int64
    shares : sequence of Share
        The parts of the connectivity; none where cells cannot be renumbered.
    order : (m,) int64 or None
        Which row of the data of cells, those of all pieces one after the other, belongs to each; None: its own.
    """

    types: NDArray[np.int64]
    offsets: NDArray[np.int64]
    connectivity: NDArray[np.int64]
    shares: Sequence[Share]
    order: NDArray[np.int64] | None = None


@dataclass(frozen=True, eq=False)
class _Layout:
    """Where the pieces hold their numbers.

    Attributes
    ----------
    file : XmlFile
    dtype : numpy dtype
        Of the coordinates.
    points, connectivity : sequence of Share
    starts : sequence of (m,) int64
        For each run of cells where they begin in the connectivity.
    orders : sequence
        See `cells.Run`.
    """

    file: XmlFile
    dtype: np.dtype[Any]
    points: Sequence[Share]
    connectivity: Sequence[Share]
    starts: Sequence[NDArray[np.int64]]
    orders: Sequence[Sequence[int] | None]

    def rounded(self, points: Points) -> Points:
        """Return points (n, 3) as the file can hold them."""
        return points.astype(self.dtype)

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the file with other points (n, 3), and with some cells turned."""
        which, values = differing(original, points).reshape(-1, 1), points.reshape(-1, 1)
        edits = []
        for share in self.points:
            here = slice(share.first, share.first + share.size)
            if which[here].any():
                numbers = self.file.numbers(share.array, share.size)
                places = numbers.places(np.arange(share.size)[:, None])
                edits.append(numbers.edited(places.replace(which[here], values[here])))
        if reversed_cells and not self.connectivity:
            raise ReadError("has points in order, and its cells cannot be renumbered one by one")
        there, here = self._turned(reversed_cells)
        for share in self.connectivity:
            which = (there >= share.first) & (there < share.first + share.size)
            if which.any():
                numbers = self.file.numbers(share.array, share.size)
                new, old = (numbers.places((at[which] - share.first)[:, None]) for at in (there, here))
                edits.append(numbers.edited(new.copied(numbers.body, old)))
        return self.file.edited(edits)

    def _turned(self, reversed_cells: Mapping[int, Turned]) -> NDArray[np.int64]:
        """(2, k) int64: where in the connectivity another vertex will stand, and where each of these stands now."""
        parts = [
            (self.starts[run][cells.rows][:, None] + _placed(cells.places, self.orders[run])[:, None]).reshape(2, -1)
            for run, cells in reversed_cells.items()
        ]
        return np.concatenate([np.empty((2, 0), dtype=np.int64), *parts], axis=1)


def _placed(places: NDArray[np.int64], order: Sequence[int] | None) -> NDArray[np.int64]:
    """Return where places of VTK's order are in the file."""
    return places if order is None else np.array(order, dtype=np.int64)[places]


def _pieces(file: XmlFile, kind: DataSet) -> list[Piece]:
    grids = file.root.named(kind.tag)
    if file.root.tag != "VTKFile" or len(grids) != 1:
        raise ReadError(f"is not a readable VTK file: it holds no {kind.tag}")
    pieces: list[Piece] = []
    before = 0
    for element in grids[0].named("Piece"):
        pieces.append(Piece(element, *kind.counts(element), before))
        before += pieces[-1].points
    return pieces


def listed(
    file: XmlFile,
    parts: Iterable[tuple[Piece, str, int]],
    types_of: Callable[[Piece, str, NDArray[np.int64]], NDArray[np.int64]],
) -> Cells:
    """Read cells, with the vertices numbered as the points of all pieces are.

    Parameters
    ----------
    parts : iterable of (Piece, str, int)
        Where they are: a piece, a section of it, and how many cells this has.
    types_of : callable
        (piece, section, (m,) how many vertices each cell has) -> their types.
    """
    none = np.empty(0, dtype=np.int64)
    types, offsets, connectivity = [none], [np.zeros(1, dtype=np.int64)], [none]
    shares: list[Share] = []
    for piece, section, count in parts:
        if not count:
            continue
        ends, corners = (piece.only(section, name) for name in ("offsets", "connectivity"))
        first = int(offsets[-1][-1])
        offsets.append(integers(file, ends, count) + first)
        types.append(types_of(piece, section, np.diff(offsets[-1], prepend=first)))
        shares.append(Share(corners, first, max(int(offsets[-1][-1]) - first, 0)))
        vertices = integers(file, corners, shares[-1].size)
        outside = (vertices < 0) | (vertices >= piece.points)
        if piece.before or outside.any():
            vertices = np.where(outside, -1, vertices + piece.before)
        connectivity.append(vertices)
    return Cells(np.concatenate(types), np.concatenate(offsets), np.concatenate(connectivity), shares)


def integers(file: XmlFile, array: Element, size: int) -> NDArray[np.int64]:
    """Return the integers (size,) of an array."""
    if array.kind is None or array.kind[0] == "f":
        raise ReadError(f"is not a readable VTK file: its array {array.name!r} does not hold integers")
    return file.numbers(array, size).read().astype(np.int64, copy=False)


def _global_ids(file: XmlFile, pieces: Sequence[Piece]) -> NDArray[np.int64] | None:
    """Return the array that the point data declare to hold the numbers of the points, or one of a name that does."""
    found = []
    for piece in (piece for piece in pieces if piece.points):
        declared = [section.attributes.get("GlobalIds", "") for section in piece.element.named("PointData")]
        arrays = {array.name: array for array in piece.arrays("PointData")}
        names = [name for name in (*declared, *GLOBAL_IDS) if name in arrays]
        if not names:
            return None
        found.append(integers(file, arrays[names[0]], piece.points))
    return np.concatenate(found) if found else None


def _about(file: XmlFile, tag: str) -> dict[str, NDArray[Any]]:
    """Return the field data that may be the numbers and dimensions of groups."""
    found = {}
    for array in file.root.named(tag, "FieldData", "DataArray"):
        if array.kind and array.attributes.get("NumberOfTuples", "").strip() == "2":
            with suppress(ReadError):
                found[array.name] = _values(file, array, 2)
    return {name: values for name, values in found.items() if is_of_group(values)}


def _arrays(
    file: XmlFile,
    pieces: Sequence[Piece],
    found: Sequence[Run],
    order: NDArray[np.int64] | None,
    about: Mapping[str, NDArray[Any]],
) -> Arrays:
    point = _joined(file, [(piece.arrays("PointData"), piece.points) for piece in pieces if piece.points])
    cell = _joined(file, [(piece.arrays("CellData"), piece.cells) for piece in pieces if piece.cells])
    unread = [
        f"{kind} data {array.name}"
        for kind, section, read in (("point", "PointData", point), ("cell", "CellData", cell))
        for piece in pieces
        for array in piece.arrays(section)
        if array.name not in read
    ]
    rows = [run.rows if order is None else order[run.rows] for run in found]
    by_run = {name: [values[here] for here in rows] for name, values in cell.items()}
    groups = groups_among(about, regions_among(cell))
    return Arrays(point, by_run, groups, sets_among(point), sets_of_runs(by_run), tuple(dict.fromkeys(unread)))


def _joined(file: XmlFile, parts: Iterable[tuple[Sequence[Element], int]]) -> dict[str, NDArray[Any]]:
    """Read, and join, the arrays that all pieces have; those that are damaged are left out."""
    tables: list[dict[str, NDArray[Any]]] = []
    for arrays, rows in parts:
        tables.append({})
        for array in arrays:
            with suppress(ReadError):
                tables[-1][array.name] = _values(file, array, rows)
    joined = {}
    for name in tables[0] if tables else ():
        found = [table[name] for table in tables if name in table]
        if len(found) == len(tables) and len({values.shape[1:] for values in found}) == 1:
            joined[name] = np.concatenate(found)
    return joined


def _values(file: XmlFile, array: Element, rows: int) -> NDArray[Any]:
    """Return the numbers (rows,) or (rows, k) of an array."""
    columns = array.count("NumberOfComponents") if array.attributes.get("NumberOfComponents") else 1
    values = file.numbers(array, rows * columns).read().astype(array.kind, copy=False)
    return values if columns == 1 else values.reshape(rows, columns)


def _untold(file: XmlFile, pieces: Sequence[Piece], tag: str, about: Mapping[str, NDArray[Any]]) -> tuple[str, ...]:
    sections = [one for piece in pieces for one in piece.element.children if one.tag in ("PointData", "CellData")]
    found = {
        "comments": file.comments,
        "field data": any(
            array.name not in about for one in file.root.named(tag, "FieldData") for array in one.children
        ),
        "strings and bits": any(array.kind is None for section in sections for array in section.children),
    }
    return tuple(name for name, there in found.items() if there)
