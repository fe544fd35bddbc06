"""VTKHDF files, of VTK in HDF5: unstructured grids and polydata in parts, or several of them as blocks.

The points of all parts stand in one data set, and so do the vertices, which each part numbers from 0, and where cells
begin among those of the part, one number more than there are cells. Of several steps in time the first is read where
points and cells are those of all of them.

Source: VTK documentation, "VTKHDF format specification", versions 1.0 to 2.7.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import hdf5
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.source import Arrays, Cells, Source, ghost_vertices
from meshfix_cli.meshfile.vtk.cells import POLYDATA, Run, markings, runs, types_of_sizes

Int64 = NDArray[np.int64]

_BLOCK = "vtkhdf:block"
_SECTIONS = {
    "UnstructuredGrid": {".": b""},
    "PolyData": {"Vertices": b"vertices", "Lines": b"lines", "Polygons": b"polygons", "Strips": b"triangle_strips"},
}
_OF_BLOCKS = ("PartitionedDataSetCollection", "MultiBlockDataSet")
_OFFSETS = ("PointOffsets", "CellOffsets", "ConnectivityIdOffsets")
_MOST_PARTS = 1 << 20


class _Block(NamedTuple):
    """A data set of VTK: its group, its type, and where its points and cells begin among those of all.

    `points` and `cells` are how many each of its parts has.
    """

    path: str
    kind: str
    first_point: int
    first_cell: int
    points: Int64
    cells: Sequence[Int64]

    @property
    def name(self) -> str:
        return self.path.rpartition("/")[2]

    @property
    def point_count(self) -> int:
        return int(self.points.sum())

    @property
    def cell_count(self) -> int:
        return int(sum(counts.sum() for counts in self.cells))


class _Found(NamedTuple):
    """A run of cells of a block, where their vertices stand, and which rows of its data are theirs."""

    block: _Block
    cells: Cells
    corners: Table
    rows: Int64


def parse(data: bytes) -> Source:
    """Read points and cells of all blocks and parts."""
    with hdf5.opened(data, "VTKHDF") as root:
        blocks = _blocks(root)
        points = _points(root, blocks)
        found = [one for block in blocks for one in _runs(root, block)]
        layout = hdf5.layout(root, data, "VTKHDF", points, [partial(_itself, one.corners) for one in found])
        load = cache(partial(_arrays, data, blocks, found))
        names = {name for block in blocks for name in _names(root, block, "CellData")}
        damaged = "is not a readable VTKHDF file: its cell data {} are damaged, or not those of all blocks"
        regions, cells = markings(names, [one.cells for one in found], lambda: load().cell, damaged)
        untold = ("field data",) if any(_names(root, block, "FieldData") for block in blocks) else ()
        notes = ("its points and cells are those of all of its steps in time",) if _is_transient(root) else ()
        several = len(blocks) > 1
        return Source(
            points.read(root), cells, layout, load, ((_BLOCK,) if several else ()) + regions,
            ghost_vertices(cells, len(points.at)), untold, notes, apart=several,
        )  # fmt: skip


def _itself(table: Table) -> Table:
    return table


def _blocks(root: Any) -> list[_Block]:
    """Return the data sets that there are."""
    top = hdf5.group(root, "VTKHDF")
    kind = "" if top is None else _kind(top)
    groups = [top]
    if kind in _OF_BLOCKS:
        groups = [one for name, one in hdf5.groups(top).items() if name != "Assembly"]
        groups = sorted(groups, key=lambda one: (str(hdf5.attribute(one, "Index", 0)).zfill(9), one.name))
    blocks: list[_Block] = []
    for group in groups:
        before = blocks[-1] if blocks else None
        first_point = before.first_point + before.point_count if before else 0
        first_cell = before.first_cell + before.cell_count if before else 0
        blocks.append(_block(group, kind if group is top else _kind(group), first_point, first_cell))
    if not blocks:
        raise ReadError("is not a readable VTKHDF file: there are no blocks in it")
    return blocks


def _kind(group: Any) -> str:
    return str(hdf5.attribute(group, "Type", "")).rstrip("\0")


def _block(group: Any, kind: str, first_point: int, first_cell: int) -> _Block:
    if kind == "ImageData":
        raise ReadError("holds ImageData, whose points stand in rows and have no coordinates that could change")
    if kind not in _SECTIONS:
        raise ReadError(f"is a VTKHDF file of the type {hdf5.printable(kind)!r}, which meshfix does not read")
    points = _counts(group, "NumberOfPoints")[: _parts(group)]
    sections = [_section(group, name) for name in _SECTIONS[kind]]
    cells = [_counts(one, "NumberOfCells", len(points)) for one in sections]
    return _Block(group.name, kind, first_point, first_cell, points[: len(cells[0])], cells)


def _section(group: Any, name: str) -> Any:
    found = group if name == "." else hdf5.group(group, name)
    if found is None:
        raise ReadError(f"is not a readable VTKHDF file: its {hdf5.name_of(group)} has no {name}")
    return found


def _is_transient(root: Any) -> bool:
    steps = hdf5.group(root, "VTKHDF/Steps")
    return steps is not None and hdf5.attribute(steps, "NSteps", 1) != 1


def _parts(group: Any) -> int | None:
    """Return how many parts the first step in time has, None: all; refuse steps that have points of their own."""
    steps = hdf5.group(group, "Steps")
    if steps is None:
        return None
    values = {name: _offsets(steps, name) for name in ("NumberOfParts", "PartOffsets", *_OFFSETS)}
    parts, counts = values["NumberOfParts"], _counts(group, "NumberOfPoints")
    differ = any((found != found[:1]).any() for name, found in values.items() if name != "PartOffsets")
    first = counts[: parts[0]] if len(parts) else counts
    for at in values["PartOffsets"].ravel().tolist():
        differ = differ or at < 0 or not np.array_equal(counts[at : at + len(first)], first)
    if differ or values["PartOffsets"].ravel()[:1].any():
        raise ReadError("has several steps in time with points or cells of their own, and one mesh is read")
    if any(values[name].any() for name in _OFFSETS):
        raise ReadError("has steps in time that do not begin with its first point, which meshfix does not read")
    return len(first)


def _offsets(steps: Any, name: str) -> Int64:
    found = hdf5.data_set(steps, name)
    return np.empty(0, dtype=np.int64) if found is None else hdf5.numbers(found, "iu").astype(np.int64)


def _integers(owner: Any, name: str, size: int | None = None) -> Int64:
    """Return the integers of a data set, of which there must be so many, and may be more."""
    found = hdf5.data_set(owner, name)
    if found is None:
        raise ReadError(f"is not a readable VTKHDF file: its {hdf5.name_of(owner)} has no {name}")
    if size is not None and not 0 <= size <= found.size:
        raise ReadError(f"is truncated: its {hdf5.name_of(found)} has {found.size:,} numbers for {size:,}")
    return hdf5.numbers(found, "iu").ravel()[:size].astype(np.int64)


def _counts(owner: Any, name: str, parts: int | None = None) -> Int64:
    """Return how many of something each part has."""
    found = _integers(owner, name, parts)
    most = 1 << 40
    if len(found) > _MOST_PARTS or (found.size and not 0 <= found.min() <= found.max() <= most):
        raise ReadError(f"is not a readable VTKHDF file: the {name} of its {hdf5.name_of(owner)} cannot be")
    return found


def _points(root: Any, blocks: Sequence[_Block]) -> Table:
    """Return where the points stand."""
    sets, places, before = [], [np.empty((0, 3), dtype=np.int64)], 0
    for block in blocks:
        found, n = hdf5.data_set(root, f"{block.path}/Points"), block.point_count
        if found is None or found.ndim != 2 or found.shape[1] != 3 or found.shape[0] < n:
            raise ReadError(f"is truncated: its {hdf5.printable(block.path)} has not the points that it announces")
        sets.append(found.name)
        places.append(before + np.arange(3 * n).reshape(n, 3))
        before += found.size
    return Table(sets, np.concatenate(places))


def _runs(root: Any, block: _Block) -> Iterator[_Found]:
    """Give the cells of a block."""
    counts = np.array(block.cells).T  # parts, sections
    firsts = np.cumsum([0, *counts.ravel()])[:-1].reshape(counts.shape)
    for i, (name, word) in enumerate(_SECTIONS[block.kind].items()):
        section = _section(root[block.path], name)
        offsets, vertices = _connectivity(section, counts[:, i], block)
        sizes = np.diff(offsets)
        types = types_of_sizes(sizes, *POLYDATA[word]) if word else _integers(section, "Types", len(sizes))
        parts = zip(firsts[:, i].tolist(), counts[:, i].tolist(), strict=True)
        rows = np.concatenate([np.empty(0, dtype=np.int64), *(np.arange(at, at + count) for at, count in parts)])
        for run in runs(types, offsets, vertices):
            ids = rows[run.rows]
            cells = Cells(run.type, run.vertices, ids + block.first_cell)
            yield _Found(block, cells, _corners(section, offsets, run), ids)


def _connectivity(section: Any, counts: Int64, block: _Block) -> tuple[Int64, Int64]:
    """Return where each cell of a section begins (m+1,), and the vertices, numbered as the points of all blocks are."""
    parts = len(counts)
    sizes = _counts(section, "NumberOfConnectivityIds", parts)
    listed = _integers(section, "Offsets", int(counts.sum()) + parts)
    vertices = _integers(section, "Connectivity", int(sizes.sum()))
    ends = np.cumsum(counts + 1)
    if (listed[ends - 1] != sizes).any() or listed[ends - 1 - counts].any():
        raise ReadError("is not a readable VTK file: the offsets of its cells do not fit their vertices")
    before = np.cumsum([0, *sizes])[:-1]
    starts = listed + np.repeat(before, counts + 1)
    offsets = np.concatenate([np.delete(starts, ends - 1), [int(sizes.sum())]])
    n = np.repeat(block.points, sizes)
    first = np.repeat(np.cumsum([0, *block.points])[:-1], sizes) + block.first_point
    return offsets, np.where((vertices >= 0) & (vertices < n), vertices + first, -1)


def _corners(section: Any, offsets: Int64, run: Run) -> Table:
    if not isinstance(run.vertices, np.ndarray):
        return Table([f"{section.name}/Connectivity"], np.empty((0, 0), dtype=np.int64))
    at = offsets[run.rows][:, None] + np.arange(run.vertices.shape[1])
    return Table([f"{section.name}/Connectivity"], at if run.order is None else at[:, run.order])


def _names(root: Any, block: _Block, section: str) -> list[str]:
    found = hdf5.group(root, f"{block.path}/{section}")
    return [] if found is None else list(found)


def _arrays(data: bytes, blocks: Sequence[_Block], found: Sequence[_Found]) -> Arrays:
    """Return the arrays that all blocks have."""
    point: dict[str, NDArray[Any]] = {}
    cell: dict[str, list[NDArray[Any]]] = {}
    unread: list[str] = []
    with hdf5.opened(data, "VTKHDF") as root:
        for section, what in (("PointData", "point"), ("CellData", "cell")):
            for name in dict.fromkeys(name for block in blocks for name in _names(root, block, section)):
                parts = [_values(root, block, section, name) for block in blocks]
                some = [part for part in parts if part is not None]
                if len(some) < len(parts) or len({part.shape[1:] for part in some}) > 1:
                    unread.append(f"{what} data {name}")
                elif section == "PointData":
                    point[name] = np.concatenate(some)
                else:
                    cell[name] = [some[blocks.index(one.block)][one.rows] for one in found]
    several, sets = len(blocks) > 1, dict[str, list[Int64]]()
    for number, block in enumerate(blocks, start=1) if several else ():
        cell.setdefault(_BLOCK, [np.zeros(len(one.rows), dtype=np.int64) for one in found])
        mine = [np.arange(len(one.rows) if one.block is block else 0) for one in found]
        for run, one in enumerate(found):
            if one.block is block:
                cell[_BLOCK][run][:] = number
        sets[block.name] = mine
    return Arrays(point, cell, cell_sets=sets, unread=tuple(unread))


def _values(root: Any, block: _Block, section: str, name: str) -> NDArray[Any] | None:
    """Return the rows of an array, of the first step in time; None: it is not there, or not of numbers."""
    found = hdf5.data_set(root, f"{block.path}/{section}/{name}")
    size = block.point_count if section == "PointData" else block.cell_count
    if found is None or found.dtype.kind not in "iuf" or not 1 <= found.ndim <= 2:
        return None
    steps = hdf5.data_set(root, f"{block.path}/Steps/{section}Offsets/{name}")
    first = int(hdf5.numbers(steps, "iu").ravel()[0]) if steps is not None and steps.size else 0
    if not 0 <= first <= len(found) - size:
        return None
    return np.asarray(hdf5.numbers(found, "iuf")[first : first + size])
