"""Files of gmsh, 2.2 and 4.1, as text and binary: elements by their entities, whose physical groups have names.

Source: "Gmsh Reference Manual", chapter "Gmsh file formats", and there "Legacy formats".
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import WriteError
from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.anew.content import Content, Int64, words_of
from meshfix_cli.meshfile.anew.gmsh_groups import Groups, groups_of
from meshfix_cli.meshfile.anew.tables import integers, numbered, reals
from meshfix_cli.meshfile.gmsh import ENTITY, SETS
from meshfix_cli.meshfile.gmsh.cells import TYPES, order_of
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import PHYSICAL, Cells

HELD = {key: kind for kind, (key, _) in TYPES.items()}
MOST = 2**31 - 1
_LONGEST = 200  # bytes of a name: gmsh reads lines of 255
_MOST_RUNS = 100_000  # of elements of one entity, each of which has a header


class _Out(NamedTuple):
    """Numbers as text, or binary with the lowest byte first."""

    binary: bool

    def head(self, kinds: str, *values: float) -> bytes:
        """Return numbers of the types of `struct`."""
        if self.binary:
            return struct.pack(f"<{kinds}", *values)
        return (" ".join(map(repr, values)) + "\n").encode()

    def rows(self, kind: str, whole: Int64, places: NDArray[np.float64] | None = None) -> bytes:
        """Return rows of integers (n, k) of a type, and of reals (n, l) behind one or none of them."""
        if not self.binary:
            if places is None:
                return integers(whole)
            return numbered(whole[:, 0], places) if whole.size else reals(places)
        if places is None:
            return whole.astype(f"<{kind}").tobytes()
        table = np.empty(len(whole), dtype=[("whole", f"<{kind}", whole.shape[1:]), ("reals", "<f8", places.shape[1:])])
        table["whole"], table["reals"] = whole, places
        return table.tobytes()

    def cut(self, rows: bytes, count: int, begin: Sequence[int]) -> list[bytes | memoryview]:
        """Return what `rows` gave for some, from each of those that begin a part up to the next."""
        if self.binary:
            ends = np.arange(count + 1) * (len(rows) // max(count, 1))
        else:
            ends = np.concatenate([[0], np.flatnonzero(np.frombuffer(rows, dtype=np.uint8) == ord("\n")) + 1])
        view, at = memoryview(rows), ends[[*begin, count]].tolist()
        return [view[first:last] for first, last in pairwise(at)]


def written(content: Content, form: Format) -> bytes:
    """Return a file of version 2.2, in which an element is in one group, or of 4.1, in which it may be in several."""
    out, old = _Out(bool(form.binary)), form.name == "gmsh22"
    groups = groups_of(content, several=not old)
    kept = [
        i
        for i, run in enumerate(content.cells)
        if run.type in HELD and len(run.vertices) and run.vertices.min() >= 0  # none lacks a node
    ]
    if not kept:
        raise content.refusal(form)
    about = f"{'2.2' if old else '4.1'} {int(out.binary)} 8\n".encode()
    parts = [_section("MeshFormat", about, *[struct.pack("<i", 1), b"\n"] * out.binary)]
    if groups.titles:
        called = _words(list(dict.fromkeys(name for _, _, name in groups.titles)))
        names = "".join(f'{d} {number} "{called[name]}"\n' for d, number, name in groups.titles)
        parts.append(_section("PhysicalNames", f"{len(groups.titles)}\n{names}".encode()))
    parts += (_version_2 if old else _version_4)(content, groups, kept, out)
    ids = np.concatenate([content.elements[i] for i in kept])
    views = [
        ("NodeData", content.nodes, dict(content.arrays.point)),
        ("ElementData", ids, dict(_data(content, groups, kept))),
    ]
    for section, tags, arrays in views:
        called = _words(list(arrays))
        parts += [_view(section, called[name], values, tags, out) for name, values in arrays.items()]
    return b"".join(parts)


def _section(name: str, *content: bytes | memoryview) -> bytes:
    return b"".join([f"${name}\n".encode(), *content, f"$End{name}\n".encode()])


def _words(names: Sequence[str]) -> dict[str, str]:
    """Return what names become, no two the same."""
    return words_of(names, " -\U0010ffff", _LONGEST, spelled=_quoted)


def _quoted(name: str) -> str:
    """Return what may stand between quotation marks on a line."""
    return " ".join(name.replace('"', "'").splitlines())


def _table(content: Content, i: int) -> Int64:
    """Return the numbers (m, 1 + k) of the elements of a run, and of their nodes in gmsh's order."""
    run = content.cells[i]
    order = order_of(run.type)
    nodes = content.nodes_of(run.vertices if order is None else run.vertices[:, np.argsort(order)])
    return np.column_stack([content.elements[i], nodes])


