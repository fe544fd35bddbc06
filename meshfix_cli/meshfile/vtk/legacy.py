"""Legacy .vtk files: unstructured and structured grids, and polydata, as text and binary, of versions 1.0 to 5.1.

Source: "VTK File Formats", section Simple Legacy Formats; what that leaves open, as VTK's own reader has it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import Arrays, Cells, Source, ghost_vertices, regions_among
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import chain
from meshfix_cli.meshfile.vtk.cells import (
    POLYDATA,
    TYPES,
    Run,
    groups_among,
    in_rows,
    is_of_group,
    markings,
    runs,
    sets_among,
    sets_of_runs,
    types_of_sizes,
)  # fmt: skip
from meshfix_cli.meshfile.vtk.sections import Array, Sections, find_sections

_POLYHEDRON = 42
_OLD = re.compile(rb"(?:\xef\xbb\xbf)?\s*# vtk DataFile Version\s+(?:[0-4](?!\d)|5\.0)")

Integers = NDArray[np.int32] | NDArray[np.int64]


def parse(data: bytes) -> Source | None:
    """Read points and cells; None where the dataset is of another type, or the points are integers."""
    found = find_sections(data)
    if found is None:
        return None
    points = found.points
    if points is None:
        raise ReadError("is truncated: the section POINTS is missing")
    if points.kind not in ("f4", "f8"):
        return None
    old = _OLD.match(data) is not None
    pairs = [(table, run) for table in _tables(found) for run in runs(table.types, table.offsets, table.vertices, old)]
    layout = InPlace(data, points.rows(), [table.places(run) for table, run in pairs])
    rows = [table.first + run.rows if table.first else run.rows for table, run in pairs]
    load = cache(partial(_arrays, found, points.tuples, rows))
    named = {array.name for array in found.arrays[b"cell_data"]}
    damaged = "is not a readable vtk file: its cell data {} cannot be read"
    found_cells = [_cells(*pair, here) for pair, here in zip(pairs, rows, strict=True)]
    regions, cells = markings(named, found_cells, lambda: load().cell, damaged)
    held = ghost_vertices(cells, points.tuples)
    others = len(_about(found)) < len(found.arrays[b"dataset"])
    untold = dict.fromkeys(["field data"] * others + found.untold)
    return Source(
        points.values().reshape(-1, 3), cells, layout, load, regions, held, tuple(untold),
        oriented=found.dataset != b"structured_grid",  # indices may run either way
    )  # fmt: skip


def promoted(data: bytes) -> bytes:
    """Return the file with points of type double."""
    found = find_sections(data)
    points = found.points if found else None
    if found is None or points is None or points.kind != "f4":
        return data
    kind, behind = found.points_kind, found.points_kind + len(b"float")
    numbers = points.values().astype(">f8").tobytes() if points.binary else data[points.begin : points.end]
    return data[:kind] + b"double" + data[behind : points.begin] + numbers + data[points.end :]


class _Table(NamedTuple):
    """A section of cells: cell i is the `first + i`-th of the file and has the vertices from `offsets[i]` on.

    `numbers` are the vertices as the file holds them, with `gap` (0 or 1) other numbers before each cell;
    None: it does not.
    """

    first: int
    types: Integers
    offsets: NDArray[np.int64]
    vertices: Integers
    numbers: Array | None
    gap: int

    def places(self, run: Run) -> Callable[[], Places]:
        """Return what tells where the vertices of a run stand, and keeps none of the large arrays where it is whole."""
        numbers = self.numbers
        if numbers is None:
            return _not_turned
        (count, size), rows = run.vertices.shape, run.rows
        if run.order is not None:
            before = self.offsets[rows] + self.gap * (rows + 1)
            return lambda: _places(numbers, lambda: before, size).at((slice(None), run.order))
        if count and rows[-1] - rows[0] == count - 1:
            first, step = int(self.offsets[rows[0]] + self.gap * (rows[0] + 1)), size + self.gap
            return partial(_places, numbers, lambda: first + step * np.arange(count), size)
        before = self.offsets[rows] + self.gap * (rows + 1)
        return partial(_places, numbers, lambda: before, size)


def _not_turned() -> Places:
    raise ReadError("has points in order, and its cells cannot be renumbered one by one")


def _places(numbers: Array, first: Callable[[], NDArray[np.int64]], size: int) -> Places:
    """Where the vertices of cells stand, from the first of each on."""
    return numbers.places(first()[:, None] + np.arange(size))


def _tables(found: Sections) -> list[_Table]:
    """The sections of cells, in the order in which VTK counts their cells."""
    if found.dataset == b"structured_grid":
        if found.points is None or math.prod(found.shape) != found.points.tuples or min(found.shape, default=0) < 1:
            raise ReadError("is not a readable vtk file: its dimensions do not fit the number of its points")
        return [_Table(0, *in_rows(found.shape), None, 0)]
    tables: list[_Table] = []
    for keyword in POLYDATA if found.dataset == b"polydata" else (b"cells",):
        if keyword in found.cells:
            first = tables[-1].first + len(tables[-1].types) if tables else 0
            tables.append(_table(first, keyword, found))
    if not tables:
        raise ReadError("there are no cells in it")
    return tables


def _table(first: int, keyword: bytes, found: Sections) -> _Table:
    count, where, array = found.cells[keyword]
    types, numbers = None, _integers(array)
    if keyword not in POLYDATA:
        if found.types is None:
            raise ReadError("is truncated: the section CELL_TYPES is missing")
        types = _integers(found.types)
    if where is None:
        offsets, numbers = _split(numbers, count, types)
    else:
        offsets = _integers(where).astype(np.int64)
        ends = [offsets[0], offsets.min(), offsets.max(), offsets[-1]]
        if ends != [0, 0, len(numbers), len(numbers)]:
            raise ReadError("is not a readable vtk file: the offsets of its cells do not fit their vertices")
    if types is None:
        types = types_of_sizes(np.diff(offsets), *POLYDATA[keyword])
    return _Table(first, types, offsets, numbers, array, int(where is None))


def _integers(array: Array) -> Integers:
    values = array.values()
    if values.dtype.kind == "f":
        raise ReadError("is not a readable vtk file: its cells are not integers")
    return values if values.dtype == np.int32 else values.astype(np.int64)


def _split(numbers: Integers, count: int, types: Integers | None) -> tuple[NDArray[np.int64], Integers]:
    """Separate the numbers of vertices, of which they give the offsets (count+1,), from the vertices."""
    each, rest = divmod(len(numbers), max(count, 1))
    if count and each and not rest and (numbers[::each] == each - 1).all():
        return np.arange(count + 1) * (each - 1), numbers.reshape(count, each)[:, 1:].ravel()
    starts = _starts(numbers, count, types)
    vertices = np.delete(numbers, starts).view(numbers.dtype)
    return np.concatenate([[0], np.cumsum(numbers[starts], dtype=np.int64)]), vertices


def _starts(numbers: Integers, count: int, types: Integers | None) -> NDArray[np.int64]:
    """Where, among numbers, stands that of the vertices of each cell."""
    if types is not None and len(types) == count:
        kinds, which = np.unique(types, return_inverse=True)
        sizes = np.array([TYPES.get(kind, ("", 0))[1] for kind in kinds.tolist()])[which]
        ends = np.cumsum(sizes + 1)
        if sizes.all() and ends[-1:] == len(numbers) and (numbers[ends - sizes - 1] == sizes).all():
            return ends - sizes - 1
    return chain(numbers, count, "the numbers of vertices of its cells do not add up")


def _cells(table: _Table, run: Run, ids: NDArray[np.int64]) -> Cells:
    polyhedra = len(run.rows) and table.types[run.rows[0]] == _POLYHEDRON
    vertices = [_of_polyhedron(faces) for faces in run.vertices] if polyhedra else run.vertices
    return Cells(run.type, vertices, ids)


def _of_polyhedron(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Vertices of a polyhedron; behind the number of its faces it has for each that of its vertices, and these."""
    counts, at = [0], 1
    while at < len(faces) and len(counts) <= faces[0]:
        counts.append(at)
        at += max(int(faces[at]), 0) + 1
    return np.delete(faces, counts) if len(faces) else faces


