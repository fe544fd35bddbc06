"""Netgen's .vol files: keywords on lines of their own, each followed by a number of rows and by as many lines.

A row of `points` has three coordinates, also in the plane; one of `volumeelements` the number of a domain, how many
points, and these; one of `surfaceelements` four numbers, the second of which is that of the boundary or, in the plane,
of the domain, how many points, these, and behind them what ties them to the geometry. The corners of solid elements
stand in the mirror image of the order of the table of elements. Domains and boundaries may have names.

Source: Netgen, "meshclass.cpp", Mesh::Save and Mesh::Load; "meshtype.hpp" and "refine.cpp" for the second order.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
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
    rows,
    without,
)
from meshfix_cli.meshfile.text import Spans, in_line, integers

_COMMENT = re.compile(rb"#[^\n\r]*")
_ROWS = (
    "surfaceelements", "surfaceelementsgi", "surfaceelementsuv", "volumeelements", "edgesegments", "edgesegmentsgi",
    "edgesegmentsgi2", "edgesegmentsgi3", "pointelements",
)  # fmt: skip
_NAMES = ("materials", "bcnames", "cd2names", "cd3names", "edgedescriptors")
_OTHERS = ("points", "dimension", "curvedelements", "identificationnames", "endmesh")
_KEYWORD = re.compile(rf"(?:\A|(?<=[\n\r]))[ \t]*({'|'.join((*_ROWS, *_NAMES, *_OTHERS))})[ \t]*(?=[\n\r]|\Z)".encode())
_ANOTHER = re.compile(rb"[\n\r][ \t]*(?:mesh3d|points)[ \t]*[\n\r]")
_SEVERAL = "several meshes, and one mesh is read: give each a file of its own"
_BREAK = re.compile(rb"[\n\r]")
_NAME = re.compile(rb"\s*(\d{1,9})[ \t]*([^\n\r]*)")
_DOMAIN = "netgen:index"
_SURFACES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}
_SOLIDS = {
    4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 12: "wedge12", 13: "pyramid13", 15: "wedge15",
    20: "hexahedron20",
}  # fmt: skip
# Which corners of the file stand in each place of the table of elements, and between which the file's other nodes lie.
_CORNERS = {
    "tetra": (0, 2, 1, 3), "pyramid": (0, 3, 2, 1, 4), "wedge": (0, 2, 1, 3, 5, 4),
    "hexahedron": (0, 3, 2, 1, 4, 7, 6, 5), "triangle": (0, 1, 2), "quad": (0, 1, 2, 3),
}  # fmt: skip
_BETWEEN = {
    "triangle6": "12 02 01", "quad8": "01 23 03 12", "tetra10": "01 02 03 12 13 23",
    "pyramid13": "01 23 03 12 04 14 24 34", "wedge12": "02 01 12 35 34 45", "wedge15": "02 01 12 35 34 45 03 14 25",
    "hexahedron20": "01 23 03 12 45 67 47 56 04 15 26 37",
}  # fmt: skip


class _Section(NamedTuple):
    """A keyword and where what follows it begins; its rows, its names by their numbers, or its coordinates."""

    keyword: str
    at: int
    rows: IntegerLines | None = None
    names: Mapping[int, str] = MappingProxyType({})
    points: Spans = np.empty((0, 3, 2), dtype=np.int64)


def parse(data: bytes) -> Source:
    """Read points and elements; domains are regions and, by their names, sets, as are boundaries."""
    text = without(data, _COMMENT, b"#")
    sections = list(_sections(text))
    dimensions = [integers(text, one.at, 1)[0][0] for one in sections if one.keyword == "dimension"]
    points = [one for one in sections if one.keyword == "points"]
    dimension = int(dimensions[0]) if dimensions else 3
    if len(points) != 1 or dimension not in (2, 3):
        what = _SEVERAL if len(points) > 1 else "no points"
        raise ReadError(f"holds {what}" if dimension in (2, 3) else f"holds a mesh in {dimension} dimensions")
    if any(one.keyword == "curvedelements" for one in sections):
        raise ReadError("has curved elements (curvedelements), which meshfix does not judge")
    spans = points[0].points
    coordinates, runs = Places.of_text(spans[:, :dimension]), Runs()
    numbering, names = Numbering(np.arange(1, len(spans) + 1)), {one.keyword: one.names for one in sections}
    for one in sections:
        if one.rows is not None:
            _add(runs, one.keyword, one.rows, numbering, dimension, names)
    geometry = b"endmesh" in text and bool(text.rpartition(b"endmesh")[2].strip())
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays,
        (_DOMAIN,) if runs.cells else (), untold=("geometry",) * geometry,
    )  # fmt: skip


def _sections(text: bytes) -> Iterator[_Section]:
    """Read up to `endmesh`, behind which the geometry may stand."""
    at, keyword = 0, ""
    while match := _KEYWORD.search(text, at):
        keyword, at = match[1].decode(), match.end()
        if keyword == "endmesh":
            if _ANOTHER.search(text, at):
                raise ReadError(f"holds {_SEVERAL}")
            return
        if keyword in _ROWS:
            count, begin = _count(text, at)
            table = integer_lines(text, begin, count, "element")
            yield _Section(keyword, at, table)
            at = table.end
        elif keyword == "points":
            count, begin = _count(text, at)
            spans, end = rows(text, begin, count, 3)
            check_blank(text, end, _end_of_line(text, end))
            yield _Section(keyword, at, points=spans)
            at = end
        elif keyword in _NAMES or keyword == "identificationnames":
            names, end = _names(text, at, numbered=keyword in _NAMES[:-1])
            yield _Section(keyword, at, names=names)
            at = end
        else:
            yield _Section(keyword, at)
    if not text[-1:].isspace():
        raise ReadError("is truncated: it does not end with endmesh")


def _count(text: bytes, at: int) -> tuple[int, int]:
    values, end = integers(text, at, 1)
    return int(values[0]), end


def _end_of_line(text: bytes, at: int) -> int:
    found = _BREAK.search(text, at)
    return found.start() if found else len(text)


def _names(text: bytes, at: int, numbered: bool) -> tuple[dict[int, str], int]:
    """Read names; those that have no number are counted, and a line may have others words in front of the name."""
    count, at = _count(text, at)
    names: dict[int, str] = {}
    for i in range(count):
        line = (_NAME if numbered else re.compile(rb"\s*()([^\n\r]+)")).match(text, at)
        if line is None:
            raise in_line(text, at, f"{count:,} names are announced, and not all are there")
        at, words = line.end(), line[2].decode("utf-8", "replace").strip()
        names[int(line[1]) if numbered else i + 1] = words if numbered else words.split()[-1] if words else ""
    return names, at


def _add(
    runs: Runs,
    keyword: str,
    table: IntegerLines,
    points: Numbering,
    dimension: int,
    names: Mapping[str, Mapping[int, str]],
) -> None:
    """Add the elements of a section, of types that their numbers of points tell."""
    if keyword.startswith(("edge", "point")):
        (first, size), label, called = _low(keyword, dimension)
        groups = [(np.arange(len(table.counts)), size)]
        offset = int(called == "edgedescriptors")
    else:
        solid = keyword == "volumeelements"
        (first, label), offset = (2, 0) if solid else (5, 1), 0
        called = "materials" if solid or dimension == 2 else "bcnames"
        sizes = table.integers(first - 1, first)[:, 0]
        if not solid:
            sizes = np.where(sizes == 0, 3, sizes)
        groups = [(here, int(sizes[here[0]])) for here in alike(sizes)]
    for here, size in groups:
        if not len(here):
            continue
        key = _key(keyword, size)
        if size < 1:
            raise in_line(table.text, table.place(int(here[0])), f"an element has {size} points")
        order = _order(key, size)
        vertices = points.points_of(table.integers(first, first + size, here)[:, order], here + 1)
        labels = table.integers(label, label + 1, here)[:, 0] + offset
        run, ids = len(runs.cells), None if keyword.startswith(("edge", "point")) else here + 1
        runs.add(Cells(key, vertices, ids), partial(_corners, table, first, order, here), {_DOMAIN: labels})
        by_name: dict[str, list[int]] = {}
        for number in np.unique(labels).tolist():
            by_name.setdefault(names.get(called, {}).get(number, ""), []).append(number)
        for name, numbers in by_name.items():
            if name not in ("", "default"):
                runs.put(name, run, np.flatnonzero(np.isin(labels, numbers)))


def _low(keyword: str, dimension: int) -> tuple[tuple[int, int], int, str]:
    """Return where the points of edges or vertices begin and how many they are, where their label is, and its names."""
    if keyword == "pointelements":
        return (0, 1), 1, "cd3names" if dimension == 3 else "cd2names"
    if keyword == "edgesegmentsgi3":
        return (0, 2), 6, "edgedescriptors"
    third = dimension == 3 and keyword == "edgesegmentsgi2"
    return (2, 2), 8 if third else 0, "cd2names" if dimension == 3 else "bcnames"


def _key(keyword: str, size: int) -> str:
    if keyword.startswith(("edge", "point")):
        return "line" if size == 2 else "vertex"
    if keyword == "volumeelements":
        return _SOLIDS.get(size, f"hexahedron_of_{size}")
    return _SURFACES.get(size, f"quad_of_{size}")


def _order(key: str, size: int) -> Sequence[int]:
    """Return which node of the file stands in each place of the table of elements."""
    shape = key.rstrip("0123456789")
    corners = _CORNERS.get(shape, range(size))
    if key not in _BETWEEN:
        return corners
    there = {frozenset(pair): place for place, pair in enumerate(_BETWEEN[key].split(), len(corners))}
    pairs = ELEMENTS[key].between.split()
    return [*corners, *(there[frozenset(str(corners[int(end)]) for end in pair)] for pair in pairs)]


def _corners(table: IntegerLines, first: int, order: Sequence[int], here: Int64) -> Places:
    return Places.of_text(table.columns(first, first + len(order), here)[:, order], "i8")