def _version_2(content: Content, groups: Groups, kept: Sequence[int], out: _Out) -> Iterator[bytes]:
    """Give nodes, and elements of which each has a group and an entity."""
    n, points = len(content.points), content.in_space()
    yield _section("Nodes", f"{n}\n".encode(), out.rows("i4", content.nodes[:, None], points), b"\n" * out.binary)
    parts = [f"{sum(len(content.elements[i]) for i in kept)}\n".encode()]
    for i in kept:
        table, kind = _table(content, i), HELD[content.cells[i].type]
        columns = [groups.physical[i], groups.entities[i]]
        if out.binary:
            parts.append(out.head("3i", kind, len(table), 2))
        else:
            columns[:0] = [np.full(len(table), kind), np.full(len(table), 2)]
        parts.append(out.rows("i4", np.column_stack([table[:, 0], *columns, table[:, 1:]])))
    yield _section("Elements", *parts, b"\n" * out.binary)


def _version_4(content: Content, groups: Groups, kept: Sequence[int], out: _Out) -> Iterator[bytes]:
    """Give entities with their groups, nodes by the entities on which they lie, and elements by theirs."""
    points = content.in_space()
    runs = [(content.cells[i], groups.entities[i]) for i in kept]
    end = b"\n" * out.binary
    yield _section("Entities", *_entities(points, groups, runs, out), end)
    owners, keys = _owners(len(points), runs)
    starts = _changes(owners)
    if len(starts) > _MOST_RUNS:  # of a mesh whose nodes are in no order of entities
        owners, starts = np.full(len(points), owners.max()), [0]
    tags = content.nodes[:, None]
    sizes = np.diff([*starts, len(points)]).tolist()
    numbers = out.cut(out.rows("u8", tags), len(points), starts)
    places = out.cut(out.rows("u8", tags[:, :0], points), len(points), starts)
    blocks: list[bytes | memoryview] = [out.head("4Q", len(starts), len(points), *_range(tags))]
    for owner, size, mine, there in zip(owners[starts].tolist(), sizes, numbers, places, strict=True):
        blocks += [out.head("3iQ", *keys[owner], 0, size), mine, there]
    yield _section("Nodes", *blocks, end)
    yield _section("Elements", *_elements(runs, [_table(content, i) for i in kept], out), end)


def _range(*numbers: Int64) -> tuple[int, int]:
    """Return the smallest and the largest number."""
    return min(int(mine.min()) for mine in numbers), max(int(mine.max()) for mine in numbers)


def _elements(runs: Sequence[tuple[Cells, Int64]], tables: Sequence[Int64], out: _Out) -> list[bytes | memoryview]:
    """Return a block for each run of elements of one entity."""
    starts = [_changes(entities) for _, entities in runs]
    count = sum(map(len, starts))
    if count > _MOST_RUNS:
        raise WriteError(f"cannot be written as gmsh: its groups change {count:,} times, so use --format gmsh22")
    about = [count, sum(map(len, tables)), *_range(*(table[:, 0] for table in tables))]
    parts: list[bytes | memoryview] = [out.head("4Q", *about)]
    for (run, entities), table, begin in zip(runs, tables, starts, strict=True):
        rows = out.cut(out.rows("u8", table), len(table), begin)
        sizes = np.diff([*begin, len(table)]).tolist()
        about = [dimension_of(run.type), HELD[run.type]]
        for entity, size, mine in zip(entities[begin].tolist(), sizes, rows, strict=True):
            parts += [out.head("3iQ", about[0], entity, about[1], size), mine]
    return parts


