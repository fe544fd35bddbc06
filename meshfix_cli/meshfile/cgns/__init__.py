"""CGNS files: zones of points, whose coordinates stand each in a data set of HDF5, and of cells.

Zones are blocks of points, in which the cells are between them, or have sections of elements. Those of one mesh are
joined where the file says so, or where their boundaries have the same coordinates; each copy of a point is written.

Source: CGNS, "Standard Interface Data Structures", and "SIDS-to-HDF5 File Mapping".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile import hdf5
from meshfix_cli.meshfile.cgns import zones as of_zones
from meshfix_cli.meshfile.cgns.joined import Shared, join
from meshfix_cli.meshfile.cgns.sets import FAMILY, arrays
from meshfix_cli.meshfile.cgns.types import Int64
from meshfix_cli.meshfile.cgns.zones import Run, Zone, children
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.source import Arrays, Cells, Source

ADF = b"ADF Database Version"


def parse(data: bytes) -> Source | None:
    """Read the zones of the one base that has cells; None: the tree has no labels, as meshio writes it."""
    if data[4:24] == ADF:
        raise ReadError("is a file of CGNS in ADF, which meshfix does not read: adf2hdf makes it one of HDF5")
    with hdf5.opened(data, "cgns") as root:
        if "CGNSLibraryVersion" not in root:
            return None
        zones = _zones(root)
        table = _coordinates(zones)
        copies = table.read(root)
        starts = np.cumsum([0, *(zone.points for zone in zones)]).tolist()
        runs = [(run, start) for zone, start in zip(zones, starts, strict=False) for run in zone.runs]
        cells = [_cells(run, start, len(zones) == 1) for run, start in runs]
        layout = hdf5.layout(root, data, "cgns", table, [run.corners or _nowhere for run, _ in runs])
        shared, paired = join(zones, copies, cells)
        rows = np.arange(len(copies)) if shared is None else shared[0]
        found = arrays(zones, rows)
        untold = tuple(_untold(zones))
    points = copies
    if shared is not None:
        points = copies[shared[1]]
        cells = [Cells(run.type, rows[run.vertices], run.ids) for run in cells]
        layout = Shared(layout, copies, rows)
    return Source(
        points,
        cells,
        layout,
        lambda: found,
        (FAMILY,) if FAMILY in found.cell else (),
        held=_held(found, len(points), rows[paired]),
        untold=untold,
        notes=tuple(_notes(zones, rows, len(points))),
        oriented=not any(zone.structured for zone in zones),  # in blocks the indices may run either way
    )


def _zones(root: Any) -> list[Zone]:
    """Read the zones of the base that has some with cells; ReadError where there are several."""
    found: dict[str, list[Zone]] = {}
    for base, group in children(root, "CGNSBase_t").items():
        zones = [of_zones.read(name, zone) for name, zone in children(group, "Zone_t").items()]
        there = [zone for zone in zones if zone is not None]
        if any(len(run.ids) for zone in there for run in zone.runs):
            found[base] = there
    if not found:
        raise ReadError("holds no zone with coordinates and cells")
    if len(found) > 1:
        raise ReadError(f"holds several bases ({', '.join(found)}), and one mesh is read: give each a file of its own")
    return next(iter(found.values()))


def _coordinates(zones: Sequence[Zone]) -> Table:
    """Return where the coordinates of all zones stand."""
    axes = len(zones[0].sets)
    for zone in zones:
        if len(zone.sets) != axes:
            raise ReadError(f"has zones with {axes} and with {len(zone.sets)} coordinates")
    sets: list[str] = []
    at, start = [], 0
    for zone in zones:
        sets += zone.sets
        at.append(start + np.arange(zone.points * axes).reshape(axes, zone.points).T)
        start += zone.points * axes
    return Table(sets, np.concatenate(at))


def _cells(run: Run, start: int, alone: bool) -> Cells:
    """Return cells with rows of the points of all zones; numbers of zones tell which they are where there is one."""
    return Cells(run.type, run.vertices + start, run.ids if alone else None)


def _nowhere() -> Table:
    raise ReadError("has cells between the points of a block, which cannot be renumbered")


def _held(found: Arrays, points: int, paired: Int64) -> NDArray[np.bool_]:
    """Mark the points of boundary conditions: they are on no boundary where a baffle's two sides are joined.

    So are those that have a partner, as where the mesh is periodic.
    """
    held = np.zeros(points, dtype=bool)
    held[paired] = True
    for rows in found.point_sets.values():
        held[rows] = True
    return held


def _notes(zones: Sequence[Zone], rows: Int64, points: int) -> Iterator[str]:
    if points < len(rows):
        common = int((np.bincount(rows) > 1).sum())
        joined = counted(common, "common point", "common points")
        yield f"joined {f'{len(zones):,} zones' if len(zones) > 1 else 'a zone to itself'} at {joined}"


def _untold(zones: Sequence[Zone]) -> Iterator[str]:
    """What the file holds that no other would."""
    for label, what in (("FlowSolution_t", "solutions"), ("GridCoordinates_t", "coordinates")):
        names = {name: None for zone in zones for name in children(zone.group, label) if name != "GridCoordinates"}
        if names:
            yield f"{what} {', '.join(dict.fromkeys(re.sub(r'[0-9]+', '', name) for name in names))}"
