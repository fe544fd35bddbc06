"""The zones of a CGNS file: points, and cells of sections or of a block of points.

A node of the tree is a group with attributes and with a data set called " data", in which the order of the axes is that
of Fortran turned round: the first index is the last there.

Source: CGNS, "Standard Interface Data Structures", sections 6.3 and 7; "SIDS-to-HDF5 File Mapping".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import hdf5
from meshfix_cli.meshfile.blocks import BLOCK, cells_of_block
from meshfix_cli.meshfile.cgns.types import MIXED, ORDER, Int64, runs, type_of
from meshfix_cli.meshfile.hdf5 import Table

AXES = ("CoordinateX", "CoordinateY", "CoordinateZ")
_DATA = " data"


@dataclass(frozen=True, eq=False)
class Run:
    """Cells of one type.

    Attributes
    ----------
    type : str
    section : str
        The name of the section; empty: of a block of points.
    vertices : (m, k) int64
        Rows of the zone's points.
    ids : (m,) int64
        The numbers that the zone gives to its cells.
    corners : callable or None
        Gives where the vertices stand in the file; None: nowhere.
    """

    type: str
    section: str
    vertices: Int64
    ids: Int64
    corners: Callable[[], Table] | None


@dataclass(frozen=True, eq=False)
class Zone:
    """A part of a mesh with points and cells of its own.

    Attributes
    ----------
    name : str
    group : group of HDF5
        While the file is open.
    shape : tuple of int
        How many points it has along each index; of an unstructured zone one number.
    structured : bool
    sets : sequence of str
        The paths of the data sets of its coordinates.
    runs : sequence of Run
    family : str
    """

    name: str
    group: Any
    shape: tuple[int, ...]
    structured: bool
    sets: Sequence[str]
    runs: Sequence[Run]
    family: str

    @property
    def points(self) -> int:
        """How many it has."""
        return int(np.prod(self.shape))

    def rows(self, indices: Int64) -> Int64:
        """Return the rows of points by their indices (k, i) from 0; those behind the ends are left out."""
        inside = ((indices >= 0) & (indices < self.shape)).all(axis=1)
        return np.ravel_multi_index(tuple(indices[inside].T), self.shape, order="F").astype(np.int64)


def grid(low: Int64, high: Int64) -> Int64:
    """Return all indices (k, i) from some to others."""
    axes = [np.arange(first, last + 1) for first, last in zip(low.tolist(), high.tolist(), strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def children(parent: Any, label: str) -> dict[str, Any]:
    """Return the nodes below another that have a label, by their names; links lead to what they stand for."""
    found = {}
    for name, one in hdf5.groups(parent).items():
        node = hdf5.group(one, " link") if hdf5.attribute(one, "type") == "LK" else one
        if node is not None and hdf5.attribute(node, "label") == label:
            found[name] = node
    return found


def child(parent: Any, label: str, name: str = "") -> Any:
    """Return the first node of a label, or that of a name, below another; None: there is none."""
    found = children(parent, label)
    return found.get(name) if name else next(iter(found.values()), None)


def integers(node: Any) -> NDArray[Any]:
    """Return the integers of a node; none where it has none."""
    found = None if node is None else hdf5.data_set(node, _DATA)
    return np.empty(0, np.int64) if found is None else hdf5.numbers(found, "iu").astype(np.int64)


def text(node: Any) -> str:
    """Return the text of a node; empty: it has none."""
    return integers(node).astype(np.uint8).tobytes().decode("utf-8", "replace").strip("\0 ")


def read(name: str, group: Any) -> Zone | None:
    """Read a zone; None: it has no coordinates."""
    grid = child(group, "GridCoordinates_t", "GridCoordinates") or child(group, "GridCoordinates_t")
    if grid is None:
        return None
    sizes = integers(group)
    kind = text(child(group, "ZoneType_t")) or "Structured"
    structured = kind == "Structured"
    if sizes.ndim != 2 or len(sizes) < 2 or (sizes < 0).any() or (not structured and sizes.shape[1] != 1):
        raise ReadError(f"is not a readable cgns file: the size of its zone {name!r} is not one")
    shape = tuple(int(size) for size in sizes[0])
    sets = _coordinates(name, grid, shape)
    cells = _block(shape) if structured else list(_sections(group, shape[0]))
    return Zone(name, group, shape, structured, sets, cells, text(child(group, "FamilyName_t")))


def _coordinates(name: str, grid: Any, shape: tuple[int, ...]) -> list[str]:
    """Return the paths of the data sets of a zone's coordinates."""
    found = children(grid, "DataArray_t")
    sets = [hdf5.data_set(found[axis], _DATA) for axis in AXES if axis in found]
    others = [axis for axis in found if axis.startswith("Coordinate") and axis not in AXES]  # around an axis
    if len(sets) < 2 or others or any(one is None for one in sets):
        there = ", ".join(found) or "none"
        raise ReadError(f"has no Cartesian coordinates in its zone {name!r} (found: {there})")
    for one in sets:
        if one.size != np.prod([float(size) for size in shape]):
            raise ReadError(f"has {one.size:,} coordinates in its zone {name!r}, which are not as many as its points")
    return [one.name for one in sets]


def _block(shape: tuple[int, ...]) -> list[Run]:
    """Return the cells between the points of a block."""
    if len(shape) not in BLOCK:
        raise ReadError(f"is not a readable cgns file: a zone has {len(shape)} indices")
    key, vertices = cells_of_block(shape)
    return [Run(key, "", vertices, np.arange(1, len(vertices) + 1), None)]


def _sections(group: Any, points: int) -> Iterator[Run]:
    """Read the sections in the order of their elements."""
    found = children(group, "Elements_t").items()
    for name, section in sorted(found, key=lambda one: int(_range(one[1]).min(initial=0))):
        kind, bounds = integers(section).ravel(), _range(section)
        if kind.size < 1 or bounds.size != 2:
            raise ReadError(f"is not a readable cgns file: its section {name!r} has no type or no range")
        yield from _section(name, int(kind[0]), bounds.tolist(), section, points)


def _range(section: Any) -> Int64:
    return integers(child(section, "IndexRange_t", "ElementRange")).ravel()


def _section(name: str, number: int, bounds: Sequence[int], section: Any, points: int) -> Iterator[Run]:
    data = child(section, "DataArray_t", "ElementConnectivity")
    nodes = integers(data).ravel()
    if number == MIXED:
        parts = list(runs(nodes, name))
    else:
        key, size = type_of(number, name)
        count = -(-len(nodes) // size)
        parts = [(key, np.arange(count), np.arange(count * size).reshape(count, size))]
    if sum(at.size for _, _, at in parts) > len(nodes) or _count(parts) != bounds[1] - bounds[0] + 1:
        raise ReadError(f"is truncated: its section {name!r} does not have the elements of its range")
    for key, rows, places in parts:
        at = places[:, ORDER[key]] if key in ORDER else places
        vertices = nodes[at] - 1
        outside = ((vertices < 0) | (vertices >= points)).any(axis=1)
        if outside.any():
            element = bounds[0] + rows[outside][0]
            raise ReadError(f"the element {element} has a vertex that is not in its zone")
        yield Run(key, name, vertices, bounds[0] + rows, partial(Table, [hdf5.data_set(data, _DATA).name], at))


def _count(parts: Sequence[tuple[str, Int64, Int64]]) -> int:
    return sum(len(rows) for _, rows, _ in parts)