def _arrays(found: Sections, points: int, rows: Sequence[NDArray[np.int64]]) -> Arrays:
    point = dict(_readable(found.arrays[b"point_data"], points))
    cell = dict(_readable(found.arrays[b"cell_data"], sum(map(len, rows))))
    unread = [f"point data {array.name}" for array in found.arrays[b"point_data"] if array.name not in point]
    unread += [f"cell data {array.name}" for array in found.arrays[b"cell_data"] if array.name not in cell]
    by_run = {name: [values[here] for here in rows] for name, values in cell.items()}
    groups = groups_among(_about(found), regions_among(cell))
    return Arrays(point, by_run, groups, sets_among(point), sets_of_runs(by_run), tuple(unread))


def _about(found: Sections) -> dict[str, NDArray[Any]]:
    """Return the field data that may be the numbers and dimensions of groups."""
    values = dict(_readable(found.arrays[b"dataset"], 2))
    return {name: pair for name, pair in values.items() if is_of_group(pair)}


def _readable(arrays: Sequence[Array], tuples: int) -> Iterator[tuple[str, NDArray[Any]]]:
    """Names and numbers of the arrays that can be read and have the right length."""
    for array in arrays:
        with suppress(ReadError):
            if array.tuples == tuples:
                yield array.name, array.values()
