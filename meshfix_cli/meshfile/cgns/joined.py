"""Which points of zones are the same, and a layout in which each of them is written wherever it stands.

Interfaces tell it where the file has them; else points on the boundaries of zones are one that have exactly equal
coordinates. What an interface joins at different places, as one with a period, is two points, which are held.

Source: CGNS, "Standard Interface Data Structures", section 8.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import hdf5
from meshfix_cli.meshfile.cgns.sets import location, named_points
from meshfix_cli.meshfile.cgns.types import Int64
from meshfix_cli.meshfile.cgns.zones import Zone, child, children, grid, integers, text
from meshfix_cli.meshfile.coincident import first_of_each_place
from meshfix_cli.meshfile.joining import Copies, by_place, joined
from meshfix_cli.meshfile.source import Cells, Layout
from meshfix_cli.meshfile.splice import Points, Turned, differing

NEAR = 1e-6  # of the size of the mesh: how far apart two files' numbers for one point may be


@dataclass(frozen=True, eq=False)
class Shared:
    """The layout of a file in which a point may stand several times.

    Attributes
    ----------
    layout : Layout
        That of all copies.
    copies : (k, d) float
        As they were read.
    rows : (k,) int64
        Which point of the mesh each is.
    """

    layout: Layout
    copies: Points
    rows: Int64

    def rounded(self, points: Points) -> Points:
        """Return points (n, d) as the file can hold them."""
        return self.layout.rounded(points)

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the file with other points (n, d), and with some cells turned."""
        moved = differing(original, points)[self.rows]
        return self.layout.rewritten(self.copies, np.where(moved, points[self.rows], self.copies), reversed_cells)


def join(zones: Sequence[Zone], points: Points, cells: Sequence[Cells]) -> tuple[tuple[Int64, Int64] | None, Int64]:
    """Find the points of the mesh.

    Parameters
    ----------
    points : (k, d) float
        Those of all zones, one zone after the other.
    cells : sequence of Cells
        With rows of these.

    Returns
    -------
    joined : pair of (k,) int64 and (n,) int64, or None
        The point of the mesh of each, and for each point of the mesh the first of its copies. None: there are no
        copies.
    paired : int64
        Those of all zones that an interface joins to others elsewhere.
    """
    starts = np.cumsum([0, *(zone.points for zone in zones)]).tolist()
    found = [pair for i in range(len(zones)) for pair in _interfaces(zones, starts, i, points)]
    told = [pair.near for pair in found if pair is not None]
    known = 0 < len(told) == len(found)
    paired = np.concatenate([np.empty(0, np.int64), *(pair.apart.ravel() for pair in found if pair is not None)])
    for zone, start in zip(zones, starts, strict=False):
        if zone.structured:
            mine = points[start : start + zone.points].astype(np.float64)
            told.append(start + (_poles if known else _cuts)(zone.shape, mine))
    labels = _united(np.concatenate([np.empty((2, 0), np.int64), *told], axis=1), len(points))
    if len(zones) > 1 and not known:
        labels = _at_one_place(zones, points, cells, labels)
    if (labels == np.arange(len(points))).all():
        return None, paired
    used = np.zeros(len(points), dtype=bool)
    for run in cells:
        used[run.vertices] = True
    return joined(labels, used), paired


