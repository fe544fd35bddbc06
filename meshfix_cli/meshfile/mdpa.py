"""Kratos's .mdpa files: blocks `Begin NAME ...` to `End NAME`, one in the other, of words in free format.

Nodes have a number and three coordinates, elements and conditions a number, that of their properties, and nodes;
geometries have no properties. What the elements of a block are, the end of its name tells: Element2D3N, Triangle3D3.
Parts of the model, which may lie in others, list numbers of nodes, elements, conditions and geometries.

Source: Kratos documentation, "Input data" and "Mesh node ordering"; Kratos, "hexahedra_3d_20.h", "prism_3d_15.h".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, lines, within, without
from meshfix_cli.meshfile.text import Spans, in_line, integers, integers_at

_COMMENT = re.compile(rb"//[^\n\r]*|/\*.*?\*/", re.DOTALL)
_EDGE = re.compile(rb"(?<!\S)(?:Begin|End)[ \t]+(\w+)[ \t]*([^\n\r]*)")
_CELLS = ("Elements", "Conditions", "Geometries")
_PARTS = ("SubModelPart", "Mesh")
_PROPERTIES = "mdpa:properties"
_LINES = {1: "vertex", 2: "line", 3: "line3"}
_PLANES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}
_SOLIDS = {
    4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 13: "pyramid13", 15: "wedge15",
    20: "hexahedron20", 27: "hexahedron27",
}  # fmt: skip
_ENDING = re.compile(r"([23])D(\d*)N?$")
_THIN = re.compile("Line(?!ar)|Beam|Truss|Cable|Spring")
_FLAT = re.compile("Triangle|Quadrilateral|Shell|Membrane|Plate|(?<!Free)Surface")
_THICK = re.compile("Tetra|Hexa|Prism|Pyramid|Solid")
# Of elements of second order, which of the nodes stands in each place of the table of elements.
_ORDER = {
    "wedge15": [*range(9), 12, 13, 14, 9, 10, 11],
    "hexahedron20": [*range(12), 16, 17, 18, 19, 12, 13, 14, 15],
    "hexahedron27": [*range(12), 16, 17, 18, 19, 12, 13, 14, 15, 24, 22, 21, 23, 20, 25, 26],
}


class _Block(NamedTuple):
    """A block, and where what stands in it begins and ends; `part` is the path of the part of the model it lies in."""

    name: str
    argument: str
    part: str
    begin: int
    end: int


@dataclass
class _Numbers:
    """The numbers of all elements, conditions or geometries, and the runs in which these stand."""

    ids: list[Int64]
    runs: list[int]


def parse(data: bytes) -> Source:
    """Read nodes, elements, conditions and geometries; parts of the model are sets."""
    text = without(data, _COMMENT, b"/")
    blocks = list(_blocks(text))
    tables = [_table(text, block, 4) for block in blocks if block.name == "Nodes"]
    if not tables:
        raise ReadError("is truncated or not readable: it has no block of nodes")
    spans = np.concatenate(tables)
    nodes, coordinates = Numbering(integers_at(text, spans[:, 0])), Places.of_text(spans[:, 1:])
    runs, numbers = Runs(), {name: _Numbers([], []) for name in _CELLS}
    for block in blocks:
        if block.name in _CELLS:
            _add(runs, text, block, nodes, numbers[block.name])
    points = _sets(runs, text, blocks, nodes, numbers)
    others = dict.fromkeys(block.name for block in blocks if block.name not in (*_CELLS, "Nodes") and not block.part)
    untold = ("comments",) * (text is not data) + tuple(f"blocks {name}" for name in others if name not in _PARTS)
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), partial(runs.arrays, points),
        (_PROPERTIES,) if numbers["Elements"].ids or numbers["Conditions"].ids else (), untold=untold,
        numbers=lambda: nodes.numbers,
    )  # fmt: skip


def _blocks(text: bytes) -> Sequence[_Block]:
    """Find the blocks, those inside of others before these."""
    found: list[_Block] = []
    inside: list[tuple[str, str, int]] = []
    for at in _edges(text):
        edge = _EDGE.match(text, at)
        if edge is None:
            continue
        name, argument = edge[1].decode(), edge[2].decode("utf-8", "replace").strip()
        if text.startswith(b"Begin", at):
            inside.append((name, argument, edge.end()))
            continue
        if not inside or inside[-1][0] != name:
            raise in_line(text, at, f"End {name} stands where no block of that name ends")
        _, argument, begin = inside.pop()
        part = ".".join(title if kind == "SubModelPart" else f"{kind} {title}" for kind, title, _ in inside)
        found.append(_Block(name, argument, part, begin, at))
    if inside:
        raise ReadError(f"is truncated: the block {inside[-1][0]} does not end")
    return found


def _edges(text: bytes) -> list[int]:
    """Return where words begin like those at the edges of blocks: a pattern would look at each letter."""
    places = []
    for word in (b"Begin", b"End"):
        at = text.find(word)
        while at >= 0:
            places.append(at)
            at = text.find(word, at + 1)
    return sorted(places)


def _table(text: bytes, block: _Block, columns: int) -> Spans:
    spans = within(text, block.begin, block.end)
    if len(spans) % columns:
        raise _uneven(text, block, columns)
    return spans.reshape(-1, columns, 2)


def _uneven(text: bytes, block: _Block, columns: int) -> ReadError:
    return in_line(text, block.begin, f"there are not {columns} numbers in each row of the block {block.name}")


def _integers(text: bytes, block: _Block, columns: int) -> Int64:
    values, end, _ = kernels.scan_integers(text, block.begin, block.end - block.begin)
    if text[end : block.end].strip():
        integers(text, end, 1)  # which says what it is
    if len(values) % columns:
        raise _uneven(text, block, columns)
    return values.reshape(-1, columns).astype(np.int64, copy=False)


def _add(runs: Runs, text: bytes, block: _Block, nodes: Numbering, numbers: _Numbers) -> None:
    """Add the elements, conditions or geometries of a block."""
    if kernels.find_words(text, block.begin, 1)[0, 0] >= block.end:  # it is empty
        return
    before = 1 if block.name == "Geometries" else 2
    key, size = _type(block, int(lines(text, block.begin, 1).counts[0]) - before)
    if not key:
        raise ReadError(f"has {block.name.lower()} called {block.argument}, which are not known")
    table, order = _integers(text, block, before + size), _ORDER.get(key, slice(None))
    ids = table[:, 0]
    vertices = nodes.points_of(table[:, before:][:, order], ids)
    labels = {} if before == 1 else {_PROPERTIES: table[:, 1]}
    numbers.ids.append(ids)
    numbers.runs.append(len(runs.cells))
    runs.add(Cells(key, vertices, ids), partial(_corners, text, block, before, size), labels)


def _corners(text: bytes, block: _Block, before: int, size: int) -> Places:
    return Places.of_text(_table(text, block, before + size)[:, before:], "i8")


def _type(block: _Block, columns: int) -> tuple[str, int]:
    """Return the type and the number of nodes of the elements of a block, whose first has so many; "": unknown."""
    name = block.argument.split()[0] if block.argument.split() else ""
    ending = _ENDING.search(name)
    size = int(ending[2][:4]) if ending and ending[2] else columns
    if size <= 2 or ending is None:
        key = _LINES.get(size, "") if size <= 2 else ""
        return (key or f"curve{size}" * (block.name == "Conditions" and size > 0)), size
    types = (_PLANES, _LINES) if ending[1] == "2" else (_SOLIDS, _PLANES)
    if _THIN.search(name):
        types = (_LINES, _LINES)
    elif _THICK.search(name):
        types = (_SOLIDS, _SOLIDS)
    elif _FLAT.search(name):
        types = (_PLANES, _PLANES)
    elif block.name == "Conditions":
        types = types[::-1]
    key = next((one[size] for one in types if size in one), "")
    return f"{key}_interface" if key and "Interface" in name else key, size


def _sets(
    runs: Runs, text: bytes, blocks: Sequence[_Block], nodes: Numbering, numbers: dict[str, _Numbers]
) -> dict[str, Int64]:
    """Put the cells of the parts of the model into sets; return the rows of their points."""
    points: dict[str, Int64] = {}
    finders = {name: Numbering(np.concatenate(one.ids)) for name, one in numbers.items() if one.ids}
    for block in blocks:
        listed = next((block.name.removeprefix(part) for part in _PARTS if block.name.startswith(part)), "")
        if not block.part or listed not in ("Nodes", *finders):
            continue
        named = integers_at(text, within(text, block.begin, block.end))
        rows = (nodes if listed == "Nodes" else finders[listed]).rows_of(named)
        rows = np.unique(rows[rows >= 0])
        if listed == "Nodes":
            points[block.part] = np.union1d(points.get(block.part, rows[:0]), rows)
            continue
        ends = np.cumsum([len(ids) for ids in numbers[listed].ids])
        for run, mine, end in zip(numbers[listed].runs, np.split(rows, np.searchsorted(rows, ends[:-1])), ends,
                                  strict=True):  # fmt: skip
            if len(mine):
                runs.put(block.part, run, mine - end + len(runs.cells[run].vertices))
    return points
