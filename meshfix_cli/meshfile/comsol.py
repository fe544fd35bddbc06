"""Comsol's .mphtxt files: objects, of which one is a mesh and others select parts of it; comments stand behind #.

A mesh has points, each as many coordinates as the space has dimensions, and for each type of elements their points, and
the number of the entity of the geometry that each lies in. Points of quadrilaterals and hexahedra run along the axes,
and so do, behind the corners, the other points of elements of second order.

Source: Comsol, "Reference Manual", chapter "The COMSOL File Formats", sections "Mesh" and "Selection"; for the second
order FEconv, "module_utils_mphtxt.f90".
"""

from __future__ import annotations

import re
from functools import partial

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, dimension_of
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, check_blank, rows, without
from meshfix_cli.meshfile.text import Spans, behind_words, in_line, integers

_COMMENT = re.compile(rb"#[^\n\r]*")
_STRING = re.compile(rb"\s*(\d{1,9}) ")
_TYPES = {
    "vtx": "vertex", "edg": "line", "tri": "triangle", "quad": "quad", "tet": "tetra", "pyr": "pyramid",
    "prism": "wedge", "hex": "hexahedron",
}  # fmt: skip
# Which of the points stands in each place of the table of elements; of the second order, all types that are known.
_ORDER = {
    "quad": [0, 1, 3, 2], "pyramid": [0, 1, 3, 2, 4], "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6],
    "line3": [0, 1, 2], "triangle6": [0, 1, 2, 3, 5, 4], "quad9": [0, 1, 3, 2, 4, 7, 8, 5, 6],
    "tetra10": [0, 1, 2, 3, 4, 6, 5, 7, 8, 9],
    "hexahedron27": [
        0, 1, 3, 2, 4, 5, 7, 6, 8, 11, 12, 9, 22, 25, 26, 23, 13, 15, 21, 19, 16, 18, 14, 20, 10, 24, 17,
    ],
}  # fmt: skip
_ENTITY = "comsol:entity"
_MOST = 64  # points of an element
_NEWER = 4  # versions of a mesh from which on elements have neither parameters nor the domains on both sides


class _Reader:
    """What stands next in a file."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.text = without(data, _COMMENT, b"#")
        self.at = 3 if data.startswith(b"\xef\xbb\xbf") else 0

    def integers(self, count: int) -> Int64:
        if not 0 <= count <= len(self.text) - self.at:
            raise ReadError(f"is truncated: {count:,} numbers are announced")
        values, self.at = integers(self.text, self.at, count)
        return values

    def integer(self) -> int:
        return int(self.integers(1)[0])

    def string(self) -> str:
        """Read a number of characters, a blank, and these, whatever they are."""
        found = _STRING.match(self.text, self.at)
        if found is None:
            raise in_line(self.text, self.at, "there is no text with its length before it")
        self.at = found.end()
        text = self.data[self.at :].split(b"\n", 1)[0].decode("utf-8", "replace")[: int(found[1])]
        self.at += len(text.encode())
        return text

    def rows(self, count: int, columns: int) -> Spans:
        spans, self.at = rows(self.text, self.at, count, columns)
        return spans

    def skip(self, count: int) -> None:
        end = behind_words(self.text, self.at, count) if 0 < count <= len(self.text) else -1
        if count and end < 0:
            raise ReadError(f"is truncated: {count:,} numbers are announced")
        self.at = max(end, self.at)


def parse(data: bytes) -> Source:
    """Read points and elements of the one mesh; selections are sets."""
    file, runs, points = _Reader(data), Runs(), None
    file.skip(2)
    tags = [file.string() for _ in range(file.integer())]
    kinds = [file.string() for _ in range(file.integer())]
    unread: list[str] = []
    for _ in tags or kinds:
        file.skip(3)
        kind = file.string()
        if kind == "Mesh":
            if points is not None:
                raise ReadError("holds several meshes, and one mesh is read: give each a file of its own")
            points = _mesh(file, runs)
        elif kind == "Selection":
            _select(file, runs)
        else:
            unread.append(f"object {kind}")  # and what is behind it, as it does not tell its length
            break
    if points is None:
        raise ReadError("holds no mesh" + (f", but {unread[0]}, which is not read" if unread else ""))
    if not unread:
        check_blank(file.text, file.at)
    coordinates = Places.of_text(points)
    arrays = runs.arrays()
    return Source(
        coordinates.read(file.text), runs.cells, InPlace(data, coordinates, runs.corners), lambda: arrays,
        (_ENTITY,) * (_ENTITY in arrays.cell), untold=("comments",) * (file.text is not data) + tuple(unread),
    )  # fmt: skip


def _mesh(file: _Reader, runs: Runs) -> Spans:
    """Read a mesh; return the spans (n, d, 2) of its coordinates."""
    version, dimension, count, first = file.integers(4).tolist()
    if dimension not in (2, 3):
        raise ReadError(f"holds a mesh in {dimension} dimensions")
    points = file.rows(count, dimension)
    numbering = Numbering(np.arange(first, first + len(points)))
    for _ in range(file.integer()):
        name, size, number = file.string(), file.integer(), file.integer()
        shape = _TYPES.get(name.rstrip("2"), "")
        if not shape or not ELEMENTS[shape].nodes <= size <= _MOST:
            raise in_line(file.text, file.at, f"elements of the type {name!r} with {size} points are not known")
        second = f"{shape}{size}"
        key = shape if size == ELEMENTS[shape].nodes else second if second in _ORDER else f"{shape}_of_{size}"
        order, begin = np.array(_ORDER.get(key, range(size))), file.at
        vertices = numbering.points_of(file.integers(number * size).reshape(number, size)[:, order])
        if version < _NEWER:
            file.skip(int(np.prod(file.integers(2))))
        entities = file.integers(file.integer())
        if version < _NEWER:
            file.skip(2 * file.integer())
        if len(entities) not in (0, number):
            raise in_line(file.text, begin, f"{number:,} elements have {len(entities):,} numbers of entities")
        runs.add(
            Cells(key, vertices), partial(_corners, file.text, begin, number, order),
            {_ENTITY: entities} if len(entities) else {},
        )  # fmt: skip
    highest = max((dimension_of(run.type) for run in runs.cells), default=0)
    _select_all(runs, highest - 1)
    return points


def _corners(text: bytes, begin: int, number: int, order: Int64) -> Places:
    return Places.of_text(rows(text, begin, number, len(order))[0][:, order], "i8")


def _select_all(runs: Runs, dimension: int) -> None:
    """Give each entity of the boundary a name."""
    for run, labels in _entities(runs, dimension):
        for number in np.unique(labels).tolist():
            runs.put(f"boundary {number}", run, np.flatnonzero(labels == number))


def _select(file: _Reader, runs: Runs) -> None:
    """Read a selection: its name, the mesh it belongs to, its dimension, and numbers of entities."""
    file.skip(1)
    name, _ = file.string(), file.string()
    dimension, count = file.integers(2).tolist()
    entities = file.integers(count)
    for run, labels in _entities(runs, dimension):
        runs.put(name, run, np.flatnonzero(np.isin(labels, entities)))


def _entities(runs: Runs, dimension: int) -> list[tuple[int, Int64]]:
    """Return the numbers of entities of the runs of a dimension."""
    found = runs.arrays().cell.get(_ENTITY, [])
    return [(i, labels) for i, labels in enumerate(found) if dimension_of(runs.cells[i].type) == dimension]
