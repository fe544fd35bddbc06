"""GetFEM's mesh files: a list of points, one of convexes, and regions, each between BEGIN and END.

A line of a point is `POINT`, its number and its coordinates, one of a convex `CONVEX`, its number, the name of its
geometric transformation and its points. These lie on a lattice, x fastest, and their order tells no orientation.
A region names convexes, or faces of them by their numbers; the face i of a simplex is opposite to its corner i.

Source: GetFEM, "getfem_mesh.cc", "bgeot_geometric_trans.cc" and "bgeot_convex_structure.cc".
"""

from __future__ import annotations

import re
from functools import partial

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, element_of
from meshfix_cli.mesh.lagrange import lattice
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
from meshfix_cli.meshfile.text import Spans, in_line, integers_at

_COMMENT = re.compile(rb"%[^\n\r]*")
_POINTS, _STRUCTURE = b"POINTS LIST", b"MESH STRUCTURE DESCRIPTION"
_NAME = re.compile(rb"[ \t]'?GT_\S+")
_REGION = re.compile(rb"BEGIN\s+REGION\s+(\d{1,9})(?!\d)(.*?)END\s+REGION", re.DOTALL)
_MEMBER = re.compile(rb"(\d{1,18})(?:/(\d{1,2}))?(?!\S)")
_MOST_NAMES = 99
# Shapes by the name of a transformation and its dimension.
_SHAPES = {
    ("PK", 1): "line", ("PK", 2): "triangle", ("PK", 3): "tetra", ("QK", 1): "line", ("QK", 2): "quad",
    ("QK", 3): "hexahedron", ("PRISM", 3): "wedge",
}  # fmt: skip
_MOST_ORDER = 9
# What lies elsewhere: which of the points stands in each place of the table of elements.
_OTHERS = {
    "PK(0,1)": ("vertex", [0]), "PYRAMID(1)": ("pyramid", [0, 1, 3, 2, 4]),
    "PYRAMID(3,1)": ("pyramid", [0, 1, 3, 2, 4]), "Q2_INCOMPLETE(2)": ("quad8", [0, 2, 7, 5, 1, 4, 6, 3]),
    "Q2_INCOMPLETE(3)": ("hexahedron20", [
        0, 2, 7, 5, 12, 14, 19, 17, 1, 4, 6, 3, 13, 16, 18, 15, 8, 9, 11, 10,
    ]),
}  # fmt: skip
_FACES = {
    "triangle": ("line", ((1, 2), (2, 0), (0, 1))),
    "tetra": ("triangle", ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))),
}  # fmt: skip


def parse(data: bytes) -> Source:
    """Read points and convexes; regions are sets."""
    text = without(data, _COMMENT, b"%")
    ids, spans = _points(text)
    points, coordinates, runs = Numbering(ids), Places.of_text(spans), Runs()
    table, names = _convexes(text)
    heads = table.integers(1, 3)
    for here in alike(heads[:, 1], table.counts):
        size = int(table.counts[here[0]]) - 3
        key, order = _type(names[int(heads[here[0], 1])], size)
        vertices = points.points_of(table.integers(3, 3 + size, here)[:, order], heads[here, 0])
        runs.add(Cells(key, vertices, heads[here, 0]), partial(_corners, table, order, here))
    unread = list(_regions(runs, text))
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays,
        untold=("comments",) * (text is not data) + tuple(unread), oriented=False,
        numbers=lambda: ids,
    )  # fmt: skip


def _section(text: bytes, name: bytes) -> tuple[int, int]:
    begin = text.find(b"BEGIN " + name)
    end = text.find(b"END", begin + len(name) + 6)
    if begin < 0 or end < 0:
        what = "end" if begin >= 0 else "begin"
        raise ReadError(f"is truncated or not readable: its {name.decode()} does not {what}")
    if text.find(b"BEGIN " + name, end) >= 0:
        raise ReadError("holds several meshes, and one mesh is read: give each a file of its own")
    return begin + len(name) + 6, end


def _rows(text: bytes, name: bytes, word: bytes) -> tuple[int, int, int]:
    """Return where the rows of a section begin, behind their number if it is told, how many there are, and its end."""
    begin, end = _section(text, name)
    told = re.compile(rb"\s*%s\s+COUNT\s+(\d{1,18})" % word).match(text, begin, end)
    begin = told.end() if told else begin
    count = text.count(word, begin, end)
    if told and int(told[1]) != count:
        raise ReadError(f"is truncated or not readable: it announces {int(told[1]):,} rows of {word.decode()}")
    return begin, count, end


