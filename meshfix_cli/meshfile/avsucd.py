"""AVS's UCD files in text: lines of counts, then of points, then of cells, then of data.

A point has its number and three coordinates, a cell its number, that of its material, a word for its type, and the
numbers of its points. Files of several steps have one mesh if only their data differ.

Source: AVS, "Developer's Guide", section "UCD File Format"; FrontISTR, "User's Manual", section on its results for AVS;
VTK, "vtkAVSucdReader.h".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places, Points
from meshfix_cli.meshfile.tables import (
    Int64,
    IntegerLines,
    Numbering,
    Runs,
    alike,
    check_blank,
    integer_lines,
    lines,
    rows,
    without,
    word_of,
)
from meshfix_cli.meshfile.text import in_line, integers_at

BINARY = b"\7"
_COMMENT = re.compile(rb"(?:\A|(?<=[\n\r]))[ \t]*#[^\n\r]*")
_STEPS = re.compile(rb"\s*(\d+)\s+(data|geom|data_geom)\s+step\d+[^\n\r]*")
_MATERIAL = "avsucd:material"
_TYPES = {
    "pt": "vertex", "line": "line", "tri": "triangle", "quad": "quad", "tet": "tetra", "pyr": "pyramid",
    "prism": "wedge", "hex": "hexahedron",
}  # fmt: skip
# Pyramids begin with their tip. Of the others programs write either of two orders that are mirrors of each other: AVS
# has first what is on top, so that its pyramids have the other orientation than those of programs that have it last.
_TOP_LAST = {"pyramid": [4, 3, 2, 1, 0]}
_TOP_FIRST = {
    "tetra": [0, 1, 3, 2], "pyramid": [1, 2, 3, 4, 0], "wedge": [3, 4, 5, 0, 1, 2],
    "hexahedron": [4, 5, 6, 7, 0, 1, 2, 3],
}  # fmt: skip
_ENOUGH = 1000  # cells of a run tell which order a file has


def parse(data: bytes) -> Source:
    """Read points and cells; what is behind them stays as it is."""
    if data.startswith(BINARY):
        raise ReadError("is a binary file of AVS, which meshfix does not read")
    text = without(data, _COMMENT, b"#")
    counts, at = _counts(text)
    table, at = rows(text, at, counts[0], 4)
    cells = integer_lines(text, at, counts[1], "cell")
    if not any(counts[2:]):
        check_blank(text, cells.end)
    coordinates, points = Places.of_text(table[:, 1:]), Numbering(integers_at(text, table[:, 0]))
    place, runs = coordinates.read(text), Runs()
    found = [(chosen, _cells(cells, chosen, points)) for chosen in _by_type(cells)]
    orders = _TOP_FIRST if sum(_volume(place, run) for _, run in found) < 0 else _TOP_LAST
    for chosen, run in found:
        order = np.array(orders.get(run.type, range(run.vertices.shape[1])))
        ordered = Cells(run.type, run.vertices[:, order] if run.type in orders else run.vertices, run.ids)
        runs.add(ordered, partial(_corners, cells, chosen, order), {_MATERIAL: cells.integers(1, 2, chosen)[:, 0]})
    layout = InPlace(data, coordinates, runs.corners)
    untold = ("comments",) * (text is not data) + ("data of points and cells",) * any(counts[2:])
    numbers = points.numbers
    return Source(place, runs.cells, layout, runs.arrays, (_MATERIAL,), untold=untold, numbers=lambda: numbers)


def _counts(text: bytes) -> tuple[list[int], int]:
    """Read how many points, cells and, perhaps, data there are; the offset behind them."""
    at = 0
    if steps := _STEPS.match(text):
        if steps[2] != b"data" and int(steps[1][:18]) > 1:
            raise ReadError("holds several meshes, and one mesh is read: give each a file of its own")
        at = steps.end()
    line = lines(text, at, 1, "line of counts")
    counts = line.integers(0, max(2, int(line.counts[0])))[0].tolist()
    if min(counts) < 0:
        raise in_line(text, int(line.spans[0, 0]), "a count is negative")
    return counts + [1] * bool(steps), line.end


def _by_type(cells: IntegerLines) -> Iterator[Int64]:
    """Give the rows of cells of one type and number of points."""
    counts = cells.counts
    types = np.where(counts > 2, cells.values[np.minimum(cells.starts[:-1] + 2, len(cells.values) - 1)], 0)
    yield from alike(types, counts)


def _cells(cells: IntegerLines, chosen: Int64, points: Numbering) -> Cells:
    """Read cells of one type and number of points; of those of second order the order of points is not known."""
    size = int(cells.counts[chosen[0]]) - 3
    name = word_of(int(cells.words(2, 3, chosen)[0, 0])) if size > 0 else ""
    shape = _TYPES.get(name.lower().rstrip("2"))
    if shape is None or size < ELEMENTS[shape].nodes:
        at = cells.place(int(chosen[0]))
        raise in_line(cells.text, at, f"cells of the type {name!r} with {max(size, 0)} points are not known")
    key, ids = shape if size == ELEMENTS[shape].nodes else f"{shape}_of_{size}", cells.integers(0, 1, chosen)[:, 0]
    return Cells(key, points.points_of(cells.integers(3, 3 + size, chosen), ids), np.ascontiguousarray(ids))


def _volume(points: Points, run: Cells) -> float:
    """Return the sum of the volumes of some of the cells, as they are numbered."""
    if run.type not in _TOP_FIRST:
        return 0.0
    order = np.array(_TOP_LAST.get(run.type, range(run.vertices.shape[1])))
    corners = points[run.vertices[:_ENOUGH, order][:, ELEMENTS[run.type].shape.simplices[0]]]
    with np.errstate(invalid="ignore", over="ignore"):
        return float(np.nan_to_num(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum())


def _corners(cells: IntegerLines, chosen: Int64, order: Int64) -> Places:
    return Places.of_text(cells.columns(3, 3 + len(order), chosen)[:, order], "i8")
