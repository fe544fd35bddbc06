"""Grids of ADCIRC (fort.14) and SCHISM (hgrid.gr3): a title, two counts, and a line for each node and element.

A line of a node has its number, two coordinates in the plane and a depth, which is no coordinate of the mesh; one of an
element its number, how many nodes, and these. Behind them stand open boundaries and others, each with the number of its
nodes and these, one to a line; some have pairs of nodes on both sides of a barrier, and numbers that tell its height.

Source: ADCIRC, "User's Manual", "ADCIRC grid and boundary information file (fort.14)"; SCHISM, "hgrid.gr3".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, IntegerLines, Lines, Numbering, Runs, alike, integer_lines, lines
from meshfix_cli.meshfile.text import MARK, fields_at, in_line, integers, integers_at, unmarked

_COUNTS = re.compile(rb"[^\n\r]*(?:\r\n|[\n\r])\s*(\d{1,18})[ \t]+(\d{1,18})(?!\S)[^\n\r]*")
_TYPES = {3: "triangle", 4: "quad"}
_PAIRED = frozenset({4, 5, 24, 25, 64})  # boundaries whose lines have a second node
_BOUNDARIES = ("open", "land")


def parse(data: bytes) -> Source:
    """Read nodes and elements; boundaries are sets of nodes, and depths data."""
    text = unmarked(data)
    head = _COUNTS.match(text, len(MARK) if data.startswith(MARK) else 0)
    if head is None:
        raise ReadError("is not a readable grid of ADCIRC: its second line has no numbers of elements and nodes")
    nodes = lines(text, head.end(), int(head[2]), "node")
    elements = integer_lines(text, nodes.end, int(head[1]), "element")
    points, coordinates = Numbering(integers_at(text, nodes.columns(0, 1))[:, 0]), Places.of_text(nodes.columns(1, 3))
    runs, sets, held = Runs(), dict[str, Int64](), np.zeros(len(nodes.counts), dtype=bool)
    ids, sizes = elements.integers(0, 2).T
    for here in alike(sizes):
        _add(runs, elements, ids, int(sizes[here[0]]), here, points)
    for name, members, paired in _boundaries(text, elements.end):
        rows = points.rows_of(members)
        if (rows < 0).any():
            raise ReadError(f"is truncated or not readable: the {name} names a node that is not there")
        sets[name] = np.unique(rows)
        held[rows] |= paired
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners),
        partial(_arrays, runs, sets, nodes), held=held if held.any() else None,
        notes=("depths stay with their nodes, also where these move",),
        numbers=lambda: points.numbers,
    )  # fmt: skip


def _add(runs: Runs, table: IntegerLines, ids: Int64, size: int, here: Int64, points: Numbering) -> None:
    if size < 1:
        raise in_line(table.text, table.place(int(here[0])), f"an element has {size} nodes")
    vertices = points.points_of(table.integers(2, 2 + size, here), ids[here])
    runs.add(Cells(_TYPES.get(size, f"quad_of_{size}"), vertices, ids[here]), partial(_corners, table, size, here))


def _corners(table: IntegerLines, size: int, here: Int64) -> Places:
    return Places.of_text(table.columns(2, 2 + size, here), "i8")


def _arrays(runs: Runs, sets: dict[str, Int64], nodes: Lines) -> Arrays:
    deep = (nodes.counts > 3).all()
    return replace(runs.arrays(sets), point={"depth": fields_at(nodes.text, nodes.columns(3, 4))[:, 0]} if deep else {})


def _boundaries(text: bytes, at: int) -> Iterator[tuple[str, Int64, bool]]:
    """Give the names of boundaries, the numbers of their nodes, and whether these are paired over a barrier."""
    values, starts, _ = kernels.read_lines(text, at, text.count(b"\n", at) + text.count(b"\r", at) + 1)
    first, counts = values[starts[:-1]], np.diff(starts)
    second = np.where(counts > 1, values[np.minimum(starts[:-1] + 1, max(len(values) - 1, 0))], 0)
    row, none = 0, first[:0]
    for kind in _BOUNDARIES:
        if row >= len(first):
            return
        count = _number(text, at, first, row)
        row += 2  # behind it stands the number of all their nodes
        for number in range(1, count + 1):
            size = _number(text, at, first, row)
            if row + size >= len(first):
                raise ReadError(f"is truncated: {counted(size, 'node', 'nodes')} of a boundary announced")
            paired = kind == "land" and int(second[row]) in _PAIRED
            here = slice(row + 1, row + 1 + size)
            members = np.concatenate([first[here], second[here] if paired else none])
            yield f"{kind} boundary {number}", members, paired
            row += 1 + size


def _number(text: bytes, at: int, first: Int64, row: int) -> int:
    """Return the number in front of a line."""
    if row >= len(first):
        raise ReadError("is truncated: its boundaries are not all there")
    if first[row] < 0:
        spans, starts, _ = kernels.find_lines(text, at, row + 1)
        begin = int(spans[starts[row], 0])
        integers(text, begin, 1)  # which says what it is
        raise in_line(text, begin, "a number of boundaries or of their nodes is below 0")
    return int(first[row])
