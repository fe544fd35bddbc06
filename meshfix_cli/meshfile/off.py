"""Geomview's .off files: a keyword, the counts of vertices, faces and edges, then a line for each vertex and each face.

A line of a vertex begins with its coordinates; what stands behind them, in colours, normals and texture coordinates, is
what the letters before OFF tell. One of a face has the number of its vertices, these, and often a colour. The keyword
may be missing, counts may stand behind it in its line, and comments and empty lines anywhere.

Source: Geomview manual, "OFF files"; Princeton Shape Benchmark, "Object File Format".
"""

from __future__ import annotations

import re
from functools import partial

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import (
    Int64,
    IntegerLines,
    Numbering,
    Runs,
    alike,
    check_blank,
    integer_lines,
    lines,
    without,
)
from meshfix_cli.meshfile.text import Spans, in_line

_COMMENT = re.compile(rb"#[^\n\r]*")
_KEYWORD = re.compile(rb"\s*((?:ST)?C?N?4?n?OFF)(?![A-Za-z])[ \t]*(BINARY)?")
_COUNTS = re.compile(rb"\s*(\d{1,18})[ \t]+(\d{1,18})(?:[ \t]+\d+)?[ \t]*(?=[\n\r]|\Z)")
_TYPES = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}


def parse(data: bytes) -> Source:
    """Read vertices and faces; a face of five vertices or more is a polygon."""
    text = without(data, _COMMENT, b"#")
    keyword = _KEYWORD.match(text)
    if keyword and keyword[2]:
        raise ReadError("is a binary file of OFF, which meshfix does not read")
    if keyword and (b"4" in keyword[1] or b"n" in keyword[1]):
        raise ReadError(f"is of the kind {keyword[1].decode()}, which is not read")
    counts = _COUNTS.match(text, keyword.end() if keyword else 0)
    if counts is None:
        raise ReadError("is truncated or not readable: it has no counts of vertices and faces")
    spans, faces, more = _tables(text, counts.end(), int(counts[1]), int(counts[2]))
    coordinates, runs = Places.of_text(spans), _runs(faces, len(spans))
    untold = ("comments",) * (text is not data) + ("colours, normals or texture coordinates",) * more
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays, untold=untold
    )


def _tables(text: bytes, at: int, n: int, m: int) -> tuple[Spans, IntegerLines, bool]:
    """Find coordinates (n, 3, 2) and faces; tell whether there are other numbers behind them."""
    points = lines(text, at, n, "point")
    faces = integer_lines(text, points.end, m, "face")
    _check_end(text, faces.end)
    more = (points.counts > 3).any() or (faces.counts > 1 + faces.integers(0, 1)[:, 0]).any()
    return points.columns(0, 3), faces, bool(more)


def _check_end(text: bytes, end: int) -> None:
    if _KEYWORD.match(text[end:].lstrip()):
        raise ReadError("holds several meshes, and one mesh is read: give each a file of its own")
    check_blank(text, end)


def _runs(faces: IntegerLines, n: int) -> Runs:
    runs, numbering, sizes = Runs(), Numbering(np.arange(n)), faces.integers(0, 1)[:, 0]
    for rows in alike(sizes):
        size = int(sizes[rows[0]])
        if size < 1:
            raise in_line(faces.text, faces.place(int(rows[0])), f"a face has {size} vertices")
        vertices = numbering.points_of(faces.integers(1, 1 + size, rows), rows)
        runs.add(Cells(_TYPES.get(size, "polygon"), vertices, rows), partial(_corners, faces, size, rows))
    return runs


def _corners(faces: IntegerLines, size: int, rows: Int64) -> Places:
    return Places.of_text(faces.columns(1, 1 + size, rows), "i8")