def _points(text: bytes) -> tuple[Int64, Spans]:
    """Return the numbers (n,) of points, and the words (n, d, 2) of their coordinates."""
    begin, count, end = _rows(text, _POINTS, b"POINT")
    table = lines(text, begin, count, "point")
    check_blank(text, table.end, end)
    dimension = int(table.counts[0]) - 2 if count else 0
    if dimension not in (1, 2, 3) or (table.counts != dimension + 2).any():
        raise in_line(text, begin, "points have not all the same number of coordinates, up to three")
    return integers_at(text, table.columns(1, 2))[:, 0], table.columns(2, 2 + dimension)


def _convexes(text: bytes) -> tuple[IntegerLines, list[str]]:
    """Return the rows of convexes, in which numbers stand for names of transformations, and these."""
    begin, count, end = _rows(text, _STRUCTURE, b"CONVEX")
    names: list[str] = []
    while (at := text.find(b"GT_", begin)) >= 0:
        found = _NAME.match(text, at - 1 - (text[at - 1 : at] == b"'"))
        if found is None or len(names) == _MOST_NAMES:
            raise in_line(text, at, f"a convex is of no kind that can be read, or of more than {_MOST_NAMES}")
        code = b" %d" % len(names)
        names.append(found[0].decode("latin-1").strip(" \t'"))
        text = text.replace(found[0], code.ljust(len(found[0])))
    table = integer_lines(text, begin, count, "convex")
    check_blank(text, table.end, end)
    for row in np.flatnonzero(table.counts < 4)[:1].tolist():
        raise in_line(text, table.place(row), "a convex has no points")
    if count and not (table.integers(2, 3).min() >= 0 and table.integers(2, 3).max() < len(names)):
        raise in_line(text, begin, "a convex has no geometric transformation (GT_...)")
    return table, names


def _type(name: str, size: int) -> tuple[str, list[int]]:
    """Return the type of convexes, and the order of their points."""
    called = name.upper().removeprefix("GT_").removeprefix("LINEAR_")
    called = re.sub(r"^PRODUCT\(GT_PK\(2,(\d)\),GT_PK\(1,\1\)\)$", r"PRISM(3,\1)", called)
    key, order = _OTHERS.get(called, ("", []))
    if key and len(order) == size:
        return key, order
    found = re.fullmatch(r"(PK|QK|PRISM)\((\d)(?:,(\d))?\)", called)
    shape = _SHAPES.get((found[1], int(found[2])), "") if found else ""
    if found is None or not shape:
        return f"polyhedron_of_{size}", list(range(size))
    places = lattice(shape, min(int(found[3] or 1), _MOST_ORDER), "vtk")
    key = shape if size == ELEMENTS[shape].nodes else f"{shape}{size}"
    if len(places) != size or element_of(key) is None:
        return f"{shape}_of_{size}", list(range(size))
    along = sorted(range(size), key=lambda i: places[i][::-1])
    return key, [along.index(i) for i in range(size)]


def _corners(table: IntegerLines, order: list[int], here: Int64) -> Places:
    return Places.of_text(table.columns(3, 3 + len(order), here)[:, order], "i8")


def _regions(runs: Runs, text: bytes) -> list[str]:
    """Put convexes of regions into sets, and add faces of simplices; return what is not read."""
    unread: list[str] = []
    elements = list(runs.cells)
    for found in _REGION.finditer(text):
        name = f"region {int(found[1])}"
        members = _MEMBER.findall(found[2])
        whole = np.array([int(one) for one, face in members if not face], dtype=np.int64)
        sides = np.array([(int(one), int(face)) for one, face in members if face], dtype=np.int64).reshape(-1, 2)
        for run, cells in enumerate(elements):
            if cells.ids is None:
                continue
            if len(whole):
                runs.put(name, run, np.flatnonzero(np.isin(cells.ids, whole)))
            rows = Numbering(cells.ids).rows_of(sides[:, 0])
            key, faces = _FACES.get(cells.type, ("", ()))
            if (rows >= 0).any() and not key:
                unread.append(f"faces of {name}")
            chosen = (rows[(rows >= 0) & (sides[:, 1] == i)] for i in range(len(faces)))
            parts = [cells.vertices[some][:, list(face)] for some, face in zip(chosen, faces, strict=True)]
            if sum(map(len, parts)):
                runs.add(Cells(key, np.concatenate(parts)), _not_turned, sets=(name,))
    return unread


def _not_turned() -> Places:
    raise ReadError("has faces of convexes, which cannot be renumbered")