def _united(pairs: Int64, n: int) -> Int64:
    """Return labels (n,) that are equal where two points (2, k) are one."""
    if not pairs.size:
        return np.arange(n)
    graph = coo_matrix((np.ones(pairs.shape[1], dtype=bool), (pairs[0], pairs[1])), (n, n))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _rim(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Mark the points of a block that are on its boundary."""
    rim = np.ones(shape, dtype=bool)
    rim[tuple(slice(1, -1) for _ in shape)] = False
    return rim


def _cuts(shape: tuple[int, ...], points: NDArray[np.float64]) -> Int64:
    """Return pairs (2, k) of points on the boundary of a block that are at one place: at a cut or a pole."""
    first = first_of_each_place(points, np.flatnonzero(_rim(shape).ravel("F")))
    rows = np.flatnonzero(first != np.arange(len(first)))
    return np.stack([rows, first[rows]])


def _poles(shape: tuple[int, ...], points: NDArray[np.float64]) -> Int64:
    """Return pairs (2, k) of points on the boundary of a block that are neighbours and at one place."""
    rows, rim = np.arange(len(points)).reshape(shape, order="F"), _rim(shape)
    found = [np.empty((2, 0), dtype=np.int64)]
    for axis, size in enumerate(shape):
        here, next_ = (
            tuple(part if i == axis else slice(None) for i in range(len(shape)))
            for part in (slice(0, size - 1), slice(1, size))
        )
        pair = np.stack([rows[here][rim[here] & rim[next_]], rows[next_][rim[here] & rim[next_]]])
        found.append(pair[:, (points[pair[0]] == points[pair[1]]).all(axis=1)])
    return np.concatenate(found, axis=1)


def _at_one_place(zones: Sequence[Zone], points: Points, cells: Sequence[Cells], labels: Int64) -> Int64:
    """Return labels that are equal also where the boundaries of two zones have points with equal coordinates."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    rows = inverse.reshape(-1)
    piece = np.repeat(np.arange(len(zones)), [zone.points for zone in zones])[first]
    runs = [Cells(run.type, rows[run.vertices]) for run in cells]
    copies = Copies([f"its zone {zone.name!r}" for zone in zones], points[first], piece, runs)
    return by_place(copies)[rows]


class _Pairs(NamedTuple):
    """Points that an interface joins: those at one place (2, k), and others (2, a)."""

    near: Int64
    apart: Int64


def _interfaces(zones: Sequence[Zone], starts: Sequence[int], here: int, points: Points) -> Iterator[_Pairs | None]:
    """Give what the interfaces of a zone join; None: one names no points."""
    names = {zone.name: i for i, zone in enumerate(zones)}
    size = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    for table in children(zones[here].group, "ZoneGridConnectivity_t").values():
        found = {**children(table, "GridConnectivity1to1_t"), **children(table, "GridConnectivity_t")}
        for name, node in found.items():
            there = names.get(text(node).rpartition("/")[2])
            if there is None:
                continue
            periodic = _is_periodic(node)
            if periodic and location(node) != "Vertex":  # the other side has an interface of its own
                faces = named_points(zones[here], node, name) + starts[here]
                yield _Pairs(np.empty((2, 0), dtype=np.int64), np.stack([faces, faces]))
                continue
            rows = _matching(zones[here], zones[there], node, name)
            if rows is None:
                yield None
                continue
            pair = np.stack([rows[0] + starts[here], rows[1] + starts[there]])
            far = np.abs(points[pair[0]].astype(np.float64) - points[pair[1]]).max(axis=1, initial=0.0)
            near = (far <= NEAR * size) & (not periodic)
            yield _Pairs(pair[:, near], pair[:, ~near])


def _is_periodic(node: Any) -> bool:
    property_ = child(node, "GridConnectivityProperty_t")
    return property_ is not None and bool(children(property_, "Periodic_t"))


def _matching(zone: Zone, donor: Zone, node: Any, name: str) -> Int64 | None:
    """Return the rows (2, k) of the points of an interface and of those of the other zone; None: it names no points."""
    if hdf5.attribute(node, "label") == "GridConnectivity1to1_t":
        mine = integers(child(node, "IndexRange_t", "PointRange"))
        theirs = integers(child(node, "IndexRange_t", "PointRangeDonor"))
        transform = integers(hdf5.group(node, "Transform")).ravel()
        return _of_ranges(zone, donor, mine, theirs, transform, name)
    kind = text(child(node, "GridConnectivityType_t")) or "Overset"
    if kind != "Abutting1to1":  # points of the one zone are within cells of the other
        return np.empty((2, 0), dtype=np.int64)
    if location(node) != "Vertex":
        return None
    ours = _listed(zone, integers(child(node, "IndexArray_t", "PointList")))
    others = _listed(donor, integers(child(node, "IndexArray_t", "PointListDonor")))
    if len(ours) != len(others):
        raise ReadError(f"is not a readable cgns file: its interface {name!r} has points without donors")
    return np.stack([ours, others])


def _listed(zone: Zone, indices: Int64) -> Int64:
    return zone.rows(indices.reshape(-1, len(zone.shape)) - 1)


def _of_ranges(zone: Zone, donor: Zone, mine: Int64, theirs: Int64, transform: Int64, name: str) -> Int64:
    """Return the rows (2, k) of points in a range of indices and of those in the other zone."""
    d = len(zone.shape)
    transform = transform if transform.size else np.arange(1, d + 1)
    fits = mine.shape == theirs.shape == (2, d) and len(donor.shape) == d
    if not fits or sorted(np.abs(transform).tolist()) != list(range(1, d + 1)):
        raise ReadError(f"is not a readable cgns file: its interface {name!r} has no matching ranges")
    low, high = mine.min(axis=0), mine.max(axis=0)
    if (low < 1).any() or (high > zone.shape).any():
        raise ReadError(f"is not a readable cgns file: its interface {name!r} is not within its zone")
    indices = grid(low, high)
    others = np.empty_like(indices)
    others[:, np.abs(transform) - 1] = theirs[0, np.abs(transform) - 1] + np.sign(transform) * (indices - mine[0])
    inside = ((others >= 1) & (others <= donor.shape)).all(axis=1)
    return np.stack([zone.rows(indices[inside] - 1), donor.rows(others[inside] - 1)])
