"""Elmer's meshes: a folder with mesh.header, which tells how many lines mesh.nodes, .elements and .boundary have.

A node has its number, one that says nothing, and three coordinates; an element its number, that of its body, one for
its type, and its nodes; an element of the boundary has those of two elements beside it before its type. A type is a
number for the shape, and two digits for how many nodes. mesh.names may say what bodies and boundaries are called.

Source: CSC, "ElmerSolver Manual", appendices "Format of mesh files" and "Element types"; CSC, "ElmerGrid Manual"; for
the nodes of second order Elmer, "elements.def".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from meshfix_cli.errors import ReadError, WriteError, naming
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import (
    Int64,
    IntegerLines,
    Lines,
    Numbering,
    Runs,
    alike,
    check_blank,
    integer_lines,
    lines,
)
from meshfix_cli.meshfile.text import in_line
from meshfix_cli.meshfile.together import Together, all_there, beside_output

HEADER = "mesh.header"
_OTHERS = (".boundary", ".names")  # what belongs to a mesh and may be missing
_NAME = re.compile(r"(?m)^[ \t]*\$[ \t]*(\S.*?)[ \t]*=[ \t]*(\d{1,18})[ \t]*\r?$")
_BODY = "elmer:body"
_SHAPES = {
    1: "vertex", 2: "line", 3: "triangle", 4: "quad", 5: "tetra", 6: "pyramid", 7: "wedge", 8: "hexahedron",
}  # fmt: skip
# Elements of second order whose nodes are known, and which of them stands in each place of the table of elements.
_SECOND: dict[str, Sequence[int]] = {
    "line3": range(3), "triangle6": range(6), "quad8": range(8), "quad9": range(9), "tetra10": range(10),
    "pyramid13": range(13), "wedge15": range(15), "hexahedron20": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15),
    "hexahedron27": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15, 23, 21, 20, 22, 24, 25, 26),
}  # fmt: skip


def parse(_: bytes, path: Path | None) -> Source:
    """Read a mesh by its folder or the name of one of its files."""
    if path is None:
        raise ReadError("is one of several files of Elmer, so it is read from its file and not from a stream")
    header = path / HEADER if path.is_dir() else path.with_suffix(".header")
    changed = [header.with_suffix(suffix) for suffix in (".nodes", ".elements")]
    all_there((header, *changed))
    copied = [header, *[one for suffix in _OTHERS if (one := header.with_suffix(suffix)).is_file()]]
    beside = {one.suffix: one.read_bytes() for one in copied}

    def places(target: Path) -> list[Path]:
        if path.is_dir() == (target.suffix in (".header", *(one.suffix for one in changed))):
            like = "a folder" if path.is_dir() else "a .header"
            raise WriteError(f"{target}: is not {like}, as the input is")
        there = target / HEADER if path.is_dir() else target
        return beside_output(target, there, (*changed, *copied), _OTHERS)

    def read(contents: Sequence[bytes]) -> Source:
        source, layout = _source(contents[0], contents[1], beside)
        written = partial(layout.divided, bounds=[len(contents[0])])
        return replace(source, pieces=Together(path, changed, layout, written, read, copied, places))

    return read([one.read_bytes() for one in changed])


def _source(nodes: bytes, elements: bytes, beside: Mapping[str, bytes]) -> tuple[Source, InPlace]:
    with naming(".header"):
        counts = lines(beside[".header"], 0, 1).integers(0, 3)[0].tolist()
    with naming(".nodes"):
        listed = lines(nodes, 0, counts[0], "node")
        check_blank(nodes, listed.end)
        _check_counts(listed, slice(None), 5)
        coordinates = Places.of_text(listed.columns(2, 5))
        place, numbering = coordinates.read(nodes), Numbering(listed.integers(0, 1)[:, 0])
    bodies, marks, boundaries = beside.get(".names", b"").decode("utf-8", "replace").partition("names for boundaries")
    runs = Runs()
    with naming(".elements"):
        _add(runs, _table(elements, counts[1]), 1, numbering, bodies, len(nodes))
    if ".boundary" in beside:
        with naming(".boundary"):
            _add(runs, _table(beside[".boundary"], counts[2]), 3, numbering, boundaries if marks else bodies, None)
    elif counts[2]:
        raise ReadError("has elements of the boundary in a .boundary, which is not there")
    layout = InPlace(nodes + elements, coordinates, runs.corners)
    return Source(place, runs.cells, None, runs.arrays, (_BODY,), numbers=lambda: numbering.numbers), layout


def _table(data: bytes, count: int) -> IntegerLines:
    table = integer_lines(data, 0, count, "element")
    check_blank(data, table.end)
    return table


def _check_counts(table: Lines | IntegerLines, here: Int64 | slice, count: int) -> None:
    """Raise ReadError where lines have more than so many numbers: others stand where these are looked for."""
    if (table.counts[here] > count).any():
        raise ReadError(f"is not readable: some of its lines have more than {count} numbers")


def _add(runs: Runs, table: IntegerLines, before: int, numbering: Numbering, names: str, at: int | None) -> None:
    """Add elements whose types stand behind `before` numbers and their own, at an offset if they may be turned."""
    rows = table.integers(0, before + 2)
    bodies, types = rows[:, 1], rows[:, before + 1]
    called = [(one[1], int(one[2])) for one in _NAME.finditer(names)]
    for here in alike(types):
        shape, size = _SHAPES.get(int(types[here[0]]) // 100, ""), int(types[here[0]]) % 100
        if not shape or size < ELEMENTS[shape].nodes:
            raise in_line(table.text, table.place(int(here[0])), f"elements of the type {types[here[0]]} are not known")
        key = shape if size == ELEMENTS[shape].nodes else f"{shape}{size}"
        order = np.array(_SECOND.get(key, range(size)))
        key = key if size == ELEMENTS[shape].nodes or key in _SECOND else f"{shape}_of_{size}"
        _check_counts(table, here, before + 2 + size)
        nodes = table.integers(before + 2, before + 2 + size, here)[:, order]
        cells = Cells(key, numbering.points_of(nodes, rows[here, 0]), rows[here, 0] if at is not None else None)
        corners = _not_turned if at is None else partial(_corners, table, before + 2, order, here, at)
        run, mine = len(runs.cells), bodies[here]
        runs.add(cells, corners, {_BODY: mine})
        for number in np.unique(mine).tolist() if at is None else ():
            runs.put(f"boundary {number}", run, np.flatnonzero(mine == number))
        for name, number in called:
            runs.put(name, run, np.flatnonzero(mine == number))


def _corners(table: IntegerLines, first: int, order: Int64, here: Int64, at: int) -> Places:
    return Places.of_text(table.columns(first, first + len(order), here)[:, order] + at, "i8")


def _not_turned() -> Places:
    raise ReadError("has elements of the boundary in a file of their own, which are not renumbered")
