"""Gambit's neutral files: sections up to a line ENDOFSECTION, of points, elements, groups and boundary conditions.

A line of a point has its number and its coordinates, an element its number, that of its type, how many points it has,
and these, on as many lines as they take; points of quadrilaterals go around, those of hexahedra run along the axes. So
do, among them, the further points of elements of second order. A boundary condition names points, or faces of elements
by their numbers.

Source: Fluent Inc., "GAMBIT Modeling Guide", appendix C, "Neutral file format"; OpenFOAM, "gambitToFoam.L"; for the
second order FEMuS, "GambitIO.cpp".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, straight_key
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import (
    Int64,
    Numbering,
    Runs,
    alike,
    check_blank,
    in_columns,
    right_aligned,
    rows,
    within,
)
from meshfix_cli.meshfile.text import in_line, integers, integers_at

_END = b"ENDOFSECTION"
_COUNTS = re.compile(rb"NDFVL\s*[\n\r]((?:[ \t]*\d{1,18}(?!\d)){5,6})[ \t]*[\n\r]")
_GROUP = re.compile(
    rb"\s*GROUP:[ \t]*(\d{1,18})[ \t]*ELEMENTS:[ \t]*(\d{1,18})[^\n\r]*?NFLAGS:[ \t]*(\d{1,9})[ \t]*"
    rb"(?:\r\n|[\n\r])([^\n\r]*)"
)
_CONDITION = re.compile(rb"\s*(\S[^\n\r]*?)[ \t]+([01])[ \t]+(\d{1,18})[ \t]+(\d{1,9})(?:[ \t]+-?\d+)*[ \t]*(?=[\n\r])")
_REF = "gambit:group"
_TYPES = {1: "line", 2: "quad", 3: "triangle", 4: "hexahedron", 5: "wedge", 6: "tetra", 7: "pyramid"}
# Which of the points stands in each place of the table of elements; of the second order, all types that are known.
_ORDER = {
    "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6], "pyramid": [0, 1, 3, 2, 4],
    "line3": [0, 2, 1], "triangle6": [0, 2, 4, 1, 3, 5], "quad8": [0, 2, 4, 6, 1, 3, 5, 7],
    "quad9": [0, 2, 4, 6, 1, 3, 5, 7, 8], "tetra10": [0, 2, 5, 9, 1, 4, 3, 6, 7, 8],
    "wedge18": [0, 2, 5, 12, 14, 17, 1, 4, 3, 13, 16, 15, 6, 8, 11, 7, 10, 9],
    "hexahedron27": [
        0, 2, 8, 6, 18, 20, 26, 24, 1, 5, 7, 3, 19, 23, 25, 21, 9, 11, 17, 15, 12, 14, 10, 16, 4, 22, 13,
    ],
}  # fmt: skip
# Which places of the table of elements the faces of an element are, by their numbers from 1.
_FACES: dict[str, Sequence[Sequence[int]]] = {
    "line": ((0,), (1,)), "triangle": ((0, 1), (1, 2), (2, 0)), "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((1, 0, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5), (0, 2, 1), (3, 4, 5)),
    "hexahedron": ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (1, 0, 3, 2), (4, 5, 6, 7)),
}  # fmt: skip
_FACETS = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}


class _Section(NamedTuple):
    """A section, and where what stands behind its first line begins and ends."""

    name: str
    begin: int
    end: int


def parse(data: bytes) -> Source:
    """Read points, elements and groups; boundary conditions are sets, and their faces cells of the file."""
    sections, counts = list(_sections(data)), _COUNTS.search(data)
    if counts is None:
        raise ReadError("is not a readable file of Gambit: it has no NUMNP and what follows it")
    n, m, _, _, dimension = (int(word) for word in counts[1].split()[:5])
    if dimension not in (2, 3):
        raise ReadError(f"has points of {dimension} coordinates")
    table = _points(data, sections, n, dimension)
    points, coordinates = Numbering(integers_at(data, table[:, 0])), right_aligned(data, table[:, 1:])
    runs, groups, point_sets = Runs(), list(_groups(data, sections)), dict[str, Int64]()
    for section in (one for one in sections if one.name == "ELEMENTS/CELLS"):
        _add(runs, data, section, m, points, groups)
    elements = list(runs.cells)
    for section in (one for one in sections if one.name == "BOUNDARY CONDITIONS"):
        name, of_faces, listed = _condition(data, section)
        if of_faces:
            _add_faces(runs, elements, name, listed)
        else:
            found = points.rows_of(listed[:, 0])
            point_sets[name] = np.union1d(point_sets.get(name, found[:0]), found[found >= 0])
    read = ("CONTROL INFO", "NODAL COORDINATES", "ELEMENTS/CELLS", "ELEMENT GROUP", "BOUNDARY CONDITIONS")
    others = dict.fromkeys(one.name for one in sections if one.name not in read)
    return Source(
        coordinates.read(data), runs.cells, InPlace(data, coordinates, runs.corners), partial(runs.arrays, point_sets),
        (_REF,) * bool(groups and elements), untold=tuple(f"section {name}" for name in others),
        numbers=lambda: points.numbers,
    )  # fmt: skip


def _sections(data: bytes) -> Iterator[_Section]:
    at = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    while data[at : at + 4096].strip():
        end = data.find(_END, at)
        if end < 0:
            raise ReadError("is truncated: its last section has no ENDOFSECTION")
        words, begin = within(data, at, end), end
        if len(words):
            line = re.compile(rb"[^\n\r]*").match(data, int(words[0, 0]), end)
            assert line is not None
            begin = line.end()
            yield _Section(re.sub(r"\s+[\d.]+\s*$", "", line[0].decode("latin-1")).strip().upper(), begin, end)
        at = end + len(_END)


def _points(data: bytes, sections: Sequence[_Section], n: int, dimension: int) -> Int64:
    """Find the words (n, 1 + dimension, 2) of points."""
    section = next((one for one in sections if one.name == "NODAL COORDINATES"), None)
    if section is None:
        raise ReadError("is not a readable file of Gambit: it has no NODAL COORDINATES")
    table, end = rows(data, section.begin, n, 1 + dimension)
    if end > section.end:
        raise ReadError(f"is truncated: {n:,} points are announced, and not all are there")
    check_blank(data, end, section.end)
    return table


def _groups(data: bytes, sections: Sequence[_Section]) -> Iterator[tuple[int, str, Int64]]:
    """Give the numbers, the names and the elements of groups."""
    for section in (one for one in sections if one.name == "ELEMENT GROUP"):
        head = _GROUP.match(data, section.begin, section.end)
        if head is None:
            raise in_line(data, section.end, "a group has no number, or not the number of its elements")
        flags, count = int(head[3]), int(head[2])
        listed = integers_at(data, within(data, head.end(), section.end))
        if len(listed) != flags + count:
            raise in_line(data, section.end, f"a group has not the {count:,} elements that it announces")
        yield int(head[1]), head[4].decode("utf-8", "replace").strip() or f"group {int(head[1])}", listed[flags:]


def _add(
    runs: Runs, data: bytes, section: _Section, m: int, points: Numbering, groups: Sequence[tuple[int, str, Int64]]
) -> None:
    """Add the elements."""
    values, end, _ = kernels.scan_integers(data[section.begin : section.end], 0, section.end - section.begin)
    if data[section.begin + end : section.end].strip():
        integers(data, section.begin + end, 1)  # which says what it is
    starts, at, view = [], 0, values.data
    while at + 2 < len(view):
        starts.append(at)
        at += 3 + max(view[at + 2], 0)
    if len(starts) != m or at != len(view):
        raise ReadError(f"is not a readable file: there are not the {m:,} elements that it announces")
    first = np.array(starts, dtype=np.int64)
    ids, types, sizes = (values[first + i].astype(np.int64) for i in range(3))
    for here in alike(types, sizes):
        shape, size = _TYPES.get(int(types[here[0]]), ""), int(sizes[here[0]])
        if not shape or size < ELEMENTS[shape].nodes:
            raise ReadError(f"has elements of the type {types[here[0]]} with {size} points, which are not known")
        second = f"{shape}{size}"
        key = shape if size == ELEMENTS[shape].nodes else second if second in _ORDER else f"{shape}_of_{size}"
        places = first[here][:, None] + 3 + np.array(_ORDER.get(key, range(size)))
        labels, run = np.zeros(len(here), dtype=np.int64), len(runs.cells)
        members = [np.isin(ids[here], listed) for _, _, listed in groups]
        for (number, _, _), mine in zip(groups, members, strict=True):
            labels[mine] = number
        vertices = points.points_of(values[places].astype(np.int64, copy=False), ids[here])
        corners = partial(_corners, data, section, places)
        runs.add(Cells(key, vertices, ids[here]), corners, {_REF: labels} if groups else {})
        for (_, name, _), mine in zip(groups, members, strict=True):
            runs.put(name, run, np.flatnonzero(mine))


def _corners(data: bytes, section: _Section, places: Int64) -> Places:
    spans = within(data, section.begin, section.end)[places]
    columns = in_columns(data, spans, 8)
    return Places.of_text(spans if columns is None else columns, "i8")


def _condition(data: bytes, section: _Section) -> tuple[str, bool, Int64]:
    """Return the name of a boundary condition, whether it is one of faces, and its rows (k, 3) or (k, 1)."""
    head = _CONDITION.match(data, section.begin, section.end)
    if head is None:
        raise in_line(data, section.end, "a boundary condition has no name, or not the number of its rows")
    of_faces, count, values = head[2] == b"1", int(head[3]), int(head[4])
    columns = 3 if of_faces else 1
    spans = within(data, head.end(), section.end)
    if len(spans) != count * (columns + values):
        raise in_line(data, section.end, f"a boundary condition has not the {count:,} rows that it announces")
    listed = integers_at(data, spans.reshape(count, columns + values, 2)[:, :columns])
    return head[1].decode("utf-8", "replace").strip(), of_faces, listed


def _add_faces(runs: Runs, elements: Sequence[Cells], name: str, listed: Int64) -> None:
    """Take faces, each with the number of its element, that of its type and its own, for cells."""
    found: dict[int, list[Int64]] = {}
    for cells in elements:
        faces = _FACES.get(straight_key(cells.type) or cells.type, ())  # by their corners
        rows = Numbering(cells.ids).rows_of(listed[:, 0]) if cells.ids is not None else listed[:0, 0]
        for number, face in enumerate(faces, start=1):
            here = rows[(rows >= 0) & (listed[:, 2] == number)]
            if len(here):
                found.setdefault(len(face), []).append(cells.vertices[here][:, list(face)])
    for size, parts in found.items():
        runs.add(Cells(_FACETS[size], np.concatenate(parts)), _not_turned, sets=(name,))


def _not_turned() -> Places:
    raise ReadError("has faces of elements, which cannot be renumbered")
