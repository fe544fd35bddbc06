"""FreeFEM's .msh files: a line of three counts, of vertices, elements and those of the boundary, and a line for each.

A line of a vertex has two or three coordinates and a label, one of an element its vertices and a label. Elements are
triangles in the plane or in space, with edges as their boundary, or tetrahedra, with triangles.

Source: FreeFEM documentation, "Mesh generation", "Data structures and read/write statements for a mesh"; FreeFEM,
"fem.cpp", Mesh::read, and "Mesh3dn.cpp", Mesh3::readmsh.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, IntegerLines, Numbering, Runs, check_blank, integer_lines, lines
from meshfix_cli.meshfile.text import fields_at, in_line, integers, unmarked

_LABEL = "freefem:label"
_TYPES = {2: "line", 3: "triangle", 4: "tetra"}  # by the number of vertices


def parse(data: bytes) -> Source:
    """Read vertices and elements; labels are regions, and those of the boundary sets."""
    text = unmarked(data)
    (n, m, b), at = integers(text, 0, 3)
    vertices = lines(text, at, int(n), "vertex")
    elements = integer_lines(text, vertices.end, int(m), "element")
    boundary = integer_lines(text, elements.end, int(b), "boundary element")
    check_blank(text, boundary.end)
    dimension = int(vertices.counts[0]) - 1 if n else 0
    if dimension not in (2, 3):
        raise in_line(text, at + 1, "a vertex has neither two nor three coordinates and a label")
    coordinates, runs = Places.of_text(vertices.columns(0, dimension)), Runs()
    points, labels = Numbering(np.arange(1, int(n) + 1)), _labels(text, vertices.columns(dimension, dimension + 1))
    size = _add(runs, elements, points, range(3, dimension + 2), named=False)
    _add(runs, boundary, points, [size - 1] if size else range(2, dimension + 1), named=True)
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), partial(_arrays, runs, labels),
        (_LABEL,) if runs.cells else (),
    )  # fmt: skip


def _labels(text: bytes, spans: Int64) -> Int64:
    """Return the labels (n,) of vertices; some programs write them as they write coordinates."""
    found = fields_at(text, spans)[:, 0]
    return np.where(np.abs(found) < 2**53, found, 0).astype(np.int64)


def _add(runs: Runs, table: IntegerLines, points: Numbering, sizes: range | list[int], named: bool) -> int:
    """Add elements that all have as many vertices; return how many these are."""
    counts = table.counts
    if not len(counts):
        return 0
    size = int(counts[0]) - 1
    if size not in sizes or (counts != size + 1).any():
        row = int(np.argmax(counts != counts[0])) if size in sizes else 0
        raise in_line(table.text, table.place(row), f"a line of an element has {counts[row]} numbers")
    ids, labels = np.arange(1, len(counts) + 1), table.integers(size, size + 1)[:, 0]
    vertices, run = points.points_of(table.integers(0, size), ids), len(runs.cells)
    runs.add(Cells(_TYPES[size], vertices, None if named else ids), partial(_corners, table, size), {_LABEL: labels})
    for number in np.unique(labels).tolist() if named else ():
        runs.put(f"boundary {number}", run, np.flatnonzero(labels == number))
    return size


def _corners(table: IntegerLines, size: int) -> Places:
    return Places.of_text(table.columns(0, size), "i8")


def _arrays(runs: Runs, labels: Int64) -> Arrays:
    return replace(runs.arrays(), point={_LABEL: labels})