def _entities(
    points: NDArray[np.float64], groups: Groups, runs: Sequence[tuple[Cells, Int64]], out: _Out
) -> Iterator[bytes]:
    """Give the entities by their dimension, each with its box and its groups."""
    boxes: dict[tuple[int, int], NDArray[np.float64]] = {}
    for run, entities in runs:
        order = np.argsort(entities, kind="stable")
        tags, begin = np.unique(entities[order], return_index=True)
        there = points[run.vertices[order]]
        low, high = (bound.reduceat(end, begin) for bound, end in _bounds(there))
        for tag, *box in zip(tags.tolist(), low, high, strict=True):
            key = dimension_of(run.type), tag
            before = boxes.get(key, np.array(box))
            boxes[key] = np.array([np.minimum(before[0], box[0]), np.maximum(before[1], box[1])])
    yield out.head("4Q", *(sum(dimension == key[0] for key in boxes) for dimension in range(4)))
    for key in sorted(boxes):
        box, mine = boxes[key].ravel().tolist(), groups.groups.get(key, ())
        place = box if key[0] else box[:3]
        bounds = (0,) if key[0] else ()
        kinds = f"i{len(place)}dQ{len(mine)}i{'Q' * len(bounds)}"
        yield out.head(kinds, key[1], *place, len(mine), *mine, *bounds)


def _bounds(there: NDArray[np.float64]) -> tuple[tuple[np.ufunc, NDArray[np.float64]], ...]:
    return (np.minimum, there.min(axis=1)), (np.maximum, there.max(axis=1))


def _owners(n: int, runs: Sequence[tuple[Cells, Int64]]) -> tuple[Int64, list[tuple[int, int]]]:
    """Return for each point (n,) which entity it lies on: one of the lowest dimension whose elements have it."""
    dimensions = [dimension_of(run.type) for run, _ in runs]
    keys = sorted({(d, tag) for d, (_, tags) in zip(dimensions, runs, strict=True) for tag in np.unique(tags).tolist()})
    highest = max(dimensions)
    owners = np.full(n, next(i for i, key in enumerate(keys) if key[0] == highest))
    for dimension in range(highest, -1, -1):
        here = [(i, tag) for i, (d, tag) in enumerate(keys) if d == dimension]
        for (run, tags), mine in zip(runs, dimensions, strict=True):
            if mine == dimension:
                first = np.searchsorted([tag for _, tag in here], tags)
                owners[run.vertices] = (here[0][0] + first)[:, None]
    return owners, keys


def _changes(values: Int64) -> list[int]:
    """Where runs of one value begin."""
    return [0, *(np.flatnonzero(np.diff(values)) + 1).tolist()]


def _data(content: Content, groups: Groups, kept: Sequence[int]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Give the data of elements, without what the groups and the entities tell; 0 is no group."""
    told = {content.region: groups.physical, ENTITY: groups.entities}
    for name, runs in content.arrays.cell.items():
        tags = told.get(name)
        same = tags is not None and all(((runs[i] == tags[i]) | (runs[i] == 0)).all() for i in kept)
        if kept and name != SETS and not same:
            own = f"{name} of the input" if name in (PHYSICAL, ENTITY) else name
            yield own, np.concatenate([runs[i] for i in kept])


def _view(section: str, name: str, values: Any, tags: Int64, out: _Out) -> bytes:
    """Return data of nodes or elements: its name, its step in time, and the values of those that have any."""
    values = np.asarray(values)
    if values.dtype.kind not in "fiub" or not values.size:
        return b""
    table = values.reshape(len(values), -1).astype(np.float64)
    there = ~np.isnan(table).all(axis=1)
    head = f'1\n"{name}"\n1\n0.0\n3\n0\n{table.shape[1]}\n{there.sum()}\n'.encode()
    return _section(section, head, out.rows("i4", tags[there][:, None], table[there]), b"\n" * out.binary)
