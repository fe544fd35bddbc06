"""XDMF files, of FEniCS, meshio and others: XML, with the numbers in it, or in HDF5 or raw bytes beside it.

All grids of a file are of one mesh: what FEniCS calls mesh tags are cells of it, or on its boundary, with labels, and
the grids of a series in time have the same points. Coordinates that stand there several times are all written.

Source: XDMF, "XDMF Model and Format".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from html import unescape
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError, naming
from meshfix_cli.mesh.elements import SIMPLICES, dimension_of
from meshfix_cli.meshfile.hdf5 import printable
from meshfix_cli.meshfile.source import Arrays, Cells, Source, regions_among
from meshfix_cli.meshfile.splice import apply
from meshfix_cli.meshfile.together import Together
from meshfix_cli.meshfile.vtk.arrays import replacement
from meshfix_cli.meshfile.vtk.cells import groups_among, sets_among, sets_of_runs
from meshfix_cli.meshfile.vtk.xml import Element, XmlFile
from meshfix_cli.meshfile.xdmf.cells import Run, Topology, topology_of
from meshfix_cli.meshfile.xdmf.items import Beside, Contents, files_named, item_of
from meshfix_cli.meshfile.xdmf.layout import Divided, Geometry, geometry_of, points_and_layout
from meshfix_cli.meshfile.xdmf.tree import Grid, Tree, said

_MAP = re.compile(r'<map key="([^"]*)" dim="([0-3])">\s*(-?\d{1,18})\s*</map>')
_LABELS = ("name_to_read",)  # what FEniCS's tutorials call the labels of cells


def parse(data: bytes, path: Path | None = None) -> Source:
    """Read the mesh of a file, and of those beside it that it names."""

    def beside(name: str) -> bytes:
        if path is None:
            raise ReadError(f"names {name!r}, which is beside it: it is read neither from a stream nor compressed")
        with naming(name):
            return _read(path, name)

    return _parsed(data, path, beside)


def _read(path: Path, name: str) -> bytes:
    there = path.parent / name
    try:
        if there.resolve() == path.resolve():
            raise ReadError("names itself as a file beside it")
        return there.read_bytes()
    except (OSError, ValueError) as error:
        raise ReadError(getattr(error, "strerror", None) or "cannot be read") from error


def _parsed(data: bytes, path: Path | None, beside: Beside) -> Source:
    """Read a file of which others are given."""
    tree, contents = Tree(data), Contents(data, beside)
    source, layout = _Mesh(tree, contents).read()
    names = contents.names
    if path is None or not names:
        return source
    bounds = [contents.start(name) for name in names]

    def parsed(files: Sequence[bytes]) -> Source:
        known = dict(zip(names, files[1:], strict=True))
        return _parsed(files[0], path, lambda name: known[name] if name in known else beside(name))

    named = dict.fromkeys(name for name, *_ in files_named(tree))
    copied = [name for name in named if name not in names and (path.parent / name).is_file()]
    pieces = Together(
        path,
        [path, *(path.parent / name for name in names)],
        layout,
        lambda original, points, cells: layout.divided(original, points, cells, bounds),
        parsed,
        [path.parent / name for name in copied],
        renamed=partial(_renamed, [*names, *copied]),
    )
    return replace(source, layout=None, pieces=pieces)


def _renamed(old: Sequence[str], contents: list[bytes], names: Sequence[str]) -> list[bytes]:
    """Return the files of which the first calls the others by other names."""
    tree, new = Tree(contents[0]), dict(zip(old, names[1:], strict=True))
    edits = [
        replacement(begin, end, escape(new[name]).encode()) for name, begin, end in files_named(tree) if name in new
    ]
    return [apply(contents[0], edits) if edits else contents[0], *contents[1:]]


def promoted(data: bytes) -> bytes:
    """Return a file of single precision with coordinates in double precision, where they are text in it."""
    tree = Tree(data)
    items = [item for grid in tree.grids() for item in geometry_of(tree, grid.geometry).items]
    single = {item.element.at: item for item in items if item.dtype.str[1:] == "f4"}
    if not single or any(item.file for item in single.values()):  # what is said of a data set may not be what it is
        raise ReadError("has coordinates of single precision in a file beside it, which cannot be double")
    file = XmlFile(data, tree.root, (), False, 0, 0)
    return file.edited([file.attribute(item.element, "Precision", "8") for item in single.values()])


class _Entry(NamedTuple):
    """A grid, and which cells of the mesh its cells are.

    Attributes
    ----------
    grid : Grid
    topology : Topology
    first : int
        The number of its first run among those of the mesh.
    rows : (k,) int64 or None
        For each of its cells which one of the first grid it is; None: they are those of its own runs.
    """

    grid: Grid
    topology: Topology
    first: int
    rows: NDArray[np.int64] | None = None


class _Mesh:
    """What the grids of a file are together."""

    def __init__(self, tree: Tree, contents: Contents) -> None:
        self.tree, self.contents = tree, contents
        grids = tree.grids()
        self.copies = self._geometries(grids)
        self.runs: list[tuple[Topology, Run]] = []
        self.entries = self._placed(grids)

    def read(self) -> tuple[Source, Divided]:
        """Return all of it, and its layout."""
        cells, before = [], 0
        for topology, runs in groupby(self.runs, key=itemgetter(0)):
            several = len(topology.runs) > 1
            for _, run in runs:
                cells.append(Cells(run.key, topology.vertices(run), run.rows + before if several else None))
            before += topology.cells
        points, layout = points_and_layout(self.contents, self.copies, self.runs)
        oriented = not (_ascending(cells) or any(topology.item.path.startswith("/Mesh/") for topology, _ in self.runs))
        source = Source(
            points, cells, layout, self._arrays, self._regions(), untold=tuple(self._untold()), oriented=oriented
        )
        return source, layout

    def _geometries(self, grids: Sequence[Grid]) -> list[Geometry]:
        """Return where the points of the grids stand, which are the same in all places."""
        found: dict[tuple[object, ...], Geometry] = {}
        for grid in grids:
            geometry = geometry_of(self.tree, grid.geometry)
            found.setdefault(geometry.place, geometry)
        first, *others = found.values()
        if others:
            points = first.read(self.contents).tobytes()
            if any(one.shape != first.shape or one.read(self.contents).tobytes() != points for one in others):
                raise _several(grids)
        return [first, *others]

    def _placed(self, grids: Sequence[Grid]) -> list[_Entry]:
        """Find out which cells are the mesh, which are those of another grid once more, and which are beside them."""
        found: dict[tuple[object, ...], Topology] = {}
        topologies = []
        for grid in grids:
            one = topology_of(self.tree, grid.topology, self.contents)
            topologies.append(found.setdefault(one.item.place, one))
        dimensions = [max((dimension_of(run.key) for run in one.runs), default=0) for one in topologies]
        main = dimensions.index(max(dimensions))
        order = [main, *(i for i in range(len(grids)) if i != main)]
        entries: list[_Entry] = []
        for i in order:
            entries.append(self._entry(grids[i], topologies[i], entries, dimensions[i] == dimensions[main]))
        return entries

    def _entry(self, grid: Grid, topology: Topology, others: Sequence[_Entry], solved: bool) -> _Entry:
        for other in others:
            if topology is other.topology or _are_same(topology, other.topology):
                return other._replace(grid=grid)
        rows = _rows_in(others[0].topology, topology) if others and solved else None
        first = len(self.runs)
        if rows is None:
            self.runs += [(topology, run) for run in topology.runs]
        return _Entry(grid, topology, first if rows is None else 0, rows)

    def _regions(self) -> tuple[str, ...]:
        """Return what tells regions apart: labels that other grids have for cells of the first, or so called."""
        first, *others = [entry for entry in self.entries if entry.first == 0]
        labels = [_name(one) for entry in others if not entry.grid.timed for one in _of_cells(entry.grid)]
        named = [_name(one) for one in _of_cells(first.grid)]
        known = [name for name in named if name in _LABELS]
        return tuple(dict.fromkeys([*labels, *known, *regions_among(named)]))

    def _arrays(self) -> Arrays:
        """Return the data of points and cells, of several steps in time the first."""
        n = self.copies[0].shape[0]
        point: dict[str, NDArray[Any]] = {}
        parts: dict[str, dict[int, NDArray[Any]]] = {}
        unread: list[str] = []
        for entry in self.entries:
            for one in entry.grid.attributes:
                name, of_cells = _name(one), one in _of_cells(entry.grid)
                values = self._values(one, entry.topology.cells if of_cells else n)
                if values is None or said(one, "Center") not in ("", "node", "cell"):
                    unread.append(f"{'cell' if of_cells else 'point'} data {name}")
                elif of_cells:
                    self._put(parts.setdefault(name, {}), entry, values)
                else:
                    point.setdefault(name, values)
        cell = {name: self._filled(found) for name, found in parts.items()}
        point_sets, cell_sets = self._sets(n)
        return Arrays(
            point,
            cell,
            groups_among(self._told(), regions_among(cell)),
            {**sets_among(point), **point_sets},
            {**sets_of_runs(cell), **cell_sets},
            tuple(dict.fromkeys(unread)),
        )

    def _told(self) -> dict[str, NDArray[np.int64]]:
        """Return what meshio tells of groups: their numbers and dimensions."""
        texts = [self.tree.data[one.begin : one.end] for entry in self.entries for one in entry.grid.told]
        plain = (text.decode("utf-8", "replace") for text in texts)
        inner = (text if "<![CDATA[" in text else unescape(text) for text in plain)
        return {
            unescape(name): np.array([int(number), int(dimension)])
            for name, dimension, number in _MAP.findall("".join(inner))
        }

    def _values(self, attribute: Element, count: int) -> NDArray[Any] | None:
        """Return the values (count,) or (count, k) of an attribute; None: they are others, or damaged."""
        with suppress(ReadError):
            item = item_of(self.tree, attribute)
            values = self.contents.read(item, data=True)
            if item.dtype == np.uint8 and values.max(initial=0) < 2 <= 2 + values.min(initial=0):
                values = values.astype(np.uint8)  # which marks a set
            if count and values.size and values.size % count == 0:
                return values if values.size == count else values.reshape(count, -1)
        return None

    def _put(self, parts: dict[int, NDArray[Any]], entry: _Entry, values: NDArray[Any]) -> None:
        """Put the values of a grid's cells into the runs that they belong to, where none are there."""
        topology = entry.topology
        if entry.rows is not None:
            topology = self.entries[0].topology
            whole = _none_like(values, topology.cells)
            whole[entry.rows] = values
            values = whole
        for number, run in enumerate(topology.runs, entry.first):
            parts.setdefault(number, values[run.rows])

    def _filled(self, parts: Mapping[int, NDArray[Any]]) -> list[NDArray[Any]]:
        """Return an array for each run."""
        some = next(iter(parts.values()))
        alike = {i: values for i, values in parts.items() if values.shape[1:] == some.shape[1:]}
        return [alike.get(i, _none_like(some, len(run.rows))) for i, (_, run) in enumerate(self.runs)]

    def _sets(self, n: int) -> tuple[dict[str, Any], dict[str, Any]]:
        point_sets: dict[str, Any] = {}
        cell_sets: dict[str, Any] = {}
        for entry in self.entries:
            for one in entry.grid.sets:
                with suppress(ReadError):
                    rows = self.contents.read(item_of(self.tree, one))
                    if said(one, "SetType") == "node":
                        point_sets[_name(one)] = np.unique(rows[(rows >= 0) & (rows < n)])
                    elif said(one, "SetType") == "cell" and entry.rows is None:
                        mine = range(entry.first, entry.first + len(entry.topology.runs))
                        runs = (run.rows if i in mine else run.rows[:0] for i, (_, run) in enumerate(self.runs))
                        cell_sets[_name(one)] = [np.flatnonzero(np.isin(some, rows)) for some in runs]
        return point_sets, cell_sets

    def _untold(self) -> Iterator[str]:
        steps = sum(entry.grid.timed for entry in self.entries)
        if self.tree.comments:
            yield "comments"
        if steps > 1:
            yield f"{steps - 1} later steps in time"


