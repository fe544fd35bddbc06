"""TetGen's and Triangle's files: points in a .node, elements beside it in an .ele, each line with a number of its own.

The first line of both tells how many lines and columns follow. Facets of a .face or .edge with a marker are cells too.

Source: H. Si, "TetGen, User's Manual", section "File formats"; J. R. Shewchuk, "Triangle", ".node files", ".ele files".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError, WriteError, naming
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import (
    CODES,
    Int64,
    IntegerLines,
    Numbering,
    Runs,
    check_blank,
    integer_lines,
    lines,
    without,
)
from meshfix_cli.meshfile.text import in_line, integers_at, numbers_at
from meshfix_cli.meshfile.together import Together, all_there, beside_output

_COMMENT = re.compile(rb"#[^\n\r]*")
_REF = "tetgen:ref"
_TYPES = {(2, 3): "triangle", (2, 6): "triangle6", (3, 4): "tetra", (3, 10): "tetra10"}
# Which of the nodes stands in each place of the table of elements.
_ORDER = {"triangle6": (0, 1, 2, 5, 3, 4), "tetra10": (0, 1, 2, 3, 6, 7, 9, 5, 8, 4)}
_FACETS = {".face": ("triangle", 3), ".edge": ("line", 2)}
_COPIED = (".face", ".edge", ".neigh", ".poly", ".smesh", ".mtr", ".vol", ".area", ".t2f", ".f2e", ".t2e", ".v.node")


def parse(_: bytes, path: Path | None) -> Source:
    """Read a mesh by the name of one of its two files."""
    if path is None:
        raise ReadError("is one of two files, .node and .ele, so it is read from its file and not from a stream")
    changed = [path.with_suffix(suffix) for suffix in (".node", ".ele")]
    all_there(changed)
    copied = [one for suffix in _COPIED if (one := path.with_suffix(suffix)).is_file()]
    facets = {one.suffix: one.read_bytes() for one in copied if one.suffix in _FACETS}

    def places(target: Path) -> list[Path]:
        if target.suffix not in (".node", ".ele"):
            raise WriteError(f"{target}: is neither a .node nor an .ele")
        return beside_output(target, target, (*changed, *copied), _FACETS)

    def read(contents: Sequence[bytes]) -> Source:
        source, layout = _source(contents[0], contents[1], facets)
        written = partial(layout.divided, bounds=[len(contents[0])])
        return replace(source, pieces=Together(path, changed, layout, written, read, copied, places))

    return read([one.read_bytes() for one in changed])


def _source(nodes: bytes, elements: bytes, facets: Mapping[str, bytes]) -> tuple[Source, InPlace]:
    with naming(".node"):
        text, at, (count, dimension, *_) = _head(nodes, 2)
        listed = lines(text, at, count, "point")
        check_blank(text, listed.end)
        if dimension not in (2, 3):
            raise ReadError(f"its points have {dimension} coordinates")
        coordinates = Places.of_text(listed.columns(1, 1 + dimension))
        points, numbering = coordinates.read(nodes), Numbering(listed.integers(0, 1)[:, 0])
    runs = Runs()
    with naming(".ele"):
        (corners, attributes), table = _integers(elements, 2)
        kind = _TYPES.get((dimension, corners))
        if kind is None:
            raise ReadError(f"its elements have {corners} nodes in {dimension} dimensions")
        rows = table.integers(0, 1 + corners)
        labels: dict[str, NDArray[Any]] = {}
        if attributes > 0:
            labels[_REF] = table.words(1 + corners, 2 + corners)[:, 0]
            if (labels[_REF] < CODES).any():  # they may be any numbers
                column = table.columns(1 + corners, 2 + corners)[:, 0]
                labels[_REF] = numbers_at(table.text, column, np.dtype("f8"))
        order = np.array(_ORDER.get(kind, range(corners)))
        cells = Cells(kind, numbering.points_of(rows[:, 1:][:, order], rows[:, 0]), rows[:, 0])
        runs.add(cells, partial(_corners, table, order, len(nodes)), labels)
    for suffix, data in facets.items():
        with naming(suffix):
            _add_facets(runs, data, *_FACETS[suffix], numbering, kind == "tetra10")
    layout = InPlace(nodes + elements, coordinates, runs.corners)
    untold = ("comments",) if b"#" in nodes or b"#" in elements else ()
    regions = (_REF,) * bool(labels)
    source = Source(points, runs.cells, None, runs.arrays, regions, untold=untold, numbers=lambda: numbering.numbers)
    return source, layout


def _head(data: bytes, counts: int) -> tuple[bytes, int, list[int]]:
    """Return the text without comments, the offset behind its first line, and what that tells."""
    text = without(data, _COMMENT, b"#")
    head = lines(text, 0, 1)
    values = integers_at(text, head.spans).tolist()
    if len(values) < counts:
        raise in_line(text, head.end, "the first line does not tell how many lines and columns there are")
    return text, head.end, [*values, 0][: counts + 1]  # the last of them may be left out


def _integers(data: bytes, counts: int) -> tuple[list[int], IntegerLines]:
    """Return what the first line tells behind the number of lines, and these."""
    text, at, (count, *others) = _head(data, counts)
    table = integer_lines(text, at, count, "line")
    check_blank(text, table.end)
    return others, table


def _corners(table: IntegerLines, order: Int64, before: int) -> Places:
    return Places.of_text(table.columns(1, 1 + len(order))[:, order] + before, "i8")


def _add_facets(runs: Runs, data: bytes, kind: str, corners: int, numbering: Numbering, second: bool) -> None:
    """Take the facets that have a marker, which are boundaries and interfaces: others may be inside.

    Those of tetrahedra of second order have a node on each edge before it, as their element has.
    """
    (markers,), table = _integers(data, 1)
    if markers < 1:
        return
    at, more = 1 + corners, 3 if corners == 3 else 1
    at += more if second and (table.counts > at + more).all() else 0
    marks = table.integers(at, at + 1)[:, 0]
    rows = np.flatnonzero(marks != 0)
    facets = Cells(kind, numbering.points_of(table.integers(1, 1 + corners, rows)))
    runs.add(facets, _not_turned, {_REF: marks[rows]})


def _not_turned() -> Places:
    raise ReadError("has facets in a file of their own, which are not renumbered")
