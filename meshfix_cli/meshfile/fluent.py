"""Ansys Fluent's .cas and .msh files: sections in parentheses, of nodes, of faces with the cells beside them, of zones.

All numbers but coordinates, and those of zones that have names, are hexadecimal. A face has its nodes and two cells, of
which 0 is none; cells are what their faces enclose. Sections with numbers from 2000 on are binary.

Source: Ansys, "Fluent User's Guide", appendix "Case and Data File Formats", section "Grid Sections".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.faces import Faces
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import SLAB, InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, chain, within
from meshfix_cli.meshfile.text import Spans, in_line

_SECTION = re.compile(rb"(?:\A(?:\xef\xbb\xbf)?|(?<=[\n\r)]))[ \t]*\([ \t]*(\d{1,4})\s*(?=[\"'(23])")
_HEAD = re.compile(rb"\s*\(([0-9a-fA-F\s]*)\)")
_BODY = re.compile(rb"\s*\(")
_DIMENSION = re.compile(rb"\s*([23])\s*\)")
_NAME = re.compile(rb"\s*\(\s*(\d{1,9})\s+([^\s()]+)\s+([^\s()]+)")
_NODES, _CELLS, _FACES, _NAMES = (10, 2010, 3010), (12, 2012, 3012), (13, 2013, 3013), (39, 45)
_REALS = {2010: "<f4", 3010: "<f8"}
_INTERIOR = 2  # the kind of a zone of faces between cells
_PERIODIC = (12, 8)  # those of faces that have shadows, and of these
_SIZES = {2: "line", 3: "triangle", 4: "quad"}
_MIXED = (0, 5)  # kinds of zones whose faces each tell their size
_ZONE = "fluent:zone"
_MOST = 15  # digits of 64 bits
_DIGITS = np.full(256, -1, dtype=np.int64)
for _number, _characters in enumerate(zip("0123456789abcdef", "0123456789ABCDEF", strict=True)):
    _DIGITS[[ord(one) for one in _characters]] = _number


class _Zone(NamedTuple):
    """Some faces: their zone, its kind, their sizes, nodes one behind the other, and the cells (f, 2) beside them."""

    number: int
    kind: int
    sizes: Int64
    nodes: Int64
    cells: Int64


@dataclass
class _Grid:
    """The sections of a file.

    Attributes
    ----------
    nodes : list of pairs
        The number of the first, and the places of their coordinates.
    cells : list of tuples
        The zone, the first and the last cell.
    """

    dimension: int = 0
    nodes: list[tuple[int, Places]] = field(default_factory=list)
    cells: list[tuple[int, int, int]] = field(default_factory=list)
    faces: list[_Zone] = field(default_factory=list)
    names: dict[int, str] = field(default_factory=dict)


def parse(data: bytes) -> Source:
    """Read nodes, and cells from their faces; zones of faces that are not inside are cells of the file as well."""
    grid = _read(data)
    if not grid.nodes or not grid.faces:
        raise ReadError("is not a readable file of Ansys Fluent: it has no nodes, or no faces")
    if len({(places.dtype, places.begin.shape[1]) for _, places in grid.nodes}) > 1:
        raise ReadError("has nodes in several formats, which meshfix does not read")
    begin = np.concatenate([places.begin for _, places in grid.nodes])
    ends = [places.end for _, places in grid.nodes if places.end is not None]
    coordinates = Places(begin, np.concatenate(ends) if ends else None, grid.nodes[0][1].dtype)
    numbers = [np.arange(first, first + len(places.begin)) for first, places in grid.nodes]
    points = Numbering(np.concatenate(numbers))
    runs, paired = _runs(grid, points)
    held = None if paired.size == 0 else np.isin(np.arange(len(begin)), paired)
    return Source(
        coordinates.read(data), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays,
        (_ZONE,) * bool(grid.cells), held, untold=("what else a case has, in sections of its own",),
        oriented=False,  # programs do not agree about it
    )  # fmt: skip


def _read(data: bytes) -> _Grid:
    """Read the sections that make the mesh."""
    grid, at = _Grid(), 0
    while section := _SECTION.search(data, at):
        number, at = int(section[1]), section.end()
        if number == 2 and (found := _DIMENSION.match(data, at)):
            grid.dimension = int(found[1])
        elif number in _NAMES and (found := _NAME.match(data, at)):
            grid.names[int(found[1])] = found[3].decode("utf-8", "replace")
        elif number in (*_NODES, *_CELLS, *_FACES):
            head = _HEAD.match(data, at)
            if head is None:
                raise in_line(data, at, f"section {number} has no numbers in parentheses")
            at = _take(data, grid, number, [int(word, 16) for word in head[1].split()], head.end())
    return grid


def _take(data: bytes, grid: _Grid, number: int, head: Sequence[int], at: int) -> int:
    """Take a section of nodes, cells or faces; return the offset behind it."""
    body = _BODY.match(data, at)
    if len(head) < 3 or head[0] == 0:  # which only announces how many there are in all
        return at
    count = head[2] - head[1] + 1
    if not 0 <= count <= len(data):
        raise ReadError(f"is truncated: section {number} announces {count:,} rows")
    if number in _CELLS:
        grid.cells.append((head[0], head[1], head[2]))
        return at if body is None else _behind(data, number, body.end(), 4 * count)
    if body is None:
        raise in_line(data, at, f"section {number} has no body")
    if number in _NODES:
        columns = head[4] if len(head) > 4 else grid.dimension
        if columns not in (2, 3):
            raise in_line(data, at, "a section of nodes does not tell how many coordinates they have")
        places, end = _coordinates(data, number, body.end(), count, columns)
        grid.nodes.append((head[1], places))
        return end
    zone, end = _faces(data, number, body.end(), count, head)
    grid.faces.append(zone)
    return end


def _behind(data: bytes, number: int, at: int, size: int) -> int:
    """Return the offset of the parenthesis that ends a body; of a binary one the size is known."""
    end = data.find(b")", at + size if number > 2000 else at)
    if end < 0:
        raise ReadError(f"is truncated: section {number} does not end")
    return end


def _coordinates(data: bytes, number: int, at: int, count: int, columns: int) -> tuple[Places, int]:
    if number in _REALS:
        size = columns * np.dtype(_REALS[number]).itemsize
        end = _behind(data, number, at, count * size)
        return Places.of_rows(at + size * np.arange(count), columns, _REALS[number]), end
    end = _behind(data, number, at, 0)
    spans = within(data, at, end)
    if len(spans) != count * columns:
        raise in_line(data, at, f"there are not the {count:,} nodes of {columns} coordinates that are announced")
    return Places.of_text(spans.reshape(count, columns, 2)), end


def _faces(data: bytes, number: int, at: int, count: int, head: Sequence[int]) -> tuple[_Zone, int]:
    """Read the faces of a zone."""
    kind, size = (head[3], head[4]) if len(head) > 4 else (0, 0)
    if number > 2000:
        values, end = _binary(data, number, at, count, size)
    else:
        end = _behind(data, number, at, 0)
        values = _hexadecimal(data, within(data, at, end))
    if size in _MIXED:
        rows = chain(values, count, f"there are not the {count:,} faces that are announced", more=3)
        sizes = values[rows]
        inside = np.ones(len(values), dtype=bool)
        inside[rows] = False
        ends = rows + sizes + 1
        inside[ends] = inside[ends + 1] = False
        cells = np.stack([values[ends], values[ends + 1]], axis=1)
        return _Zone(head[0], kind, sizes, values[inside], cells), end
    if len(values) != count * (size + 2):
        raise in_line(data, at, f"there are not the {count:,} faces of {size} nodes that are announced")
    table = values.reshape(count, size + 2)
    return _Zone(head[0], kind, np.full(count, size), table[:, :size].ravel(), table[:, size:]), end


def _binary(data: bytes, number: int, at: int, count: int, size: int) -> tuple[Int64, int]:
    """Read the integers of a binary section; those of faces that tell their sizes end where they say."""
    words = np.frombuffer(data, dtype="<i4", count=(len(data) - at) // 4, offset=at)
    total = count * (size + 2)
    if size in _MIXED:
        total = 0
        for _ in range(count):
            if not 0 <= total < len(words) or words[total] < 0:
                raise ReadError(f"is truncated: section {number} announces {count:,} faces")
            total += int(words[total]) + 3
    if total > len(words):
        raise ReadError(f"is truncated: section {number} announces {count:,} faces")
    return words[:total].copy(), _behind(data, number, at, 4 * total)


def _hexadecimal(data: bytes, spans: Spans) -> Int64:
    """Return the numbers (k,) that words are; ReadError where one is none."""
    values = np.empty(len(spans), dtype=np.int64)
    for at in range(0, len(spans), SLAB):
        values[at : at + SLAB] = _slab(data, spans[at : at + SLAB])
    return values


def _slab(data: bytes, spans: Spans) -> Int64:
    raw, values = np.frombuffer(data, dtype=np.uint8), np.zeros(len(spans), dtype=np.int64)
    begin, lengths = spans[:, 0], spans[:, 1] - spans[:, 0]
    wrong = lengths > _MOST
    for i in range(min(int(lengths.max()), _MOST)):
        here = lengths > i
        digits = np.where(here, _DIGITS[raw[np.minimum(begin + i, len(raw) - 1)]], 0)
        wrong |= digits < 0
        values = np.where(here, values * 16 + digits, values)
    if wrong.any():
        first, last = spans[np.argmax(wrong)].tolist()
        raise in_line(data, first, f"{data[first:last][:40].decode('latin-1')!r} is not a hexadecimal number")
    return values


def _runs(grid: _Grid, points: Numbering) -> tuple[Runs, Int64]:
    """Make cells of faces, and add the faces of zones that are not inside; with the points of periodic ones."""
    zones = [(zone.number, zone.kind, len(zone.sizes)) for zone in grid.faces]
    sizes = np.concatenate([zone.sizes for zone in grid.faces])
    cells = np.concatenate([zone.cells for zone in grid.faces]).astype(np.int64) - 1
    nodes = np.concatenate([zone.nodes for zone in grid.faces])
    grid.faces.clear()  # which would be there twice
    nodes = points.points_of(nodes[:, None])[:, 0]
    if (cells.max(axis=1, initial=-1) < 0).any():
        raise ReadError("is not a readable file of Ansys Fluent: a face lies beside no cell")
    offsets, runs = np.append(0, np.cumsum(sizes)), Runs()
    faces = _owned(offsets, nodes, cells)
    del cells
    zone_of = np.zeros(faces.cells, dtype=np.int64)
    for number, first, last in grid.cells:
        zone_of[max(first - 1, 0) : max(last, 0)] = number
    for key, vertices, ids in _loops(faces) if sizes.max(initial=0) == 2 else faces.elements():
        labels, run = zone_of[ids], len(runs.cells)
        runs.add(Cells(key, vertices, ids + 1), _not_turned, {_ZONE: labels})
        for number in np.unique(labels).tolist() if grid.cells else ():
            runs.put(_name(grid.names, number), run, np.flatnonzero(labels == number))
    at, paired = 0, [nodes[:0]]
    for number, kind, count in zones:
        if kind != _INTERIOR:
            _add_facets(runs, offsets[at : at + count + 1], nodes, _name(grid.names, number))
        if kind in _PERIODIC:
            paired.append(nodes[offsets[at] : offsets[at + count]])
        at += count
    return runs, np.concatenate(paired)


def _name(names: Mapping[int, str], number: int) -> str:
    return names.get(number, f"zone {number}")


def _owned(offsets: Int64, nodes: Int64, cells: Int64) -> Faces:
    """Return faces whose loops are positive seen from outside of their owners: here they are so seen from inside."""
    alone = cells[:, 0] < 0  # these have the other cell for an owner, and keep their loops
    turned = np.repeat(offsets[:-1] + offsets[1:] - 1, np.diff(offsets))
    turned -= np.arange(len(nodes))
    if alone.any():
        kept = np.repeat(alone, np.diff(offsets))
        turned[kept] = np.flatnonzero(kept)
    owner, other = np.where(alone, cells[:, 1], cells[:, 0]), np.where(alone, -1, cells[:, 1])
    return Faces(offsets, nodes[turned], owner, other)


def _loops(faces: Faces) -> Iterator[tuple[str, Int64, Int64]]:
    """Give the types of cells of a plane mesh, their vertices, and their numbers: the loops that their edges make."""
    edges = faces.vertices.reshape(-1, 2)[:, ::-1]
    inner = faces.neighbour >= 0
    cell = np.concatenate([faces.owner, faces.neighbour[inner]])
    both = np.concatenate([edges, edges[inner][:, ::-1]])
    order = np.argsort(cell, kind="stable")
    both, numbers, first, count = both[order], *np.unique(cell[order], return_index=True, return_counts=True)
    for size in np.unique(count).tolist():
        here = np.flatnonzero(count == size)
        start, end = np.moveaxis(both[first[here][:, None] + np.arange(size)], -1, 0)
        vertices = [start[:, 0]]
        at = end[:, 0]
        for _ in range(size - 1):
            vertices.append(at)
            at = np.take_along_axis(end, (start == at[:, None]).argmax(axis=1)[:, None], axis=1)[:, 0]
        loops = np.stack(vertices, axis=1)
        closed = (at == start[:, 0]) & (np.sort(loops, axis=1) == np.sort(start, axis=1)).all(axis=1)
        if size < 3 or not closed.all():
            wrong = numbers[here[~closed]] if size > 2 else numbers[here]
            raise ReadError(f"is not a readable mesh: the faces of the cell {wrong[0] + 1} are no loop")
        yield _SIZES.get(size, "polygon"), loops, numbers[here]


def _add_facets(runs: Runs, offsets: Int64, nodes: Int64, name: str) -> None:
    sizes = np.diff(offsets)
    for size in np.unique(sizes).tolist():
        rows = offsets[:-1][sizes == size]
        runs.add(Cells(_SIZES.get(size, "polygon"), nodes[rows[:, None] + np.arange(size)]), _not_turned, sets=(name,))


def _not_turned() -> Places:
    raise ReadError("has cells that are made of faces, of which none can be renumbered alone")
