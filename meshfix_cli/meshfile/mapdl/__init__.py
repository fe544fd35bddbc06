"""Ansys Mechanical's archives (.cdb): commands, and blocks of numbers in the columns of a format of Fortran.

A line of NBLOCK has the number of a node, two more integers where the block is one of SOLID, and coordinates, of which
the last are left out where they are zero. An element of EBLOCK has its material, its type, nine more integers, among
them how many nodes it has and its own number, and nodes, eight of them on its first line; in a block that is not one of
SOLID its number, its type, its real constant, its material, its coordinate system, and nodes; in a COMPACT one its
number and nodes, behind the commands TYPE and MAT. ET tells what a type is.

Source: Ansys, "Mechanical APDL Command Reference", NBLOCK, EBLOCK, CMBLOCK, ET, ETBLOCK, CDWRITE.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.mapdl.blocks import Archive, Block, Scientific
from meshfix_cli.meshfile.mapdl.types import types
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, alike
from meshfix_cli.meshfile.text import Spans, in_line, unmarked

_MATERIAL, _TYPE = "ansys:material", "ansys:type"
_BESIDE = 11  # integers of an element of a solid block before its nodes
_HERE = 8  # nodes on its first line
_MOST = 27


def parse(data: bytes) -> Source:
    """Read nodes and elements; materials and types are regions, and components are sets."""
    text = unmarked(data)
    archive = Archive.of(text.replace(b"\r", b"\n") if b"\r" in text else text)
    if not archive.nodes or not archive.elements:
        other = ", but commands that make a mesh, which are not carried out" if archive.single else ""
        raise ReadError(f"has no blocks of nodes and elements (NBLOCK, EBLOCK){other}")
    numbers = np.concatenate([block.values(0, 1)[:, 0] for block in archive.nodes])
    for block in archive.nodes:
        block.announced(len(block.begin), "node")
    (coordinates, held), points, runs = _coordinates(archive), Numbering(numbers), Runs()
    for block in archive.elements:
        _add(runs, block, points)
    point_sets: dict[str, Int64] = {}
    for name, of_nodes, ranges in archive.sets:
        if of_nodes:
            point_sets[name] = np.flatnonzero(_inside(ranges, numbers))
            continue
        for run, cells in enumerate(runs.cells):
            if cells.ids is not None:
                runs.put(name, run, np.flatnonzero(_inside(ranges, cells.ids)))
    return Source(
        coordinates.read(archive.text), runs.cells, InPlace(data, coordinates, runs.corners),
        partial(runs.arrays, point_sets), (_MATERIAL, _TYPE) if runs.cells else (), held, ("commands",),
        numbers=lambda: numbers,
    )  # fmt: skip


def _coordinates(archive: Archive) -> tuple[Places, NDArray[np.bool_]]:
    """Find the columns of coordinates, and the points whose lines are too short to take others.

    A line that ends before its last coordinate takes one there.
    """
    forms = {block.form for block in archive.nodes}
    form = forms.pop()
    if forms or form.reals < 2 or form.columns < 8:
        raise ReadError("has blocks of nodes in different formats, or in one that cannot hold them")
    edges = sum(form.widths) + form.columns * np.arange(min(form.reals, 3) + 1)
    spans = np.concatenate([block.fields(edges) for block in archive.nodes])
    lengths = spans[..., 1] - spans[..., 0]
    dimension = 3 if lengths[:, 2:].any() else 2  # a mesh in a plane has no third ones
    spans, lengths = spans[:, :dimension], lengths[:, :dimension]
    whole = lengths == form.columns
    held: NDArray[np.bool_] = ~(whole[:, :-1].all(axis=1) & (whole[:, -1] | (lengths[:, -1] == 0)))
    places = Scientific(spans[..., 0], spans[..., 1], np.dtype("f8"), form.columns, "padded", None, form.exponent)
    return places, held


def _add(runs: Runs, block: Block, points: Numbering) -> None:
    """Add the elements of a block."""
    count = 0
    for size, heads, nodes in _solid(block) if block.kind == "SOLID" else _others(block):
        ids, kinds, materials = heads.T
        count += len(ids)
        for rows in alike(kinds):
            kind = int(kinds[rows[0]])
            listed = _listed(block, nodes, rows, size)
            for some in types(block.element.get(kind, 0), block.option.get(kind, 0), listed):
                here = rows[some.rows]
                labels = {_MATERIAL: materials[here], _TYPE: kinds[here]}
                if some.columns:
                    vertices = points.points_of(listed[some.rows][:, some.columns], ids[here])
                    corners = partial(_corners, block, nodes, here, some.columns)
                    runs.add(Cells(some.key, vertices, ids[here]), corners, labels)
                else:
                    lists = [points.points_of(row[row > 0][None], ids[here])[0] for row in listed[some.rows]]
                    runs.add(Cells(some.key, lists, ids[here]), _not_turned, labels)
    block.announced(count, "element")


_Nodes = Sequence[tuple[Int64, int, int]]  # of elements: on which lines (m,), from which field to which


def _solid(block: Block) -> Iterator[tuple[int, Int64, _Nodes]]:
    """Give elements of as many nodes: these, their numbers, types and materials (m, 3), and where nodes are."""
    if len(set(block.form.widths)) > 1 or len(block.form.widths) < _BESIDE + _HERE:
        raise in_line(
            block.text, int(block.begin[0]) if len(block.begin) else 0, "a block of elements has no 19 columns"
        )
    sizes = block.values(_HERE, _HERE + 1)[:, 0]
    heads = _first_lines(sizes)
    if heads is None or ((sizes[heads] < 1) | (sizes[heads] > _MOST)).any():
        raise in_line(block.text, int(block.begin[0]), "elements have not the lines that their numbers of nodes tell")
    for rows in alike(sizes[heads]):
        size, here = int(sizes[heads[rows[0]]]), heads[rows]
        nodes = [(here, _BESIDE, _BESIDE + min(size, _HERE))]
        nodes += [(here + 1, 0, size - _HERE)] if size > _HERE else []
        about = block.values(0, _BESIDE, here)
        yield size, about[:, [10, 1, 0]], nodes


def _first_lines(sizes: Int64) -> Int64 | None:
    """Return which lines are the first of elements, by what they would say of their nodes; None: it does not fit."""
    more = sizes > _HERE
    if not more.any():
        return np.arange(len(sizes))
    if more[::2].all() and len(more) % 2 == 0:
        return np.arange(0, len(sizes), 2)
    first, at, view = [], 0, more.tolist()
    while at < len(view):
        first.append(at)
        at += 1 + view[at]
    return np.array(first, dtype=np.int64) if at == len(view) else None


def _others(block: Block) -> Iterator[tuple[int, Int64, _Nodes]]:
    """Do the same for a block that is not one of solids: an element has a line."""
    most, beside = len(block.form.widths), 1 if block.kind == "COMPACT" else 5
    values = block.values(0, most)
    given = np.hstack([np.ones((len(values), 1), dtype=np.int64), values[:, beside:]]) != 0
    sizes = most - beside - np.argmax(given[:, ::-1], axis=1)
    about = values[:, [0, 1, 3]] if beside > 1 else values[:, [0, 0, 0]]
    if beside == 1:
        about[:, 1:] = block.type, block.material
    for rows in alike(sizes):
        if (size := int(sizes[rows[0]])) > 0:
            yield size, about[rows], [(rows, beside, beside + size)]


def _listed(block: Block, nodes: _Nodes, rows: Int64, size: int) -> Int64:
    """Return the numbers (k, size) of the nodes of some of the elements; 0: there is none."""
    return np.hstack([block.values(first, last, lines[rows]) for lines, first, last in nodes]).reshape(-1, size)


def _corners(block: Block, nodes: _Nodes, rows: Int64, columns: Sequence[int]) -> Places:
    width, spans = block.form.widths[-1], list[Spans]()
    edges = np.cumsum([0, *block.form.widths])
    for lines, first, last in nodes:
        spans.append(block.fields(edges[first : last + 1], lines[rows]))
    return Places.of_text(np.concatenate(spans, axis=1)[:, columns], "i8", width, "padded")


def _not_turned() -> Places:
    raise ReadError("has elements that lack nodes, which cannot be renumbered")


def _inside(ranges: Int64, numbers: Int64) -> NDArray[np.bool_]:
    """Whether numbers (n,) are in one of some ranges (k, 2)."""
    first, last = np.sort(ranges[:, 0]), np.sort(ranges[:, 1])
    inside: NDArray[np.bool_] = np.searchsorted(first, numbers, "right") > np.searchsorted(last, numbers, "left")
    return inside