def _several(grids: Sequence[Grid]) -> ReadError:
    names = list(dict.fromkeys(printable(grid.name) for grid in grids if grid.name))
    told = f" ({', '.join([*names[:3], *['...'] * (len(names) > 3)])})" if names else ""
    return ReadError(
        f"holds several grids with points of their own{told}, and one mesh is read: give each a file of its own"
    )


def _name(element: Element) -> str:
    return element.name or element.tag


def _of_cells(grid: Grid) -> list[Element]:
    return [one for one in grid.attributes if said(one, "Center") == "cell"]


def _none_like(values: NDArray[Any], count: int) -> NDArray[Any]:
    """Return for some cells what none of the values is."""
    if values.dtype.kind == "f":
        return np.full((count, *values.shape[1:]), np.nan, dtype=values.dtype)
    none = 0 if values.size == 0 or values.min() > 0 else values.max() + 1
    return np.full((count, *values.shape[1:]), none, dtype=values.dtype)


def _are_same(one: Topology, other: Topology) -> bool:
    """Whether two grids have the same cells."""
    kinds = [[(run.key, len(run.rows)) for run in topology.runs] for topology in (one, other)]
    return kinds[0] == kinds[1] and one.base == other.base and np.array_equal(one.values, other.values)


def _rows_in(mesh: Topology, some: Topology) -> NDArray[np.int64] | None:
    """Return which cells (k,) of a mesh those of another grid are; None: not all are there."""
    found = np.empty(some.cells, dtype=np.int64)
    for run in some.runs:
        alike = [one for one in mesh.runs if one.key == run.key and not isinstance(one.at, list)]
        if len(alike) != 1 or isinstance(run.at, list) or alike[0].at.shape[1] != run.at.shape[1]:
            return None
        all_cells, cells = np.sort(mesh.vertices(alike[0]), axis=1), np.sort(some.vertices(run), axis=1)
        factors = np.random.default_rng(0).integers(1, 2**63, cells.shape[1], dtype=np.uint64)
        keys, wanted = ((rows.astype(np.uint64) * factors).sum(axis=1) for rows in (all_cells, cells))
        order = np.argsort(keys)
        at = order[np.minimum(np.searchsorted(keys[order], wanted), len(order) - 1)] if len(order) else order
        if len(at) != len(cells) or (all_cells[at] != cells).any():
            return None
        found[run.rows] = alike[0].rows[at]
    return found


def _ascending(cells: Sequence[Cells]) -> bool:
    """Whether cells are numbered with no regard to their orientation: FEniCS's have ascending vertices."""
    simplices = [run.vertices for run in cells if run.type in (one.key for one in SIMPLICES.values())]
    return len(simplices) > 0 and all((np.diff(vertices, axis=1) > 0).all() for vertices in simplices)
